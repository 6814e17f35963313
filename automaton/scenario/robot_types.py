"""Types of robots: their speed, their payload, and the areas of the floor that are closed to them.

Types are assigned by robot identity, in the order in which the scenario lists them. A scenario without
types has one type, to which no area is closed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.durations import ByLoad, Durations
from automaton.scenario.fleet import (
    ALL,
    EMPTY,
    HEADING_COUNTS,
    LOADED,
    FleetType,
    Kinematics,
)
from automaton.scenario.schema import Battery, Fleet, Scenario

ANY_WEIGHT = 2**31 - 1  # payload of a robot without a limit

Rectangle = tuple[int, int, int, int]  # x and y of two opposite corners, both inside
Mask = npt.NDArray[np.bool_]


class RobotType(NamedTuple):
    """The common properties of the robots of a type."""

    name: str = ""
    move_time_factor: int = 1  # factor on the duration of a move
    payload: int = ANY_WEIGHT  # heaviest order that it carries
    closed: tuple[Rectangle, ...] = ()  # areas that it must not enter
    durations: Durations = Durations()  # of the type or of the fleet; moves without the factor
    closed_empty: tuple[Rectangle, ...] = ()  # further areas closed without a load
    closed_loaded: tuple[Rectangle, ...] = ()  # further areas closed with a load
    battery: Battery | None = None
    kinematics: Kinematics = "differential"

    @property
    def headings(self) -> int:
        """The number of headings that these robots distinguish."""
        return HEADING_COUNTS[self.kinematics]

    @property
    def rail(self) -> bool:
        """Whether these robots turn only on turntables."""
        return self.kinematics == "rail"

    @property
    def turns(self) -> ByLoad:
        """Ticks of a turn by 90 degrees; 0 for omni robots."""
        return ByLoad(0, 0) if self.kinematics == "omni" else self.durations.turns

    @property
    def moves(self) -> ByLoad:
        """Ticks of a move, the factor included."""
        empty, loaded = self.durations.moves
        return ByLoad(empty * self.move_time_factor, loaded * self.move_time_factor)

    @property
    def loads_differ(self) -> bool:
        """Whether robots of this type drive differently with a load."""
        return (
            self.durations.moves.differ
            or self.turns.differ
            or self.closed_empty != self.closed_loaded
        )

    @property
    def driving(self) -> RobotType:
        """The type reduced to the properties that determine how its robots drive."""
        durations = Durations(move=self.durations.move, turn=self.durations.turn)
        return self._replace(name="", payload=ANY_WEIGHT, durations=durations, battery=None)

    def carrying(self, loaded: bool) -> RobotType:
        """The type with the areas that are closed with a load, or without one."""
        own = self.closed_loaded if loaded else self.closed_empty
        return self._replace(closed=(*self.closed, *own), closed_empty=(), closed_loaded=())


def types_of(scenario: Scenario) -> tuple[RobotType, ...]:
    """The types of a scenario's robots, at least one."""
    kinds = scenario.fleet.types or (FleetType(name=""),)
    return tuple(
        RobotType(
            kind.name,
            kind.move_time_factor,
            ANY_WEIGHT if kind.payload is None else kind.payload,
            _closed_to(scenario, kind.name, ALL),
            kind.durations.within(scenario.durations),
            _closed_to(scenario, EMPTY),
            _closed_to(scenario, LOADED),
            None if scenario.battery is None else kind.battery.within(scenario.battery),
            scenario.fleet.kinematics_of(kind),
        )
        for kind in kinds
    )


def _closed_to(scenario: Scenario, *names: str) -> tuple[Rectangle, ...]:
    """The areas that are closed to any of some names."""
    return tuple(
        (*area.first, *area.last)
        for area in scenario.areas.values()
        if any(name in area.closed_to for name in names)
    )


def rows_of(types: tuple[RobotType, ...], loads_differ: bool) -> tuple[RobotType, ...]:
    """The types without a load; if a load changes how they drive, then the types with one."""
    rows = tuple(one.carrying(False) for one in types)
    return rows + tuple(one.carrying(True) for one in types) if loads_differ else rows


def type_of_each(fleet: Fleet) -> npt.NDArray[np.uint8]:
    """(n,) the type of each robot, by identity."""
    if not fleet.types:
        return np.zeros(fleet.robots, np.uint8)
    return np.repeat(np.arange(len(fleet.types), dtype=np.uint8), fleet.counts)


class FloorByType(NamedTuple):
    """A floor with the cells and exits that are open to each type."""

    closed: Mask  # (K, C) cells closed to type k
    floor_plans: tuple[FloorPlan, ...]  # (K,) the floor with the exits open to type k


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
    """(height + 2, width + 2) the exits that do not lead into or out of a closed cell."""
    exits = np.where(closed, 0, floor_plan.exits.reshape(-1)).astype(np.uint8)
    for direction, offset in enumerate(floor_plan.offsets):
        # np.roll wraps around only through the border, which has no exits.
        exits[np.roll(closed, -offset)] &= np.uint8(15 ^ (1 << direction))
    return exits.reshape(floor_plan.exits.shape)


def follows_in_convoy(scenario: Scenario) -> bool:
    """Whether robots follow each other in moves of several ticks.

    If all moves take one tick, convoy equals handover.
    """
    floor, rules = scenario.floor, scenario.world
    is_quick = all(ticks == 1 for one in types_of(scenario) for ticks in one.moves)
    may_slow = rules.slowdown != "none" or rules.extra_tick_probability > 0
    takes_time = not is_quick or may_slow or bool(floor.speed_limits or floor.lifts)
    return rules.following == "convoy" and takes_time
