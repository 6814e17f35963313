"""Store long lists of orders and of lines as columns: a million would be too many values of a scenario.

{"scenario": {"orders": {"list": [{"from": [0, 0], ...}, ...]}}}     in memory
{"scenario": {"orders": {"list": null}}, "listed": {"from": (n, 2), "release": (n,), ...}}  in a file

Of lines `listed_lines` has the columns and `line_names` what they name: a number or a text for each
code. What is due at a tick is a column of its own, `due at`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from automaton.evidence.recording.contents import Content, InvalidFrameError

MIN_PACKED: Final = 1000  # orders; shorter lists stay as the scenario has them
CELLS: Final = ("from", "to")
NAMES: Final = ("order", "pod", "sku", "station")  # of lines: numbers and texts
DUE_AT: Final = "due at"
NOTHING: Final = -(2**31)  # stands for null
MAX_VALUE: Final = 2**31 - 1

Column = np.ndarray[Any, Any]


def pack_listed(content: Content) -> Content:
    """Return a header or conditions with long lists of transports or of lines as columns."""
    orders = content["scenario"].get("orders", {})
    listed, lines = orders.get("list"), orders.get("lines")
    if listed is not None and len(listed) >= MIN_PACKED:
        columns = _columns(listed)
        if columns is not None:
            content = {**_with_list(content, "list", None), "listed": columns}
    if isinstance(lines, list | tuple) and len(lines) >= MIN_PACKED:
        names: dict[str, list[Any]] = {name: [] for name in NAMES}
        columns = _columns(lines, names)
        if columns is not None:
            content = {**_with_list(content, "lines", None), "listed_lines": columns}
            content["line_names"] = names
    return content


def unpack_listed(content: Content) -> Content:
    """Return a header or conditions with its lists themselves. Raises InvalidFrameError."""
    names = content.get("line_names", {})
    for key, form in (("listed", "list"), ("listed_lines", "lines")):
        columns = content.get(key)
        if columns is not None:
            rows = _rows(columns, names if form == "lines" else {})
            packed = (key, "line_names")
            content = {name: part for name, part in content.items() if name not in packed}
            content = _with_list(content, form, rows)
            names = {}
    return content


def _with_list(content: Content, form: str, rows: list[Any] | None) -> Content:
    scenario = content["scenario"]
    orders = scenario.get("orders")
    if not isinstance(orders, dict):
        raise InvalidFrameError("its scenario has no orders to list")
    return {**content, "scenario": {**scenario, "orders": {**orders, form: rows}}}


def _columns(
    rows: Sequence[Any], names: dict[str, list[Any]] | None = None
) -> dict[str, Column] | None:
    """The columns of a list; where there are `names`, which are filled, codes. None: it has others."""
    columns = {}
    for name in rows[0]:
        values = [row[name] for row in rows]
        if names is not None and name in names:
            values = _codes(values, names[name])
        if name == "due":
            at = [value["at"] if isinstance(value, dict) else None for value in values]
            values = [None if isinstance(value, dict) else value for value in values]
            if any(value is not None for value in at):
                columns[DUE_AT] = np.array([NOTHING if v is None else v for v in at], np.int32)
        column = _column(name, values)
        if column is None:
            return None
        columns[name] = column
    return columns


def _codes(values: list[Any], names: list[Any]) -> list[int | None]:
    """The place of each value among `names`, which gets those that are new."""
    known: dict[Any, int] = {}
    codes = [None if value is None else known.setdefault(value, len(known)) for value in values]
    names += known
    return codes


def _column(name: str, values: list[Any]) -> Column | None:
    """(n,) or, of cells, (n, 2) int32; None where a value is neither a cell, a number nor nothing."""
    if name in CELLS:
        if any(value is None for value in values):
            return None
        return np.array(values, np.int32).reshape(-1, 2)
    numbers = [NOTHING if value is None else value for value in values]
    if not all(type(number) is int and NOTHING <= number <= MAX_VALUE for number in numbers):
        return None
    return np.array(numbers, np.int32)


def _rows(columns: dict[str, Column], names: dict[str, list[Any]]) -> list[dict[str, Any]]:
    """The list that is stored as columns. Raises InvalidFrameError."""
    if len({len(column) for column in columns.values()}) != 1 or any(
        (name in CELLS) != (column.ndim == 2) for name, column in columns.items()
    ):
        raise InvalidFrameError("its listed orders are not a table")
    values = {
        name: _named(name, column, names[name]) if name in names else _values(column)
        for name, column in columns.items()
    }
    if DUE_AT in values:
        ticks = zip(values.pop(DUE_AT), values.get("due", ()), strict=False)
        values["due"] = [due if at is None else {"at": at} for at, due in ticks]
    fields = list(values)
    return [dict(zip(fields, row, strict=True)) for row in zip(*values.values(), strict=False)]


def _named(name: str, column: Column, names: list[Any]) -> list[Any]:
    """What the codes of a column stand for."""
    codes = _values(column)
    if any(code is not None and not 0 <= code < len(names) for code in codes):
        raise InvalidFrameError(f"an unnamed {name} is in its lines")
    return [None if code is None else names[code] for code in codes]


def _values(column: Column) -> list[Any]:
    values: list[Any] = column.tolist()
    return [None if value == NOTHING else value for value in values] if column.ndim == 1 else values
