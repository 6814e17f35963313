"""Shortest paths for strategies written in Python; compiled ones call automaton.engine.search.

All costs are ticks on poses (cell, heading), including turns; ties are broken by rule.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from automaton.engine import search
from automaton.engine.distance_tables import UNREACHABLE as UNREACHABLE
from automaton.engine.operations import with_load
from automaton.engine.state import NIL, Array, Workspace, World
from automaton.strategy import placing as slot_access


def position(view: World, robot: int) -> int:
    """The cell from which a robot (storage index) drives on.

    In a long move this is the cell that it enters; in a parking bay, the home cell through which it
    leaves.
    """
    robots = view.robots
    cell, claim = int(robots.cell[robot]), int(robots.claim[robot])
    if claim != NIL:
        return claim
    return int(robots.home[robot]) if cell == NIL else cell


def _checked(view: World, cell: int) -> int:
    """Check a cell named by a user's code, since compiled searches do not check indices."""
    if not 0 <= cell < view.grid.cell_flags.shape[0]:
        raise IndexError(
            f"cell {cell} is outside the grid of {view.grid.cell_flags.shape[0]} cells"
        )
    return int(cell)


def distance(view: World, workspace: Workspace, robot: int, target: int) -> int:
    """Ticks from a robot's pose to a target cell on the empty floor, or UNREACHABLE."""
    heading = int(view.robots.heading[robot])
    cell = position(view, robot)
    robot_type = int(view.robots.type[robot])
    return int(search.distance(view, workspace, robot_type, cell, heading, _checked(view, target)))


def distances(view: World, workspace: Workspace, robots: Any, cells: Any) -> Array:
    """Ticks as `distance` gives them, of many robots to many cells in one call.

    `robots` and `cells` are broadcast as in NumPy: two lists of k are k pairs, and `robots[:, None]`
    with `cells` gives a row for each robot. Order both so that pairs with one cell follow each other
    if there are more cells than room for distance tables.
    """
    pairs = np.broadcast_arrays(np.asarray(robots, np.int64), np.asarray(cells, np.int64))
    who, to = (np.ascontiguousarray(each).reshape(-1) for each in pairs)
    for numbers, size, name in (
        (who, len(view.robots.cell), "robot"),
        (to, len(view.grid.cell_flags), "cell"),
    ):
        wrong = np.flatnonzero((numbers < 0) | (numbers >= size))
        if len(wrong):
            raise IndexError(f"there is no {name} {numbers[wrong[0]]}: the last one is {size - 1}")
    out = np.empty(len(who), np.int64)
    search.distances(view, workspace, who, to, out)
    return out.reshape(pairs[0].shape)


def pickup_cell(view: World, robot: int, slot: int) -> int | None:
    """The cell from which a robot picks up a load, by the scenario's `world.access_cell`, or None."""
    robot_type, here = int(view.robots.type[robot]), position(view, robot)
    cell = int(slot_access.pickup_cell(view, robot_type, int(slot), here))
    return None if cell == NIL else cell


def dropoff_cell(view: World, robot: int, slot: int) -> int | None:
    """The cell from which a robot drops its load, by the scenario's `world.access_cell`, or None."""
    robot_type, here = int(view.robots.type[robot]), position(view, robot)
    cell = int(slot_access.dropoff_cell(view, robot_type, int(slot), here))
    return None if cell == NIL else cell


def access_cells(view: World, robot: int, slot: int) -> list[int]:
    """The cells from which a robot can serve a slot: its east, south, west and north neighbours."""
    reachable = view.slots.reachable[with_load(view, int(view.robots.type[robot]))]
    return [int(cell) for cell in view.slots.access[slot] if cell != NIL and reachable[cell]]


def nearest(
    view: World, workspace: Workspace, robot: int, cells: Iterable[int], around: bool = False
) -> int | None:
    """The index of the cell of least path cost from a robot; ties to the lowest index.

    `around`: exclude cells that have no room now. None if no cell is reachable.
    """
    mark = search.begin_search(workspace)
    for index, cell in enumerate(cells):
        search.mark_goal(workspace, mark, _checked(view, cell), index)
    robot_type, heading = np.int64(view.robots.type[robot]), np.int64(view.robots.heading[robot])
    found = search.nearest_mark(
        view, workspace, mark, robot_type, position(view, robot), heading, around
    )
    return None if found == NIL else int(found)


def route(
    view: World, workspace: Workspace, robot: int, target: int, around: bool = False
) -> list[int] | None:
    """Directions of the shortest path from a robot to a target cell, or None."""
    steps = np.empty(workspace.steps.shape, np.uint8)
    heading = int(view.robots.heading[robot])
    cell = position(view, robot)
    target = _checked(view, target)
    robot_type = int(view.robots.type[robot])
    way = int(around)
    length = search.find_path(view, workspace, robot_type, cell, heading, target, way, steps)
    return None if length == NIL else [int(step) for step in steps[:length]]
