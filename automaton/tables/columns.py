"""The tables of a run and their columns: names, kinds and meanings.

Rows are columns of NumPy arrays until a writer takes them. A whole number that is not known is
NO_NUMBER, another number NaN; a text is its place in a list of texts, or NO_TEXT; yes or no is 1 or 0,
or NO_TEXT. Importing this needs neither Numba nor pyarrow.
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
TICKS: Final = "ticks"  # a whole number, beside which its seconds stand where a tick is a time
NUMBER: Final = "number"
TEXT: Final = "text"
FLAG: Final = "true or false"

NO_NUMBER: Final = int(np.iinfo(np.int64).min)
NO_TEXT: Final = -1
SUFFIX_OF_SECONDS: Final = "_s"  # what the name of a column of seconds ends in


class TableColumn(NamedTuple):
    """One column."""

    name: str
    kind: str
    meaning: str


class Form(NamedTuple):
    """A table as it is written."""

    name: str
    columns: tuple[TableColumn, ...]
    texts: Mapping[str, Sequence[str]]  # of each column of texts
    tick: Fraction | None  # seconds; None: a tick is not a time

    def names(self) -> list[str]:
        """The names of all columns, those of seconds included."""
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
    TableColumn("released", TICKS, "tick of its release; empty: not in this run"),
    TableColumn("due", TICKS, "tick at which it is due"),
    TableColumn("done", TICKS, "tick in which it was done; empty: open at the end"),
    TableColumn("lead_time", TICKS, "time from its release until it was done"),
    TableColumn(
        "tardiness",
        TICKS,
        "time from `due` until it was done, or to the end of the run; 0: in time",
    ),
    TableColumn(
        "late",
        FLAG,
        "whether it was done after it was due, or is open and past due at the end; empty: not known",
    ),
    TableColumn("lines", INTEGER, "lines of the order; empty where orders have none"),
    TableColumn("name", TEXT, "name of the order in the list or file of lines"),
)
LINE_COLUMNS: Final = (
    TableColumn("line", INTEGER, "number of the line, from 0"),
    TableColumn("order", INTEGER, "the order that it belongs to"),
    TableColumn("sku", TEXT, "SKU of the line, where the scenario names it"),
    TableColumn("pod", INTEGER, "number of the pod, from 1"),
    TableColumn("pod_name", TEXT, "name of the pod; its number where it has none"),
    TableColumn("station", TEXT, "the station where it is served"),
    TableColumn("trip", INTEGER, "the trip that serves it"),
    TableColumn("robot", INTEGER, "the robot that last took this trip"),
    TableColumn("units", INTEGER, "number of units"),
    TableColumn("released", TICKS, "tick of its release; empty: not in this run"),
    TableColumn("taken", TICKS, "tick in which the robot took the trip"),
    TableColumn("lifted", TICKS, "first tick in which the pod is on the robot"),
    TableColumn("arrived", TICKS, "tick at whose end the robot stands at the station"),
    TableColumn("begun", TICKS, "first tick of the visit in which it is served"),
    TableColumn("done", TICKS, "the last tick of this visit; empty: open at the end"),
)
TRIP_COLUMNS: Final = (
    TableColumn("trip", INTEGER, "number of the trip; without lines, of the order"),
    TableColumn("pod", INTEGER, "number of the pod, from 1"),
    TableColumn("from", TEXT, "cell `x_y` from which the load comes"),
    TableColumn("to", TEXT, "cell `x_y` where it was brought, or is to go"),
    TableColumn("robot", INTEGER, "the robot that last took it"),
    TableColumn("type", TEXT, "type of this robot, where there are several"),
    TableColumn("released", TICKS, "tick of its release; empty: not in this run"),
    TableColumn("taken", TICKS, "tick in which this robot took it"),
    TableColumn("picked", TICKS, "first tick in which the load is on the robot"),
    TableColumn("delivered", TICKS, "first tick in which the load is where it is to go"),
    TableColumn("stops", INTEGER, "stops that were done"),
    TableColumn("moves", INTEGER, "moves with the load; without one, since the order was taken"),
    TableColumn("drive", TICKS, "ticks of these moves and of the turns between them"),
    TableColumn(
        "least_drive",
        TICKS,
        "fewest ticks for these drives on an empty floor; empty: the load was picked "
        "up more than once",
    ),
    TableColumn("queued", TICKS, "ticks in the queues of stations"),
)
EVENT_COLUMNS: Final = (
    TableColumn("tick", TICKS, "when it happened"),
    TableColumn("event", TEXT, "name of the event"),
    TableColumn("robot", INTEGER, "the robot; of a wait cycle, the one with the lowest number"),
    TableColumn(
        "order", INTEGER, "the order, or its trip; of `job done` and `part finished`, the part"
    ),
    TableColumn(
        "value",
        NUMBER,
        "how many or how much: moves of `retreated`, robots of a wait cycle, the charge from 0 to 1 of "
        "`charges`, the station from 0 of parts, stations of `zones redesigned` that changed theirs",
    ),
    TableColumn(
        "x", INTEGER, "column of the robot's cell, where loads are handled or robots go down"
    ),
    TableColumn("y", INTEGER, "row of this cell"),
)
STATE_COLUMNS: Final = (
    TableColumn("tick", TICKS, "tick after which this is the state"),
    TableColumn("robot", INTEGER, "number of the robot, from 0"),
    TableColumn(
        "x",
        INTEGER,
        "column of its cell; during a long move the cell that it leaves; empty: off the floor",
    ),
    TableColumn("y", INTEGER, "row of this cell"),
    TableColumn("heading", TEXT, "E, S, W or N; on rails EW or NS; empty: it may move any way"),
    TableColumn("action", TEXT, "action of the robot"),
    TableColumn("load", INTEGER, "the order, or the trip, whose load it carries"),
    TableColumn("order", INTEGER, "the order, or the trip, that it works on"),
    TableColumn("charge", NUMBER, "charge of its battery, from 0 to 1; empty: robots have none"),
    TableColumn("cause", TEXT, "cause of waiting; empty: the robot does not wait"),
    TableColumn("blocker", INTEGER, "the robot that blocks it"),
)
STATION_COLUMNS: Final = (
    TableColumn("station", TEXT, "name of the station, or its number from 1"),
    TableColumn("x", INTEGER, "column of the station"),
    TableColumn("y", INTEGER, "row of the station"),
    TableColumn("visits", INTEGER, "visits that were done, or parts"),
    TableColumn("lines", INTEGER, "lines that were served; empty where orders have none"),
    TableColumn("work", TICKS, "ticks of these visits, or of work on parts"),
    TableColumn("utilization", NUMBER, "`work` / ticks of the run"),
)
CELL_COLUMNS: Final = (
    TableColumn("x", INTEGER, "column of the cell, one of those that robots drive on"),
    TableColumn("y", INTEGER, "row of the cell"),
    TableColumn("visits", INTEGER, "times that a robot entered it"),
    TableColumn("waited", TICKS, "robot ticks that were lost in it"),
    TableColumn("flow_e", INTEGER, "moves out of it to the east"),
    TableColumn("flow_s", INTEGER, "moves out of it to the south"),
    TableColumn("flow_w", INTEGER, "moves out of it to the west"),
    TableColumn("flow_n", INTEGER, "moves out of it to the north"),
)
# Of robots: what `run --json` has of each, which depends on the scenario.
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
    """The form of a table of a run; `columns`: where TABLES has none."""
    return Form(name, TABLES[name] or columns, texts, exact_time(resolved.scenario.units.tick))


def where(is_known: Array, values: Array) -> Array:
    """(k,) int64: whole numbers, and NO_NUMBER where they are not known."""
    out: Array = np.where(is_known, np.asarray(values, np.int64), NO_NUMBER)
    return out


def texts_where(is_known: Array, codes: Array) -> Array:
    """(k,) int64: places of texts, or flags, and NO_TEXT where they are not known."""
    out: Array = np.where(is_known, np.asarray(codes, np.int64), NO_TEXT)
    return out


def rows_as_objects(form: Form, rows: Rows) -> list[dict[str, Any]]:
    """Rows one by one, without columns of seconds; None for what is not known."""
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
    """Texts as places in the list of the different ones; None is NO_TEXT."""
    known: dict[str, int] = {}
    codes = [NO_TEXT if one is None else known.setdefault(one, len(known)) for one in values]
    return np.array(codes, np.int64), list(known)


# Rows gathered into groups, and groups as tables of pyarrow.


GROUP_ROWS: Final = 65_536  # 8 MB of the widest table

Write = Callable[[Form, "pa.Table"], None]


def arrow() -> Any:
    """The module pyarrow. Raises InputError where it is not installed."""
    try:
        import pyarrow
    except ImportError as error:
        raise InputError(
            f"tables are made with pyarrow, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[experiments]'"
        ) from None
    return pyarrow


class GroupBuffer:
    """Gathers the rows of a table, and writes them in groups of GROUP_ROWS."""

    def __init__(self, form: Form, write: Write) -> None:
        self.form, self._write = form, write
        self._held = 0
        self._is_begun = False
        self._columns = {
            column.name: np.empty(GROUP_ROWS, np.float64 if column.kind == NUMBER else np.int64)
            for column in form.columns
        }

    def append(self, rows: Rows) -> None:
        """Add rows; each group that is full is written."""
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
        """Write the rows that are left; of a table without any, its columns."""
        if not self._held and self._is_begun:
            return
        held = {name: column[: self._held] for name, column in self._columns.items()}
        self._write(self.form, arrow_table(self.form, held))
        self._held, self._is_begun = 0, True


def arrow_table(form: Form, rows: Rows) -> pa.Table:
    """Rows as a table of pyarrow, with a column of seconds beside each of ticks."""
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


# Cells: columns and rows of numbers, and texts such as `4_2`.


def columns_and_rows(floor_plan: FloorPlan, cells: Array) -> tuple[Array, Array]:
    """(k,) x and y of flat cells; NO_NUMBER off the floor."""
    rows, columns = np.divmod(np.asarray(cells, np.int64), floor_plan.stride)
    is_cell = np.asarray(cells) != NIL
    return where(is_cell, columns - 1), where(is_cell, rows - 1)


def cell_texts(run: Measured) -> tuple[Array, list[str]]:
    """(s + 1,) the code of the cell of each slot, NO_TEXT of one without a cell; and the texts."""
    cells = run.world.slots.cell
    different, codes = np.unique(cells, return_inverse=True)
    texts = ["{}_{}".format(*run.resolved.floor_plan.xy(cell)) for cell in different.tolist()]
    return np.append(texts_where(cells != NIL, codes), NO_TEXT), texts
