"""A floor for sorting: robots carry parcels from docks at both sides to chutes all over the floor.

i.......i   Docks stand every second row in the first and the last column; a robot takes a parcel
........    in the cell next to one. A chute (a rack, which takes any number of loads) stands in
i..r..r.i   every third column and row; robots drop into it from above or below.
"""

from __future__ import annotations

from typing import Annotated, Final

import msgspec
import numpy as np
from msgspec import Meta

from automaton.floor.floor_plan import (
    ALL_EXITS,
    DOCK,
    FLOOR,
    RACK,
    WALL,
    FloorPlan,
    bordered,
    make_floor_plan,
)

CHUTE_EVERY: Final = 3
FIRST_CHUTE: Final = 3  # column
DOCK_EVERY: Final = 2

Side = Annotated[int, Meta(ge=8, le=4096)]


class Sorting(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Docks at two sides and chutes in between, for one robot in a cell."""

    columns: Annotated[Side, Meta(description="Cells from left to right, docks included.")] = 40
    rows: Annotated[Side, Meta(description="Cells from top to bottom.")] = 30

    def build(self) -> FloorPlan:
        """The floor, `columns` wide and `rows` high."""
        kind = bordered(self.rows, self.columns)
        floor = kind[1:-1, 1:-1]
        floor[:] = FLOOR
        floor[2:-2:CHUTE_EVERY, FIRST_CHUTE : self.columns - FIRST_CHUTE : CHUTE_EVERY] = RACK
        for side in (0, -1):
            floor[:, side] = WALL
            floor[::DOCK_EVERY, side] = DOCK
        leave = np.where(kind == FLOOR, ALL_EXITS, 0).astype(np.uint8)
        return make_floor_plan(kind, leave)
