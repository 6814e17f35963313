"""The pods of a floor at tick 0, their stations and their lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.engine.facilities import Lines, Pods, PodStations, Slots, Stops, Trips
from automaton.engine.random_numbers import STREAM_LINE_DEMAND, draw_releases
from automaton.engine.state import NEVER, NIL, ORDER_UNRELEASED, Array, Orders
from automaton.floor.floor_plan import STORAGE, FloorPlan
from automaton.floor.reachability import ticks_between
from automaton.scenario.order_lines import (
    LineTable,
    carries_pods,
    listed_lines,
    pod_cells,
    pod_numbers,
    skus_of,
)
from automaton.scenario.orders import Line, LineDemand, PerOrder
from automaton.scenario.schema import Handling, Scenario
from automaton.scenario.table_fields import NOTHING
from automaton.world.capabilities import loaded_driving
from automaton.world.draws import geometric, handling_of_lines, integers, whole_micro
from automaton.world.floor_parts import handling_rules, queue_path, station_numbers
from automaton.world.prepared_floor import PreparedFloor
from automaton.world.release_ticks import ticks_by_rank
from automaton.world.resolved import Resolved

Column = npt.NDArray[np.int64]

DRAW_POD, DRAW_CLASS, DRAW_STATION, DRAW_POD_CLASS, DRAW_PER_ORDER = 0, 1, 2, 3, 4
NO_PODS = dict.fromkeys((*"plqhswrkcbd", "skus", "held", "listed"), 0)


class PodWorld(NamedTuple):
    """The pods of a world; without lines all arrays are empty, and other orders rule."""

    pods: Pods
    lines: Lines
    trips: Trips
    stations: PodStations
    orders: Orders | None = None
    stops: Stops | None = None


def build_pods(
    resolved: Resolved, floor: PreparedFloor, slots: Slots, listed: Orders, seed: int
) -> PodWorld:
    """Pods where they are listed or drawn, the stations, and lines with room for their trips.

    Enters the pods into `slots.content`; `listed`: the listed orders, all unknown at first if some carry
    pods.
    """
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    if not carries_pods(scenario, floor_plan):
        return PodWorld(
            Pods.sized(NO_PODS),
            Lines.sized(NO_PODS),
            Trips.sized(NO_PODS),
            PodStations.sized(NO_PODS),
        )
    cells = pod_cells(scenario, floor_plan)
    home = floor.grid.slot[cells].astype(np.int32)
    slots.content[home] = np.arange(len(home), dtype=np.int32)
    if scenario.orders.lines is None:
        return of_listed_orders(resolved, home, floor.grid.slot, listed)
    numbers = station_numbers(scenario, floor_plan)
    columns = line_columns(scenario, len(home), numbers, seed)
    rules = handling_rules(scenario, floor_plan)
    count, stops = len(columns.order), scenario.pods.max_stops
    lines = lines_of(columns, list(dict.fromkeys(rules)), seed)
    away = ticks_from_slots(resolved, floor.grid.slot) if (columns.sku != NIL).any() else None
    sizes = {"l": count, "w": count * stops, "r": scenario.fleet.robots, "listed": 0}
    demand = np.bincount(columns.pod[columns.pod != NIL], minlength=len(home))
    return PodWorld(
        pods=pods_of(resolved, demand, columns.pod_class, home, floor.grid.slot),
        lines=lines,
        trips=Trips.sized(sizes),
        stations=stations_of(scenario, floor_plan, rules, away),
        orders=trip_orders(count, stops),
        stops=Stops.sized({"v": count * stops}, cell=np.full(count * stops, NIL, np.int32)),
    )


def of_listed_orders(resolved: Resolved, home: Array, slot_of: Array, listed: Orders) -> PodWorld:
    """The pods that listed orders carry, and the pod of each order."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    pod_in = np.full(len(floor_plan.slots) + 1, NIL, np.int32)  # the last one: no slot
    pod_in[home] = np.arange(len(home), dtype=np.int32)
    pod = pod_in[listed.source]
    carries = pod != NIL
    pods = pods_of(
        resolved,
        np.bincount(pod[carries], minlength=len(home)),
        np.array(classes_given(scenario), np.int64),
        home,
        slot_of,
    )
    listed.state[:] = ORDER_UNRELEASED
    listed.weight[carries] = np.maximum(listed.weight[carries], pods.weight[pod[carries]])
    sizes = {"w": int(listed.first_stop[-1]), "r": scenario.fleet.robots, "listed": len(pod)}
    return PodWorld(
        pods=pods,
        lines=Lines.sized(NO_PODS),
        trips=Trips.sized(sizes, pod=pod),
        stations=stations_of(scenario, floor_plan, handling_rules(scenario, floor_plan), None),
    )


