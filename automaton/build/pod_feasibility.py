"""Whether pods, stations, queues and lines fit the floor."""

from __future__ import annotations

import numpy as np

from automaton.build.capabilities import FleetOnFloor
from automaton.build.queues import queue_path
from automaton.errors import nearest
from automaton.floor.cells import DIRECTIONS, STATION, STORAGE
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.loaded_ways import to_and_from
from automaton.floor.reachability import Mask
from automaton.scenario.document import Document, Keys
from automaton.scenario.orders import Orders
from automaton.scenario.pods import Line, Pods, PodStation
from automaton.scenario.schema import Scenario
from automaton.units import count


def check_pods(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Stations are stations, queues paths, and lines want pods that there are. Raises InputError."""
    if scenario.orders.lines is None:
        for key, is_set in (("stations", scenario.stations), ("pods", scenario.pods != Pods())):
            if is_set:
                raise document.error((key,), f"{key} belong to orders.lines")
        return
    if not len(floor_plan.stations):
        raise document.error(("layout",), "lines are done at stations, and the floor has none")
    pods = int(((floor_plan.kind == STORAGE) & (floor_plan.loads != 0)).sum())
    if not pods:
        raise document.error(("layout",), "lines want pods, and the floor has none: draw them as p")
    check_stations(document, scenario, floor_plan)
    names = list(scenario.stations)
    if isinstance(scenario.orders.lines, tuple):
        for index, line in enumerate(scenario.orders.lines):
            keys: Keys = ("orders", "lines", index)
            check_line(document, line, keys, pods, names, len(floor_plan.stations))
    check_classes(document, scenario.orders, scenario)


def check_classes(document: Document, orders: Orders, scenario: Scenario) -> None:
    """The classes by which lines are drawn are those of the pods. Raises InputError."""
    wanted = getattr(orders.lines, "classes", None)
    if wanted is None:
        return
    known = list(scenario.pods.classes or ())
    for name in wanted:
        if name not in known:
            there = f"pods.classes has {', '.join(known)}" if known else "pods have no classes"
            text = f"'{name}' is not a class of pods{nearest(name, known)}: {there}"
            raise document.error(("orders", "lines", "classes", name), text)


def check_line(
    document: Document, line: Line, keys: Keys, pods: int, names: list[str], stations: int
) -> None:
    """A line wants a pod that there is at a station that there is. Raises InputError."""
    if line.pod > pods:
        there = f"there are {count(pods, 'pod')}, numbered from 1 as one reads the picture"
        raise document.error((*keys, "pod"), f"'{line.pod}' is not a pod: {there}")
    if line.station is None or line.station in names:
        return
    if not isinstance(line.station, int) or not 1 <= line.station <= stations:
        known = [*names, *(str(k + 1) for k in range(stations))]
        text = f"'{line.station}' is not a station{nearest(str(line.station), names)}"
        raise document.error((*keys, "station"), f"{text}; there are {', '.join(known)}")


def check_stations(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Names stand for stations, each for its own, and queues share no cells. Raises InputError."""
    owner: dict[int, str] = {int(cell): "" for cell in floor_plan.stations}
    named: dict[int, str] = {}
    for name, station in scenario.stations.items():
        x, y = station.at
        keys: Keys = ("stations", name)
        inside = floor_plan.holds(x, y)
        cell = floor_plan.cell(x, y) if inside else 0
        if not inside or floor_plan.kind.flat[cell] != STATION:
            there = f"a {floor_plan.kind_of(cell).name} is there" if inside else "it lies outside"
            raise document.error(
                (*keys, "at"), f"station {name} is at [{x}, {y}], but {there}, not a station"
            )
        if cell in named:
            raise document.error(
                (*keys, "at"), f"stations {named[cell]} and {name} are both at [{x}, {y}]"
            )
        named[cell] = name
        check_queue(document, name, station, floor_plan, owner)


def check_queue(
    document: Document,
    name: str,
    station: PodStation,
    floor_plan: FloorPlan,
    owner: dict[int, str],
) -> None:
    """The queue of a station is a path along which robots drive to it. Raises InputError."""
    keys: Keys = ("stations", name, "queue")
    before = station.at
    for number, (x, y) in enumerate(station.queue):
        if (x != before[0]) == (y != before[1]):
            text = f"the queue of {name} goes from {list(before)} to [{x}, {y}]"
            raise document.error((*keys, number), f"{text}: along neither a row nor a column")
        if not floor_plan.holds(x, y):
            raise document.error((*keys, number), f"[{x}, {y}] lies outside the floor")
        before = (x, y)
    ahead = floor_plan.cell(*station.at)
    for cell in queue_path(floor_plan, station.at, station.queue):
        x, y = floor_plan.xy(cell)
        way = floor_plan.offsets.index(ahead - cell)
        if cell in owner:
            whose = f"that of {owner[cell]}" if owner[cell] else "a station"
            text = f"the queue of {name} comes to [{x}, {y}], which is {whose}"
            if owner[cell] == name:
                text = f"the queue of {name} comes twice to [{x}, {y}]"
            raise document.error(keys, text)
        if not floor_plan.exits.flat[cell] >> way & 1:
            text = f"the queue of {name} breaks at [{x}, {y}]: from there no robot drives "
            raise document.error(keys, text + DIRECTIONS[way])
        if floor_plan.capacity.flat[cell] != 1:
            raise document.error(
                keys, f"[{x}, {y}] in the queue of {name} has room for more than one robot"
            )
        owner[cell] = name
        ahead = cell


def check_pod_ways(document: Document, fleet: FleetOnFloor) -> None:
    """Every pod gets to every station and back, over other storage not at all. Raises InputError."""
    floor_plan = fleet.floor_plan
    if fleet.scenario.orders.lines is None:
        return
    pods: Mask = (floor_plan.kind == STORAGE).reshape(-1) & (floor_plan.loads != 0).reshape(-1)
    within: Mask = np.logical_or.reduce(fleet.within)
    for number, station in enumerate(floor_plan.stations.tolist(), 1):
        x, y = floor_plan.xy(station)
        if not within[station]:
            text = f"no robot gets to station {number} at ({x}, {y}) and back"
            raise document.error(("layout",), text)
        apart: Mask = pods & ~(
            to_and_from(floor_plan, station, fleet.rail) & fleet.loaded.any(axis=0)
        )
        if apart.any():
            cell = int(np.argmax(apart))
            pod = int(np.count_nonzero(pods[: cell + 1]))
            u, v = floor_plan.xy(cell)
            text = f"pod {pod} at ({u}, {v}) has no way to station {number} at ({x}, {y}) and back"
            raise document.error(("layout",), f"{text} that leads through no other storage")
