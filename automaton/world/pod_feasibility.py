"""Whether the pods of a list of orders come to stay in cells of their own.

A cell of storage holds one pod. Where two would stay at the end, the robot with the second one would
wait for ever before the cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError, nearest
from automaton.floor.cells import DIRECTIONS, STATION, STORAGE
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.reachability import Mask, to_and_from
from automaton.scenario.carried_pods import (
    carries_pods,
    is_of_pod,
    pod_cells,
    pod_names,
    pod_numbers,
    skus_of,
)
from automaton.scenario.changing_floor import Cell
from automaton.scenario.document import Document, Keys
from automaton.scenario.orders import Line, OrderLine, Orders
from automaton.scenario.pods import Pods, PodStation
from automaton.scenario.schema import Scenario
from automaton.units import count
from automaton.world.capabilities import FleetOnFloor
from automaton.world.floor_parts import queue_path

NO_ORDER: Final = -1


def check_destinations(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """No two pods come to stay in one cell. Raises InputError.

    Orders begin in cells in which pods stand. Where a pod goes whose last order has no `to` is not known.
    """
    cells = pod_cells(scenario, floor_plan).tolist()
    names = pod_names(scenario, len(cells))
    pod_at = {floor_plan.xy(cell): f"pod {name}" for cell, name in zip(cells, names, strict=True)}
    orders = scenario.orders.listed or ()
    last = last_orders(orders)
    stays = {at: (name, NO_ORDER) for at, name in pod_at.items() if at not in last}
    for index, order in enumerate(orders):
        at, target = order.source, order.target
        if at is None or target is None:
            continue
        is_last = last[at] == index
        if target in stays and (is_last or stays[target][1] == NO_ORDER):
            raise _taken(document, index, target, pod_at[at], stays[target])
        if is_last:
            stays[target] = pod_at[at], index


def last_orders(orders: Sequence[OrderLine]) -> dict[Cell, int]:
    """By the cell in which a pod stands at first, the place of its last order in the list."""
    last: dict[Cell, int] = {}
    for index, order in enumerate(orders):
        if order.source is None:
            continue
        known = last.get(order.source)
        if known is None or orders[known].release <= order.release:
            last[order.source] = index
    return last


def _taken(
    document: Document, index: int, target: Cell, name: str, stays: tuple[str, int]
) -> InputError:
    """`stays`: the pod that stays at the target, and the order that brings it there."""
    other, earlier = stays
    text = f"order {index} brings {name} to {list(target)}, where {other} stays"
    why = f"order {earlier} brings it there" if earlier != NO_ORDER else "no order carries it away"
    return document.error(("orders", "list", index, "to"), f"{text}: {why}; choose another cell")


# Whether pods, stations, queues and lines fit the floor.


def check_pods(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Stations are stations, queues paths, and orders want pods that there are. Raises InputError."""
    if not carries_pods(scenario, floor_plan):
        for key, is_set in (("stations", scenario.stations), ("pods", scenario.pods != Pods())):
            if is_set:
                text = f"{key} belong to orders.lines, or to orders of a list that begin in storage"
                raise document.error((key,), text)
        return
    check_listed_pods(document, scenario, floor_plan)
    check_stations(document, scenario, floor_plan)
    if scenario.orders.lines is None:
        check_pod_orders(document, scenario, floor_plan)
        check_destinations(document, scenario, floor_plan)
        return
    if not len(floor_plan.stations):
        raise document.error(("layout",), "lines are done at stations, and the floor has none")
    pods = len(pod_cells(scenario, floor_plan))
    if not pods:
        raise document.error(("layout",), "lines want pods, and the floor has none: draw them as p")
    if isinstance(scenario.orders.lines, tuple):
        known = pod_numbers(scenario, pods), skus_of(scenario)
        stations = len(floor_plan.stations)
        for index, line in enumerate(scenario.orders.lines):
            keys: Keys = ("orders", "lines", index)
            check_wanted(document, line, keys, pods, *known)
            check_station(document, line, keys, list(scenario.stations), stations)
    check_classes(document, scenario.orders, scenario)


