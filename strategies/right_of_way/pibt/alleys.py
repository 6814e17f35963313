"""Dead ends: who may go in, and who has to come out.

One robot that works is let in at a time, when it is empty; those that are parked there come out for
it. Robots whose homes share a dead end park from its end on: the one with the home farthest in goes
first, and who is parked nearer to the mouth comes out for it.
"""

import numpy as np

from automaton.engine.state import GOAL_NONE, GOAL_PARK, NIL
from automaton.strategy.kernels import kernel
from strategies.right_of_way.pibt.pibt_state import LEAVING, U

DEEPEST = 2**31 - 1


@kernel
def empty_dead_ends(state):
    for e in range(state.tenants.shape[0]):
        state.tenants[e] = 0
        state.drivers[e] = 0
        state.callers[e] = 0
        state.parked_from[e] = DEEPEST
        state.parks_at[e] = 0


@kernel
def count_in_dead_ends(view, state, i):
    """Count robot i in the dead end that it is in, enters, or wants into."""
    robots = view.robots
    cell, goal = np.int64(robots.cell[i]), np.int64(robots.goal_cell[i])
    here = np.int64(state.dead_end[cell])
    if here != NIL:
        state.tenants[here] += 1
        if robots.parked[i]:
            state.parked_from[here] = min(state.parked_from[here], state.depth[cell])
        else:
            state.drivers[here] += 1
    there = np.int64(state.dead_end[state.next[i]]) if state.mode[i] == LEAVING else here
    if there != NIL and there != here:
        state.tenants[there] += 1
        state.drivers[there] += 1
    if robots.goal_type[i] == GOAL_NONE:
        return
    wanted = np.int64(state.dead_end[goal])
    if wanted == NIL or wanted == here:
        return
    if robots.goal_type[i] == GOAL_PARK:
        state.parks_at[wanted] = max(state.parks_at[wanted], state.depth[goal])
    else:
        state.callers[wanted] += 1


@kernel
def has_to_leave(view, state, i):
    """Whether robot i, without work, is in a dead end that others want into, or past its place."""
    robots = view.robots
    goal_type, cell = robots.goal_type[U(i)], np.int64(robots.cell[U(i)])
    if state.dead_ends == 0 or cell == NIL or (goal_type != GOAL_NONE and goal_type != GOAL_PARK):
        return False
    here = np.int64(state.dead_end[cell])
    place = cell if goal_type == GOAL_NONE else np.int64(robots.goal_cell[U(i)])
    if here == NIL or state.dead_end[place] != here:
        return False
    return state.callers[here] > 0 or state.parks_at[here] > state.depth[place]


@kernel
def may_enter(view, state, i, cell):
    """Whether robot i may enter a cell as far as dead ends go: with a goal inside, and at its turn."""
    if state.dead_ends == 0:
        return True
    dead_end = np.int64(state.dead_end[cell])
    if dead_end == NIL or state.dead_end[view.robots.cell[i]] == dead_end:
        return True
    goal = np.int64(view.robots.goal_cell[i])
    if goal == NIL or state.dead_end[goal] != dead_end:
        return False
    if view.robots.goal_type[i] != GOAL_PARK:
        return state.tenants[dead_end] == 0
    depth = state.depth[goal]
    if state.callers[dead_end] or state.drivers[dead_end] or depth < state.parks_at[dead_end]:
        return False
    return state.parked_from[dead_end] >= depth
