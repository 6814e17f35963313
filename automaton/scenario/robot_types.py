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

ANY_WEIGHT = 2**31 - 1  # payload of a robot that carries everything

Rectangle = tuple[int, int, int, int]  # x and y of two opposite corners, both inside
Mask = npt.NDArray[np.bool_]


class RobotType(NamedTuple):
    """What the robots of a type have in common."""

    name: str = ""
    move_time_factor: int = 1  # a move takes so many times its duration
    payload: int = ANY_WEIGHT  # the heaviest order it carries
    closed: tuple[Rectangle, ...] = ()  # areas that it must not enter
    durations: Durations = Durations()  # its own where it has some; a move without the factor
    closed_empty: tuple[Rectangle, ...] = ()  # further areas, without a load
    closed_loaded: tuple[Rectangle, ...] = ()  # further areas, with a load
    battery: Battery | None = None
    kinematics: Kinematics = "differential"

    @property
    def headings(self) -> int:
        """How many headings these robots distinguish."""
        return HEADING_COUNTS[self.kinematics]

    @property
    def rail(self) -> bool:
        """Whether these robots turn on turntables alone."""
        return self.kinematics == "rail"

    @property
    def turns(self) -> ByLoad:
        """Ticks of a turn by 90 degrees; an omni robot turns in none."""
        return ByLoad(0, 0) if self.kinematics == "omni" else self.durations.turns

    @property
    def moves(self) -> ByLoad:
        """Ticks of a move, the factor included."""
        empty, loaded = self.durations.moves
        return ByLoad(empty * self.move_time_factor, loaded * self.move_time_factor)

    @property
    def loads_differ(self) -> bool:
        """Whether robots of this type drive otherwise with a load than without one."""
        return (
            self.durations.moves.differ
            or self.turns.differ
            or self.closed_empty != self.closed_loaded
        )

    @property
    def driving(self) -> RobotType:
        """The type with what decides on how its robots drive, and nothing else."""
        durations = Durations(move=self.durations.move, turn=self.durations.turn)
        return self._replace(name="", payload=ANY_WEIGHT, durations=durations, battery=None)

    def carrying(self, loaded: bool) -> RobotType:
        """The type while its robots carry a load, or none: then alone these areas are closed."""
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
    """The areas that are closed to one of some names."""
    return tuple(
        (*area.first, *area.last)
        for area in scenario.areas.values()
        if any(name in area.closed_to for name in names)
    )


def rows_of(types: tuple[RobotType, ...], loads_differ: bool) -> tuple[RobotType, ...]:
    """The types without a load; where loads make a difference, then those with one."""
    rows = tuple(one.carrying(False) for one in types)
    return rows + tuple(one.carrying(True) for one in types) if loads_differ else rows


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


def follows_in_convoy(scenario: Scenario) -> bool:
    """Whether robots follow each other in moves of several ticks.

    Where all moves take one tick, a convoy is the same as handing cells over.
    """
    floor, rules = scenario.floor, scenario.world
    is_quick = all(ticks == 1 for one in types_of(scenario) for ticks in one.moves)
    may_slow = rules.slowdown != "none" or rules.extra_tick_probability > 0
    takes_time = not is_quick or may_slow or bool(floor.speed_limits or floor.lifts)
    return rules.following == "convoy" and takes_time
