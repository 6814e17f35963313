"""One moment of a run for drawings: places, looks and loads, from the state."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import (
    Looks,
    RobotLooks,
    box_of,
    cell_of,
    looks_of,
    place_labels,
    robot_looks,
)
from automaton.engine.state import GATE_CLOSING, GATE_DOOR, NIL
from automaton.floor.floor_plan import UNBOUNDED, FloorPlan
from automaton.vocabulary import STATE_WORDS, robot_states
from automaton.world.resolved import Resolved

Cells = NDArray[np.int32]  # flat indices

FROM_ROBOTS: Final = (
    *("cell", "claim", "bay", "load", "parked", "heading", "travel", "status"),
    *("charge", "goal_type", "goal_cell", "action", "type", "ticket"),
)
# With the values for runs without observation.
FROM_OBSERVATION: Final = {
    "cause": 0,
    "blocker": NIL,
    "wanted": NIL,
    "wait_cycle_ticks": 0,
    "since": 0,
}


@dataclass(frozen=True, eq=False)
class DrawnFloor:
    """The constants of a run."""

    floor_plan: FloorPlan
    headings: tuple[int, ...]  # number of headings by type: 1, 2 (axes) or 4
    battery: bool  # robots run on batteries
    may_be_down: bool  # robots may break down
    place_names: dict[int, str]  # such as "door 1", by flat cell
    levels: tuple[tuple[str, int], ...]  # names of levels, and their first cells

    @cached_property
    def looks(self) -> Looks:
        """(height + 2, width + 2), see looks_of."""
        return looks_of(self.floor_plan)

    @cached_property
    def box(self) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of the drawing, see box_of."""
        return box_of(self.floor_plan)

    @cached_property
    def places(self) -> dict[int, tuple[str, list[str]]]:
        """Kinds and short names by cell, see place_labels."""
        return place_labels(self.place_names, self.floor_plan.stride)

    @cached_property
    def bounded(self) -> NDArray[np.bool_]:
        """(C,) cells whose loads are drawn; others hold any number of loads, or none."""
        bounded: NDArray[np.bool_] = ~UNBOUNDED[self.floor_plan.kind.reshape(-1)]
        return bounded


def drawn_floor(resolved: Resolved) -> DrawnFloor:
    """The floor of a scenario."""
    scenario = resolved.scenario
    faults = bool(scenario.faults.listed or scenario.faults.probability)
    headings = tuple(one.headings for one in resolved.fleet.types)
    with_battery, names = scenario.battery is not None, resolved.place_names
    return DrawnFloor(
        resolved.floor_plan, headings, with_battery, faults, names, resolved.level_corners
    )


@dataclass(frozen=True, eq=False)
class Moment:
    """The state after a tick or between two ticks, by robot identity."""

    tick: int
    x: NDArray[np.float64]  # (n,) left edge of the robot, in cells from the left; NaN: off
    y: NDArray[np.float64]
    looks: RobotLooks
    doing: NDArray[np.int32]  # (n,) a RobotState
    cause: NDArray[np.int32]  # (n,) CAUSE_*; 0: not waiting, or no observation
    blocker: NDArray[np.int32]  # (n,) the blocking robot, or NIL
    full: Cells  # (k,) cells with a load or a pod
    shut: Cells  # (k,) closed cells, and cells of shut doors

    def word_of(self, robot: int) -> str:
        """A robot's activity in words."""
        return STATE_WORDS[int(self.doing[robot])]


def fleet_of(world: Any, observation: Any) -> Any:
    """Copies of the drawn fields of robots, (n,) arrays by identity, and `doing`."""
    by_identity = world.robots.at_index
    fields = {name: getattr(world.robots, name)[by_identity] for name in FROM_ROBOTS}
    for name, unknown in FROM_OBSERVATION.items():
        values = getattr(observation, name)
        observed = len(values) == len(by_identity)
        fields[name] = values[by_identity] if observed else np.full(len(by_identity), unknown)
    fleet = SimpleNamespace(**fields)
    fleet.doing = robot_states(fleet).astype(np.int32)
    return fleet


def looks_of_fleet(fleet: Any, floor: DrawnFloor) -> RobotLooks:
    """The looks of the robots of `fleet_of`."""
    return robot_looks(fleet, floor.headings, floor.battery, floor.may_be_down)


def moment_of(floor: DrawnFloor, world: Any, observation: Any) -> Moment:
    """A moment of a run."""
    fleet = fleet_of(world, observation)
    shown = full_cells(world, floor), shut_cells(world)
    return moment_of_fleet(floor, fleet, int(world.clock.tick), *shown)


def moment_of_fleet(floor: DrawnFloor, fleet: Any, tick: int, full: Cells, shut: Cells) -> Moment:
    """A moment from the fields of robots, by identity, with the cells of loads and closed cells.

    A robot in a move of several ticks is drawn between its two cells. A fleet without `doing` gets
    no words.
    """
    cell = cell_of(fleet)
    ahead = np.where((fleet.claim == NIL) | (cell == NIL), cell, fleet.claim)
    stride = floor.floor_plan.stride
    x, y = (cell % stride + ahead % stride) / 2, (cell // stride + ahead // stride) / 2
    off = cell == NIL
    return Moment(
        tick=tick,
        x=np.where(off, np.nan, x - 1),
        y=np.where(off, np.nan, y - 1),
        looks=looks_of_fleet(fleet, floor),
        doing=getattr(fleet, "doing", np.zeros(0, np.int32)),
        cause=np.asarray(fleet.cause, np.int32),
        blocker=np.asarray(fleet.blocker, np.int32),
        full=full,
        shut=shut,
    )


def empty_moment() -> Moment:
    """A floor without robots and loads."""
    none, cells = np.zeros(0), np.zeros(0, np.int32)
    looks = RobotLooks(*(np.zeros(0, np.uint8) for _ in RobotLooks._fields))
    return Moment(0, none, none, looks, cells, cells, cells, cells, cells)


def full_cells(world: Any, floor: DrawnFloor) -> Cells:
    """(k,) cells with a load or pod: slots for one load, and loads left on the floor."""
    slots = world.slots
    cells = slots.cell[(slots.content != NIL) & (slots.cell != NIL)]
    full: Cells = np.unique(cells[floor.bounded[cells]]).astype(np.int32)
    return full


def shut_cells(world: Any) -> Cells:
    """(k,) cells that no robot may enter now: closed cells, and cells of shut doors."""
    gates, tick = world.gates, int(world.clock.tick)
    if not len(gates.kind):
        return np.zeros(0, np.int32)
    shut = (gates.kind == GATE_DOOR) & (gates.open_from > tick)
    row = gates.first_closing[:-1] + gates.closing
    for gate in np.flatnonzero((gates.kind == GATE_CLOSING) & (row < gates.first_closing[1:])):
        first, end = gates.closings[row[gate]].tolist()
        shut[gate] = first <= tick < end
    entries = np.flatnonzero(shut[gates.cell_gate])
    cells = np.searchsorted(gates.cell_first, entries, side="right") - 1
    return np.unique(cells).astype(np.int32)
