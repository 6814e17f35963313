"""Store long lists of orders as columns: a million of them would be too many values of a scenario.

{"scenario": {"orders": {"list": [{"from": [0, 0], ...}, ...]}}}     in memory
{"scenario": {"orders": {"list": null}}, "listed": {"from": (n, 2), "release": (n,), ...}}  in a file
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from automaton.evidence.recording.contents import Content, InvalidFrameError

MIN_PACKED: Final = 1000  # orders; shorter lists stay as the scenario has them
CELLS: Final = ("from", "to")
NOTHING: Final = -(2**31)  # stands for null
MAX_VALUE: Final = 2**31 - 1


def pack_listed(content: Content) -> Content:
    """Return a header or conditions with a long list of orders as columns, if it is one of transports."""
    lines = content["scenario"].get("orders", {}).get("list")
    if lines is None or len(lines) < MIN_PACKED:
        return content
    columns = {}
    for name in lines[0]:
        column = _column(name, [line[name] for line in lines])
        if column is None:
            return content
        columns[name] = column
    return {**_with_list(content, None), "listed": columns}


def unpack_listed(content: Content) -> Content:
    """Return a header or conditions with the list of orders itself. Raises InvalidFrameError."""
    columns = content.get("listed")
    if columns is None:
        return content
    rows = {len(column) for column in columns.values()}
    if len(rows) != 1 or any(
        (name in CELLS) != (column.ndim == 2) for name, column in columns.items()
    ):
        raise InvalidFrameError("its listed orders are not a table")
    names = list(columns)
    values = zip(*(_values(column) for column in columns.values()), strict=True)
    lines = [dict(zip(names, row, strict=True)) for row in values]
    return _with_list({name: part for name, part in content.items() if name != "listed"}, lines)


def _with_list(content: Content, lines: list[Any] | None) -> Content:
    scenario = content["scenario"]
    orders = scenario.get("orders")
    if not isinstance(orders, dict):
        raise InvalidFrameError("its scenario has no orders to list")
    return {**content, "scenario": {**scenario, "orders": {**orders, "list": lines}}}


def _column(name: str, values: list[Any]) -> np.ndarray[Any, Any] | None:
    """(n,) or, of cells, (n, 2) int32; None where a value is neither a cell, a number nor nothing."""
    if name in CELLS:
        if any(value is None for value in values):
            return None
        return np.array(values, np.int32).reshape(-1, 2)
    numbers = [NOTHING if value is None else value for value in values]
    if not all(type(number) is int and NOTHING <= number <= MAX_VALUE for number in numbers):
        return None
    return np.array(numbers, np.int32)


def _values(column: np.ndarray[Any, Any]) -> list[Any]:
    values: list[Any] = column.tolist()
    return [None if value == NOTHING else value for value in values] if column.ndim == 1 else values
