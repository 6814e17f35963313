"""Orders as a CSV file, one line each, with a head; columns may stand in any sequence.

    tick,from_x,from_y,to_x,to_y      tick: from which the order is known
    0,0,0,4,0                         from, to: cells, counted from 0 at the upper left
    12,4,0,0,0

A tick may be a time such as 20 s or, with units.clock, a clock time. Columns `weight` and `priority`
may say how heavy they are, without which all weigh 1, and which come first; `due` until when they are
to be done: ticks or a time after the release, a clock time, or nothing. Columns stand between
commas, semicolons or tabs. Lines need not be sorted; empty ones are left out. The content becomes the
scenario's own list of orders, so that recordings stand alone.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.scenario.conversions import Bounds, Conversion, Place, convert
from automaton.scenario.csv_table import NUMBER, Row, number_in, read_table
from automaton.scenario.document import Document, ListFile
from automaton.scenario.field_types import Due, DueAt
from automaton.scenario.orders import OrderLine
from automaton.scenario.quantities import DUE, MOMENT, Scale
from automaton.scenario.reading import content_hash, read_text
from automaton.scenario.schema import Scenario

REQUIRED_COLUMNS: Final = ("tick", "from_x", "from_y", "to_x", "to_y")
OPTIONAL_COLUMNS: Final = ("weight", "priority", "due")
LATEST: Final = 2_000_000_000
TIMES: Final = {
    "tick": Place(MOMENT, Bounds(is_whole=True, ge=0, le=LATEST)),
    "due": Place(DUE, Bounds(is_whole=True, ge=0, le=LATEST)),
}
BOUNDS: Final = {
    "tick": (0, LATEST),
    "weight": (1, 1_000_000_000),
    "priority": (-100, 100),
    "due": (0, LATEST),
}


class OrderFile(NamedTuple):
    """The orders of a file."""

    path: str
    content_hash: str  # 16 hex digits
    orders: tuple[OrderLine, ...]
    lines: tuple[int, ...]  # where each of them stands, from 1
    conversions: tuple[Conversion, ...]  # of times with units


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
    found = read_orders(read_text(path), str(path), scenario.units.scale)
    orders = msgspec.structs.replace(scenario.orders, arrivals=None, listed=found.orders)
    listed = ListFile(("orders", "list"), found.path, found.lines)
    document = replace(document, listed=(*document.listed, listed))
    absolute = found._replace(path=str(path.resolve()))
    return document, msgspec.structs.replace(scenario, orders=orders), absolute


def read_orders(text: str, path: str, scale: Scale) -> OrderFile:
    """The orders of a CSV text. Raises InputError with the line."""
    orders, lines = [], []
    conversions: list[Conversion] = []
    for row in read_table(text, path, REQUIRED_COLUMNS, OPTIONAL_COLUMNS, "order"):
        due = _due(row, path, scale, conversions)
        value = {name: _number(row, name, path, scale, conversions) for name in row.cells}
        source, target = (value["from_x"], value["from_y"]), (value["to_x"], value["to_y"])
        line = OrderLine(
            source=source,
            target=target,
            release=value["tick"],
            weight=value.get("weight", 1),
            priority=value.get("priority", 0),
            due=due,
        )
        orders.append(line)
        lines.append(row.line)
    return OrderFile(
        path, content_hash(Path(path)), tuple(orders), tuple(lines), tuple(conversions)
    )


def _due(row: Row, path: str, scale: Scale, conversions: list[Conversion]) -> Due | None:
    """Until when an order is to be done; its cell is taken out of the row."""
    text = row.cells.pop("due", "")
    if not text:
        return None
    ticks = _number(Row(row.line, {"due": text}), "due", path, scale, conversions)
    of_clock = _is_time(text) and conversions[-1].is_moment
    return DueAt(at=ticks) if of_clock else ticks


def _is_time(text: str) -> bool:
    return text[:1].isdigit() and not NUMBER.fullmatch(text)


def _number(row: Row, name: str, path: str, scale: Scale, conversions: list[Conversion]) -> int:
    """The number in a cell, or of ticks the time; what was converted is added."""
    if name in TIMES and _is_time(row.cells[name]):
        try:
            conversions.append(convert(name, row.cells[name], TIMES[name], scale))
        except InputError as error:
            raise InputError(error.message, path, row.line) from None
        return int(conversions[-1].value)
    if name not in BOUNDS:
        return number_in(row, name, path, -LATEST, LATEST, "of a column or row of the floor")
    least, most = BOUNDS[name]
    return number_in(row, name, path, least, most, f"from {least} to {most:,}")
