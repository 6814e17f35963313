"""The lines of a file as a table, and queries about all orders of a scenario.

A tuple of a million lines would take 400 MB. So lines are stored as columns, and created on access. Code
that goes through all lines uses `line_column`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, overload

import msgspec
import numpy as np
from numpy.typing import NDArray

from automaton.floor.floor_plan import STATION, STORAGE, FloorPlan
from automaton.floor.reachability import has_storage
from automaton.scenario.orders import ENDS, Line, LineDemand, OrderLine, Orders
from automaton.scenario.quantities import DueAt
from automaton.scenario.schema import Scenario
from automaton.scenario.table_fields import NO_DUE, NOTHING
from automaton.scenario.table_reader import ReadFile

LineColumn = NDArray[np.int32]
LINE_FIELDS: Final = {
    "release": "released",
    "due": "due",
    "priority": "priority",
    "units": "units",
}


class LineTable(Sequence[Line]):
    """The lines of a file: 32 bytes each, and the texts of their orders.

    `values`: (n,) by field, as automaton.scenario.order_files reads it: indices into `orders`, `pods`,
    `skus`, `stations` and `order_classes`, or NOTHING, and the due tick of a line, or NO_DUE.
    """

    def __init__(
        self,
        values: Mapping[str, LineColumn],
        orders: Sequence[str],
        pods: Sequence[str | int],
        skus: Sequence[str],
        stations: Sequence[str | int],
        classes: Sequence[str],
    ) -> None:
        self.values, self.orders, self.stations = values, orders, stations
        self.pods, self.skus, self.order_classes = pods, skus, classes

    def with_values(self, values: Mapping[str, LineColumn]) -> LineTable:
        """The same texts with other columns."""
        return LineTable(
            values, self.orders, self.pods, self.skus, self.stations, self.order_classes
        )

    def __len__(self) -> int:
        return len(self.values["pod"])

    @overload
    def __getitem__(self, index: int) -> Line: ...

    @overload
    def __getitem__(self, index: slice) -> LineTable: ...

    def __getitem__(self, index: int | slice) -> Line | LineTable:
        if isinstance(index, slice):
            values = {name: column[index] for name, column in self.values.items()}
            return self.with_values(values)
        return next(iter(self[index:][:1] if index >= 0 else self[index:]))

    def __iter__(self) -> Iterator[Line]:
        names = ("order", "pod", "sku", "station", "class", "released", "due", "priority", "units")
        rows = zip(*(self.values[name].tolist() for name in names), strict=True)
        for order, pod, sku, station, of_class, release, due, priority, units in rows:
            yield Line(
                order=None if order == NOTHING else self.orders[order],
                pod=None if pod == NOTHING else self.pods[pod],
                sku=None if sku == NOTHING else self.skus[sku],
                station=None if station == NOTHING else self.stations[station],
                release=release,
                due=None if due == NO_DUE else DueAt(at=due),
                priority=priority,
                units=units,
                order_class=None if of_class == NOTHING else self.order_classes[of_class],
            )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence) or len(self) != len(other):
            return False
        return all(mine == theirs for mine, theirs in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]


def line_column(lines: Sequence[Line], name: str) -> LineColumn:
    """(n,) int32: the release, due, priority or units of lines; due: the tick, or NO_DUE."""
    if isinstance(lines, LineTable):
        return lines.values[LINE_FIELDS[name]]
    if name == "due":
        ticks = (line.due_tick for line in lines)
        return np.array([NO_DUE if tick is None else min(tick, NO_DUE) for tick in ticks], np.int32)
    return np.array([getattr(line, name) for line in lines], np.int32)


def line_texts(lines: Sequence[Line], name: str) -> tuple[LineColumn, Sequence[str]]:
    """The orders, SKUs or classes of lines: (n,) int32 indices into texts, or NOTHING; the texts."""
    if isinstance(lines, LineTable):
        texts = {"order": lines.orders, "sku": lines.skus, "class": lines.order_classes}
        return lines.values[name], texts[name]
    return _numbered(getattr(line, "order_class" if name == "class" else name) for line in lines)


def classes_of_orders(orders: Orders) -> tuple[LineColumn, Sequence[str]]:
    """The classes of listed orders or lines: (n,) int32 indices into texts, or NOTHING; the texts."""
    if orders.listed is not None:
        return _numbered(order.order_class for order in orders.listed)
    return line_texts(listed_lines(orders), "class")


def _numbered(values: Iterable[object]) -> tuple[LineColumn, Sequence[str]]:
    known: dict[str, int] = {}
    places = [
        NOTHING if value is None else known.setdefault(str(value), len(known)) for value in values
    ]
    return np.array(places, np.int32), list(known)


def listed_lines(orders: Orders) -> Sequence[Line]:
    """Return the lines that are listed, one by one or in a file."""
    lines: Sequence[Line] | LineDemand | None = orders.lines
    return () if lines is None or isinstance(lines, LineDemand) else lines


def has_due_times(orders: Orders) -> bool:
    """Return whether any of the orders has a due time."""
    if isinstance(orders.lines, LineDemand):
        return orders.lines.due is not None
    return any(order.due is not None for order in orders.listed or ()) or bool(
        (line_column(listed_lines(orders), "due") != NO_DUE).any()
    )


def priorities_of(orders: Orders) -> list[int]:
    """Return the priorities that orders have, the highest first."""
    priorities = {line.priority for line in orders.listed or ()}
    priorities.update(np.unique(line_column(listed_lines(orders), "priority")).tolist())
    return sorted(priorities or {0}, reverse=True)


def has_tours(orders: Orders) -> bool:
    """Return whether any of the orders has no load."""
    listed = orders.listed or ()
    if orders.generator == "tours" or orders.tasks is not None:
        return True
    return any(line.stops is not None for line in listed)


def kinds_of_sources(orders: Orders, floor_plan: FloorPlan) -> set[int]:
    """Return the kinds of slots where orders begin."""
    found = {
        int(floor_plan.kind.flat[floor_plan.cell(*line.source)])
        for line in orders.listed or ()
        if line.source is not None
    }
    if orders.generator in ENDS:
        found.add(ENDS[orders.generator][0])
    return found | ({STATION} if orders.parts is not None else set())


def plain_data(value: Any) -> Any:
    """A scenario or a part of it as msgspec.to_builtins returns it; tables become lists."""
    return msgspec.to_builtins(value, enc_hook=_listed)


def _listed(value: Any) -> Any:
    if isinstance(value, LineTable):
        return list(value)
    raise NotImplementedError(f"no data: {type(value).__name__}")


class Day(NamedTuple):
    """A file of orders or lines that was read for a scenario."""

    file: ReadFile
    orders: Orders
    key: str  # hash of its content and of how it was read

    @property
    def name(self) -> str:
        """The name of the file, without its folder."""
        return Path(self.file.path).name


# The pods that robots carry. Lines carry pods, and so do listed orders that begin in storage.


def is_of_pod(order: OrderLine, floor_plan: FloorPlan) -> bool:
    """Whether a listed order begins in storage, and so carries the pod that stands there."""
    if order.source is None or not floor_plan.holds(*order.source):
        return False
    return bool(floor_plan.kind.flat[floor_plan.cell(*order.source)] == STORAGE)


def lists_pods(scenario: Scenario, floor_plan: FloorPlan) -> bool:
    """Whether a listed order carries a pod."""
    if scenario.orders.listed is None or not has_storage(floor_plan):
        return False
    return any(is_of_pod(order, floor_plan) for order in scenario.orders.listed)


def carries_pods(scenario: Scenario, floor_plan: FloorPlan) -> bool:
    """Whether robots carry pods."""
    return scenario.orders.lines is not None or lists_pods(scenario, floor_plan)


def transports_of(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[tuple[int, OrderLine]]:
    """The listed orders that bring a load from one slot to another, with their indices."""
    for index, order in enumerate(scenario.orders.listed or ()):
        if order.has_load and not is_of_pod(order, floor_plan):
            yield index, order


def pod_cells(scenario: Scenario, floor_plan: FloorPlan) -> NDArray[np.intp]:
    """Flat cells of pods 0, 1, ... at the start: as listed, or in reading order of the picture."""
    listed = scenario.pods.listed
    if listed is not None:
        return np.array([floor_plan.cell(*pod.at) for pod in listed], np.intp)
    drawn: NDArray[np.intp] = np.flatnonzero((floor_plan.kind == STORAGE) & (floor_plan.loads != 0))
    return drawn


def pod_names(scenario: Scenario, count: int) -> list[str]:
    """The name of each pod, or its number from 1 if it has no name."""
    names = [str(k + 1) for k in range(count)]
    for k, pod in enumerate(scenario.pods.listed or ()):
        names[k] = names[k] if pod.name is None else pod.name
    return names


def pod_numbers(scenario: Scenario, count: int) -> dict[str, int]:
    """The number of each pod, from 0, by its name and by its number from 1 as text."""
    numbers = {str(k + 1): k for k in range(count)}
    return numbers | {name: k for k, name in enumerate(pod_names(scenario, count))}


def skus_of(scenario: Scenario) -> dict[str, int]:
    """The number of each SKU that a pod holds, in the order of the pods."""
    listed = scenario.pods.listed or ()
    return {
        sku: k for k, sku in enumerate(dict.fromkeys(sku for pod in listed for sku in pod.skus))
    }
