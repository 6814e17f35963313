"""A warehouse of racks in rows, with docks on its left side (Bhattathiri, Li & Kuhl, Figure 1).

#############   Aisles run along the rows 1, 4, 7, ...; two highways down the columns 1 and 3,
#~~~~~~~~~~~#   with docks between them; cross highways cut the racks into blocks. A robot
#~i~rrr~rrr~#   stands in the aisle above or below a rack, and right of a dock.
#~i~rrr~rrr~#
#~~~~~~~~~~~#   The paper's figure shows 16 x 13 cells of the upper left corner and says 100 x
#############   100 cells, 64 docks, 5,769 racks and 1,044 zones; the presets are three ways
                of completing it.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
from msgspec import Meta

from automaton.floor.floor_plan import (
    ALL_EXITS,
    DOCK,
    FLOOR,
    RACK,
    CellBytes,
    FloorPlan,
    bordered,
    make_floor_plan,
)

AISLE_EVERY: Final = 3  # an aisle, then two rows of racks
HIGHWAYS: Final = (1, 3)
DOCKS: Final = 2  # their column
FIRST_RACK: Final = 4  # column


class Shape(NamedTuple):
    """What a preset stands for."""

    rows: int
    columns: int
    block: int  # racks side by side between cross highways
    last_row: int  # racks in the row below the last aisle; 0: that row is wall
    closed: tuple[tuple[int, int], ...]  # cells [x, y] of aisles that are filled with racks


PRESETS: Final = {
    "E1": Shape(100, 100, 13, 73, ()),
    "E2": Shape(100, 104, 9, 0, ((54, 49),)),
    "L1": Shape(100, 100, 9, 0, ()),
}

Cells = Annotated[int, Meta(ge=6, le=4096)]


class Racks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Rows of racks between aisles for any number of robots, docks on the left."""

    preset: Annotated[
        Literal["E1", "E2", "L1"],
        Meta(
            description="Preset that gives the values you leave out. E1: 5,769 racks and 522 segments "
            "(1,044 if each direction counts); E2: 5,769 racks, and 1,044 segments and intersections "
            "outside dead ends; L1: 5,504 racks, and 1,078 such segments and intersections."
        ),
    ] = "E1"
    rows: Annotated[Cells | None, Meta(description="Cells from top to bottom, walls included.")] = (
        None
    )
    columns: Annotated[
        Cells | None, Meta(description="Cells from left to right, walls included.")
    ] = None
    block: Annotated[
        Annotated[int, Meta(ge=1, le=4096)] | None,
        Meta(description="Racks side by side between two cross highways."),
    ] = None
    last_row: Annotated[
        Annotated[int, Meta(ge=0, le=4096)] | None,
        Meta(
            description="Racks in the row that is left over below the last aisle, if any; 0: "
            "this row is wall."
        ),
    ] = None
    closed: Annotated[
        tuple[tuple[int, int], ...] | None,
        Meta(
            description="Cells [x, y] of aisles that are closed: racks fill the aisle from one "
            "highway to the next."
        ),
    ] = None
    capacity: Annotated[
        Literal[0, 1, 2],
        Meta(description="Robots at a time in a cell: any number (0), 1, or 2 (one each way)."),
    ] = 0

    def __post_init__(self) -> None:
        shape = self.shape
        width, spare = shape.columns - 1 - FIRST_RACK, (shape.rows - 3) % AISLE_EVERY
        if self.last_row and not spare:
            raise ValueError(
                f"last_row is {self.last_row}, but with {shape.rows} rows none is left over"
            )
        if self.last_row and self.last_row > width:
            raise ValueError(
                f"last_row must be from 0 to columns - 5 = {width}, found {self.last_row}"
            )
        for x, y in shape.closed:
            inside = FIRST_RACK <= x < shape.columns - 1 and 1 <= y < shape.rows - 1
            if not inside or y % AISLE_EVERY != 1 or _crosses(np.array(x), shape.block):
                raise ValueError(f"closed names [{x}, {y}], which is not a cell of an aisle")

    @property
    def shape(self) -> Shape:
        """The preset with the numbers that were given instead of its own."""
        preset = PRESETS[self.preset]
        given = {name: getattr(self, name) for name in Shape._fields}
        changed = {name: value for name, value in given.items() if value is not None}
        return preset._replace(**changed)

    def build(self) -> FloorPlan:
        """The floor, `columns` wide and `rows` high, its outer cells wall."""
        shape = self.shape
        kind = bordered(shape.rows, shape.columns)
        draw(kind[1:-1, 1:-1], shape)
        free = kind == FLOOR
        leave = np.where(free, ALL_EXITS, 0).astype(np.uint8)
        return make_floor_plan(kind, leave, np.where(free, self.capacity, 1).astype(np.uint8))


def draw(floor: CellBytes, shape: Shape) -> None:
    """Enter kinds of cells into a floor of walls, (rows, columns), indexed [y, x] as users count."""
    inner = floor[1:-1, 1:-1]  # column and row 1 come first
    last_aisle = (shape.rows - 3) // AISLE_EVERY * AISLE_EVERY
    inner[: last_aisle + 1] = RACK
    inner[: last_aisle + 1, DOCKS - 1] = DOCK
    inner[: last_aisle + 1 : AISLE_EVERY] = FLOOR
    columns = np.arange(1, shape.columns - 1)
    highways = np.isin(columns, HIGHWAYS)
    inner[: last_aisle + 1, highways | _crosses(columns, shape.block)] = FLOOR
    if shape.last_row and last_aisle + 1 < len(inner):
        inner[last_aisle + 1, highways] = FLOOR
        inner[last_aisle + 1, FIRST_RACK - 1 : FIRST_RACK - 1 + shape.last_row] = RACK
    for x, y in shape.closed:
        begin = x - (x - FIRST_RACK) % (shape.block + 1)
        floor[y, begin : min(begin + shape.block, shape.columns - 1)] = RACK


def _crosses(columns: npt.NDArray[np.int_], block: int) -> npt.NDArray[np.bool_]:
    """Whether a cross highway runs down these columns."""
    place = columns - FIRST_RACK
    crosses: npt.NDArray[np.bool_] = (place >= 0) & (place % (block + 1) == block)
    return crosses
