"""What robots of several types can do: areas and starts that fit them, orders that one of them does.

Of each order it is known where it begins and ends and how heavy it is; a type does it if it carries
the weight and gets to both ends, and back. Orders that are drawn count as all that could be drawn.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.engine.state import NIL
from automaton.errors import nearest
from automaton.floor.cells import CELL_KINDS, UNLIMITED
from automaton.floor.floor_plan import DRIVABLE, FloorPlan
from automaton.floor.reachability import around_home, rack_stands, slot_access
from automaton.scenario.document import Document, Keys
from automaton.scenario.orders import ENDS
from automaton.scenario.robot_types import (
    RobotType,
    closed_cells,
    first_open,
    floor_plan_for,
    type_of_each,
    types_of,
)
from automaton.scenario.schema import Scenario

Start = str | tuple[int, ...]
Mask = npt.NDArray[np.bool_]

START_DESCRIPTIONS = {
    "parking-bays": "parking bays",
    "racks": "cells in front of racks",
    "random": "cells",
}  # by start


def check_areas(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Areas lie on the floor, and are closed to types that there are. Raises InputError."""
    names = [kind.name for kind in scenario.fleet.types]
    for area, given in scenario.areas.items():
        for key, (x, y) in (("from", given.first), ("to", given.last)):
            if not floor_plan.holds(x, y):
                extent = f"(x 0..{floor_plan.width - 1}, y 0..{floor_plan.height - 1})"
                text = f"the corner [{x}, {y}] of the area {area} lies outside the floor {extent}"
                raise document.error(("areas", area, key), text)
        for number, name in enumerate(given.closed_to):
            if name not in names:
                known = (
                    f"fleet.types has {', '.join(names)}" if names else "there are no fleet.types"
                )
                text = f"the area {area} is closed to '{name}'{nearest(name, names)}, but {known}"
                raise document.error(("areas", area, "closed_to", number), text)


def check_starts(
    document: Document, scenario: Scenario, floor_plan: FloorPlan, start: Start
) -> None:
    """No robot begins where its type may not go. Raises InputError."""
    each, types = type_of_each(scenario.fleet), types_of(scenario)
    if not isinstance(start, tuple):
        counts = np.bincount(each)
        for number, cells in enumerate(starts_by_type(scenario, floor_plan, start)):
            many = start == "racks" and (floor_plan.capacity.flat[cells] == UNLIMITED).all()
            # Of cells drawn at random others may have taken as many as there are others.
            needed = counts[number] if start == "parking-bays" else 1 if many else len(each)
            if len(cells) < needed:
                text = f"fleet.robots is {len(each)}, but too few {START_DESCRIPTIONS[start]} are open to"
                name = types[number].name
                raise document.error(("fleet", "types"), f"{text} {name}: {len(cells)}")
        return
    for robot, cell in enumerate(start):
        robot_type = types[each[robot]]
        if closed_cells(floor_plan, robot_type)[cell]:
            x, y = floor_plan.xy(cell)
            area = area_at(scenario, robot_type, x, y)
            text = (
                f"robot {robot} would start at [{x}, {y}], in the area {area}, which is closed to"
            )
            raise document.error(("fleet", "start", robot), f"{text} {robot_type.name}")


def area_at(scenario: Scenario, robot_type: RobotType, x: int, y: int) -> str:
    """The area that keeps a type out of a cell."""
    for name, area in scenario.areas.items():
        columns, rows = sorted((area.first[0], area.last[0])), sorted((area.first[1], area.last[1]))
        inside = columns[0] <= x <= columns[1] and rows[0] <= y <= rows[1]
        if inside and robot_type.name in area.closed_to:
            return name
    raise ValueError(f"({x}, {y}) is open to {robot_type.name}")


def starts_by_type(
    scenario: Scenario, floor_plan: FloorPlan, start: Start
) -> list[npt.NDArray[np.int64]]:
    """For each type the cells where its robots may begin."""
    each, types = type_of_each(scenario.fleet), types_of(scenario)
    if isinstance(start, tuple):
        cells = np.array(start, np.int64)
        return [cells[each == number] for number in range(len(types))]
    if start == "parking-bays":
        homes = floor_plan.bays[:, 1].astype(np.int64)
        chosen = first_open(homes, scenario, floor_plan)
        return [homes[numbers] for numbers in chosen]
    cells = np.flatnonzero(DRIVABLE[floor_plan.kind.reshape(-1)])
    if start == "racks":
        cells = np.unique(rack_stands(floor_plan)).astype(np.int64)
    return [cells[~closed_cells(floor_plan, robot_type)[cells]] for robot_type in types]


def within_by_type(scenario: Scenario, floor_plan: FloorPlan, start: Start) -> list[Mask]:
    """For each type (C,) bool: the cells that its robots get to from where they begin, and back."""
    rail = scenario.fleet.kinematics == "rail"
    pairs = zip(types_of(scenario), starts_by_type(scenario, floor_plan, start), strict=True)
    return [
        around_home(floor_plan_for(floor_plan, robot_type), int(cells[0]), rail)
        for robot_type, cells in pairs
    ]


