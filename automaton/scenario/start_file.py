"""Where robots begin as a CSV file, one line each in the order of their numbers.

    x,y,heading        x, y: a cell, counted from 0 at the upper left
    0,0,east           heading: which way the robot faces; without the column, as fleet.heading says
    4,0,north

The content becomes the scenario's own list of starts, so that recordings stand alone.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple, get_args

import msgspec

from automaton.errors import InputError, nearest
from automaton.scenario.document import Document, ListFile
from automaton.scenario.field_types import Direction
from automaton.scenario.fleet import StartFile
from automaton.scenario.locations import FARTHEST
from automaton.scenario.order_columns import read_columns
from automaton.scenario.order_fields import NameField, NumberField, OrderFile
from automaton.scenario.quantities import Scale
from automaton.scenario.schema import Scenario

HEADINGS: Final[tuple[Direction, ...]] = get_args(Direction)
FIELDS: Final = (
    NumberField("x", 0, FARTHEST),
    NumberField("y", 0, FARTHEST),
    NameField("heading", dict(zip(HEADINGS, range(4), strict=True)), "direction", is_required=True),
)
# Of headings there is no column, or one in all rows.
NEEDED: Final = ((("x",),), (("y",),), (("heading",), ()))


class ReadStarts(NamedTuple):
    """The starts of a file."""

    path: str
    content_hash: str  # 16 hex digits
    cells: tuple[tuple[int, int], ...]
    headings: tuple[Direction, ...] | None
    lines: tuple[int, ...]  # where each of them stands, from 1


def with_starts_of_file(
    document: Document, scenario: Scenario
) -> tuple[Document, Scenario, ReadStarts | None]:
    """The scenario with the starts of its file as a list, if it names one. Raises InputError."""
    start = scenario.fleet.start
    if not isinstance(start, StartFile):
        return document, scenario, None
    path = document.folder / start.file
    if not os.path.isfile(path):
        text = f"there is no file of starts '{start.file}'"
        raise document.error(("fleet", "start", "file"), text)
    starts = read_starts(path)
    if starts.headings is not None and scenario.fleet.heading is not None:
        text = f"the headings are in {start.file}; leave out fleet.heading, or that column"
        raise document.error(("fleet", "heading"), text)
    if len(starts.cells) != scenario.fleet.robots:
        text = f"fleet.robots is {scenario.fleet.robots:,}, but {start.file} has"
        raise document.error(("fleet", "robots"), f"{text} {len(starts.cells):,} starts")
    if starts.headings is not None and "differential" not in scenario.fleet.all_kinematics:
        text = (
            f"{start.file} has headings, which belong to differential robots; leave out that column"
        )
        raise document.error(("fleet", "start", "file"), text)
    fleet = msgspec.structs.replace(
        scenario.fleet, start=starts.cells, heading=starts.headings or scenario.fleet.heading
    )
    listed = ListFile(("fleet", "start"), starts.path, starts.lines)
    document = replace(document, listed=(*document.listed, listed))
    absolute = starts._replace(path=str(path.resolve()))
    return document, msgspec.structs.replace(scenario, fleet=fleet), absolute


def read_starts(path: Path) -> ReadStarts:
    """The starts of a CSV file. Raises InputError with the line."""
    columns = read_columns(
        path, FIELDS, OrderFile(file=path.name), None, Scale("1 tick"), NEEDED, may_rename=False
    )
    if columns.counts.ignored:
        name, known = columns.counts.ignored[0], [field.name for field in FIELDS]
        text = f"unknown column '{name[:40]}'{nearest(name, known)}"
        raise InputError(f"{text}; the columns are {', '.join(known)}", str(path))
    columns.errors.raise_any()
    values = columns.values
    headings = [HEADINGS[code] for code in values["heading"].tolist() if code >= 0]
    return ReadStarts(
        str(path),
        columns.content_hash,
        tuple(zip(values["x"].tolist(), values["y"].tolist(), strict=True)),
        tuple(headings) or None,
        tuple(columns.lines.tolist()),
    )
