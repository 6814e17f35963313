"""Which robot holds a cell: `traffic.holder`, for strategies that look robots up by cell.

It is filled from what the strategy sees right before a strategy with `holders = True` is asked, and
cleared afterwards: other strategies pay nothing for it, and nothing persists between decisions.
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
    """Enter every robot in the cells, or lanes of two-lane cells, that it holds.

    Under convoy a robot may enter a cell that another one is still leaving: the entering robot
    counts.
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
    """Enter a value for each cell or lane that robot i holds; a robot that turns between two lanes
    holds both."""
    robots = visible_world.robots
    cell = np.int64(robots.cell[U(i)])
    if cell == NIL:
        return
    mark_cell(visible_world, cell, np.int64(robots.travel[U(i)]), value)
    if robots.claim[U(i)] != NIL:
        mark_claim(visible_world, i, value)


@kernel
def mark_claim(visible_world, i, value):
    """Enter a value for what robot i claims: the cell that it enters, or the lane to which it turns."""
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
    """The column of `holder` for a robot that travels in `direction`, by the capacity of the cell.

    NIL in a cell without limit.
    """
    capacity = (cell_flags >> 5) & 3
    if capacity == 0:
        return NIL
    return direction >> 1 if capacity == 2 else 0


# Per-robot memory: with a radius a strategy sees only its own robot's rows of the state.
#
# The state then exists twice: in full, and as the strategy sees it, with zeros except in the rows
# of the robot that it is asked about. The loop does not know the types of strategies; it copies
# bytes.


ROW_FULL = 0  # columns of memory.rows: address of a per-robot field in full; 0 for others
ROW_SHOWN = 1  # its address in the visible state
ROW_BYTES = 2  # bytes of a robot's row; of the whole field unless it is per robot
NO_STATE_ROWS = np.zeros((0, 3), np.int64)  # without a radius


def state_rows(full: Struct, shown: Struct) -> Any:
    """(f, 3) int64: the rows of a memory with this state, full and visible."""
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
    """Copy what robot i remembers to the visible state."""
    for k in range(rows.shape[0]):
        size = rows[k, ROW_BYTES]
        if rows[k, ROW_FULL]:
            copy_bytes(rows[k, ROW_SHOWN] + i * size, rows[k, ROW_FULL] + i * size, size)


@kernel
def keep_rows(rows, i):
    """Save what robot i remembers now, and clear the visible state."""
    for k in range(rows.shape[0]):
        shown, size = rows[k, ROW_SHOWN], rows[k, ROW_BYTES]
        if rows[k, ROW_FULL]:
            shown += i * size
            copy_bytes(rows[k, ROW_FULL] + i * size, shown, size)
        clear_bytes(shown, size)
