"""Streets: weights of moves, which guide robots, and moves that are closed.

    x,y,east,south,west,north,wait      streets: {preset: crisscross}
    12,0,0.5,,1,,                       streets: {file: streets.csv, scale: mean}
    12,1,closed,,0.5,,2                 streets: [{row: 12, east: 0.5, west: closed}]

A weight multiplies the cost of a move where a way is chosen, never the ticks of the move; `wait` is the
weight of a tick of waiting. A file of guidance graphs (GGO) is told by its header: a line for each cell
in reading order, whose x is the row and y the column; inf: no edge. Zhang et al., IJCAI 2024.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from automaton.errors import InputError, InvalidValueError, Keys, nearest
from automaton.floor.floor_plan import DIRECTIONS, FloorPlan
from automaton.scenario.changing_floor import Rectangle, cells_of_path, cells_of_set
from automaton.scenario.document import Document
from automaton.scenario.quantities import ConfigSection, NamedCell, NonEmptyText, Pair
from automaton.scenario.table_reader import ReadFile, named_file, with_rows
from automaton.scenario.text_files import content_hash, quoted, read_text

STREETS: Final[Keys] = ("streets",)
UNIT: Final = 100  # weights are multiples of 1 / UNIT
LEAST_WEIGHT: Final = 0.01
MOST_WEIGHT: Final = 10_000
CLOSED: Final = "closed"
COLUMNS: Final = ("x", "y", *DIRECTIONS, "wait")
GGO_COLUMNS: Final = (
    "id",
    "type",
    "x",
    "y",
    "weight_to_RIGHT",
    "weight_to_UP",
    "weight_to_LEFT",
    "weight_to_DOWN",
    "weight_for_WAIT",
)
GGO_DIRECTIONS: Final = (0, 3, 2, 1)  # right, up, left, down as directions
GGO_WALLS: Final = "@T"

Weights = NDArray[np.int32]

Weight = (
    Annotated[
        float,
        Meta(ge=LEAST_WEIGHT, le=MOST_WEIGHT, description="The weight of the moves."),
    ]
    | Literal["closed"]
    | None
)
Wait = (
    Annotated[float, Meta(ge=0, le=MOST_WEIGHT, description="The weight of a tick of waiting.")]
    | None
)
Range = Pair | None


class StreetPlan(ConfigSection, frozen=True, kw_only=True):
    """Streets of a file or of a pattern."""

    file: Annotated[
        NonEmptyText | None,
        Meta(
            description="A CSV file with the columns x, y, east, south, west, north and wait, or one of "
            "guidance graphs (GGO); path relative to the scenario."
        ),
    ] = None
    preset: Annotated[
        Literal["crisscross"] | None,
        Meta(
            description="crisscross: rows run east and west in turn, columns south and north; the first "
            "row runs east, the first column north."
        ),
    ] = None
    scale: Annotated[
        Annotated[float, Meta(gt=0, le=MOST_WEIGHT)] | Literal["mean"],
        Meta(description="A factor of all weights; mean: such that the mean weight of moves is 1."),
    ] = 1.0
    along: Annotated[
        float, Meta(ge=LEAST_WEIGHT, le=MOST_WEIGHT, description="crisscross: along a street.")
    ] = 0.5
    against: Annotated[
        Weight, Meta(description="crisscross: the weight of moves against a street, or closed.")
    ] = 1.0
    wait: Annotated[
        float, Meta(ge=0, le=MOST_WEIGHT, description="crisscross: of a tick of waiting.")
    ] = 1.0
    phase: Annotated[
        tuple[Annotated[int, Meta(ge=0, le=1)], Annotated[int, Meta(ge=0, le=1)]],
        Meta(description="crisscross: 1 reverses the directions of the rows, of the columns."),
    ] = (0, 0)

    def __post_init__(self) -> None:
        if (self.file is None) == (self.preset is None):
            raise ValueError("streets must have exactly one of file and preset, or be a list")
        own = [key for key in ("along", "against", "wait") if getattr(self, key) != DEFAULTS[key]]
        if self.file is not None and (own or self.phase != (0, 0)):
            key = own[0] if own else "phase"
            raise ValueError(f"streets has {key}, which belongs to preset: crisscross")


DEFAULTS: Final = {"along": 0.5, "against": 1.0, "wait": 1.0}


class Street(ConfigSection, frozen=True, kw_only=True):
    """Weights of a cell, a row, a column, a path or an area; later streets overwrite earlier ones."""

    at: Annotated[NamedCell | None, Meta(description="A cell.")] = None
    row: Annotated[Annotated[int, Meta(ge=0)] | None, Meta(description="The y of a row.")] = None
    columns: Annotated[Range, Meta(description="The first and last column of a row.")] = None
    column: Annotated[Annotated[int, Meta(ge=0)] | None, Meta(description="The x of a column.")] = (
        None
    )
    rows: Annotated[Range, Meta(description="The first and last row of a column.")] = None
    path: Annotated[
        Annotated[tuple[NamedCell, ...], Meta(min_length=2)] | None,
        Meta(description="Corners of a path."),
    ] = None
    area: Annotated[Rectangle | None, Meta(description="Two opposite corners of a rectangle.")] = (
        None
    )
    east: Annotated[Weight, Meta(description="Weight of moves to the east, or closed.")] = None
    south: Annotated[Weight, Meta(description="Weight of moves to the south, or closed.")] = None
    west: Annotated[Weight, Meta(description="Weight of moves to the west, or closed.")] = None
    north: Annotated[Weight, Meta(description="Weight of moves to the north, or closed.")] = None
    there: Annotated[Weight, Meta(description="Weight of moves along the path, or closed.")] = None
    back: Annotated[Weight, Meta(description="The same, back along the path.")] = None
    wait: Wait = None

    def __post_init__(self) -> None:
        places = [key for key in PLACES if getattr(self, key) is not None]
        if len(places) != 1:
            raise ValueError("a street must have exactly one of at, row, column, path and area")
        if self.columns is not None and self.row is None:
            raise ValueError("columns limits a row; this street has none")
        if self.rows is not None and self.column is None:
            raise ValueError("rows limits a column; this street has none")
        if (self.there is not None or self.back is not None) and self.path is None:
            raise ValueError("there and back are directions of a path; this street has none")
        if self.path is not None and any(getattr(self, way) is not None for way in DIRECTIONS):
            raise ValueError("the directions of a path are there and back")
        if all(getattr(self, way) is None for way in (*DIRECTIONS, "there", "back", "wait")):
            raise ValueError("this street has no weight: set a direction, there, back or wait")


PLACES: Final = ("at", "row", "column", "path", "area")

Streets = Annotated[
    StreetPlan | tuple[Street, ...],
    Meta(description="Weights of moves, which guide robots, and closed moves."),
]


def hundredths(weight: float) -> int:
    """A weight in 1 / UNIT, half up, at least one unless it is 0."""
    whole = math.floor(weight * UNIT + 0.5)
    return max(whole, 1) if weight > 0 else whole


class StreetWeights:
    """The weights of the moves of a floor, in 1 / UNIT, and of waiting; closed moves."""

    def __init__(self, floor_plan: FloorPlan, is_closed: bool = False) -> None:
        """`is_closed`: the floor is without its closed moves already, as that of a recording."""
        self.is_closed = is_closed
        cells = floor_plan.kind.size
        self.floor_plan = floor_plan
        self.exits = floor_plan.exits.reshape(-1)
        self.moves: Weights = np.full((cells, 4), UNIT, np.int32)
        self.waits: Weights = np.full(cells, UNIT, np.int32)
        self.closed = np.zeros((cells, 4), np.bool_)
        self.closed_by: dict[tuple[int, int], Keys] = {}

    def set_move(
        self, cell: int, direction: int, weight: float | str, keys: Keys = STREETS
    ) -> bool:
        """Set the weight of a move, or close it; False if the floor has no such move."""
        if not self.is_closed and not self.exits[cell] >> direction & 1:
            return False
        self.closed[cell, direction] = weight == CLOSED
        if isinstance(weight, str):
            self.closed_by[cell, direction] = keys
        else:
            self.moves[cell, direction] = hundredths(weight)
        return True

    def scale(self, factor: float | str) -> None:
        """Multiply all weights; "mean": such that the mean over all moves becomes 1."""
        exits = self.open_moves()
        if factor == "mean":
            mean = float(self.moves[exits].mean()) / UNIT if exits.any() else 1.0
            factor = 1.0 / mean
        if factor == 1.0:
            return
        for weights, least in ((self.moves, 1), (self.waits, 0)):
            scaled = np.floor(weights * float(factor) + 0.5)
            weights[:] = np.clip(scaled, least, MOST_WEIGHT * UNIT)

    def open_moves(self) -> NDArray[np.bool_]:
        """(cells, 4) the moves that the floor has, without closed ones."""
        bits = (self.exits[:, None] >> np.arange(4, dtype=np.uint8)) & 1
        exits: NDArray[np.bool_] = (bits > 0) & ~self.closed
        return exits

    def floor(self) -> FloorPlan:
        """The floor with these weights, and without closed exits; weights that all are 1 are none."""
        shut = (self.closed << np.arange(4)).sum(axis=1).astype(np.uint8)
        floor_plan = self.floor_plan
        if shut.any():
            exits = (self.exits & ~shut).reshape(floor_plan.exits.shape)
            floor_plan = floor_plan.with_exits(exits)
        moves = np.where(self.open_moves(), self.moves, UNIT).astype(np.int32)
        waits = np.where(floor_plan.drivable.reshape(-1), self.waits, UNIT).astype(np.int32)
        return floor_plan.with_weights(moves, waits)


# The streets of a scenario on its floor.


def streets_on(
    floor_plan: FloorPlan, streets: Streets | None, is_closed: bool = False
) -> StreetWeights:
    """The weights of a scenario without a file. Raises InvalidValueError."""
    weights = StreetWeights(floor_plan, is_closed)
    if isinstance(streets, StreetPlan):
        enter_crisscross(weights, streets)
        weights.scale(streets.scale)
        return weights
    for number, street in enumerate(streets or ()):
        keys: Keys = (*STREETS, number)
        try:
            enter_street(weights, street, f"street {number + 1}", keys)
        except InputError as error:
            if isinstance(error, InvalidValueError):
                raise
            raise InvalidValueError(keys, error.message) from None
    return weights


def enter_crisscross(weights: StreetWeights, plan: StreetPlan) -> None:
    """Rows run east and west in turn, columns south and north."""
    floor_plan = weights.floor_plan
    for cell in np.flatnonzero(floor_plan.drivable).tolist():
        x, y = floor_plan.xy(cell)
        runs = ((y + plan.phase[0]) % 2 * 2, 1 if (x + plan.phase[1]) % 2 else 3)
        for direction in range(4):
            weight = plan.along if direction in runs else plan.against
            weights.set_move(cell, direction, 1.0 if weight is None else weight)
        weights.waits[cell] = hundredths(plan.wait)


def enter_street(weights: StreetWeights, street: Street, name: str, keys: Keys) -> None:
    """Enter the weights of a street. Raises InputError."""
    floor_plan = weights.floor_plan
    cells = cells_of_street(street, name, floor_plan)
    if street.path is not None:
        enter_path(weights, street, cells, name, keys)
    for direction, way in enumerate(DIRECTIONS):
        weight = getattr(street, way)
        if weight is None:
            continue
        met = [weights.set_move(cell, direction, weight, keys) for cell in cells]
        if not any(met):
            raise InvalidValueError(
                (*keys, way), f"{name} has {way}, but no robot can move {way} from its cells"
            )
    if street.wait is not None:
        weights.waits[cells] = hundredths(street.wait)


def cells_of_street(street: Street, name: str, floor_plan: FloorPlan) -> list[int]:
    """The flat cells of a street. Raises InputError."""
    if street.at is not None:
        cells = cells_of_set(name, (street.at,), floor_plan)
        if not floor_plan.drivable.flat[cells[0]]:
            x, y = street.at
            kind = floor_plan.kind_of(cells[0]).name
            raise InputError(f"{name} has the cell [{x}, {y}], a {kind}; robots do not drive there")
        return cells
    if street.path is not None:
        cells_of_set(name, street.path, floor_plan)
        return cells_of_path(name, street.path, floor_plan)
    if street.area is not None:
        return cells_of_set(name, street.area, floor_plan)
    if street.row is not None:
        first, last = street.columns or (0, floor_plan.width - 1)
        corners = ((first, street.row), (last, street.row))
    else:
        first, last = street.rows or (0, floor_plan.height - 1)
        corners = ((street.column or 0, first), (street.column or 0, last))
    return cells_of_set(name, corners, floor_plan)


def enter_path(
    weights: StreetWeights, street: Street, cells: list[int], name: str, keys: Keys
) -> None:
    """Enter the weights along a path, and back. Raises InputError for a move that the floor lacks."""
    floor_plan = weights.floor_plan
    for here, after in itertools.pairwise(cells):
        direction = floor_plan.offsets.index(after - here)
        ways = ((here, direction, street.there), (after, direction ^ 2, street.back))
        for cell, way, weight in ways:
            if weight is not None and not weights.set_move(cell, way, weight, keys):
                x, y = floor_plan.xy(cell)
                raise InputError(
                    f"{name} goes {DIRECTIONS[way]} from [{x}, {y}], where no robot can move so"
                )


# Files of streets: they become a list in the scenario, so that recordings need no further file.


def with_streets_of_file(
    document: Document, streets: Streets | None, floor_plan: FloorPlan
) -> tuple[Document, Streets | None, ReadFile | None]:
    """The streets of a scenario, with those of its file as a list. Raises InputError."""
    if not isinstance(streets, StreetPlan) or streets.file is None:
        return document, streets, None
    path = named_file(document, STREETS, "streets", streets.file)
    text = read_text(path)
    try:
        listed, lines = streets_of_text(text, floor_plan, streets.scale)
    except InputError as error:
        raise error.at(str(path), error.line) from None
    data = msgspec.to_builtins(listed)
    entries = [{key: value for key, value in entry.items() if value is not None} for entry in data]
    document = with_rows(document, STREETS, str(path), lines, streets=entries)
    return document, listed, ReadFile(str(path.resolve()), content_hash(path))


def streets_of_text(
    text: str, floor_plan: FloorPlan, scale: float | Literal["mean"] = 1.0
) -> tuple[tuple[Street, ...], list[int]]:
    """The streets of a file, one for each cell, and their lines. Raises InputError with a line."""
    rows = rows_of(text)
    line, header = next(rows, (1, []))
    if tuple(header) == GGO_COLUMNS:
        entries = list(guidance_graph_cells(rows, floor_plan, line))
    else:
        entries = list(own_cells(rows, header, floor_plan, line))
    if scale != 1.0:
        entries = scaled(entries, floor_plan, scale)
    return tuple(street for _, street in entries), [line for line, _ in entries]


def rows_of(text: str) -> Iterator[tuple[int, list[str]]]:
    """The rows of a file with commas, semicolons or tabs, without empty ones, and their lines."""
    lines = text.removeprefix("\ufeff").splitlines()
    first = next((line for line in lines if line.strip()), "")
    separator = max(",;\t", key=first.count)
    for number, line in enumerate(lines, 1):
        if line.strip(f" {separator}"):
            yield number, [part.strip() for part in next(csv.reader([line], delimiter=separator))]


def own_cells(
    rows: Iterator[tuple[int, list[str]]], header: list[str], floor_plan: FloorPlan, line: int
) -> Iterator[tuple[int, Street]]:
    """The streets of a file with the columns x, y and directions."""
    names = [name.lower() for name in header]
    for name in names:
        if name not in COLUMNS:
            raise InputError(
                f"unknown column {quoted(name)}{nearest(name, COLUMNS)}; a file of streets has the "
                f"columns {', '.join(COLUMNS)}",
                line=line,
            )
    if "x" not in names or "y" not in names or len(set(names)) != len(names) or len(names) < 3:
        raise InputError(
            f"a file of streets needs the columns x, y and some of {', '.join(COLUMNS[2:])}, each once",
            line=line,
        )
    seen: dict[tuple[int, int], int] = {}
    for number, values in rows:
        if len(values) > len(names):
            raise InputError(f"{len(values)} values for {len(names)} columns", line=number)
        given = dict(zip(names, values, strict=False))
        x, y = (coordinate(given.get(name, ""), name, number) for name in ("x", "y"))
        if (x, y) in seen:
            raise InputError(
                f"cell [{x}, {y}] appears twice, first in line {seen[x, y]}", line=number
            )
        seen[x, y] = number
        check_cell(floor_plan, x, y, number)
        exits = int(floor_plan.exits.flat[floor_plan.cell(x, y)])
        weights: dict[str, Any] = {}
        for name in COLUMNS[2:]:
            if given.get(name):
                weights[name] = weight_of(given[name], name, (x, y), number)
                if name != "wait" and not exits >> DIRECTIONS.index(name) & 1:
                    raise InputError(
                        f"cell [{x}, {y}] has a weight to the {name}, where no robot can move",
                        line=number,
                    )
        if weights:
            yield number, Street(at=(x, y), **weights)


def coordinate(text: str, name: str, line: int) -> int:
    if not re.fullmatch("[0-9]{1,6}", text):
        raise InputError(f"{name} is {quoted(text)}, not a whole number from 0", line=line)
    return int(text)


def check_cell(floor_plan: FloorPlan, x: int, y: int, line: int) -> None:
    """Robots drive on the cell. Raises InputError."""
    if not floor_plan.holds(x, y):
        raise InputError(f"cell [{x}, {y}] is off the floor {floor_plan.extent}", line=line)
    kind = floor_plan.kind_of(floor_plan.cell(x, y))
    if not kind.drivable:
        raise InputError(f"cell [{x}, {y}] is a {kind.name}, on which no robot drives", line=line)


def weight_of(text: str, name: str, cell: tuple[int, int], line: int) -> float | str:
    """The weight in a field of a cell. Raises InputError."""
    if text.lower() == CLOSED and name != "wait":
        return CLOSED
    least = 0.0 if name == "wait" else LEAST_WEIGHT
    try:
        weight = float(text)
    except ValueError:
        weight = math.nan
    if not least <= weight <= MOST_WEIGHT:
        allowed = "0 to 10,000" if name == "wait" else "0.01 to 10,000 or closed"
        x, y = cell
        raise InputError(
            f"cell [{x}, {y}] has {name} {quoted(text)}; a weight is {allowed}", line=line
        )
    return weight


def guidance_graph_cells(
    rows: Iterator[tuple[int, list[str]]], floor_plan: FloorPlan, line: int
) -> Iterator[tuple[int, Street]]:
    """The streets of a guidance graph (GGO): all cells in reading order, x: the row, y: the column."""
    expected = 0
    for line, values in rows:
        if len(values) != len(GGO_COLUMNS):
            raise InputError(
                f"{len(values)} values for {len(GGO_COLUMNS)} columns of a guidance graph",
                line=line,
            )
        y, x = coordinate(values[2], "x", line), coordinate(values[3], "y", line)
        at = divmod(expected, floor_plan.width)
        if (y, x) != at or not floor_plan.holds(x, y):
            hint = ""
            if (x, y) == at:
                hint = "; in a guidance graph x is the row and y the column"
            raise InputError(
                f"the guidance graph has the cell of row {y}, column {x}, where the floor of "
                f"{floor_plan.width} x {floor_plan.height} cells has row {at[0]}, column {at[1]}{hint}",
                line=line,
            )
        expected += 1
        cell = floor_plan.cell(x, y)
        is_wall = not floor_plan.drivable.flat[cell]
        if (values[1] in tuple(GGO_WALLS)) != is_wall:
            kind = floor_plan.kind_of(cell).name
            raise InputError(
                f"cell [{x}, {y}] is of type {quoted(values[1])} in the guidance graph, and a {kind} on "
                "this floor",
                line=line,
            )
        if not is_wall:
            yield line, graph_cell(values, floor_plan, (x, y), line)
    if expected != floor_plan.width * floor_plan.height:
        raise InputError(
            f"the guidance graph has {expected} cells, this floor of {floor_plan.width} x "
            f"{floor_plan.height} cells {floor_plan.width * floor_plan.height}",
            line=line,
        )


def graph_cell(
    values: Sequence[str], floor_plan: FloorPlan, at: tuple[int, int], line: int
) -> Street:
    """The street of a cell of a guidance graph; inf: closed, if the floor has the edge."""
    exits = int(floor_plan.exits.flat[floor_plan.cell(*at)])
    weights: dict[str, Any] = {"wait": weight_of(values[8], "wait", at, line)}
    for column, direction in enumerate(GGO_DIRECTIONS, 4):
        name, text = DIRECTIONS[direction], values[column]
        is_edge = bool(exits >> direction & 1)
        if text.lower() == "inf":
            if is_edge:
                weights[name] = CLOSED
        elif not is_edge:
            raise InputError(
                f"cell [{at[0]}, {at[1]}] has a weight to the {name}, where no robot can move",
                line=line,
            )
        else:
            weights[name] = weight_of(text, name, at, line)
    return Street(at=at, **weights)


def scaled(
    entries: list[tuple[int, Street]], floor_plan: FloorPlan, scale: float | str
) -> list[tuple[int, Street]]:
    """The streets of all cells, with scaled weights."""
    weights = streets_on(floor_plan, tuple(street for _, street in entries))
    weights.scale(scale)
    lines = {street.at: line for line, street in entries}
    found = []
    for cell in np.flatnonzero(floor_plan.drivable).tolist():
        at = floor_plan.xy(cell)
        ways: dict[str, Any] = {"wait": weights.waits[cell] / UNIT}
        for direction, way in enumerate(DIRECTIONS):
            if weights.exits[cell] >> direction & 1:
                weight = float(weights.moves[cell, direction]) / UNIT
                ways[way] = CLOSED if weights.closed[cell, direction] else weight
        found.append((lines.get(at, 1), Street(at=at, **ways)))
    return found
