"""The paths for the A* layers, computed with Numba.

explored     1 in cells explored by the search for the selected robot, 2 on the resulting path
predicted    by cell, the number of robots that will drive through it, without the selected one

A robot's predicted path is the rest of its route and, if it is picking up an order with a known
target, the A* path from there to the place where it sets its load down. Both ignore other robots and
closed zones.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from automaton.engine.operations import first_cell
from automaton.engine.state import NIL, Array, World
from automaton.scenario.schema import Scenario
from strategies.routing.astar import LARGER_G, TIES, astar, route_space
from strategies.routing.predicted_paths import count_predicted


class Paths:
    """A* paths on the empty floor of a world."""

    def __init__(self, world: World, ties: int) -> None:
        grid = world.grid
        self._grid, self._duration, self._ties = grid, world.rules.duration, ties
        self._seed = world.rules.seed
        self._space = route_space(grid)
        longest = max(grid.cell_flags.size, world.robots.route.shape[1])
        self._steps = np.zeros(longest, np.uint8)
        self._seen = np.zeros(grid.cell_flags.size, np.int32)

    def fit(self, world: World, ties: int) -> bool:
        """Whether these paths belong to this world and tie rule."""
        same = self._grid is world.grid and self._ties == ties
        same = same and self._seed == world.rules.seed  # random ties depend on it
        return same and np.array_equal(self._duration, world.rules.duration)

    def found(self, kind: int, pose: int, target: int) -> tuple[Array, Array]:
        """Search a path for a robot type from a pose to a cell: the explored cells, and the path."""
        workspace, headings = self._space, self._grid.headings
        path = self._search(kind, pose, target)
        poses = np.flatnonzero(workspace.label >> 32 == workspace.state.stamp)
        return np.unique(poses // headings), path

    def counted(self, world: World, besides: int) -> Array:
        """(C,) int32: number of robots, except `besides`, that will drive through each cell."""
        field = np.zeros(self._grid.cell_flags.size, np.int32)
        scratch = (self._steps, self._seen)
        with np.errstate(over="ignore"):
            count_predicted(world.read_only(), self._space, self._ties, besides, *scratch, field)
        return field

    def _search(self, kind: int, pose: int, target: int) -> Array:
        """(k,) the cells of the path; () without a path."""
        grid, steps, duration = self._grid, self._steps, self._duration[kind]
        arguments = (self._space, self._ties, self._seed, pose, target, False, steps)
        length = astar(grid, kind, duration, *arguments)
        if length == NIL:
            return np.zeros(0, np.int64)
        return driven(grid.offset, pose // grid.headings, steps[:length])


def ties_of(scenario: Scenario) -> int:
    """The tie rule of the routing strategy, by default LARGER_G."""
    routing = scenario.strategy.routing
    name = routing.get("tie_break") if isinstance(routing, Mapping) else None
    return TIES.index(name) if name in TIES else LARGER_G


def driven(offset: Array, start: int, steps: Array) -> Array:
    """(k + 1,) the cells visited by k steps from a cell, including this cell."""
    return np.concatenate(([start], start + np.cumsum(offset[steps])))


def explored(world: World, paths: Paths, robot: int) -> Array:
    """(C,) int32: 1 in cells explored from a robot's cell to its goal cell, 2 on the path.

    All are 0 for a robot without a goal, or for NIL.
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
