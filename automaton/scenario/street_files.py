"""Files of streets: a table of cells, or a guidance graph of GGO, by its header.

    x,y,east,south,west,north,wait      id,type,x,y,weight_to_RIGHT,weight_to_UP,...
    12,0,0.5,,1,,                       0,.,0,0,0.53,inf,inf,1.2,1
    12,1,closed,,0.5,,2                 1,@,0,1,inf,inf,inf,inf,inf

They become a list in the scenario, so that recordings need no further file. A guidance graph has a line
for each cell in reading order; its x is the row and its y the column; inf: no edge. Zhang et al., IJCAI
2024.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Sequence
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError, nearest
from automaton.floor.floor_plan import DIRECTIONS, WEIGHT_UNIT, FloorPlan
from automaton.scenario.changing_floor import (
    CLOSED_MOVE,
    LEAST_WEIGHT,
    MOST_WEIGHT,
    Street,
    StreetPlan,
    Streets,
)
from automaton.scenario.document import Document
from automaton.scenario.streets import (
    STREETS,
    THEN,
    StreetWeights,
    enter_streets,
    hundredths,
    street_entries,
    streets_on,
)
from automaton.scenario.table_reader import ReadFile, named_file, with_rows
from automaton.scenario.text_files import content_hash, quoted, read_text

STREET_COLUMNS: Final = ("x", "y", *DIRECTIONS, "wait")
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


class ReadStreets(NamedTuple):
    """The streets of a scenario on its floor."""

    document: Document  # with the lines of the file
    listed: Streets | None  # with those of the file as a list
    weights: StreetWeights
    file: ReadFile | None


def read_streets(
    document: Document, streets: Streets | None, floor_plan: FloorPlan, is_closed: bool = False
) -> ReadStreets:
    """Read the file of streets, if there is one, and the weights of all streets. Raises InputError."""
    if not isinstance(streets, StreetPlan) or streets.file is None:
        return ReadStreets(document, streets, streets_on(floor_plan, streets, is_closed), None)
    path = named_file(document, STREETS, "streets", streets.file)
    text = read_text(path)
    try:
        listed, lines = streets_of_text(text, floor_plan, streets.scale, is_closed)
    except InputError as error:
        raise error.at(str(path), error.line) from None
    weights = streets_on(floor_plan, listed, is_closed)
    enter_streets(weights, streets.then, THEN)
    listed += streets.then
    rows = dict(enumerate(lines))
    document = with_rows(document, STREETS, str(path), rows, streets=street_entries(listed))
    return ReadStreets(document, listed, weights, ReadFile(str(path.resolve()), content_hash(path)))


def streets_of_text(
    text: str,
    floor_plan: FloorPlan,
    scale: float | Literal["mean"] = 1.0,
    is_closed: bool = False,
) -> tuple[tuple[Street, ...], list[int]]:
    """The streets of a file, one for each cell, and their lines. Raises InputError with a line.

    `is_closed`: the floor is without its closed moves already.
    """
    rows = rows_of(text)
    line, header = next(rows, (1, []))
    if tuple(header) == GGO_COLUMNS:
        entries = list(guidance_graph_cells(rows, floor_plan, line))
    else:
        entries = list(own_cells(rows, header, floor_plan, line, is_closed))
    if scale != 1.0:
        entries = scaled(entries, floor_plan, scale, is_closed)
    return tuple(street for _, street in entries), [line for line, _ in entries]


def rows_of(text: str) -> Iterator[tuple[int, list[str]]]:
    """The rows of a file with commas, semicolons or tabs, without empty ones, and their lines."""
    lines = text.removeprefix("\ufeff").splitlines()
    first = next((line for line in lines if line.strip()), "")
    separator = max(",;\t", key=first.count)
    for number, line in enumerate(lines, 1):
        if not line.strip(f" {separator}"):
            continue
        try:
            parts = next(csv.reader([line], delimiter=separator, strict=True))
        except csv.Error as error:
            raise InputError(f"is not CSV: {error}", line=number) from None
        yield number, [part.strip() for part in parts]


def own_cells(
    rows: Iterator[tuple[int, list[str]]],
    header: list[str],
    floor_plan: FloorPlan,
    line: int,
    is_closed: bool,
) -> Iterator[tuple[int, Street]]:
    """The streets of a file with the columns x, y and directions."""
    names = [name.lower() for name in header]
    for name in names:
        if name not in STREET_COLUMNS:
            raise InputError(
                f"unknown column {quoted(name)}{nearest(name, STREET_COLUMNS)}; a file of streets has "
                f"the columns {', '.join(STREET_COLUMNS)}",
                line=line,
            )
    if "x" not in names or "y" not in names or len(set(names)) != len(names) or len(names) < 3:
        raise InputError(
            "a file of streets needs the columns x, y and some of "
            f"{', '.join(STREET_COLUMNS[2:])}, each once",
            line=line,
        )
    line_of: dict[tuple[int, int], int] = {}
    for number, values in rows:
        if len(values) > len(names):
            raise InputError(f"{len(values)} values for {len(names)} columns", line=number)
        texts = dict(zip(names, values, strict=False))
        x, y = (coordinate(texts.get(name, ""), name, number) for name in ("x", "y"))
        if (x, y) in line_of:
            raise InputError(
                f"cell [{x}, {y}] appears twice, first in line {line_of[x, y]}", line=number
            )
        line_of[x, y] = number
        check_cell(floor_plan, x, y, number)
        cell, weights = floor_plan.cell(x, y), dict[str, Any]()
        for name in STREET_COLUMNS[2:]:
            if texts.get(name):
                weight = weights[name] = weight_of(texts[name], name, (x, y), number)
                may_lack = is_closed and weight == CLOSED_MOVE
                exits = (floor_plan.possible_exits if may_lack else floor_plan.exits).flat[cell]
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
    if text.lower() == CLOSED_MOVE and name != "wait":
        return CLOSED_MOVE
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
                f"cell [{x}, {y}] is of type {quoted(values[1])} in the guidance graph, but {kind} on "
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
                weights[name] = CLOSED_MOVE
        elif not is_edge:
            raise InputError(
                f"cell [{at[0]}, {at[1]}] has a weight to the {name}, where no robot can move",
                line=line,
            )
        else:
            weights[name] = weight_of(text, name, at, line)
    return Street(at=at, **weights)


def scaled(
    entries: list[tuple[int, Street]], floor_plan: FloorPlan, scale: float | str, is_closed: bool
) -> list[tuple[int, Street]]:
    """The streets of all cells, with scaled weights."""
    weights = streets_on(floor_plan, tuple(street for _, street in entries), is_closed)
    weights.scale(scale)
    lines = {street.at: line for line, street in entries}
    streets = []
    for cell in np.flatnonzero(floor_plan.drivable).tolist():
        at = floor_plan.xy(cell)
        ways: dict[str, Any] = {"wait": float(weights.waits[cell]) / WEIGHT_UNIT}
        for direction, way in enumerate(DIRECTIONS):
            if weights.closed[cell, direction]:
                ways[way] = CLOSED_MOVE
            elif weights.exits[cell] >> direction & 1:
                ways[way] = float(weights.moves[cell, direction]) / WEIGHT_UNIT
        streets.append((lines.get(at, 1), Street(at=at, **ways)))
    return streets


def street_table(
    names: Sequence[str],
    moves: NDArray[np.float64],
    waits: NDArray[np.float64],
    at: Sequence[tuple[int, int]],
    file: str,
    closed: NDArray[np.bool_] | None = None,
) -> str:
    """A file of streets with a line for each cell that has weights other than 1; "" for none.

    `names`: the directions of the columns of `moves` and `closed`; `at`: the cells; `file`: the origin of
    the weights. Raises InputError for a weight that is out of range.
    """
    _check_range(moves, LEAST_WEIGHT, names, at, file)
    _check_range(waits[:, None], 0.0, ["wait"], at, file)
    rows: list[tuple[Any, ...]] = []
    texts = [list(map(_field, of_cell)) for of_cell in moves.tolist()]
    for number, direction in () if closed is None else np.argwhere(closed).tolist():
        texts[number][direction] = CLOSED_MOVE
    for cell, of_moves, wait in zip(at, texts, waits.tolist(), strict=True):
        fields = {**dict(zip(names, of_moves, strict=True)), "wait": _field(wait)}
        if any(fields.values()):
            rows.append((*cell, *(fields[name] for name in STREET_COLUMNS[2:])))
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([STREET_COLUMNS, *rows] if rows else [])
    return out.getvalue()


def _check_range(
    weights: NDArray[np.float64],
    least: float,
    names: Sequence[str],
    at: Sequence[tuple[int, int]],
    file: str,
) -> None:
    """Raise InputError for the first weight that is out of range."""
    wrong = np.argwhere(~((weights >= least) & (weights <= MOST_WEIGHT)))
    if len(wrong):
        cell, column = wrong[0].tolist()
        x, y = at[cell]
        raise InputError(
            f"cell [{x}, {y}] has {names[column]} {weights[cell, column]:g}; a weight is {least:g} to "
            f"{MOST_WEIGHT:,}",
            file,
        )


def _field(weight: float) -> str:
    """A weight, rounded as streets are; nothing for 1."""
    units = hundredths(weight)
    return "" if units == WEIGHT_UNIT else f"{units / WEIGHT_UNIT:.10g}"
