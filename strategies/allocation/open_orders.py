"""Which orders a robot may take."""

import numpy as np

from automaton.engine.state import NIL, ORDER_WAITING
from automaton.strategy.kernels import can_do, kernel

LEAST_PRIORITY = -(1 << 15)  # below that of any order


@kernel
def is_open(view, out, order):
    """Whether an order waits, unreserved, and no earlier decision of this batch took it."""
    return (
        view.orders.state[order] == ORDER_WAITING
        and view.orders.reserved_by[order] == NIL
        and out.order_taken[order] == 0
    )


@kernel
def highest_priority(view, out, i):
    """The highest priority of the open orders that robot i can do."""
    highest = LEAST_PRIORITY
    if view.rules.priorities.shape[0] == 1:
        return highest
    for order in range(view.orders.state.shape[0]):
        priority = np.int64(view.orders.priority[order])
        if priority > highest and is_open(view, out, order) and can_do(view, i, order):
            highest = priority
    return highest
