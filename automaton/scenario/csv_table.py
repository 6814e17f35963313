"""A CSV table with a head, its columns in any sequence, separated as spreadsheets do."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final, NamedTuple

from automaton.errors import InputError, nearest

SEPARATORS: Final = (";", "\t", ",")  # the first that occurs in the head
NUMBER: Final = re.compile(r"-?[0-9]{1,10}")


class Row(NamedTuple):
    """A row below the head."""

    line: int  # of the file, from 1
    cells: dict[str, str]  # by column


def read_table(
    text: str, path: str, required: Sequence[str], optional: Sequence[str], what: str
) -> list[Row]:
    """Read the rows of a CSV text, empty lines left out; `what` a row is: "order".

    Raises InputError with the line.
    """
    rows = [(number, row) for number, row in enumerate(text.split("\n"), 1) if row.strip()]
    if not rows:
        raise InputError(f"is empty; its head must name the columns {', '.join(required)}", path)
    first, head = rows[0]
    separator = next((sign for sign in SEPARATORS if sign in head), ",")
    names = [name.strip().strip('"') for name in head.split(separator)]
    _check_head(names, required, optional, path, first)
    if len(rows) == 1:
        raise InputError(f"holds no {what} below its head", path, first)
    table = []
    for number, row in rows[1:]:
        cells = row.split(separator)
        if len(cells) != len(names):
            text = f"the line has {len(cells)} values, the head names {len(names)} columns"
            raise InputError(text, path, number)
        pairs = zip(names, cells, strict=True)
        table.append(Row(number, {name: cell.strip().strip('"') for name, cell in pairs}))
    return table


def _check_head(
    names: list[str], required: Sequence[str], optional: Sequence[str], path: str, line: int
) -> None:
    columns = (*required, *optional)
    allowed = f"the columns are {', '.join(columns)}"
    for name in names:
        if name not in columns:
            text = f"unknown column '{name[:40]}'{nearest(name, columns)}; {allowed}"
            raise InputError(text, path, line)
        if names.count(name) > 1:
            raise InputError(f"the column {name} appears twice; {allowed}", path, line)
    missing = [name for name in required if name not in names]
    if missing:
        raise InputError(f"the column {missing[0]} is missing; {allowed}", path, line)


def number_in(row: Row, name: str, path: str, least: int, most: int, allowed: str) -> int:
    """Return a cell as a whole number; `allowed` says which ones are. Raises InputError."""
    text = row.cells[name]
    number = int(text) if NUMBER.fullmatch(text) else None
    if number is None or not least <= number <= most:
        shown = repr(text[:20]) if text else "nothing"
        raise InputError(f"{name} must be a whole number {allowed}, found {shown}", path, row.line)
    return number
