"""Priority inheritance: a robot takes the best option that is left, and whoever is there makes way."""

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL
from automaton.strategy.kernels import kernel
from strategies.right_of_way.pibt.options import (
    holder_of,
    is_lane_free,
    resource_in,
    turns_to,
    waits_in_vain_to_turn,
)
from strategies.right_of_way.pibt.pibt_state import DECIDED, STAY, UNDECIDED


@kernel
def reserve(view, state, resource, i):
    if resource != NIL:
        state.reserved[resource] = (view.clock[CLOCK_TICK] << 32) | i


@kernel
def reserver_of(view, state, resource):
    """Who has reserved a resource in this tick, or NIL."""
    if resource == NIL:
        return np.int64(NIL)
    word = state.reserved[resource]
    return word & 0xFFFFFFFF if word >> 32 == view.clock[CLOCK_TICK] else np.int64(NIL)


@kernel
def own_resource(view, i):
    return resource_in(view, np.int64(view.robots.cell[i]), np.int64(view.robots.travel[i]))


@kernel
def may_enter(view, state, i, cell):
    """Whether robot i may enter a cell as far as dead ends go: alone, and with a goal inside."""
    dead_end = np.int64(state.dead_end[cell])
    if dead_end == NIL or state.dead_end[view.robots.cell[i]] == dead_end:
        return True
    goal = np.int64(view.robots.goal_cell[i])
    return goal != NIL and state.dead_end[goal] == dead_end and state.tenants[dead_end] == 0


@kernel
def would_swap(view, state, i, to, holder):
    """Whether robot i and one that comes from that cell into its own would meet on the edge."""
    cell = np.int64(view.robots.cell[i])
    if holder != NIL and state.mode[holder] != UNDECIDED and state.next[holder] == cell:
        return True
    comer = reserver_of(view, state, own_resource(view, i))
    return comer != NIL and comer != i and view.robots.cell[comer] == to


@kernel
def push(view, state, first):
    """Decide robot `first`, and those whom it pushes; returns whether it got an option of its own.

    A chain of pushes is as long as the fleet, so the stack is explicit.
    """
    state.stack[0] = first
    state.mode[first] = DECIDED
    depth = 1
    while depth:
        i = np.int64(state.stack[depth - 1])
        pushed = take_option(view, state, i)
        if pushed == SETTLED:
            return True
        if pushed == FAILED:
            stay(view, state, i)
            depth -= 1
        else:
            state.mode[pushed] = DECIDED
            state.stack[depth] = pushed
            depth += 1
    return False


SETTLED = -1  # results of take_option, beside the robot that has to make way
FAILED = -2


@kernel
def stay(view, state, i):
    state.next[i] = view.robots.cell[i]
    reserve(view, state, own_resource(view, i), i)


@kernel
def take_option(view, state, i):
    """Reserve the next option of robot i that is left; returns the robot to push, SETTLED or FAILED."""
    cell, heading = np.int64(view.robots.cell[i]), np.int64(view.robots.heading[i])
    must_turn = False  # for what it likes better than to stay
    while state.option_next[i] < state.option_count[i]:
        option = np.int64(state.options[i, state.option_next[i]])
        state.option_next[i] += 1
        if option == STAY:
            if must_turn and waits_in_vain_to_turn(view, state, i):
                continue
            comer = reserver_of(view, state, own_resource(view, i))
            if comer == NIL or comer == i:
                stay(view, state, i)
                return SETTLED
            continue
        if turns_to(view.grid.headings, heading, option) and not is_lane_free(view, state, i):
            must_turn = True
            continue
        to = cell + view.grid.offset[option]
        resource = resource_in(view, to, option)
        other = reserver_of(view, state, resource)
        if other != NIL and other != i:
            continue
        holder = holder_of(view, to, option)
        if would_swap(view, state, i, to, holder) or not may_enter(view, state, i, to):
            continue
        reserve(view, state, resource, i)
        state.next[i] = to
        if holder != NIL and holder != i and state.mode[holder] == UNDECIDED:
            return holder
        return SETTLED
    return FAILED
