"""Narrow aisles between corridors of two rows, stations at the last corridor: goods to person.

.........   Aisles are one cell wide, in `sections` one below another. Two-way, or alternately
.........   down and up (`one_way`). Stations stand in the last row of the last corridor, every
#v#^#v#^#   fourth cell, or below it in a pocket of their own (`pockets`), from which a robot
#v#^#v#^#   comes out as it went in. With `shelves` the walls beside the aisles are shelves, and
.........   destinations stand below the last corridor in place of stations.
..t...t..
"""

from __future__ import annotations

from typing import Annotated, Final

import msgspec
import numpy as np
from msgspec import Meta

from automaton.floor.floor_plan import (
    ALL_EXITS,
    DESTINATION,
    FLOOR,
    NORTH,
    SHELF,
    SOUTH,
    STATION,
    WALL,
    FloorPlan,
    bordered,
    make_floor_plan,
)

CORRIDOR: Final = 2  # rows
FIRST_STATION: Final = 2  # its column
STATION_EVERY: Final = 4


class Aisles(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Narrow aisles between corridors, for one robot in a cell, with stations at the bottom."""

    aisles: Annotated[int, Meta(ge=2, le=2000, description="Aisles side by side.")] = 16
    sections: Annotated[int, Meta(ge=1, le=500, description="Sections one below another.")] = 2
    length: Annotated[int, Meta(ge=1, le=2000, description="Cells of an aisle in a section.")] = 9
    one_way: Annotated[
        bool, Meta(description="Whether aisles are one-way, alternately down and up.")
    ] = False
    pockets: Annotated[
        bool, Meta(description="Whether stations stand in pockets below the floor.")
    ] = False

    shelves: Annotated[
        bool,
        Meta(
            description="Whether shelves stand beside the aisles, and destinations below in "
            "place of stations."
        ),
    ] = False

    def __post_init__(self) -> None:
        if self.shelves and self.pockets:
            raise ValueError("pockets are for stations: a floor with shelves has destinations")

    def build(self) -> FloorPlan:
        """The floor, `2 * aisles + 1` wide."""
        width, pitch = 2 * self.aisles + 1, self.length + CORRIDOR
        height = self.sections * pitch + CORRIDOR + (self.pockets or self.shelves)
        kind = bordered(height, width)
        floor = kind[1:-1, 1:-1]
        floor[:] = SHELF if self.shelves else WALL
        floor[:, 1::2] = FLOOR
        corridors = np.arange(height) % pitch < CORRIDOR
        floor[corridors] = FLOOR
        if self.pockets or self.shelves:
            floor[-1] = WALL
        end = DESTINATION if self.shelves else STATION
        floor[-1, FIRST_STATION::STATION_EVERY] = end
        drivable = (kind == FLOOR) | (kind == STATION)
        leave = np.where(drivable, ALL_EXITS, 0).astype(np.uint8)
        if self.one_way:
            inside = leave[1:-1, 1:-1]
            rows = np.flatnonzero(~corridors[: self.sections * pitch])
            inside[np.ix_(rows, np.arange(1, width, 4))] = 1 << SOUTH
            inside[np.ix_(rows, np.arange(3, width, 4))] = 1 << NORTH
        return make_floor_plan(kind, leave)
