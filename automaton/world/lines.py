"""The lines of a scenario as columns: listed, or drawn.

Draws are addressed by the seed and the number of the line or of the order, so that all fleets and
strategies face the same demand.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.engine import random_numbers
from automaton.engine.random_numbers import STREAM_LINE_DEMAND
from automaton.engine.releases import draw_releases
from automaton.engine.state import NEVER, NIL
from automaton.scenario.order_fields import NOTHING
from automaton.scenario.orders import LineTable, listed_lines
from automaton.scenario.pods import Line, LineDemand, PerOrder
from automaton.scenario.schema import Scenario
from automaton.scenario.table_files import pod_numbers, skus_of
from automaton.world.geometric_draws import geometric

Column = npt.NDArray[np.int64]

DRAW_POD, DRAW_CLASS, DRAW_STATION, DRAW_POD_CLASS, DRAW_PER_ORDER = 0, 1, 2, 3, 4


class LineColumns(NamedTuple):
    """(l,) each, by line."""

    order: Column
    pod: Column  # NIL: any with the SKU
    sku: Column  # NIL: none, or a pod is wanted
    station: Column  # NIL: any
    release: Column
    due: Column  # NEVER: none
    priority: Column
    units: Column
    pod_class: Column  # (p,) of each pod, as lines were drawn by it; empty: they were not


def line_columns(scenario: Scenario, pods: int, stations: dict[str, int], seed: int) -> LineColumns:
    """The lines of a scenario with so many pods; `stations`: numbers from 0 by name."""
    lines = scenario.orders.lines
    assert lines is not None, "the scenario has lines"
    if isinstance(lines, LineDemand):
        return _drawn(lines, scenario, pods, max(stations.values()) + 1, seed)
    listed = listed_lines(scenario.orders)
    if isinstance(listed, LineTable):
        return _of_table(listed, scenario, stations)
    return _listed(listed, scenario, pod_numbers(scenario, pods), stations)


def _of_table(lines: LineTable, scenario: Scenario, stations: dict[str, int]) -> LineColumns:
    values, count = lines.values, len(lines)
    named = values["order"] != NOTHING
    alike = np.where(named, values["order"], np.arange(count) + len(lines.orders))
    _, first, which = np.unique(alike, return_index=True, return_inverse=True)
    numbers = np.array([stations[str(name)] for name in lines.stations], np.int64)
    at = np.where(values["station"] == NOTHING, NIL, numbers[values["station"]])
    known = skus_of(scenario)  # a row that names its pod may have any SKU beside it
    skus = np.array([*(known.get(sku, NIL) for sku in lines.skus), NIL], np.int64)
    has_pod = values["pod"] != NOTHING
    order = np.argsort(np.argsort(first))[which]  # in the sequence of their first lines
    return LineColumns(
        order=order,
        pod=np.where(has_pod, values["pod"], NIL).astype(np.int64),
        sku=np.where(has_pod | (values["sku"] == NOTHING), NIL, skus[values["sku"]]),
        station=at,
        release=values["released"].astype(np.int64),
        due=values["due"].astype(np.int64),
        priority=values["priority"].astype(np.int64),
        units=values["units"].astype(np.int64),
        pod_class=np.array(classes_given(scenario), np.int64),
    )


def _listed(
    lines: Sequence[Line], scenario: Scenario, pods: dict[str, int], stations: dict[str, int]
) -> LineColumns:
    skus = skus_of(scenario)
    known: dict[int | str, int] = {}
    order = [
        known.setdefault(f" {k}" if line.order is None else line.order, len(known))
        for k, line in enumerate(lines)
    ]
    due = [NEVER if line.due_tick is None else line.due_tick for line in lines]
    columns: tuple[list[int], ...] = (
        order,
        [NIL if line.pod is None else pods[str(line.pod)] for line in lines],
        [skus[str(line.sku)] if line.pod is None else NIL for line in lines],
        [NIL if line.station is None else stations[str(line.station)] for line in lines],
        [line.release for line in lines],
        due,
        [line.priority for line in lines],
        [line.units for line in lines],
        classes_given(scenario),
    )
    return LineColumns(*(np.array(column, np.int64) for column in columns))


def _drawn(
    lines: LineDemand, scenario: Scenario, pods: int, stations: int, seed: int
) -> LineColumns:
    order = _orders_of_lines(lines, seed)
    released = np.zeros(int(order[-1]) + 1, np.int64)
    if lines.mean_interarrival_time:
        last = scenario.stop.max_duration + 1
        chance = round(2**32 / lines.mean_interarrival_time)
        with np.errstate(over="ignore"):
            draw_releases(released, chance, np.uint64(seed), last)
    pod, pod_class = _pods_of_lines(lines, scenario, pods, seed)
    station = np.full(lines.drawn, NIL, np.int64)
    if lines.stations == "random":
        station = _integers(stations, int(order[-1]) + 1, seed, DRAW_STATION)[order]
    release = released[order]
    none = np.zeros(lines.drawn, np.int64)
    due = none + NEVER if lines.due is None else np.minimum(release + lines.due, NEVER)
    return LineColumns(order, pod, none + NIL, station, release, due, none, none + 1, pod_class)


def classes_given(scenario: Scenario) -> list[int]:
    """The class of each pod from 0, if they are listed with their classes; else nothing."""
    numbers = {name: number for number, name in enumerate(scenario.pods.classes or ())}
    listed = scenario.pods.listed or ()
    return [numbers[pod.pod_class] for pod in listed if pod.pod_class is not None]


def _orders_of_lines(lines: LineDemand, seed: int) -> Column:
    if isinstance(lines.per_order, PerOrder):
        each = geometric(
            lines.per_order.mean, seed, STREAM_LINE_DEMAND, DRAW_PER_ORDER, np.arange(lines.drawn)
        )
    else:
        each = np.full(lines.drawn, lines.per_order, np.int64)
    ends = np.cumsum(each)
    result: Column = np.searchsorted(ends, np.arange(lines.drawn), side="right")
    return result


def _pods_of_lines(
    lines: LineDemand, scenario: Scenario, pods: int, seed: int
) -> tuple[Column, Column]:
    """The pod of each line, and the class of each pod where lines are drawn by class."""
    if lines.classes is None or scenario.pods.classes is None:
        pod_class = np.array(classes_given(scenario), np.int64)
        return _integers(pods, lines.drawn, seed, DRAW_POD), pod_class
    names = list(scenario.pods.classes)
    pod_class = np.array(classes_given(scenario), np.int64)
    if not len(pod_class):
        bounds = class_ends(list(scenario.pods.classes.values()), pods)
        mixed = np.argsort(_integers(2**31 - 1, pods, seed, DRAW_POD_CLASS), kind="stable")
        pod_class = np.zeros(pods, np.int64)
        pod_class[mixed] = np.searchsorted(bounds, np.arange(pods), side="right")
    shares = np.array([lines.classes.get(name, 0.0) for name in names])
    wanted = np.minimum(
        np.searchsorted(np.cumsum(shares), _fractions(lines.drawn, seed), side="right"),
        len(names) - 1,
    )
    pod = np.zeros(lines.drawn, np.int64)
    for number in range(len(names)):
        members, asked = np.flatnonzero(pod_class == number), np.flatnonzero(wanted == number)
        among = members if len(members) else np.arange(pods)
        pod[asked] = among[_integers(len(among), lines.drawn, seed, DRAW_POD)[asked]]
    return pod, pod_class


def class_ends(shares: list[float], count: int) -> Column:
    """(classes,) how many of `count` belong to each class or one before it; halves go to the earlier."""
    ends = np.floor(np.cumsum(shares) / sum(shares) * count + 0.5)
    ends[-1] = count
    return ends.astype(np.int64)


def _integers(below: int, count: int, seed: int, what: int) -> Column:
    drawn = np.zeros(count, np.int64)
    with np.errstate(over="ignore"):
        random_numbers.random_integers(drawn, below, np.uint64(seed), STREAM_LINE_DEMAND, what)
    return drawn


def _fractions(count: int, seed: int) -> npt.NDArray[np.float64]:
    return _integers(2**31 - 1, count, seed, DRAW_CLASS) / (2**31 - 1)
