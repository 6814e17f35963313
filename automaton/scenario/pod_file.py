"""The pods that a scenario has in a CSV file, and what pods are called.

pod;x;y;name;class;weight;skus      pod: its number from 1; left out: as the rows come
1;2;1;A-17-3;A;380;4711 4712        skus: between blanks; only x and y are needed

The columns may be called otherwise, as `pods.columns` says.

They become the scenario's own list, so that recordings stand alone.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.errors import nearest
from automaton.floor.cells import STORAGE
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.document import Document, Keys, ListFile
from automaton.scenario.locations import FARTHEST
from automaton.scenario.order_columns import read_columns
from automaton.scenario.order_fields import (
    NOTHING,
    Field,
    NumberField,
    OrderColumns,
    TextField,
)
from automaton.scenario.order_notes import reading_notes
from automaton.scenario.pods import Pods
from automaton.scenario.quantities import Scale
from automaton.scenario.schema import Scenario
from automaton.scenario.text_lines import quoted
from automaton.scenario.validation import validated

PODS: Final[Keys] = ("pods",)
MOST_PODS: Final = 1_000_000
HEAVIEST: Final = 1_000_000_000
FIELDS: Final[tuple[Field, ...]] = (
    NumberField("pod", 1, MOST_PODS),
    NumberField("x", 0, FARTHEST),
    NumberField("y", 0, FARTHEST),
    TextField("name"),
    TextField("class"),
    NumberField("weight", 1, HEAVIEST, default=1),
    TextField("skus"),
)
OF_FILE: Final = ("file", "columns", "sheet", "encoding")  # keys that the list does without
NEEDED: Final = ((("x",),), (("y",),))  # columns

Array = NDArray[np.int32]


class PodFile(NamedTuple):
    """The file of pods that a scenario has."""

    path: str
    content_hash: str  # 16 hex digits
    notes: tuple[str, ...]  # for `check`


def with_pods_of_file(document: Document) -> tuple[Document, PodFile | None]:
    """The document with the pods of its file as a list, if it names one. Raises InputError."""
    section = document.data.get("pods")
    if not isinstance(section, dict) or section.get("file") is None:
        return document, None
    pods = validated(document, section, Pods, PODS)
    path = document.folder / str(pods.file)
    if not os.path.isfile(path):
        raise document.error((*PODS, "file"), f"there is no file of pods '{pods.file}'")
    named = None if pods.columns is None else pods.columns.of_fields
    columns = read_columns(path, FIELDS, pods.options, named, Scale("1 tick"), NEEDED)
    rows = _sequence(columns)
    _check_rows(columns, list(pods.classes or ()))
    columns.errors.raise_any()
    rest = {key: value for key, value in section.items() if key not in OF_FILE}
    document = replace(
        document,
        data={**document.data, "pods": {**rest, "list": _pods(columns, rows)}},
        listed=(*document.listed, ListFile((*PODS, "list"), str(path), columns.lines[rows])),
    )
    notes = tuple(reading_notes(columns, Scale("1 tick")))
    return document, PodFile(str(path.resolve()), columns.content_hash, notes)


def _sequence(columns: OrderColumns) -> Array:
    """The row of each pod, by number; mistakes go to the errors of the columns."""
    if "pod" not in columns.column_of:
        return np.arange(len(columns), dtype=np.int32)
    numbers, count = columns.values["pod"], len(columns)
    columns.refuse(
        "beyond",
        "pod",
        numbers > count,
        lambda row: (
            f"{columns.column_of['pod']} {numbers[row]}: pods are numbered from 1 to {count:,}"
        ),
    )
    _refuse_second(
        columns,
        "pod",
        np.where((numbers < 1) | (numbers > count), NOTHING, numbers),
        lambda row: f"{columns.column_of['pod']} {numbers[row]} is here twice",
    )
    rows: Array = np.argsort(numbers, kind="stable").astype(np.int32)
    return rows


def _check_rows(columns: OrderColumns, classes: list[str]) -> None:
    """No two pods have a name or a cell, and classes are those of the scenario."""
    values, names, texts = columns.values, columns.names["name"], columns.names["class"]
    x, y, codes, called = values["x"], values["y"], values["class"], columns.column_of

    def named_twice(row: int) -> str:
        return f"{called['name']} {quoted(names[values['name'][row]])} is here twice"

    def unknown(row: int) -> str:
        text = texts[codes[row]]
        there = f"pods.classes has {', '.join(classes)}" if classes else "set pods.classes"
        return f"{called['class']} {quoted(text)} is not a class of pods{nearest(text, classes)}: {there}"

    _refuse_second(columns, "name", values["name"], named_twice)
    places = x.astype(np.int64) * (FARTHEST + 1) + y
    _refuse_second(columns, "x", places, lambda row: f"a second pod stands at [{x[row]}, {y[row]}]")
    is_known = np.array([*(text in classes for text in texts), True])  # the last one: no class
    columns.refuse("unknown", "class", ~is_known[codes], unknown)
    if (codes != NOTHING).any():
        empty = f"{called['class']} is empty, where others have one"
        columns.refuse("empty", "class", codes == NOTHING, lambda row: empty)


def _refuse_second(
    columns: OrderColumns, field: str, codes: NDArray[Any], sentence: Callable[[int], str]
) -> None:
    """Refuse rows with a code that a row before them has."""
    _, first, which = np.unique(codes, return_index=True, return_inverse=True)
    again = codes != NOTHING
    again[first] = False
    columns.refuse(
        "twice",
        field,
        again,
        lambda row: f"{sentence(row)} (first in line {columns.lines[first[which[row]]]})",
    )


def _pods(columns: OrderColumns, rows: Array) -> list[dict[str, Any]]:
    values, names = columns.values, columns.names
    skus = [text.split() for text in names["skus"]] + [[]]  # the last one: none
    pods = []
    for row in rows.tolist():
        pod: dict[str, Any] = {"at": [int(values["x"][row]), int(values["y"][row])]}
        for field in ("name", "class"):
            code = values[field][row]
            if code != NOTHING:
                pod[field] = names[field][code]
        if values["weight"][row] != 1:
            pod["weight"] = int(values["weight"][row])
        if skus[values["skus"][row]]:
            pod["skus"] = skus[values["skus"][row]]
        pods.append(pod)
    return pods


def pod_cells(scenario: Scenario, floor_plan: FloorPlan) -> NDArray[np.intp]:
    """Flat cells of pods 0, 1, ... at the start: as listed, or as one reads the picture."""
    listed = scenario.pods.listed
    if listed is not None:
        return np.array([floor_plan.cell(*pod.at) for pod in listed], np.intp)
    drawn: NDArray[np.intp] = np.flatnonzero((floor_plan.kind == STORAGE) & (floor_plan.loads != 0))
    return drawn


def pod_names(scenario: Scenario, count: int) -> list[str]:
    """The name of each of so many pods, its number from 1 where it has none."""
    names = [str(k + 1) for k in range(count)]
    for k, pod in enumerate(scenario.pods.listed or ()):
        names[k] = names[k] if pod.name is None else pod.name
    return names


def pod_numbers(scenario: Scenario, count: int) -> dict[str, int]:
    """The number of each of so many pods, from 0, by its name and by its number from 1 as text."""
    numbers = {str(k + 1): k for k in range(count)}
    return numbers | {name: k for k, name in enumerate(pod_names(scenario, count))}


def skus_of(scenario: Scenario) -> dict[str, int]:
    """The number of each SKU that a pod holds, in the sequence of the pods."""
    listed = scenario.pods.listed or ()
    return {
        sku: k for k, sku in enumerate(dict.fromkeys(sku for pod in listed for sku in pod.skus))
    }
