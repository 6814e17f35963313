"""Which orders a robot may take, and how it takes one."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import (
    CLOCK_FIRST_OPEN,
    CLOCK_KNOWN_ORDERS,
    CMD_TAKE_ORDER,
    NIL,
    ORDER_WAITING,
)
from automaton.engine.trips import has_place
from automaton.strategy.access_cells import begin_cell, can_do, position

LEAST_PRIORITY = -(1 << 15)  # below that of any order


@kernel
def is_open(view, out, i, order):
    """Whether an order waits for robot i, and no earlier decision of this batch took it.

    It is reserved for no robot, or as a trip for the one beneath its pod; and its station lets one come.
    """
    if view.orders.state[order] != ORDER_WAITING or out.order_taken[order]:
        return False
    owner = view.orders.reserved_by[order]
    if view.trips.pod.shape[0] == 0:
        return owner == NIL
    is_offered = view.trips.offered[view.robots.identity[i]] == order
    return (owner == NIL or is_offered) and has_place(view, order)


@kernel
def highest_priority(view, out, i):
    """The highest priority of the open orders that robot i can do."""
    highest = LEAST_PRIORITY
    if view.rules.priorities.shape[0] == 1:
        return highest
    for order in range(view.clock[CLOCK_FIRST_OPEN], view.clock[CLOCK_KNOWN_ORDERS]):
        priority = np.int64(view.orders.priority[order])
        if priority > highest and is_open(view, out, i, order) and can_do(view, i, order):
            highest = priority
    return highest


@kernel
def take_order(view, out, k, i, order):
    """Decision k of the batch: robot i takes this order and drives to where it begins."""
    out.command[k] = CMD_TAKE_ORDER
    out.order[k] = order
    out.goal_cell[k] = begin_cell(view, view.robots.type[i], order, position(view, i))
    out.order_taken[order] = 1
