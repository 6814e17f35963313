"""Orders that are released in the course of a run."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import request_zoning
from automaton.engine.random_numbers import STREAM_RELEASES, random_bits
from automaton.engine.state import (
    CLOCK_KNOWN_ORDERS,
    CLOCK_NEXT_RELEASE,
    CLOCK_REVISION,
    CLOCK_TICK,
    CLOCK_UNDELIVERED,
    NIL,
    ORDER_WAITING,
)


@kernel
def release_orders(world):
    """Orders whose tick has come are known from now on; in a closed loop one for each delivered.

    Where they are dealt out, each robot's next one is, once it has done the one before.
    """
    orders, clock = world.orders, world.clock
    while clock[CLOCK_NEXT_RELEASE] < orders.release_sequence.shape[0]:
        order = np.int64(orders.release_sequence[clock[CLOCK_NEXT_RELEASE]])
        if order == NIL:
            return
        if world.rules.in_system:
            delivered = orders.release_sequence.shape[0] - clock[CLOCK_UNDELIVERED]
            if clock[CLOCK_NEXT_RELEASE] - delivered >= world.rules.in_system:
                return
            orders.release_tick[order] = clock[CLOCK_TICK]
        elif orders.release_tick[order] > clock[CLOCK_TICK]:
            return
        orders.state[order] = ORDER_WAITING
        clock[CLOCK_KNOWN_ORDERS] = max(clock[CLOCK_KNOWN_ORDERS], order + 1)
        clock[CLOCK_NEXT_RELEASE] += 1
        clock[CLOCK_REVISION] += 1
        request_zoning(world)


@kernel
def draw_releases(out, chance, seed, last):
    """out[k] = tick of order k: each tick after the one before has `chance` of 2**32 to be it.

    Those that would come after tick `last` stand at it.
    """
    tick = 0
    for k in range(1, out.shape[0]):
        tick = min(tick + 1, last)
        while (
            tick < last
            and np.int64(random_bits(seed, STREAM_RELEASES, tick, 0) >> np.uint64(32)) >= chance
        ):
            tick += 1
        out[k] = tick
