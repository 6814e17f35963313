"""Plans made one after another inside compiled code, to exclude calls from Python."""

from __future__ import annotations

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL, Array, Grid, Workspace, World
from strategies.routing.astar import LARGER_G, RouteSpace, astar, search, write_steps
from strategies.routing.congestion import time_dependent_path
from strategies.routing.forecasts import CongestionState, forecast_one, forget
from strategies.routing.traffic_avoidance import (
    LEAST_TIME,
    PLAIN_ASTAR,
    choose_threshold,
    close_zones,
)

MOST = 6  # the largest A


FEWEST = 1  # others that close a zone, where A = 1


@kernel
def plan_legs(
    grid: Grid, duration: Array, workspace: RouteSpace, ties: int, tasks: Array, steps: Array
) -> None:
    """Plan both legs of each task, (n, 3) int32, by plain A*."""
    seed = np.uint64(1)
    for number in range(tasks.shape[0]):
        for leg in range(2):
            start, target = np.int64(tasks[number, leg]), np.int64(tasks[number, leg + 1])
            astar(grid, 0, duration, workspace, ties, seed, start, target, False, steps)


@kernel
def plan_avoiding(
    grid: Grid, duration: Array, workspace: RouteSpace, tasks: Array, foreseen: Array, steps: Array
) -> None:
    """Plan both legs of robot 0 of each task, (n, r, 3) int32, with predicted occupancy by others,
    (n, Z) int32."""
    seed = np.uint64(1)
    for number in range(tasks.shape[0]):
        for zone in range(workspace.count.shape[0]):
            workspace.count[zone] = foreseen[number, zone]
        start, pick, drop = tasks[number, 0, 0], tasks[number, 0, 1], tasks[number, 0, 2]
        threshold = choose_threshold(
            grid,
            0,
            duration,
            workspace,
            LARGER_G,
            seed,
            start,
            pick,
            drop,
            MOST,
            FEWEST,
            LEAST_TIME,
        )
        close_zones(grid, workspace, threshold, start, pick, drop)
        pose = np.int64(start)
        for target in (pick, drop):
            pose = search(
                grid, 0, duration, workspace, LARGER_G, seed, pose, target, threshold != PLAIN_ASTAR
            )
            if pose != NIL:
                write_steps(grid, workspace, pose, steps)


@kernel
def plan_in_time(view: World, workspace: Workspace, state: CongestionState) -> None:
    """Replan the route of every robot to its goal cell; each sees the plans of earlier robots."""
    for i in range(view.robots.cell.shape[0]):
        if view.robots.goal_cell[i] != NIL:
            forget(state, i)
            length = time_dependent_path(view, workspace, state, i, False, workspace.steps)
            forecast_one(view, workspace, state, i, workspace.steps, length)
