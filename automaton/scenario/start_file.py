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

from automaton.errors import InputError, alternatives, nearest
from automaton.scenario.csv_table import number_in, read_table
from automaton.scenario.document import Document, ListFile
from automaton.scenario.field_types import Direction
from automaton.scenario.fleet import StartFile
from automaton.scenario.reading import content_hash, read_text
from automaton.scenario.schema import Scenario

START_COLUMNS: Final = ("x", "y")
HEADING_COLUMN: Final = "heading"
HEADINGS: Final[tuple[Direction, ...]] = get_args(Direction)
FARTHEST: Final = 1_000_000


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
    starts = read_starts(read_text(path), str(path))
    if starts.headings is not None and scenario.fleet.heading is not None:
        text = f"the headings are in {start.file}; leave out fleet.heading, or that column"
        raise document.error(("fleet", "heading"), text)
    if len(starts.cells) != scenario.fleet.robots:
        text = f"fleet.robots is {scenario.fleet.robots:,}, but {start.file} has"
        raise document.error(("fleet", "robots"), f"{text} {len(starts.cells):,} starts")
    fleet = msgspec.structs.replace(
        scenario.fleet, start=starts.cells, heading=starts.headings or scenario.fleet.heading
    )
    listed = ListFile(("fleet", "start"), starts.path, starts.lines)
    document = replace(document, listed=(*document.listed, listed))
    absolute = starts._replace(path=str(path.resolve()))
    return document, msgspec.structs.replace(scenario, fleet=fleet), absolute


def read_starts(text: str, path: str) -> ReadStarts:
    """The starts of a CSV text. Raises InputError with the line."""
    rows = read_table(text, path, START_COLUMNS, (HEADING_COLUMN,), "start")
    allowed = "of a column or row of the floor"
    cells = [
        (
            number_in(row, "x", path, -1, FARTHEST, allowed),
            number_in(row, "y", path, -1, FARTHEST, allowed),
        )
        for row in rows
    ]
    headings: list[Direction] = []
    for row in rows if HEADING_COLUMN in rows[0].cells else ():
        heading = row.cells[HEADING_COLUMN]
        direction = next((one for one in HEADINGS if one == heading), None)
        if direction is None:
            text = f"heading must be {alternatives(HEADINGS)}, found {heading[:20]!r}"
            raise InputError(text + nearest(heading, HEADINGS), path, row.line)
        headings.append(direction)
    return ReadStarts(
        path,
        content_hash(Path(path)),
        tuple(cells),
        tuple(headings) or None,
        tuple(row.line for row in rows),
    )
