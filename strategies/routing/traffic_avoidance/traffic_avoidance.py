"""Traffic avoidance (Bhattathiri, Li & Kuhl): A* around zones in which many others are predicted.

A robot that gets a task predicts which zones the others use. All it knows of them is where their
tasks began, pick up and drop: it predicts the zones on the A* paths of the whole task, as if no
robot delayed them, or a noisy version of those, or what a network says that has learnt such paths.
It plans both legs of its own task at once, with the zones of A or more others closed for A = 1, 2,
..., and keeps the plan that takes the least time so.

The noisy version is that of the trials of Table 5 (prediction_noise). In a fleet of many
nearly every zone has A or more others predicted for each A up to max_threshold; then no way is left
open, and plain A* is all there is. How often another plan was taken is counted:
`alternative_routes`.
"""

from typing import ClassVar

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL
from automaton.strategy.kernels import kernel, position
from automaton.strategy.layer import Strategy, memory_of
from strategies.routing.astar.astar import astar, search
from strategies.routing.astar.astar_routing import RULE, around_robots, start_pose
from strategies.routing.astar.frontier import TIES
from strategies.routing.traffic_avoidance.avoidance import (
    LEAST_TIME,
    PLAIN,
    choose_threshold,
    close_zones,
)
from strategies.routing.traffic_avoidance.network_files import network_for, packed, scratch_size
from strategies.routing.traffic_avoidance.path_zones import add_zones, count_zones, has_zone
from strategies.routing.traffic_avoidance.predicted_paths import next_goal_cell
from strategies.routing.traffic_avoidance.prediction_noise import (
    CERTAIN,
    USED_SHARE,
    blur,
    false_alarms,
)
from strategies.routing.traffic_avoidance.zone_network import add_predicted

# memory.parameters, after RULE
MOST = 1  # the largest A
KEEP_ZONE = 2  # the chances of the noise in units of 1 / CERTAIN: a zone used is predicted,
ADD_ZONE = 3  # and another one
NETWORK = 4  # where a packed network begins, if there is one; memory.shared is its scratch

# memory.per_robot
STAND = 0  # the zones predicted of a robot are those of its way to this cell ...
NEXT = 1  # ... and on to this one
PLAN_FROM = 2  # the leg that was planned before its time
PLAN_TO = 3
TAKEN = 4  # the order whose first leg a network was last asked about, plus 1 ...
TAKEN_AT = 5  # ... and the cell from which that leg began
ALTERNATIVES = 6  # plans that were not plain A*'s
SETS = 7  # two sets of zones, a bit for each: those predicted, those closed to the planned leg


@kernel
def sets_of(memory, i):
    """The two sets of zones of robot i."""
    words = (memory.per_robot.shape[1] - SETS) >> 1
    return memory.per_robot[i, SETS : SETS + words], memory.per_robot[i, SETS + words :]


@kernel
def foresee_task(view, memory, workspace, i):
    """Replay robot i's task from where it is now, and remember the zones that it uses."""
    per_robot, given = memory.per_robot, memory.parameters
    if given.shape[0] > NETWORK:
        predict(view, memory, i)
        return
    used, _ = sets_of(memory, i)
    used[:] = 0
    per_robot[i, STAND] = view.robots.goal_cell[i]
    per_robot[i, NEXT] = next_goal_cell(view, i)
    pose, robot_type = start_pose(view, i), view.robots.type[i]
    for leg in (STAND, NEXT):
        if per_robot[i, leg] != NIL and pose != NIL:
            pose = search(
                view.grid,
                robot_type,
                view.rules.duration[robot_type],
                workspace.routes,
                given[RULE],
                view.rules.seed,
                pose,
                per_robot[i, leg],
                False,
            )
            if pose != NIL:
                add_zones(view.grid, workspace.routes, pose, used)
    if given[KEEP_ZONE] < CERTAIN or given[ADD_ZONE] > 0:
        traffic_zone_count, tick = view.grid.traffic_zone_count, view.clock[CLOCK_TICK]
        who = np.int64(view.robots.identity[i])
        blur(
            used, traffic_zone_count, given[KEEP_ZONE], given[ADD_ZONE], view.rules.seed, tick, who
        )


@kernel
def is_on_second_leg(view, memory, i):
    """Whether robot i has its load and brings it where it was predicted to."""
    return view.robots.load[i] != NIL and memory.per_robot[i, NEXT] == view.robots.goal_cell[i]


@kernel
def is_foreseen(view, memory, i):
    """Whether the zones predicted of robot i are those of its present task."""
    per_robot = memory.per_robot
    same = per_robot[i, STAND] == view.robots.goal_cell[i] and per_robot[i, NEXT] == next_goal_cell(
        view, i
    )
    return same or is_on_second_leg(view, memory, i)