def pods_of(
    resolved: Resolved, demand: Array, as_listed: Array, home: Array, slot_of: Array
) -> Pods:
    """The pods in their slots, and the classes of pods and of storage cells.

    `demand`: (p,) number of requests for each pod; `as_listed`: (p,) its class; empty: classes by
    demand.
    """
    floor_plan, classes = resolved.floor_plan, resolved.scenario.pods.classes
    slots = len(floor_plan.slots)
    pod_class, slot_class = np.zeros(len(home), np.int16), np.full(slots, NIL, np.int16)
    cells = np.flatnonzero(floor_plan.kind.reshape(-1) == STORAGE)
    slot_class[slot_of[cells]] = 0
    if classes is not None:
        shares = list(classes.values())
        pod_class = as_listed.astype(np.int16) if len(as_listed) else ranked(-demand, shares)
        slot_class[slot_of[cells]] = ranked(ticks_to_stations(resolved)[cells], shares)
    first, holders = pods_by_sku(resolved.scenario)
    listed = resolved.scenario.pods.listed
    weight = [1] * len(home) if listed is None else [pod.weight for pod in listed]
    return Pods.sized(
        {"p": len(home), "s": slots},
        slot=home,
        home=home.copy(),
        pod_class=pod_class,
        slot_class=slot_class,
        weight=np.array(weight, np.int32),
        sku_first=first,
        sku_pod=holders,
    )


def pods_by_sku(scenario: Scenario) -> tuple[Array, Array]:
    """(skus + 1,) and (held,) int32: the first index of each SKU in the pods by SKU, and these pods."""
    numbers = skus_of(scenario)
    listed = scenario.pods.listed or ()
    pairs = {(numbers[sku], pod) for pod, one in enumerate(listed) for sku in one.skus}
    held = np.array(sorted(pairs), np.int32).reshape(-1, 2)
    first = np.searchsorted(held[:, 0], np.arange(len(numbers) + 1)).astype(np.int32)
    return first, held[:, 1].copy()


def ranked(values: Array, shares: list[float]) -> Array:
    """(n,) int16: the class of each value by rank, the least value first, ties by index."""
    result = np.zeros(len(values), np.int16)
    ranks = np.arange(len(values))
    result[np.argsort(values, kind="stable")] = np.searchsorted(
        class_ends(shares, len(values)), ranks, side="right"
    )
    return result


def ticks_to_stations(resolved: Resolved) -> Array:
    """(cells,) least ticks with a load from a cell, in its best heading, to the nearest station."""
    nearest: Array = np.min(ticks_to_each_station(resolved), axis=0)
    return nearest


def ticks_to_each_station(resolved: Resolved) -> list[Array]:
    """For each station (cells,): the least ticks with a load from each cell, in its best heading."""
    floor_plan, driving = resolved.floor_plan, loaded_driving(resolved.fleet.types[0])
    return [
        ticks_between(floor_plan, driving, int(cell), backwards=True).min(axis=1)
        for cell in floor_plan.stations
    ]


def ticks_from_slots(resolved: Resolved, slot_of: Array) -> Array:
    """(stations, slots) int32: the least ticks with a load from each slot."""
    cells = np.flatnonzero(slot_of != NIL)
    away = np.zeros((len(resolved.floor_plan.stations), len(cells)), np.int32)
    for row, ticks in zip(away, ticks_to_each_station(resolved), strict=True):
        row[slot_of[cells]] = np.minimum(ticks[cells], NEVER)
    return away


