"""The floor of De Ryck et al. as a grid: depots, stations, and the lanes between them.

 #  #  1  #  2  #  3  #  #     A cell is 10 m wide. Depots 1 to 3 are dead ends; depot 17 is not
 #  #  .  #  .  #  .  #  #     the paper's: it is where a fourth robot starts. Tasks are at the
 4  .  5  .  6  .  7  .  8     stations 4 to 16. The figure of the paper is lost; this floor has
 .  #  .  #  .  #  .  #  .     every length that the text states.
 .  #  .  #  .  #  .  #  .
 9  . 10  . 11  . 12  . 13     `comb` closes the four lanes between the stations of this row, so
 .  #  #  #  .  #  #  #  .     that each length of the text belongs to one shortest way only.
 .  #  #  #  .  #  #  #  .
14  .  .  . 15  .  .  . 16
 #  #  #  #  .  #  #  #  #
 #  #  #  # 17  #  #  #  #
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Annotated, Any, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from automaton.floor.floor_plan import (
    ALL_EXITS,
    CHARGER,
    FLOOR,
    STATION,
    UNLIMITED,
    FloorPlan,
    bordered,
    make_floor_plan,
)

CELL: Final = 10  # metres; a robot drives 1 m/s
TABLE_WIDTH: Final = 9
HEIGHT: Final = 11

CELL_OF_POSITION: Final[dict[int, tuple[int, int]]] = {  # position of the paper: its cell
    **{1: (2, 0), 2: (4, 0), 3: (6, 0)},
    **{4: (0, 2), 5: (2, 2), 6: (4, 2), 7: (6, 2), 8: (8, 2)},
    **{9: (0, 5), 10: (2, 5), 11: (4, 5), 12: (6, 5), 13: (8, 5)},
    **{14: (0, 8), 15: (4, 8), 16: (8, 8), 17: (4, 10)},
}
DEPOT_POSITIONS: Final = (1, 2, 3, 17)
STATION_POSITIONS: Final = tuple(range(4, 17))

Lane = tuple[int, int]

# The lanes of the lengths in the text, and what joins them: 6-7 and the row of 14 to 17.
NEEDED_LANES: Final[frozenset[Lane]] = frozenset(
    {
        *[(1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 8), (4, 9), (8, 13), (9, 14)],
        *[(13, 16), (14, 15), (15, 16), (15, 17)],
    }
)
CROSS_LANES: Final[frozenset[Lane]] = frozenset([(9, 10), (10, 11), (11, 12), (12, 13)])
# These may be there or not: the text holds either way.
OPTIONAL_LANES: Final[frozenset[Lane]] = CROSS_LANES | {(5, 10), (6, 11), (7, 12), (11, 15)}

Metres = NDArray[np.int64]


def metres(lanes: Iterable[Lane]) -> Metres:
    """(17, 17) shortest ways between positions 1..17 over these lanes; -1 where there is none."""
    count = len(CELL_OF_POSITION)
    far = 1 << 40
    found = np.full((count, count), far, np.int64)
    np.fill_diagonal(found, 0)
    for a, b in lanes:
        found[a - 1, b - 1] = found[b - 1, a - 1] = CELL * length((a, b))
    for via in range(count):
        np.minimum(found, found[:, via, None] + found[None, via], out=found)
    found[found >= far] = -1
    return found


def length(lane: Lane) -> int:
    """Cells from one end of a lane to the other; lanes are straight."""
    (x, y), (to_x, to_y) = CELL_OF_POSITION[lane[0]], CELL_OF_POSITION[lane[1]]
    return abs(to_x - x) + abs(to_y - y)


def cells_of(lane: Lane) -> list[tuple[int, int]]:
    """The cells of a lane, both ends included."""
    (x, y), (to_x, to_y) = CELL_OF_POSITION[lane[0]], CELL_OF_POSITION[lane[1]]
    steps = length(lane)
    return [(x + (to_x - x) * k // steps, y + (to_y - y) * k // steps) for k in range(steps + 1)]


class Depots(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Depots and stations, as in De Ryck et al.; a cell is 10 m wide, and robots pass each other."""

    lanes: Annotated[
        Literal["full", "comb"],
        Meta(
            description="Lanes between the stations 9 to 13. full: with them; comb: without them."
        ),
    ] = "full"
    chargers: Annotated[
        tuple[int, ...], Meta(description="Positions with a charger, from 1 to 17.")
    ] = (2,)

    def __post_init__(self) -> None:
        for position in self.chargers:
            if position not in CELL_OF_POSITION:
                raise ValueError(f"chargers are at positions 1 to 17, found {position}")

    @property
    def edges(self) -> Collection[Lane]:
        """The lanes of the graph."""
        return NEEDED_LANES | (
            OPTIONAL_LANES if self.lanes == "full" else OPTIONAL_LANES - CROSS_LANES
        )

    def metres(self) -> Metres:
        """(17, 17) metres between positions 1..17."""
        return metres(self.edges)

    def places(self) -> dict[int, tuple[int, int]]:
        """The cell of each position."""
        return CELL_OF_POSITION

    def build(self) -> FloorPlan:
        """The floor; any number of robots on a cell, except on a charger."""
        kind, leave = bordered(HEIGHT, TABLE_WIDTH), bordered(HEIGHT, TABLE_WIDTH)
        capacity: NDArray[Any] = bordered(HEIGHT, TABLE_WIDTH, 1)
        floor, out, robots = (array[1:-1, 1:-1] for array in (kind, leave, capacity))
        for lane in self.edges:
            for x, y in cells_of(lane):
                floor[y, x], out[y, x], robots[y, x] = FLOOR, ALL_EXITS, UNLIMITED
        for x, y in (CELL_OF_POSITION[position] for position in STATION_POSITIONS):
            floor[y, x] = STATION
        for position in self.chargers:
            x, y = CELL_OF_POSITION[position]
            floor[y, x], robots[y, x] = CHARGER, 1
        return make_floor_plan(kind, leave, capacity)
