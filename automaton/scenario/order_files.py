"""Orders in files: transports, lines and rates by hour as tables, tasks as text.

    released,from,to            released;pod;sku;station;units            # tasks of two cells
    0,rack-7,packing            07:31;12;;P1;2                            2
    06:30,rack-9,packing        07:31;;4711;;1                            34,101
                                                                          7,640

Transports go from cell to cell, by name or as from_x, from_y, to_x, to_y. A line requests a pod, or any
pod with a SKU; its station may be empty. `released` is a tick, a time such as 20 s, or a clock time. The
cells of a task are row * width + column, from 0 at the upper left, as in the League of Robot Runners.

The rows become a list in the scenario, so recordings need no further files.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError, InvalidValueError, Keys, nearest
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.arrivals import (
    HOURS_OF_DAY,
    MAX_RATE,
    WEEKDAYS,
    HourlyRate,
    hour_text,
    missing_hours,
)
from automaton.scenario.changing_floor import Cell
from automaton.scenario.columns import QuarantinedRows
from automaton.scenario.document import Document
from automaton.scenario.order_lines import (
    Day,
    LineTable,
    pod_cells,
    pod_names,
    pod_numbers,
    skus_of,
)
from automaton.scenario.orders import (
    LineColumns,
    LineDemand,
    OrderLine,
    TransportColumns,
    Transports,
)
from automaton.scenario.quantities import MAX_STOPS, DueAt, Scale
from automaton.scenario.schema import Scenario
from automaton.scenario.table_fields import (
    NO_DUE,
    NOTHING,
    Column,
    ColumnNames,
    NumberField,
    Quarantine,
    TableOptions,
    column,
)
from automaton.scenario.table_files import names_of_cells
from automaton.scenario.table_reader import (
    NO_TIMES,
    ReadFile,
    TableColumns,
    file_warnings,
    matching_files,
    named_file,
    read_table,
    reading_notes,
    with_rows,
)
from automaton.scenario.text_files import (
    content_hash,
    content_lines,
    counted_lines,
    quoted,
    split_columns,
    whole_number,
)

TRANSPORTS_KEY: Final[Keys] = ("orders", "transports", "file")
LINES_KEY: Final[Keys] = ("orders", "lines", "file")
TASKS_KEY: Final[Keys] = ("orders", "tasks")
PROFILE_KEY: Final[Keys] = ("orders", "arrivals", "profile")
RATE: Final = re.compile(r"[0-9]{1,9}(?:[.,][0-9]{1,9})?")

Array = NDArray[np.int32]


def files_of_orders(document: Document, scenario: Scenario) -> tuple[Path, ...]:
    """The files of transports that a scenario names; () if it has none. Raises InputError."""
    transports = scenario.orders.transports
    if transports is None:
        return ()
    return matching_files(document, TRANSPORTS_KEY, TransportColumns.rows, transports.file)


def files_of_lines(document: Document, scenario: Scenario) -> tuple[Path, ...]:
    """The files of lines that a scenario names; () if it has none. Raises InputError."""
    demand = scenario.orders.lines
    if not isinstance(demand, LineDemand) or demand.file is None:
        return ()
    return matching_files(document, LINES_KEY, LineColumns.rows, demand.file)


def day_of_orders(document: Document, scenario: Scenario, path: Path) -> tuple[Day, Document]:
    """The transports of a file as a list of orders, and the document with its rows. Raises InputError."""
    transports = scenario.orders.transports
    assert transports is not None, "the scenario has a file of transports"
    names = names_of_cells(document)
    known = {name: number for number, name in enumerate(names)}
    table = read_table(
        path,
        TransportColumns,
        transports,
        transports.columns,
        scenario.units.scale,
        {"from": known, "to": known},
    )
    if not names and {"from", "to"} & set(table.column_of):
        raise InputError(
            "names cells, but the scenario has no locations; set locations: {NAME: [x, y]} or "
            "locations: FILE, or use columns from_x, from_y, to_x and to_y",
            str(path),
            1,
        )
    mistakes = table.settle(transports)
    quarantine = _quarantine(document, path, transports, mistakes)
    document = with_rows(document, ("orders", "list"), table.path, table.lines)
    orders = msgspec.structs.replace(
        scenario.orders, transports=None, listed=_transports(table, list(names.values()))
    )
    file = _read_file(path, table, scenario.units.scale, quarantine)
    return Day(file, orders, _key(table, transports)), document


def _key(table: TableColumns, options: TableOptions) -> str:
    """Hash of the content of a file and of the options that read it, except its name."""
    how = {key: value for key, value in msgspec.to_builtins(options).items() if key != "file"}
    how["several"] = options.names_several
    text = json.dumps([table.content_hash, how], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _read_file(
    path: Path, table: TableColumns, scale: Scale, quarantine: QuarantinedRows | None
) -> ReadFile:
    return ReadFile(
        str(path.resolve()),
        table.content_hash,
        tuple(reading_notes(table, scale)),
        tuple(file_warnings(table)),
        table.counts.selected,
        table.counts.skipped,
        quarantine,
    )


def _quarantine(
    document: Document, path: Path, options: TableOptions, mistakes: dict[int, str]
) -> QuarantinedRows | None:
    """The skipped rows of a file and the file for them, if the scenario names one. Raises InputError."""
    if not isinstance(options.unknown, Quarantine):
        return None
    target = document.folder / options.unknown.quarantine
    if options.names_several:
        target = target.with_name(f"{target.stem}-{path.stem}{target.suffix}")
    if target.resolve() == path.resolve() or target.match(options.file):
        key = "transports" if isinstance(options, Transports) else "lines"
        text = f"the quarantine '{options.unknown.quarantine}' must not be a file of orders"
        raise InvalidValueError(("orders", key, "unknown"), text)
    return QuarantinedRows(target, path, options.encoding, options.sheet, mistakes)


def _transports(table: TableColumns, cells: list[Cell]) -> tuple[OrderLine, ...]:
    """The orders of a table: about 140 bytes each, as equal cells and numbers are one object."""
    values, classes = table.values, [*table.names["class"], None]  # the last one: none
    rows = zip(
        _ends(table, "from", cells),
        _ends(table, "to", cells),
        _shared(values["released"].tolist()),
        values["weight"].tolist(),
        values["priority"].tolist(),
        _due(values["released"].tolist(), values["due"].tolist()),
        map(classes.__getitem__, values["class"].tolist()),
        strict=True,
    )
    return tuple(
        OrderLine(
            source=source,
            target=target,
            release=release,
            weight=weight,
            priority=priority,
            due=due,
            order_class=order_class,
        )
        for source, target, release, weight, priority, due, order_class in rows
    )


def _due(released: list[int], due: list[int]) -> Iterator[int | DueAt | None]:
    """Due time of each order in ticks after its release; before its release: the tick itself."""
    known: dict[int, int] = {}
    for release, tick in zip(released, due, strict=True):
        if tick == NO_DUE:
            yield None
        elif tick < release:
            yield DueAt(at=tick)
        else:
            yield known.setdefault(tick - release, tick - release)


def _shared(numbers: list[int]) -> Iterator[int]:
    """The same numbers, equal ones as one object: saves 32 bytes each."""
    known: dict[int, int] = {}
    return (known.setdefault(number, number) for number in numbers)


def _ends(table: TableColumns, end: str, cells: list[Cell]) -> list[Cell]:
    """The cell in each row where its order begins or ends; equal cells are one object."""
    if end in table.column_of:
        return list(map(cells.__getitem__, table.values[end].tolist()))
    pairs = np.stack([table.values[f"{end}_x"], table.values[f"{end}_y"]], axis=1)
    different, which = np.unique(pairs, axis=0, return_inverse=True)
    known = [(x, y) for x, y in different.tolist()]
    return list(map(known.__getitem__, which.reshape(-1).tolist()))


def day_of_lines(
    document: Document, scenario: Scenario, floor_plan: FloorPlan, path: Path
) -> tuple[Day, Document]:
    """The lines of a file as a table, and the document with its rows. Raises InputError."""
    demand = scenario.orders.lines
    assert isinstance(demand, LineDemand), "the scenario has a file of lines"
    stations = [*scenario.stations, *range(1, len(floor_plan.stations) + 1)]
    known = {"station": {str(name): k for k, name in enumerate(stations)}}
    table = read_table(path, LineColumns, demand, demand.columns, scenario.units.scale, known)
    count = len(pod_cells(scenario, floor_plan))
    table.values["pod"] = _pods_of_rows(table, pod_numbers(scenario, count), skus_of(scenario))
    mistakes = table.settle(demand)
    quarantine = _quarantine(document, path, demand, mistakes)
    lines = LineTable(
        table.values,
        table.names["order"],
        [
            k + 1 if name == str(k + 1) else name
            for k, name in enumerate(pod_names(scenario, count))
        ],
        table.names["sku"],
        stations,
        table.names["class"],
    )
    orders = msgspec.structs.replace(scenario.orders, lines=lines)
    file = _read_file(path, table, scenario.units.scale, quarantine)
    document = with_rows(document, ("orders", "lines"), table.path, table.lines)
    return Day(file, orders, _key(table, demand)), document


def _pods_of_rows(table: TableColumns, numbers: dict[str, int], skus: Collection[str]) -> Array:
    """(n,) the pod that each row names, NOTHING if it has only a SKU.

    Rows with neither, or with an unknown one, are added to the errors of the table.
    """
    values, names = table.values, table.names
    pod, sku = values["pod"], values["sku"]
    of_pod = np.array([*(numbers.get(text, NOTHING) for text in names["pod"]), NOTHING], np.int32)
    is_sku = np.array([*(text in skus for text in names["sku"]), False])
    numbered: Array = of_pod[pod]
    wants_sku = (pod == NOTHING) & (sku != NOTHING)

    def is_no_pod(row: int) -> str:
        text = names["pod"][pod[row]]
        return f"{table.column_of['pod']} {quoted(text)} is not a pod{nearest(text, numbers)}"

    def is_no_sku(row: int) -> str:
        text = names["sku"][sku[row]]
        like = (
            nearest(text, skus) if skus else ": pods have none; set skus in pods.list or its file"
        )
        return f"{table.column_of['sku']} {quoted(text)} is not a SKU of a pod{like}"

    table.refuse("unknown", "pod", (pod != NOTHING) & (numbered == NOTHING), is_no_pod)
    table.refuse("unknown", "sku", wants_sku & ~is_sku[sku], is_no_sku)
    empty = (pod == NOTHING) & (sku == NOTHING)
    wanted = [table.column_of[name] for name in ("pod", "sku") if name in table.column_of]
    says = " and ".join(wanted) + (" are empty" if len(wanted) > 1 else " is empty")
    if "sku" not in table.column_of:
        says += "; a line without a pod needs a SKU in a separate column"
    table.refuse("empty", "pod", empty, lambda row: says)
    return numbered


class RateColumns(ColumnNames, frozen=True, kw_only=True):
    """The columns of a file of rates by the hour of the week."""

    rows, may_rename = "rates", False
    needed = ((("weekday",),), (("hour",),), (("orders",),))

    weekday: Annotated[
        Column, column("The day, 1 to 7 from Monday.", NumberField, least=1, most=WEEKDAYS)
    ] = None
    hour: Annotated[
        Column, column("The hour, 0 to 23.", NumberField, least=0, most=HOURS_OF_DAY - 1)
    ] = None
    orders: Annotated[
        Column, column("Mean number of orders that arrive in the hour.", is_required=True)
    ] = None


def with_rates_of_file(
    document: Document, scenario: Scenario
) -> tuple[Document, Scenario, ReadFile | None]:
    """The scenario with the rates of the file of its profile as a list. Raises InputError."""
    arrivals = scenario.orders.arrivals
    if arrivals is None or not isinstance(arrivals.profile, str):
        return document, scenario, None
    path = named_file(document, PROFILE_KEY, RateColumns.rows, arrivals.profile)
    table = read_table(path, RateColumns, TableOptions(file=path.name))
    rates = _rates(table)
    day_and_hour = zip(table.values["weekday"].tolist(), table.values["hour"].tolist(), strict=True)
    profile = tuple(
        HourlyRate(weekday=weekday, hour=hour, orders=rate)
        for (weekday, hour), rate in zip(day_and_hour, rates, strict=True)
    )
    change = msgspec.structs.replace
    orders = change(scenario.orders, arrivals=change(arrivals, profile=profile))
    document = with_rows(document, PROFILE_KEY, table.path, table.lines)
    file = ReadFile(str(path.resolve()), table.content_hash, tuple(reading_notes(table, NO_TIMES)))
    return document, change(scenario, orders=orders), file


def _rates(table: TableColumns) -> list[float]:
    """The rate in each row; every hour of a day that appears has one. Raises InputError."""
    values, column, texts = table.values, table.column_of["orders"], table.names["orders"]
    written = [texts[code] if code != NOTHING else "" for code in values["orders"].tolist()]
    plain = [text.replace(",", ".") if RATE.fullmatch(text) else "" for text in written]
    is_bad = np.array([not text or float(text) > MAX_RATE for text in plain])
    is_bad &= values["orders"] != NOTHING

    def is_no_rate(row: int) -> str:
        return f"{column} must be a number from 0 to {MAX_RATE:,}, found {quoted(written[row])}"

    hours = (values["weekday"].astype(np.int64) - 1) * HOURS_OF_DAY + values["hour"]
    table.refuse("number", "orders", is_bad, is_no_rate)
    table.errors.raise_any()
    table.refuse_again(
        "hour",
        hours,
        lambda row, line: f"{hour_text(int(hours[row]))} appears twice (first in line {line})",
    )
    table.errors.raise_any()
    for day, hour in missing_hours(hours.tolist()):
        line = int(table.lines[hours // HOURS_OF_DAY == day][0])
        text = f"weekday {day + 1} has no row for hour {hour}; write 0 if no orders arrive in it"
        raise InputError(text, table.path, line)
    return [float(text) for text in plain]


class TaskFile(NamedTuple):
    """The tasks of a file; their cells are not yet checked against the floor."""

    path: str
    tasks: tuple[tuple[int, ...], ...]  # the cells of each
    lines: tuple[int, ...]  # line of each task, from 1


def with_tasks_of_file(
    document: Document, scenario: Scenario, floor_plan: FloorPlan
) -> tuple[Document, Scenario, ReadFile | None]:
    """The scenario with the tasks of its file, if it names one. Raises InputError."""
    name = scenario.orders.tasks
    if not isinstance(name, str):
        return document, scenario, None
    path = named_file(document, TASKS_KEY, "tasks", name)
    found = read_tasks(path)
    orders = msgspec.structs.replace(scenario.orders, tasks=_places(found, floor_plan))
    document = with_rows(document, TASKS_KEY, found.path, found.lines)
    file = ReadFile(str(path.resolve()), content_hash(path))
    return document, msgspec.structs.replace(scenario, orders=orders), file


def read_tasks(path: Path, most: int = MAX_STOPS) -> TaskFile:
    """The tasks of a file, of at most `most` cells each. Raises InputError with the line."""
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
    return TaskFile(file, tuple(tasks), tuple(line.number for line in below))


def _places(found: TaskFile, floor_plan: FloorPlan) -> tuple[tuple[tuple[int, int], ...], ...]:
    """The cells (x, y) of each task. Raises InputError for one that lies outside the floor."""
    width, size = floor_plan.width, floor_plan.width * floor_plan.height
    for cells, line in zip(found.tasks, found.lines, strict=True):
        for cell in cells:
            if not 0 <= cell < size:
                text = f"cell {cell} lies outside the floor (cells 0 to {size - 1:,})"
                raise InputError(text, found.path, line)
    return tuple(tuple((cell % width, cell // width) for cell in cells) for cells in found.tasks)
