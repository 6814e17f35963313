"""Priority inheritance: a robot takes its best remaining option, and the robot there makes way."""

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    FOLLOWING_CONVOY,
    FOLLOWING_HANDOVER,
    FOLLOWING_NONE,
    NIL,
    gate_before,
    has_gates,
    is_facing,
    kernel,
    limited_ticks,
    opens_soon,
    prefetch,
)
from strategies.right_of_way.pibt.options import option_of, turns_to, waits_in_vain_to_turn
from strategies.right_of_way.pibt.pibt_state import (
    MODE_DECIDED,
    MODE_LEAVING,
    MODE_UNDECIDED,
    NO_OPTION,
    STAY_OPTION,
    U,
    holder_of,
    holds_both_lanes,
    is_across,
    is_for_two,
    may_enter,
    own_resource,
    reserve,
    reserve_ahead,
    reserve_other_lane,
    reserver_of,
    resource_in,
)
from strategies.right_of_way.steering import at_once_ticks, comes_to_charge, lacks_charge

SETTLED = -1  # results of take_option, besides the robot that must make way
FAILED = -2
IS_EMPTY = -3  # a result of clear_lane
NOT_ASKED = 0  # state.departs
GOES = 1
IS_BEHIND = 2
ASKED = 3  # robots behind it on this walk depend on it


@kernel
def push(view, state, first):
    """Decide for robot `first` and all that it pushes; return whether it got one of its options.

    A chain of pushes may contain the whole fleet, so the stack is explicit.
    """
    state.stack[0] = first
    state.mode[first] = MODE_DECIDED
    depth = 1
    while depth:
        i = np.int64(state.stack[U(depth - 1)])
        if state.lanes:
            give_lanes_back(view, state, i)
        pushed = take_option(view, state, i, depth)
        if pushed == SETTLED:
            return True
        if pushed == FAILED:
            stay(view, state, i)
            depth -= 1
        else:
            state.mode[U(pushed)] = MODE_DECIDED
            state.stack[U(depth)] = pushed
            depth += 1
    return False


@kernel
def take_option(view, state, i, depth):
    """Reserve the next remaining option of robot i; return the robot to push, SETTLED or FAILED.

    Robot i is the last of this number of robots that push each other.
    """
    cell = np.int64(view.robots.cell[U(i)])
    while True:
        place = np.int64(state.option_next[U(i)])
        option = option_of(state, i, place)
        if option == NO_OPTION:
            return FAILED
        state.option_next[U(i)] = place + 1
        if option == STAY_OPTION:
            if state.lanes and waits_in_vain_to_turn(view, state, i):
                continue
            comer = reserver_of(state, own_resource(view, i))
            if comer == NIL or comer == i:
                stay(view, state, i)
                return SETTLED
            continue
        turns = turns_to(view, i, option) > 0
        if state.lanes and turns and is_for_two(view, cell):
            in_way = clear_lane(view, state, i, cell, np.int64(view.robots.travel[U(i)]) ^ 2)
            if in_way == FAILED:
                continue
            if in_way != IS_EMPTY:
                return in_way
        to = cell + view.grid.offset[U(option)]
        gate = gate_before(view, i, to)
        if gate != NIL:  # it requests the gate, and stays meanwhile
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
            if is_to_make_way(view, state, other, to):
                return wait_for(view, state, i, other)
            continue
        holder = holder_of(view, to, option)
        if would_swap(view, state, i, to, holder) or not may_enter(view, state, i, to):
            continue
        if closes_ring(view, state, i, resource) and not may_rotate(view, state, depth):
            continue
        if state.lanes and is_across(view, state, i, to, option):
            in_way = clear_lane(view, state, i, to, option ^ 2)
            if in_way == FAILED:
                continue
            if in_way != IS_EMPTY:
                return in_way
        reserve_ahead(view, state, i, to, option)
        if state.lanes and turns:
            reserve_other_lane(view, state, i)
        state.next[U(i)] = to
        if holder != NIL and holder != i and state.mode[U(holder)] == MODE_UNDECIDED:
            return holder
        return SETTLED


