"""The operations open to a robot, their costs, the order of robots, and chains of pushes.

    cost = 1024 (path length from its final pose - path length from the current pose) + rank
    cost = 1024 (t - T - path length from the current pose) + rank   if it reaches the goal in t + 1 ticks

The rank is lower the earlier the robot goes forward. A robot without a goal prefers to wait; one that
blocks another robot prefers to end in another cell.
"""

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    ACTION_TURN,
    GOAL_NONE,
    GOAL_PARK,
    NIL,
    NO_WAY_THROUGH,
    UNREACHABLE,
    cost_in,
    cost_unit,
    distance,
    dropoff_cell,
    end_of_stops,
    fetch_costs,
    gate_before,
    guiding_table_of,
    guiding_tables,
    has_room,
    is_in_full_gate,
    kernel,
    limited_ticks,
    lowest_bit,
    splitmix64,
    weighted_table_of,
    with_load,
)
from strategies.right_of_way.epibt.epibt_state import (
    FORWARD,
    KEY_RANGE,
    NO_AIM,
    RIGHT,
    WAIT,
    U,
    cell_after,
    cell_held,
    enter_path,
)
from strategies.right_of_way.steering import (
    comes_to_charge,
    lacks_charge,
    may_not_go_home,
    steps_aside,
    way_to_make_room,
)

COST_SHIFT = 10
MAX_EXCESS = KEY_RANGE  # limit of the extra length of a path: keys have 32 bits
CANDIDATE_BITS = 8  # bits below the cost in a key
CANDIDATE_MASK = 255
DIGIT_BITS = 11  # of sorted keys
LAST_KEY = (1 << 2 * DIGIT_BITS) - 1
FIRST_IDLE_KEY = LAST_KEY // 2  # of robots that drive home, which come after all robots with work
WORK_KEY = FIRST_IDLE_KEY // 2  # of robots with work, which come after all starved robots
MEETS_NONE = -2  # an operation meets no robot
MEETS_SEVERAL = -3  # it meets more than one


