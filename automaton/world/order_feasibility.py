"""Whether orders fit a floor: robots can reach sources and targets, carry the loads, and return."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from automaton.errors import Finding, Keys, alternatives
from automaton.floor.floor_plan import (
    ANY_LOADS,
    CELL_KINDS,
    DESTINATION,
    DIRECTIONS,
    DOCK,
    DRIVABLE,
    RACK,
    SHELF,
    STATION,
    UNLIMITED,
    FloorPlan,
)
from automaton.floor.reachability import (
    closed_step,
    reached,
    slot_access,
    slots_beside,
)
from automaton.scenario.arrivals import expected_orders, second_of_week
from automaton.scenario.floor_section import Floor
from automaton.scenario.order_lines import transports_of
from automaton.scenario.orders import MAX_DRAWN_LINES, OrderLine
from automaton.scenario.robot_types import RobotType
from automaton.scenario.schema import Scenario
from automaton.scenario.validation import dotted
from automaton.units import count, ticks_and_time, unit
from automaton.world.capabilities import FleetOnFloor
from automaton.world.task_lists import MAX_TASK_ORDERS, order_count, stop_groups

REQUIRED_KINDS = {  # kinds of cells that a generator needs
    "dock-to-rack": (DOCK, RACK),
    "stations": (STATION,),
    "visits": (STATION,),
}
REMOTE = np.array([kind.remote for kind in CELL_KINDS])  # (kinds,) bool


def check_orders(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """Orders lead from slots that give loads to slots that take them."""
    generator = scenario.orders.generator
    if scenario.stop.when == "on-targets":
        yield from check_targets(scenario, floor_plan)
    if scenario.orders.follows_profile:
        yield from check_profile(scenario)
    if scenario.orders.parts is not None:
        yield from check_parts(scenario, floor_plan)
        return
    if scenario.orders.tasks is not None:
        yield from check_tasks(scenario, floor_plan)
        return
    if generator == "tours" or scenario.orders.lines is not None:
        return
    if scenario.orders.listed is None:
        for kind in REQUIRED_KINDS.get(generator or "", (SHELF, DESTINATION)):
            if not np.any(floor_plan.kind == kind):
                name = CELL_KINDS[kind].name
                text = f"the orders {generator} need a {name}, but the floor has none"
                yield Finding(("layout",), text)
        if generator == "stations" and np.count_nonzero(floor_plan.kind == STATION) < 2:
            text = "the orders stations need two stations, but the floor has only one"
            yield Finding(("layout",), text)
        return
    taken: dict[tuple[int, int], int] = {}
    begins: dict[tuple[int, int], bool] = {}  # by kind, whether several orders may begin in a cell
    ends: set[tuple[int, int]] = set()
    for index, order in enumerate(scenario.orders.listed):
        if order.stops is not None:
            keys: Keys = ("orders", "list", index, "stops")
            yield from check_stops(order.stop_cells, keys, floor_plan)
    for index, order in transports_of(scenario, floor_plan):
        keys = ("orders", "list", index)
        if order.target is None:
            text = f"the key 'to' is missing in {dotted(keys)}"
            hint = "only the order of a pod, from storage, may leave it out"
            yield Finding(keys, f"{text}; {hint}")
            continue
        source, target = order.ends
        if order.stops is not None and source == target:
            text = (
                "an order with from and to carries a load between them; leave both out if the "
                "robot only visits its stops"
            )
            yield Finding(keys, text)
        if source not in begins or target not in ends or source == target:
            yield from _check_order(order, keys, floor_plan)
            slot_kind = floor_plan.kind_of(floor_plan.cell(*source))
            begins[source] = slot_kind.holds == ANY_LOADS
            ends.add(target)
        if begins[source]:
            continue
        if source in taken:
            x, y = source
            name = floor_plan.kind_of(floor_plan.cell(x, y)).name
            yield Finding(
                (*keys, "from"),
                f"order {index} takes the load of [{x}, {y}], like order {taken[source]}; "
                f"a {name} holds one load",
            )
        taken[source] = index


def check_profile(scenario: Scenario) -> Iterator[Finding]:
    """A profile brings orders before the end of the run, and not too many."""
    keys: Keys = ("orders", "arrivals", "profile")
    number = arriving_orders(scenario)
    end = ticks_and_time(scenario.stop.max_duration, unit(scenario.units.tick))
    if not number:
        text = f"the profile has no orders in the {end} of a run (stop.max_duration)"
        yield Finding(keys, f"{text} after {scenario.units.clock} (units.clock)")
    is_open = scenario.orders.has_random_count and scenario.orders.count is None
    if is_open and number > MAX_DRAWN_LINES:
        text = f"the profile brings about {number:,.0f} orders in the {end} of a run, at most"
        yield Finding(keys, f"{text} {MAX_DRAWN_LINES:,} are possible; set orders.count")


def arriving_orders(scenario: Scenario) -> float:
    """The mean number of orders of a profile that arrive before the end of a run."""
    arrivals, scale = scenario.orders.arrivals, scenario.units.scale
    assert arrivals is not None and scale.clock is not None, "checked: a profile needs a clock"
    seconds = float(scenario.stop.max_duration * scale.tick_seconds)
    return expected_orders(arrivals.rates, second_of_week(scale.clock), seconds)


def arrivals_in_words(scenario: Scenario) -> list[str]:
    """The sentence of `check` about the orders of a profile; [] without one."""
    if not scenario.orders.follows_profile:
        return []
    end = ticks_and_time(scenario.stop.max_duration, unit(scenario.units.tick))
    most = "" if scenario.orders.count is None else f", {scenario.orders.count:,} at most"
    what = "orders" if scenario.orders.lines is None else "orders with lines"
    return [f"about {arriving_orders(scenario):,.0f} {what} arrive in {end}{most}"]


def check_parts(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """Parts go through existing stations, and each has a processing time."""
    count = len(floor_plan.stations)
    if not count:
        yield Finding(("layout",), "parts need stations, but the floor has none")
    there = f"the floor has the stations 1 to {count}"
    for row, kind in enumerate(scenario.orders.parts or ()):
        for place, number in enumerate(kind.route):
            if number > count:
                keys: Keys = ("orders", "parts", row, "route", place)
                yield Finding(keys, f"a part goes to station {number}, but {there}")
    times = scenario.orders.processing_time
    if isinstance(times, tuple) and len(times) != count:
        listed = f"{len(times)} station{'' if len(times) == 1 else 's'}"
        text = f"orders.processing_time lists {listed}, but {there}"
        yield Finding(("orders", "processing_time"), text)


def check_tasks(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """The cells of tasks are drivable, and pre-assigned tasks are not too many."""
    keys: Keys = ("orders", "tasks")
    tasks = scenario.orders.tasks or ()
    for number, task in enumerate(tasks):
        yield from check_stops(task, (*keys, number), floor_plan)
    most = order_count(scenario, floor_plan)
    if most > MAX_TASK_ORDERS:
        text = (
            f"in {ticks_and_time(scenario.stop.max_duration, unit(scenario.units.tick))} the robots "
            f"could do {most:,} tasks, more than a run holds ({MAX_TASK_ORDERS:,}); set a lower "
            "stop.max_duration, or assign: pool"
        )
        yield Finding(("stop", "max_duration"), text)


def check_targets(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """With stop.when on-targets each robot has at most one task, and stays in the last cell of it."""
    orders, fleet, keys = scenario.orders, scenario.fleet, ("stop", "when")
    if not isinstance(orders.tasks, tuple) or orders.assign != "round-robin" or orders.repeat:
        text = "on-targets needs orders.tasks with assign: round-robin and without repeat"
        yield Finding(keys, text)
        return
    if len(orders.tasks) > fleet.robots:
        text = f"on-targets needs at most one task for each robot, but there are {len(orders.tasks):,} "
        yield Finding(keys, f"{text}tasks for {count(fleet.robots, 'robot')}")
    if fleet.when_idle != "park" or fleet.start == "parking-bays":
        text = "on-targets needs robots that stay on the floor: set fleet.when_idle to park, and"
        yield Finding(keys, f"{text} fleet.start to cells of the floor")
    taken: dict[Any, int] = {}
    for number, task in enumerate(orders.tasks):
        x, y = task[-1]
        first = taken.setdefault((x, y), number)
        if not floor_plan.holds(x, y) or first == number:
            continue
        if floor_plan.capacity.flat[floor_plan.cell(x, y)] != UNLIMITED:
            text = (
                f"the task of robot {number} ends in [{x}, {y}], where that of robot {first} ends"
            )
            yield Finding(("orders", "tasks", number), f"{text}; on-targets needs different cells")


def check_stops(stops: Iterable[Any], keys: Keys, floor_plan: FloorPlan) -> Iterator[Finding]:
    """The stops of an order are drivable cells."""
    for number, (x, y) in enumerate(stops):
        stop = f"{dotted((*keys, number))}: the stop [{x}, {y}]"
        if not floor_plan.holds(x, y):
            text = f"{stop} lies outside the floor {floor_plan.extent}"
            yield Finding((*keys, number), text)
            continue
        kind = floor_plan.kind.flat[floor_plan.cell(x, y)]
        if not DRIVABLE[kind]:
            text = f"{stop} is a {CELL_KINDS[kind].name}: robots do not drive there"
            yield Finding((*keys, number), text)


def _check_order(order: OrderLine, keys: Keys, floor_plan: FloorPlan) -> Iterator[Finding]:
    source, target = order.ends
    for name, (x, y) in (("from", source), ("to", target)):
        if not floor_plan.holds(x, y):
            text = f"[{x}, {y}] lies outside the floor {floor_plan.extent}"
            yield Finding((*keys, name), text)
            return
        kind = floor_plan.kind_of(floor_plan.cell(x, y))
        verb, allowed = ("begins", kind.gives) if name == "from" else ("ends", kind.takes)
        if not allowed:
            others = (k for k in CELL_KINDS if (k.gives if name == "from" else k.takes))
            names = alternatives(f"a {other.name}" for other in others)
            text = f"an order {verb} at {names}; [{x}, {y}] is a {kind.name}"
            yield Finding((*keys, name), text)
    visit = floor_plan.kind_of(floor_plan.cell(*source)).code == STATION
    if source == target and not visit:
        yield Finding((*keys, "to"), "an order ends where it begins")


def check_floor(floor: Floor, fleet: FleetOnFloor) -> Iterator[Finding]:
    """Every robot can serve every shelf and destination and return home.

    Slots of remote kinds may be out of reach: they get no orders.
    """
    floor_plan, kind = floor.floor_plan, floor.floor_plan.kind.reshape(-1)
    for slots, why in (
        (
            slots_beside(floor_plan, ~floor_plan.drivable.reshape(-1)),
            "has no drivable cell beside it",
        ),
        (
            slots_beside(floor_plan, ~np.logical_or.reduce(fleet.within)),
            "cannot be served: a robot must be able to drive from its start to a cell beside it, "
            "and back",
        ),
    ):
        unserved = slots[~REMOTE[kind[slots]]].tolist()
        if unserved:
            x, y = floor_plan.xy(unserved[0])
            name = CELL_KINDS[kind[unserved[0]]].name
            why += closed_way(fleet, unserved[0])
            yield Finding(floor.row_keys(y), f"the {name} at ({x}, {y}) {why}")
    for robot_type, cells, within in zip(fleet.types, fleet.starts, fleet.within, strict=True):
        apart = cells[~within[cells]]
        if apart.size:
            (x, y), (x0, y0) = floor_plan.xy(int(apart[0])), floor_plan.xy(int(cells[0]))
            who = f"robots ({robot_type.name})" if robot_type.name else "robots"
            text = f"{who} start in parts of the floor that are not connected both ways: "
            yield Finding(floor.row_keys(y), f"{text}({x0}, {y0}) and ({x}, {y})")


def closed_way(fleet: FleetOnFloor, cell: int) -> str:
    """The closed direction on the way to a slot or back, and how to open it; "" if none is closed."""
    floor_plan, rail = fleet.floor_plan, fleet.types[0].rail
    homes = fleet.starts[0][:1].tolist()
    access = slot_access(floor_plan)[fleet.slot_of[cell]]
    beside = access[access >= 0].tolist()
    there = [c for c in beside if reached(floor_plan, homes, rail)[c]]
    found = (
        closed_step(floor_plan, there, homes) if there else closed_step(floor_plan, homes, beside)
    )
    if found is None:
        return ""
    a, b, direction = found
    against = floor_plan.exits.flat[b] == 1 << (direction ^ 2)  # its one-way exit leads to a
    (x, y), (x1, y1), (x2, y2) = (
        floor_plan.xy(a),
        floor_plan.xy(b),
        floor_plan.xy(b if against else a),
    )
    step = f"{DIRECTIONS[direction]} from ({x}, {y}) into ({x1}, {y1})"
    return (
        f"; the way {'back' if there else 'there'} leads {step}, which is closed: "
        f"let robots drive both ways at ({x2}, {y2})"
    )


def check_tours(fleet: FleetOnFloor) -> Iterator[Finding]:
    """Tours have cells to visit."""
    orders = fleet.scenario.orders
    groups = stop_groups(orders, fleet.floor_plan, fleet.within)
    if orders.cells == "all" and len(groups[0]) < 2:
        yield Finding(("layout",), "the orders tours need two cells, but robots reach only one")
        return
    names = orders.cells if isinstance(orders.cells, tuple) else (orders.cells,)
    meanings = {"stations": "station", "racks": "cell above or below a rack"}
    for name, cells in zip(names, groups, strict=True):
        if not len(cells):
            needed = meanings.get(name, "cell outside dead ends")
            yield Finding(("orders", "cells"), f"tours need a {needed}, but robots reach none")


def check_service(fleet: FleetOnFloor) -> Iterator[Finding]:
    """Robots reach the docks and racks that orders name, and some of each required kind."""
    orders, floor_plan = fleet.scenario.orders, fleet.floor_plan
    served = np.logical_or.reduce(fleet.served)
    why = "a robot must be able to drive from its start to its front, and back"
    kinds = floor_plan.kind.reshape(-1)[floor_plan.slots]
    for kind in REQUIRED_KINDS.get(orders.generator or "", ()):
        few = 2 if orders.generator == "stations" else 1
        if np.count_nonzero(served[kinds == kind]) < few:
            name = CELL_KINDS[kind].name
            found = f"no {name}" if few == 1 else f"fewer than two {name}s"
            yield Finding(("layout",), f"{found} can be served: {why}")

    if orders.generator == "tours":
        yield from check_tours(fleet)

    def because(cell: int) -> str:
        if fleet.service.accessible[:, fleet.slot_of[cell]].any():
            return "areas cut off robots with its load"
        return why + closed_way(fleet, cell)

    for number in sorted({number for kind in orders.parts or () for number in kind.route}):
        cell = int(floor_plan.stations[number - 1])
        if not served[fleet.slot_of[cell]]:
            yield Finding(("layout",), f"station {number} cannot be served: {because(cell)}")
    tasks: Sequence[Any] = orders.tasks or ()
    for number, task in enumerate(tasks):
        if all(fleet.within[:, floor_plan.cell(x, y)].all() for x, y in task):
            continue
        yield from check_reached(fleet, task, 1, ("orders", "tasks", number))
    is_served: set[tuple[int, int]] = set()  # checked cells
    for index, order in enumerate(orders.listed or ()):
        if order.stops is not None:
            keys: Keys = ("orders", "list", index)
            yield from check_reached(fleet, order.stop_cells, order.weight, keys, order.has_load)
        if order.target is None or is_served.issuperset(order.ends):
            continue
        for name, (x, y) in zip(("from", "to"), order.ends, strict=True):
            cell = floor_plan.cell(x, y)
            if not served[fleet.slot_of[cell]]:
                kind_name = floor_plan.kind_of(cell).name
                yield Finding(
                    ("orders", "list", index, name),
                    f"the {kind_name} at [{x}, {y}] cannot be served: {because(cell)}",
                )
        is_served.update(order.ends)


def check_reached(
    fleet: FleetOnFloor,
    stops: Sequence[Any],
    weight: int,
    keys: Keys,
    has_load: bool = False,
) -> Iterator[Finding]:
    """Some type of robots reaches all stops of an order and carries its weight."""
    floor_plan = fleet.floor_plan
    carries = np.array([robot_type.payload >= weight for robot_type in fleet.types])
    if not carries.any():
        text = f"the order weighs {weight:,}, but no robot carries more than {fleet.payload:,}"
        yield Finding(keys, text)
        return
    cells = [floor_plan.cell(x, y) for x, y in stops]
    reached_by = (fleet.loaded if has_load else fleet.within)[carries][:, cells]
    if reached_by.all(axis=1).any():
        return
    lost = int(np.argmin(reached_by.any(axis=0)))
    x, y = stops[lost]
    text = f"no robot that can do the order can reach its stop [{x}, {y}] from its start and return"
    if reached_by.any(axis=0).all():
        text = "no type of robot can reach all stops of the order"
    of_stop: Keys = (*keys, lost) if keys[1] == "tasks" else (*keys, "stops", lost)
    yield Finding(of_stop, f"{dotted(of_stop)}: {text}")


def check_abilities(fleet: FleetOnFloor) -> Iterator[Finding]:
    """Some robot can pick up each order, and some robot can deliver it."""
    impossible = fleet.impossible()
    if impossible is None:
        return
    (way, verb, cell), floor_plan, most = impossible, fleet.floor_plan, fleet.payload
    if not verb:
        text = f"{way.what} weighs {way.weight:,}, but no robot carries more than {most:,}"
        yield Finding(way.keys, text)
        return
    x, y = floor_plan.xy(cell)
    weight = f", of weight {way.weight:,}," if most < RobotType().payload else ""
    name = floor_plan.kind_of(cell).name
    text = f"{way.what}{weight} {verb} at the {name} [{x}, {y}]"
    yield Finding(way.keys, f"{text}, which no robot that can carry it may enter")


def check_loaded_ways(fleet: FleetOnFloor) -> Iterator[Finding]:
    """Areas do not cut robots off from the targets of their loads."""
    parted = fleet.parted()
    if parted is None:
        return
    name, begin, end = parted
    (x, y), (u, v) = fleet.floor_plan.xy(begin), fleet.floor_plan.xy(end)
    who = f"robots of the type {name}" if name else "robots"
    yield Finding(
        ("areas",),
        f"{who} with a load cannot drive from [{x}, {y}] to [{u}, {v}]: areas are closed to them",
    )
