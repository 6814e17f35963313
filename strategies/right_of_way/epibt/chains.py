"""Chains: a robot takes the best operation that pushes at most one other robot, which then does the same.

    build(r): take r's path out; for each operation, best first:
        it meets no path      enter it, the chain is accepted
        it meets two robots   try the next one
        it meets one, u       try the next one if u may not be pushed;
                              else take u out, enter r's, build(u); if that fails, undo, try the next one
    no operation is left: the old plan again, it has failed

u may not be pushed if it is fixed, if its plan was settled in this round, if it was visited too often,
or if its turn comes before that of the root. Two paths meet where they are in one cell after as many
ticks, or exchange two cells in one. A chain can have all robots, so its stack is explicit.
"""

import numpy as np

from automaton.engine.state import NIL
from automaton.strategy.kernels import kernel
from strategies.right_of_way.epibt.candidates import (
    CANDIDATE_BITS,
    CANDIDATE_MASK,
    nth_key,
)
from strategies.right_of_way.epibt.paths import cell_after, cell_held, enter_path

FREE = -2  # an operation meets no robot
SEVERAL = -3  # it meets more than one


@kernel
def robot_met(state, i, operation):
    """Return the one robot whose path an operation of robot i meets, FREE or SEVERAL."""
    occupied = state.occupied
    met = np.int64(FREE)
    before = np.int64(state.pose[i]) >> 2
    for tick in range(state.ticks):
        cell = cell_after(state, i, operation, tick)
        holder = np.int64(occupied[cell, tick])
        if holder != NIL and holder != met:
            if met != FREE:
                return np.int64(SEVERAL)
            met = holder
        if state.holds_two:
            holder = np.int64(occupied[cell_held(state, i, operation, tick), tick])
            if holder != NIL and holder != met:
                if met != FREE:
                    return np.int64(SEVERAL)
                met = holder
        if cell != before:
            other = np.int64(occupied[before, tick])
            if other != NIL and other != met and is_coming_from(state, other, cell, tick):
                if met != FREE:
                    return np.int64(SEVERAL)
                met = other
        before = cell
    return met


@kernel
def is_coming_from(state, robot, cell, tick):
    """Return whether a robot is in a cell before what it does in a tick from now."""
    if tick == 0:
        return np.int64(state.pose[robot]) >> 2 == cell
    return state.occupied[cell, tick - 1] == robot


@kernel
def may_push(state, root, u, repairs):
    """Return whether the chain of `root` may push robot u."""
    stamp = state.stamp[0]
    if state.is_fixed[u] or state.settled[u] == stamp:
        return False
    if state.visit_stamp[u] == stamp and state.visits[u] >= state.visits_allowed:
        return False
    return repairs or state.sequence_key[u] > state.sequence_key[root]


@kernel
def try_operations(state, root, top, repairs):
    """Try the next operations of the last robot of the chain; it has one, or NIL is returned.

    Returns FREE if it meets no robot, else the robot that it pushes.
    """
    i = np.int64(state.chain_robot[top])
    tried = np.int64(state.chain_tried[top])
    while tried < state.key_count[i]:
        key = nth_key(state, i, tried)
        tried += 1
        operation = np.int64(state.candidate[key & CANDIDATE_MASK])
        met = robot_met(state, i, operation)
        if met == SEVERAL or (met != FREE and not may_push(state, root, met, repairs)):
            continue
        state.plan[i] = operation
        state.chain_cost[top] = key >> CANDIDATE_BITS
        state.chain_tried[top] = tried
        return met
    return np.int64(NIL)


@kernel
def append_to_chain(state, top, i):
    """Robot i, whose path has been taken out, comes next in the chain."""
    stamp = state.stamp[0]
    state.chain_robot[top] = i
    state.chain_tried[top] = 0
    state.chain_plan[top] = state.plan[i]
    if state.visit_stamp[i] != stamp:
        state.visit_stamp[i] = stamp
        state.visits[i] = 0
    state.visits[i] += 1
    state.settled[i] = stamp


@kernel
def build(state, root, repairs):
    """Return whether robot `root`, and all that it pushes, have new plans; if not, all keep theirs.

    `repairs`: any robot may be pushed, and the plans must become better on the whole.
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
        if met == FREE:
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
def is_better(state, top):
    """Return whether the new plans of a chain cost no more on the whole, by the power of its robots."""
    gain = 0
    for k in range(top + 1):
        i = state.chain_robot[k]
        gain += state.power[i] * (state.cost[i] - state.chain_cost[k])
    return gain >= 0


@kernel
def undo(state, top):
    """Give all robots of a chain their old plans; the path of the last one is out."""
    for k in range(top):
        enter_path(state, np.int64(state.chain_robot[k]), NIL)
    for k in range(top + 1):
        i = np.int64(state.chain_robot[k])
        state.plan[i] = state.chain_plan[k]
        state.settled[i] = 0
        enter_path(state, i, i)
