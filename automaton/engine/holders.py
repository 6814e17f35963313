"""Which robot holds a cell: `traffic.holder`, for strategies that look robots up by cell.

It is entered right before a layer whose strategy says `holders = True` is asked, from what that
strategy sees, and removed after: no other robot pays for it, and nothing of it outlasts a decision.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.motion import U, direction_between
from automaton.engine.state import FOLLOWING_CONVOY, NIL


@kernel
def enter_holders(visible_world):
    """Enter every robot at the cells, or lanes of cells for two, that it holds.

    Under convoy a robot may come into a cell that another one is still leaving: the first is entered.
    """
    robots = visible_world.robots
    for i in range(robots.cell.shape[0]):
        mark_held(visible_world, i, robots.identity[U(i)])
    if visible_world.rules.following == FOLLOWING_CONVOY:
        for i in range(robots.cell.shape[0]):
            if robots.cell[U(i)] != NIL and robots.claim[U(i)] != NIL:
                mark_claim(visible_world, i, robots.identity[U(i)])


@kernel
def remove_holders(visible_world):
    """Undo `enter_holders`; no robot has moved since."""
    for i in range(visible_world.robots.cell.shape[0]):
        mark_held(visible_world, i, NIL)


@kernel
def mark_held(visible_world, i, value):
    """Enter a value at all that robot i holds; a robot that turns between two lanes holds both."""
    robots = visible_world.robots
    cell = np.int64(robots.cell[U(i)])
    if cell == NIL:
        return
    mark_cell(visible_world, cell, np.int64(robots.travel[U(i)]), value)
    if robots.claim[U(i)] != NIL:
        mark_claim(visible_world, i, value)


@kernel
def mark_claim(visible_world, i, value):
    """Enter a value at what robot i claims: the cell that it enters, or the lane to which it turns."""
    robots = visible_world.robots
    cell, claim = np.int64(robots.cell[U(i)]), np.int64(robots.claim[U(i)])
    if claim == cell:
        mark_cell(visible_world, cell, np.int64(robots.travel[U(i)]) ^ 2, value)
    else:
        mark_cell(visible_world, claim, direction_between(visible_world.grid, cell, claim), value)


@kernel
def mark_cell(visible_world, cell, direction, value):
    lane = lane_of(np.int64(visible_world.grid.cell_flags[U(cell)]), direction)
    if lane != NIL:
        visible_world.traffic.holder[U(cell), U(lane)] = value


@kernel
def lane_of(cell_flags, direction):
    """The column of `holder`, by a cell's rule, for a robot that travels in `direction`.

    NIL in a cell without limit.
    """
    capacity = (cell_flags >> 5) & 3
    if capacity == 0:
        return NIL
    return direction >> 1 if capacity == 2 else 0
