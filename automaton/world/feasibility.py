"""Whether robots on rails find tracks and turntables among robots that need none."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from automaton.engine.state import GATE_BLOCK, GATE_LIFT, NIL
from automaton.errors import InputError, alternatives, nearest
from automaton.floor.cells import (
    ANY_LOADS,
    CELL_KINDS,
    CHARGER,
    DESTINATION,
    DIRECTIONS,
    DOCK,
    RACK,
    SHELF,
    STATION,
    STORAGE,
    TRACK,
    TURNTABLE,
    UNLIMITED,
)
from automaton.floor.floor_plan import DRIVABLE, FloorPlan
from automaton.floor.reachability import (
    closed_step,
    rack_stands,
    reached,
    slot_access,
    slots_beside,
)
from automaton.scenario.carried_pods import transports_of
from automaton.scenario.document import Document, Keys
from automaton.scenario.fleet import ALL, EMPTY, GROUPS, StartFile
from automaton.scenario.floor_section import Floor
from automaton.scenario.orders import OrderLine
from automaton.scenario.robot_types import RobotType
from automaton.scenario.schema import Scenario
from automaton.scenario.validation import dotted
from automaton.units import ticks_and_time, unit
from automaton.world.capabilities import FleetOnFloor, Start
from automaton.world.gate_cells import check_gates, check_homes, check_starts_at_gates
from automaton.world.pod_feasibility import check_pod_ways, check_pods
from automaton.world.task_lists import MAX_ORDERS, order_count


def check_rails(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Rail robots beside others have both tracks and turntables. Raises InputError."""
    fleet = scenario.fleet
    ways = [fleet.kinematics_of(kind) for kind in fleet.types]
    if "rail" not in ways or len(set(ways)) == 1:
        return
    missing = [
        f"{CELL_KINDS[kind].name}s"
        for kind in (TRACK, TURNTABLE)
        if not (floor_plan.kind == kind).any()
    ]
    if missing:
        number = ways.index("rail")
        raise document.error(
            ("fleet", "types", number),
            f"{fleet.types[number].name} drives on rails beside robots that do not, which takes tracks "
            f"and turntables, but the floor has no {' and no '.join(missing)}; draw them, or set "
            "kinematics of this type to differential or omni",
        )


# What only the floor can tell: whether robots fit, and loads can be reached and delivered.


REQUIRED_KINDS = {  # kinds of cells without which a generator has nothing to draw
    "dock-to-rack": (DOCK, RACK),
    "stations": (STATION,),
    "visits": (STATION,),
}
NO_STRATEGY = "none"
ROBOTS: Keys = ("fleet", "robots")
START: Keys = ("fleet", "start")
REMOTE = np.array([kind.remote for kind in CELL_KINDS])  # (kinds,) bool


START_DESCRIPTIONS = {
    "parking-bays": "parking bays",
    "racks": "cells in front of racks",
    "random": "cells",
}  # by start


def check_feasible(document: Document, scenario: Scenario, floor: Floor) -> FleetOnFloor:
    """The fleet on its floor, where the scenario fits it. Raises InputError."""
    floor_plan = floor.floor_plan
    check_areas(document, scenario, floor_plan)
    check_rails(document, scenario, floor_plan)
    check_locations(document, scenario, floor_plan)
    check_gates(document, scenario, floor_plan)
    fleet = FleetOnFloor(scenario, floor_plan, start_of(document, scenario, floor_plan))
    check_starts(document, fleet)
    check_orders(document, scenario, floor)
    check_floor(floor, fleet)
    check_service(document, fleet)
    check_pod_ways(document, fleet)
    check_abilities(document, fleet)
    check_loaded_ways(document, fleet)
    check_energy(document, scenario, floor_plan)
    check_sight(document, scenario)
    return fleet


