"""Which operations are open to a robot, what each costs it, and whose turn comes first.

    cost = 1024 (way from the pose at its end - way from where it is) + rank
    cost = 1024 (t - T - way from where it is) + rank   where it reaches the goal in t + 1 ticks

The rank is lower the earlier the robot goes forward. A robot without a goal would rather wait; one
that is in the way of another would rather end in another cell.
"""

import numpy as np

from automaton.engine.facilities import NO_WAY_THROUGH
from automaton.engine.state import CLOCK_TICK, GOAL_NONE, GOAL_PARK, NIL
from automaton.strategy.kernels import (
    UNREACHABLE,
    cost_in,
    gate_before,
    has_room,
    is_in_full_gate,
    kernel,
    splitmix64,
    table_of,
    weighted_table_of,
    with_load,
)
from strategies.right_of_way.arrivals import comes_to_charge, lacks_charge
from strategies.right_of_way.deadlocks import steps_aside
from strategies.right_of_way.epibt.epibt_state import NO_AIM
from strategies.right_of_way.epibt.operations import FORWARD
from strategies.right_of_way.epibt.paths import cell_after
from strategies.right_of_way.making_room import may_not_go_home, way_to_make_room

COST_SHIFT = 10
MAX_EXCESS = 4000  # of a way over another one: keys have 32 bits
CANDIDATE_BITS = 8  # below a cost in a key
CANDIDATE_MASK = 255
DIGIT_BITS = 11  # of keys that are sorted
LAST_KEY = (1 << 2 * DIGIT_BITS) - 1
FIRST_IDLE_KEY = LAST_KEY // 2  # of robots on their way home, who come after all with work
_1 = np.uint64(1)


@kernel
def rank_candidates(view, workspace, state, i, stall):
    """Enter the keys of all operations that are open to robot i, the cost of its plan, and its turn.

    In a stall (deadlocks) the oldest come first; then turns are drawn, others for each of its rounds.
    """
    goal, row = goal_of(view, workspace, state, i)
    pose = np.int64(state.pose[i])
    way = cost_from(workspace, state, row, pose) if goal != NIL else np.int64(0)
    state.cost[i] = plan_cost(workspace, state, i, goal, row, way)
    waits = is_kept(view, state, i)
    enter_keys(view, workspace, state, i, goal, row, way, waits)
    state.sorted_count[i] = 0
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
        state.sequence_key[i] = min(FIRST_IDLE_KEY + way, LAST_KEY - 2)
    elif stall > 1:
        number = np.uint64(stall << 32 | np.int64(view.robots.identity[i]))
        draw = splitmix64(np.uint64(view.rules.seed) ^ number)
        state.sequence_key[i] = np.int64(draw % np.uint64(FIRST_IDLE_KEY))
    elif state.oldest_first or stall:
        age = view.clock[CLOCK_TICK] - state.idle_since[i]
        state.sequence_key[i] = max(FIRST_IDLE_KEY - 1 - age, 0)
    else:
        state.sequence_key[i] = min(way, FIRST_IDLE_KEY - 1)
    if goal != NIL and (state.has_storage or stall):
        turn_at_pockets(state, i, goal)


@kernel
def turn_at_pockets(state, i, goal):
    """Who leaves a pocket comes first, and who wants into one that is taken comes last.

    Else a robot that waits before a charger, which is very near to its goal, would keep the one in it
    from coming out, and all those behind it from passing.
    """
    cell = np.int64(state.pose[i]) >> 2
    holder = np.int64(state.occupied[goal, 0])
    if state.is_pocket[cell] and cell != goal:
        state.sequence_key[i] = 0
    elif state.is_pocket[goal] and holder != NIL and holder != i:
        state.sequence_key[i] = LAST_KEY - 1


