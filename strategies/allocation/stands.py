"""From which cell a robot picks up and sets down, and which columns of a floor are alleys.

A load is picked up from the right of its shelf where the floor allows it (the table-top robots stand
at (x + 1, y)), and set down from the left: so loads travel to the right.
"""

import numpy as np

from automaton.strategy.kernels import kernel
from automaton.world.state import NIL, WAITING

FROM_RIGHT_FIRST = (0, 2, 1, 3)  # neighbours E, W, S, N of the slot
FROM_LEFT_FIRST = (2, 0, 3, 1)


@kernel
def pick_stand(view, slot):
    """The cell from which a load is picked up."""
    for direction in FROM_RIGHT_FIRST:
        if view.slots.access[slot, direction] != NIL:
            return np.int64(view.slots.access[slot, direction])
    return NIL


@kernel
def drop_stand(view, slot):
    """The cell from which a load is set down."""
    for direction in FROM_LEFT_FIRST:
        if view.slots.access[slot, direction] != NIL:
            return np.int64(view.slots.access[slot, direction])
    return NIL


@kernel
def is_open(view, given, order):
    """Whether an order waits, unreserved, and no earlier answer of this batch took it."""
    return (
        view.orders.state[order] == WAITING
        and view.orders.by[order] == NIL
        and given.order_taken[order] == 0
    )
