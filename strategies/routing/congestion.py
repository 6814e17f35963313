"""Routes around predicted congestion: shared plans and a time-expanded search.

Replaying all plans ahead with the slow zones of the world predicts the number of robots in each zone
at each tick. Robots that need a route get the cheapest one for this prediction, one after another in
the order of their identities; each sees the routes of those before it. For comparison, robots may
predict less: the positions of the others if no robot delayed them on the A* paths of their tasks
(`tasks`), or the share of time that each then spends in a zone (`task-averages`). A detour around
blocking robots is never replanned before its end: a new plan would lead back to them.
"""

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    ACTION_TURN,
    MAY_TURN,
    NIL,
    REASON_PERIODIC,
    STARTED,
    Strategy,
    begin_search,
    cost_unit,
    headings_of,
    how_turned,
    is_closed,
    kernel,
    least_move_cost,
    limited_ticks,
    move_cost,
    pop,
    push,
    ways_on,
    write_path,
)
from strategies.routing.forecasts import (
    CongestionState,
    add_task_forecast,
    add_task_forecasts,
    begin_plan,
    congestion_state,
    forecast_all,
    forecast_one,
    forget,
    forget_all,
    occupancy,
    remove_task_forecast,
    ticks_of_move,
    zone_of,
)
from strategies.routing.routing_parameters import SharedPlans
from strategies.routing.shortest import around_closed, around_what

COST_OF_TICK = 1000  # cost of a tick; beta has the same unit
MAX_COST = (1 << 31) - 1  # poses that cost more count as unreachable
EXPANDED = NIL  # marks an expanded pose instead of its tick

# Keys of the heap: cost 31 bits, Manhattan distance 32 - b bits, pose b bits.
BOTH = 32


@kernel
def decide(view, batch, decisions, memory, workspace):
    if batch.count == 0:
        return
    state = CongestionState.of(memory)
    look_ahead(view, workspace, state)
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        steps = decisions.routing.steps[k]
        detour = 1 + np.int64(view.robots.goal_cell[i])
        if batch.reason[k] == REASON_PERIODIC and state.detour[i] == detour:
            continue
        leave_out(view, state, i)
        length = NIL
        around = around_what(batch.reason[k])
        if around:
            length = time_dependent_path(view, workspace, state, i, around, steps)
        state.detour[i] = 0 if length == NIL else detour
        if length == NIL:
            length = time_dependent_path(view, workspace, state, i, 0, steps)
            length = around_closed(view, workspace, i, steps, length)
        if length != NIL:
            decisions.routing.route_length[k] = length
        put_back(view, workspace, state, i, steps, length)
    forget_all(state)


class Congestion(Strategy):
    """Cheapest route in predicted traffic; each move costs 1 + beta x other robots in its zone."""

    layer = "routing"
    Parameters = SharedPlans
    compiled = decide

    def __init__(self, parameters=None):
        super().__init__(parameters)
        self.period = self.parameters.replan_period

    def reset(self, view):
        return congestion_state(view, self.parameters)


@kernel
def look_ahead(view, workspace, state):
    """Predict all robots, by their plans or by their tasks only."""
    if state.tasks_alone:
        add_task_forecasts(view, workspace, state)
    else:
        forecast_all(view, workspace, state)


@kernel
def leave_out(view, state, i):
    """Predict all robots except this one."""
    if state.tasks_alone:
        remove_task_forecast(view, state, i)
    else:
        forget(state, i)


@kernel
def put_back(view, workspace, state, i, steps, length):
    """Add this robot with its new route to the prediction."""
    if state.tasks_alone:
        add_task_forecast(view, workspace, state, i)
    elif length != NIL:
        forecast_one(view, workspace, state, i, steps, length)


# Time-expanded search: the cheapest route through zones with predicted robots.
#
# A move at tick T from a cell in a zone with `others` robots costs 1 + beta * others times its
# duration; the weight of a street multiplies the 1. In zones that slow robots down it takes 1 + others
# times its duration. A turn costs and takes its ticks. Label-setting A*: each pose is expanded once,
# with its cheapest label, which holds the tick of arrival. (With beta > 1 an earlier but dearer path may
# lose to a later but cheaper one.) The estimate is the Manhattan distance times the least cost of a move;
# ties go to the pose nearest to the target, then to
# the lowest pose.


