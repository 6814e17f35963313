"""Rows gathered into groups, and groups as tables of pyarrow."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from automaton.errors import InputError
from automaton.tables.columns import (
    FLAG,
    NO_NUMBER,
    NO_TEXT,
    NUMBER,
    SECONDS,
    TEXT,
    TICKS,
    Array,
    Form,
    Rows,
)

if TYPE_CHECKING:
    import pyarrow as pa

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
            columns[column.name + SECONDS] = _seconds(form, values)
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
