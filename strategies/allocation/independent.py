"""Independent planning (Grzejszczak & Nocon, Algorithm 1): every robot carries its load all the way.

A free robot takes the unreserved order of least path cost (ties: lowest order) and sets the load
down at the order's own target. An empty robot that gave its order back before a retreat searches
around the cells of the other robots, or through them if it then reaches no order.

Each decision examines all orders from the first unfinished to the last known one, and does a search
that ends at the nearest open order. `first-come` examines each order once.

This file has the strategy twice: compiled, and in plain Python as a tutorial.
"""

import numpy as np

from automaton.strategy import orders, paths
from automaton.strategy.api import (
    CMD_PARK,
    NIL,
    REASON_ORDER_RETURNED,
    REASON_PERIODIC,
    STORAGE_POLICIES,
    PlacingState,
    Strategy,
    begin_cell,
    begin_search,
    can_do,
    highest_priority,
    is_open,
    kernel,
    mark_goal,
    nearest_mark,
    place_load,
    places_load,
    position,
    take_order,
)
from strategies.allocation.allocation_parameters import IndependentParameters


@kernel
def decide(view, batch, decisions, memory, workspace):
    out, state = decisions.allocation, PlacingState.of(memory)
    for k in range(batch.count):
        if workspace.stop[0]:
            return
        i = np.int64(batch.robot[k])
        reason = batch.reason[k]
        if places_load(reason):
            place_load(view, out, workspace, k, i, state.storage)
        elif reason != REASON_PERIODIC:
            take_nearest(view, out, workspace, k, i, reason == REASON_ORDER_RETURNED)


class Independent(Strategy):
    """Every robot takes the nearest unreserved order and carries it to its destination."""

    layer = "allocation"
    Parameters = IndependentParameters
    compiled = decide

    def reset(self, view):
        return PlacingState(storage=STORAGE_POLICIES.index(self.parameters.storage))


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
def nearest_order(view, out, workspace, i, around):
    """The open order of least path cost among those of the highest priority for robot i; or NIL."""
    least = highest_priority(view, out, i)
    search = begin_search(workspace)
    found = False
    here, robot_type = position(view, i), view.robots.type[i]
    for order in range(view.clock.first_open, view.clock.known_orders):
        if view.orders.priority[order] < least or not is_open(view, out, i, order):
            continue
        if can_do(view, i, order):
            mark_goal(workspace, search, begin_cell(view, robot_type, order, here), order)
            found = True
    if not found:
        return NIL
    heading = np.int64(view.robots.heading[i])
    return nearest_mark(view, workspace, search, robot_type, here, heading, around)


# The tutorial: how to write a strategy in plain Python.
#
# It decides exactly as `independent` does (equal digests, tested), in tens of microseconds per
# decision. The loop calls it with a batch of robots and applies its decisions; robots without a decision
# continue. A compiled strategy has the same shape: replace `decide` by a kernel.


class IndependentPython(Strategy):
    """Every robot takes the nearest unreserved order and carries it to its destination."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        out = decisions.allocation
        for k in range(batch.count):
            robot, reason = batch.robot[k], batch.reason[k]
            if orders.asks_for_place(reason):
                orders.place_load(view, out, workspace, k, robot)
            elif reason != REASON_PERIODIC:
                order = self.nearest(view, out, workspace, robot, reason == REASON_ORDER_RETURNED)
                if order is None:
                    out.command[k] = CMD_PARK
                else:
                    orders.take(view, out, k, robot, order)

    def nearest(self, view, out, workspace, robot, around):
        found = orders.list_open(view, out, robot)
        highest = max((view.orders.priority[order] for order in found), default=0)
        found = [order for order in found if view.orders.priority[order] == highest]
        cells = [orders.begin_cell(view, robot, order) for order in found]
        first = paths.nearest(view, workspace, robot, cells, around) if around else None
        if first is None:  # or if no order is reachable around the other robots
            first = paths.nearest(view, workspace, robot, cells)
        return None if first is None else found[first]
