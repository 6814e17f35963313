"""From which cell a robot picks up and drops, as the shipped allocations have it.

A load is picked up from the right of its shelf where the floor allows it (the table-top robots stand
at (x + 1, y)), and dropped from the left: so loads travel to the right. Whatever predicts where a
robot will go reckons with the same cells.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.world.state import NIL

FROM_RIGHT_FIRST = (0, 2, 1, 3)  # neighbours E, W, S, N of the slot
FROM_LEFT_FIRST = (2, 0, 3, 1)


@kernel
def pickup_cell(view, robot_type, slot):
    """The cell from which robots of a type pick a load up, NIL if there is none."""
    one = view.slots.reachable.shape[0] == 1  # then access holds only what it gets to
    for direction in FROM_RIGHT_FIRST:
        cell = np.int64(view.slots.access[slot, direction])
        if cell != NIL and (one or view.slots.reachable[robot_type, cell]):
            return cell
    return np.int64(NIL)


@kernel
def dropoff_cell(view, robot_type, slot):
    """The cell from which robots of a type drop a load, NIL if there is none."""
    one = view.slots.reachable.shape[0] == 1
    for direction in FROM_LEFT_FIRST:
        cell = np.int64(view.slots.access[slot, direction])
        if cell != NIL and (one or view.slots.reachable[robot_type, cell]):
            return cell
    return np.int64(NIL)


@kernel
def can_bring(view, robot_type, order, slot):
    """Whether robots of a type carry an order, and get to where it lies and to a slot with it."""
    if view.orders.weight[order] > view.rules.payload[robot_type]:
        return False
    accessible = view.slots.accessible
    if accessible.shape[0] == 1:
        return True  # there are no orders but for slots that a robot serves
    return (
        accessible[robot_type, view.orders.current_slot[order]] != 0
        and accessible[robot_type, slot] != 0
    )


@kernel
def can_do(view, i, order):
    """Whether robot i carries an order, and gets to where it lies and to its target."""
    robot_type = np.int64(view.robots.type[i])
    return can_bring(view, robot_type, order, np.int64(view.orders.target[order]))
