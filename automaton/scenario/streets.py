"""Streets: weights that guide robots, and directions that are closed.

    streets: {preset: crisscross, along: 0.5}         # rows run east and west in turn, columns south and north
    streets: {file: streets.csv, scale: mean}         # x,y,east,south,west,north,wait
    streets:                                          # later entries replace earlier ones, edge by edge
      - {row: 12, columns: [2, 33], east: 0.5}
      - {column: 3, south: closed}
      - {path: [[2, 4], [9, 4], [9, 8]], there: 0.5, back: closed}
      - {area: {from: [0, 0], to: [9, 9]}, wait: 2}
      - {at: [4, 4], east: 0.3}

A weight multiplies the cost of a move when a way is chosen, never its duration. A closed direction is an
exit that the floor does not have. The rows of a file become entries `at`, so recordings need no further
files. Weights are whole hundredths.

Source: Y. Zhang et al., Guidance Graph Optimization for Lifelong Multi-Agent Path Finding, IJCAI 2024.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from automaton.errors import InputError, InvalidValueError, Keys
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.changing_floor import Cell, Rectangle, cells_of_path, cells_of_set
from automaton.scenario.document import Document
from automaton.scenario.quantities import (
    ConfigSection,
    Direction,
    NamedCell,
    NonEmptyText,
    Pair,
)
from automaton.scenario.table_fields import (
    COORDINATE,
    Column,
    ColumnNames,
    TableOptions,
    column,
)
from automaton.scenario.table_reader import ReadFile, TableColumns, named_file, read_table, with_rows
from automaton.scenario.text_files import quoted

UNIT: Final = 100  # of weights and of a tick, in the cost of a way
CLOSED: Final = "closed"
LEAST_WEIGHT: Final = 0.01
MOST_WEIGHT: Final = 10_000.0
COMPASS: Final[tuple[Direction, ...]] = ("east", "south", "west", "north")  # of bits and columns
WAIT: Final = "wait"
DECIMAL_NUMBER: Final = re.compile(r"\d{1,6}(\.\d{1,12})?|\.\d{1,12}")
STREETS_KEY: Final[Keys] = ("streets", "file")

Weight = Annotated[float, Meta(ge=LEAST_WEIGHT, le=MOST_WEIGHT)]
WaitWeight = Annotated[float, Meta(ge=0, le=MOST_WEIGHT)]
WeightOrClosed = Literal["closed"] | Weight
Ints = NDArray[np.int32]


class Street(ConfigSection, frozen=True, kw_only=True):
    """Weights of the moves out of some cells."""

    at: Annotated[NamedCell | None, Meta(description="A single cell.")] = None
    row: Annotated[int | None, Meta(ge=0, description="A row, or the part of it in `columns`.")] = None
    columns: Annotated[Pair | None, Meta(description="First and last column of the part.")] = None
    column: Annotated[
        int | None, Meta(ge=0, description="A column, or the part of it in `rows`.")
    ] = None
    rows: Annotated[Pair | None, Meta(description="First and last row of the part.")] = None
    path: Annotated[
        tuple[NamedCell, ...] | None,
        Meta(min_length=2, description="The corners of a path, with weights `there` and `back`."),
    ] = None
    area: Annotated[Rectangle | None, Meta(description="A rectangle.")] = None
    east: Annotated[
        WeightOrClosed | None,
        Meta(description="Weight of moves to the east, or closed; null: unchanged."),
    ] = None
    south: Annotated[WeightOrClosed | None, Meta(description="The same to the south.")] = None
    west: Annotated[WeightOrClosed | None, Meta(description="The same to the west.")] = None
    north: Annotated[WeightOrClosed | None, Meta(description="The same to the north.")] = None
    there: Annotated[
        WeightOrClosed | None,
        Meta(description="Weight of moves along the path, or closed; null: unchanged."),
    ] = None
    back: Annotated[
        WeightOrClosed | None, Meta(description="The same for moves along the path backwards.")
    ] = None
    wait: Annotated[
        WaitWeight | None,
        Meta(
            description="Weight of a tick of waiting in the cells, for right of way `pibt`; null: "
            "unchanged."
        ),
    ] = None

    def __post_init__(self) -> None:
        places = [
            name for name in ("at", "row", "column", "path", "area") if getattr(self, name) is not None
        ]
        if len(places) != 1:
            found = " and ".join(places) or "none of them"
            raise ValueError(f"a street has one of at, row, column, path and area, found {found}")
        for name, of in (("columns", "row"), ("rows", "column"), ("there", "path"), ("back", "path")):
            if getattr(self, name) is not None and places[0] != of:
                raise ValueError(f"{name} belongs to {of}, and this street has {places[0]}")
        if places[0] == "path" and any(getattr(self, name) is not None for name in COMPASS):
            raise ValueError("a street along a path has weights `there` and `back`, not of directions")


class Streets(ConfigSection, frozen=True, kw_only=True):
    """Streets of a file, or of a preset."""

    file: Annotated[
        NonEmptyText | None,
        Meta(
            description="A CSV file with the columns x, y, and any of east, south, west, north and "
            "wait: a weight, closed, or nothing for 1; path relative to the scenario."
        ),
    ] = None
    scale: Annotated[
        Literal["mean"] | Weight,
        Meta(
            description="Factor of all weights of the file; mean: such that the mean weight of all "
            "moves on the floor becomes 1."
        ),
    ] = 1.0
    preset: Annotated[
        Literal["crisscross"] | None,
        Meta(
            description="crisscross: rows run east and west in turn, columns south and north."
        ),
    ] = None
    along: Annotated[Weight, Meta(description="Weight of moves along crisscross streets.")] = 0.5
    against: Annotated[
        WeightOrClosed, Meta(description="Weight of moves against them, or closed.")
    ] = 1.0
    wait: Annotated[WaitWeight, Meta(description="Weight of a tick of waiting.")] = 1.0
    phase: Annotated[
        tuple[Literal[0, 1], Literal[0, 1]],
        Meta(
            description="Row y runs east if y + the first number is even; column x runs south if x + "
            "the second one is odd."
        ),
    ] = (0, 0)

    def __post_init__(self) -> None:
        if (self.file is None) == (self.preset is None):
            raise ValueError("streets has either file or preset, or is a list of streets")
        of_preset = self.along != 0.5 or self.against != 1 or self.wait != 1 or self.phase != (0, 0)
        if self.file is not None and of_preset:
            raise ValueError("along, against, wait and phase belong to a preset, and streets has a file")
        if self.preset is not None and self.scale != 1:
            raise ValueError("scale belongs to a file, and streets has a preset")


StreetsSection = Streets | tuple[Street, ...] | None


class StreetColumns(ColumnNames, frozen=True, kw_only=True):
    """The columns of a file of streets."""

    rows, may_rename = "streets", False
    needed = ((("x",),), (("y",),))

    x: Annotated[Column, column("The column of the cell.", COORDINATE)] = None
    y: Annotated[Column, column("The row of the cell.", COORDINATE)] = None
    east: Annotated[Column, column("Weight of moves to the east, or closed.")] = None
    south: Annotated[Column, column("Weight of moves to the south, or closed.")] = None
    west: Annotated[Column, column("Weight of moves to the west, or closed.")] = None
    north: Annotated[Column, column("Weight of moves to the north, or closed.")] = None
    wait: Annotated[Column, column("Weight of a tick of waiting.")] = None


class StreetWeights(NamedTuple):
    """Weights of the c cells of a floor, in hundredths; in directions E, S, W, N."""

    move: Ints  # (c, 4)
    wait: Ints  # (c,)
    closed: NDArray[np.bool_]  # (c, 4)


# From a section to weights.


def street_weights(section: StreetsSection, floor_plan: FloorPlan) -> StreetWeights | None:
    """The weights on a floor; None without streets. Raises InvalidValueError.

    The section has the streets of its file as a list.
    """
    if section is None:
        return None
    cells = floor_plan.kind.size
    weights = StreetWeights(
        np.full((cells, 4), UNIT, np.int32),
        np.full(cells, UNIT, np.int32),
        np.zeros((cells, 4), np.bool_),
    )
    if isinstance(section, Streets):
        assert section.file is None, "files are read before"
        _enter_crisscross(weights, section, floor_plan)
    else:
        for number, street in enumerate(section):
            try:
                _enter(weights, street, floor_plan)
            except InputError as error:
                raise InvalidValueError(("streets", number), error.message) from None
    exits = (floor_plan.exits.reshape(-1)[:, None] >> np.arange(4, dtype=np.uint8)) & 1 > 0
    weights.closed[~exits] = False
    weights.move[~exits | weights.closed] = UNIT
    weights.wait[~floor_plan.drivable.reshape(-1)] = UNIT
    return weights


def _enter_crisscross(weights: StreetWeights, preset: Streets, floor_plan: FloorPlan) -> None:
    """Row y + phase[0] even: east; column x + phase[1] odd: south."""
    y, x = np.divmod(np.arange(floor_plan.kind.size), floor_plan.stride)
    runs_east = (y - 1 + preset.phase[0]) % 2 == 0
    runs_south = (x - 1 + preset.phase[1]) % 2 == 1
    along = np.stack((runs_east, runs_south, ~runs_east, ~runs_south), axis=1)
    weights.move[along] = hundredths(preset.along)
    if preset.against == CLOSED:
        weights.closed[~along] = True
    else:
        weights.move[~along] = hundredths(float(preset.against))
    weights.wait[:] = hundredths(preset.wait)


def _enter(weights: StreetWeights, street: Street, floor_plan: FloorPlan) -> None:
    """Enter the weights of a street. Raises InputError without file and line."""
    if street.path is not None:
        path = _path(street.path, floor_plan)
        for here, to in zip(path[:-1], path[1:], strict=True):
            direction = floor_plan.offsets.index(to - here)
            _enter_edge(weights, here, direction, street.there)
            _enter_edge(weights, to, direction ^ 2, street.back)
        cells = np.array(path)
    else:
        cells = np.array(_cells(street, floor_plan))
        for direction, name in enumerate(COMPASS):
            _enter_edge(weights, cells, direction, getattr(street, name))
    if street.wait is not None:
        weights.wait[cells] = hundredths(street.wait)


def _enter_edge(
    weights: StreetWeights, cells: Any, direction: int, value: WeightOrClosed | None
) -> None:
    if value is None:
        return
    weights.closed[cells, direction] = value == CLOSED
    if value != CLOSED:
        weights.move[cells, direction] = hundredths(float(value))


def hundredths(weight: float) -> int:
    """A weight in hundredths, rounded half up."""
    return math.floor(weight * UNIT + 0.5)


def _path(corners: Sequence[Cell], floor_plan: FloorPlan) -> list[int]:
    """The cells of a path. Raises InputError for corners off the floor or not in line."""
    cells_of_set("its path", corners, floor_plan)  # type: ignore[arg-type]
    return cells_of_path("its path", corners, floor_plan)


def _cells(street: Street, floor_plan: FloorPlan) -> list[int]:
    """The cells of a street that is no path. Raises InputError without file and line."""
    right, bottom = floor_plan.width - 1, floor_plan.height - 1
    if street.at is not None:
        return cells_of_set("at", (street.at,), floor_plan)
    if street.area is not None:
        return cells_of_set("its area", street.area, floor_plan)
    if street.row is not None:
        first, last = street.columns or (0, right)
        corners, name = ((first, street.row), (last, street.row)), f"row {street.row}"
    else:
        first, last = street.rows or (0, bottom)
        x = int(street.column or 0)
        corners, name = ((x, first), (x, last)), f"column {x}"
    return _path_of(name, corners, floor_plan)


def _path_of(name: str, corners: Sequence[Cell], floor_plan: FloorPlan) -> list[int]:
    return cells_of_set(name, tuple(corners), floor_plan)


def with_closed_exits(floor_plan: FloorPlan, weights: StreetWeights | None) -> FloorPlan:
    """The floor without the exits that streets close."""
    if weights is None or not weights.closed.any():
        return floor_plan
    bits = (weights.closed << np.arange(4)).sum(axis=1).astype(np.uint8)
    return floor_plan.with_exits(floor_plan.exits & ~bits.reshape(floor_plan.exits.shape))


# From a file to a list.


def read_streets(
    document: Document, section: StreetsSection, floor_plan: FloorPlan
) -> tuple[Document, StreetsSection, ReadFile | None]:
    """The streets with those of their file as a list, and the document with its lines.

    Raises InputError with the line.
    """
    if not isinstance(section, Streets) or section.file is None:
        return document, section, None
    path = named_file(document, STREETS_KEY, StreetColumns.rows, section.file)
    table = read_table(path, StreetColumns, TableOptions(file=path.name))
    table.errors.raise_any()
    streets = tuple(_rows(table, floor_plan))
    if section.scale != 1:
        streets = _scaled(streets, section.scale, floor_plan)
    document = with_rows(document, ("streets",), table.path, table.lines)
    return document, streets, ReadFile(str(path.resolve()), table.content_hash)


def _rows(table: TableColumns, floor_plan: FloorPlan) -> Iterator[Street]:
    """The street of each row. Raises InputError with its line."""
    seen: dict[Cell, int] = {}
    names = [name for name in (*COMPASS, WAIT) if name in table.column_of]
    texts = {
        name: [*(_read(text) for text in table.names[name]), None] for name in names
    }  # of each different text; the last one: nothing
    for row, line in enumerate(table.lines.tolist()):
        x, y = (int(table.values[axis][row]) for axis in ("x", "y"))
        if (x, y) in seen:
            text = f"cell [{x}, {y}] appears twice (first in line {seen[x, y]})"
            raise InputError(text, table.path, line)
        seen[x, y] = line
        values = {name: texts[name][int(table.values[name][row])] for name in names}
        for name, value in values.items():
            _check(table, line, (x, y), name, value, floor_plan)
        yield Street(at=(x, y), **{name: one for name, one in values.items() if one is not None})


def _read(text: str) -> float | str:
    """A weight, "closed", or the text itself if it is neither."""
    if text == CLOSED:
        return CLOSED
    plain = text.replace(",", ".") if text.count(",") == 1 else text
    return float(plain) if DECIMAL_NUMBER.fullmatch(plain) else text


def _check(
    table: TableColumns,
    line: int,
    at: Cell,
    name: str,
    value: float | str | None,
    floor_plan: FloorPlan,
) -> None:
    """Refuse a value that is no weight, or of an edge that the floor does not have."""
    x, y = at
    if not floor_plan.holds(x, y):
        text = f"cell [{x}, {y}] lies outside the floor {floor_plan.extent}"
        raise InputError(text, table.path, line)
    if value is None:
        return
    cell, least = floor_plan.cell(x, y), 0.0 if name == WAIT else LEAST_WEIGHT
    allowed = f"{least:g} to {MOST_WEIGHT:,.0f}" + ("" if name == WAIT else ", or closed")
    is_number = isinstance(value, float) and least <= value <= MOST_WEIGHT
    if not is_number and (value != CLOSED or name == WAIT):
        said = quoted(value) if isinstance(value, str) else f"{value:g}"
        text = f"cell [{x}, {y}], {name}: a weight is {allowed}, found {said}"
        raise InputError(text, table.path, line)
    if not floor_plan.drivable.flat[cell]:
        raise InputError(f"cell [{x}, {y}] is no cell where robots drive", table.path, line)
    if name != WAIT and not floor_plan.exits.flat[cell] >> COMPASS.index(name) & 1:  # type: ignore[arg-type]
        text = f"cell [{x}, {y}] has no exit to the {name}, so that the weight has no effect"
        raise InputError(text, table.path, line)


def _scaled(
    streets: tuple[Street, ...], scale: Literal["mean"] | float, floor_plan: FloorPlan
) -> tuple[Street, ...]:
    """All weights of moves multiplied by a factor, within the limits of weights."""
    if scale == "mean":
        weights = street_weights(streets, floor_plan)
        assert weights is not None
        exits = (floor_plan.exits.reshape(-1)[:, None] >> np.arange(4, dtype=np.uint8)) & 1 > 0
        scale = UNIT / float(weights.move[exits & ~weights.closed].mean())
    factor = float(scale)
    everywhere = Street(
        area=Rectangle(first=(0, 0), last=(floor_plan.width - 1, floor_plan.height - 1)),
        **dict.fromkeys(COMPASS, within(factor)),
    )
    return (
        everywhere,
        *(
            msgspec.structs.replace(
                street,
                **{
                    name: within(factor * value)
                    for name in COMPASS
                    if isinstance(value := getattr(street, name), float)
                },
            )
            for street in streets
        ),
    )


def within(weight: float) -> float:
    """The nearest weight that is allowed, in whole hundredths."""
    return min(max(hundredths(weight), 1), int(MOST_WEIGHT) * UNIT) / UNIT


Reader = Callable[[Path], StreetsSection]
