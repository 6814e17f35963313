"""Forecasts: predicted robots in each zone, tick by tick, from now to a horizon.

The plans of robots (routes, then the rest of their tasks) are replayed ahead of time by the rule of
slow zones and no other rule. For comparison, a forecast may use only the tasks of robots.
"""

from __future__ import annotations

import numpy as np

from automaton.strategy.api import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_TURN,
    DERIVED,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PICK,
    NIL,
    SCRATCH,
    Array,
    Struct,
    World,
    dropoff_cell,
    field,
    first_cell,
    heading_towards,
    headings_of,
    kernel,
    limited_ticks,
    next_stop_cell,
    pickup_cell,
    with_load,
    without_load,
)
from strategies.routing.astar import LARGER_G, RouteSpace, astar, route_space
from strategies.routing.routing_parameters import SharedPlans

PICK_STEP = 4  # steps besides the four directions
DROP_STEP = 5
LANES = 4  # counts in a word
LANE = 16  # bits of a count
MASK = (1 << LANE) - 1
EVERY_LANE = 0x0001000100010001
FULL_SHARE = 1_000_000  # with predicted shares: a robot that is always in the zone


class CongestionState(Struct):
    """Parameters, detours, and the forecast of n robots in Z zones for h ticks from now."""

    beta: int = field("int64", "cost of another robot in the zone, in thousandths of a move")
    horizon: int = field("int64", "h, at most 65,535")
    tasks_alone: int = field("int64", "1: only the tasks of the others are known")
    shares: int = field("int64", "1: the forecast is a share of time, equal for all ticks")
    detour: Array = field("(n,) int64", "1 + the goal cell of a detour, or 0")
    # Plans of whole tasks persist until the task ends.
    task: Array = field("(n,) int64", "dispatched << 32 | 1 + the order of the plan, or 0")
    step_count: Array = field("(n,) int64", "steps of the plan")
    steps: Array = field("(n, h + 2) uint8", "one for each tick, and for work of no ticks")
    # The replay of a plan:
    step: Array = field("(n,) int64", "steps begun", role=SCRATCH)
    place: Array = field("(n,) int64", "the cell in which the next step begins", role=SCRATCH)
    travel: Array = field("(n,) int64", "direction in which it arrives there", role=SCRATCH)
    heading: Array = field("(n,) int64", role=SCRATCH)
    free: Array = field("(n,) int64", "tick in which the next step begins", role=SCRATCH)
    robot_type: Array = field(
        "(n,) int64", "its type then, which depends on its load", role=SCRATCH
    )
    in_bay: Array = field(
        "(n,) int64",
        "1: its first step begins in a parking bay; k > 1: its step out of it ends in k ticks",
        role=SCRATCH,
    )
    zone: Array = field("(n,) int64", "where it is counted, or NIL", role=SCRATCH)
    since: Array = field("(n,) int64", "the tick of its arrival there", role=SCRATCH)
    visit_count: Array = field("(n,) int64", "number of counted visits", role=SCRATCH)
    visit_zone: Array = field("(n, h + 2) int32", role=SCRATCH)
    visit_begin: Array = field("(n, h + 2) uint16", "the first tick", role=SCRATCH)
    visit_end: Array = field("(n, h + 2) uint16", "the tick after its end", role=SCRATCH)
    # For all robots; zero between two calls:
    counts: Array = field("(Z, words) int64", "robots in a zone, tick by tick", role=DERIVED)
    overflowed: int = field("() int64", "1: a count has overflowed", role=DERIVED)
    zone_share: Array = field(
        "(Z,) int64", "expected robots in a zone, in 1 / FULL_SHARE", role=DERIVED
    )
    crowd: Array = field("(Z,) int64", "robots in a zone at the tick of a replay", role=DERIVED)
    calendar: Array = field(
        "(h,) int64", "1 + the first robot whose step begins in a tick", role=DERIVED
    )
    link: Array = field("(n,) int64", "1 + the next robot in the same tick", role=SCRATCH)
    # For searches:
    arrival: Array = field("(P,) int32", "tick in which a pose is reached", role=SCRATCH)
    routes: RouteSpace