@kernel
def clear_lane(view, state, i, cell, direction):
    """Clear the second lane of a cell for two, in which robot i turns or will stand across.

    Two robots that stand across would wait for each other for ever. Returns IS_EMPTY if the lane
    is empty; otherwise robot i waits, and the result is that of `take_option`.
    """
    lane, u = resource_in(view, cell, direction), holder_of(view, cell, direction)
    comer = reserver_of(state, lane)
    if comer != NIL and comer != i:
        return (
            wait_for(view, state, i, comer) if is_to_make_way(view, state, comer, cell) else FAILED
        )
    if u == NIL or u == i:
        return IS_EMPTY
    if state.mode[U(u)] == MODE_UNDECIDED or state.mode[U(u)] == MODE_LEAVING:
        return wait_for(view, state, i, u)
    return FAILED


@kernel
def is_to_make_way(view, state, u, cell):
    """Whether robot u, which has reserved a lane of a cell for two, is in it and can be pushed."""
    is_there = is_for_two(view, cell) and view.robots.cell[U(u)] == cell
    return is_there and state.mode[U(u)] == MODE_UNDECIDED


@kernel
def wait_for(view, state, i, u):
    """Let robot i wait until robot u has left a cell for two; returns u if it must make way."""
    reserve(state, own_resource(view, u), i)
    state.next[U(i)] = view.robots.cell[U(i)]
    if reserver_of(state, own_resource(view, i)) == NIL:
        reserve(state, own_resource(view, i), i)  # else the robot that pushes it waits, too
    return u if state.mode[U(u)] == MODE_UNDECIDED else SETTLED


@kernel
def give_lanes_back(view, state, i):
    """Release the lanes that robot i reserved for its last option, which failed."""
    place = np.int64(state.option_next[U(i)])
    option = option_of(state, i, place - 1) if place else np.int64(STAY_OPTION)
    if option >= STAY_OPTION:
        return
    cell = np.int64(view.robots.cell[U(i)])
    to = cell + view.grid.offset[U(option)]
    release(view, state, i, to, option)
    release(view, state, i, to, option ^ 2)
    if not holds_both_lanes(view, state, i):
        release(view, state, i, cell, np.int64(view.robots.travel[U(i)]) ^ 2)


@kernel
def release(view, state, i, cell, direction):
    lane = resource_in(view, cell, direction)
    if is_for_two(view, cell) and reserver_of(state, lane) == i:
        state.reserved[U(lane)] = 0


@kernel
def stay(view, state, i):
    state.next[U(i)] = view.robots.cell[U(i)]
    reserve(state, own_resource(view, i), i)


@kernel
def would_swap(view, state, i, to, holder):
    """Whether robot i and a robot that moves from this cell into its own would swap cells."""
    cell = np.int64(view.robots.cell[U(i)])
    if state.lanes and state.rings and is_for_two(view, cell) and is_for_two(view, to):
        return False  # each has its lane
    if holder != NIL and state.mode[U(holder)] != MODE_UNDECIDED and state.next[U(holder)] == cell:
        return True
    comer = reserver_of(state, own_resource(view, i))
    return comer != NIL and comer != i and view.robots.cell[U(comer)] == to


@kernel
def closes_ring(view, state, i, resource):
    """Whether this option of robot i closes a ring: it takes the resource of the chain's first robot."""
    first = np.int64(state.stack[0])
    return first != i and resource != NIL and resource == own_resource(view, first)


@kernel
def may_rotate(view, state, depth):
    """Whether a ring of all robots on the stack moves, if the last one takes the place of the first.

    It does not if rings never rotate, if a robot in it comes to charge or waits for a lane, or if its
    first robot must step aside. If all moves take one tick, the world refuses a ring with a robot that
    comes to charge.
    """
    if state.rings == 0 or state.deadlocks.aside[U(state.stack[0])]:
        return False
    charges = state.holds_back and view.chargers.cell.shape[0]
    if charges or state.lanes:
        for k in range(depth):
            i = np.int64(state.stack[U(k)])
            if charges and comes_to_charge(view, i, state.next[U(i)]):
                return False
            if k < depth - 1 and state.next[U(i)] == view.robots.cell[U(i)]:
                return False
    return True