@kernel
def predict(view, memory, i):
    """Have the network say which zones robot i's task uses, and remember them.

    It has learnt whole legs, so it is asked about them: the first one begins where the robot stood
    when it was first seen with its order, or where it stands now if there is none to pick up.
    """
    per_robot, traffic_zone = memory.per_robot, view.grid.traffic_zone
    per_robot[i, STAND] = view.robots.goal_cell[i]
    per_robot[i, NEXT] = next_goal_cell(view, i)
    used, _ = sets_of(memory, i)
    used[:] = 0
    network, cell = memory.parameters[NETWORK:], position(view, i)
    if per_robot[i, NEXT] != NIL:
        taken = np.int64(view.robots.order[i]) + 1  # the memory begins with zeros: no order
        if per_robot[i, TAKEN] != taken:
            per_robot[i, TAKEN] = taken
            per_robot[i, TAKEN_AT] = cell
        cell = per_robot[i, TAKEN_AT]
    for leg in (STAND, NEXT):
        if per_robot[i, leg] != NIL:
            start, end = (
                np.int64(traffic_zone[cell, 0]),
                np.int64(traffic_zone[per_robot[i, leg], 0]),
            )
            add_predicted(network, memory.shared, start, end, used)
            cell = per_robot[i, leg]


@kernel
def count_others(view, memory, workspace, i):
    """workspace.routes.count = how many others are predicted in each zone.

    Each is predicted once for a task. With limited sight nothing is remembered about others.
    """
    count = workspace.routes.count
    count[:] = 0
    for j in range(view.robots.cell.shape[0]):
        if j == i or view.robots.goal_cell[j] == NIL:
            continue
        if not is_foreseen(view, memory, j) or view.rules.radius > 0:
            foresee_task(view, memory, workspace, j)
        used, _ = sets_of(memory, j)
        count_zones(used, count)


@kernel
def choose(view, memory, workspace, i, start):
    """Close zones as the chosen plan has it; whether any is. Keeps those of a second leg."""
    routes, given = workspace.routes, memory.parameters
    goal_cell, then = np.int64(view.robots.goal_cell[i]), next_goal_cell(view, i)
    pick, drop = (goal_cell, then) if then != NIL else (then, goal_cell)
    count_others(view, memory, workspace, i)
    robot_type = view.robots.type[i]
    threshold = choose_threshold(
        view.grid,
        robot_type,
        view.rules.duration[robot_type],
        routes,
        given[RULE],
        view.rules.seed,
        start,
        pick,
        drop,
        given[MOST],
        LEAST_TIME,
    )
    if threshold == PLAIN:
        routes.closed[:] = 0
    else:
        close_zones(view.grid, routes, threshold, start, pick, drop)
        memory.per_robot[i, ALTERNATIVES] += 1
    _, closed = sets_of(memory, i)
    closed[:] = 0
    for zone in range(view.grid.traffic_zone_count):
        closed[zone >> 6] |= np.int64(routes.closed[zone]) << (zone & 63)
    memory.per_robot[i, PLAN_FROM] = goal_cell
    memory.per_robot[i, PLAN_TO] = then


@kernel
def has_plan(view, memory, i, start):
    """Whether this leg was planned together with the one before it."""
    cell = start // view.grid.headings
    return (
        memory.per_robot[i, PLAN_FROM] == cell
        and memory.per_robot[i, PLAN_TO] == view.robots.goal_cell[i]
    )


@kernel
def plan(view, memory, workspace, i, steps):
    """Write the route of robot i into steps; its length, or NIL."""
    routes, start = workspace.routes, start_pose(view, i)
    if has_plan(view, memory, i, start):
        _, closed = sets_of(memory, i)
        for zone in range(view.grid.traffic_zone_count):
            routes.closed[zone] = has_zone(closed, zone)
        memory.per_robot[i, PLAN_FROM] = NIL
    else:
        choose(view, memory, workspace, i, start)
    robot_type = view.robots.type[i]
    return astar(
        view.grid,
        robot_type,
        view.rules.duration[robot_type],
        routes,
        memory.parameters[RULE],
        view.rules.seed,
        start,
        np.int64(view.robots.goal_cell[i]),
        True,
        steps,
    )


@kernel
def decide(view, batch, decisions, memory, workspace):
    for k in range(batch.count[0]):  # first: tasks that begin now, all from where they begin
        i = np.int64(batch.robot[k])
        if not is_on_second_leg(view, memory, i):
            foresee_task(view, memory, workspace, i)
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        steps = decisions.routing.steps[k]
        length = around_robots(view, workspace, i, batch.reason[k], steps)
        if length == NIL:
            length = plan(view, memory, workspace, i, steps)
        if length != NIL:
            decisions.routing.route_length[k] = length


class TrafficAvoidance(Strategy):
    """A* around the zones in which many others are predicted."""

    layer = "routing"
    compiled = decide
    counters: ClassVar = {"alternative_routes": ALTERNATIVES}

    def reset(self, view):
        p = self.parameters
        words = -(-view.grid.traffic_zone_count // 64)
        keep, add = 1.0, 0.0
        if p.predictor == "noisy":
            keep = p.recall
            add = false_alarms(p.precision, p.recall, p.prevalence or USED_SHARE)
        chances = (round(keep * CERTAIN), round(add * CERTAIN))
        parameters = (TIES.index(p.tie_break), p.max_threshold, *chances)
        own = SETS + 2 * words
        if p.predictor in ("exact", "noisy"):
            return memory_of(view, own, parameters=parameters)
        network = network_for(view.grid, view.rules.duration[0], p.network)
        parameters = np.concatenate([parameters, packed(network)])
        return memory_of(view, own, scratch_size(network), parameters)
