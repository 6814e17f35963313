"""Which robot holds a cell: `traffic.holder`, for strategies that look robots up by cell.

It is entered right before a layer whose strategy says `holders = True` is asked, from what that
strategy sees, and removed after: nobody else pays for it, and nothing of it outlasts a decision.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.motion import U, direction_between
from automaton.world.state import NIL


@kernel
def enter_holders(seen):
    """Enter every robot at the cells, or lanes of cells for two, that it holds."""
    for i in range(seen.robots.cell.shape[0]):
        mark_held(seen, i, seen.robots.identity[U(i)])


@kernel
def remove_holders(seen):
    """Undo `enter_holders`; no robot has moved since."""
    for i in range(seen.robots.cell.shape[0]):
        mark_held(seen, i, NIL)


@kernel
def mark_held(seen, i, value):
    """Enter a value at all that robot i holds; a robot that turns between two lanes holds both."""
    robots = seen.robots
    cell = np.int64(robots.cell[U(i)])
    if cell == NIL:
        return
    claim, travel = np.int64(robots.claim[U(i)]), np.int64(robots.travel[U(i)])
    mark_cell(seen, cell, travel, value)
    if claim == cell:
        mark_cell(seen, cell, travel ^ 2, value)
    elif claim != NIL:
        mark_cell(seen, claim, direction_between(seen.grid, cell, claim), value)


@kernel
def mark_cell(seen, cell, direction, value):
    lane = lane_of(np.int64(seen.grid.rule[U(cell)]), direction)
    if lane != NIL:
        seen.traffic.holder[U(cell), U(lane)] = value


@kernel
def lane_of(rule, direction):
    """The column of `holder`, by a cell's rule, for a robot that travels in `direction`.

    NIL in a cell without limit.
    """
    capacity = (rule >> 5) & 3
    if capacity == 0:
        return NIL
    return direction >> 1 if capacity == 2 else 0
