"""The tables of a run and their columns: names, kinds and meanings.

Until they are written, rows are NumPy arrays by column. Unknown values are NO_NUMBER for whole numbers,
NaN for other numbers, and NO_TEXT for texts and flags. A text is stored as its index in a list of texts,
a flag as 1 or 0. This module imports without Numba and pyarrow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.runs.task_metrics import Measured
from automaton.units import exact_time

if TYPE_CHECKING:
    import pyarrow as pa

    from automaton.world.resolved import Resolved

Array = NDArray[Any]
Rows = Mapping[str, Array]  # (k,) each, by column

INTEGER: Final = "whole number"
TICKS: Final = "ticks"  # a whole number; with a column of seconds if a tick has a time unit
NUMBER: Final = "number"
TEXT: Final = "text"
FLAG: Final = "true or false"

NO_NUMBER: Final = int(np.iinfo(np.int64).min)
NO_TEXT: Final = -1
SUFFIX_OF_SECONDS: Final = "_s"  # end of the names of columns of seconds


class TableColumn(NamedTuple):
    """A column of a table."""

    name: str
    kind: str
    meaning: str


class Form(NamedTuple):
    """The form of a table: its name, columns, texts and length of a tick."""

    name: str
    columns: tuple[TableColumn, ...]
    texts: Mapping[str, Sequence[str]]  # by column of texts
    tick: Fraction | None  # seconds; None: a tick has no time unit

    def names(self) -> list[str]:
        """The names of all columns, including columns of seconds."""
        names = []
        for column in self.columns:
            names.append(column.name)
            if column.kind == TICKS and self.tick is not None:
                names.append(column.name + SUFFIX_OF_SECONDS)
        return names


ORDER_COLUMNS: Final = (
    TableColumn("order", INTEGER, "number of the order, from 0"),
    TableColumn(
        "priority",
        INTEGER,
        "priority of the order: the highest of its lines; larger numbers come first",
    ),
    TableColumn("released", TICKS, "release tick of the order; empty: not in this run"),
    TableColumn("due", TICKS, "due tick of the order"),
    TableColumn("done", TICKS, "tick in which the order was done; empty: open at the end"),
    TableColumn("lead_time", TICKS, "time from the release until the order was done"),
    TableColumn(
        "tardiness",
        TICKS,
        "time from `due` until the order was done, or to the end of the run; 0: on time",
    ),
    TableColumn(
        "late",
        FLAG,
        "whether the order was done late, or is open and past due at the end; empty: unknown",
    ),
    TableColumn("lines", INTEGER, "number of lines of the order; empty if orders have no lines"),
    TableColumn("name", TEXT, "name of the order in the list or file of lines"),
)
LINE_COLUMNS: Final = (
    TableColumn("line", INTEGER, "number of the line, from 0"),
    TableColumn("order", INTEGER, "the order to which the line belongs"),
    TableColumn("sku", TEXT, "SKU of the line, if the scenario gives it"),
    TableColumn("pod", INTEGER, "number of the pod, from 1"),
    TableColumn("pod_name", TEXT, "name of the pod, or its number if it has no name"),
    TableColumn("station", TEXT, "the station that serves the line"),
    TableColumn("trip", INTEGER, "the trip that serves the line"),
    TableColumn("robot", INTEGER, "the robot that last took the trip"),
    TableColumn("units", INTEGER, "number of units"),
    TableColumn("released", TICKS, "release tick of the line; empty: not in this run"),
    TableColumn("taken", TICKS, "tick in which the robot took the trip"),
    TableColumn("lifted", TICKS, "first tick in which the pod is on the robot"),
    TableColumn("arrived", TICKS, "tick in which the robot arrived at the station"),
    TableColumn("begun", TICKS, "first tick of the visit that serves the line"),
    TableColumn("done", TICKS, "tick in which the visit ended; empty: open at the end"),
)
TRIP_COLUMNS: Final = (
    TableColumn("trip", INTEGER, "number of the trip, or of the order if orders have no lines"),
    TableColumn("pod", INTEGER, "number of the pod, from 1"),
    TableColumn("from", TEXT, "cell `x_y` from which the load comes"),
    TableColumn("to", TEXT, "cell `x_y` to which the load was or will be brought"),
    TableColumn("robot", INTEGER, "the robot that last took the trip"),
    TableColumn("type", TEXT, "type of the robot, if the fleet has several"),
    TableColumn("released", TICKS, "release tick of the trip; empty: not in this run"),
    TableColumn("taken", TICKS, "tick in which the robot took the trip"),
    TableColumn("picked", TICKS, "first tick in which the load is on the robot"),
    TableColumn("delivered", TICKS, "first tick in which the load is at its target"),
    TableColumn("stops", INTEGER, "number of stops done"),
    TableColumn(
        "moves",
        INTEGER,
        "number of moves with the load; if the order has no load, "
        "number of moves since it was taken",
    ),
    TableColumn("drive", TICKS, "ticks of `moves` and of the turns between them"),
    TableColumn(
        "least_drive",
        TICKS,
        "least possible `drive` on an empty floor; empty: the load was picked up more than once",
    ),
    TableColumn("queued", TICKS, "ticks in the queues of stations"),
)
EVENT_COLUMNS: Final = (
    TableColumn("tick", TICKS, "tick of the event"),
    TableColumn("event", TEXT, "name of the event"),
    TableColumn("robot", INTEGER, "the robot; of a wait cycle, the one with the lowest number"),
    TableColumn(
        "order", INTEGER, "the order or its trip; the part for `job done` and `part finished`"
    ),
    TableColumn(
        "value",
        NUMBER,
        "amount: moves (`retreated`), robots (wait cycles), charge from 0 to 1 (`charges`), station from "
        "0 (parts), or stations with a new zone (`zones redesigned`)",
    ),
    TableColumn(
        "x", INTEGER, "column of the robot's cell, for events of loads and of robots that go down"
    ),
    TableColumn("y", INTEGER, "row of the robot's cell, for the same events"),
    TableColumn(
        "rule",
        TEXT,
        "layer and rule of an `illegal decision`; `value` is then the value that the strategy gave",
    ),
)
STATE_COLUMNS: Final = (
    TableColumn("tick", TICKS, "tick at whose end the robot has the state"),
    TableColumn("robot", INTEGER, "number of the robot, from 0"),
    TableColumn(
        "x",
        INTEGER,
        "column of the robot's cell, or of the cell that it leaves in a move of several "
        "ticks; empty: off the floor",
    ),
    TableColumn("y", INTEGER, "row of the robot's cell"),
    TableColumn("heading", TEXT, "E, S, W or N; on rails EW or NS; empty: the robot never turns"),
    TableColumn("action", TEXT, "action of the robot"),
    TableColumn("load", INTEGER, "the order or trip whose load the robot carries"),
    TableColumn("order", INTEGER, "the order or trip that the robot works on"),
    TableColumn("charge", NUMBER, "battery charge, from 0 to 1; empty: robots have no batteries"),
    TableColumn("cause", TEXT, "cause of waiting; empty: the robot does not wait"),
    TableColumn("blocker", INTEGER, "the robot that blocks the waiting one"),
)
STATION_COLUMNS: Final = (
    TableColumn("station", TEXT, "name of the station, or its number from 1"),
    TableColumn("x", INTEGER, "column of the station"),
    TableColumn("y", INTEGER, "row of the station"),
    TableColumn("visits", INTEGER, "number of visits done, or of parts"),
    TableColumn("lines", INTEGER, "number of lines served; empty if orders have no lines"),
    TableColumn("work", TICKS, "ticks of the visits in `visits`, or of work on parts"),
    TableColumn("utilization", NUMBER, "`work` / ticks of the run"),
)
CELL_COLUMNS: Final = (
    TableColumn("x", INTEGER, "column of the cell (only cells on which robots can drive)"),
    TableColumn("y", INTEGER, "row of the cell"),
    TableColumn("visits", INTEGER, "number of times that a robot entered the cell"),
    TableColumn("waited", TICKS, "ticks that robots lost in the cell"),
    TableColumn("flow_e", INTEGER, "number of moves out of the cell to the east"),
    TableColumn("flow_s", INTEGER, "number of moves out of the cell to the south"),
    TableColumn("flow_w", INTEGER, "number of moves out of the cell to the west"),
    TableColumn("flow_n", INTEGER, "number of moves out of the cell to the north"),
)
# The columns of robots are those of `run --json`, which depend on the scenario.
TABLES: Final[dict[str, tuple[TableColumn, ...]]] = {
    "orders": ORDER_COLUMNS,
    "lines": LINE_COLUMNS,
    "trips": TRIP_COLUMNS,
    "events": EVENT_COLUMNS,
    "states": STATE_COLUMNS,
    "robots": (),
    "stations": STATION_COLUMNS,
    "cells": CELL_COLUMNS,
}


def form_of(
    name: str, resolved: Resolved, columns: tuple[TableColumn, ...] = (), /, **texts: Sequence[str]
) -> Form:
    """The form of a table of a run; `columns`: its columns if TABLES has none."""
    return Form(name, TABLES[name] or columns, texts, exact_time(resolved.scenario.units.tick))


def where(is_known: Array, values: Array) -> Array:
    """(k,) int64: whole numbers, or NO_NUMBER where they are unknown."""
    out: Array = np.where(is_known, np.asarray(values, np.int64), NO_NUMBER)
    return out


def texts_where(is_known: Array, codes: Array) -> Array:
    """(k,) int64: indices of texts, or flags, or NO_TEXT where they are unknown."""
    out: Array = np.where(is_known, np.asarray(codes, np.int64), NO_TEXT)
    return out


def rows_as_objects(form: Form, rows: Rows) -> list[dict[str, Any]]:
    """Rows as dicts, without columns of seconds; None for unknown values."""
    columns = []
    for name, kind, _ in form.columns:
        values = rows[name].tolist()
        if kind == TEXT:
            texts = form.texts[name]
            values = [None if code == NO_TEXT else texts[code] for code in values]
        elif kind == FLAG:
            values = [None if one == NO_TEXT else one == 1 for one in values]
        else:
            values = [None if one == NO_NUMBER or one != one else one for one in values]
        columns.append(values)
    names = [column.name for column in form.columns]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def codes_of(values: Sequence[str | None]) -> tuple[Array, list[str]]:
    """Texts as indices into the list of distinct texts; NO_TEXT for None."""
    known: dict[str, int] = {}
    codes = [NO_TEXT if one is None else known.setdefault(one, len(known)) for one in values]
    return np.array(codes, np.int64), list(known)


# Buffering of rows in groups, and groups as pyarrow tables.


GROUP_ROWS: Final = 65_536  # 8 MB of the widest table

Write = Callable[[Form, "pa.Table"], None]


def arrow() -> Any:
    """The module pyarrow. Raises InputError if it is not installed."""
    try:
        import pyarrow
    except ImportError as error:
        raise InputError(
            f"tables need pyarrow, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[experiments]'"
        ) from None
    return pyarrow


class GroupBuffer:
    """Collects the rows of a table, and writes them in groups of GROUP_ROWS."""

    def __init__(self, form: Form, write: Write) -> None:
        self.form, self._write = form, write
        self._held = 0
        self._is_begun = False
        self._columns = {
            column.name: np.empty(GROUP_ROWS, np.float64 if column.kind == NUMBER else np.int64)
            for column in form.columns
        }

    def append(self, rows: Rows) -> None:
        """Add rows; write each full group."""
        count = len(rows[self.form.columns[0].name]) if self.form.columns else 0
        begun = 0
        while begun < count:
            size = min(count - begun, GROUP_ROWS - self._held)
            for name, column in self._columns.items():
                column[self._held : self._held + size] = rows[name][begun : begun + size]
            self._held += size
            begun += size
            if self._held == GROUP_ROWS:
                self.flush()

    def flush(self) -> None:
        """Write the remaining rows; for an empty table, only its columns."""
        if not self._held and self._is_begun:
            return
        held = {name: column[: self._held] for name, column in self._columns.items()}
        self._write(self.form, arrow_table(self.form, held))
        self._held, self._is_begun = 0, True


def arrow_table(form: Form, rows: Rows) -> pa.Table:
    """Rows as a pyarrow table, with a column of seconds after each column of ticks."""
    columns: dict[str, Any] = {}
    for column in form.columns:
        values = rows[column.name]
        columns[column.name] = _arrow_column(form, column.name, column.kind, values)
        if column.kind == TICKS and form.tick is not None:
            columns[column.name + SUFFIX_OF_SECONDS] = _seconds(form, values)
    return arrow().table(columns)


def _arrow_column(form: Form, name: str, kind: str, values: Array) -> pa.Array:
    pa = arrow()
    if kind == NUMBER:
        return pa.array(values, pa.float64(), mask=np.isnan(values))
    if kind == TEXT:
        codes = pa.array(values, pa.int32(), mask=values == NO_TEXT)
        texts = pa.array(list(form.texts[name]), pa.string())
        return pa.DictionaryArray.from_arrays(codes, texts)
    if kind == FLAG:
        return pa.array(values == 1, pa.bool_(), mask=values == NO_TEXT)
    return pa.array(values, mask=values == NO_NUMBER).cast(pa.int32())


def _seconds(form: Form, ticks: Array) -> pa.Array:
    """Ticks in seconds, rounded once: 3 ticks of 0.1 s are 0.3 s."""
    pa, tick = arrow(), form.tick
    assert tick is not None, "the caller has asked"
    unknown = ticks == NO_NUMBER
    known = np.where(unknown, 0, ticks)
    return pa.array(known * tick.numerator / tick.denominator, pa.float64(), mask=unknown)


# Cells as column and row numbers, and as texts such as `4_2`.


def columns_and_rows(floor_plan: FloorPlan, cells: Array) -> tuple[Array, Array]:
    """(k,) x and y of flat cells; NO_NUMBER off the floor."""
    rows, columns = np.divmod(np.asarray(cells, np.int64), floor_plan.stride)
    is_cell = np.asarray(cells) != NIL
    return where(is_cell, columns - 1), where(is_cell, rows - 1)


def cell_texts(run: Measured) -> tuple[Array, list[str]]:
    """(s + 1,) code of the cell of each slot, NO_TEXT for slots without a cell; and the texts."""
    cells = run.world.slots.cell
    different, codes = np.unique(cells, return_inverse=True)
    texts = ["{}_{}".format(*run.resolved.floor_plan.xy(cell)) for cell in different.tolist()]
    return np.append(texts_where(cells != NIL, codes), NO_TEXT), texts
