"""Orders as a CSV file, one line each, with a head; columns may stand in any sequence.

    tick,from_x,from_y,to_x,to_y      tick: from which the order is known
    0,0,0,4,0                         from, to: cells, counted from 0 at the upper left
    12,4,0,0,0

A column `weight` may say how heavy they are; without it all weigh 1. Columns stand between commas,
semicolons or tabs. Lines need not be sorted; empty ones are left out. The content becomes the
scenario's own list of orders, so that recordings stand alone.
"""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from automaton.errors import InputError, nearest
from automaton.scenario.document import Document, ListFile
from automaton.scenario.orders import OrderLine
from automaton.scenario.reading import content_hash, read_text
from automaton.scenario.schema import Scenario

REQUIRED_COLUMNS: Final = ("tick", "from_x", "from_y", "to_x", "to_y")
ORDER_FILE_COLUMNS: Final = (*REQUIRED_COLUMNS, "weight")
SEPARATORS: Final = (";", "\t", ",")  # the first that occurs in the head
LATEST: Final = 2_000_000_000
BOUNDS: Final = {"tick": (0, LATEST), "weight": (1, 1_000_000_000)}
NUMBER: Final = re.compile(r"-?[0-9]{1,10}")


class OrderFile(NamedTuple):
    """The orders of a file."""

    path: str
    content_hash: str  # 16 hex digits
    orders: tuple[OrderLine, ...]
    lines: tuple[int, ...]  # where each of them stands, from 1


def with_orders_of_file(
    document: Document, scenario: Scenario
) -> tuple[Document, Scenario, OrderFile | None]:
    """The scenario with the orders of its file as a list, if it names one. Raises InputError."""
    name = scenario.orders.file
    if name is None:
        return document, scenario, None
    path = document.folder / name
    if not os.path.isfile(path):
        text = f"there is no file of orders '{name}'"
        raise document.error(("orders", "arrivals", "file"), text)
    found = read_orders(read_text(path), str(path))
    orders = msgspec.structs.replace(scenario.orders, arrivals=None, listed=found.orders)
    listed = ListFile(("orders", "list"), found.path, found.lines)
    document = replace(document, listed=listed)
    absolute = found._replace(path=str(path.resolve()))
    return document, msgspec.structs.replace(scenario, orders=orders), absolute


def read_orders(text: str, path: str) -> OrderFile:
    """The orders of a CSV text. Raises InputError with the line."""
    rows = [(number, row) for number, row in enumerate(text.split("\n"), 1) if row.strip()]
    if not rows:
        raise InputError(
            f"is empty; its head must name the columns {', '.join(REQUIRED_COLUMNS)}", path
        )
    first, head = rows[0]
    separator = next((sign for sign in SEPARATORS if sign in head), ",")
    names = [name.strip().strip('"') for name in head.split(separator)]
    _check_head(names, path, first)
    if len(rows) == 1:
        raise InputError("holds no order below its head", path, first)
    orders, lines = [], []
    for number, row in rows[1:]:
        cells = row.split(separator)
        if len(cells) != len(names):
            text = f"the line has {len(cells)} values, the head names {len(names)} columns"
            raise InputError(text, path, number)
        pairs = zip(names, cells, strict=True)
        value = {name: _number(name, cell, path, number) for name, cell in pairs}
        source, target = (value["from_x"], value["from_y"]), (value["to_x"], value["to_y"])
        weight = value.get("weight", 1)
        orders.append(OrderLine(source=source, target=target, release=value["tick"], weight=weight))
        lines.append(number)
    return OrderFile(path, content_hash(Path(path)), tuple(orders), tuple(lines))


def _check_head(names: list[str], path: str, line: int) -> None:
    allowed = f"the columns are {', '.join(ORDER_FILE_COLUMNS)}"
    for name in names:
        if name not in ORDER_FILE_COLUMNS:
            raise InputError(
                f"unknown column '{name[:40]}'{nearest(name, ORDER_FILE_COLUMNS)}; {allowed}",
                path,
                line,
            )
        if names.count(name) > 1:
            raise InputError(f"the column {name} appears twice; {allowed}", path, line)
    missing = [name for name in REQUIRED_COLUMNS if name not in names]
    if missing:
        raise InputError(f"the column {missing[0]} is missing; {allowed}", path, line)


def _number(name: str, cell: str, path: str, line: int) -> int:
    text = cell.strip().strip('"')
    number = int(text) if NUMBER.fullmatch(text) else None
    least, most = BOUNDS.get(name, (-LATEST, LATEST))
    if number is None or not least <= number <= most:
        found = repr(text[:20]) if text else "nothing"
        allowed = "of a column or row of the floor"
        if name in BOUNDS:
            allowed = f"from {least} to {most:,}"
        raise InputError(f"{name} must be a whole number {allowed}, found {found}", path, line)
    return number
