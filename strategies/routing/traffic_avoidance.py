"""Traffic avoidance (Bhattathiri, Li & Kuhl): A* around zones in which many others are predicted.

A robot with a new task predicts the zones of the others. It knows only where their tasks began, pick
up and drop. The prediction is the zones on the A* paths of their whole tasks, as if no robot delayed
them; or these zones with noise (as in the trials of Table 5); or the output of a network that has learnt
such paths. The robot plans both legs of its own task at once, with zones of A or more others closed
for A = 1, 2, ... (or of more than A: `closed_from`), and keeps the plan with the least predicted time.

In a large fleet nearly every zone has A or more predicted others for each A up to max_threshold. Then no
path remains open, and only plain A* is left. `alternative_routes` counts the plans other than plain A*.
"""

from typing import ClassVar

import numpy as np

from automaton.strategy.api import (
    NIL,
    UNREACHABLE,
    Array,
    Strategy,
    Struct,
    cost_unit,
    field,
    kernel,
    position,
)
from strategies.routing.astar import (
    TIES,
    RouteSpace,
    around_robots,
    astar,
    route_space,
    search,
    start_pose,
)
from strategies.routing.predicted_paths import (
    CERTAIN,
    USED_SHARE,
    KernelNetwork,
    add_predicted,
    add_zones,
    blur,
    count_zones,
    delay_of,
    false_alarms,
    has_zone,
    kernel_network,
    next_goal_cell,
    no_network,
    words,
)
from strategies.routing.routing_parameters import Avoidance, network_for

PLAIN_ASTAR = 0  # in place of A: nothing is closed

# Choice of the candidate: least predicted time, then plain A*, then least A.
LEAST_TIME = 0
MOST_CAUTIOUS = 1  # the candidate with the least A
STAND = 0  # columns of AvoidanceState.leg_end
NEXT = 1


class AvoidanceState(Struct):
    """Parameters, predictions of each robot, and its plan."""

    tie_rule: int = field("int64", "an index of TIES")
    max_threshold: int = field("int64", "the largest A")
    least_count: int = field("int64", "others that close a zone if A = 1")
    keep_chance: int = field("int64", "probability, in 1 / CERTAIN, of predicting a used zone")
    add_chance: int = field("int64", "and of predicting an unused zone")
    network: KernelNetwork
    predicted: Array = field("(n, words) int64", "zones of a robot's task, a bit for each")
    leg_end: Array = field("(n, 2) int64", "the cells to which its two legs lead, in order")
    planned_from: Array = field("(n,) int64", "the leg that was planned in advance")
    planned_to: Array = field("(n,) int64")
    closed: Array = field("(n, words) int64", "the closed zones of that leg, a bit for each")
    taken: Array = field("(n,) int64", "1 + the order whose first leg the network has predicted")
    taken_at: Array = field("(n,) int64", "the cell from which that leg began")
    alternatives: Array = field("(n,) int64", "plans other than plain A*")
    routes: RouteSpace


@kernel
def decide(view, batch, decisions, memory, workspace):
    state = AvoidanceState.of(memory)
    for k in range(batch.count):  # first: all new tasks are predicted from their start
        i = np.int64(batch.robot[k])
        if not is_on_second_leg(view, state, i):
            foresee_task(view, state, i)
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        steps = decisions.routing.steps[k]
        length = around_robots(view, workspace, i, batch.reason[k], steps)
        if length == NIL:
            length = plan(view, state, i, steps)
        if length != NIL:
            decisions.routing.route_length[k] = length


class TrafficAvoidance(Strategy):
    """A* around zones with many predicted others."""

    layer = "routing"
    Parameters = Avoidance
    compiled = decide
    counters: ClassVar = {"alternative_routes": "alternatives"}

    def reset(self, view):
        p = self.parameters
        keep, add = 1.0, 0.0
        if p.predictor == "noisy":
            keep = p.recall
            add = false_alarms(p.precision, p.recall, p.prevalence or USED_SHARE)
        network = no_network()
        if p.predictor not in ("exact", "noisy"):
            network = kernel_network(network_for(view.grid, view.rules.duration[0], p.network))
        return AvoidanceState.sized(
            {"n": len(view.robots.cell), "words": words(view.grid.traffic_zone_count)},
            tie_rule=TIES.index(p.tie_break),
            max_threshold=p.max_threshold,
            least_count=p.least_count,
            keep_chance=round(keep * CERTAIN),
            add_chance=round(add * CERTAIN),
            network=network,
            routes=route_space(view.grid),
        )


