"""The lines of a CSV file, as warehouse systems write them, as the lines of a scenario.

released;pod;sku;station;units  released: a tick, a time such as 20 s, or a clock time
07:31;12;;P1;2                  pod, station: name or number; station may be empty
07:31;;4711;;1                  sku: of any pod that holds it
"""

from __future__ import annotations

import os
from collections.abc import Collection
from dataclasses import replace
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from automaton.errors import nearest
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.document import Document, Keys, ListFile
from automaton.scenario.line_table import LineTable
from automaton.scenario.order_columns import read_columns
from automaton.scenario.order_fields import (
    NOTHING,
    DueField,
    Field,
    NameField,
    NumberField,
    OrderColumns,
    ReleaseField,
    TextField,
)
from automaton.scenario.order_file import TransportFile
from automaton.scenario.pod_file import pod_cells, pod_names, pod_numbers, skus_of
from automaton.scenario.pods import LineDemand
from automaton.scenario.schema import Scenario
from automaton.scenario.text_lines import quoted

FILE: Final[Keys] = ("orders", "lines", "file")
MOST_UNITS: Final = 1_000_000
PLACES: Final = ((("pod",), ("sku",)),)  # what must be there, beside the release


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
    stations = [*scenario.stations, *range(1, len(floor_plan.stations) + 1)]
    fields: list[Field] = [
        ReleaseField(),
        DueField(),
        TextField("order"),
        TextField("pod"),
        TextField("sku"),
        NameField("station", {str(name): k for k, name in enumerate(stations)}, "station"),
        NumberField("priority", -100, 100, default=0),
        NumberField("units", 0, MOST_UNITS, default=1),
    ]
    named = None if demand.columns is None else demand.columns.of_fields
    scale = scenario.units.scale
    columns = read_columns(path, fields, demand, named, scale, PLACES)
    count = len(pod_cells(scenario, floor_plan))
    pods = _pods_of_rows(columns, pod_numbers(scenario, count), skus_of(scenario))
    columns.errors.raise_any()
    listed = ListFile(("orders", "lines"), columns.path, columns.lines)
    lines = LineTable(
        {**columns.values, "pod": pods},
        columns.names["order"],
        [
            k + 1 if name == str(k + 1) else name
            for k, name in enumerate(pod_names(scenario, count))
        ],
        columns.names["sku"],
        stations,
    )
    orders = msgspec.structs.replace(scenario.orders, lines=lines)
    file = TransportFile.of(path, columns, scale)
    document = replace(document, listed=(*document.listed, listed))
    return document, msgspec.structs.replace(scenario, orders=orders), file


def _pods_of_rows(
    columns: OrderColumns, numbers: dict[str, int], skus: Collection[str]
) -> NDArray[np.int32]:
    """(n,) the pod that each row names, NOTHING where it has a SKU alone.

    Rows with neither, or with one that is not known, go to the errors of the columns.
    """
    values, names = columns.values, columns.names
    pod, sku = values["pod"], values["sku"]
    of_pod = np.array([*(numbers.get(text, NOTHING) for text in names["pod"]), NOTHING], np.int32)
    is_sku = np.array([*(text in skus for text in names["sku"]), False])
    numbered: NDArray[np.int32] = of_pod[pod]
    wants_sku = (pod == NOTHING) & (sku != NOTHING)

    def is_no_pod(row: int) -> str:
        text = names["pod"][pod[row]]
        return f"{columns.column_of['pod']} {quoted(text)} is not a pod{nearest(text, numbers)}"

    def is_no_sku(row: int) -> str:
        text = names["sku"][sku[row]]
        like = (
            nearest(text, skus) if skus else ": pods have none; set skus in pods.list or its file"
        )
        return f"{columns.column_of['sku']} {quoted(text)} is not a SKU of a pod{like}"

    columns.refuse("unknown", "pod", (pod != NOTHING) & (numbered == NOTHING), is_no_pod)
    columns.refuse("unknown", "sku", wants_sku & ~is_sku[sku], is_no_sku)
    empty = (pod == NOTHING) & (sku == NOTHING)
    wanted = [columns.column_of[name] for name in ("pod", "sku") if name in columns.column_of]
    says = " and ".join(wanted) + (" are empty" if len(wanted) > 1 else " is empty")
    if "sku" not in columns.column_of:
        says += "; a line without a pod needs a SKU, in a column of its own"
    columns.refuse("empty", "pod", empty, lambda row: says)
    return numbered