def lines_of(columns: LineArrays, rules: list[Handling], seed: int) -> Lines:
    count = len(columns.order)
    orders = int(columns.order.max()) + 1
    handling = np.stack([handling_of_lines(rule, columns.units, seed) for rule in rules])
    return Lines.sized(
        {"l": count, "q": orders},
        order=columns.order.astype(np.int32),
        pod=columns.pod.astype(np.int32),
        sku=columns.sku.astype(np.int32),
        station=columns.station.astype(np.int32),
        release_tick=columns.release.astype(np.int32),
        due=columns.due.astype(np.int32),
        priority=columns.priority.astype(np.int16),
        sequence=np.argsort(columns.release, kind="stable").astype(np.int32),
        handling=handling,
        left=np.bincount(columns.order, minlength=orders).astype(np.int32),
    )


def stations_of(
    scenario: Scenario, floor_plan: FloorPlan, rules: list[Handling], ticks_from: Array | None
) -> PodStations:
    cells = floor_plan.stations
    distinct = list(dict.fromkeys(rules))
    numbers = station_numbers(scenario, floor_plan)
    places = np.ones(len(cells), np.int32)
    at, queue_at = (np.full(floor_plan.kind.size, NIL, np.int32) for _ in range(2))
    at[cells] = np.arange(len(cells), dtype=np.int32)
    way = np.zeros(floor_plan.kind.size, np.uint8)
    breaks = []
    for name, station in scenario.stations.items():
        number = numbers[name]
        path = queue_path(floor_plan, station.at, station.queue)
        for before, cell in zip([int(cells[number]), *path], path, strict=False):
            queue_at[cell] = number
            way[cell] = floor_plan.offsets.index(before - cell)  # checked: a path
        most = station.max_trips
        places[number] = len(path) + 1 if most == "queue" else NIL if most is None else most
        breaks += [(number, one.begin, one.begin + one.ticks) for one in station.breaks]
    visit = whole_micro(np.array([rule.visit for rule in rules]))
    return PodStations.sized(
        {"k": len(cells)},
        cell=cells.copy(),
        places=places,
        rule=np.array([distinct.index(rule) for rule in rules], np.int32),
        visit=visit,
        station_at=at,
        queue_at=queue_at,
        queue_way=way,
        ticks_from=np.zeros((0, 0), np.int32) if ticks_from is None else ticks_from,
        breaks=np.array(sorted(breaks, key=lambda row: row[1]), np.int64).reshape(-1, 3),
    )


def trip_orders(count: int, stops: int) -> Orders:
    """Room for this number of trips, all unknown at first."""
    nowhere, never = np.full(count, NIL, np.int32), np.full(count, NEVER, np.int32)
    return Orders.sized(
        state=np.full(count, ORDER_UNRELEASED, np.uint8),
        current_slot=nowhere,
        source=nowhere.copy(),
        target=nowhere.copy(),
        release_tick=never,
        weight=np.ones(count, np.int32),
        release_sequence=nowhere.copy(),
        first_stop=np.arange(0, (count + 1) * stops, stops, dtype=np.int32),
    )


# The lines of a scenario as columns: listed, or drawn.
#
# Draws depend only on the seed and the number of the line or of the order, so all fleets and
# strategies face the same demand.


class LineArrays(NamedTuple):
    """(l,) each, by line."""

    order: Column
    pod: Column  # NIL: any with the SKU
    sku: Column  # NIL: none, or a pod is requested
    station: Column  # NIL: any
    release: Column
    due: Column  # NEVER: none
    priority: Column
    units: Column
    pod_class: Column  # (p,) class of each pod if lines are drawn by class; else empty


def line_columns(scenario: Scenario, pods: int, stations: dict[str, int], seed: int) -> LineArrays:
    """The lines of a scenario with this number of pods; `stations`: numbers from 0 by name."""
    lines = scenario.orders.lines
    assert lines is not None, "the scenario has lines"
    if isinstance(lines, LineDemand):
        return _drawn(lines, scenario, pods, max(stations.values()) + 1, seed)
    listed = listed_lines(scenario.orders)
    if isinstance(listed, LineTable):
        return _of_table(listed, scenario, stations)
    return _listed(listed, scenario, pod_numbers(scenario, pods), stations)