@kernel
def is_kept(view, state, i):
    """Return whether a gate keeps robot i out of the cell ahead, its battery, or a charger that is held.

    Where moves take one tick robots are sent all the same, and may be refused.
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
    """Return whether the best operation of robot i goes on ahead, if it waits for that."""
    if state.key_count[i] == 0:
        return False
    return state.aim[state.candidate[nth_key(state, i, 0) & CANDIDATE_MASK]] == 0


@kernel
def way_out_of(view, state, i):
    """Return the direction in which robot i, without work, makes room for others, or NIL."""
    return way_to_make_room(view, state.service_areas, i, np.int64(state.pose[i]) >> 2)


@kernel
def goal_of(view, workspace, state, i):
    """Return the goal cell of robot i and the row of distances to it; NIL if it has none.

    A robot that makes room goes to the next cell on its way out.
    """
    robots = view.robots
    goal, way_out = np.int64(robots.goal_cell[i]), way_out_of(view, state, i)
    if way_out != NIL:
        goal = (np.int64(state.pose[i]) >> 2) + view.grid.offset[way_out]
    elif goal == NIL or robots.goal_type[i] == GOAL_NONE:
        return np.int64(NIL), np.int64(NIL)
    elif may_not_go_home(view, state.service_areas, i):
        return np.int64(NIL), np.int64(NIL)
    robot_type = np.int64(robots.type[i])
    if state.guided:
        row = weighted_table_of(view, state.tables, robot_type, goal)
    else:
        if state.has_storage:  # which no way leads through
            robot_type = with_load(view, robot_type)
        row = table_of(view, workspace, robot_type, goal)
    if row == NIL or cost_from(workspace, state, row, np.int64(state.pose[i])) >= UNREACHABLE:
        return np.int64(NIL), np.int64(NIL)
    return goal, row


@kernel
def cost_from(workspace, state, row, pose):
    """Return the cost from a pose to the goal cell of a table."""
    if state.guided:
        return cost_in(state.tables, row, pose >> 2, pose & 3)
    return cost_in(workspace.tables, row, pose >> 2, pose & 3)


@kernel
def end_of(state, i, operation):
    """Return the pose in which an operation of robot i ends."""
    pose = np.int64(state.pose[i])
    last = state.ticks - 1
    cell = (pose >> 2) + np.int64(state.offset[state.row[i], operation, last])
    return cell * 4 + ((pose + np.int64(state.turned[operation])) & 3)


@kernel
def cost_beyond(workspace, state, row, pose, way):
    """Return what the cost from a pose exceeds the way from where the robot is, within bounds."""
    return min(max(cost_from(workspace, state, row, pose) - way, -MAX_EXCESS), MAX_EXCESS)


@kernel
def plan_cost(workspace, state, i, goal, row, way):
    """Return what the plan of robot i costs, whatever class it is."""
    plan = np.int64(state.plan[i])
    if state.asked[i]:
        cost = np.int64(end_of(state, i, plan) >> 2 == state.pose[i] >> 2)
        return (cost << COST_SHIFT) + state.following.shape[0] - 1 - plan
    if goal == NIL:
        return plan
    ticks = ticks_to_goal(state, i, plan, goal)
    if ticks:
        cost = ticks - state.ticks - 1 - way
    else:
        cost = cost_beyond(workspace, state, row, end_of(state, i, plan), way)
    return (cost << COST_SHIFT) + state.following.shape[0] - 1 - plan


@kernel
def ticks_to_goal(state, i, operation, goal):
    """Return after how many ticks an operation of robot i reaches the goal cell; 0: it does not."""
    for tick in range(state.ticks):
        if cell_after(state, i, operation, tick) == goal:
            return tick + 1
    return np.int64(0)


@kernel
def enter_keys(view, workspace, state, i, goal, row, way, waits):
    """Enter the keys of the operations that are open to robot i; those with one end share its cost.

    `waits`: it cannot go forward in this tick.
    """
    robot_type, pose = np.int64(view.robots.type[i]), np.int64(state.pose[i])
    keys, count = state.key[i], 0
    is_to_leave = steps_aside(view, state.deadlocks, i)
    cost, end = np.int64(0), np.int64(NIL)
    last_class = state.following.shape[0] - 1
    is_near = goal != NIL and way <= state.reach
    barred = np.int64(state.deadlocks.aside[i]) - 1 if is_to_leave else np.int64(NIL)
    for number in range(state.candidate.shape[0]):
        if (state.open[robot_type, pose, number >> 6] >> np.uint64(number & 63)) & _1 == 0:
            continue
        operation = np.int64(state.candidate[number])
        if waits and state.action[operation] == FORWARD:
            continue
        if barred != NIL and stays_or_goes(state, i, operation, barred):
            continue
        rank = operation if goal == NIL and not state.asked[i] else last_class - operation
        if state.asked[i]:
            cost = np.int64(end_of(state, i, operation) >> 2 == pose >> 2)
        if state.has_storage and ends_in_storage(view, state, i, operation, goal):
            continue
        if goal != NIL and state.candidate_end[number] != end:
            end = np.int64(state.candidate_end[number])
            cost = cost_beyond(workspace, state, row, end_of(state, i, operation), way)
        ticks = ticks_to_goal(state, i, operation, goal) if is_near else 0
        excess = ticks - state.ticks - 1 - way if ticks else cost
        keys[count] = ((excess << COST_SHIFT) + rank) << CANDIDATE_BITS | number
        count += 1
    state.key_count[i] = count


@kernel
def stays_or_goes(state, i, operation, direction):
    """Return whether an operation of robot i ends where it stands, or first goes in a direction."""
    pose, aim = np.int64(state.pose[i]), np.int64(state.aim[operation])
    return end_of(state, i, operation) >> 2 == pose >> 2 or (pose + aim) & 3 == direction


@kernel
def ends_in_storage(view, state, i, operation, goal):
    """Return whether an operation takes robot i into storage that is not its goal."""
    cell, grid = end_of(state, i, operation) >> 2, view.grid
    if cell == goal or cell == state.pose[i] >> 2:
        return False
    robot_type = with_load(view, np.int64(view.robots.type[i]))
    return np.int64(grid.type_cell_flags[robot_type, cell]) & NO_WAY_THROUGH != 0


@kernel
def ask_idle_robot_ahead(view, state, i, asked):
    """Put an idle robot in the cell that robot i would like to enter on the list of those asked.

    Returns the length of that list, `chain_robot`.
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
    """Return the n-th lowest key of robot i; its keys are sorted as far as they are asked for."""
    if n < state.sorted_count[i]:
        return np.int64(state.key[i, n])
    keys = state.key[i]
    best, lowest = n, keys[n]
    for k in range(n + 1, state.key_count[i]):
        if keys[k] < lowest:
            best, lowest = k, keys[k]
    keys[best] = keys[n]
    keys[n] = lowest
    state.sorted_count[i] = n + 1
    return np.int64(lowest)


@kernel
def sort_by_key(state, count):
    """Write the steered robots into `sequence` by ascending key, ties by identity."""
    sort_by_digit(state, count, state.steered, state.sorting, 0)
    sort_by_digit(state, count, state.sorting, state.sequence, DIGIT_BITS)


@kernel
def settle_ties(state, count):
    """Make the places of robots with goals their keys, so that no two are alike."""
    for place in range(count):
        i = np.int64(state.sequence[place])
        if state.sequence_key[i] != LAST_KEY:
            state.sequence_key[i] = place


@kernel
def sort_by_digit(state, count, unsorted, out, shift):
    """Sort robots by one digit of their keys; equal ones stay in their order."""
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
