"""Random floors, as the benchmarks of path finding for many robots have them.

...#..   Obstacles: `obstacles` is the share of cells that are drawn as walls. What is cut off from
.#....   the largest part of the floor by them is wall, too, so that all free cells are reached from
....#.   each other.

.....#.....   Square rooms side by side, with a door of one cell in each wall between two of them.
.....#.....   Where a door is follows from `floor_seed`.
...........
##.#####.##
"""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np
import numpy.typing as npt
from msgspec import Meta

from automaton.floor.floor_plan import (
    ALL_EXITS,
    FLOOR,
    WALL,
    CellBytes,
    FloorPlan,
    bordered,
    make_floor_plan,
)

Side = Annotated[int, Meta(ge=2, le=4096)]


class RandomFloor(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An open floor for one robot in a cell, with random obstacles."""

    columns: Annotated[Side, Meta(description="Cells from left to right.")] = 32
    rows: Annotated[Side, Meta(description="Cells from top to bottom.")] = 32
    obstacles: Annotated[
        float, Meta(ge=0, le=0.4, description="Share of the cells that are walls.")
    ] = 0.2
    floor_seed: Annotated[int, Meta(ge=0, le=2**32, description="Seed that places the walls.")] = 1

    def build(self) -> FloorPlan:
        """The floor, `columns` wide and `rows` high."""
        draws = np.random.default_rng(self.floor_seed)
        kind = bordered(self.rows, self.columns)
        walls = draws.random((self.rows, self.columns)) < self.obstacles
        kind[1:-1, 1:-1] = np.where(walls, WALL, FLOOR)
        return open_floor(kind)


class Rooms(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Square rooms for one robot in a cell, with a door in each wall."""

    across: Annotated[int, Meta(ge=1, le=500, description="Rooms side by side.")] = 4
    down: Annotated[int, Meta(ge=1, le=500, description="Rooms one below another.")] = 4
    side: Annotated[int, Meta(ge=2, le=500, description="Cells of a room's side.")] = 7
    floor_seed: Annotated[int, Meta(ge=0, le=2**32, description="Seed that places the doors.")] = 1

    def build(self) -> FloorPlan:
        """The floor, `across * (side + 1) - 1` wide and `down * (side + 1) - 1` high."""
        draws, pitch = np.random.default_rng(self.floor_seed), self.side + 1
        kind = bordered(self.down * pitch - 1, self.across * pitch - 1)
        floor = kind[1:-1, 1:-1]
        floor[:] = FLOOR
        floor[self.side :: pitch, :] = WALL
        floor[:, self.side :: pitch] = WALL
        for row in range(self.down):
            for column in range(self.across):
                beside, below = draws.integers(0, self.side, 2).tolist()
                if column + 1 < self.across:
                    floor[row * pitch + beside, column * pitch + self.side] = FLOOR
                if row + 1 < self.down:
                    floor[row * pitch + self.side, column * pitch + below] = FLOOR
        return open_floor(kind)


def open_floor(kind: CellBytes) -> FloorPlan:
    """A floor of cells for one robot each, without what is cut off from its largest part."""
    kind = np.where(largest_part(kind == FLOOR), kind, WALL).astype(np.uint8)
    leave = np.where(kind == FLOOR, ALL_EXITS, 0).astype(np.uint8)
    return make_floor_plan(kind, leave)


def largest_part(free: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """(rows, columns) bool: the largest set of free cells that hang together; ties to the first."""
    part = np.zeros(free.shape, np.int64)
    sizes = [0]
    for row, column in np.argwhere(free).tolist():
        if part[row, column]:
            continue
        number, waiting = len(sizes), [(row, column)]
        sizes.append(0)
        part[row, column] = number
        while waiting:
            y, x = waiting.pop()
            sizes[number] += 1
            for beside in ((y, x + 1), (y + 1, x), (y, x - 1), (y - 1, x)):
                if free[beside] and not part[beside]:
                    part[beside] = number
                    waiting.append(beside)
    return part == int(np.argmax(sizes)) if len(sizes) > 1 else free