class Way(NamedTuple):
    """Orders that lead from some slots to some slots."""

    keys: Keys
    what: str  # as errors call them
    source: npt.NDArray[np.int64]  # flat cells
    target: npt.NDArray[np.int64]
    weight: int  # of the heaviest
    stays: bool = False  # each ends where it begins: a visit


def ways(scenario: Scenario, floor_plan: FloorPlan, served: Mask) -> Iterator[Way]:
    """All orders of a scenario. `served`: (s,) slots that robots of some type get to."""
    orders, slots = scenario.orders, floor_plan.slots().astype(np.int64)
    for index, line in enumerate(orders.listed or ()):
        source, target = (np.array([floor_plan.cell(*end)]) for end in (line.source, line.target))
        yield Way(("orders", "list", index), f"order {index}", source, target, line.weight)
    stations = floor_plan.stations().astype(np.int64)
    for row, parts in enumerate(orders.parts or ()):
        name = parts.name or f"parts {row + 1}"
        for here, then in itertools.pairwise(parts.route):
            what = f"the way of {name} from station {here} to {then}"
            source, target = stations[[here - 1]], stations[[then - 1]]
            yield Way(("orders", "parts", row), what, source, target, parts.weight)
    if orders.generator is not None:
        kinds = floor_plan.kind.reshape(-1)[slots]
        begin, end = (slots[(kinds == kind) & served] for kind in ENDS[orders.generator])
        if orders.generator == "picture-loads":
            begin = begin[floor_plan.loads.reshape(-1)[begin] == 1]
        weight = orders.weight if isinstance(orders.weight, int) else orders.weight.most
        keys: Keys = ("orders", "generator")
        yield Way(keys, "an order", begin, end, weight, orders.generator == "visits")


def abilities(way: Way, floor_plan: FloorPlan, types: tuple[RobotType, ...], served: Mask) -> Any:
    """(2, K, most ends) bool: whether a type can begin an order at each source, and end it."""
    number = {cell: slot for slot, cell in enumerate(floor_plan.slots().tolist())}
    carries = np.array([robot_type.payload >= way.weight for robot_type in types])
    found = []
    for cells in (way.source, way.target):
        rows = [number[cell] for cell in cells.tolist()]
        found.append(served[:, rows] & carries[:, None])
    return found


def served_by_type(scenario: Scenario, floor_plan: FloorPlan, start: Start) -> Mask:
    """(K, s) bool: the slots that robots of each type get to from where they begin, and back."""
    access = slot_access(floor_plan)
    masks = within_by_type(scenario, floor_plan, start)
    return np.stack([((access != NIL) & within[access]).any(axis=1) for within in masks])


def check_abilities(
    document: Document, scenario: Scenario, floor_plan: FloorPlan, start: Start
) -> None:
    """Every order can be picked up by some robot, and delivered by some. Raises InputError."""
    types, served = types_of(scenario), served_by_type(scenario, floor_plan, start)
    most = max(robot_type.payload for robot_type in types)
    for way in ways(scenario, floor_plan, np.logical_or.reduce(served)):
        if way.weight > most:
            text = f"{way.what} weighs {way.weight:,}, but no robot carries more than {most:,}"
            raise document.error(way.keys, text)
        for verb, cells, able in zip(
            ("begins", "ends"),
            (way.source, way.target),
            abilities(way, floor_plan, types, served),
            strict=True,
        ):
            lost = np.flatnonzero(~able.any(axis=0))
            if lost.size:
                cell = int(cells[lost[0]])
                x, y = floor_plan.xy(cell)
                weight = f", of weight {way.weight:,}," if most < RobotType().payload else ""
                name = CELL_KINDS[floor_plan.kind.flat[cell]].name
                text = f"{way.what}{weight} {verb} at the {name} [{x}, {y}]"
                raise document.error(way.keys, f"{text}, where no robot that carries it may go")


def handed_over(scenario: Scenario, floor_plan: FloorPlan, start: Start) -> str:
    """A sentence on the first order that no type of robot carries all the way; "" if there is none."""
    types, served = types_of(scenario), served_by_type(scenario, floor_plan, start)
    if len(types) == 1:
        return ""
    for way in ways(scenario, floor_plan, np.logical_or.reduce(served)):
        begins, ends = abilities(way, floor_plan, types, served)
        together = begins.astype(int).T @ ends.astype(int)
        lost = np.argwhere(together == 0)
        if lost.size and not way.stays:
            (x, y), (u, v) = (
                floor_plan.xy(way.source[lost[0][0]]),
                floor_plan.xy(way.target[lost[0][1]]),
            )
            return (
                f"{way.what} from [{x}, {y}] to [{u}, {v}] is carried all the way by no type of "
                "robot; only zoning hands orders over from one type to another"
            )
    return ""
