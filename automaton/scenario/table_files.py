"""Tables of the floor and the fleet: names of cells, pods, starts of robots, measured durations.

    name,x,y            pod;x;y;name;class;weight;skus          x,y,heading         seconds;picker
    packing,4,2         1;2;1;A-17-3;A;380;4711 4712            0,0,east            12;A
                                                                4,0,north           14.5;B

x, y: a cell, counted from 0 at the upper left. Pods: without a column `pod` they are numbered by row;
blanks separate skus; only x and y are required. Starts: in the order of robot numbers; without a column
`heading`, fleet.heading applies. Durations: a column of ticks or times such as 20 s, as in `{empirical:
times.csv, column: seconds}`, for handling, repairs in place and random closings.

The rows become a list in the scenario, so recordings need no further files.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple, cast, get_args

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from automaton.errors import InputError, InvalidValueError, Keys, nearest
from automaton.scenario.changing_floor import Cell, Locations
from automaton.scenario.document import Document
from automaton.scenario.durations import LONGEST, Distribution, Handling
from automaton.scenario.fleet import StartFile
from automaton.scenario.pods import PodColumns, Pods
from automaton.scenario.quantities import TIME, Direction, Scale
from automaton.scenario.schema import Scenario
from automaton.scenario.table_fields import (
    COORDINATE,
    FARTHEST,
    NOTHING,
    Column,
    ColumnNames,
    NameField,
    TableOptions,
    TextField,
    column,
)
from automaton.scenario.table_reader import (
    NO_TIMES,
    ReadFile,
    TableColumns,
    named_file,
    read_columns,
    read_table,
    reading_notes,
    with_rows,
)
from automaton.scenario.text_files import quoted
from automaton.scenario.validation import NumberRange, Place, convert, validated

LOCATIONS_KEY: Final[Keys] = ("locations",)
PODS_KEY: Final[Keys] = ("pods",)
HEADING_NAMES: Final[tuple[Direction, ...]] = get_args(Direction)
PLAIN_TICKS: Final = re.compile(r"[0-9]+(\.[0-9]+)?")
DURATION: Final = Place(TIME, NumberRange(is_whole=False, ge=0, le=LONGEST))

Array = NDArray[np.int32]


class LocationColumns(ColumnNames, frozen=True, kw_only=True):
    """The columns of a file of names of cells."""

    rows, may_rename = "locations", False
    needed = ((("x",),), (("y",),))

    name: Annotated[Column, column("The name of the cell.", is_required=True)] = None
    x: Annotated[Column, column("The column of the cell.", COORDINATE)] = None
    y: Annotated[Column, column("The row of the cell.", COORDINATE)] = None


def with_locations_of_file(document: Document) -> tuple[Document, ReadFile | None]:
    """The document with the names of its file, if any, as a mapping. Raises InputError."""
    named = _locations(document)
    if not isinstance(named, str):
        return document, None
    path = named_file(document, LOCATIONS_KEY, LocationColumns.rows, named)
    cells, lines, content_hash = read_locations(path)
    document = with_rows(document, LOCATIONS_KEY, str(path), lines, locations=cells)
    return document, ReadFile(str(path.resolve()), content_hash)


def read_locations(path: Path) -> tuple[dict[str, list[int]], dict[str, int], str]:
    """Read the cell and the line of each name in a file, and the hash of the file. Raises InputError."""
    options = TableOptions(file=path.name, encoding=_encoding_of(path))
    table = read_table(path, LocationColumns, options)
    names = [table.names["name"][code] for code in table.values["name"].tolist()]
    table.refuse_again(
        "name",
        table.values["name"],
        lambda row, line: f"name {quoted(names[row])} appears twice",
    )
    table.errors.raise_any()
    rows = zip(table.values["x"].tolist(), table.values["y"].tolist(), strict=True)
    cells = dict(zip(names, map(list, rows), strict=True))
    return cells, dict(zip(names, table.lines.tolist(), strict=True)), table.content_hash


def _encoding_of(path: Path) -> Literal["utf-8", "cp1252"]:
    """UTF-8, else cp1252: a scenario cannot state the encoding of these files."""
    try:
        with path.open(encoding="utf-8-sig") as stream:
            for _ in stream:
                pass
    except UnicodeDecodeError:
        return "cp1252"
    except OSError:  # the reader raises the error
        pass
    return "utf-8"


def names_of_cells(document: Document) -> dict[str, Cell]:
    """The cell of each name: of locations, stations, and pods at their start cells.

    Requires that the files of the document have been read. Raises InputError if two things at different
    cells have the same name.
    """
    named = _locations(document)
    assert not isinstance(named, str), "its file has been read"
    names: dict[str, Cell] = dict(named)
    what = dict.fromkeys(names, "location")
    for kind, keys, name, at in _named_things(document):
        cell = named.get(at) if isinstance(at, str) else _cell(at)
        if cell is None:
            continue  # checked with its section
        if names.setdefault(name, cell) != cell:
            if kind == what[name]:
                raise InvalidValueError(keys, f"two {kind}s are called {name}")
            other = f"the {what[name]} {name} is at {list(names[name])}"
            raise InvalidValueError(keys, f"{other}, but the {kind} {name} is at {list(cell)}")
        what.setdefault(name, kind)
    return names


def _named_things(document: Document) -> Iterator[tuple[str, Keys, str, Any]]:
    """The kind, the keys, the name and the cell of each station and pod."""
    stations, pods = document.data.get("stations"), document.data.get("pods")
    for name, station in (stations if isinstance(stations, dict) else {}).items():
        if isinstance(station, dict):
            yield "station", ("stations", name), name, station.get("at")
    listed = pods.get("list") if isinstance(pods, dict) else None
    for number, pod in enumerate(listed if isinstance(listed, list | tuple) else ()):
        if isinstance(pod, dict) and isinstance(pod.get("name"), str):
            yield "pod", ("pods", "list", number), pod["name"], pod.get("at")


def _cell(at: Any) -> Cell | None:
    """A cell as the document gives it, or None."""
    if isinstance(at, list | tuple) and len(at) == 2 and all(type(one) is int for one in at):
        return at[0], at[1]
    return None


def _locations(document: Document) -> dict[str, Cell] | str:
    value = document.data.get("locations", {})
    locations: dict[str, Cell] | str = validated(value, cast("type[Any]", Locations), LOCATIONS_KEY)
    return locations


def with_pods_of_file(document: Document) -> tuple[Document, ReadFile | None]:
    """The document with the pods of its file, if any, as a list. Raises InputError."""
    section = document.data.get("pods")
    if not isinstance(section, dict) or section.get("file") is None:
        return document, None
    pods = validated(section, Pods, PODS_KEY)
    path = named_file(document, (*PODS_KEY, "file"), PodColumns.rows, str(pods.file))
    table = read_table(path, PodColumns, pods.options, pods.columns)
    rows = _sequence(table)
    _check_rows(table, list(pods.classes or ()))
    table.errors.raise_any()
    of_file = ("file", "columns", "sheet", "encoding")  # keys that a list does not have
    rest = {key: value for key, value in section.items() if key not in of_file}
    listed = {**rest, "list": _pods(table, rows)}
    keys = (*PODS_KEY, "list")
    document = with_rows(document, keys, str(path), table.lines[rows], pods=listed)
    notes = tuple(reading_notes(table, NO_TIMES))
    return document, ReadFile(str(path.resolve()), table.content_hash, notes)


def _sequence(table: TableColumns) -> Array:
    """The row of each pod, by number; mistakes are added to the errors of the table."""
    if "pod" not in table.column_of:
        return np.arange(len(table), dtype=np.int32)
    numbers, count = table.values["pod"], len(table)
    table.refuse(
        "beyond",
        "pod",
        numbers > count,
        lambda row: (
            f"{table.column_of['pod']} {numbers[row]}: pods are numbered from 1 to {count:,}"
        ),
    )
    table.refuse_again(
        "pod",
        np.where((numbers < 1) | (numbers > count), NOTHING, numbers),
        lambda row, line: (
            f"{table.column_of['pod']} {numbers[row]} appears twice (first in line {line})"
        ),
    )
    rows: Array = np.argsort(numbers, kind="stable").astype(np.int32)
    return rows


def _check_rows(table: TableColumns, classes: list[str]) -> None:
    """Names and cells of pods are unique, and their classes are in pods.classes."""
    values, names, texts = table.values, table.names["name"], table.names["class"]
    x, y, codes, called = values["x"], values["y"], values["class"], table.column_of

    def named_twice(row: int, line: int) -> str:
        name = quoted(names[values["name"][row]])
        return f"{called['name']} {name} appears twice (first in line {line})"

    def placed_twice(row: int, line: int) -> str:
        return f"a second pod stands at [{x[row]}, {y[row]}] (first in line {line})"

    def unknown(row: int) -> str:
        text = texts[codes[row]]
        there = f"pods.classes has {', '.join(classes)}" if classes else "set pods.classes"
        return f"{called['class']} {quoted(text)} is not a class of pods{nearest(text, classes)}: {there}"

    table.refuse_again("name", values["name"], named_twice)
    table.refuse_again("x", x.astype(np.int64) * (FARTHEST + 1) + y, placed_twice)
    is_known = np.array([*(text in classes for text in texts), True])  # the last one: no class
    table.refuse("unknown", "class", ~is_known[codes], unknown)
    if (codes != NOTHING).any():
        empty = f"{called['class']} is empty, where others have one"
        table.refuse("empty", "class", codes == NOTHING, lambda row: empty)


def _pods(table: TableColumns, rows: Array) -> list[dict[str, Any]]:
    values, names = table.values, table.names
    skus = [text.split() for text in names["skus"]] + [[]]  # the last one: none
    pods = []
    for row in rows.tolist():
        pod: dict[str, Any] = {"at": [int(values["x"][row]), int(values["y"][row])]}
        for field in ("name", "class"):
            code = values[field][row]
            if code != NOTHING:
                pod[field] = names[field][code]
        if values["weight"][row] != 1:
            pod["weight"] = int(values["weight"][row])
        if skus[values["skus"][row]]:
            pod["skus"] = skus[values["skus"][row]]
        pods.append(pod)
    return pods


class StartColumns(ColumnNames, frozen=True, kw_only=True):
    """The columns of a file of start cells."""

    rows, may_rename = "starts", False
    needed = ((("x",),), (("y",),), (("heading",), ()))  # either no headings, or one in each row

    x: Annotated[Column, column("The column where the robot begins.", COORDINATE)] = None
    y: Annotated[Column, column("The row where the robot begins.", COORDINATE)] = None
    heading: Annotated[
        Column,
        column(
            "The direction in which the robot faces.",
            NameField,
            known=dict(zip(HEADING_NAMES, range(4), strict=True)),
            what="direction",
            is_required=True,
        ),
    ] = None


class ReadStarts(NamedTuple):
    """The start cells of a file."""

    content_hash: str  # 16 hex digits
    cells: tuple[Cell, ...]
    headings: tuple[Direction, ...] | None
    lines: tuple[int, ...]  # line of each, from 1


def with_starts_of_file(
    document: Document, scenario: Scenario
) -> tuple[Document, Scenario, ReadFile | None]:
    """The scenario with the starts of its file, if any, as a list. Raises InputError."""
    start = scenario.fleet.start
    if not isinstance(start, StartFile):
        return document, scenario, None
    path = named_file(document, ("fleet", "start", "file"), StartColumns.rows, start.file)
    starts = read_starts(path)
    if starts.headings is not None and scenario.fleet.heading is not None:
        text = f"{start.file} has headings; leave out fleet.heading or the column of headings"
        raise InvalidValueError(("fleet", "heading"), text)
    if len(starts.cells) != scenario.fleet.robots:
        text = f"fleet.robots is {scenario.fleet.robots:,}, but {start.file} has"
        raise InvalidValueError(("fleet", "robots"), f"{text} {len(starts.cells):,} starts")
    if starts.headings is not None and "differential" not in scenario.fleet.all_kinematics:
        text = (
            f"{start.file} has headings, which belong to differential robots; leave out that column"
        )
        raise InvalidValueError(("fleet", "start", "file"), text)
    fleet = structs.replace(
        scenario.fleet, start=starts.cells, heading=starts.headings or scenario.fleet.heading
    )
    document = with_rows(document, ("fleet", "start"), str(path), starts.lines)
    file = ReadFile(str(path.resolve()), starts.content_hash)
    return document, structs.replace(scenario, fleet=fleet), file


def read_starts(path: Path) -> ReadStarts:
    """The start cells of a CSV file. Raises InputError with the line."""
    table = read_table(path, StartColumns, TableOptions(file=path.name))
    if table.counts.ignored:
        name, known = table.counts.ignored[0], StartColumns.__struct_fields__
        text = f"unknown column '{name[:40]}'{nearest(name, known)}"
        raise InputError(f"{text}; the columns are {', '.join(known)}", str(path))
    table.errors.raise_any()
    values = table.values
    headings = [HEADING_NAMES[code] for code in values["heading"].tolist() if code >= 0]
    return ReadStarts(
        table.content_hash,
        tuple(zip(values["x"].tolist(), values["y"].tolist(), strict=True)),
        tuple(headings) or None,
        tuple(table.lines.tolist()),
    )


def with_durations_of_files(
    document: Document, scenario: Scenario
) -> tuple[Scenario, list[ReadFile]]:
    """The scenario with the durations of its files as lists. Raises InputError."""
    filler = _Filler(document, scenario.units.scale)
    durations, faults, floor = scenario.durations, scenario.faults, scenario.floor
    usual = filler.of_handling(("durations",), durations.handling)
    stations = {
        name: station
        if station.handling is None
        else structs.replace(
            station, handling=filler.of_handling(("stations", name), station.handling)
        )
        for name, station in scenario.stations.items()
    }
    repair = filler.filled(("faults", "repair_in_place"), faults.repair_in_place)
    closed = tuple(
        structs.replace(closing, ticks=filler.filled(("floor", "closed", k, "for"), closing.ticks))
        for k, closing in enumerate(floor.closed)
    )
    if not filler.files:
        return scenario, filler.files
    filled = structs.replace(
        scenario,
        durations=structs.replace(durations, handling=usual),
        stations=stations,
        faults=structs.replace(faults, repair_in_place=repair),
        floor=structs.replace(floor, closed=closed),
    )
    return filled, filler.files


class _Filler:
    """Replaces file names in distributions by the durations of the files, and records the files."""

    def __init__(self, document: Document, scale: Scale) -> None:
        self.document, self.scale = document, scale
        self.files: list[ReadFile] = []

    def of_handling(self, keys: Keys, handling: Handling) -> Handling:
        """The handling times of a visit, with the durations of their files."""
        return structs.replace(
            handling, line=self.filled((*keys, "handling", "line"), handling.line)
        )

    def filled(self, keys: Keys, drawn: Any) -> Any:
        """A distribution with the values of its file; unchanged without a file."""
        if not isinstance(drawn, Distribution) or not isinstance(drawn.empirical, str):
            return drawn
        path = named_file(self.document, (*keys, "empirical"), "durations", drawn.empirical)
        table = read_columns(
            path,
            [TextField("duration")],
            TableOptions(file=drawn.empirical),
            {"duration": drawn.column or ""},
            self.scale,
        )
        values = tuple(_durations(table, self.scale))
        self.files.append(ReadFile(str(path.resolve()), table.content_hash))
        return structs.replace(drawn, empirical=values, column=None)


def _durations(table: TableColumns, scale: Scale) -> Iterator[float]:
    """The ticks in each row of a column. Raises InputError."""
    texts, codes = [*table.names["duration"], ""], table.values["duration"]  # the last one: nothing
    column = table.column_of["duration"]
    ticks, wrong = np.zeros(len(texts)), [""] * len(texts)
    for code in np.unique(codes).tolist():
        try:
            ticks[code] = _ticks(column, texts[code], scale)
        except InputError as error:
            wrong[code] = error.message
    is_bad = np.array([bool(message) for message in wrong])
    table.refuse("time", "duration", is_bad[codes], lambda row: wrong[codes[row]])
    table.errors.raise_any()
    return iter(ticks[codes].tolist())


def _ticks(column: str, text: str, scale: Scale) -> float:
    if not PLAIN_TICKS.fullmatch(text):
        return convert(column, text, DURATION, scale).value
    if float(text) > LONGEST:
        raise InputError(f"{column} must be at most {LONGEST:,} ticks, found {quoted(text)}")
    return float(text)
