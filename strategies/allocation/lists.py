"""Robots with a list of orders ahead of them: what each does next."""

import numpy as np

from automaton.strategy.kernels import can_do, kernel
from automaton.world.state import KEEP, NIL, PARK, PERIODIC, PICKED, WAITING
from strategies.allocation.independent import deliver, take_order


@kernel
def planned_count(view, given, i):
    """How many orders robot i has ahead of it, by the answers if they say so."""
    return np.int64(view.robots.planned[i] if given.planned[i] == KEEP else given.planned[i])


@kernel
def copy_plan(view, given, i):
    """Let the answers begin with the plan that robot i has."""
    if given.planned[i] != KEEP:
        return
    given.planned[i] = view.robots.planned[i]
    for k in range(view.robots.planned[i]):
        given.plan[i, k] = view.robots.plan[i, k]


@kernel
def take_next(view, given, k, i):
    """Answer k: robot i takes the first order of its list that still waits; False if none does."""
    copy_plan(view, given, i)
    count = np.int64(given.planned[i])
    for p in range(count):
        order = np.int64(given.plan[i, p])
        waits = view.orders.state[order] == WAITING and view.orders.by[order] == NIL
        if waits and can_do(view, i, order):
            take_order(view, given, k, i, order)
            for q in range(p + 1, count):
                given.plan[i, q - p - 1] = given.plan[i, q]
            given.planned[i] = count - p - 1
            return True
    given.planned[i] = 0
    return False


@kernel
def serve(view, asked, given, memory, due):
    """Answer a batch: loads go to their targets, free robots take the next order of their lists."""
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        if asked.reason[k] == PICKED:
            deliver(view, given, k, i)
        elif asked.reason[k] != PERIODIC and not take_next(view, given, k, i):
            given.verb[k] = PARK
            memory.own[i, due] = 0


@kernel
def has_empty_list(view, asked, given):
    """Whether a robot that is asked what to do next has nothing ahead of it."""
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        if asked.reason[k] != PICKED and asked.reason[k] != PERIODIC:
            if planned_count(view, given, i) == 0:
                return True
    return False
