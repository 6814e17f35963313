"""Robots with a list of orders ahead of them: what each does next."""

import numpy as np

from automaton.engine.state import (
    CMD_PARK,
    KEEP,
    NIL,
    ORDER_WAITING,
    REASON_PERIODIC,
)
from automaton.strategy.kernels import (
    allocation_of,
    can_do,
    has_place,
    is_open,
    kernel,
    place_load,
    places_load,
    take_order,
)


@kernel
def planned_count(view, out, i):
    """How many orders robot i has ahead of it, by the decisions if they say so."""
    return np.int64(
        view.robots.order_queue_length[i]
        if out.order_queue_length[i] == KEEP
        else out.order_queue_length[i]
    )


@kernel
def copy_plan(view, out, i):
    """Let the decisions begin with the plan that robot i has."""
    if out.order_queue_length[i] != KEEP:
        return
    out.order_queue_length[i] = view.robots.order_queue_length[i]
    for k in range(view.robots.order_queue_length[i]):
        out.order_queue[i, k] = view.robots.order_queue[i, k]


@kernel
def drop_lost_orders(view, out, strategy):
    """Strike off the lists of a strategy's robots what robots of other strategies have taken."""
    if view.rules.allocations == 1:
        return
    orders = view.orders
    for i in range(view.robots.cell.shape[0]):
        if allocation_of(view, i) != strategy:
            continue
        count, remaining = np.int64(view.robots.order_queue_length[i]), 0
        for p in range(count):
            order = np.int64(view.robots.order_queue[i, p])
            if orders.state[order] == ORDER_WAITING and orders.reserved_by[order] == NIL:
                out.order_queue[i, remaining] = order
                remaining += 1
        if remaining < count:
            out.order_queue_length[i] = remaining


@kernel
def take_next(view, out, k, i):
    """Decision k: robot i takes the first order of its list that still waits; False if none does."""
    copy_plan(view, out, i)
    count = np.int64(out.order_queue_length[i])
    for p in range(count):
        order = np.int64(out.order_queue[i, p])
        waits = view.orders.state[order] == ORDER_WAITING and view.orders.reserved_by[order] == NIL
        if waits and can_do(view, i, order):
            take_order(view, out, k, i, order)
            for q in range(p + 1, count):
                out.order_queue[i, q - p - 1] = out.order_queue[i, q]
            out.order_queue_length[i] = count - p - 1
            return True
    out.order_queue_length[i] = 0
    return False


@kernel
def take_next_trip(view, out, k, i):
    """Decision k, where orders are trips of pods: robot i takes one, or waits; False if it has none.

    The one of the pod above it is reserved for it, and comes first. Then the first one of its list to
    whose station it may come; those before it stay in the list.
    """
    offered = np.int64(view.trips.offered[view.robots.identity[i]])
    if offered != NIL and is_open(view, out, i, offered):
        take_order(view, out, k, i, offered)
        return True
    copy_plan(view, out, i)
    count, remaining, taken = np.int64(out.order_queue_length[i]), 0, False
    for p in range(count):
        order = np.int64(out.order_queue[i, p])
        if view.orders.state[order] != ORDER_WAITING or view.orders.reserved_by[order] != NIL:
            continue
        if not taken and has_place(view, order) and can_do(view, i, order):
            take_order(view, out, k, i, order)
            taken = True
            continue
        out.order_queue[i, remaining] = order
        remaining += 1
    out.order_queue_length[i] = remaining
    return taken or remaining > 0


@kernel
def serve(view, batch, out, workspace, due, policy):
    """Decide for a batch: loads go to their targets, free robots take the next order of their lists.

    due[i] = 0 where robot i's list is done; (n,) int64. `policy`: of storage, its place among POLICIES.
    """
    carries_pods = view.trips.pod.shape[0] > 0
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        if places_load(batch.reason[k]):
            place_load(view, out, workspace, k, i, policy)
            continue
        if batch.reason[k] == REASON_PERIODIC:
            continue
        if not (take_next_trip(view, out, k, i) if carries_pods else take_next(view, out, k, i)):
            out.command[k] = CMD_PARK
            due[i] = 0


@kernel
def has_empty_list(view, batch, out):
    """Whether a robot that is asked what to do next has nothing ahead of it."""
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        if not places_load(batch.reason[k]) and batch.reason[k] != REASON_PERIODIC:
            if planned_count(view, out, i) == 0:
                return True
    return False
