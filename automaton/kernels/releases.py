"""Orders that become known in the course of a run."""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import RELEASES, draw
from automaton.kernels.news import tell_zoning
from automaton.world.state import CHANGES, NEXT_ORDER, NIL, TICK, UNDELIVERED, WAITING


@kernel
def release_orders(world):
    """Orders whose tick has come are known from now on; in a closed loop one for each delivered."""
    orders, clock = world.orders, world.clock
    while clock[NEXT_ORDER] < orders.coming.shape[0]:
        order = np.int64(orders.coming[clock[NEXT_ORDER]])
        if order == NIL:
            return
        if world.rules.in_system:
            delivered = orders.coming.shape[0] - clock[UNDELIVERED]
            if clock[NEXT_ORDER] - delivered >= world.rules.in_system:
                return
            orders.released[order] = clock[TICK]
        elif orders.released[order] > clock[TICK]:
            return
        orders.state[order] = WAITING
        clock[NEXT_ORDER] += 1
        clock[CHANGES] += 1
        tell_zoning(world)


@kernel
def draw_releases(out, chance, seed, last):
    """out[k] = tick of order k: each tick after the one before has `chance` of 2**32 to be it.

    Those that would come after tick `last` stand at it.
    """
    tick = 0
    for k in range(1, out.shape[0]):
        tick = min(tick + 1, last)
        while tick < last and np.int64(draw(seed, RELEASES, tick, 0) >> np.uint64(32)) >= chance:
            tick += 1
        out[k] = tick