def _of_table(lines: LineTable, scenario: Scenario, stations: dict[str, int]) -> LineArrays:
    values, count = lines.values, len(lines)
    named = values["order"] != NOTHING
    alike = np.where(named, values["order"], np.arange(count) + len(lines.orders))
    _, first, which = np.unique(alike, return_index=True, return_inverse=True)
    numbers = np.array([stations[str(name)] for name in lines.stations], np.int64)
    at = np.where(values["station"] == NOTHING, NIL, numbers[values["station"]])
    known = skus_of(scenario)  # in a row with a pod, the SKU is ignored
    skus = np.array([*(known.get(sku, NIL) for sku in lines.skus), NIL], np.int64)
    has_pod = values["pod"] != NOTHING
    order = np.argsort(np.argsort(first))[which]  # in the order of their first lines
    return LineArrays(
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
) -> LineArrays:
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
    return LineArrays(*(np.array(column, np.int64) for column in columns))


def _drawn(
    lines: LineDemand, scenario: Scenario, pods: int, stations: int, seed: int
) -> LineArrays:
    order = _orders_of_lines(lines, seed)
    released = np.zeros(int(order[-1]) + 1, np.int64)
    if lines.mean_interarrival_time:
        last = scenario.stop.max_duration + 1
        chance = round(2**32 / lines.mean_interarrival_time)
        with np.errstate(over="ignore"):
            draw_releases(released, chance, np.uint64(seed), last)
    elif scenario.orders.follows_profile:
        released = ticks_by_rank(scenario, len(released), seed)
    pod, pod_class = _pods_of_lines(lines, scenario, pods, seed)
    station = np.full(lines.drawn, NIL, np.int64)
    if lines.stations == "random":
        station = _integers(int(order[-1]) + 1, stations, seed, DRAW_STATION)[order]
    release = released[order]
    none = np.zeros(lines.drawn, np.int64)
    due = none + NEVER if lines.due is None else np.minimum(release + lines.due, NEVER)
    return LineArrays(order, pod, none + NIL, station, release, due, none, none + 1, pod_class)


def classes_given(scenario: Scenario) -> list[int]:
    """The class of each pod, from 0, if they are listed with classes; else empty."""
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
    """The pod of each line, and the class of each pod if lines are drawn by class."""
    if lines.classes is None or scenario.pods.classes is None:
        pod_class = np.array(classes_given(scenario), np.int64)
        return _integers(lines.drawn, pods, seed, DRAW_POD), pod_class
    names = list(scenario.pods.classes)
    pod_class = np.array(classes_given(scenario), np.int64)
    if not len(pod_class):
        bounds = class_ends(list(scenario.pods.classes.values()), pods)
        mixed = np.argsort(_integers(pods, 2**31 - 1, seed, DRAW_POD_CLASS), kind="stable")
        pod_class = np.zeros(pods, np.int64)
        pod_class[mixed] = np.searchsorted(bounds, np.arange(pods), side="right")
    shares = np.array([lines.classes.get(name, 0.0) for name in names])
    fractions = _integers(lines.drawn, 2**31 - 1, seed, DRAW_CLASS) / (2**31 - 1)
    wanted = np.searchsorted(np.cumsum(shares), fractions, side="right")
    wanted = np.minimum(wanted, len(names) - 1)
    pod = np.zeros(lines.drawn, np.int64)
    for number in range(len(names)):
        members, asked = np.flatnonzero(pod_class == number), np.flatnonzero(wanted == number)
        among = members if len(members) else np.arange(pods)
        pod[asked] = among[_integers(lines.drawn, len(among), seed, DRAW_POD)[asked]]
    return pod, pod_class


def class_ends(shares: list[float], count: int) -> Column:
    """(classes,) cumulative numbers of the classes out of `count`; halves go to the earlier class."""
    ends = np.floor(np.cumsum(shares) / sum(shares) * count + 0.5)
    ends[-1] = count
    return ends.astype(np.int64)


def _integers(count: int, below: int, seed: int, what: int) -> Column:
    return integers(count, below, seed, STREAM_LINE_DEMAND, what)