@kernel
def foresee_task(view, state, i):
    """Replay robot i's task from its current cell, and store the zones that it uses."""
    if state.network.zones:
        predict(view, state, i)
        return
    used, leg_end = state.predicted[i], state.leg_end
    used[:] = 0
    leg_end[i, STAND] = view.robots.goal_cell[i]
    leg_end[i, NEXT] = next_goal_cell(view, i)
    pose, robot_type = start_pose(view, i), view.robots.type[i]
    duration, routes, ties = view.rules.duration[robot_type], state.routes, state.tie_rule
    for leg in (STAND, NEXT):
        if leg_end[i, leg] != NIL and pose != NIL:
            target = leg_end[i, leg]
            pose = search(
                view.grid, robot_type, duration, routes, ties, view.rules.seed, pose, target, False
            )
            if pose != NIL:
                add_zones(view.grid, routes, pose, used)
    keep, add = state.keep_chance, state.add_chance
    if keep < CERTAIN or add > 0:
        traffic_zone_count, tick = view.grid.traffic_zone_count, view.clock.tick
        who = np.int64(view.robots.identity[i])
        blur(used, traffic_zone_count, keep, add, view.rules.seed, tick, who)


@kernel
def is_on_second_leg(view, state, i):
    """Whether robot i carries its load to the predicted cell."""
    return view.robots.load[i] != NIL and state.leg_end[i, NEXT] == view.robots.goal_cell[i]


@kernel
def is_foreseen(view, state, i):
    """Whether the predicted zones of robot i belong to its current task."""
    goal_cell, leg_end = view.robots.goal_cell[i], state.leg_end
    same = leg_end[i, STAND] == goal_cell and leg_end[i, NEXT] == next_goal_cell(view, i)
    return same or is_on_second_leg(view, state, i)


@kernel
def predict(view, state, i):
    """Predict the zones of robot i's task with the network, and store them.

    The network has learnt whole legs. The first leg begins where the robot was first seen with its
    order, or at its current cell if it has nothing to pick up.
    """
    leg_end, traffic_zone = state.leg_end, view.grid.traffic_zone
    leg_end[i, STAND] = view.robots.goal_cell[i]
    leg_end[i, NEXT] = next_goal_cell(view, i)
    used, cell = state.predicted[i], position(view, i)
    used[:] = 0
    if leg_end[i, NEXT] != NIL:
        taken = np.int64(view.robots.order[i]) + 1  # 0, as at the start: no order
        if state.taken[i] != taken:
            state.taken[i] = taken
            state.taken_at[i] = cell
        cell = state.taken_at[i]
    for leg in (STAND, NEXT):
        if leg_end[i, leg] != NIL:
            start = np.int64(traffic_zone[cell, 0])
            end = np.int64(traffic_zone[leg_end[i, leg], 0])
            add_predicted(state.network, start, end, used)
            cell = leg_end[i, leg]


@kernel
def count_others(view, state, i):
    """state.routes.count = the predicted number of others in each zone.

    A task is predicted once. With limited sight nothing is stored about others.
    """
    count = state.routes.count
    count[:] = 0
    for j in range(view.robots.cell.shape[0]):
        if j == i or view.robots.goal_cell[j] == NIL:
            continue
        if not is_foreseen(view, state, j) or view.rules.radius > 0:
            foresee_task(view, state, j)
        count_zones(state.predicted[j], count)


@kernel
def choose(view, state, i, start):
    """Close the zones of the chosen plan; return whether any is closed. Stores those of a second leg."""
    routes = state.routes
    goal_cell, then = np.int64(view.robots.goal_cell[i]), next_goal_cell(view, i)
    pick, drop = (goal_cell, then) if then != NIL else (then, goal_cell)
    count_others(view, state, i)
    robot_type, ties, seed = view.robots.type[i], state.tie_rule, view.rules.seed
    duration = view.rules.duration[robot_type]
    most, least_count = state.max_threshold, state.least_count
    threshold = choose_threshold(
        view.grid, robot_type, duration, routes, ties, seed, start, pick, drop, most, least_count,
        LEAST_TIME,
    )  # fmt: skip
    if threshold == PLAIN_ASTAR:
        routes.closed[:] = 0
    else:
        close_zones(view.grid, routes, threshold + least_count - 1, start, pick, drop)
        state.alternatives[i] += 1
    closed = state.closed[i]
    closed[:] = 0
    for zone in range(view.grid.traffic_zone_count):
        closed[zone >> 6] |= np.int64(routes.closed[zone]) << (zone & 63)
    state.planned_from[i] = goal_cell
    state.planned_to[i] = then


