"""Where robots are going to drive: the rest of their routes and of their tasks, as A* would drive it."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import GOAL_PICK, NIL
from automaton.strategy.kernels import (
    dropoff_cell,
    first_cell,
    heading_towards,
    next_stop_cell,
    with_load,
)
from strategies.routing.astar.astar import astar


@kernel
def count_predicted(view, workspace, ties, besides, steps, visible_world, field):
    """field: (C,) int32, how many robots on a way are going to drive through each cell.

    `besides`: the identity of a robot that does not count. A robot's way is the rest of its route,
    or the path to its goal cell, and the path from there to where it drops what it picks up.
    `workspace`,
    `steps` (L,) uint8 and `seen` (C,) int32 are scratch.
    """
    robots, headings = view.robots, view.grid.headings
    field[:] = 0
    visible_world[:] = 0
    for i in range(robots.cell.shape[0]):
        goal_cell = np.int64(robots.goal_cell[i])
        if goal_cell == NIL or robots.identity[i] == besides:
            continue
        cell, heading = first_cell(robots, i), np.int64(robots.heading[i])
        route_index, end = np.int64(robots.route_index[i]), np.int64(robots.route_length[i])
        if route_index < end:
            length = end - route_index
            for s in range(length):
                steps[s] = robots.route[i, route_index + s]
            follow(view.grid, cell, steps, length, i + 1, visible_world, field)
        else:
            pose, robot_type = cell * headings + heading, np.int64(robots.type[i])
            length = follow_path(
                view, workspace, ties, i, robot_type, pose, goal_cell, steps, visible_world, field
            )
        if length > 0:
            heading = heading_towards(view.grid, robots.type[i], np.int64(steps[length - 1]))
        beyond = next_goal_cell(view, i)
        if beyond != NIL:
            pose = goal_cell * headings + heading
            robot_type = with_load(view, np.int64(robots.type[i]))
            follow_path(
                view, workspace, ties, i, robot_type, pose, beyond, steps, visible_world, field
            )


@kernel
def next_goal_cell(view, i):
    """Where robot i will drop what it drives to pick up, or carry a pod first; NIL if it does not."""
    order = np.int64(view.robots.order[i])
    if order == NIL or view.robots.goal_type[i] != GOAL_PICK:
        return np.int64(NIL)
    if view.trips.pod.shape[0] > 0:
        return next_stop_cell(view, order)
    target, pick = np.int64(view.orders.target[order]), np.int64(view.robots.goal_cell[i])
    return dropoff_cell(view, view.robots.type[i], target, pick)


@kernel
def follow_path(view, workspace, ties, i, robot_type, pose, target, steps, visible_world, field):
    """Count the cells of robot i's path of A* from a pose to a cell, as one of a type; its length.

    NIL: none.
    """
    rules = view.rules
    duration = rules.duration[robot_type]
    length = astar(
        view.grid, robot_type, duration, workspace, ties, rules.seed, pose, target, False, steps
    )
    if length != NIL:
        follow(view.grid, pose // view.grid.headings, steps, length, i + 1, visible_world, field)
    return length


@kernel
def follow(grid, cell, steps, length, mark, visible_world, field):
    """Count a cell, and those of so many steps from it, unless this robot's mark is on them."""
    for s in range(length + 1):
        if visible_world[cell] != mark:
            visible_world[cell] = mark
            field[cell] += 1
        if s < length:
            cell += grid.offset[steps[s]]
