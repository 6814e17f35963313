"""Transports of a CSV file as the orders of a scenario.

    released,from,to                released: a tick, a time such as 20 s, or a clock time
    0,rack-7,packing                from, to: names of cells; or columns from_x, from_y, to_x, to_y
    06:30,rack-9,packing

The orders become the scenario's own list, so that recordings stand alone. Equal cells of a million
rows are one object: a row takes some 140 bytes.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import msgspec
import numpy as np

from automaton.errors import InputError
from automaton.scenario.cell_names import Cell
from automaton.scenario.document import Document, Keys, ListFile
from automaton.scenario.field_types import DueAt
from automaton.scenario.locations import names_of_cells
from automaton.scenario.order_columns import read_columns
from automaton.scenario.order_fields import NO_DUE, NameField, OrderColumns
from automaton.scenario.order_notes import file_warnings, reading_notes
from automaton.scenario.orders import OrderLine
from automaton.scenario.quantities import Scale
from automaton.scenario.schema import Scenario
from automaton.scenario.transports import FIELDS, PLACES

FILE: Final[Keys] = ("orders", "transports", "file")


class TransportFile(NamedTuple):
    """What is known of a file of transports beside its orders."""

    path: str
    content_hash: str  # 16 hex digits
    columns: OrderColumns
    notes: tuple[str, ...]  # for `check`
    warnings: tuple[str, ...]

    @classmethod
    def of(cls, path: Path, columns: OrderColumns, scale: Scale) -> TransportFile:
        """What is said of a file whose columns were read."""
        return cls(
            str(path.resolve()),
            columns.content_hash,
            columns,
            tuple(reading_notes(columns, scale)),
            tuple(file_warnings(columns)),
        )


def with_orders_of_file(
    document: Document, scenario: Scenario
) -> tuple[Document, Scenario, TransportFile | None]:
    """The scenario with the orders of its file as a list, if it names one. Raises InputError."""
    transports = scenario.orders.transports
    if transports is None:
        return document, scenario, None
    path = document.folder / transports.file
    if not os.path.isfile(path):
        raise document.error(FILE, f"there is no file of orders '{transports.file}'")
    names = names_of_cells(document)
    known = {name: number for number, name in enumerate(names)}
    ends = [NameField(end, known, "location", is_required=True) for end in ("from", "to")]
    named = None if transports.columns is None else transports.columns.of_fields
    scale = scenario.units.scale
    columns = read_columns(path, [*FIELDS, *ends], transports, named, scale, PLACES)
    if not names and {"from", "to"} & set(columns.column_of):
        raise InputError(
            "names cells, and the scenario has no names of cells; set locations: {NAME: [x, y]} or "
            "locations: FILE, or use columns from_x, from_y, to_x and to_y",
            str(path),
            1,
        )
    columns.errors.raise_any()
    listed = ListFile(("orders", "list"), columns.path, columns.lines)
    document = replace(document, listed=(*document.listed, listed))
    orders = msgspec.structs.replace(
        scenario.orders, transports=None, listed=_lines(columns, list(names.values()))
    )
    file = TransportFile.of(path, columns, scale)
    return document, msgspec.structs.replace(scenario, orders=orders), file


def _lines(columns: OrderColumns, cells: list[Cell]) -> tuple[OrderLine, ...]:
    values = columns.values
    rows = zip(
        _cells(columns, "from", cells),
        _cells(columns, "to", cells),
        shared(values["released"].tolist()),
        values["weight"].tolist(),
        values["priority"].tolist(),
        _due(values["released"].tolist(), values["due"].tolist()),
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
        )
        for source, target, release, weight, priority, due in rows
    )


def _due(released: list[int], due: list[int]) -> Iterator[int | DueAt | None]:
    """Ticks after its release until which each order is to be done; before it: the tick itself."""
    known: dict[int, int] = {}
    for release, tick in zip(released, due, strict=True):
        if tick == NO_DUE:
            yield None
        elif tick < release:
            yield DueAt(at=tick)
        else:
            yield known.setdefault(tick - release, tick - release)


def shared(numbers: list[int]) -> Iterator[int]:
    """The same numbers, of which equal ones are one object: 32 bytes less for each."""
    known: dict[int, int] = {}
    return (known.setdefault(number, number) for number in numbers)


def _cells(columns: OrderColumns, end: str, cells: list[Cell]) -> list[Cell]:
    """The cell of each row where its order begins or ends; equal ones are one object."""
    if end in columns.column_of:
        return list(map(cells.__getitem__, columns.values[end].tolist()))
    pairs = np.stack([columns.values[f"{end}_x"], columns.values[f"{end}_y"]], axis=1)
    different, which = np.unique(pairs, axis=0, return_inverse=True)
    known = [(x, y) for x, y in different.tolist()]
    return list(map(known.__getitem__, which.reshape(-1).tolist()))
