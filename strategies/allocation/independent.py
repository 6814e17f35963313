"""Independent planning (Grzejszczak & Nocon, Algorithm 1): every robot carries its load all the way.

A free robot takes the unreserved order of least path cost (ties: lowest order) and sets the load
down at the order's own target. An empty robot that gave its order back before a retreat decides
with the cells of the other robots removed, or as if they were free if nothing is reachable so.

Each question costs a look at all m orders of the run, done or not, and a search that ends at the
nearest open one: m looks for each pick-up, so m^2 in a run. `first-come` looks at each order once.
"""

import numpy as np

from automaton.engine.state import (
    CMD_DROP_AT,
    CMD_PARK,
    CMD_TAKE_ORDER,
    NIL,
    REASON_ORDER_RETURNED,
    REASON_PERIODIC,
    REASON_PICKED,
    REASON_SERVED,
)
from automaton.strategy.kernels import (
    begin_cell,
    begin_search,
    can_do,
    dropoff_cell,
    kernel,
    mark_goal,
    nearest_mark,
    position,
)
from automaton.strategy.layer import Strategy
from strategies.allocation.open_orders import highest_priority, is_open


@kernel
def nearest_order(view, out, workspace, i, around):
    """The open order of least path cost, of those of the highest priority, for robot i; NIL: none."""
    least = highest_priority(view, out, i)
    search = begin_search(workspace)
    found = False
    here, robot_type = position(view, i), view.robots.type[i]
    for order in range(view.orders.state.shape[0]):
        if (
            view.orders.priority[order] >= least
            and is_open(view, out, order)
            and can_do(view, i, order)
        ):
            mark_goal(
                workspace,
                search,
                begin_cell(view, robot_type, order, here),
                order,
            )
            found = True
    if not found:
        return NIL
    heading = np.int64(view.robots.heading[i])
    return nearest_mark(view, workspace, search, robot_type, here, heading, around)


@kernel
def take_order(view, out, k, i, order):
    """Decision k of the batch: robot i takes this order and drives to where it begins."""
    out.command[k] = CMD_TAKE_ORDER
    out.order[k] = order
    out.goal_cell[k] = begin_cell(view, view.robots.type[i], order, position(view, i))
    out.order_taken[order] = 1


@kernel
def take_nearest(view, out, workspace, k, i, released):
    """Decision k: the nearest open order, or home if there is none."""
    order = NIL
    if released:
        order = nearest_order(view, out, workspace, i, True)
    if order == NIL:
        order = nearest_order(view, out, workspace, i, False)
    if order == NIL:
        out.command[k] = CMD_PARK
    else:
        take_order(view, out, k, i, order)


@kernel
def takes_load(view, out, slot):
    """Whether a load may be dropped at a slot: where any number fits, or on a shelf that is empty
    and promised to no robot."""
    if view.slots.unbounded[slot]:
        return True
    empty = view.slots.content[slot] == NIL and view.slots.reserved_by[slot] == NIL
    return empty and out.slot_taken[slot] == 0


@kernel
def places_load(reason):
    """Whether allocation is asked where the load of a robot goes."""
    return reason == REASON_PICKED or reason == REASON_SERVED


@kernel
def set_down(view, out, k, i, slot):
    """Decision k: robot i drops its load at this slot, which takes it."""
    out.command[k] = CMD_DROP_AT
    out.slot[k] = slot
    out.goal_cell[k] = dropoff_cell(view, view.robots.type[i], slot, position(view, i))
    if view.slots.unbounded[slot] == 0:
        out.slot_taken[slot] = 1


@kernel
def deliver(view, out, k, i):
    """Decision k: drop the load at its order's own target; if it is full, ask again next tick."""
    slot = np.int64(view.orders.target[view.robots.load[i]])
    if takes_load(view, out, slot):
        set_down(view, out, k, i, slot)
    else:
        out.ask_again[k] = 1


@kernel
def decide(view, batch, decisions, memory, workspace):
    out = decisions.allocation
    for k in range(batch.count[0]):
        if workspace.stop[0]:
            return
        i = np.int64(batch.robot[k])
        reason = batch.reason[k]
        if places_load(reason):
            deliver(view, out, k, i)
        elif reason != REASON_PERIODIC:
            take_nearest(view, out, workspace, k, i, reason == REASON_ORDER_RETURNED)


class Independent(Strategy):
    """Every robot takes the nearest unreserved order and carries it to its destination."""

    layer = "allocation"
    compiled = decide