@kernel
def has_plan(view, state, i, start):
    """Whether this leg was planned together with the previous one."""
    cell = start // view.grid.headings
    return state.planned_from[i] == cell and state.planned_to[i] == view.robots.goal_cell[i]


@kernel
def plan(view, state, i, steps):
    """Write the route of robot i to `steps`; return its length or NIL."""
    routes, start = state.routes, start_pose(view, i)
    if has_plan(view, state, i, start):
        closed = state.closed[i]
        for zone in range(view.grid.traffic_zone_count):
            routes.closed[zone] = has_zone(closed, zone)
        state.planned_from[i] = NIL
    else:
        choose(view, state, i, start)
    robot_type, ties, seed = view.robots.type[i], state.tie_rule, view.rules.seed
    duration, goal_cell = view.rules.duration[robot_type], np.int64(view.robots.goal_cell[i])
    return astar(view.grid, robot_type, duration, routes, ties, seed, start, goal_cell, True, steps)


# Closed zones: those with A or more others, except zones that touch the robot's own start, pick-up or
# drop-off. Each A that leaves a path open gives a candidate, and so does plain A*.


@kernel
def choose_threshold(
    grid, robot_type, duration, workspace, ties, seed, start, pick, drop, most, least_count, rule
):
    """The A = 1..most of the chosen candidate, or PLAIN_ASTAR.

    `least_count`: the fewest others that close a zone if A = 1: 1, or 2 for "more than A".
    Reads the others in each zone from workspace.count; `start` is a pose, `pick` and `drop` are
    cells, `pick` may be NIL. Overwrites workspace.closed; call close_zones to set it for the result.
    """
    chosen = PLAIN_ASTAR
    offset = least_count - 1
    least = foreseen_time(
        grid, robot_type, duration, workspace, ties, seed, start, pick, drop, PLAIN_ASTAR
    )
    for threshold in range(1, most + 1):
        if close_zones(grid, workspace, threshold + offset, start, pick, drop) == 0:
            break  # no larger A closes a zone
        ticks = foreseen_time(
            grid, robot_type, duration, workspace, ties, seed, start, pick, drop, threshold
        )
        if rule == MOST_CAUTIOUS and ticks < UNREACHABLE:
            return np.int64(threshold)
        if ticks < least:
            least = ticks
            chosen = threshold
    return np.int64(chosen)


@kernel
def foreseen_time(grid, robot_type, duration, workspace, ties, seed, start, pick, drop, threshold):
    """Ticks of both legs, delayed by the others of workspace.count in their zones, or UNREACHABLE."""
    ticks = 0
    pose = np.int64(start)
    for leg in range(2):
        target = drop if leg else pick
        if target == NIL:
            continue
        pose = search(
            grid,
            robot_type,
            duration,
            workspace,
            ties,
            seed,
            pose,
            target,
            threshold != PLAIN_ASTAR,
        )
        if pose == NIL:
            return UNREACHABLE
        ticks += workspace.state.cost
        ticks += cost_unit(grid) * delay_of(grid, duration, workspace, pose, workspace.count)
    return ticks


@kernel
def close_zones(grid, workspace, threshold, start, pick, drop):
    """Close zones with this number of others, except the robot's own; return their number before that."""
    busy = 0
    for zone in range(workspace.closed.shape[0]):
        workspace.closed[zone] = workspace.count[zone] >= threshold
        busy += workspace.closed[zone]
    open_zones(grid, workspace, start >> (grid.headings >> 1))
    open_zones(grid, workspace, drop)
    if pick != NIL:
        open_zones(grid, workspace, pick)
    return busy


@kernel
def open_zones(grid, workspace, cell):
    """Open the zones that touch a cell: its own zones and those of adjacent cells.

    So a robot on an intersection can leave it, whether the intersection is a zone or not.
    """
    open_cell(grid, workspace, cell)
    for way in range(4):
        open_cell(grid, workspace, cell + grid.offset[way])


@kernel
def open_cell(grid, workspace, cell):
    for column in range(2):
        if grid.traffic_zone[cell, column] != NIL:
            workspace.closed[grid.traffic_zone[cell, column]] = 0
