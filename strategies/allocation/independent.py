"""Independent planning (Grzejszczak & Nocon, Algorithm 1): every robot carries its load all the way.

A free robot takes the unreserved order of least path cost (ties: lowest order) and sets the load
down at the order's own target. An empty robot that gave its order back before a withdrawal decides
with the cells of the other robots removed, or as if they were free if nothing is reachable so.

Each question costs a look at all m orders of the run, done or not, and a search that ends at the
nearest open one: m looks for each pick-up, so m^2 in a run. `first-come` looks at each order once.
"""

import numpy as np

from automaton.strategy.kernels import (
    begin_search,
    can_do,
    drop_stand,
    kernel,
    mark_goal,
    nearest_mark,
    pick_stand,
    position,
)
from automaton.strategy.layer import Strategy, memory_of
from automaton.world.state import NIL, PARK, PERIODIC, PICKED, RELEASED, SET_DOWN, TAKE
from strategies.allocation.open_orders import is_open


@kernel
def nearest_order(view, given, space, i, around):
    """The open order of least path cost for robot i, NIL if there is none."""
    search = begin_search(space)
    found = False
    kind = view.robots.type[i]
    for order in range(view.orders.state.shape[0]):
        if is_open(view, given, order) and can_do(view, i, order):
            mark_goal(space, search, pick_stand(view, kind, view.orders.place[order]), order)
            found = True
    if not found:
        return NIL
    heading = np.int64(view.robots.heading[i])
    return nearest_mark(view, space, search, kind, position(view, i), heading, around)


@kernel
def take_order(view, given, k, i, order):
    """Answer k of the batch: robot i picks up this order."""
    given.verb[k] = TAKE
    given.order[k] = order
    given.stand[k] = pick_stand(view, view.robots.type[i], view.orders.place[order])
    given.order_taken[order] = 1


@kernel
def take_nearest(view, given, space, k, i, released):
    """Answer k: the nearest open order, or home if there is none."""
    order = NIL
    if released:
        order = nearest_order(view, given, space, i, True)
    if order == NIL:
        order = nearest_order(view, given, space, i, False)
    if order == NIL:
        given.verb[k] = PARK
    else:
        take_order(view, given, k, i, order)


@kernel
def takes_load(view, given, slot):
    """Whether a load may be set down at a slot: where any number fits, or on a shelf that is empty
    and promised to nobody."""
    if view.slots.endless[slot]:
        return True
    empty = view.slots.content[slot] == NIL and view.slots.by[slot] == NIL
    return empty and given.slot_taken[slot] == 0


@kernel
def set_down(view, given, k, i, slot):
    """Answer k: robot i sets its load down at this slot, which takes it."""
    given.verb[k] = SET_DOWN
    given.slot[k] = slot
    given.stand[k] = drop_stand(view, view.robots.type[i], slot)
    if view.slots.endless[slot] == 0:
        given.slot_taken[slot] = 1


@kernel
def deliver(view, given, k, i):
    """Answer k: set the load down at its order's own target; if it is full, ask again next tick."""
    slot = np.int64(view.orders.target[view.robots.load[i]])
    if takes_load(view, given, slot):
        set_down(view, given, k, i, slot)
    else:
        given.ask_again[k] = 1


@kernel
def decide(view, asked, answers, memory, space):
    given = answers.allocation
    for k in range(asked.count[0]):
        if space.stop[0]:
            return
        i = np.int64(asked.robot[k])
        reason = asked.reason[k]
        if reason == PICKED:
            deliver(view, given, k, i)
        elif reason != PERIODIC:
            take_nearest(view, given, space, k, i, reason == RELEASED)


class Independent(Strategy):
    """Every robot takes the nearest unreserved order and carries it to its destination."""

    layer = "allocation"
    compiled = decide

    def reset(self, view):
        return memory_of(view)
