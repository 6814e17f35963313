"""Where robots are going to drive: the rest of their routes and of their tasks, as A* would drive it."""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.operations import first_cell
from automaton.kernels.routes.astar import astar
from automaton.kernels.stands import drop_stand
from automaton.world.state import GOAL_PICK, NIL


@kernel
def count_predicted(view, space, ties, besides, steps, seen, field):
    """field: (C,) int32, how many robots on a way are going to drive through each cell.

    `besides`: the identity of a robot that does not count. A robot's way is the rest of its route, or
    the path to its stand, and the path from there to where it sets down what it picks up. `space`,
    `steps` (L,) uint8 and `seen` (C,) int32 are scratch.
    """
    robots, headings = view.robots, view.grid.headings
    field[:] = 0
    seen[:] = 0
    for i in range(robots.cell.shape[0]):
        stand = np.int64(robots.stand[i])
        if stand == NIL or robots.identity[i] == besides:
            continue
        cell, heading = first_cell(robots, i), np.int64(robots.heading[i])
        at, end = np.int64(robots.at[i]), np.int64(robots.length[i])
        if at < end:
            length = end - at
            for s in range(length):
                steps[s] = robots.route[i, at + s]
            follow(view.grid, cell, steps, length, i + 1, seen, field)
        else:
            pose = cell * headings + heading
            length = follow_path(view, space, ties, i, pose, stand, steps, seen, field)
        if length > 0:
            heading = np.int64(steps[length - 1]) & (headings - 1)
        beyond = next_stand(view, i)
        if beyond != NIL:
            pose = stand * headings + heading
            follow_path(view, space, ties, i, pose, beyond, steps, seen, field)


@kernel
def next_stand(view, i):
    """Where robot i will set down what it drives to pick up; NIL if it does not."""
    order = np.int64(view.robots.order[i])
    if order == NIL or view.robots.goal[i] != GOAL_PICK:
        return np.int64(NIL)
    return drop_stand(view, view.robots.type[i], np.int64(view.orders.target[order]))


@kernel
def follow_path(view, space, ties, i, pose, target, steps, seen, field):
    """Count the cells of robot i's path of A* from a pose to a cell; its length, NIL: none."""
    rules, kind = view.rules, view.robots.type[i]
    duration = rules.duration[kind]
    length = astar(view.grid, kind, duration, space, ties, rules.seed, pose, target, False, steps)
    if length != NIL:
        follow(view.grid, pose // view.grid.headings, steps, length, i + 1, seen, field)
    return length


@kernel
def follow(grid, cell, steps, length, mark, seen, field):
    """Count a cell, and those of so many steps from it, unless this robot's mark is on them."""
    for s in range(length + 1):
        if seen[cell] != mark:
            seen[cell] = mark
            field[cell] += 1
        if s < length:
            cell += grid.offset[steps[s]]