def check_areas(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Areas lie on the floor, and are closed to types that there are. Raises InputError."""
    names = [kind.name for kind in scenario.fleet.types]
    for area_name, area in scenario.areas.items():
        for key, (x, y) in (("from", area.first), ("to", area.last)):
            if not floor_plan.holds(x, y):
                text = f"the corner [{x}, {y}] of the area {area_name} lies outside the floor"
                raise document.error(("areas", area_name, key), f"{text} {floor_plan.extent}")
        for number, name in enumerate(area.closed_to):
            if name not in (*names, *GROUPS):
                known = (
                    f"fleet.types has {', '.join(names)}" if names else "there are no fleet.types"
                )
                known += f"; it may be closed to {', '.join(GROUPS)} as well"
                hint = nearest(name, [*names, *GROUPS])
                text = f"the area {area_name} is closed to '{name}'{hint}, but {known}"
                raise document.error(("areas", area_name, "closed_to", number), text)


def check_locations(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Named cells lie on the floor. Raises InputError."""
    assert not isinstance(scenario.locations, str), "its file has been read"
    for name, (x, y) in scenario.locations.items():
        if not floor_plan.holds(x, y):
            text = f"the location {name} [{x}, {y}] lies outside the floor {floor_plan.extent}"
            raise document.error(("locations", name), text)


def start_of(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> Start:
    """Where robots begin, defaults filled in and checked. Raises InputError."""
    fleet = scenario.fleet
    assert not isinstance(fleet.start, StartFile), "its file has been read"
    if isinstance(fleet.start, tuple):
        return _listed_start(document, fleet.start, fleet.robots, floor_plan)
    if fleet.start is None and floor_plan.starts:
        return _drawn_start(document, fleet.robots, floor_plan)
    start = fleet.start or ("parking-bays" if len(floor_plan.bays) else "random")
    if start == "parking-bays" and fleet.robots > len(floor_plan.bays):
        raise document.error(
            ROBOTS,
            f"{_robots(fleet.robots)} but the floor has "
            f"{_count(len(floor_plan.bays), 'parking bay')}",
        )
    cells = int(np.count_nonzero(floor_plan.drivable))
    if start == "random" and fleet.robots > cells:
        raise document.error(
            ROBOTS, f"{_robots(fleet.robots)} but robots can stand on {_count(cells, 'cell')}"
        )
    if start == "parking-bays" and fleet.when_idle == "leave":
        raise document.error(
            ("fleet", "when_idle"),
            "fleet.when_idle is leave, but robots that begin in parking bays park there",
        )
    if start == "racks":
        _check_stands(document, fleet.robots, floor_plan)
    return start


def _check_stands(document: Document, robots: int, floor_plan: FloorPlan) -> None:
    stands = np.unique(rack_stands(floor_plan))
    if not len(stands):
        raise document.error(
            START, "fleet.start is racks, but there is no rack that robots can stand in front of"
        )
    limited = (floor_plan.capacity.flat[stands] != UNLIMITED).any()
    if limited and robots > len(stands):
        room = f"in front of racks there is room for {len(stands)}"
        raise document.error(ROBOTS, f"{_robots(robots)} but {room}")


def _drawn_start(document: Document, robots: int, floor_plan: FloorPlan) -> Start:
    if robots != len(floor_plan.starts):
        x, y = floor_plan.xy(floor_plan.starts[-1])
        raise document.error(
            ROBOTS,
            f"{_robots(robots)} but the picture draws {len(floor_plan.starts)}, the last at [{x}, {y}]; "
            "change one of them, or set fleet.start",
        )
    return floor_plan.starts


def _listed_start(
    document: Document, cells: tuple[tuple[int, int], ...], robots: int, floor_plan: FloorPlan
) -> Start:
    if len(cells) != robots:
        raise document.error(
            START, f"{_robots(robots)} but fleet.start lists {_count(len(cells), 'cell')}"
        )
    taken: dict[int, int] = {}
    for robot, (x, y) in enumerate(cells):
        keys: Keys = (*START, robot)
        where = f"robot {robot} would start at [{x}, {y}]"
        if not floor_plan.holds(x, y):
            raise document.error(keys, f"{where}, outside the floor {floor_plan.extent}")
        cell = floor_plan.cell(x, y)
        if not DRIVABLE[floor_plan.kind.flat[cell]]:
            name = floor_plan.kind_of(cell).name
            raise document.error(keys, f"{where}, a {name}: robots do not drive there")
        if cell in taken and floor_plan.capacity.flat[cell] != UNLIMITED:
            raise document.error(keys, f"{where}, where robot {taken[cell]} starts already")
        taken[cell] = robot
    return tuple(floor_plan.cell(x, y) for x, y in cells)


def check_starts(document: Document, fleet: FleetOnFloor) -> None:
    """No robot begins where its type may not go. Raises InputError."""
    floor_plan, start, robots = fleet.floor_plan, fleet.start, len(fleet.type_of)
    try:
        if isinstance(start, tuple):
            check_starts_at_gates(fleet.scenario, floor_plan, list(start))
        if start == "racks":  # in front of one, there may be any number of robots
            stands = rack_stands(floor_plan).tolist()
            check_homes(fleet.scenario, floor_plan, stands, GATE_LIFT, GATE_BLOCK)
        elif start != "random":
            homes = np.concatenate(fleet.starts).tolist()
            check_homes(fleet.scenario, floor_plan, homes, GATE_LIFT)
    except InputError as error:
        raise document.error(START, error.message) from None
    if not isinstance(start, tuple):
        for robot_type, count, cells in zip(fleet.types, fleet.counts, fleet.starts, strict=True):
            many = start == "racks" and (floor_plan.capacity.flat[cells] == UNLIMITED).all()
            # Of random cells, others may have taken as many as there are others.
            needed = count if start == "parking-bays" else 1 if many else robots
            if len(cells) < needed:
                text = f"{_robots(robots)}, but too few {START_DESCRIPTIONS[start]} are open to"
                name = robot_type.name
                raise document.error(("fleet", "types"), f"{text} {name}: {len(cells)}")
        return
    for robot, (cell, number) in enumerate(zip(start, fleet.type_of, strict=True)):
        if fleet.closed[number, cell]:
            x, y = floor_plan.xy(cell)
            if floor_plan.kind.flat[cell] == STORAGE and not fleet.drives_under:
                text = f"robot {robot} would start at [{x}, {y}], in storage, where it bars pods"
                raise document.error(("fleet", "start", robot), f"{text} (pods.under: none)")
            robot_type = fleet.types[number]
            area = area_at(fleet.scenario, robot_type, x, y)
            text = (
                f"robot {robot} would start at [{x}, {y}], in the area {area}, which is closed to"
            )
            who = robot_type.name or "it"
            raise document.error(("fleet", "start", robot), f"{text} {who}")


def area_at(scenario: Scenario, robot_type: RobotType, x: int, y: int) -> str:
    """The area that keeps a type out of a cell."""
    for name, area in scenario.areas.items():
        if area.holds(x, y) and {robot_type.name, ALL, EMPTY} & set(area.closed_to):
            return name
    raise ValueError(f"({x}, {y}) is open to {robot_type.name}")


def check_parts(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Parts go through stations that there are, and work is done there. Raises InputError."""
    count = len(floor_plan.stations)
    if not count:
        raise document.error(("layout",), "parts need stations, and the floor has none")
    there = f"the floor has the stations 1 to {count}"
    for row, kind in enumerate(scenario.orders.parts or ()):
        for place, number in enumerate(kind.route):
            if number > count:
                keys: Keys = ("orders", "parts", row, "route", place)
                raise document.error(keys, f"a part goes to station {number}, but {there}")
    times = scenario.orders.processing_time
    if isinstance(times, tuple) and len(times) != count:
        text = f"orders.processing_time lists {_count(len(times), 'station')}, but {there}"
        raise document.error(("orders", "processing_time"), text)


def check_orders(document: Document, scenario: Scenario, floor: Floor) -> None:
    """Orders lead from slots that supply loads to slots that take them. Raises InputError."""
    generator = scenario.orders.generator
    if scenario.orders.parts is not None:
        check_parts(document, scenario, floor.floor_plan)
        return
    if scenario.orders.tasks is not None:
        check_tasks(document, scenario, floor.floor_plan)
        return
    check_pods(document, scenario, floor.floor_plan)
    if generator == "tours" or scenario.orders.lines is not None:
        return
    if scenario.orders.listed is None:
        for kind in REQUIRED_KINDS.get(generator or "", (SHELF, DESTINATION)):
            if not np.any(floor.floor_plan.kind == kind):
                name = CELL_KINDS[kind].name
                raise document.error(
                    ("layout",), f"the orders {generator} need a {name}, the floor has none"
                )
        if generator == "stations" and np.count_nonzero(floor.floor_plan.kind == STATION) < 2:
            raise document.error(
                ("layout",), "the orders stations lead from a station to another, there is only one"
            )
        return
    taken: dict[tuple[int, int], int] = {}
    begins: dict[tuple[int, int], bool] = {}  # by cell, whether several orders may begin there
    ends: set[tuple[int, int]] = set()
    for index, order in enumerate(scenario.orders.listed):
        if order.stops is not None:
            keys: Keys = ("orders", "list", index, "stops")
            check_stops(document, order.stop_cells, keys, floor.floor_plan)
    for index, order in transports_of(scenario, floor.floor_plan):
        keys = ("orders", "list", index)
        if order.target is None:
            text = f"the key 'to' is missing in {dotted(keys)}"
            hint = "only the order of a pod, from storage, may leave it out"
            raise document.error(keys, f"{text}; {hint}")
        source, target = order.ends
        if order.stops is not None and source == target:
            text = (
                "an order with from and to brings a load from one to the other; leave both out if "
                "a robot has only to come to its stops"
            )
            raise document.error(keys, text)
        if source not in begins or target not in ends or source == target:
            _check_order(document, order, keys, floor.floor_plan)
            slot_kind = floor.floor_plan.kind_of(floor.floor_plan.cell(*source))
            begins[source] = slot_kind.holds == ANY_LOADS
            ends.add(target)
        if begins[source]:
            continue
        if source in taken:
            x, y = source
            name = floor.floor_plan.kind_of(floor.floor_plan.cell(x, y)).name
            raise document.error(
                (*keys, "from"),
                f"order {index} takes the load of [{x}, {y}], as order {taken[source]} does; "
                f"a {name} holds one load",
            )
        taken[source] = index


def check_tasks(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """The cells of tasks are drivable, and the list does not become too long. Raises InputError."""
    keys: Keys = ("orders", "tasks")
    tasks = scenario.orders.tasks or ()
    for number, task in enumerate(tasks):
        check_stops(document, task, (*keys, number), floor_plan)
    count = order_count(scenario, floor_plan)
    if count > MAX_ORDERS:
        text = (
            f"in {ticks_and_time(scenario.stop.max_duration, unit(scenario.units.tick))} the robots "
            f"could do {count:,} tasks, more than a run holds ({MAX_ORDERS:,}); set a lower "
            "stop.max_duration"
        )
        raise document.error(("stop", "max_duration"), text)


def check_stops(
    document: Document, stops: Iterable[Any], keys: Keys, floor_plan: FloorPlan
) -> None:
    """The stops of an order are cells that robots drive on. Raises InputError."""
    for number, (x, y) in enumerate(stops):
        stop = f"{dotted((*keys, number))}: the stop [{x}, {y}]"
        if not floor_plan.holds(x, y):
            text = f"{stop} lies outside the floor {floor_plan.extent}"
            raise document.error((*keys, number), text)
        kind = floor_plan.kind.flat[floor_plan.cell(x, y)]
        if not DRIVABLE[kind]:
            text = f"{stop} is a {CELL_KINDS[kind].name}: robots do not drive there"
            raise document.error((*keys, number), text)


def _check_order(document: Document, order: OrderLine, keys: Keys, floor_plan: FloorPlan) -> None:
    source, target = order.ends
    for name, (x, y) in (("from", source), ("to", target)):
        if not floor_plan.holds(x, y):
            raise document.error(
                (*keys, name), f"[{x}, {y}] lies outside the floor {floor_plan.extent}"
            )
        kind = floor_plan.kind_of(floor_plan.cell(x, y))
        verb, allowed = ("begins", kind.gives) if name == "from" else ("ends", kind.takes)
        if not allowed:
            others = (k for k in CELL_KINDS if (k.gives if name == "from" else k.takes))
            names = alternatives(f"a {other.name}" for other in others)
            raise document.error(
                (*keys, name), f"an order {verb} at {names}; [{x}, {y}] is a {kind.name}"
            )
    visit = floor_plan.kind_of(floor_plan.cell(*source)).code == STATION
    if source == target and not visit:
        raise document.error((*keys, "to"), "an order ends where it begins")


def check_floor(floor: Floor, fleet: FleetOnFloor) -> None:
    """Every robot can serve every shelf and destination and come home again. Raises InputError.

    Slots of remote kinds may be out of reach: orders are given to the others alone.
    """
    floor_plan, kind = floor.floor_plan, floor.floor_plan.kind.reshape(-1)
    for slots, why in (
        (
            slots_beside(floor_plan, ~floor_plan.drivable.reshape(-1)),
            "has no cell beside it that robots drive on",
        ),
        (
            slots_beside(floor_plan, ~np.logical_or.reduce(fleet.within)),
            "cannot be served: a robot must get beside it from its start, and back",
        ),
    ):
        unserved = slots[~REMOTE[kind[slots]]].tolist()
        if unserved:
            x, y = floor_plan.xy(unserved[0])
            name = CELL_KINDS[kind[unserved[0]]].name
            why += closed_way(fleet, unserved[0])
            raise floor.error(f"the {name} at ({x}, {y}) {why}", y)
    for robot_type, cells, within in zip(fleet.types, fleet.starts, fleet.within, strict=True):
        apart = cells[~within[cells]]
        if apart.size:
            (x, y), (x0, y0) = floor_plan.xy(int(apart[0])), floor_plan.xy(int(cells[0]))
            who = f"robots ({robot_type.name})" if robot_type.name else "robots"
            raise floor.error(
                f"{who} start in parts of the floor that are not connected both ways: "
                f"({x0}, {y0}) and ({x}, {y})",
                y,
            )


def check_service(document: Document, fleet: FleetOnFloor) -> None:
    """Robots reach the docks and racks that orders name, and some of each. Raises InputError."""
    orders, floor_plan = fleet.scenario.orders, fleet.floor_plan
    served = np.logical_or.reduce(fleet.served)
    why = "a robot must get in front of it from its start, and back"
    kinds = floor_plan.kind.reshape(-1)[floor_plan.slots]
    for kind in REQUIRED_KINDS.get(orders.generator or "", ()):
        few = 2 if orders.generator == "stations" else 1
        if np.count_nonzero(served[kinds == kind]) < few:
            name = CELL_KINDS[kind].name
            found = f"no {name}" if few == 1 else f"fewer than two {name}s"
            raise document.error(("layout",), f"{found} can be served: {why}")

    if orders.generator == "tours" and np.count_nonzero(fleet.within.all(axis=0)) < 2:
        raise document.error(
            ("layout",), "the orders tours lead from cell to cell, and robots reach only one"
        )

    def because(cell: int) -> str:
        if fleet.service.accessible[:, fleet.slot_of[cell]].any():
            return "areas cut off robots with its load"
        return why + closed_way(fleet, cell)

    for number in sorted({number for kind in orders.parts or () for number in kind.route}):
        cell = int(floor_plan.stations[number - 1])
        if not served[fleet.slot_of[cell]]:
            raise document.error(("layout",), f"station {number} cannot be served: {because(cell)}")
    tasks: Sequence[Any] = orders.tasks or ()
    for number, task in enumerate(tasks):
        if all(fleet.within[:, floor_plan.cell(x, y)].all() for x, y in task):
            continue
        check_reached(document, fleet, task, 1, ("orders", "tasks", number))
    is_served: set[tuple[int, int]] = set()  # cells that have been looked at
    for index, order in enumerate(orders.listed or ()):
        if order.stops is not None:
            keys: Keys = ("orders", "list", index)
            check_reached(document, fleet, order.stop_cells, order.weight, keys, order.has_load)
        if order.target is None or is_served.issuperset(order.ends):
            continue
        for name, (x, y) in zip(("from", "to"), order.ends, strict=True):
            cell = floor_plan.cell(x, y)
            if not served[fleet.slot_of[cell]]:
                kind_name = floor_plan.kind_of(cell).name
                raise document.error(
                    ("orders", "list", index, name),
                    f"the {kind_name} at [{x}, {y}] cannot be served: {because(cell)}",
                )
        is_served.update(order.ends)


def check_reached(
    document: Document,
    fleet: FleetOnFloor,
    stops: Sequence[Any],
    weight: int,
    keys: Keys,
    has_load: bool = False,
) -> None:
    """Some type of robots gets to all stops of an order, and carries its weight. Raises InputError."""
    floor_plan = fleet.floor_plan
    carries = np.array([robot_type.payload >= weight for robot_type in fleet.types])
    if not carries.any():
        text = f"the order weighs {weight:,}, but no robot carries more than {fleet.payload:,}"
        raise document.error(keys, text)
    cells = [floor_plan.cell(x, y) for x, y in stops]
    reached_by = (fleet.loaded if has_load else fleet.within)[carries][:, cells]
    if reached_by.all(axis=1).any():
        return
    lost = int(np.argmin(reached_by.any(axis=0)))
    x, y = stops[lost]
    text = f"no robot that can do the order gets to its stop [{x}, {y}] from its start, and back"
    if reached_by.any(axis=0).all():
        text = "no type of robots gets to all stops of the order"
    of_stop: Keys = (*keys, lost) if keys[1] == "tasks" else (*keys, "stops", lost)
    raise document.error(of_stop, f"{dotted(of_stop)}: {text}")


def check_abilities(document: Document, fleet: FleetOnFloor) -> None:
    """Every order can be picked up by some robot, and delivered by some. Raises InputError."""
    impossible = fleet.impossible()
    if impossible is None:
        return
    (way, verb, cell), floor_plan, most = impossible, fleet.floor_plan, fleet.payload
    if not verb:
        text = f"{way.what} weighs {way.weight:,}, but no robot carries more than {most:,}"
        raise document.error(way.keys, text)
    x, y = floor_plan.xy(cell)
    weight = f", of weight {way.weight:,}," if most < RobotType().payload else ""
    name = floor_plan.kind_of(cell).name
    text = f"{way.what}{weight} {verb} at the {name} [{x}, {y}]"
    raise document.error(way.keys, f"{text}, where no robot that carries it may go")


def check_loaded_ways(document: Document, fleet: FleetOnFloor) -> None:
    """No area cuts robots off from where they are to bring their loads. Raises InputError."""
    parted = fleet.parted()
    if parted is None:
        return
    name, begin, end = parted
    (x, y), (u, v) = fleet.floor_plan.xy(begin), fleet.floor_plan.xy(end)
    who = f"robots of the type {name}" if name else "robots"
    raise document.error(
        ("areas",),
        f"{who} with a load do not get from [{x}, {y}] to [{u}, {v}]: areas are closed to them",
    )


def check_energy(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Batteries fit the fleet, and there is a charger if something charges. Raises InputError."""
    battery, robots = scenario.battery, scenario.fleet.robots
    charging = scenario.strategy.charging
    named = charging if isinstance(charging, str) else charging.get("name")
    if battery is None and named != NO_STRATEGY:
        raise document.error(
            ("strategy", "charging"),
            f"strategy.charging is {named}, but the scenario has no battery",
        )
    if named != NO_STRATEGY and not np.any(floor_plan.kind == CHARGER):
        raise document.error(
            ("layout",), f"strategy.charging is {named}, but the floor has no charger"
        )
    if (
        battery is not None
        and isinstance(battery.initial_charge, tuple)
        and len(battery.initial_charge) != robots
    ):
        raise document.error(
            ("battery", "start"),
            f"{_robots(robots)} but battery.initial_charge lists "
            f"{_count(len(battery.initial_charge), 'charge')}",
        )
    if battery is None and scenario.faults.charge != "kept":
        raise document.error(
            ("faults", "charge"),
            f"faults.charge is {scenario.faults.charge:g}, but the scenario has no battery",
        )
    for index, fault in enumerate(scenario.faults.listed):
        if fault.robot >= robots:
            raise document.error(
                ("faults", "list", index, "robot"),
                f"there is no robot {fault.robot}: {_robots(robots)}, counted from 0",
            )


def check_sight(document: Document, scenario: Scenario) -> None:
    """Robots that know the orders of zones alone have zones. Raises InputError."""
    zoning = scenario.strategy.zoning
    named = zoning if isinstance(zoning, str) else zoning.get("name")
    if getattr(scenario.information, "orders", "all") == "zones" and named == NO_STRATEGY:
        raise document.error(
            ("strategy", "zoning"),
            "strategy.zoning is none, but with information.orders zones robots know only the orders of "
            "their zones: no robot would ever receive one; set information.orders: all, or zoning: "
            "decentralized",
        )


def closed_way(fleet: FleetOnFloor, cell: int) -> str:
    """Which direction is closed on the way to a slot or back, and what would open it; "" if none is."""
    floor_plan, rail = fleet.floor_plan, fleet.types[0].rail
    homes = fleet.starts[0][:1].tolist()
    access = slot_access(floor_plan)[fleet.slot_of[cell]]
    beside = access[access != NIL].tolist()
    there = [c for c in beside if reached(floor_plan, homes, rail)[c]]
    found = (
        closed_step(floor_plan, there, homes) if there else closed_step(floor_plan, homes, beside)
    )
    if found is None:
        return ""
    a, b, direction = found
    against = floor_plan.exits.flat[b] == 1 << (direction ^ 2)  # its one way leads out towards a
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


def _robots(number: int) -> str:
    return f"fleet.robots is {number}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
