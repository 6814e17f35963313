"""Whether pods, their stations with queues, and their orders fit the floor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.errors import WHOLE_LIST, Finding, Keys, nearest
from automaton.floor.floor_plan import DIRECTIONS, STATION, STORAGE, FloorPlan
from automaton.floor.reachability import Mask, to_and_from
from automaton.scenario.changing_floor import Cell
from automaton.scenario.order_lines import (
    carries_pods,
    is_of_pod,
    pod_cells,
    pod_names,
    pod_numbers,
    skus_of,
)
from automaton.scenario.orders import Line, OrderLine, Orders
from automaton.scenario.pods import Pods, PodStation
from automaton.scenario.schema import Scenario
from automaton.units import count
from automaton.world.capabilities import FleetOnFloor
from automaton.world.floor_parts import queue_path

NO_ORDER: Final = -1


def check_pods(
    scenario: Scenario, floor_plan: FloorPlan, are_of_file: bool = False
) -> Iterator[Finding]:
    """Named stations are stations, queues are paths, and orders need existing pods.

    `are_of_file`: pods.list comes from a file.
    """
    if scenario.orders.parts is not None or scenario.orders.tasks is not None:
        return
    if not carries_pods(scenario, floor_plan):
        for key, is_set in (("stations", scenario.stations), ("pods", scenario.pods != Pods())):
            if is_set:
                text = f"{key} belong to orders.lines, or to orders of a list that begin in storage"
                yield Finding((key,), text)
        return
    yield from check_listed_pods(scenario, floor_plan, are_of_file)
    yield from check_stations(scenario, floor_plan)
    if scenario.orders.lines is None:
        yield from check_pod_orders(scenario, floor_plan)
        yield from check_destinations(scenario, floor_plan)
        return
    stations, pods = len(floor_plan.stations), len(pod_cells(scenario, floor_plan))
    if not stations:
        yield Finding(("layout",), "lines need stations, but the floor has none")
    if not pods:
        yield Finding(("layout",), "lines need pods, but the floor has none; draw them as p")
    if isinstance(scenario.orders.lines, tuple):
        numbers, skus = pod_numbers(scenario, pods), skus_of(scenario)
        for index, line in enumerate(scenario.orders.lines):
            keys: Keys = ("orders", "lines", index)
            yield from check_wanted(line, keys, pods, numbers, skus)
            yield from check_station(line, keys, list(scenario.stations), stations)
    yield from check_classes(scenario.orders, list(scenario.pods.classes or ()))


def check_listed_pods(
    scenario: Scenario, floor_plan: FloorPlan, are_of_file: bool
) -> Iterator[Finding]:
    """Listed pods stand in storage, one in each cell, and all drawn pods are listed."""
    listed, classes = scenario.pods.listed, list(scenario.pods.classes or ())
    if listed is None:
        return
    standing: dict[int, str] = {}
    names: set[str] = set()
    for number, pod in enumerate(listed):
        keys: Keys = ("pods", "list", number)
        x, y = pod.at
        who = f"pod {number + 1}" if pod.name is None else f"pod {pod.name}"
        if other := _other_than(STORAGE, pod.at, floor_plan):
            yield Finding(keys, f"{who} stands at [{x}, {y}], but {other}, not storage")
            continue
        cell = floor_plan.cell(x, y)
        if cell in standing:
            yield Finding(keys, f"{standing[cell]} and {who} both stand at [{x}, {y}]")
        if pod.name in names:
            yield Finding((*keys, "name"), f"two pods are called {pod.name}")
        if pod.pod_class is not None and pod.pod_class not in classes:
            yield Finding((*keys, "class"), no_class(pod.pod_class, classes))
        if (pod.pod_class is None) != (listed[0].pod_class is None):
            without = who if pod.pod_class is None else "pod 1"
            yield Finding(keys, f"{without} has no class, but other pods have one")
        standing[cell] = who
        names |= set() if pod.name is None else {pod.name}
    drawn = (floor_plan.kind.reshape(-1) == STORAGE) & (floor_plan.loads.reshape(-1) != 0)
    drawn[list(standing)] = False
    if not drawn.any():
        return
    x, y = floor_plan.xy(int(np.argmax(drawn)))
    if are_of_file:
        text = f"has no pod at [{x}, {y}], where the layout has one: add a row, or draw it as q"
        yield Finding(("pods", "list", WHOLE_LIST), text)
    else:
        text = f"the layout has a pod at [{x}, {y}], but pods.list has none there: draw it as q"
        yield Finding(("layout",), text)


def _other_than(kind: int, at: Cell, floor_plan: FloorPlan) -> str:
    """What is at a cell that should be of a given kind; "" if it is of that kind."""
    if not floor_plan.holds(*at):
        return f"it lies outside the floor {floor_plan.extent}"
    cell = floor_plan.cell(*at)
    return (
        "" if floor_plan.kind.flat[cell] == kind else f"a {floor_plan.kind_of(cell).name} is there"
    )


def check_stations(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """Names refer to different stations, and queues share no cells."""
    owner: dict[int, str] = {int(cell): "" for cell in floor_plan.stations}
    named: dict[int, str] = {}
    for name, station in scenario.stations.items():
        x, y = station.at
        keys: Keys = ("stations", name, "at")
        if other := _other_than(STATION, station.at, floor_plan):
            yield Finding(keys, f"station {name} is at [{x}, {y}], but {other}, not a station")
            continue
        cell = floor_plan.cell(x, y)
        if cell in named:
            yield Finding(keys, f"stations {named[cell]} and {name} are both at [{x}, {y}]")
        named[cell] = name
        yield from check_queue(name, station, floor_plan, owner)


def check_queue(
    name: str, station: PodStation, floor_plan: FloorPlan, owner: dict[int, str]
) -> Iterator[Finding]:
    """The queue of a station is a path on which robots drive to it.

    Modifies `owner`: by cell the name of the station that the queue belongs to, "" for a station.
    """
    keys: Keys = ("stations", name, "queue")
    before, hint = station.at, outwards(station)
    for number, (x, y) in enumerate(station.queue):
        if (x != before[0]) == (y != before[1]):
            text = f"the queue of {name} goes from {list(before)} to [{x}, {y}]"
            yield Finding((*keys, number), f"{text}: along neither a row nor a column{hint}")
            return
        if not floor_plan.holds(x, y):
            text = f"[{x}, {y}] lies outside the floor {floor_plan.extent}"
            yield Finding((*keys, number), text)
            return
        before = (x, y)
    ahead = floor_plan.cell(*station.at)
    for cell in queue_path(floor_plan, station.at, station.queue):
        x, y = floor_plan.xy(cell)
        way = floor_plan.offsets.index(ahead - cell)
        if cell in owner:
            whose = f"that of {owner[cell]}" if owner[cell] else "a station"
            text = f"the queue of {name} contains [{x}, {y}], which is {whose}"
            if owner[cell] == name:
                text = f"the queue of {name} contains [{x}, {y}] twice"
            yield Finding(keys, text + hint)
        if not floor_plan.exits.flat[cell] >> way & 1:
            text = f"the queue of {name} breaks at [{x}, {y}]: from there no robot drives "
            yield Finding(keys, text + DIRECTIONS[way] + hint)
        if floor_plan.capacity.flat[cell] != 1:
            text = f"[{x}, {y}] in the queue of {name} has room for more than one robot"
            yield Finding(keys, text)
        owner[cell] = name
        ahead = cell


def outwards(station: PodStation) -> str:
    """A hint for a queue that is listed in reverse: its last cell is nearer to the station; else ""."""
    if len(station.queue) < 2:
        return ""
    x, y = station.at
    first, *_, last = (abs(u - x) + abs(v - y) for u, v in station.queue)
    if last >= first:
        return ""
    return "; a queue is listed from the cell next to its station outwards: reverse the list"


# Orders of a list that carry pods.


def check_pod_orders(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """Listed orders carry existing pods, into storage, and no other loads."""
    standing = set(pod_cells(scenario, floor_plan).tolist())
    for index, order in enumerate(scenario.orders.listed or ()):
        if order.source is None:
            continue
        keys: Keys = ("orders", "list", index)
        x, y = order.source
        if not is_of_pod(order, floor_plan):
            text = (
                f"order {index} takes a load at [{x}, {y}], but other orders carry pods from "
                "storage"
            )
            yield Finding((*keys, "from"), f"{text}; a list cannot contain both")
            continue
        if floor_plan.cell(x, y) not in standing:
            yield Finding((*keys, "from"), f"no pod stands at [{x}, {y}] at the start")
        if order.target is None:
            continue
        if order.target == order.source and order.stops is None:
            yield Finding((*keys, "to"), "an order ends where it begins")
        u, v = order.target
        what = f"lies outside the floor {floor_plan.extent}"
        if floor_plan.holds(u, v):
            kind = floor_plan.kind_of(floor_plan.cell(u, v))
            what = "" if kind.code == STORAGE else f"is a {kind.name}"
        if what:
            text = f"the order of a pod ends in storage, but [{u}, {v}] {what}"
            yield Finding((*keys, "to"), text)


def check_destinations(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """No two pods stay in the same cell: the robot with the second pod would wait for ever.

    Requires that orders begin in cells with pods. The last cell of a pod is unknown if its last order
    has no `to`.
    """
    cells = pod_cells(scenario, floor_plan).tolist()
    names = pod_names(scenario, len(cells))
    pod_at = {floor_plan.xy(cell): f"pod {name}" for cell, name in zip(cells, names, strict=True)}
    orders = scenario.orders.listed or ()
    last = last_orders(orders)
    # By cell: the pod that stays there, and the order that brings it.
    stays = {at: (name, NO_ORDER) for at, name in pod_at.items() if at not in last}
    for index, order in enumerate(orders):
        at, target = order.source, order.target
        if at is None or target is None:
            continue
        is_last = last[at] == index
        if target in stays and (is_last or stays[target][1] == NO_ORDER):
            other, earlier = stays[target]
            why = "no order carries it away"
            if earlier != NO_ORDER:
                why = f"order {earlier} brings it there"
            text = (
                f"order {index} brings {pod_at[at]} to {list(target)}, where {other} stays: {why}"
            )
            yield Finding(("orders", "list", index, "to"), f"{text}; choose another cell")
        if is_last:
            stays[target] = pod_at[at], index


def last_orders(orders: Sequence[OrderLine]) -> dict[Cell, int]:
    """The index of the last order of each pod, by its start cell."""
    last: dict[Cell, int] = {}
    for index, order in enumerate(orders):
        if order.source is None:
            continue
        known = last.get(order.source)
        if known is None or orders[known].release <= order.release:
            last[order.source] = index
    return last


# Lines, which request pods at stations.


def check_wanted(
    line: Line, keys: Keys, pods: int, numbers: dict[str, int], skus: dict[str, int]
) -> Iterator[Finding]:
    """A line requests an existing pod or SKU."""
    if line.pod is None:
        if str(line.sku) not in skus:
            like = (
                nearest(str(line.sku), skus) if skus else ": pods have none; set skus in pods.list"
            )
            yield Finding((*keys, "sku"), f"'{line.sku}' is not a SKU of a pod{like}")
    elif str(line.pod) not in numbers:
        like = nearest(str(line.pod), numbers) if isinstance(line.pod, str) else ""
        there = f"there are {count(pods, 'pod')}, numbered from 1 in reading order of the picture"
        yield Finding((*keys, "pod"), f"'{line.pod}' is not a pod{like or f': {there}'}")


def check_station(line: Line, keys: Keys, names: list[str], stations: int) -> Iterator[Finding]:
    """A line names an existing station."""
    if line.station is None or line.station in names:
        return
    if not isinstance(line.station, int) or not 1 <= line.station <= stations:
        known = [*names, *(str(k + 1) for k in range(stations))]
        text = f"'{line.station}' is not a station{nearest(str(line.station), names)}"
        yield Finding((*keys, "station"), f"{text}; there are {', '.join(known)}")


def check_classes(orders: Orders, known: list[str]) -> Iterator[Finding]:
    """The classes of random lines are classes of pods."""
    for name in getattr(orders.lines, "classes", None) or ():
        if name not in known:
            yield Finding(("orders", "lines", "classes", name), no_class(name, known))


def no_class(name: str, classes: list[str]) -> str:
    """A finding about an unknown class of pods."""
    there = f"pods.classes has {', '.join(classes)}" if classes else "pods have no classes"
    return f"'{name}' is not a class of pods{nearest(name, classes)}: {there}"


# The ways of pods, which avoid other storage, and the robots that carry them.


def check_pod_ways(fleet: FleetOnFloor) -> Iterator[Finding]:
    """Some robot carries each pod, and reaches every station with it, and returns."""
    scenario, floor_plan = fleet.scenario, fleet.floor_plan
    if not carries_pods(scenario, floor_plan):
        return
    cells = pod_cells(scenario, floor_plan)
    names = pod_names(scenario, len(cells))
    weights = pod_weights(scenario, len(cells))
    if (weights > fleet.payload).any():
        # The lightest pod that is too heavy; of several, the first.
        pod = int(np.argmax(weights == weights[weights > fleet.payload].min()))
        text = f"pod {names[pod]} weighs {weights[pod]:,}, but no robot carries more than"
        yield Finding((*pod_place(scenario, pod), "weight"), f"{text} {fleet.payload:,}")
    payloads = np.array([one.payload for one in fleet.types])
    carried: Mask = fleet.loaded[:, cells] & (payloads[:, None] >= weights)
    if scenario.orders.lines is None:
        yield from check_ways_of_orders(fleet, dict(zip(cells.tolist(), carried.T, strict=True)))
        return
    within: Mask = np.logical_or.reduce(fleet.within)
    for number, station in enumerate(floor_plan.stations.tolist(), 1):
        x, y = floor_plan.xy(station)
        if not within[station]:
            yield Finding(
                ("layout",), f"no robot can reach station {number} at ({x}, {y}) and return"
            )
        ways = [to_and_from(floor_plan, station, one.rail)[cells] for one in fleet.types]
        apart: Mask = ~np.logical_or.reduce(np.stack(ways) & carried)
        if apart.any():
            pod = int(np.argmax(apart))
            u, v = floor_plan.xy(int(cells[pod]))
            text = f"pod {names[pod]} at ({u}, {v}) has no route to station {number} at ({x}, {y})"
            text = f"{text} and back that avoids other storage"
            yield Finding(pod_place(scenario, pod), text)


def pod_weights(scenario: Scenario, pods: int) -> npt.NDArray[np.int64]:
    """(p,) the weight of each pod."""
    listed = scenario.pods.listed
    return np.array([1] * pods if listed is None else [pod.weight for pod in listed], np.int64)


def pod_place(scenario: Scenario, pod: int) -> Keys:
    """The keys of the start cell of a pod."""
    return ("layout",) if scenario.pods.listed is None else ("pods", "list", pod)


def check_ways_of_orders(fleet: FleetOnFloor, carried: dict[int, Mask]) -> Iterator[Finding]:
    """The pods of listed orders can reach all stops and their targets.

    `carried`: (K,) by cell of a pod, the types that carry it. One type must do the whole order.
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
                text = f"the pod at [{x}, {y}] has no route to [{u}, {v}] and back"
                yield Finding(keys, f"{text} that avoids other storage")
                break


def joined(floor_plan: FloorPlan, cell: int, rail: bool) -> Mask:
    """(C,) the cells from which a load can reach a cell, and return."""
    kind = floor_plan.kind.reshape(-1)
    if kind[cell] != STORAGE:
        return to_and_from(floor_plan, cell, rail)
    ways_in: Mask = np.zeros(kind.size, np.bool_)
    for offset in floor_plan.offsets:
        if kind[cell + offset] != STORAGE and floor_plan.drivable.flat[cell + offset]:
            ways = to_and_from(floor_plan, cell + offset, rail)
            ways_in |= ways & ways[cell]
    return ways_in
