"""The lines of a CSV file, as warehouse systems write them, as the lines of a scenario.

released;pod;station;units      released: a tick, a time such as 20 s, or a clock time
07:31;12;P1;2                   pod: its number from 1; station: its name or number, or nothing
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Final

import msgspec
import numpy as np

from automaton.floor.cells import STORAGE
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.document import Document, Keys, ListFile
from automaton.scenario.line_table import LineTable
from automaton.scenario.order_columns import read_columns
from automaton.scenario.order_fields import (
    DueField,
    Field,
    NameField,
    NumberField,
    ReleaseField,
    TextField,
)
from automaton.scenario.order_file import TransportFile
from automaton.scenario.order_notes import reading_notes, start_warnings
from automaton.scenario.pods import LineDemand
from automaton.scenario.schema import Scenario

FILE: Final[Keys] = ("orders", "lines", "file")
MOST_UNITS: Final = 1_000_000
PLACES: Final = ((("pod",),),)  # what must be there, beside the release


def with_lines_of_file(
    document: Document, scenario: Scenario, floor_plan: FloorPlan
) -> tuple[Document, Scenario, TransportFile | None]:
    """The scenario with the lines of its file as a list, if it names one. Raises InputError."""
    demand = scenario.orders.lines
    if not isinstance(demand, LineDemand) or demand.file is None:
        return document, scenario, None
    path = document.folder / demand.file
    if not os.path.isfile(path):
        raise document.error(FILE, f"there is no file of lines '{demand.file}'")
    pods = int(np.count_nonzero((floor_plan.kind == STORAGE) & (floor_plan.loads != 0)))
    stations = [*scenario.stations, *range(1, len(floor_plan.stations) + 1)]
    fields: list[Field] = [
        ReleaseField(),
        DueField(),
        TextField("order"),
        NameField("pod", {str(k + 1): k for k in range(pods)}, "pod", is_required=True),
        NameField("station", {str(name): k for k, name in enumerate(stations)}, "station"),
        NumberField("priority", -100, 100, default=0),
        NumberField("units", 0, MOST_UNITS, default=1),
    ]
    named = None if demand.columns is None else demand.columns.of_fields
    scale = scenario.units.scale
    columns = read_columns(path, fields, demand, named, scale, PLACES)
    columns.errors.raise_any()
    listed = ListFile(("orders", "lines"), columns.path, columns.lines)
    lines = LineTable(columns.values, columns.names["order"], stations)
    orders = msgspec.structs.replace(scenario.orders, lines=lines)
    file = TransportFile(
        str(path.resolve()),
        columns.content_hash,
        columns,
        tuple(reading_notes(columns, scale)),
        tuple(start_warnings(columns)),
    )
    document = replace(document, listed=(*document.listed, listed))
    return document, msgspec.structs.replace(scenario, orders=orders), file
