"""The table-top warehouse of Grzejszczak and Nocoń: tables of shelves between alleys of track.

b+-+-+d      two tables of three positions: alleys at even x, tables at odd x, corridors above
b|s|s|d      and below; turntables where they meet; a parking bay left of every row (column x = -1);
b|s|s|d      destinations right of the last alley.
b|s|s|d
b+-+-+d
"""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from automaton.floor.floor_plan import (
    ALL_EXITS,
    ALONG_X,
    ALONG_Y,
    BAY,
    DESTINATION,
    SHELF,
    TRACK,
    TURNTABLE,
    FloorPlan,
    bordered,
    make_floor_plan,
)


class Tabletop(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Tables of shelves between alleys of track, destinations on the right, parking bays on the left."""

    tables: Annotated[int, Meta(ge=1, le=2000, description="Tables side by side.")]
    positions: Annotated[int, Meta(ge=1, le=2000, description="Shelves of a table.")]
    destinations: Annotated[
        int | None,
        Meta(description="Rows with a destination, counted from the top; left out: every row."),
    ] = None

    def __post_init__(self) -> None:
        rows = self.positions + 2
        if self.destinations is not None and not 1 <= self.destinations <= rows:
            raise ValueError(
                f"destinations must be a whole number from 1 to positions + 2 = {rows}, "
                f"found {self.destinations}"
            )

    def build(self) -> FloorPlan:
        """The floor: 2 * tables + 2 cells wide (destinations included), positions + 2 high."""
        height, last_alley = self.positions + 2, 2 * self.tables
        rows = height if self.destinations is None else self.destinations
        kind, leave = bordered(height, last_alley + 2), bordered(height, last_alley + 2)
        floor, out = kind[1:-1, 1:-1], leave[1:-1, 1:-1]  # indexed [y, x] as users count

        floor[:, 0 : last_alley + 1 : 2], out[:, 0 : last_alley + 1 : 2] = TRACK, ALONG_Y
        floor[1:-1, 1:last_alley:2] = SHELF
        for corridor in (0, height - 1):
            floor[corridor, 1:last_alley:2], out[corridor, 1:last_alley:2] = TRACK, ALONG_X
            floor[corridor, 0 : last_alley + 1 : 2] = TURNTABLE
            out[corridor, 0 : last_alley + 1 : 2] = ALL_EXITS
        floor[:rows, last_alley + 1] = DESTINATION
        kind[1:-1, 0] = BAY
        return make_floor_plan(kind, leave)
