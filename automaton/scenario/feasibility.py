"""What only the floor can tell: whether robots fit, and loads can be reached and delivered."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np

from automaton.scenario.document import Document, Keys
from automaton.scenario.floors import Floor
from automaton.scenario.schema import OrderLine, Scenario
from automaton.world.cells import DESTINATION, KINDS, SHELF, UNLIMITED
from automaton.world.plan import DRIVABLE, FloorPlan
from automaton.world.reach import around_home, slots_out_of_reach, slots_without_access

Start = Literal["bays", "random"] | tuple[int, ...]

ROBOTS: Keys = ("fleet", "robots")
START: Keys = ("fleet", "start")


def start_of(document: Document, scenario: Scenario, plan: FloorPlan) -> Start:
    """Where robots begin, defaults filled in and checked. Raises InputError."""
    fleet = scenario.fleet
    if isinstance(fleet.start, tuple):
        return _listed_start(document, fleet.start, fleet.robots, plan)
    if fleet.start is None and plan.starts:
        return _drawn_start(document, fleet.robots, plan)
    start = fleet.start or ("bays" if len(plan.bays) else "random")
    if start == "bays" and fleet.robots > len(plan.bays):
        raise document.error(
            ROBOTS, f"{_robots(fleet.robots)} but the floor has {_count(len(plan.bays), 'bay')}"
        )
    cells = int(np.count_nonzero(plan.drivable()))
    if start == "random" and fleet.robots > cells:
        raise document.error(
            ROBOTS, f"{_robots(fleet.robots)} but robots can stand on {_count(cells, 'cell')}"
        )
    return start


def _drawn_start(document: Document, robots: int, plan: FloorPlan) -> Start:
    if robots != len(plan.starts):
        raise document.error(
            ROBOTS,
            f"{_robots(robots)} but the picture draws {len(plan.starts)}; "
            "change one of them, or say fleet.start",
        )
    return plan.starts


def _listed_start(
    document: Document, cells: tuple[tuple[int, int], ...], robots: int, plan: FloorPlan
) -> Start:
    if len(cells) != robots:
        raise document.error(
            START, f"{_robots(robots)} but fleet.start lists {_count(len(cells), 'cell')}"
        )
    taken: dict[int, int] = {}
    for robot, (x, y) in enumerate(cells):
        keys: Keys = (*START, robot)
        where = f"robot {robot} would start at [{x}, {y}]"
        if not plan.holds(x, y):
            raise document.error(keys, f"{where}, outside the floor {_extent(plan)}")
        cell = plan.cell(x, y)
        if not DRIVABLE[plan.kind.flat[cell]]:
            name = KINDS[plan.kind.flat[cell]].name
            raise document.error(keys, f"{where}, a {name}: robots do not drive there")
        if cell in taken and plan.capacity.flat[cell] != UNLIMITED:
            raise document.error(keys, f"{where}, where robot {taken[cell]} starts already")
        taken[cell] = robot
    return tuple(plan.cell(x, y) for x, y in cells)


def check_orders(document: Document, scenario: Scenario, floor: Floor) -> None:
    """Orders lead from shelves to slots. Raises InputError."""
    if scenario.orders.listed is None:
        for kind in (SHELF, DESTINATION):
            if not np.any(floor.plan.kind == kind):
                name = KINDS[kind].name
                raise document.error(
                    ("layout",), f"the orders full-shelves need a {name}, the floor has none"
                )
        return
    taken: dict[tuple[int, int], int] = {}
    for index, order in enumerate(scenario.orders.listed):
        keys: Keys = ("orders", "list", index)
        _check_order(document, order, keys, floor.plan)
        if order.source in taken:
            x, y = order.source
            raise document.error(
                (*keys, "from"),
                f"order {index} takes the load of [{x}, {y}], as order {taken[order.source]} does; "
                "a shelf holds one load",
            )
        taken[order.source] = index


def _check_order(document: Document, order: OrderLine, keys: Keys, plan: FloorPlan) -> None:
    for name, (x, y) in (("from", order.source), ("to", order.target)):
        if not plan.holds(x, y):
            raise document.error(
                (*keys, name), f"[{x}, {y}] lies outside the floor {_extent(plan)}"
            )
        kind = KINDS[plan.kind.flat[plan.cell(x, y)]]
        if name == "from" and kind.code != SHELF:
            raise document.error(
                (*keys, name), f"an order begins at a shelf; [{x}, {y}] is a {kind.name}"
            )
        if not kind.slot:
            raise document.error(
                (*keys, name),
                f"an order ends at a shelf or a destination; [{x}, {y}] is a {kind.name}",
            )
    if order.source == order.target:
        raise document.error((*keys, "to"), "an order ends where it begins")


def check_floor(scenario: Scenario, floor: Floor, start: Start) -> None:
    """Every robot can serve every slot and come home again. Raises InputError."""
    plan = floor.plan
    if start == "random":
        homes = tuple(np.flatnonzero(plan.drivable()).tolist())
    elif start == "bays":
        homes = tuple(plan.bays[: scenario.fleet.robots, 1].tolist())
    else:
        homes = start
    rail = scenario.fleet.kinematics == "rail"
    lonely, remote = _unserved(plan, homes[0], rail)
    for cell, why in (
        (lonely, "has no cell beside it that robots drive on"),
        (remote, "cannot be served: a robot must get beside it from its start, and back"),
    ):
        if cell is not None:
            x, y = plan.xy(cell)
            name = KINDS[plan.kind.flat[cell]].name
            raise floor.error(f"the {name} at ({x}, {y}) {why}", y)
    apart = np.array(homes)[~around_home(plan, homes[0], rail)[list(homes)]]
    if apart.size:
        (x, y), (x0, y0) = plan.xy(int(apart[0])), plan.xy(homes[0])
        raise floor.error(
            f"robots start in parts of the floor that are not connected both ways: "
            f"({x0}, {y0}) and ({x}, {y})",
            y,
        )


@lru_cache(maxsize=64)
def _unserved(plan: FloorPlan, home: int, rail: bool) -> tuple[int | None, int | None]:
    """The first slot that nothing drives beside, and the first that is out of reach."""
    lonely = slots_without_access(plan)
    remote = slots_out_of_reach(plan, home, rail)
    return (int(lonely[0]) if lonely.size else None, int(remote[0]) if remote.size else None)


def _robots(number: int) -> str:
    return f"fleet.robots is {number}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _extent(plan: FloorPlan) -> str:
    return f"(x 0..{plan.width - 1}, y 0..{plan.height - 1})"
