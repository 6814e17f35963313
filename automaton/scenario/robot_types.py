"""Types of robots: how fast they are, what they carry, and which areas of the floor are closed to them.

Robots have their types by identity, in the order in which the scenario lists them. A scenario that
lists none has one type, to which nothing is closed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.schema import Fleet, Scenario

ANY_WEIGHT = 2**31 - 1  # payload of a robot that carries everything

Rectangle = tuple[int, int, int, int]  # x and y of two opposite corners, both inside
Mask = npt.NDArray[np.bool_]


class RobotType(NamedTuple):
    """What the robots of a type have in common."""

    name: str = ""
    move_time_factor: int = 1  # a move takes so many times its duration
    payload: int = ANY_WEIGHT  # the heaviest order it carries
    closed: tuple[Rectangle, ...] = ()  # areas that it must not enter


def types_of(scenario: Scenario) -> tuple[RobotType, ...]:
    """The types of a scenario's robots, at least one."""
    return tuple(
        RobotType(
            kind.name,
            kind.move_time_factor,
            ANY_WEIGHT if kind.payload is None else kind.payload,
            tuple(
                (*area.first, *area.last)
                for area in scenario.areas.values()
                if kind.name in area.closed_to
            ),
        )
        for kind in scenario.fleet.types
    ) or (RobotType(),)


def least_move(scenario: Scenario) -> int:
    """Ticks that a move takes the fastest robots."""
    return scenario.durations.move * min(
        robot_type.move_time_factor for robot_type in types_of(scenario)
    )


def type_of_each(fleet: Fleet) -> npt.NDArray[np.uint8]:
    """(n,) the type of each robot, by identity."""
    if not fleet.types:
        return np.zeros(fleet.robots, np.uint8)
    return np.repeat(np.arange(len(fleet.types), dtype=np.uint8), fleet.counts)


@lru_cache(maxsize=64)
def closed_cells(floor_plan: FloorPlan, robot_type: RobotType) -> Mask:
    """(C,) the cells that are closed to a type."""
    mask = np.zeros((floor_plan.height + 2, floor_plan.width + 2), np.bool_)
    for x0, y0, x1, y1 in robot_type.closed:
        rows = slice(min(y0, y1) + 1, max(y0, y1) + 2)
        mask[rows, min(x0, x1) + 1 : max(x0, x1) + 2] = True
    mask.setflags(write=False)
    return mask.reshape(-1)


@lru_cache(maxsize=64)
def open_exits(floor_plan: FloorPlan, robot_type: RobotType) -> npt.NDArray[np.uint8]:
    """(height + 2, width + 2) the exits open to a type: none leads into or out of a closed cell."""
    closed = closed_cells(floor_plan, robot_type)
    exits = np.where(closed, 0, floor_plan.exits.reshape(-1)).astype(np.uint8)
    for direction, offset in enumerate((1, floor_plan.stride, -1, -floor_plan.stride)):
        # np.roll wraps round, but only through the border, which has no exits.
        exits[np.roll(closed, -offset)] &= np.uint8(15 ^ (1 << direction))
    exits.setflags(write=False)
    return exits.reshape(floor_plan.exits.shape)


def floor_plan_for(floor_plan: FloorPlan, robot_type: RobotType) -> FloorPlan:
    """The floor with the exits that robots of a type may take."""
    return (
        floor_plan.with_exits(open_exits(floor_plan, robot_type))
        if robot_type.closed
        else floor_plan
    )


def first_open(
    cells: npt.NDArray[Any], scenario: Scenario, floor_plan: FloorPlan
) -> list[npt.NDArray[np.intp]]:
    """For each type the numbers of the first cells that are open to it, one for each of its robots.

    One type after another takes its cells; fewer where they do not suffice.
    """
    if not scenario.fleet.types:
        return [np.arange(min(len(cells), scenario.fleet.robots))]
    free = np.ones(len(cells), np.bool_)
    chosen = []
    for robot_type, count in zip(types_of(scenario), scenario.fleet.counts, strict=True):
        chosen.append(np.flatnonzero(free & ~closed_cells(floor_plan, robot_type)[cells])[:count])
        free[chosen[-1]] = False
    return chosen
