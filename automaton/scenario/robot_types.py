"""Types of robots: how fast they are, what they carry, and which areas of the floor are closed to them.

Robots have their types by identity, in the order in which the scenario lists them. A scenario that
lists none has one type, to which nothing is closed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

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


def type_of_each(fleet: Fleet) -> npt.NDArray[np.uint8]:
    """(n,) the type of each robot, by identity."""
    if not fleet.types:
        return np.zeros(fleet.robots, np.uint8)
    return np.repeat(np.arange(len(fleet.types), dtype=np.uint8), fleet.counts)


class FloorByType(NamedTuple):
    """A floor as robots of each type may drive on it."""

    closed: Mask  # (K, C) the cells that are closed to type k
    floor_plans: tuple[FloorPlan, ...]  # (K,) with the exits that robots of type k may take


@lru_cache(maxsize=64)
def floor_by_type(floor_plan: FloorPlan, types: tuple[RobotType, ...]) -> FloorByType:
    """The floor for each of some types. Equal floors and types give the same object."""
    areas = np.zeros((len(types), floor_plan.height + 2, floor_plan.width + 2), np.bool_)
    for mask, robot_type in zip(areas, types, strict=True):
        for x0, y0, x1, y1 in robot_type.closed:
            rows = slice(min(y0, y1) + 1, max(y0, y1) + 2)
            mask[rows, min(x0, x1) + 1 : max(x0, x1) + 2] = True
    areas.setflags(write=False)
    closed = areas.reshape(len(types), -1)
    floor_plans = tuple(
        floor_plan.with_exits(_open_exits(floor_plan, mask)) if mask.any() else floor_plan
        for mask in closed
    )
    return FloorByType(closed, floor_plans)


def _open_exits(floor_plan: FloorPlan, closed: Mask) -> npt.NDArray[np.uint8]:
    """(height + 2, width + 2) the exits that lead neither into nor out of a closed cell."""
    exits = np.where(closed, 0, floor_plan.exits.reshape(-1)).astype(np.uint8)
    for direction, offset in enumerate(floor_plan.offsets):
        # np.roll wraps round, but only through the border, which has no exits.
        exits[np.roll(closed, -offset)] &= np.uint8(15 ^ (1 << direction))
    return exits.reshape(floor_plan.exits.shape)