@kernel
def fetch_cells(view, state, i):
    """Prefetch the data of robot i's cell and of its preferred cell."""
    cell, option = np.int64(view.robots.cell[U(i)]), option_of(state, i, 0)
    if cell != NIL and option < STAY_OPTION:
        to = cell + view.grid.offset[U(option)]
        prefetch(state.reserved, U(cell))
        prefetch(state.reserved, U(to))
        prefetch(view.traffic.holder, U(2 * to))


# Departures: which robots with a chosen cell begin to move in this tick, by the rule of following.
#
# A robot whose cell is not free yet is held back and keeps its choice: the chosen cell comes first in
# the next tick, like a cell to which a robot has turned. If all moves take one tick and may follow each
# other, all pushed robots make way at once, so no robot is held back.


def holds_back(view):
    """Return whether pushed robots may still be in their cells at the end of the tick."""
    ticks = np.asarray(view.rules.duration)[:, ACTION_MOVE].max()
    limits = np.asarray(view.grid.min_move_ticks)
    longest = max(int(ticks), int(limits.max(initial=0)))
    takes_time = longest > at_once_ticks(view) or view.rules.slowdown
    return bool(takes_time or view.rules.following == FOLLOWING_NONE)


@kernel
def departs(view, state, first):
    """Return whether robot `first`, which has chosen another cell, begins to move there now.

    It does if the cell is free, or opens because its holder also begins to move. A ring of such robots
    exists only if rings rotate. The result holds for all robots on this walk.
    """
    stack, depth, i, opens = state.stack, 0, first, True
    while state.departs[U(i)] == NOT_ASKED:
        state.departs[U(i)] = ASKED
        stack[U(depth)] = i
        depth += 1
        to = np.int64(state.next[U(i)])
        u = holder_of(view, to, direction_of(state, i))
        charges = comes_to_charge(view, i, to)
        if u != NIL and not charges and moves_off(view, state, u, to):
            i = u
        else:
            has_set_out = u != NIL and is_way_free(view, to, u)
            opens = u == NIL or (has_set_out and not (charges and not state.rings))
    if state.departs[U(i)] != ASKED:
        opens = state.departs[U(i)] == GOES and gives_way_at_once(view, state, i)
    while depth:
        depth -= 1
        i = np.int64(stack[U(depth)])
        state.departs[U(i)] = GOES if opens else IS_BEHIND
        opens = opens and gives_way_at_once(view, state, i)
    return state.departs[U(first)] == GOES


@kernel
def direction_of(state, i):
    """Return the direction that moving robot i has chosen."""
    return option_of(state, i, np.int64(state.option_next[U(i)]) - 1)


@kernel
def moves_off(view, state, u, cell):
    """Return whether robot u has chosen to leave a cell, need not turn first, and has enough charge."""
    has_chosen = state.mode[U(u)] == MODE_DECIDED and state.next[U(u)] != cell
    if not has_chosen or view.robots.cell[U(u)] != cell:
        return False
    return is_facing(view, u, direction_of(state, u)) and not lacks_charge(view, u)


@kernel
def is_way_free(view, cell, u):
    """Return whether a robot may begin to move into a cell that moving robot u still holds."""
    robots, following = view.robots, view.rules.following
    if robots.cell[U(u)] != cell or robots.claim[U(u)] == NIL or robots.claim[U(u)] == cell:
        return False
    if following == FOLLOWING_HANDOVER:
        return robots.busy[U(u)] == 1
    return following == FOLLOWING_CONVOY


@kernel
def gives_way_at_once(view, state, u):
    """Return whether robot u frees its cell in the tick in which it begins to move."""
    if view.rules.following != FOLLOWING_HANDOVER:
        return view.rules.following == FOLLOWING_CONVOY
    cell, direction = np.int64(view.robots.cell[U(u)]), direction_of(state, u)
    if view.rules.slowdown and view.grid.traffic_zone[U(cell), U(direction >> 1)] != NIL:
        return False  # how many robots slow it down is counted later
    if has_gates(view) and view.gates.cabin_ticks[U(cell), U(direction)] > 1:
        return False
    usual = view.rules.duration[U(view.robots.type[U(u)]), U(ACTION_MOVE)]
    return limited_ticks(view.grid, usual, cell, direction) == 1
