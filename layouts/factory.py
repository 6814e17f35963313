"""The factory floor of Keith & La: 18 workstations on the centre lines of the aisles.

The graph has 52 critical points (letters, the authors' own) and 63 straight segments, 2735 ft in
all. With cells of 2.5 ft all 153 distances between stations are exact; with 5 ft 84 are.
WS1 to WS10 stand in production, WS11 to WS15 between the racks of the warehouse, WS16 to WS18 at
the docks; the areas are inferred from the authors' map of the floor.

 A....1....B..C......D     The aisles are 9.5 to 30 ft wide, so robots pass each other (`pass`);
 .         2  .      4     with `single` a cell holds one robot.
 E....3....F..G      .
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

import msgspec
from msgspec import Meta
from numpy.typing import NDArray

from automaton.floor.floor_plan import (
    ALL_EXITS,
    FLOOR,
    STATION,
    UNLIMITED,
    FloorPlan,
    bordered,
    make_floor_plan,
)

FEET: Final[dict[str, tuple[float, float]]] = {  # point: feet from the west and from the south
    **{"A": (70, 390), "B": (190, 390), "C": (230, 390), "D": (290, 390), "E": (70, 315)},
    **{"F": (190, 315), "G": (230, 315), "H": (10, 300), "I": (70, 300), "J": (230, 265)},
    **{"K": (290, 265), "L": (10, 250), "M": (70, 250), "N": (70, 240), "O": (230, 240)},
    **{"P": (70, 165), "Q": (230, 165), "R": (10, 150), "S": (70, 150), "T": (70, 115)},
    **{"U": (110, 115), "V": (150, 115), "W": (190, 115), "X": (230, 115), "Y": (70, 25)},
    **{"Z": (110, 25), "a": (150, 25), "b": (190, 25), "c": (230, 25), "d": (70, 0)},
    **{"e": (110, 0), "f": (150, 0), "g": (190, 0), "h": (230, 0), "i": (130, 390)},
    **{"j": (190, 352.5), "k": (130, 315), "l": (290, 327.5), "m": (10, 275), "n": (130, 240)},
    **{"o": (180, 240), "p": (10, 200), "q": (130, 165), "r": (180, 165), "s": (70, 70)},
    **{"t": (110, 70), "u": (150, 70), "v": (190, 70), "w": (230, 70), "x": (110, 12.5)},
    **{"y": (150, 12.5), "z": (190, 12.5)},
}
_SEGMENTS: Final = (
    "AE Ai BC Bi Bj CD CG Dl EI Ek FG Fj Fk GJ HI Hm IM JK JO Kl LM "
    "Lm Lp MN NP Nn OQ Oo PS Pq QX Qr RS Rp ST TU Ts UV Ut VW Vu WX "
    "Wv Xw YZ Yd Ys Za Zt Zx ab au ay bc bv bz ch cw ex fy gz no qr "
)
SEGMENTS: Final = tuple((a, b) for a, b in map(tuple, _SEGMENTS.split()))
STATION_POINTS: Final = "ijklmnopqrstuvwxyz"  # the points of WS1 to WS18
NORTHERN_LANE: Final = 390  # feet: the northern lane

AREAS: Final[dict[str, tuple[int, ...]]] = {
    "production": tuple(range(1, 11)),
    "warehouse": tuple(range(11, 16)),
    "shipping_receiving": tuple(range(16, 19)),
}


class Factory(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The factory floor of Keith & La with its 18 workstations."""

    cell: Annotated[float, Meta(description="Feet across a cell: 2.5 or 5.")] = 2.5
    lanes: Annotated[
        Literal["pass", "single"],
        Meta(description="pass: robots pass each other anywhere; single: one robot in a cell."),
    ] = "pass"

    def __post_init__(self) -> None:
        if self.cell not in (2.5, 5.0):
            raise ValueError(f"cell is 2.5 or 5 feet, found {self.cell}")

    @property
    def feet_per_cell(self) -> float:
        """How wide a cell is."""
        return float(self.cell)

    def points(self) -> dict[str, tuple[int, int]]:
        """The cell (x, y) of each critical point by its letter."""
        return {letter: self._cell_at(x, y) for letter, (x, y) in FEET.items()}

    def stations(self) -> dict[int, tuple[int, int]]:
        """The cell (x, y) of each workstation by its number."""
        return {n: self._cell_at(*FEET[letter]) for n, letter in enumerate(STATION_POINTS, 1)}

    def areas(self) -> Mapping[str, tuple[int, ...]]:
        """The workstations of each area."""
        return AREAS

    def build(self) -> FloorPlan:
        """The floor."""
        points = self.points()
        width, height = (end + 1 for end in (points["D"][0], points["d"][1]))
        kind, leave = bordered(height, width), bordered(height, width)
        capacity: NDArray[Any] = bordered(height, width, 1)
        floor, out, robots = (array[1:-1, 1:-1] for array in (kind, leave, capacity))
        for a, b in SEGMENTS:
            (x, y), (to_x, to_y) = sorted((points[a], points[b]))
            lane = (slice(min(y, to_y), max(y, to_y) + 1), slice(x, to_x + 1))
            floor[lane], out[lane] = FLOOR, ALL_EXITS
            robots[lane] = UNLIMITED if self.lanes == "pass" else 1
        for x, y in self.stations().values():
            floor[y, x] = STATION
        stride = width + 2
        numbered = ((y + 1) * stride + x + 1 for x, y in self.stations().values())
        return make_floor_plan(kind, leave, capacity, numbered=numbered)

    def _cell_at(self, x: float, y: float) -> tuple[int, int]:
        """Halves are rounded to the east and to the north."""
        feet = self.feet_per_cell
        return int(x / feet + 0.5), int(NORTHERN_LANE / feet) - int(y / feet + 0.5)
