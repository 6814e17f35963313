"""Whether a scenario fits its floor: areas, starts and batteries; other modules check orders and pods."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from automaton.engine.state import GATE_BLOCK, GATE_LIFT
from automaton.errors import Finding, InputError, Keys, nearest, refuse
from automaton.floor.floor_plan import (
    CELL_KINDS,
    CHARGER,
    DRIVABLE,
    STORAGE,
    TRACK,
    TURNTABLE,
    UNLIMITED,
    FloorPlan,
)
from automaton.floor.reachability import (
    rack_stands,
)
from automaton.scenario.fleet import ALL, EMPTY, GROUPS, FleetType, StartFile
from automaton.scenario.floor_section import Floor
from automaton.scenario.robot_types import RobotType
from automaton.scenario.schema import Fleet, Scenario
from automaton.world.capabilities import FleetOnFloor, Start
from automaton.world.gate_cells import check_gates, check_homes, check_starts_at_gates
from automaton.world.order_feasibility import (
    check_abilities,
    check_floor,
    check_loaded_ways,
    check_orders,
    check_service,
)
from automaton.world.pod_feasibility import check_pod_ways, check_pods

NO_STRATEGY = "none"
ROBOTS_KEY: Keys = ("fleet", "robots")
START_KEY: Keys = ("fleet", "start")
START_DESCRIPTIONS = {
    "parking-bays": "parking bays",
    "racks": "cells in front of racks",
    "random": "cells",
}  # by fleet.start


def feasible_fleet(
    scenario: Scenario, floor: Floor, pods_are_of_file: bool = False
) -> FleetOnFloor:
    """The fleet on its floor. Raises InvalidValueError if the scenario does not fit the floor."""
    floor_plan = floor.floor_plan
    refuse(
        itertools.chain(
            check_areas(scenario, floor_plan),
            check_rails(scenario, floor_plan),
            check_locations(scenario, floor_plan),
            check_gates(scenario, floor_plan),
            check_start(scenario, floor_plan),
        )
    )
    fleet = FleetOnFloor(scenario, floor_plan, start_of(scenario, floor_plan))
    refuse(
        itertools.chain(
            check_starts(fleet),
            check_pods(scenario, floor_plan, pods_are_of_file),
            check_orders(scenario, floor_plan),
            check_floor(floor, fleet),
            check_service(fleet),
            check_pod_ways(fleet),
            check_abilities(fleet),
            check_loaded_ways(fleet),
            check_energy(scenario, floor_plan),
            check_sight(scenario),
            check_sizes(scenario),
        )
    )
    return fleet


def check_areas(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """Areas lie on the floor and are closed to existing types."""
    names = [kind.name for kind in scenario.fleet.types]
    for area_name, area in scenario.areas.items():
        for key, (x, y) in (("from", area.first), ("to", area.last)):
            if not floor_plan.holds(x, y):
                text = f"the corner [{x}, {y}] of the area {area_name} lies outside the floor"
                yield Finding(("areas", area_name, key), f"{text} {floor_plan.extent}")
        for number, name in enumerate(area.closed_to):
            if name not in (*names, *GROUPS):
                known = (
                    f"fleet.types has {', '.join(names)}" if names else "there are no fleet.types"
                )
                known += f"; it may be closed to {', '.join(GROUPS)} as well"
                hint = nearest(name, [*names, *GROUPS])
                text = f"the area {area_name} is closed to '{name}'{hint}, but {known}"
                yield Finding(("areas", area_name, "closed_to", number), text)


def check_locations(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """Named cells must lie on the floor."""
    assert not isinstance(scenario.locations, str), "its file has been read"
    for name, (x, y) in scenario.locations.items():
        if not floor_plan.holds(x, y):
            text = f"the location {name} [{x}, {y}] lies outside the floor {floor_plan.extent}"
            yield Finding(("locations", name), text)


def check_rails(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """If only some types drive on rails, the floor needs tracks and turntables."""
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
        yield Finding(
            ("fleet", "types", number),
            f"{fleet.types[number].name} drives on rails beside robots that do not, which takes tracks "
            f"and turntables, but the floor has no {' and no '.join(missing)}; draw them, or set "
            "kinematics of this type to differential or omni",
        )


def check_start(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """There are enough start cells for all robots."""
    fleet = scenario.fleet
    robots, start = fleet.robots, start_of(scenario, floor_plan)
    if isinstance(fleet.start, tuple):
        yield from check_listed_starts(fleet.start, robots, floor_plan)
    elif isinstance(start, tuple):
        if robots != len(start):
            x, y = floor_plan.xy(start[-1])
            text = f"{_robots(robots)} but the picture draws {len(start)}, the last at [{x}, {y}]; "
            yield Finding(ROBOTS_KEY, f"{text}change one of them, or set fleet.start")
    elif start == "parking-bays":
        bays = len(floor_plan.bays)
        if robots > bays:
            text = f"{_robots(robots)} but the floor has {_count(bays, 'parking bay')}"
            yield Finding(ROBOTS_KEY, text)
        if fleet.when_idle == "leave":
            text = "fleet.when_idle is leave, but robots that begin in parking bays park there"
            yield Finding(("fleet", "when_idle"), text)
    elif start == "random":
        cells = int(np.count_nonzero(floor_plan.drivable))
        if robots > cells:
            text = f"{_robots(robots)} but robots can stand on {_count(cells, 'cell')}"
            yield Finding(ROBOTS_KEY, text)
    else:
        yield from check_stands(robots, floor_plan)


def start_of(scenario: Scenario, floor_plan: FloorPlan) -> Start:
    """The start of the robots, with defaults filled in."""
    start = scenario.fleet.start
    assert not isinstance(start, StartFile), "its file has been read"
    if isinstance(start, tuple):
        return tuple(floor_plan.cell(x, y) for x, y in start)
    if start is None and floor_plan.starts:
        return floor_plan.starts
    return start or ("parking-bays" if len(floor_plan.bays) else "random")


def check_listed_starts(
    cells: tuple[tuple[int, int], ...], robots: int, floor_plan: FloorPlan
) -> Iterator[Finding]:
    """Listed start cells are different drivable cells, one for each robot."""
    if len(cells) != robots:
        text = f"{_robots(robots)} but fleet.start lists {_count(len(cells), 'cell')}"
        yield Finding(START_KEY, text)
    taken: dict[int, int] = {}
    for robot, (x, y) in enumerate(cells):
        keys: Keys = (*START_KEY, robot)
        where = f"robot {robot} would start at [{x}, {y}]"
        if not floor_plan.holds(x, y):
            yield Finding(keys, f"{where}, outside the floor {floor_plan.extent}")
            continue
        cell = floor_plan.cell(x, y)
        if not DRIVABLE[floor_plan.kind.flat[cell]]:
            name = floor_plan.kind_of(cell).name
            yield Finding(keys, f"{where}, a {name}: robots do not drive there")
        if cell in taken and floor_plan.capacity.flat[cell] != UNLIMITED:
            yield Finding(keys, f"{where}, where robot {taken[cell]} starts already")
        taken[cell] = robot


def check_stands(robots: int, floor_plan: FloorPlan) -> Iterator[Finding]:
    """There are enough cells in front of racks for all robots."""
    stands = np.unique(rack_stands(floor_plan))
    if not len(stands):
        text = "fleet.start is racks, but robots cannot stand in front of any rack"
        yield Finding(START_KEY, text)
    limited = (floor_plan.capacity.flat[stands] != UNLIMITED).any()
    if limited and robots > len(stands):
        room = f"in front of racks there is room for {len(stands)}"
        yield Finding(ROBOTS_KEY, f"{_robots(robots)} but {room}")


def check_starts(fleet: FleetOnFloor) -> Iterator[Finding]:
    """No robot begins in an area that is closed to its type."""
    floor_plan, start, robots = fleet.floor_plan, fleet.start, len(fleet.type_of)
    try:
        if isinstance(start, tuple):
            check_starts_at_gates(fleet.scenario, floor_plan, list(start))
        if start == "racks":  # any number of robots may stand in front of a rack
            stands = rack_stands(floor_plan).tolist()
            check_homes(fleet.scenario, floor_plan, stands, GATE_LIFT, GATE_BLOCK)
        elif start != "random":
            homes = np.concatenate(fleet.starts).tolist()
            check_homes(fleet.scenario, floor_plan, homes, GATE_LIFT)
    except InputError as error:
        yield Finding(START_KEY, error.message)
    if not isinstance(start, tuple):
        for robot_type, count, cells in zip(fleet.types, fleet.counts, fleet.starts, strict=True):
            many = start == "racks" and (floor_plan.capacity.flat[cells] == UNLIMITED).all()
            # Each other robot may have taken one of the random cells.
            needed = count if start == "parking-bays" else 1 if many else robots
            if len(cells) < needed:
                text = f"{_robots(robots)}, but too few {START_DESCRIPTIONS[start]} are open to"
                name = robot_type.name
                yield Finding(("fleet", "types"), f"{text} {name}: {len(cells)}")
        return
    for robot, (cell, number) in enumerate(zip(start, fleet.type_of, strict=True)):
        if fleet.closed[number, cell]:
            x, y = floor_plan.xy(cell)
            if floor_plan.kind.flat[cell] == STORAGE and not fleet.drives_under:
                text = f"robot {robot} would start at [{x}, {y}], in storage, where it blocks pods"
                yield Finding((*START_KEY, robot), f"{text} (pods.under: none)")
                continue
            robot_type = fleet.types[number]
            area = area_at(fleet.scenario, robot_type, x, y)
            text = (
                f"robot {robot} would start at [{x}, {y}], in the area {area}, which is closed to"
            )
            who = robot_type.name or "it"
            yield Finding((*START_KEY, robot), f"{text} {who}")


def area_at(scenario: Scenario, robot_type: RobotType, x: int, y: int) -> str:
    """The area that closes a cell to a type."""
    for name, area in scenario.areas.items():
        if area.holds(x, y) and {robot_type.name, ALL, EMPTY} & set(area.closed_to):
            return name
    raise ValueError(f"({x}, {y}) is open to {robot_type.name}")


def check_energy(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """Batteries fit the fleet, and a charging strategy has a charger."""
    battery, robots = scenario.battery, scenario.fleet.robots
    charging = scenario.strategy.charging
    named = charging if isinstance(charging, str) else charging.get("name")
    if battery is None and named != NO_STRATEGY:
        text = f"strategy.charging is {named}, but the scenario has no battery"
        yield Finding(("strategy", "charging"), text)
    if named != NO_STRATEGY and not np.any(floor_plan.kind == CHARGER):
        text = f"strategy.charging is {named}, but the floor has no charger"
        yield Finding(("layout",), text)
    charges = None if battery is None else battery.initial_charge
    if isinstance(charges, tuple) and len(charges) != robots:
        text = f"battery.initial_charge lists {_count(len(charges), 'charge')}"
        yield Finding(("battery", "start"), f"{_robots(robots)} but {text}")
    if battery is None and scenario.faults.charge != "kept":
        text = f"faults.charge is {scenario.faults.charge:g}, but the scenario has no battery"
        yield Finding(("faults", "charge"), text)
    for index, fault in enumerate(scenario.faults.listed):
        if fault.robot >= robots:
            text = f"there is no robot {fault.robot}: {_robots(robots)}, counted from 0"
            yield Finding(("faults", "list", index, "robot"), text)


def check_sight(scenario: Scenario) -> Iterator[Finding]:
    """Robots that know only the orders of their zones need zones."""
    zoning = scenario.strategy.zoning
    named = zoning if isinstance(zoning, str) else zoning.get("name")
    if getattr(scenario.information, "orders", "all") == "zones" and named == NO_STRATEGY:
        yield Finding(
            ("strategy", "zoning"),
            "strategy.zoning is none, but information.orders is zones: robots know only the orders of "
            "their zones, so no robot would receive one; set information.orders: all, or zoning: "
            "decentralized",
        )


def check_sizes(scenario: Scenario) -> Iterator[Finding]:
    """Sizes of robots need a cell with a length: a robot takes one cell."""
    parts: list[tuple[Keys, Fleet | FleetType]] = [(("fleet",), scenario.fleet)]
    parts += [(("fleet", "types", n), kind) for n, kind in enumerate(scenario.fleet.types)]
    for keys, part in parts:
        for side in ("length", "width"):
            if getattr(part, side) is None:
                continue
            try:
                _ = scenario.units.scale.cell_metres
            except InputError as error:
                yield Finding((*keys, side), f"to compare it with a cell, {error.message}")


def _robots(number: int) -> str:
    return f"fleet.robots is {number}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