def check_pod_orders(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Orders of a list carry pods that there are, into storage, and no other loads. Raises InputError."""
    standing = set(pod_cells(scenario, floor_plan).tolist())
    for index, order in enumerate(scenario.orders.listed or ()):
        if order.source is None:
            continue
        keys: Keys = ("orders", "list", index)
        x, y = order.source
        if not is_of_pod(order, floor_plan):
            text = f"order {index} takes a load at [{x}, {y}], and other orders carry pods from storage"
            raise document.error((*keys, "from"), f"{text}: a list has one or the other")
        if floor_plan.cell(x, y) not in standing:
            raise document.error((*keys, "from"), f"no pod stands at [{x}, {y}] at the start")
        if order.target is None:
            continue
        if order.target == order.source and order.stops is None:
            raise document.error((*keys, "to"), "an order ends where it begins")
        u, v = order.target
        inside = floor_plan.holds(u, v)
        cell = floor_plan.cell(u, v) if inside else 0
        if not inside or floor_plan.kind.flat[cell] != STORAGE:
            what = (
                f"is a {floor_plan.kind_of(cell).name}"
                if inside
                else f"lies outside the floor {floor_plan.extent}"
            )
            text = f"the order of a pod ends in storage, but [{u}, {v}] {what}"
            raise document.error((*keys, "to"), text)


def check_classes(document: Document, orders: Orders, scenario: Scenario) -> None:
    """The classes by which lines are drawn are those of the pods. Raises InputError."""
    wanted = getattr(orders.lines, "classes", None)
    if wanted is None:
        return
    known = list(scenario.pods.classes or ())
    for name in wanted:
        if name not in known:
            raise document.error(("orders", "lines", "classes", name), no_class(name, known))


def check_listed_pods(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Pods that are listed stand in storage, one in each cell, and all that are drawn are listed.

    Raises InputError.
    """
    listed, classes = scenario.pods.listed, list(scenario.pods.classes or ())
    if listed is None:
        return
    standing: dict[int, str] = {}
    names: set[str] = set()
    for number, pod in enumerate(listed):
        keys: Keys = ("pods", "list", number)
        x, y = pod.at
        who = f"pod {number + 1}" if pod.name is None else f"pod {pod.name}"
        inside = floor_plan.holds(x, y)
        cell = floor_plan.cell(x, y) if inside else 0
        if not inside or floor_plan.kind.flat[cell] != STORAGE:
            there = (
                f"a {floor_plan.kind_of(cell).name} is there"
                if inside
                else f"it lies outside the floor {floor_plan.extent}"
            )
            raise document.error(keys, f"{who} stands at [{x}, {y}], but {there}, not storage")
        if cell in standing:
            raise document.error(keys, f"{standing[cell]} and {who} both stand at [{x}, {y}]")
        if pod.name in names:
            raise document.error((*keys, "name"), f"two pods are called {pod.name}")
        if pod.pod_class is not None and pod.pod_class not in classes:
            raise document.error((*keys, "class"), no_class(pod.pod_class, classes))
        if (pod.pod_class is None) != (listed[0].pod_class is None):
            without = who if pod.pod_class is None else "pod 1"
            raise document.error(keys, f"{without} has no class, and others have one")
        standing[cell] = who
        names |= set() if pod.name is None else {pod.name}
    drawn = (floor_plan.kind.reshape(-1) == STORAGE) & (floor_plan.loads.reshape(-1) != 0)
    drawn[list(standing)] = False
    if drawn.any():
        x, y = floor_plan.xy(int(np.argmax(drawn)))
        file = next((one.file for one in document.listed if one.keys == ("pods", "list")), None)
        if file is not None:
            text = f"has no pod at [{x}, {y}], where the layout has one: add a row, or draw it as q"
            raise InputError(text, file)
        text = f"the layout has a pod at [{x}, {y}], and pods.list has none there: draw it as q"
        raise document.error(("layout",), text)


def no_class(name: str, classes: list[str]) -> str:
    """Say that there is no such class of pods."""
    there = f"pods.classes has {', '.join(classes)}" if classes else "pods have no classes"
    return f"'{name}' is not a class of pods{nearest(name, classes)}: {there}"


def check_wanted(
    document: Document,
    line: Line,
    keys: Keys,
    pods: int,
    numbers: dict[str, int],
    skus: dict[str, int],
) -> None:
    """A line wants a pod, or a SKU, that there is. Raises InputError."""
    if line.pod is None:
        if str(line.sku) not in skus:
            like = (
                nearest(str(line.sku), skus) if skus else ": pods have none; set skus in pods.list"
            )
            raise document.error((*keys, "sku"), f"'{line.sku}' is not a SKU of a pod{like}")
    elif str(line.pod) not in numbers:
        like = nearest(str(line.pod), numbers) if isinstance(line.pod, str) else ""
        there = f"there are {count(pods, 'pod')}, numbered from 1 as one reads the picture"
        raise document.error((*keys, "pod"), f"'{line.pod}' is not a pod{like or f': {there}'}")


def check_station(
    document: Document, line: Line, keys: Keys, names: list[str], stations: int
) -> None:
    """A line wants its pod at a station that there is. Raises InputError."""
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
            there = (
                f"a {floor_plan.kind_of(cell).name} is there"
                if inside
                else f"it lies outside the floor {floor_plan.extent}"
            )
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
    before, hint = station.at, outwards(station)
    for number, (x, y) in enumerate(station.queue):
        if (x != before[0]) == (y != before[1]):
            text = f"the queue of {name} goes from {list(before)} to [{x}, {y}]"
            raise document.error((*keys, number), f"{text}: along neither a row nor a column{hint}")
        if not floor_plan.holds(x, y):
            raise document.error(
                (*keys, number), f"[{x}, {y}] lies outside the floor {floor_plan.extent}"
            )
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
            raise document.error(keys, text + hint)
        if not floor_plan.exits.flat[cell] >> way & 1:
            text = f"the queue of {name} breaks at [{x}, {y}]: from there no robot drives "
            raise document.error(keys, text + DIRECTIONS[way] + hint)
        if floor_plan.capacity.flat[cell] != 1:
            raise document.error(
                keys, f"[{x}, {y}] in the queue of {name} has room for more than one robot"
            )
        owner[cell] = name
        ahead = cell


def outwards(station: PodStation) -> str:
    """The rule that a queue breaks whose last cell is nearer to the station than its first; or ""."""
    if len(station.queue) < 2:
        return ""
    x, y = station.at
    first, *_, last = (abs(u - x) + abs(v - y) for u, v in station.queue)
    if last >= first:
        return ""
    return "; a queue is listed from the cell next to its station outwards: turn the list round"


def check_pod_ways(document: Document, fleet: FleetOnFloor) -> None:
    """Every pod gets to every station and back, over other storage not at all. Raises InputError."""
    floor_plan = fleet.floor_plan
    if not carries_pods(fleet.scenario, floor_plan):
        return
    cells = pod_cells(fleet.scenario, floor_plan)
    names = pod_names(fleet.scenario, len(cells))
    carried = carried_from(document, fleet, cells)
    if fleet.scenario.orders.lines is None:
        check_ways_of_orders(document, fleet, dict(zip(cells.tolist(), carried.T, strict=True)))
        return
    within: Mask = np.logical_or.reduce(fleet.within)
    for number, station in enumerate(floor_plan.stations.tolist(), 1):
        x, y = floor_plan.xy(station)
        if not within[station]:
            text = f"no robot gets to station {number} at ({x}, {y}) and back"
            raise document.error(("layout",), text)
        ways = [to_and_from(floor_plan, station, one.rail)[cells] for one in fleet.types]
        apart: Mask = ~np.logical_or.reduce(np.stack(ways) & carried)
        if apart.any():
            pod = int(np.argmax(apart))
            u, v = floor_plan.xy(int(cells[pod]))
            text = f"pod {names[pod]} at ({u}, {v}) has no way to station {number} at ({x}, {y})"
            text = f"{text} and back that leads through no other storage"
            raise document.error(pod_place(fleet.scenario, pod), text)


def check_ways_of_orders(document: Document, fleet: FleetOnFloor, carried: dict[int, Mask]) -> None:
    """The pods of listed orders get to all stops and to where they go. Raises InputError.

    `carried`: (K,) by cell of a pod, the types that carry it. One type does all of an order.
    """
    floor_plan = fleet.floor_plan
    for index, order in enumerate(fleet.scenario.orders.listed or ()):
        if order.source is None:
            continue
        keys: Keys = ("orders", "list", index)
        x, y = order.source
        begin = floor_plan.cell(x, y)
        ends = () if order.target is None else (order.target,)
        able = carried[begin].copy()
        for u, v in (*order.stop_cells, *ends):
            for kind in np.flatnonzero(able).tolist():
                ways = joined(floor_plan, floor_plan.cell(u, v), fleet.types[kind].rail)
                able[kind] = ways[begin]
            if not able.any():
                text = f"the pod at [{x}, {y}] has no way to [{u}, {v}] and back"
                raise document.error(keys, f"{text} that leads through no other storage")


def joined(floor_plan: FloorPlan, cell: int, rail: bool) -> Mask:
    """(C,) the cells from which a load gets to a cell, and to which it comes back."""
    kind = floor_plan.kind.reshape(-1)
    if kind[cell] != STORAGE:
        return to_and_from(floor_plan, cell, rail)
    ways_in: Mask = np.zeros(kind.size, np.bool_)
    for offset in floor_plan.offsets:
        if kind[cell + offset] != STORAGE and floor_plan.drivable.flat[cell + offset]:
            ways = to_and_from(floor_plan, cell + offset, rail)
            ways_in |= ways & ways[cell]
    return ways_in


def pod_place(scenario: Scenario, pod: int) -> Keys:
    """Where a scenario says of a pod where it stands."""
    return ("layout",) if scenario.pods.listed is None else ("pods", "list", pod)


def carried_from(document: Document, fleet: FleetOnFloor, cells: npt.NDArray[np.intp]) -> Mask:
    """(K, p) whether robots of a type carry a pod and get to where it stands. Raises InputError."""
    listed = fleet.scenario.pods.listed
    weights: npt.NDArray[np.int64] = np.ones(len(cells), np.int64)
    if listed is not None:
        weights[:] = [pod.weight for pod in listed]
    carried: Mask = np.zeros((len(fleet.types), len(cells)), np.bool_)
    for weight in np.unique(weights).tolist():
        here = weights == weight
        carries = np.array([robot_type.payload >= weight for robot_type in fleet.types])
        if not carries.any():
            pod = int(np.argmax(here))
            name = pod_names(fleet.scenario, len(cells))[pod]
            text = f"pod {name} weighs {weight:,}, but no robot carries more than {fleet.payload:,}"
            raise document.error((*pod_place(fleet.scenario, pod), "weight"), text)
        carried[:, here] = fleet.loaded[:, cells[here]] & carries[:, None]
    return carried