def congestion_state(view: World, parameters: SharedPlans) -> CongestionState:
    """The state at the beginning of a run."""
    zones = view.grid.traffic_zone_count
    return empty_state(len(view.robots.cell), zones, parameters, route_space(view.grid))


def empty_state(
    robots: int, zones: int, parameters: SharedPlans, routes: RouteSpace
) -> CongestionState:
    """A state for this number of robots and zones, with an empty forecast."""
    horizon, poses = parameters.horizon, len(routes.came)
    return CongestionState.sized(
        {"n": robots, "Z": zones, "h": horizon, "words": -(-horizon // LANES), "P": poses},
        routes=routes,
        beta=round(1000 * parameters.beta),
        horizon=horizon,
        tasks_alone=int(parameters.forecast != "plans"),
        shares=int(parameters.forecast == "task-averages"),
    )


# Counts of the zones: four ticks per word. A robot adds its visits to zones. A count saturates at
# 65,535 and stays there until all counts are cleared.


@kernel
def present(state, zone, tick):
    """Robots predicted in a zone at a tick; 0 without a zone and beyond the horizon."""
    if zone == NIL or tick >= state.horizon:
        return 0
    return (state.counts[zone, tick // LANES] >> (tick % LANES * LANE)) & MASK


@kernel
def occupancy(state, zone, tick):
    """Expected robots in a zone at a tick, in thousandths."""
    if zone != NIL and state.shares:
        return state.zone_share[zone] // (FULL_SHARE // 1000)
    return 1000 * present(state, zone, tick)


@kernel
def add(state, zone, begin, end, sign):
    """Add `sign` to the counts of a zone from tick `begin` up to, but not including, tick `end`."""
    counts = state.counts[zone]
    if state.zone.shape[0] > MASK:
        add_within_bounds(state, counts, begin, end, sign)
        return
    tick = begin
    while tick < end:
        if tick % LANES == 0 and tick + LANES <= end:
            counts[tick // LANES] += sign * EVERY_LANE
            tick += LANES
        else:
            counts[tick // LANES] += sign << (tick % LANES * LANE)
            tick += 1


@kernel
def add_within_bounds(state, counts, begin, end, sign):
    """The same if a count may overflow: it must not carry into the next count."""
    for tick in range(begin, end):
        word, shift = tick // LANES, tick % LANES * LANE
        count = (counts[word] >> shift) & MASK
        if count == MASK or count + sign > MASK:
            counts[word] |= MASK << shift
            state.overflowed = 1
        else:
            counts[word] += sign << shift


@kernel
def enter_zone(state, i, zone, tick):
    """Move robot i to `zone` at `tick`: end and count its visit to the previous zone."""
    before, since = state.zone[i], state.since[i]
    if zone == before:
        return
    if before != NIL and tick > since:
        visit = state.visit_count[i]
        state.visit_zone[i, visit] = before
        state.visit_begin[i, visit] = since
        state.visit_end[i, visit] = tick
        state.visit_count[i] += 1
        add(state, before, since, tick, 1)
    state.zone[i] = zone
    state.since[i] = tick


@kernel
def forget(state, i):
    """Take robot i out of the counts."""
    for visit in range(state.visit_count[i]):
        begin, end = np.int64(state.visit_begin[i, visit]), np.int64(state.visit_end[i, visit])
        add(state, np.int64(state.visit_zone[i, visit]), begin, end, -1)
    state.visit_count[i] = 0


@kernel
def forget_all(state):
    """Reset the counts to zero."""
    for i in range(state.zone.shape[0]):
        forget(state, i)
    if state.overflowed:
        state.counts[:] = 0
        state.overflowed = 0
    if state.shares:
        state.zone_share[:] = 0


# The known plan of each robot: its route, then the rest of its task.
#
# A plan begins where the robot is free for its next step. It consists of directions, the work at the
# goal cell, and the path with the load to the order's target, by plain A*. A plan of a pod's trip ends
# at its next stop, since the duration of the visit is unknown.


@kernel
def zone_of(grid, cell, direction):
    """The zone of a robot in a cell, for its direction of arrival or departure."""
    return np.int64(grid.traffic_zone[cell, direction >> 1])


@kernel
def begin_plan(view, state, i):
    """Clear the plan of robot i; until it is free, it counts in its cell or the cell it is leaving."""
    robots = view.robots
    cell, claim = np.int64(robots.cell[i]), np.int64(robots.claim[i])
    travel, heading = np.int64(robots.travel[i]), np.int64(robots.heading[i])
    state.zone[i] = NIL if cell == NIL else zone_of(view.grid, cell, travel)
    if cell == NIL:
        travel = heading  # as if it had arrived in its heading
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
    """Add a step to the plan of robot i; steps that do not fit are beyond the horizon."""
    count = state.step_count[i]
    if count < state.steps.shape[1]:
        state.steps[i, count] = step
        state.step_count[i] = count + 1


@kernel
def append_rest(view, workspace, state, i, heading):
    """Add the rest of robot i's task, from its goal cell and a heading."""
    robots = view.robots
    if robots.goal_type[i] == GOAL_DROP:
        append(state, i, DROP_STEP)
    elif robots.goal_type[i] == GOAL_PICK and robots.order[i] != NIL:
        append(state, i, PICK_STEP)
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
                append(state, i, DROP_STEP)


@kernel
def append_path(view, workspace, state, i, robot_type, pose, target):
    """Extend the plan of robot i by the plain A* path of a type from a pose to a cell."""
    seed, duration, steps = view.rules.seed, view.rules.duration[robot_type], workspace.steps
    length = astar(
        view.grid, robot_type, duration, state.routes, LARGER_G, seed, pose, target, False, steps
    )
    for s in range(length):
        append(state, i, np.int64(steps[s]))


@kernel
def plan_on(view, workspace, state, i, steps, first, end):
    """Set the plan of robot i: drive steps[first:end], then continue its task."""
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
    """Whether robot i is driving to a goal, with a route or about to get one."""
    return (
        robots.goal_type[i] != GOAL_NONE
        and robots.goal_cell[i] != NIL
        and robots.retreat_moves[i] == 0
    )


@kernel
def plan_all(view, workspace, state):
    """Set the plan of each robot to its current route."""
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        if has_task(robots, i):
            first, end = robots.route_index[i], robots.route_length[i]
            plan_on(view, workspace, state, i, robots.route[i], first, end)
        else:
            begin_plan(view, state, i)


# Replay of plans: each robot takes its steps as soon as it is free.
#
# The duration of a move is multiplied by the number of robots in its zone when it begins; no robot
# waits for a cell. A robot that leaves a parking bay counts from the next tick on. A robot whose plan
# has ended counts for one more tick, since its next task is unknown; a robot without a task stays.


@kernel
def forecast_all(view, workspace, state):
    """Count all robots with their current routes, from now to the horizon."""
    plan_all(view, workspace, state)
    robots = view.robots.cell.shape[0]
    for i in range(robots):
        if state.zone[i] != NIL:
            state.crowd[state.zone[i]] += 1
        if state.free[i] or has_task(view.robots, i):
            schedule(state, i, state.free[i])
    for tick in range(state.horizon):
        go_on(view, state, tick)
    for i in range(robots):
        enter_zone(state, i, NIL, state.horizon)
    state.crowd[:] = 0


@kernel
def schedule(state, i, tick):
    """Schedule robot i's next step for a tick, unless it is beyond the horizon."""
    if tick < state.horizon:
        state.link[i] = state.calendar[tick]
        state.calendar[tick] = i + 1


@kernel
def go_on(view, state, tick):
    """Replay a tick: first all arrivals, then all next steps."""
    i = state.calendar[tick] - 1
    while i >= 0:
        arrive(view, state, i, tick)
        i = state.link[i] - 1
    i = state.calendar[tick] - 1
    state.calendar[tick] = 0
    while i >= 0:
        following = state.link[i] - 1
        depart(view, state, i, tick)
        i = following


@kernel
def arrive(view, state, i, tick):
    """Move robot i to the end of its last step, or off the floor after the end of its plan."""
    before, zone = state.zone[i], NIL
    if state.step[i] <= state.step_count[i] and state.in_bay[i] != 1:
        zone = zone_of(view.grid, state.place[i], state.travel[i])
    if zone != before:
        if before != NIL:
            state.crowd[before] -= 1
        if zone != NIL:
            state.crowd[zone] += 1
        enter_zone(state, i, zone, tick)


@kernel
def depart(view, state, i, tick):
    """Begin robot i's next step, or end its plan."""
    while state.step[i] < state.step_count[i]:
        ticks = state.in_bay[i] - 1
        if ticks <= 0:
            zone = zone_left(view, state, i)
            others = 0 if zone == NIL else state.crowd[zone] - (1 if zone == state.zone[i] else 0)
            ticks = ticks_of_step(view, state, i, others)
            if state.in_bay[i] and ticks > 1:
                state.in_bay[i] = ticks
                schedule(state, i, tick + 1)
                return
        if ticks:
            state.in_bay[i] = 0
        begin_step(view, state, i)
        if ticks:
            schedule(state, i, tick + ticks)
            return
    if state.step[i] == state.step_count[i]:
        state.step[i] += 1
        schedule(state, i, tick + 1)


@kernel
def next_step(state, i):
    """The next step of robot i: a direction, PICK_STEP or DROP_STEP."""
    return np.int64(state.steps[i, state.step[i]])


@kernel
def zone_left(view, state, i):
    """The zone of the next move, or NIL if the next step is not a move."""
    step = next_step(state, i)
    return zone_of(view.grid, state.place[i], step) if step < PICK_STEP else NIL


@kernel
def ticks_of_step(view, state, i, others):
    """The ticks of robot i's next step with `others` robots in its zone."""
    duration = view.rules.duration[state.robot_type[i]]
    step = next_step(state, i)
    if step >= PICK_STEP:
        return np.int64(duration[ACTION_DROP if step == DROP_STEP else ACTION_PICK])
    if heading_towards(view.grid, state.robot_type[i], step) != state.heading[i]:
        return np.int64(duration[ACTION_TURN])
    own = limited_ticks(view.grid, np.int64(duration[ACTION_MOVE]), state.place[i], step)
    return ticks_of_move(view, own, others)


@kernel
def begin_step(view, state, i):
    """Begin the next step, or the turn before a move in another direction."""
    headings = headings_of(view.grid, state.robot_type[i])
    step, before = next_step(state, i), state.heading[i]
    heading = step & (headings - 1)
    if step < PICK_STEP and heading != before:
        left = headings == 4 and (heading - before) & 3 == 3
        state.heading[i] = (before + (3 if left else 1)) & (headings - 1)
        return
    state.step[i] += 1
    if step < PICK_STEP:
        state.place[i] += view.grid.offset[step]
        state.travel[i] = step
    elif step == PICK_STEP:
        state.robot_type[i] = with_load(view, state.robot_type[i])
    else:
        state.robot_type[i] = without_load(view, state.robot_type[i])


@kernel
def ticks_of_move(view, own, others):
    """The ticks of a move with `others` robots in its zone; `own`: without them."""
    return own * (1 + (others if view.rules.slowdown else 0))


@kernel
def forecast_one(view, workspace, state, i, steps, length):
    """Count robot i with a new route, slowed by all counted robots, whose times do not change."""
    plan_on(view, workspace, state, i, steps, 0, length)
    tick, horizon = state.free[i], state.horizon
    while state.step[i] < state.step_count[i] and tick < horizon:
        zone = zone_of(view.grid, state.place[i], state.travel[i])
        enter_zone(state, i, zone, tick + state.in_bay[i])
        ticks = ticks_of_step(view, state, i, present(state, zone_left(view, state, i), tick))
        if ticks:
            state.in_bay[i] = 0
        begin_step(view, state, i)
        tick += ticks
    if tick < horizon:
        enter_zone(state, i, zone_of(view.grid, state.place[i], state.travel[i]), tick)
    enter_zone(state, i, NIL, min(tick + 1, horizon))


# Forecasts from tasks instead of plans (Bhattathiri, Li & Kuhl).
#
# Known for each robot are the place and time where its task began, its pick-up and its drop-off. The
# robot is predicted on paths of plain A* as if no robot delayed it: at the resulting ticks or, if
# shares are predicted, at any time with the probability ticks in the zone / ticks of the task.


@kernel
def add_task_forecasts(view, workspace, state):
    """Count all robots by their current tasks."""
    for i in range(view.robots.cell.shape[0]):
        state.visit_count[i] = 0
        add_task_forecast(view, workspace, state, i)


@kernel
def add_task_forecast(view, workspace, state, i):
    """Count robot i."""
    if view.robots.order[i] == NIL:
        state.task[i] = 0
        return
    plan_task(view, workspace, state, i)
    if state.shares:
        share_zones(view, state, i, 1)
    else:
        replay_task(view, state, i)


@kernel
def remove_task_forecast(view, state, i):
    """Take robot i out of the forecast."""
    if state.shares == 0:
        forget(state, i)
    elif state.task[i] != 0:
        share_zones(view, state, i, -1)


@kernel
def plan_task(view, workspace, state, i):
    """Plan the whole task of robot i; the plan persists until the task ends."""
    orders, headings, order = view.orders, view.grid.headings, np.int64(view.robots.order[i])
    task = (np.int64(orders.dispatched[order]) << 32) | (order + 1)
    if state.task[i] == task:
        return
    state.task[i] = task
    state.step_count[i] = 0
    if orders.source[order] == NIL:
        return  # no load: its stops are planned one by one
    robot_type = without_load(view, np.int64(view.robots.type[i]))
    origin = np.int64(orders.dispatched_from[order])
    access_cell = pickup_cell(view, robot_type, np.int64(orders.source[order]), origin)
    end = dropoff_cell(view, robot_type, np.int64(orders.target[order]), access_cell)
    if access_cell == NIL or end == NIL:
        return  # a robot of another type drives a part of the path
    heading = np.int64(orders.dispatched_heading[order])
    append_path(view, workspace, state, i, robot_type, origin * headings + heading, access_cell)
    if state.step_count[i] > 0:
        step = np.int64(state.steps[i, state.step_count[i] - 1])
        heading = heading_towards(view.grid, robot_type, step)
    append(state, i, PICK_STEP)
    loaded = with_load(view, robot_type)
    append_path(view, workspace, state, i, loaded, access_cell * headings + heading, end)
    append(state, i, DROP_STEP)


@kernel
def begin_task(view, state, i):
    """Reset robot i to where its task began."""
    order = np.int64(view.robots.order[i])
    state.place[i] = view.orders.dispatched_from[order]
    state.heading[i] = view.orders.dispatched_heading[order]
    state.travel[i] = state.heading[i]
    state.step[i] = 0
    state.in_bay[i] = 0
    state.robot_type[i] = without_load(view, np.int64(view.robots.type[i]))


@kernel
def replay_task(view, state, i):
    """Count robot i's visits from now on, as if no robot ever delayed it."""
    begin_task(view, state, i)
    state.zone[i] = NIL
    state.since[i] = 0
    tick = np.int64(view.orders.dispatched[view.robots.order[i]]) - view.clock.tick
    while state.step[i] < state.step_count[i] and tick < state.horizon:
        zone = zone_of(view.grid, state.place[i], state.travel[i])
        enter_zone(state, i, zone, max(tick, 0))
        tick += ticks_of_step(view, state, i, 0)
        begin_step(view, state, i)
    enter_zone(state, i, NIL, min(max(tick, 0), state.horizon))


@kernel
def share_zones(view, state, i, sign):
    """Add robot i's shares of time in zones to the totals, or subtract them (sign -1).

    A task of 0 ticks, such as a pick and a drop of 0 ticks in the robot's cell, has no shares.
    """
    begin_task(view, state, i)
    ticks = 0
    while state.step[i] < state.step_count[i]:
        ticks += ticks_of_step(view, state, i, 0)
        begin_step(view, state, i)
    if ticks == 0:
        return
    begin_task(view, state, i)
    while state.step[i] < state.step_count[i]:
        zone = zone_of(view.grid, state.place[i], state.travel[i])
        began = ticks_of_step(view, state, i, 0)
        if zone != NIL:
            state.zone_share[zone] += sign * (began * FULL_SHARE // ticks)
        begin_step(view, state, i)
