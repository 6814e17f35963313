"""Square rooms side by side, with a door of one cell in each wall between two of them.

.....#.....   Where a door is follows from `floor_seed`.
.....#.....
...........
##.#####.##
"""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta

from automaton.floor.cells import FLOOR, WALL
from automaton.floor.floor_plan import FloorPlan, bordered
from layouts.random_floor import open_floor


class Rooms(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Square rooms for one robot in a cell, with a door in each wall."""

    across: Annotated[int, Meta(ge=1, le=500, description="Rooms side by side.")] = 4
    down: Annotated[int, Meta(ge=1, le=500, description="Rooms one below another.")] = 4
    side: Annotated[int, Meta(ge=2, le=500, description="Cells of a room's side.")] = 7
    floor_seed: Annotated[
        int, Meta(ge=0, le=2**32, description="Where the doors are follows from it.")
    ] = 1

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
