"""The names that a scenario gives to cells, itself or in a CSV file.

name,x,y         x, y: a cell, counted from 0 at the upper left
packing,4,2
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, cast

import msgspec
import numpy as np

from automaton.errors import InputError
from automaton.scenario.changing_floor import Cell, Locations
from automaton.scenario.document import Document, Keys, ListFile, quoted
from automaton.scenario.order_columns import read_columns
from automaton.scenario.order_fields import (
    NO_DUE,
    NameField,
    NumberField,
    OrderColumns,
    OrderFile,
    TextField,
    file_warnings,
    reading_notes,
)
from automaton.scenario.orders import PLACES, TRANSPORT_FIELDS, OrderLine
from automaton.scenario.quantities import DueAt, Scale
from automaton.scenario.schema import Scenario
from automaton.scenario.validation import validated

LOCATIONS: Final[Keys] = ("locations",)
FARTHEST: Final = 1_000_000
LOCATION_FIELDS: Final = (
    TextField("name", is_required=True),
    NumberField("x", 0, FARTHEST),
    NumberField("y", 0, FARTHEST),
)
NEEDED: Final = ((("x",),), (("y",),))  # columns, beside that of names


class LocationFile(NamedTuple):
    """The file of names that a scenario has."""

    path: str
    content_hash: str  # 16 hex digits


def with_locations_of_file(document: Document) -> tuple[Document, LocationFile | None]:
    """The document with the names of its file as a mapping, if it names one. Raises InputError."""
    named = _locations(document)
    if not isinstance(named, str):
        return document, None
    path = document.folder / named
    if not os.path.isfile(path):
        raise document.error(LOCATIONS, f"there is no file of locations '{named}'")
    cells, lines, content_hash = read_locations(path)
    listed = ListFile(LOCATIONS, str(path), lines)
    document = replace(
        document,
        data={**document.data, "locations": cells},
        listed=(*document.listed, listed),
    )
    return document, LocationFile(str(path.resolve()), content_hash)


def read_locations(path: Path) -> tuple[dict[str, list[int]], dict[str, int], str]:
    """Read the cell and the line of each name in a file, and its hash. Raises InputError."""
    file = OrderFile(file=path.name, encoding=_encoding_of(path))
    columns = read_columns(
        path, LOCATION_FIELDS, file, None, Scale("1 tick"), NEEDED, may_rename=False
    )
    codes, names = columns.values["name"], columns.names["name"]
    _, first = np.unique(codes, return_index=True)
    again = np.ones(len(codes), np.bool_)
    again[first] = False
    columns.refuse(
        "twice", "name", again, lambda row: f"name {quoted(names[codes[row]])} is here twice"
    )
    columns.errors.raise_any()
    rows = zip(
        (names[code] for code in codes.tolist()),
        columns.values["x"].tolist(),
        columns.values["y"].tolist(),
        columns.lines.tolist(),
        strict=True,
    )
    cells, lines = {}, {}
    for name, x, y, line in rows:
        cells[name], lines[name] = [x, y], line
    return cells, lines, columns.content_hash


def _encoding_of(path: Path) -> Literal["utf-8", "cp1252"]:
    """UTF-8, or cp1252 where that cannot be: a scenario has no place to say it for these files."""
    try:
        with path.open(encoding="utf-8-sig") as stream:
            for _ in stream:
                pass
    except UnicodeDecodeError:
        return "cp1252"
    except OSError:  # its reader says why
        pass
    return "utf-8"


def names_of_cells(document: Document) -> dict[str, Cell]:
    """The cell of each name: of the locations, the stations, and the pods where these stand first.

    The files of a document have been read. Raises InputError where two things at different cells have
    one name.
    """
    named = _locations(document)
    assert not isinstance(named, str), "its file has been read"
    names: dict[str, Cell] = dict(named)
    what = dict.fromkeys(names, "location")
    for kind, keys, name, at in _named_things(document):
        cell = named.get(at) if isinstance(at, str) else _cell(at)
        if cell is None:
            continue  # it is checked with the section where it stands
        if names.setdefault(name, cell) != cell:
            if kind == what[name]:
                raise document.error(keys, f"two {kind}s are called {name}")
            other = f"the {what[name]} {name} is at {list(names[name])}"
            raise document.error(keys, f"{other}, but the {kind} {name} is at {list(cell)}")
        what.setdefault(name, kind)
    return names


def _named_things(document: Document) -> Iterator[tuple[str, Keys, str, Any]]:
    """What it is, where it stands in the document, its name and its cell: of stations and pods."""
    stations, pods = document.data.get("stations"), document.data.get("pods")
    for name, station in (stations if isinstance(stations, dict) else {}).items():
        if isinstance(station, dict):
            yield "station", ("stations", name), name, station.get("at")
    listed = pods.get("list") if isinstance(pods, dict) else None
    for number, pod in enumerate(listed if isinstance(listed, list | tuple) else ()):
        if isinstance(pod, dict) and isinstance(pod.get("name"), str):
            yield "pod", ("pods", "list", number), pod["name"], pod.get("at")


def _cell(at: Any) -> Cell | None:
    """A cell as a document has it, or None."""
    if isinstance(at, list | tuple) and len(at) == 2 and all(type(one) is int for one in at):
        return at[0], at[1]
    return None


def _locations(document: Document) -> dict[str, Cell] | str:
    value = document.data.get("locations", {})
    locations: dict[str, Cell] | str = validated(
        document, value, cast("type[Any]", Locations), LOCATIONS
    )
    return locations


# Transports of a CSV file as the orders of a scenario.
#
# released,from,to released: a tick, a time such as 20 s, or a clock time 0,rack-7,packing from, to:
# names of cells; or columns from_x, from_y, to_x, to_y 06:30,rack-9,packing
#
# The orders become the scenario's own list, so that recordings stand alone. Equal cells of a million
# rows are one object: a row takes some 140 bytes.


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
    columns = read_columns(path, [*TRANSPORT_FIELDS, *ends], transports, named, scale, PLACES)
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