@kernel
def time_dependent_path(view, workspace, state, i, around, steps):
    """Write the cheapest route of robot i to its goal cell, as much as fits; return its length or NIL.

    `around`: cells without room now, except the goal cell, are removed from the floor.
    """
    robot_type, grid, target = view.robots.type[i], view.grid, np.int64(view.robots.goal_cell[i])
    duration, type_cell_flags = view.rules.duration[robot_type], grid.type_cell_flags[robot_type]
    begin_plan(view, state, i)
    headings, apart = grid.headings, headings_of(grid, robot_type)
    bits = bits_for(workspace.cost.shape[0])
    move, turn = np.int64(duration[ACTION_MOVE]), np.int64(duration[ACTION_TURN]) * COST_OF_TICK
    search = begin_search(workspace)
    start, free = state.place[i] * headings + state.heading[i], state.free[i]
    size = label(view, state, move, workspace, search, bits, 0, start, 0, free, target, STARTED)
    while size > 0 and workspace.stop[0] == 0:
        pose = pop(workspace.heap, size) & ((1 << bits) - 1)
        size -= 1
        now = np.int64(state.arrival[pose])
        if now == EXPANDED:
            continue
        state.arrival[pose] = EXPANDED
        workspace.generation[1] += 1
        cell, heading, cost = pose // headings, pose % headings, np.int64(workspace.cost[pose])
        if cell == target:
            return write_path(grid, workspace, pose, steps)
        flags = np.int64(type_cell_flags[cell])
        ways = ways_on(flags, cell == state.place[i])
        for way in range(heading, 4, apart):
            after = cell + grid.offset[way]
            if (ways >> way) & 1 == 0 or is_closed(view, after, way, target, around):
                continue
            others = occupancy(state, zone_of(grid, cell, way), now)  # in thousandths
            own = limited_ticks(grid, move, cell, way)
            dearer = cost + own * (state.beta * others // 1000)
            dearer += move_cost(grid, move, cell, way) * (COST_OF_TICK // cost_unit(grid))
            later = now + ticks_of_move(view, own, others // 1000)
            to = after * headings + heading
            size = label(
                view, state, move, workspace, search, bits, size, to, dearer, later, target, way
            )
        if apart > 1 and flags & MAY_TURN:
            dearer, later = cost + turn, now + np.int64(duration[ACTION_TURN])
            for turned in (1, -1):
                to = cell * headings + ((heading + turned) & (apart - 1))
                how = how_turned(pose, to)
                size = label(
                    view, state, move, workspace, search, bits, size, to, dearer, later, target, how
                )
    return np.int64(NIL)


@kernel
def bits_for(count):
    """The number of bits that distinguish this number of items."""
    bits = 1
    while (1 << bits) < count:
        bits += 1
    return bits


@kernel
def label(view, state, move, workspace, search, bits, size, pose, cost, tick, target, how):
    """Label a pose with cost and tick of arrival if they improve it; return the size of the queue.

    `move`: ticks of a move of the robot.
    """
    arrival = state.arrival
    if workspace.stamp[pose] == search:
        if arrival[pose] == EXPANDED or cost > workspace.cost[pose]:
            return size
        if cost == workspace.cost[pose] and tick >= arrival[pose]:
            return size
    width, cell = view.grid.width, pose // view.grid.headings
    left = abs(cell // width - target // width) + abs(cell % width - target % width)
    grid = view.grid
    total = cost + left * least_move_cost(grid, move) * (COST_OF_TICK // cost_unit(grid))
    if total > MAX_COST:
        return size
    workspace.stamp[pose] = search
    workspace.cost[pose] = cost
    arrival[pose] = tick
    workspace.parent[pose] = how
    nearer = min(left, (1 << (BOTH - bits)) - 1)
    push(workspace.heap, size, (total << BOTH) | (nearer << bits) | pose)
    return size + 1
