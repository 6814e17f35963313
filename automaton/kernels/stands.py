"""From which cell a robot picks up and sets down, as the shipped allocations have it.

A load is picked up from the right of its shelf where the floor allows it (the table-top robots stand
at (x + 1, y)), and set down from the left: so loads travel to the right. Whoever foresees where a
robot will go reckons with the same cells.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.world.state import NIL

FROM_RIGHT_FIRST = (0, 2, 1, 3)  # neighbours E, W, S, N of the slot
FROM_LEFT_FIRST = (2, 0, 3, 1)


@kernel
def pick_stand(view, slot):
    """The cell from which a load is picked up, NIL if there is none."""
    for direction in FROM_RIGHT_FIRST:
        if view.slots.access[slot, direction] != NIL:
            return np.int64(view.slots.access[slot, direction])
    return np.int64(NIL)


@kernel
def drop_stand(view, slot):
    """The cell from which a load is set down, NIL if there is none."""
    for direction in FROM_LEFT_FIRST:
        if view.slots.access[slot, direction] != NIL:
            return np.int64(view.slots.access[slot, direction])
    return np.int64(NIL)
