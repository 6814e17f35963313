"""The pods of a floor at tick 0, the stations to which they are carried, and the lines to be done."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from automaton.build.handling_times import handling_of_lines, whole_micro
from automaton.build.lines import LineColumns, class_ends, line_columns
from automaton.build.prepared_floor import Floor
from automaton.build.queues import queue_path
from automaton.build.resolve import Resolved
from automaton.build.station_numbers import station_numbers
from automaton.build.visit_bounds import loaded_driving
from automaton.engine.facilities import Slots
from automaton.engine.pods import Lines, Pods, PodStations, Trips
from automaton.engine.state import NEVER, NIL, ORDER_UNRELEASED, Array, Orders
from automaton.engine.stops import Stops
from automaton.floor.cells import STORAGE
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.travel_ticks import ticks_between
from automaton.scenario.schema import Handling, Scenario


class PodWorld(NamedTuple):
    """What a world has of pods; without lines all of it is empty, and other orders rule."""

    pods: Pods
    lines: Lines
    trips: Trips
    stations: PodStations
    orders: Orders | None = None
    stops: Stops | None = None


def build_pods(resolved: Resolved, floor: Floor, slots: Slots, seed: int) -> PodWorld:
    """Pods where the picture draws them, the stations, and lines with room for their trips.

    Enters the pods into `slots.content`.
    """
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    if scenario.orders.lines is None:
        return PodWorld(
            Pods.sized(NOTHING),
            Lines.sized(NOTHING),
            Trips.sized(NOTHING),
            PodStations.sized(NOTHING),
        )
    cells = pod_cells(floor_plan)
    home = floor.grid.slot[cells].astype(np.int32)
    slots.content[home] = np.arange(len(home), dtype=np.int32)
    numbers = station_numbers(scenario, floor_plan)
    columns = line_columns(scenario, len(home), numbers, seed)
    rules = handling_rules(scenario, floor_plan)
    count, stops = len(columns.order), scenario.pods.max_stops
    lines = lines_of(columns, list(dict.fromkeys(rules)), seed)
    sizes = {"l": count, "w": count * stops, "r": scenario.fleet.robots}
    return PodWorld(
        pods=pods_of(resolved, columns, home, floor.grid.slot),
        lines=lines,
        trips=Trips.sized(sizes),
        stations=stations_of(scenario, floor_plan, rules),
        orders=trip_orders(count, stops),
        stops=Stops.sized({"v": count * stops}, cell=np.full(count * stops, NIL, np.int32)),
    )


NOTHING = dict.fromkeys("plqhswrkcb", 0)


def pod_cells(floor_plan: FloorPlan) -> Array:
    """Flat cells of pods 0, 1, ..., in reading order."""
    stands = (floor_plan.kind == STORAGE) & (floor_plan.loads != 0)
    return np.flatnonzero(stands)


def handling_rules(scenario: Scenario, floor_plan: FloorPlan) -> list[Handling]:
    """How long a visit takes, by station."""
    usual = scenario.durations.handling
    rules = [usual] * len(floor_plan.stations)
    numbers = station_numbers(scenario, floor_plan)
    for name, station in scenario.stations.items():
        rules[numbers[name]] = station.handling or usual
    return rules


def pods_of(resolved: Resolved, columns: LineColumns, home: Array, slot_of: Array) -> Pods:
    """The pods in their slots, and the classes of pods and of storage cells."""
    floor_plan, classes = resolved.floor_plan, resolved.scenario.pods.classes
    slots = len(floor_plan.slots)
    pod_class, slot_class = np.zeros(len(home), np.int16), np.full(slots, NIL, np.int16)
    cells = np.flatnonzero(floor_plan.kind.reshape(-1) == STORAGE)
    slot_class[slot_of[cells]] = 0
    if classes is not None:
        shares = list(classes.values())
        pod_class = columns.pod_class.astype(np.int16)
        if not len(pod_class):
            demand = np.bincount(columns.pod, minlength=len(home))
            pod_class = ranked(-demand, shares)
        slot_class[slot_of[cells]] = ranked(ticks_to_stations(resolved)[cells], shares)
    return Pods.sized(
        {"p": len(home), "s": slots},
        slot=home,
        home=home.copy(),
        pod_class=pod_class,
        slot_class=slot_class,
    )


def ranked(values: Array, shares: list[float]) -> Array:
    """(n,) int16: the class of each by its rank, the least value first, ties the lower number."""
    result = np.zeros(len(values), np.int16)
    ranks = np.arange(len(values))
    result[np.argsort(values, kind="stable")] = np.searchsorted(
        class_ends(shares, len(values)), ranks, side="right"
    )
    return result


def ticks_to_stations(resolved: Resolved) -> Array:
    """(cells,) least ticks with a load from a cell, in its best heading, to the nearest station."""
    floor_plan, driving = resolved.floor_plan, loaded_driving(resolved.scenario)
    ways = [
        ticks_between(floor_plan, driving, int(cell), backwards=True).min(axis=1)
        for cell in floor_plan.stations
    ]
    nearest: Array = np.min(ways, axis=0)
    return nearest


def lines_of(columns: LineColumns, rules: list[Handling], seed: int) -> Lines:
    count = len(columns.order)
    orders = int(columns.order.max()) + 1
    handling = np.stack([handling_of_lines(rule, columns.units, seed) for rule in rules])
    return Lines.sized(
        {"l": count, "q": orders},
        order=columns.order.astype(np.int32),
        pod=columns.pod.astype(np.int32),
        station=columns.station.astype(np.int32),
        release_tick=columns.release.astype(np.int32),
        due=columns.due.astype(np.int32),
        priority=columns.priority.astype(np.int16),
        sequence=np.argsort(columns.release, kind="stable").astype(np.int32),
        handling=handling,
        left=np.bincount(columns.order, minlength=orders).astype(np.int32),
    )


def stations_of(scenario: Scenario, floor_plan: FloorPlan, rules: list[Handling]) -> PodStations:
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
        breaks=np.array(sorted(breaks, key=lambda row: row[1]), np.int64).reshape(-1, 3),
    )


def trip_orders(count: int, stops: int) -> Orders:
    """Room for so many trips, none of which is known yet."""
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