@kernel
def rank_candidates(view, workspace, state, i, stall):
    """Set the keys of all operations open to robot i, the cost of its plan, and its place in the order.

    In a stall (deadlocks) the oldest come first; later rounds of the stall use random orders.
    """
    goal, row = np.int64(state.goal[i]), np.int64(state.table[i])
    pose, way = np.int64(state.pose[i]), np.int64(0)
    if goal != NIL:
        way = cost_from(workspace, state, row, pose)
        if way >= UNREACHABLE:
            goal, row, way = np.int64(NIL), np.int64(NIL), np.int64(0)
    if state.repair_tries:
        state.cost[i] = plan_cost(view, workspace, state, i, goal, row, way)
    waits = is_kept(view, state, i)
    enter_keys(view, workspace, state, i, goal, row, way, waits)
    if state.asked[i]:
        state.sequence_key[i] = LAST_KEY - 1
    elif goal == NIL or (waits and wants_ahead(state, i)):
        state.sequence_key[i] = LAST_KEY
    elif (
        (is_in_full_gate(view, pose >> 2) and stall == 0)
        or state.deadlocks.aside[i]
        or way_out_of(view, state, i) != NIL
    ):
        state.sequence_key[i] = 0
    elif view.robots.goal_type[i] == GOAL_PARK:
        state.sequence_key[i] = min(FIRST_IDLE_KEY + way // cost_unit(view.grid), LAST_KEY - 2)
    elif stall > 1:
        number = np.uint64(stall << 32 | np.int64(view.robots.identity[i]))
        draw = splitmix64(np.uint64(view.rules.seed) ^ number)
        state.sequence_key[i] = np.int64(draw % np.uint64(FIRST_IDLE_KEY))
    elif state.oldest_first or stall or is_starved(view, state, i):
        age = view.clock.tick - state.idle_since[i]
        last = FIRST_IDLE_KEY if state.starved_after == NIL or stall else WORK_KEY
        state.sequence_key[i] = max(last - 1 - age, 0)
    else:
        ticks = way // cost_unit(view.grid)
        state.sequence_key[i] = min(WORK_KEY + ticks + state.rest[i], FIRST_IDLE_KEY - 1)
    if goal != NIL and (state.has_storage or stall):
        turn_at_pockets(state, i, goal)


@kernel
def is_starved(view, state, i):
    """Return whether robot i has finished no goal for `starved_after` ticks."""
    if state.starved_after == NIL:
        return False
    return view.clock.tick - state.idle_since[i] >= state.starved_after


@kernel
def rest_of_order(view, workspace, i, order):
    """Return the least ticks of an order of robot i after its goal: stop by stop, to the target.

    On the empty floor, with the best heading in each cell, without work in these cells.
    """
    robots, orders = view.robots, view.orders
    here, rest = np.int64(robots.goal_cell[i]), np.int64(0)
    if order == NIL or here == NIL:
        return rest
    robot_type = np.int64(robots.type[i])
    first = np.int64(orders.first_stop[order]) + np.int64(orders.stops_done[order])
    for stop in range(first, end_of_stops(view, order)):
        cell = np.int64(view.stops.cell[stop])
        rest += leg_ticks(view, workspace, robot_type, here, cell)
        here = cell
    if orders.target[order] != NIL:
        cell = np.int64(dropoff_cell(view, robot_type, np.int64(orders.target[order]), here))
        rest += leg_ticks(view, workspace, robot_type, here, cell)
    return rest


@kernel
def leg_ticks(view, workspace, robot_type, here, there):
    """Return the ticks from a cell to another one with the best heading; 0: there is no path."""
    if there == NIL or there == here:
        return np.int64(0)
    robot_type, least = with_load(view, robot_type), np.int64(UNREACHABLE)
    for heading in range(view.grid.headings):
        least = min(least, distance(view, workspace, robot_type, here, heading, there))
    return least if least < UNREACHABLE else np.int64(0)


@kernel
def turn_at_pockets(state, i, goal):
    """Robots that leave a pocket come first; robots that want to enter an occupied one come last.

    Otherwise a robot that waits for a charger, since it is very near to its goal, would block the exit
    of the robot in it, and the path of all robots behind.
    """
    cell = np.int64(state.pose[i]) >> 2
    holder = np.int64(state.occupied[goal, 0])
    if state.is_pocket[cell] and cell != goal:
        state.sequence_key[i] = 0
    elif state.is_pocket[goal] and holder != NIL and holder != i:
        state.sequence_key[i] = LAST_KEY - 1


@kernel
def is_kept(view, state, i):
    """Return whether a gate, its battery or an occupied charger keeps robot i out of the cell ahead.

    If moves take one tick, robots are sent anyway, and the world may refuse the move.
    """
    pose = np.int64(state.pose[i])
    ahead = (pose >> 2) + view.grid.offset[pose & 3]
    if gate_before(view, i, ahead) != NIL:
        return True
    if state.slow_moves == 0 or view.rules.battery == 0 or state.delay[i]:
        return False
    is_held = comes_to_charge(view, i, ahead) and not has_room(
        view.traffic.occupancy, ahead, pose & 3
    )
    return is_held or lacks_charge(view, i)


@kernel
def wants_ahead(state, i):
    """Return whether the best operation of robot i moves straight ahead, possibly after waits."""
    if state.key_count[i] == 0:
        return False
    return state.aim[state.candidate[nth_key(state, i, 0) & CANDIDATE_MASK]] == 0


@kernel
def way_out_of(view, state, i):
    """Return the direction in which idle robot i makes room for others, or NIL."""
    return way_to_make_room(view, state.service_areas, i, np.int64(state.pose[i]) >> 2)


@kernel
def find_goal(view, workspace, state, i):
    """Set the goal cell of robot i and the row of its distance table; NIL if it has no goal.

    A robot that makes room has the next cell on its path out as its goal.
    """
    robots = view.robots
    state.goal[i], state.table[i] = NIL, NIL
    goal, way_out = np.int64(robots.goal_cell[i]), way_out_of(view, state, i)
    if way_out != NIL:
        goal = (np.int64(state.pose[i]) >> 2) + view.grid.offset[way_out]
    elif goal == NIL or robots.goal_type[i] == GOAL_NONE:
        return
    elif may_not_go_home(view, state.service_areas, i):
        return
    robot_type = np.int64(robots.type[i])
    if state.guided:
        row = weighted_table_of(view, state.tables, robot_type, goal)
        fetch_costs(state.tables, row, np.int64(state.pose[i]) >> 2)
    else:
        if state.has_storage:  # no path leads through it
            robot_type = with_load(view, robot_type)
        row = guiding_table_of(view, workspace, robot_type, goal)
        fetch_costs(guiding_tables(workspace), row, np.int64(state.pose[i]) >> 2)
    if row != NIL:
        state.goal[i], state.table[i] = goal, row


@kernel
def cost_from(workspace, state, row, pose):
    """Return the cost from a pose to the goal cell of a table."""
    if state.guided:
        return cost_in(state.tables, row, pose >> 2, pose & 3)
    return cost_in(guiding_tables(workspace), row, pose >> 2, pose & 3)


@kernel
def end_of(state, i, operation):
    """Return the pose in which an operation of robot i ends."""
    pose = np.int64(state.pose[U(i)])
    last = state.ticks - 1
    cell = (pose >> 2) + np.int64(state.offset[U(state.row[U(i)]), U(operation), U(last)])
    return cell * 4 + ((pose + np.int64(state.turned[U(operation)])) & 3)


@kernel
def cost_beyond(workspace, state, row, pose, way):
    """Return the cost from a pose minus the cost from the robot's current pose, within bounds."""
    return bounded(state, cost_from(workspace, state, row, pose) - way)


@kernel(inline=True)
def bounded(state, excess):
    """Return an excess cost in the unit of keys, within bounds."""
    if state.grain > 1:
        excess //= state.grain
    return min(max(excess, -MAX_EXCESS), MAX_EXCESS)


@kernel
def street_excess(view, state, i, operation, ticks):
    """Return what weights of streets add to an operation of robot i in its first `ticks` ticks."""
    grid, pose = view.grid, np.int64(state.pose[i])
    cell, heading, used, excess = pose >> 2, pose & 3, np.int64(0), np.int64(0)
    duration = view.rules.duration[view.robots.type[i]]
    for k in range(state.sequence_of.shape[1]):
        action = state.sequence_of[operation, k]
        if used >= ticks:
            break
        if action == FORWARD:
            move = limited_ticks(grid, duration[ACTION_MOVE], cell, heading)
            excess += move * (np.int64(grid.move_weight[4 * cell + heading]) - cost_unit(grid))
            used += move
            cell += grid.offset[heading]
        elif action == WAIT:
            stride = np.int64(view.rules.stride)
            excess += stride * (np.int64(grid.wait_weight[cell]) - cost_unit(grid))
            used += stride
        else:
            heading = (heading + (1 if action == RIGHT else 3)) & 3
            used += np.int64(duration[ACTION_TURN])
    return excess


@kernel
def cost_with_streets(view, workspace, state, i, operation, goal, row, way):
    """Return the cost of an operation of robot i: that of its actions, and of the way from its end."""
    ticks = ticks_to_goal(state, i, operation, goal)
    if ticks:
        excess = street_excess(view, state, i, operation, ticks)
        excess += cost_unit(view.grid) * (ticks - state.ticks - 1)
    else:
        excess = street_excess(view, state, i, operation, state.ticks)
        excess += cost_from(workspace, state, row, end_of(state, i, operation))
    return bounded(state, excess - way)


@kernel
def plan_cost(view, workspace, state, i, goal, row, way):
    """Return the cost of robot i's plan, which may be any class."""
    plan = np.int64(state.plan[i])
    if state.asked[i]:
        cost = np.int64(end_of(state, i, plan) >> 2 == state.pose[i] >> 2)
        return (cost << COST_SHIFT) + state.following.shape[0] - 1 - plan
    if goal == NIL:
        return plan
    ticks = ticks_to_goal(state, i, plan, goal)
    if state.streets:
        cost = cost_with_streets(view, workspace, state, i, plan, goal, row, way)
    elif ticks:
        cost = ticks - state.ticks - 1 - way
    else:
        cost = cost_beyond(workspace, state, row, end_of(state, i, plan), way)
    return (cost << COST_SHIFT) + state.following.shape[0] - 1 - plan


@kernel
def ticks_to_goal(state, i, operation, goal):
    """Return the ticks in which an operation of robot i reaches the goal cell; 0: it does not."""
    for tick in range(state.ticks):
        if cell_after(state, i, operation, tick) == goal:
            return tick + 1
    return np.int64(0)


@kernel
def enter_keys(view, workspace, state, i, goal, row, way, waits):
    """Set the keys of the operations open to robot i; operations with the same end share a cost.

    `waits`: the robot cannot go forward in this tick.
    """
    robot_type, pose = np.int64(view.robots.type[i]), np.int64(state.pose[i])
    keys, count = state.key[i], 0
    is_to_leave = steps_aside(view, state.deadlocks, i)
    cost, end = np.int64(0), np.int64(NIL)
    last_class = state.following.shape[0] - 1
    is_near = goal != NIL and way <= state.reach and state.streets == 0
    barred = np.int64(state.deadlocks.aside[i]) - 1 if is_to_leave else np.int64(NIL)
    for word in range(state.open.shape[2]):
        left = state.open[U(robot_type), U(pose), U(word)]
        while left:
            number = (word << 6) + lowest_bit(left)
            left &= left - np.uint64(1)
            operation = np.int64(state.candidate[U(number)])
            if waits and state.action[U(operation)] == FORWARD:
                continue
            if barred != NIL and stays_or_goes(state, i, operation, barred):
                continue
            rank = operation if goal == NIL and not state.asked[i] else last_class - operation
            if state.asked[i]:
                cost = np.int64(end_of(state, i, operation) >> 2 == pose >> 2)
            if state.has_storage and ends_in_storage(view, state, i, operation, goal):
                continue
            if goal != NIL and state.streets:
                cost = cost_with_streets(view, workspace, state, i, operation, goal, row, way)
            elif goal != NIL and state.candidate_end[U(number)] != end:
                end = np.int64(state.candidate_end[U(number)])
                cost = cost_beyond(workspace, state, row, end_of(state, i, operation), way)
            ticks = ticks_to_goal(state, i, operation, goal) if is_near else 0
            excess = ticks - state.ticks - 1 - way if ticks else cost
            key = ((excess << COST_SHIFT) + rank) << CANDIDATE_BITS | number
            keys[U(count)] = key
            if key < keys[0]:
                keys[U(count)], keys[0] = keys[0], key
            count += 1
    state.key_count[i] = count
    state.sorted_count[i] = min(count, 1)


@kernel
def stays_or_goes(state, i, operation, direction):
    """Return whether an operation of robot i ends in its cell, or first moves in `direction`."""
    pose, aim = np.int64(state.pose[i]), np.int64(state.aim[operation])
    return end_of(state, i, operation) >> 2 == pose >> 2 or (pose + aim) & 3 == direction


@kernel
def ends_in_storage(view, state, i, operation, goal):
    """Return whether an operation moves robot i into storage other than its goal."""
    cell, grid = end_of(state, i, operation) >> 2, view.grid
    if cell == goal or cell == state.pose[i] >> 2:
        return False
    robot_type = with_load(view, np.int64(view.robots.type[i]))
    return np.int64(grid.type_cell_flags[robot_type, cell]) & NO_WAY_THROUGH != 0


@kernel
def ask_idle_robot_ahead(view, state, i, asked):
    """Append an idle robot in the cell that robot i prefers to the list of robots asked to make room.

    Returns the length of this list, `chain_robot`.
    """
    if state.key_count[i] == 0:
        return asked
    best = np.int64(state.candidate[nth_key(state, i, 0) & CANDIDATE_MASK])
    if state.aim[best] == NO_AIM:
        return asked
    pose = np.int64(state.pose[i])
    cell = (pose >> 2) + view.grid.offset[(pose + np.int64(state.aim[best])) & 3]
    u = np.int64(state.occupied[cell, 0])
    if u == NIL or u == i or state.is_fixed[u] or state.asked[u]:
        return asked
    if view.robots.goal_type[u] != GOAL_NONE or state.sequence_key[u] != LAST_KEY:
        return asked
    state.asked[u] = 1
    state.chain_robot[asked] = u
    return asked + 1


@kernel
def nth_key(state, i, n):
    """Return the n-th lowest key of robot i; keys are sorted only as far as requested."""
    if n < state.sorted_count[U(i)]:
        return np.int64(state.key[U(i), U(n)])
    keys = state.key[i]
    best, lowest = n, keys[U(n)]
    for k in range(n + 1, state.key_count[U(i)]):
        if keys[U(k)] < lowest:
            best, lowest = k, keys[U(k)]
    keys[U(best)] = keys[U(n)]
    keys[U(n)] = lowest
    state.sorted_count[i] = n + 1
    return np.int64(lowest)


@kernel
def sort_by_key(state, count):
    """Write the steered robots into `sequence` by ascending key, ties by identity."""
    sort_by_digit(state, count, state.steered, state.sorting, 0)
    sort_by_digit(state, count, state.sorting, state.sequence, DIGIT_BITS)


@kernel
def settle_ties(state, count):
    """Replace the keys of robots with goals by their places, so that all keys differ."""
    for place in range(count):
        i = np.int64(state.sequence[place])
        if state.sequence_key[i] != LAST_KEY:
            state.sequence_key[i] = place


@kernel
def limit_drivers(state, count):
    """Let the robots after the first `drivers` in `sequence` only make room."""
    for place in range(state.drivers, count):
        state.sequence_key[state.sequence[place]] = LAST_KEY


@kernel
def sort_by_digit(state, count, unsorted, out, shift):
    """Sort robots by one digit of their keys (stable)."""
    counts, digits = state.sorting_count, (1 << DIGIT_BITS) - 1
    counts[:] = 0
    for k in range(count):
        counts[(state.sequence_key[unsorted[k]] >> shift) & digits] += 1
    before = 0
    for digit in range(counts.shape[0]):
        before, counts[digit] = before + counts[digit], before
    for k in range(count):
        digit = (state.sequence_key[unsorted[k]] >> shift) & digits
        out[counts[digit]] = unsorted[k]
        counts[digit] += 1


# Chains: a robot takes its best operation that pushes at most one other robot, which does the same.
#
#     build(r): remove r's path; for each operation, best first:
#         it meets no path      add it: the chain succeeds
#         it meets two robots   try the next operation
#         it meets one, u       if u must not be pushed, try the next operation;
#                               else remove u, add r's, build(u); if that fails, undo, try the next
#     no operation left: restore the old plan and fail
#
# u must not be pushed if it is fixed, if its plan was settled in this round, if it was visited too
# often, or if its turn is before the root's. Two paths meet if they are in one cell at the same tick,
# or exchange two cells in a tick. A chain can contain all robots, so its stack is explicit.


@kernel
def build(state, root, repairs):
    """Plan robot `root` and all robots that it pushes; return False if all keep their old plans.

    `repairs`: any robot may be pushed, and the total cost of the plans must fall.
    """
    enter_path(state, root, NIL)
    append_to_chain(state, 0, root)
    top = 0
    pushes = 0
    while True:
        i = np.int64(state.chain_robot[top])
        met = try_operations(state, root, top, repairs)
        if met == NIL:
            state.plan[i] = state.chain_plan[top]
            state.settled[i] = 0
            if top:
                enter_path(state, np.int64(state.chain_robot[top - 1]), NIL)
            enter_path(state, i, i)
            if top == 0:
                return False
            top -= 1
            continue
        if met == MEETS_NONE:
            if repairs and not is_better(state, top):
                undo(state, top)
                return False
            enter_path(state, i, i)
            for k in range(top + 1):
                state.cost[state.chain_robot[k]] = state.chain_cost[k]
            return True
        pushes += 1
        if pushes > (state.repair_pushes if repairs else state.max_pushes):
            undo(state, top)
            return False
        enter_path(state, met, NIL)
        enter_path(state, i, i)
        top += 1
        append_to_chain(state, top, met)


@kernel
def try_operations(state, root, top, repairs):
    """Try the next operations of the last robot of the chain.

    Returns MEETS_NONE if one meets no robot, else the robot that it pushes; NIL if none is left.
    """
    i = np.int64(state.chain_robot[top])
    tried = np.int64(state.chain_tried[top])
    while tried < state.key_count[i]:
        key = nth_key(state, i, tried)
        tried += 1
        operation = np.int64(state.candidate[key & CANDIDATE_MASK])
        met = robot_met(state, i, operation)
        if met == MEETS_SEVERAL or (met != MEETS_NONE and not may_push(state, root, met, repairs)):
            continue
        state.plan[i] = operation
        state.chain_cost[top] = key >> CANDIDATE_BITS
        state.chain_tried[top] = tried
        return met
    return np.int64(NIL)


@kernel
def robot_met(state, i, operation):
    """Return the only robot whose path an operation of robot i meets, MEETS_NONE or MEETS_SEVERAL."""
    occupied = state.occupied
    met = np.int64(MEETS_NONE)
    before = np.int64(state.pose[i]) >> 2
    for tick in range(state.ticks):
        cell = cell_after(state, i, operation, tick)
        holder = np.int64(occupied[U(cell), U(tick)])
        if holder != NIL and holder != met:
            if met != MEETS_NONE:
                return np.int64(MEETS_SEVERAL)
            met = holder
        if state.holds_two:
            holder = np.int64(occupied[U(cell_held(state, i, operation, tick)), U(tick)])
            if holder != NIL and holder != met:
                if met != MEETS_NONE:
                    return np.int64(MEETS_SEVERAL)
                met = holder
        if cell != before:
            other = np.int64(occupied[U(before), U(tick)])
            if other != NIL and other != met and is_coming_from(state, other, cell, tick):
                if met != MEETS_NONE:
                    return np.int64(MEETS_SEVERAL)
                met = other
        before = cell
    return met


@kernel
def is_coming_from(state, robot, cell, tick):
    """Return whether a robot is in a cell before its step at a tick from now."""
    if tick == 0:
        return np.int64(state.pose[U(robot)]) >> 2 == cell
    return state.occupied[U(cell), U(tick - 1)] == robot


@kernel
def may_push(state, root, u, repairs):
    """Return whether the chain of `root` may push robot u."""
    stamp = state.stamp
    if state.is_fixed[U(u)] or state.settled[U(u)] == stamp:
        return False
    if state.visit_stamp[U(u)] == stamp and state.visits[U(u)] >= state.visits_allowed:
        return False
    return repairs or state.sequence_key[U(u)] > state.sequence_key[U(root)]


@kernel
def append_to_chain(state, top, i):
    """Append robot i, whose path is removed, to the chain."""
    stamp = state.stamp
    state.chain_robot[top] = i
    state.chain_tried[top] = 0
    state.chain_plan[top] = state.plan[i]
    if state.visit_stamp[i] != stamp:
        state.visit_stamp[i] = stamp
        state.visits[i] = 0
    state.visits[i] += 1
    state.settled[i] = stamp


@kernel
def is_better(state, top):
    """Return whether the total cost of a chain, weighted by the power of its robots, does not rise."""
    gain = 0
    for k in range(top + 1):
        i = state.chain_robot[k]
        gain += state.power[i] * (state.cost[i] - state.chain_cost[k])
    return gain >= 0


@kernel
def undo(state, top):
    """Restore the old plans of a chain; the path of its last robot is already removed."""
    for k in range(top):
        enter_path(state, np.int64(state.chain_robot[k]), NIL)
    for k in range(top + 1):
        i = np.int64(state.chain_robot[k])
        state.plan[i] = state.chain_plan[k]
        state.settled[i] = 0
        enter_path(state, i, i)
