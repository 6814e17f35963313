"""Orders of a list that carry pods: each waits for its turn, since a pod has one order at a time.

An order is known to strategies when its pod stands in storage without another one. Until then it waits
behind the others for the same pod, in the sequence of their releases; in the tick after the pod was
stored the next one is known, and begins where the pod stands then.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import (
    CLOCK_NEXT_RELEASE,
    CLOCK_REVISION,
    CLOCK_STORED_PODS,
    NIL,
    ORDER_UNRELEASED,
    ORDER_WAITING,
)
from automaton.engine.trips import offer


@kernel
def take_turns(world, record, first):
    """Orders of pods that were stored in the last tick are known, and those released in this one.

    `first`: the place of these in the sequence of releases.
    """
    clock, pods, orders = world.clock, world.pods, world.orders
    for k in range(clock[CLOCK_STORED_PODS]):
        pod = np.int64(pods.stored[k])
        order = np.int64(pods.first_line[pod])
        pods.first_line[pod] = world.trips.following[order]
        begin_turn(world, record, pod, order)
    clock[CLOCK_STORED_PODS] = 0
    for k in range(first, clock[CLOCK_NEXT_RELEASE]):
        order = np.int64(orders.release_sequence[k])
        pod = np.int64(world.trips.pod[order])
        if pod == NIL:
            continue
        if pods.trip[pod] == NIL:
            begin_turn(world, record, pod, order)
        else:
            await_turn(world, pod, order)


@kernel
def await_turn(world, pod, order):
    """An order waits, behind the others, until its pod has none."""
    pods, following = world.pods, world.trips.following
    world.orders.state[order] = ORDER_UNRELEASED
    following[order] = NIL
    if pods.first_line[pod] == NIL:
        pods.first_line[pod] = order
    else:
        following[pods.last_line[pod]] = order
    pods.last_line[pod] = order


@kernel
def begin_turn(world, record, pod, order):
    """The order of a pod that stands in storage may be taken; who stands beneath may have it."""
    orders, slot = world.orders, np.int64(world.pods.slot[pod])
    world.pods.trip[pod] = order
    orders.source[order] = slot
    orders.current_slot[order] = slot
    orders.state[order] = ORDER_WAITING
    world.clock[CLOCK_REVISION] += 1
    offer(world, record, order, np.int64(world.slots.cell[slot]))
