"""Which operations are open to a robot, what each costs it, and whose turn comes first.

    cost = 1024 (cost from the pose at its end to the goal cell) + rank
    cost = -1024 (D - d) + rank   where the goal cell is reached after d + 1 actions

The rank is lower the earlier the robot goes forward. A robot without a goal would rather wait.
"""

import numpy as np

from automaton.engine.state import CLOCK_TICK, GOAL_NONE, NIL
from automaton.strategy.kernels import kernel
from strategies.right_of_way.epibt.lattice_distances import (
    FAR,
    distance_from,
    least_distance,
    row_to,
)

COST_SHIFT = 10
CANDIDATE_BITS = 8  # below a cost in a key
CANDIDATE_MASK = 255
DIGIT_BITS = 11  # of keys that are sorted
LAST_KEY = (1 << 2 * DIGIT_BITS) - 1
_1 = np.uint64(1)


@kernel
def rank_candidates(view, workspace, state, i):
    """Enter the keys of all operations that are open to robot i, and the cost of its plan."""
    goal, row = goal_of(view, workspace, state, i)
    pose = np.int64(state.pose[i])
    state.key_count[i] = 0
    state.sorted_count[i] = 0
    state.cost[i] = plan_cost(state, i, pose, goal, row)
    state.sequence_key[i] = LAST_KEY
    is_near = False
    if goal != NIL:
        heading = pose & 3
        least = least_distance(state.tables, row, pose >> 2)
        is_near = least <= 3 * state.depth  # a move costs 3 at most
        way = distance_from(state.tables, row, pose >> 2, heading)
        state.sequence_key[i] = min(way * state.cost_unit, LAST_KEY - 1)
    if state.oldest_first and goal != NIL:
        age = view.clock[CLOCK_TICK] - state.idle_since[i]
        state.sequence_key[i] = max(LAST_KEY - 1 - age, 0)
    enter_keys(state, i, np.int64(view.robots.type[i]), pose, goal, row, is_near)


@kernel
def goal_of(view, workspace, state, i):
    """Return the goal cell of robot i and the row of distances to it; NIL if it has none."""
    robots = view.robots
    goal = np.int64(robots.goal_cell[i])
    if goal == NIL or robots.goal_type[i] == GOAL_NONE:
        return np.int64(NIL), np.int64(NIL)
    tick = view.clock[CLOCK_TICK]
    robot_type = np.int64(robots.type[i])
    row = row_to(view.grid, workspace.stop, state.tables, robot_type, goal, tick)
    if row == NIL or least_distance(state.tables, row, np.int64(state.pose[i]) >> 2) >= FAR:
        return np.int64(NIL), np.int64(NIL)
    return goal, row


@kernel
def plan_cost(state, i, pose, goal, row):
    """Return what the plan of robot i costs, whatever class it is."""
    plan = np.int64(state.plan[i])
    rank = state.following.shape[0] - 1 - plan
    if goal == NIL:
        return plan
    cost = cost_if_reached(state, plan, pose, goal)
    if cost >= 0:
        end = (pose >> 2) + np.int64(state.offset[pose & 3, plan, state.depth - 1])
        heading = (pose + np.int64(state.turned[plan])) & 3
        cost = distance_from(state.tables, row, end, heading) * state.cost_unit
    return (cost << COST_SHIFT) + rank


@kernel
def cost_if_reached(state, operation, pose, goal):
    """Return -(D - d) for an operation that reaches the goal cell after d + 1 actions, else 0."""
    to_goal = goal - (pose >> 2)
    for tick in range(state.depth):
        if state.offset[pose & 3, operation, tick] == to_goal:
            return tick - state.depth
    return np.int64(0)


@kernel
def enter_keys(state, i, robot_type, pose, goal, row, is_near):
    """Enter the keys of the operations that are open to robot i; those with one end share its cost."""
    keys, count = state.key[i], 0
    cost, end = np.int64(0), np.int64(NIL)
    last_class = state.following.shape[0] - 1
    for number in range(state.candidate.shape[0]):
        if (state.open[robot_type, pose, number >> 6] >> np.uint64(number & 63)) & _1 == 0:
            continue
        operation = np.int64(state.candidate[number])
        rank = last_class - operation
        if goal == NIL:
            rank = operation
        elif state.candidate_end[number] != end:
            end = np.int64(state.candidate_end[number])
            cell = (pose >> 2) + np.int64(state.offset[pose & 3, operation, state.depth - 1])
            heading = (pose + np.int64(state.turned[operation])) & 3
            cost = distance_from(state.tables, row, cell, heading) * state.cost_unit
        reached = cost_if_reached(state, operation, pose, goal) if is_near else 0
        total = ((reached if reached else cost) << COST_SHIFT) + rank
        keys[count] = total << CANDIDATE_BITS | number
        count += 1
    state.key_count[i] = count


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
