"""Priority inheritance: a robot takes the best option that is left, and whoever is there makes way."""

import numpy as np

from automaton.engine.state import NIL
from automaton.strategy.kernels import gate_before, kernel, opens_soon, prefetch
from strategies.right_of_way.arrivals import comes_to_charge
from strategies.right_of_way.pibt.alleys import may_enter
from strategies.right_of_way.pibt.options import (
    option_of,
    turns_to,
    waits_in_vain_to_turn,
)
from strategies.right_of_way.pibt.pibt_state import DECIDED, NO_OPTION, STAY, UNDECIDED, U
from strategies.right_of_way.pibt.reservations import (
    holder_of,
    is_lane_free,
    own_resource,
    reserve,
    reserve_other_lane,
    reserver_of,
    resource_in,
)


@kernel
def fetch_cells(view, state, i):
    """Ask the memory for what is noted of the cell of robot i, and of the one that it likes best."""
    cell, option = np.int64(view.robots.cell[U(i)]), option_of(state, i, 0)
    if cell != NIL and option < STAY:
        to = cell + view.grid.offset[U(option)]
        prefetch(state.reserved, U(cell))
        prefetch(state.reserved, U(to))
        prefetch(view.traffic.holder, U(2 * to))


@kernel
def would_swap(view, state, i, to, holder):
    """Whether robot i and one that comes from that cell into its own would meet on the edge."""
    cell = np.int64(view.robots.cell[U(i)])
    if holder != NIL and state.mode[U(holder)] != UNDECIDED and state.next[U(holder)] == cell:
        return True
    comer = reserver_of(state, own_resource(view, i))
    return comer != NIL and comer != i and view.robots.cell[U(comer)] == to


@kernel
def closes_ring(view, state, i, resource):
    """Whether robot i, by this option, takes what the robot holds whose pushes it makes way for."""
    first = np.int64(state.stack[0])
    return first != i and resource != NIL and resource == own_resource(view, first)


@kernel
def may_rotate(view, state, depth):
    """Whether a ring of all robots on the stack moves, if the last one takes the place of the first.

    It does not where rings do not rotate at all, if a robot in it comes to charge, or if it is to let the
    first step aside. Where all moves take one tick a ring with one that comes to charge is refused.
    """
    if state.rings == 0 or state.deadlocks.aside[U(state.stack[0])]:
        return False
    if state.holds_back and view.chargers.cell.shape[0]:
        for k in range(depth):
            i = np.int64(state.stack[U(k)])
            if comes_to_charge(view, i, state.next[U(i)]):
                return False
    return True


@kernel
def push(view, state, first):
    """Decide robot `first`, and those whom it pushes; returns whether it got an option of its own.

    A chain of pushes is as long as the fleet, so the stack is explicit.
    """
    state.stack[0] = first
    state.mode[first] = DECIDED
    depth = 1
    while depth:
        i = np.int64(state.stack[U(depth - 1)])
        pushed = take_option(view, state, i, depth)
        if pushed == SETTLED:
            return True
        if pushed == FAILED:
            stay(view, state, i)
            depth -= 1
        else:
            state.mode[U(pushed)] = DECIDED
            state.stack[U(depth)] = pushed
            depth += 1
    return False


SETTLED = -1  # results of take_option, beside the robot that has to make way
FAILED = -2


@kernel
def stay(view, state, i):
    state.next[U(i)] = view.robots.cell[U(i)]
    reserve(state, own_resource(view, i), i)


@kernel
def take_option(view, state, i, depth):
    """Reserve the next option of robot i that is left; returns the robot to push, SETTLED or FAILED.

    It is the last of so many robots that push each other.
    """
    cell = np.int64(view.robots.cell[U(i)])
    must_turn = False  # for what it likes better than to stay
    while True:
        place = np.int64(state.option_next[U(i)])
        option = option_of(state, i, place)
        if option == NO_OPTION:
            return FAILED
        state.option_next[U(i)] = place + 1
        if option == STAY:
            if must_turn and waits_in_vain_to_turn(view, state, i):
                continue
            comer = reserver_of(state, own_resource(view, i))
            if comer == NIL or comer == i:
                stay(view, state, i)
                return SETTLED
            continue
        turns = turns_to(view, i, option) > 0
        if turns and not is_lane_free(view, state, i):
            must_turn = True
            continue
        to = cell + view.grid.offset[U(option)]
        gate = gate_before(view, i, to)
        if gate != NIL:  # it asks for the gate, and stays where it is meanwhile
            if state.asks[U(i)] == 0 and (place == 0 or opens_soon(view, gate, i)):
                state.asks[U(i)] = option + 1
            comer = reserver_of(state, own_resource(view, i))
            if comer == NIL or comer == i:
                stay(view, state, i)
                return SETTLED
            continue
        resource = resource_in(view, to, option)
        other = reserver_of(state, resource)
        if other != NIL and other != i:
            continue
        holder = holder_of(view, to, option)
        if would_swap(view, state, i, to, holder) or not may_enter(view, state, i, to):
            continue
        if closes_ring(view, state, i, resource) and not may_rotate(view, state, depth):
            continue
        reserve(state, resource, i)
        if turns:
            reserve_other_lane(view, state, i)
        state.next[U(i)] = to
        if holder != NIL and holder != i and state.mode[U(holder)] == UNDECIDED:
            return holder
        return SETTLED
