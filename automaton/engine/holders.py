"""Which robot holds a cell: `traffic.holder`, for strategies that look robots up by cell.

It is entered right before a layer whose strategy says `holders = True` is asked, from what that
strategy sees, and removed after: no other robot pays for it, and nothing of it outlasts a decision.
"""

from typing import Any

import numpy as np

from automaton.engine.jit.kernel import U, kernel
from automaton.engine.jit.struct_types import clear_bytes, copy_bytes
from automaton.engine.jit.structs import Struct
from automaton.engine.motion import direction_between
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


# What one robot remembers: under a radius a strategy sees its robot's rows of the state alone.
#
# Its state exists twice then: in full, and as the strategy is shown it, which is zero but for the
# rows of the robot that it is asked about. The loop knows no strategy's types, and moves bytes.


ROW_FULL = 0  # columns of memory.rows: address of a per-robot field in full; 0 for other fields
ROW_SHOWN = 1  # its address as shown
ROW_BYTES = 2  # of a robot's row; of the whole field unless it is per robot
NO_STATE_ROWS = np.zeros((0, 3), np.int64)  # without a radius


def state_rows(full: Struct, shown: Struct) -> Any:
    """(f, 3) int64: the rows of a memory that has this state, in full and as shown."""
    rows = []
    for (_, declared, array), (_, _, other) in zip(full.arrays(), shown.arrays(), strict=True):
        if not declared.is_kept or not array.nbytes:
            continue
        addresses = [one.__array_interface__["data"][0] for one in (array, other)]
        if declared.is_per_robot:
            rows.append((*addresses, array.nbytes // len(array)))
        else:
            rows.append((0, addresses[1], array.nbytes))
    return np.array(rows, np.int64).reshape(len(rows), 3)


@kernel
def show_rows(rows, i):
    """Show a strategy what robot i remembers."""
    for k in range(rows.shape[0]):
        size = rows[k, ROW_BYTES]
        if rows[k, ROW_FULL]:
            copy_bytes(rows[k, ROW_SHOWN] + i * size, rows[k, ROW_FULL] + i * size, size)


@kernel
def keep_rows(rows, i):
    """Keep what robot i remembers now, and show nothing any more."""
    for k in range(rows.shape[0]):
        shown, size = rows[k, ROW_SHOWN], rows[k, ROW_BYTES]
        if rows[k, ROW_FULL]:
            shown += i * size
            copy_bytes(rows[k, ROW_FULL] + i * size, shown, size)
        clear_bytes(shown, size)
