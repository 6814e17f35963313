"""The names that a scenario gives to cells, itself or in a CSV file.

name,x,y         x, y: a cell, counted from 0 at the upper left
packing,4,2
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

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
    file = OrderFile(file=path.name)
    columns = read_columns(path, FIELDS, file, None, Scale("1 tick"), NEEDED)
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


def names_of_cells(
    document: Document, further: Mapping[str, Cell] | None = None, what: str = "station"
) -> dict[str, Cell]:
    """The cell of each name of a document whose locations are a mapping, and of further names.

    `what`: a further name is of. Raises InputError where both name another cell alike.
    """
    named = _locations(document)
    assert not isinstance(named, str), "its file has been read"
    names: dict[str, Cell] = dict(named)
    for name, cell in (further or {}).items():
        if names.setdefault(name, cell) != cell:
            text = (
                f"the location {name} is {list(names[name])}, but the {what} {name} is {list(cell)}"
            )
            raise document.error((*LOCATIONS, name), text)
    return names


def _locations(document: Document) -> dict[str, Cell] | str:
    value = document.data.get("locations", {})
    locations: dict[str, Cell] | str = validated(
        document, value, cast("type[Any]", Locations), LOCATIONS
    )
    return locations
