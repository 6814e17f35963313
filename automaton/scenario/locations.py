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

import numpy as np

from automaton.scenario.cell_names import Cell, Locations
from automaton.scenario.document import Document, Keys, ListFile
from automaton.scenario.order_columns import read_columns
from automaton.scenario.order_fields import NumberField, OrderFile, TextField
from automaton.scenario.quantities import Scale
from automaton.scenario.text_lines import quoted
from automaton.scenario.validation import validated

LOCATIONS: Final[Keys] = ("locations",)
FARTHEST: Final = 1_000_000
FIELDS: Final = (
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
    columns = read_columns(path, FIELDS, file, None, Scale("1 tick"), NEEDED, may_rename=False)
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
