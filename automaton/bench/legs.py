"""Plans made one after the other inside compiled code, so that calls from Python do not count."""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.routes.astar import astar, search, write_steps
from automaton.kernels.routes.avoidance import LEAST_TIME, PLAIN, choose_threshold, close_zones
from automaton.kernels.routes.forecast import foresee_one
from automaton.kernels.routes.frontier import LARGER_G
from automaton.kernels.routes.presence import forget
from automaton.kernels.routes.timed import find_in_time
from automaton.world.route_space import RouteSpace
from automaton.world.state import NIL, Array, Grid, Memory, Workspace, World

MOST = 6  # the largest A


@kernel
def plan_legs(
    grid: Grid, duration: Array, space: RouteSpace, ties: int, tasks: Array, steps: Array
) -> None:
    """Plan both legs of each task, (n, 3) int32, by plain A*."""
    seed = np.uint64(1)
    for number in range(tasks.shape[0]):
        for leg in range(2):
            start, target = np.int64(tasks[number, leg]), np.int64(tasks[number, leg + 1])
            astar(grid, 0, duration, space, ties, seed, start, target, False, steps)


@kernel
def plan_avoiding(
    grid: Grid, duration: Array, space: RouteSpace, tasks: Array, foreseen: Array, steps: Array
) -> None:
    """Plan both legs of robot 0 of each task, (n, r, 3) int32, with others foreseen, (n, Z) int32."""
    seed = np.uint64(1)
    for number in range(tasks.shape[0]):
        for zone in range(space.count.shape[0]):
            space.count[zone] = foreseen[number, zone]
        start, pick, drop = tasks[number, 0, 0], tasks[number, 0, 1], tasks[number, 0, 2]
        threshold = choose_threshold(
            grid, 0, duration, space, LARGER_G, seed, start, pick, drop, MOST, LEAST_TIME
        )
        close_zones(grid, space, threshold, start, pick, drop)
        pose = np.int64(start)
        for target in (pick, drop):
            pose = search(
                grid, 0, duration, space, LARGER_G, seed, pose, target, threshold != PLAIN
            )
            if pose != NIL:
                write_steps(grid, space, pose, steps)


@kernel
def plan_in_time(view: World, space: Workspace, memory: Memory, beta: int) -> None:
    """Plan the way of every robot to its stand anew, each seeing the plans of those before it."""
    for i in range(view.robots.cell.shape[0]):
        if view.robots.stand[i] != NIL:
            forget(memory, i)
            length = find_in_time(view, space, memory, beta, i, False, space.steps)
            foresee_one(view, space, memory, i, space.steps, length)
