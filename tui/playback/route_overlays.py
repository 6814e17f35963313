"""What A* looks at, and where robots are going to drive: figures 3 and 4 of Bhattathiri, Li & Kuhl.

explored     1 in the cells that the search for the selected robot finds, 2 on the path it finds
predicted    how many robots besides the selected one are going to drive through each cell

A robot's predicted path is the rest of its route and, if it picks up an order with a target of its
own, the path of A* from there to where it sets its load
down. Both overlays ignore other robots and closed zones.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from automaton.engine.requests import first_cell
from automaton.engine.state import NIL, Array, World
from automaton.evidence.history.snapshot import OVERLAYS, Snapshot
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from strategies.routing.astar.astar import astar
from strategies.routing.astar.frontier import LARGER_G, OPEN_STAMP, TIES
from strategies.routing.astar.route_workspace import route_space
from strategies.routing.traffic_avoidance.predicted_paths import count_predicted

PAUSE_S: Final = 0.25  # between two computations while ticks go by
OVERLAY_TIME_RATIO: Final = 4  # at most a fourth of the time goes into them


class Overlays:
    """The overlays of one run; scratch is kept from picture to picture."""

    def __init__(self) -> None:
        self._of: tuple[Simulation, int, int, str] | None = None  # run, tick, robot and layer
        self._field: Array | None = None
        self._next = -math.inf  # when it may be computed again while ticks go by
        self._paths: Paths | None = None

    def laid_over(
        self, snapshot: Snapshot, simulation: Simulation, layer: str, playing: bool
    ) -> Snapshot:
        """The snapshot of this moment with the numbers of an overlay as its heat.

        While ticks go by they may be some tenths of a second old; otherwise they are of this tick.
        """
        if layer not in OVERLAYS:
            return snapshot
        now = (simulation, snapshot.tick, snapshot.selected, layer)
        began = time.monotonic()
        old = self._of is not None and self._of[2:] == now[2:] and began < self._next
        if self._of != now and not (playing and old):
            self._of, self._field = now, self._computed(simulation, snapshot.selected, layer)
            ended = time.monotonic()
            self._next = ended + max(PAUSE_S, OVERLAY_TIME_RATIO * (ended - began))
        return replace(snapshot, heat=self._field)

    def _computed(self, simulation: Simulation, selected: int, layer: str) -> Array:
        world, ties = simulation.world, ties_of(simulation.resolved.scenario)
        if self._paths is None or not self._paths.fit(world, ties):
            self._paths = Paths(world, ties)
        if layer == "explored":
            return explored(world, self._paths, selected)
        return predicted(world, self._paths, selected)


class Paths:
    """Paths of A* on the empty floor of a world."""

    def __init__(self, world: World, ties: int) -> None:
        grid = world.grid
        self._grid, self._duration, self._ties = grid, world.rules.duration, ties
        self._seed = world.rules.seed
        self._space = route_space(grid)
        longest = max(grid.cell_flags.size, world.robots.route.shape[1])
        self._steps = np.zeros(longest, np.uint8)
        self._seen = np.zeros(grid.cell_flags.size, np.int32)

    def fit(self, world: World, ties: int) -> bool:
        """Whether they are those of this world."""
        same = self._grid is world.grid and self._ties == ties
        same = same and self._seed == world.rules.seed  # random ties depend on it
        return same and np.array_equal(self._duration, world.rules.duration)

    def found(self, kind: int, pose: int, target: int) -> tuple[Array, Array]:
        """The cells that a search for a type's way from a pose to a cell finds, and those of its path."""
        workspace, headings = self._space, self._grid.headings
        path = self._search(kind, pose, target)
        poses = np.flatnonzero(workspace.label >> 32 == workspace.state[OPEN_STAMP])
        return np.unique(poses // headings), path

    def counted(self, world: World, besides: int) -> Array:
        """(C,) int32: robots that are going to drive through each cell, but for one."""
        field = np.zeros(self._grid.cell_flags.size, np.int32)
        scratch = (self._steps, self._seen)
        with np.errstate(over="ignore"):
            count_predicted(world.read_only(), self._space, self._ties, besides, *scratch, field)
        return field

    def _search(self, kind: int, pose: int, target: int) -> Array:
        """(k,) the cells of the path; without one, none."""
        grid, steps, duration = self._grid, self._steps, self._duration[kind]
        arguments = (self._space, self._ties, self._seed, pose, target, False, steps)
        length = astar(grid, kind, duration, *arguments)
        if length == NIL:
            return np.zeros(0, np.int64)
        return driven(grid.offset, pose // grid.headings, steps[:length])


def ties_of(scenario: Scenario) -> int:
    """The tie rule of the routing strategy if it has one, otherwise that of A* by default."""
    routing = scenario.strategy.routing
    name = routing.get("tie_break") if isinstance(routing, Mapping) else None
    return TIES.index(name) if name in TIES else LARGER_G


def driven(offset: Array, start: int, steps: Array) -> Array:
    """(k + 1,) the cells of k steps from a cell, which is the first one."""
    return np.concatenate(([start], start + np.cumsum(offset[steps])))


def explored(world: World, paths: Paths, robot: int) -> Array:
    """(C,) int32: 1 in cells found by the search from where a robot is to its goal cell, 2 on the
    path.

    All are 0 for a robot that is on no way, or for NIL.
    """
    field = np.zeros(world.grid.cell_flags.size, np.int32)
    robots = world.robots
    if not 0 <= robot < len(robots.cell):
        return field
    i = int(robots.at_index[robot])
    if robots.goal_cell[i] == NIL:
        return field
    pose = int(first_cell(world.robots, i)) * world.grid.headings + int(robots.heading[i])
    found, path = paths.found(int(robots.type[i]), pose, int(robots.goal_cell[i]))
    field[found] = 1
    field[path] = 2
    return field


def predicted(world: World, paths: Paths, besides: int) -> Array:
    """(C,) int32: how many robots on a way are going to drive through each cell, but for one."""
    return paths.counted(world, besides)
