"""Robots with a list of orders ahead of them: what each does next."""

import numpy as np

from automaton.engine.state import (
    CMD_PARK,
    KEEP,
    NIL,
    ORDER_WAITING,
    REASON_PERIODIC,
)
from automaton.strategy.kernels import can_do, kernel
from strategies.allocation.independent import take_order
from strategies.allocation.placing import deliver, places_load


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
def serve(view, batch, out, due):
    """Decide for a batch: loads go to their targets, free robots take the next order of their lists.

    due[i] = 0 where robot i's list is done; (n,) int64.
    """
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        if places_load(batch.reason[k]):
            deliver(view, out, k, i)
        elif batch.reason[k] != REASON_PERIODIC and not take_next(view, out, k, i):
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
