"""Which robots that have chosen another cell begin their moves in this tick, by the rule of following.

A robot whose way is not free yet is held back instead of sent, and goes on with its choice: the cell for
which it waits comes first in the next tick, as the one to which a robot has turned does. Where all moves
take one tick and may follow, all that are pushed make way at once: there robots are sent as before.
"""

import numpy as np

from automaton.engine.state import (
    ACTION_MOVE,
    FOLLOWING_CONVOY,
    FOLLOWING_HANDOVER,
    FOLLOWING_NONE,
    NIL,
)
from automaton.strategy.kernels import has_gates, is_facing, kernel, limited_ticks
from strategies.right_of_way.arrivals import at_once_ticks, comes_to_charge, lacks_charge
from strategies.right_of_way.pibt.options import option_of
from strategies.right_of_way.pibt.pibt_state import DECIDED, U
from strategies.right_of_way.pibt.reservations import holder_of

NOT_ASKED = 0  # state.departs
GOES = 1
IS_BEHIND = 2
ASKED = 3  # those behind it on this walk depend on it


def holds_back(view):
    """Return whether robots may find that those whom they push are not gone in the same tick."""
    ticks = np.asarray(view.rules.duration)[:, ACTION_MOVE].max()
    limits = np.asarray(view.grid.min_move_ticks)
    longest = max(int(ticks), int(limits.max(initial=0)))
    takes_time = longest > at_once_ticks(view) or view.rules.slowdown
    return bool(takes_time or view.rules.following == FOLLOWING_NONE)


@kernel
def direction_of(state, i):
    """Return the direction in which robot i, which goes, has chosen to."""
    return option_of(state, i, np.int64(state.option_next[U(i)]) - 1)


@kernel
def moves_off(view, state, u, cell):
    """Return whether robot u has chosen to go from a cell, need not turn first, and has the charge."""
    if state.mode[U(u)] != DECIDED or view.robots.cell[U(u)] != cell or state.next[U(u)] == cell:
        return False
    return is_facing(view, u, direction_of(state, u)) and not lacks_charge(view, u)


@kernel
def is_way_free(view, cell, u):
    """Return whether a robot may begin to move into a cell that robot u, under way, holds."""
    robots, following = view.robots, view.rules.following
    if robots.cell[U(u)] != cell or robots.claim[U(u)] == NIL or robots.claim[U(u)] == cell:
        return False
    if following == FOLLOWING_HANDOVER:
        return robots.busy[U(u)] == 1
    return following == FOLLOWING_CONVOY


@kernel
def gives_way_at_once(view, state, u):
    """Return whether the move that robot u begins opens its cell in the same tick."""
    if view.rules.following != FOLLOWING_HANDOVER:
        return view.rules.following == FOLLOWING_CONVOY
    cell, direction = np.int64(view.robots.cell[U(u)]), direction_of(state, u)
    if view.rules.slowdown and view.grid.traffic_zone[U(cell), U(direction >> 1)] != NIL:
        return False  # how many robots slow it down is counted later
    if has_gates(view) and view.gates.cabin_ticks[U(cell), U(direction)] > 1:
        return False
    usual = view.rules.duration[U(view.robots.type[U(u)]), U(ACTION_MOVE)]
    return limited_ticks(view.grid, usual, cell, direction) == 1


@kernel
def departs(view, state, first):
    """Return whether robot `first`, which has chosen another cell, begins to move there now.

    It does where the cell is free, or opens because its holder moves off in turn; a ring of such robots
    has closed only where rings rotate. What is found holds for all robots on the way there.
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
