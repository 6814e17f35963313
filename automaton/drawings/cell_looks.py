"""What a cell looks like in a drawing: its kind, and a detail in the bits above, in one number."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from automaton.floor.cells import (
    ALL_EXITS,
    BAY,
    CELL_KINDS,
    DIRECTION_VECTORS,
    FLOOR,
    STORAGE,
    TRACK,
    TURNTABLE,
    WALL,
    opposite_exits,
)
from automaton.floor.floor_plan import FloorPlan

Looks = NDArray[np.uint8]

DETAIL_SHIFT: Final = 4
KIND_MASK: Final = (1 << DETAIL_SHIFT) - 1
LOOK_COUNT: Final = 16 << DETAIL_SHIFT
DETAIL_OUTSIDE: Final = 1  # detail of a wall that touches nothing but walls
DETAIL_ONE_WAY: Final = 1  # to 4: details of floor; 1 + direction
KIND_COLOURS: Final = {
    kind.code: {"floor": "mark", "storage": "mark"}.get(kind.name, kind.name) for kind in CELL_KINDS
}


def looks_of(floor_plan: FloorPlan) -> Looks:
    """(height + 2, width + 2) kind and detail of each cell, border included; of rails their exits."""
    kind, exits = floor_plan.kind, floor_plan.exits
    detail = np.zeros_like(kind)
    rails = (kind == TRACK) | (kind == TURNTABLE)
    detail[rails] = exits[rails]
    onwards = exits & ~_exits_into(kind == STORAGE)
    for direction in range(4):
        detail[(kind == FLOOR) & _one_way(onwards, direction)] = DETAIL_ONE_WAY + direction
    detail[(kind == WALL) & ~_beside_something(kind)] = DETAIL_OUTSIDE
    return np.asarray(kind | detail << DETAIL_SHIFT, np.uint8)


def colour_of(look: int) -> str:
    """The name of the colour in which a look is drawn."""
    kind, detail = look & KIND_MASK, look >> DETAIL_SHIFT
    if kind == WALL and detail == DETAIL_OUTSIDE:
        return "void"
    return "direction" if kind == FLOOR and detail else KIND_COLOURS[kind]


def box_of(floor_plan: FloorPlan) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of the floor with its parking bays, which may lie in the border.

    Columns and rows as users count them; right and bottom are excluded.
    """
    height, width = floor_plan.kind.shape
    rows, columns = np.nonzero(floor_plan.kind == BAY)
    left, top = min(1, *columns, 1), min(1, *rows, 1)
    right, bottom = max(width - 1, *(columns + 1), 1), max(height - 1, *(rows + 1), 1)
    return int(left) - 1, int(top) - 1, int(right) - 1, int(bottom) - 1


def _exits_into(cells: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The exits that lead into some cells: an aisle is one-way, though robots turn off into storage."""
    sides = np.zeros(cells.shape, np.uint8)
    for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
        sides |= np.where(np.roll(cells, (-dy, -dx), (0, 1)), np.uint8(1 << direction), np.uint8(0))
    return sides


def _one_way(exits: NDArray[np.uint8], direction: int) -> NDArray[np.bool_]:
    """Cells with that exit alone, from which there is no way back: a dead end is not one-way."""
    bit = 1 << direction
    dx, dy = DIRECTION_VECTORS[direction]
    ahead = np.roll(exits, (-dy, -dx), (0, 1))
    one_way: NDArray[np.bool_] = (exits == bit) & (ahead & opposite_exits(bit) & ALL_EXITS == 0)
    return one_way


def _beside_something(kind: NDArray[np.uint8]) -> NDArray[np.bool_]:
    some = np.pad(kind != WALL, 1)
    height, width = kind.shape
    near = np.zeros(kind.shape, bool)
    for dy in range(3):
        for dx in range(3):
            near |= some[dy : dy + height, dx : dx + width]
    return near
