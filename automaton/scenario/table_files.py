"""The pods that a scenario has in a CSV file, and what pods are called.

pod;x;y;name;class;weight;skus      pod: its number from 1; left out: as the rows come
1;2;1;A-17-3;A;380;4711 4712        skus: between blanks; only x and y are needed

The columns may be called otherwise, as `pods.columns` says.

They become the scenario's own list, so that recordings stand alone.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple, get_args

import msgspec
import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from automaton.errors import InputError, nearest
from automaton.floor.cells import STORAGE
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.columns import RowErrors, read_csv_columns
from automaton.scenario.document import (
    Document,
    Keys,
    ListFile,
    content_hash,
    content_lines,
    counted_lines,
    quoted,
    split_columns,
    whole_number,
)
from automaton.scenario.durations import LONGEST, Distribution, Handling
from automaton.scenario.fleet import StartFile
from automaton.scenario.order_columns import read_columns
from automaton.scenario.order_fields import (
    NOTHING,
    DueField,
    Field,
    NameField,
    NumberField,
    OrderColumns,
    OrderFile,
    ReleaseField,
    TextField,
    reading_notes,
)
from automaton.scenario.order_file import FARTHEST, TransportFile
from automaton.scenario.orders import MAX_STOPS, LineTable
from automaton.scenario.pods import LineDemand, Pods
from automaton.scenario.quantities import TIME, Direction, Scale
from automaton.scenario.schema import Scenario
from automaton.scenario.validation import Bounds, Place, convert, validated

PODS: Final[Keys] = ("pods",)
MOST_PODS: Final = 1_000_000
HEAVIEST: Final = 1_000_000_000
POD_FIELDS: Final[tuple[Field, ...]] = (
    NumberField("pod", 1, MOST_PODS),
    NumberField("x", 0, FARTHEST),
    NumberField("y", 0, FARTHEST),
    TextField("name"),
    TextField("class"),
    NumberField("weight", 1, HEAVIEST, default=1),
    TextField("skus"),
)
OF_FILE: Final = ("file", "columns", "sheet", "encoding")  # keys that the list does without
POD_NEEDED: Final = ((("x",),), (("y",),))  # columns

Array = NDArray[np.int32]


class PodFile(NamedTuple):
    """The file of pods that a scenario has."""

    path: str
    content_hash: str  # 16 hex digits
    notes: tuple[str, ...]  # for `check`


def with_pods_of_file(document: Document) -> tuple[Document, PodFile | None]:
    """The document with the pods of its file as a list, if it names one. Raises InputError."""
    section = document.data.get("pods")
    if not isinstance(section, dict) or section.get("file") is None:
        return document, None
    pods = validated(document, section, Pods, PODS)
    path = document.folder / str(pods.file)
    if not os.path.isfile(path):
        raise document.error((*PODS, "file"), f"there is no file of pods '{pods.file}'")
    named = None if pods.columns is None else pods.columns.of_fields
    columns = read_columns(path, POD_FIELDS, pods.options, named, Scale("1 tick"), POD_NEEDED)
    rows = _sequence(columns)
    _check_rows(columns, list(pods.classes or ()))
    columns.errors.raise_any()
    rest = {key: value for key, value in section.items() if key not in OF_FILE}
    document = replace(
        document,
        data={**document.data, "pods": {**rest, "list": _pods(columns, rows)}},
        listed=(*document.listed, ListFile((*PODS, "list"), str(path), columns.lines[rows])),
    )
    notes = tuple(reading_notes(columns, Scale("1 tick")))
    return document, PodFile(str(path.resolve()), columns.content_hash, notes)


def _sequence(columns: OrderColumns) -> Array:
    """The row of each pod, by number; mistakes go to the errors of the columns."""
    if "pod" not in columns.column_of:
        return np.arange(len(columns), dtype=np.int32)
    numbers, count = columns.values["pod"], len(columns)
    columns.refuse(
        "beyond",
        "pod",
        numbers > count,
        lambda row: (
            f"{columns.column_of['pod']} {numbers[row]}: pods are numbered from 1 to {count:,}"
        ),
    )
    _refuse_second(
        columns,
        "pod",
        np.where((numbers < 1) | (numbers > count), NOTHING, numbers),
        lambda row: f"{columns.column_of['pod']} {numbers[row]} is here twice",
    )
    rows: Array = np.argsort(numbers, kind="stable").astype(np.int32)
    return rows


def _check_rows(columns: OrderColumns, classes: list[str]) -> None:
    """No two pods have a name or a cell, and classes are those of the scenario."""
    values, names, texts = columns.values, columns.names["name"], columns.names["class"]
    x, y, codes, called = values["x"], values["y"], values["class"], columns.column_of

    def named_twice(row: int) -> str:
        return f"{called['name']} {quoted(names[values['name'][row]])} is here twice"

    def unknown(row: int) -> str:
        text = texts[codes[row]]
        there = f"pods.classes has {', '.join(classes)}" if classes else "set pods.classes"
        return f"{called['class']} {quoted(text)} is not a class of pods{nearest(text, classes)}: {there}"

    _refuse_second(columns, "name", values["name"], named_twice)
    places = x.astype(np.int64) * (FARTHEST + 1) + y
    _refuse_second(columns, "x", places, lambda row: f"a second pod stands at [{x[row]}, {y[row]}]")
    is_known = np.array([*(text in classes for text in texts), True])  # the last one: no class
    columns.refuse("unknown", "class", ~is_known[codes], unknown)
    if (codes != NOTHING).any():
        empty = f"{called['class']} is empty, where others have one"
        columns.refuse("empty", "class", codes == NOTHING, lambda row: empty)


def _refuse_second(
    columns: OrderColumns, field: str, codes: NDArray[Any], sentence: Callable[[int], str]
) -> None:
    """Refuse rows with a code that a row before them has."""
    _, first, which = np.unique(codes, return_index=True, return_inverse=True)
    again = codes != NOTHING
    again[first] = False
    columns.refuse(
        "twice",
        field,
        again,
        lambda row: f"{sentence(row)} (first in line {columns.lines[first[which[row]]]})",
    )


def _pods(columns: OrderColumns, rows: Array) -> list[dict[str, Any]]:
    values, names = columns.values, columns.names
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


def pod_cells(scenario: Scenario, floor_plan: FloorPlan) -> NDArray[np.intp]:
    """Flat cells of pods 0, 1, ... at the start: as listed, or as one reads the picture."""
    listed = scenario.pods.listed
    if listed is not None:
        return np.array([floor_plan.cell(*pod.at) for pod in listed], np.intp)
    drawn: NDArray[np.intp] = np.flatnonzero((floor_plan.kind == STORAGE) & (floor_plan.loads != 0))
    return drawn


def pod_names(scenario: Scenario, count: int) -> list[str]:
    """The name of each of so many pods, its number from 1 where it has none."""
    names = [str(k + 1) for k in range(count)]
    for k, pod in enumerate(scenario.pods.listed or ()):
        names[k] = names[k] if pod.name is None else pod.name
    return names


def pod_numbers(scenario: Scenario, count: int) -> dict[str, int]:
    """The number of each of so many pods, from 0, by its name and by its number from 1 as text."""
    numbers = {str(k + 1): k for k in range(count)}
    return numbers | {name: k for k, name in enumerate(pod_names(scenario, count))}


def skus_of(scenario: Scenario) -> dict[str, int]:
    """The number of each SKU that a pod holds, in the sequence of the pods."""
    listed = scenario.pods.listed or ()
    return {
        sku: k for k, sku in enumerate(dict.fromkeys(sku for pod in listed for sku in pod.skus))
    }


# The lines of a CSV file, as warehouse systems write them, as the lines of a scenario.
#
# released;pod;sku;station;units released: a tick, a time such as 20 s, or a clock time 07:31;12;;P1;2
# pod, station: name or number; station may be empty 07:31;;4711;;1 sku: of any pod that holds it


FILE: Final[Keys] = ("orders", "lines", "file")
MOST_UNITS: Final = 1_000_000
PLACES: Final = ((("pod",), ("sku",)),)  # what must be there, beside the release


def with_lines_of_file(
    document: Document, scenario: Scenario, floor_plan: FloorPlan
) -> tuple[Document, Scenario, TransportFile | None]:
    """The scenario with the lines of its file as a list, if it names one. Raises InputError."""
    demand = scenario.orders.lines
    if not isinstance(demand, LineDemand) or demand.file is None:
        return document, scenario, None
    path = document.folder / demand.file
    if not os.path.isfile(path):
        raise document.error(FILE, f"there is no file of lines '{demand.file}'")
    stations = [*scenario.stations, *range(1, len(floor_plan.stations) + 1)]
    fields: list[Field] = [
        ReleaseField(),
        DueField(),
        TextField("order"),
        TextField("pod"),
        TextField("sku"),
        NameField("station", {str(name): k for k, name in enumerate(stations)}, "station"),
        NumberField("priority", -100, 100, default=0),
        NumberField("units", 0, MOST_UNITS, default=1),
    ]
    named = None if demand.columns is None else demand.columns.of_fields
    scale = scenario.units.scale
    columns = read_columns(path, fields, demand, named, scale, PLACES)
    count = len(pod_cells(scenario, floor_plan))
    pods = _pods_of_rows(columns, pod_numbers(scenario, count), skus_of(scenario))
    columns.errors.raise_any()
    listed = ListFile(("orders", "lines"), columns.path, columns.lines)
    lines = LineTable(
        {**columns.values, "pod": pods},
        columns.names["order"],
        [
            k + 1 if name == str(k + 1) else name
            for k, name in enumerate(pod_names(scenario, count))
        ],
        columns.names["sku"],
        stations,
    )
    orders = msgspec.structs.replace(scenario.orders, lines=lines)
    file = TransportFile.of(path, columns, scale)
    document = replace(document, listed=(*document.listed, listed))
    return document, msgspec.structs.replace(scenario, orders=orders), file


def _pods_of_rows(
    columns: OrderColumns, numbers: dict[str, int], skus: Collection[str]
) -> NDArray[np.int32]:
    """(n,) the pod that each row names, NOTHING where it has a SKU alone.

    Rows with neither, or with one that is not known, go to the errors of the columns.
    """
    values, names = columns.values, columns.names
    pod, sku = values["pod"], values["sku"]
    of_pod = np.array([*(numbers.get(text, NOTHING) for text in names["pod"]), NOTHING], np.int32)
    is_sku = np.array([*(text in skus for text in names["sku"]), False])
    numbered: NDArray[np.int32] = of_pod[pod]
    wants_sku = (pod == NOTHING) & (sku != NOTHING)

    def is_no_pod(row: int) -> str:
        text = names["pod"][pod[row]]
        return f"{columns.column_of['pod']} {quoted(text)} is not a pod{nearest(text, numbers)}"

    def is_no_sku(row: int) -> str:
        text = names["sku"][sku[row]]
        like = (
            nearest(text, skus) if skus else ": pods have none; set skus in pods.list or its file"
        )
        return f"{columns.column_of['sku']} {quoted(text)} is not a SKU of a pod{like}"

    columns.refuse("unknown", "pod", (pod != NOTHING) & (numbered == NOTHING), is_no_pod)
    columns.refuse("unknown", "sku", wants_sku & ~is_sku[sku], is_no_sku)
    empty = (pod == NOTHING) & (sku == NOTHING)
    wanted = [columns.column_of[name] for name in ("pod", "sku") if name in columns.column_of]
    says = " and ".join(wanted) + (" are empty" if len(wanted) > 1 else " is empty")
    if "sku" not in columns.column_of:
        says += "; a line without a pod needs a SKU, in a column of its own"
    columns.refuse("empty", "pod", empty, lambda row: says)
    return numbered


# Where robots begin as a CSV file, one line each in the order of their numbers.
#
# x,y,heading x, y: a cell, counted from 0 at the upper left 0,0,east heading: which way the robot
# faces; without the column, as fleet.heading says 4,0,north
#
# The content becomes the scenario's own list of starts, so that recordings stand alone.


HEADINGS: Final[tuple[Direction, ...]] = get_args(Direction)
START_FIELDS: Final = (
    NumberField("x", 0, FARTHEST),
    NumberField("y", 0, FARTHEST),
    NameField("heading", dict(zip(HEADINGS, range(4), strict=True)), "direction", is_required=True),
)
# Of headings there is no column, or one in all rows.
START_NEEDED: Final = ((("x",),), (("y",),), (("heading",), ()))


class ReadStarts(NamedTuple):
    """The starts of a file."""

    path: str
    content_hash: str  # 16 hex digits
    cells: tuple[tuple[int, int], ...]
    headings: tuple[Direction, ...] | None
    lines: tuple[int, ...]  # where each of them stands, from 1


def with_starts_of_file(
    document: Document, scenario: Scenario
) -> tuple[Document, Scenario, ReadStarts | None]:
    """The scenario with the starts of its file as a list, if it names one. Raises InputError."""
    start = scenario.fleet.start
    if not isinstance(start, StartFile):
        return document, scenario, None
    path = document.folder / start.file
    if not os.path.isfile(path):
        text = f"there is no file of starts '{start.file}'"
        raise document.error(("fleet", "start", "file"), text)
    starts = read_starts(path)
    if starts.headings is not None and scenario.fleet.heading is not None:
        text = f"the headings are in {start.file}; leave out fleet.heading, or that column"
        raise document.error(("fleet", "heading"), text)
    if len(starts.cells) != scenario.fleet.robots:
        text = f"fleet.robots is {scenario.fleet.robots:,}, but {start.file} has"
        raise document.error(("fleet", "robots"), f"{text} {len(starts.cells):,} starts")
    if starts.headings is not None and "differential" not in scenario.fleet.all_kinematics:
        text = (
            f"{start.file} has headings, which belong to differential robots; leave out that column"
        )
        raise document.error(("fleet", "start", "file"), text)
    fleet = msgspec.structs.replace(
        scenario.fleet, start=starts.cells, heading=starts.headings or scenario.fleet.heading
    )
    listed = ListFile(("fleet", "start"), starts.path, starts.lines)
    document = replace(document, listed=(*document.listed, listed))
    absolute = starts._replace(path=str(path.resolve()))
    return document, msgspec.structs.replace(scenario, fleet=fleet), absolute


def read_starts(path: Path) -> ReadStarts:
    """The starts of a CSV file. Raises InputError with the line."""
    columns = read_columns(
        path,
        START_FIELDS,
        OrderFile(file=path.name),
        None,
        Scale("1 tick"),
        START_NEEDED,
        may_rename=False,
    )
    if columns.counts.ignored:
        name, known = columns.counts.ignored[0], [field.name for field in START_FIELDS]
        text = f"unknown column '{name[:40]}'{nearest(name, known)}"
        raise InputError(f"{text}; the columns are {', '.join(known)}", str(path))
    columns.errors.raise_any()
    values = columns.values
    headings = [HEADINGS[code] for code in values["heading"].tolist() if code >= 0]
    return ReadStarts(
        str(path),
        columns.content_hash,
        tuple(zip(values["x"].tolist(), values["y"].tolist(), strict=True)),
        tuple(headings) or None,
        tuple(columns.lines.tolist()),
    )


# Tasks as a text file, one line each, below the number of tasks.
#
# # tasks of two cells on a floor of 32 columns 2 34,101 7,640
#
# Lines that begin with # and empty ones are skipped. A cell is row * width + column, counted from 0
# at the upper left. Problems of the League of Robot Runners have their tasks in such files. The
# content becomes the scenario's own list of tasks, so that recordings stand alone.


TASKS: Final[Keys] = ("orders", "tasks")


class TaskFile(NamedTuple):
    """The tasks of a file; whether there are such cells is known to who has the floor."""

    path: str
    content_hash: str  # 16 hex digits
    tasks: tuple[tuple[int, ...], ...]  # the cells of each
    lines: tuple[int, ...]  # where each task stands, from 1


def with_tasks_of_file(
    document: Document, scenario: Scenario, floor_plan: FloorPlan
) -> tuple[Document, Scenario, TaskFile | None]:
    """The scenario with the tasks of its file, if it names one. Raises InputError."""
    name = scenario.orders.tasks
    if not isinstance(name, str):
        return document, scenario, None
    path = document.folder / name
    if not os.path.isfile(path):
        raise document.error(TASKS, f"there is no file of tasks '{name}'")
    found = read_tasks(path)
    orders = msgspec.structs.replace(scenario.orders, tasks=_places(found, floor_plan))
    listed = ListFile(TASKS, found.path, found.lines)
    document = replace(document, listed=(*document.listed, listed))
    absolute = found._replace(path=str(path.resolve()))
    return document, msgspec.structs.replace(scenario, orders=orders), absolute


def read_tasks(path: Path, most: int = MAX_STOPS) -> TaskFile:
    """The tasks of a file, of at most so many cells each. Raises InputError with the line."""
    file = str(path)
    below = counted_lines(content_lines(path), "task", file)
    tasks = []
    for line in below:
        cells = tuple(
            whole_number(text, "a cell of a task", file, line.number, column)
            for column, text in split_columns(line.text, ",")
        )
        if len(cells) > most:
            text = f"the task has {len(cells)} cells, at most {most} are possible"
            raise InputError(text, file, line.number)
        tasks.append(cells)
    return TaskFile(file, content_hash(path), tuple(tasks), tuple(line.number for line in below))


def _places(found: TaskFile, floor_plan: FloorPlan) -> tuple[tuple[tuple[int, int], ...], ...]:
    """The cells (x, y) of each task. Raises InputError for one that lies outside the floor."""
    width, size = floor_plan.width, floor_plan.width * floor_plan.height
    for cells, line in zip(found.tasks, found.lines, strict=True):
        for cell in cells:
            if not 0 <= cell < size:
                text = f"cell {cell} lies outside the floor (cells 0 to {size - 1:,})"
                raise InputError(text, found.path, line)
    return tuple(tuple((cell % width, cell // width) for cell in cells) for cells in found.tasks)


# Measured durations, of a column of a CSV file: `{empirical: times.csv, column: seconds}`.
#
# Of handling, of repairs in place and of closings by chance.
#
# A value is a number of ticks or a time such as 20 s. The values become the scenario's own, so that
# recordings stand alone.


NUMBER: Final = re.compile(r"[0-9]+(\.[0-9]+)?")
PLACE: Final = Place(TIME, Bounds(is_whole=False, ge=0, le=LONGEST))


class DurationFile(NamedTuple):
    """A file that was read."""

    path: str
    content_hash: str  # 16 hex digits


def with_durations_of_files(
    document: Document, scenario: Scenario
) -> tuple[Scenario, list[DurationFile]]:
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
    """Puts durations of files into distributions, and notes the files."""

    def __init__(self, document: Document, scale: Scale) -> None:
        self.document, self.scale = document, scale
        self.files: list[DurationFile] = []

    def of_handling(self, keys: Keys, handling: Handling) -> Handling:
        """What a visit takes, its lines by what stands in their file."""
        return structs.replace(
            handling, line=self.filled((*keys, "handling", "line"), handling.line)
        )

    def filled(self, keys: Keys, drawn: Any) -> Any:
        """A distribution with the values of its file, if it names one; anything else as it is."""
        if not isinstance(drawn, Distribution) or not isinstance(drawn.empirical, str):
            return drawn
        path = self.document.folder / drawn.empirical
        if not path.exists():
            text = f"there is no file of durations '{drawn.empirical}'"
            raise self.document.error((*keys, "empirical"), text)
        values = tuple(durations_of(path, drawn.column or "", self.scale))
        self.files.append(DurationFile(str(path.resolve()), content_hash(path)))
        return structs.replace(drawn, empirical=values, column=None)


def durations_of(path: Path, column: str, scale: Scale) -> Iterator[float]:
    """The ticks in a column of a file, row by row. Raises InputError."""

    def choose(head: Sequence[str], line: int) -> dict[str, str]:
        if column not in head:
            there = f"the columns are {', '.join(filter(None, head))}"
            text = f"there is no column '{column}'{nearest(column, head)}; {there}"
            raise InputError(text, str(path), line)
        return {column: column}

    errors = RowErrors(str(path))
    table = read_csv_columns(path, "utf-8", choose, errors)
    if not len(table.lines):
        raise InputError("has no rows below its head", str(path))
    texts, codes = table.columns[column]
    ticks: list[float] = []
    for code, text in enumerate(texts):
        try:
            ticks.append(_ticks(column, text, scale))
        except InputError as error:
            rows = codes == code
            ticks.append(0.0)
            errors.add("time", table.lines[rows].tolist(), error.message.__str__)
    errors.raise_any()
    return (ticks[code] for code in codes.tolist())


def _ticks(column: str, text: str, scale: Scale) -> float:
    if not NUMBER.fullmatch(text):
        return convert(column, text, PLACE, scale).value
    if float(text) > LONGEST:
        raise InputError(f"{column} must be at most {LONGEST:,} ticks, found {quoted(text)}")
    return float(text)
