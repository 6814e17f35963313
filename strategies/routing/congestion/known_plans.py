"""What each robot is going to do, as far as it is known: its route, then the rest of its task.

A plan begins where the robot is free for its next step. It consists of directions, of the work at
the goal cell, and of the way with the load to the order's target, for which the path of plain A*
stands. Of a trip of a pod the way to its next stop is known, not how long its visit takes: there the
plan ends.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import GOAL_DROP, GOAL_NONE, GOAL_PICK, NIL
from automaton.strategy.kernels import (
    dropoff_cell,
    first_cell,
    heading_towards,
    next_stop_cell,
    with_load,
)
from strategies.routing.astar.astar import astar
from strategies.routing.astar.frontier import LARGER_G

PICKS = 4  # steps besides the four directions
DROPS = 5


@kernel
def zone_of(grid, cell, direction):
    """The zone of a robot in a cell that came or leaves in a direction."""
    return np.int64(grid.traffic_zone[cell, direction >> 1])


@kernel
def begin_plan(view, state, i):
    """Robot i has no plan; until it is free it counts where it stands, or whence it is coming."""
    robots = view.robots
    cell, claim = np.int64(robots.cell[i]), np.int64(robots.claim[i])
    travel, heading = np.int64(robots.travel[i]), np.int64(robots.heading[i])
    state.zone[i] = NIL if cell == NIL else zone_of(view.grid, cell, travel)
    if cell == NIL:
        travel = heading  # as if it had come along its heading
    if claim != NIL and claim != cell:
        for direction in range(4):
            if cell + view.grid.offset[direction] == claim:
                travel = np.int64(direction)
    state.place[i] = first_cell(robots, i)
    state.travel[i] = travel
    state.heading[i] = heading
    state.free[i] = np.int64(robots.busy[i])
    state.since[i] = 0
    state.step[i] = 0
    state.step_count[i] = 0
    state.visit_count[i] = 0
    state.in_bay[i] = cell == NIL
    state.robot_type[i] = robots.type[i]


@kernel
def append(state, i, step):
    """Add a step to the plan of robot i; what does not fit lies beyond the horizon."""
    count = state.step_count[i]
    if count < state.steps.shape[1]:
        state.steps[i, count] = step
        state.step_count[i] = count + 1


@kernel
def append_rest(view, workspace, state, i, heading):
    """Add what follows when robot i is at its goal cell with a heading: the rest of its task."""
    robots = view.robots
    if robots.goal_type[i] == GOAL_DROP:
        append(state, i, DROPS)
    elif robots.goal_type[i] == GOAL_PICK and robots.order[i] != NIL:
        append(state, i, PICKS)
        order, pick = np.int64(robots.order[i]), np.int64(robots.goal_cell[i])
        carries_pods = view.trips.pod.shape[0] > 0
        if carries_pods:
            end = next_stop_cell(view, order)
        else:
            end = dropoff_cell(view, robots.type[i], np.int64(view.orders.target[order]), pick)
        if end != NIL:
            pose = pick * view.grid.headings + heading
            robot_type = with_load(view, np.int64(robots.type[i]))
            append_path(view, workspace, state, i, robot_type, pose, end)
            if not carries_pods:
                append(state, i, DROPS)


@kernel
def append_path(view, workspace, state, i, robot_type, pose, target):
    """Add the path of plain A* of a type from a pose to a cell to the plan of robot i."""
    rules = view.rules
    length = astar(
        view.grid,
        robot_type,
        rules.duration[robot_type],
        state.routes,
        LARGER_G,
        rules.seed,
        pose,
        target,
        False,
        workspace.steps,
    )
    for s in range(length):
        append(state, i, np.int64(workspace.steps[s]))


@kernel
def plan_on(view, workspace, state, i, steps, first, end):
    """Give robot i the plan to drive steps[first:end], and then to go on with its task."""
    begin_plan(view, state, i)
    cell, heading = state.place[i], state.heading[i]
    for s in range(first, end):
        step = np.int64(steps[s])
        append(state, i, step)
        cell += view.grid.offset[step]
        heading = heading_towards(view.grid, view.robots.type[i], step)
    if cell == view.robots.goal_cell[i]:
        append_rest(view, workspace, state, i, heading)


@kernel
def has_task(robots, i):
    """Whether robot i is on its way to somewhere, with a route or about to get one."""
    return (
        robots.goal_type[i] != GOAL_NONE
        and robots.goal_cell[i] != NIL
        and robots.retreat_moves[i] == 0
    )


@kernel
def plan_all(view, workspace, state):
    """Give every robot the plan that it has: its route."""
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        if has_task(robots, i):
            plan_on(
                view,
                workspace,
                state,
                i,
                robots.route[i],
                robots.route_index[i],
                robots.route_length[i],
            )
        else:
            begin_plan(view, state, i)
