"""Blocks of shelves with aisles of one cell around them, and stations at both sides (Zhang et al.,
*Guidance Graph Optimization for Lifelong Multi-Agent Path Finding*, 2024).

...........   Shelves stand in the rows 2, 6, 10, ..., in blocks of `block` shelves side by side, two
t.........t   cells away from both sides and one cell from each other. A robot serves a shelf from the
..rrr.rrr..   row above or below it. Stations are in the first and the last column, in the rows 1, 4,
...........   7, ... Floors may end anywhere: no block is cut, and no shelf stands in the last two rows.
t.........t
"""

from __future__ import annotations

from typing import Annotated, Final

import msgspec
import numpy as np
from msgspec import Meta

from automaton.floor.floor_plan import (
    ALL_EXITS,
    FLOOR,
    RACK,
    STATION,
    FloorPlan,
    bordered,
    make_floor_plan,
)

MARGIN: Final = 2  # cells between the blocks and each side
SHELVES_EVERY: Final = 4  # rows
STATIONS_EVERY: Final = 3


class ShelfBlocks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Blocks of shelves in rows and stations at two sides, for one robot in a cell."""

    columns: Annotated[
        int, Meta(ge=5, le=4096, description="Cells from left to right, stations included.")
    ] = 36
    rows: Annotated[int, Meta(ge=5, le=4096, description="Cells from top to bottom.")] = 33
    block: Annotated[int, Meta(ge=1, le=4096, description="Shelves side by side in a block.")] = 10

    def __post_init__(self) -> None:
        most = self.columns - 2 * MARGIN
        if self.block > most:
            raise ValueError(f"block must be from 1 to columns - 4 = {most}, found {self.block}")

    def build(self) -> FloorPlan:
        """The floor, `columns` wide and `rows` high."""
        kind = bordered(self.rows, self.columns)
        floor = kind[1:-1, 1:-1]
        floor[:] = FLOOR
        floor[1:-1:STATIONS_EVERY, [0, -1]] = STATION
        for left in range(MARGIN, self.columns - MARGIN - self.block + 1, self.block + 1):
            floor[2:-2:SHELVES_EVERY, left : left + self.block] = RACK
        leave = np.where(np.isin(kind, (FLOOR, STATION)), ALL_EXITS, 0).astype(np.uint8)
        return make_floor_plan(kind, leave)
