"""Shortest job first with aging (Keith & La, Algorithm 2).

A free robot takes the order of highest score: C_A times its age minus C_D times how long it takes to
drive to it and to carry it to where it is set down next. The age counts from the tick in which the
order became known, and is kept when it is set down at a transfer station. Ties: the lowest number.
With zones a robot takes orders from the queues of the zones that it serves, and sets each down where
zoning says; without, any order, which it carries to its target.
"""

import numpy as np

from automaton.strategy.kernels import (
    FAR,
    can_bring,
    distance,
    drop_stand,
    kernel,
    pick_stand,
    position,
)
from automaton.strategy.layer import Strategy, memory_of
from automaton.world.state import NIL, PARK, PERIODIC, PICKED, TICK
from strategies.allocation.independent import deliver, set_down, take_order, takes_load
from strategies.allocation.open_orders import is_open

# memory.parameters
AGE = 0  # weights, in thousandths
JOB = 1
PARKS = 2  # 1: robots without an order drive home

WORST = -(1 << 62)


@kernel
def is_mine(view, order, identity):
    """Whether an order is in a queue that this robot serves; without zones all are."""
    zoning = view.zoning
    if zoning.queue.shape[0] == 0:
        return True
    queue = zoning.queue[order]
    return queue >= 0 and zoning.server[queue] == identity


@kernel
def next_stop(view, order):
    """The slot where an order is set down next: where zoning says, or its target."""
    if view.zoning.queue.shape[0] and view.zoning.stop[order] != NIL:
        return np.int64(view.zoning.stop[order])
    return np.int64(view.orders.target[order])


@kernel
def score(view, space, memory, i, order):
    """The score of an order for robot i, in thousandths of ticks; WORST if it cannot do it."""
    slot, kind = next_stop(view, order), view.robots.type[i]
    if not can_bring(view, kind, order, slot):
        return WORST
    pick = pick_stand(view, kind, np.int64(view.orders.place[order]))
    drop = drop_stand(view, kind, slot)
    heading = np.int64(view.robots.heading[i])
    job = distance(view, space, kind, position(view, i), heading, pick)
    job += distance(view, space, kind, pick, heading, drop)
    if job >= FAR:
        return WORST
    age = view.clock[TICK] - view.orders.released[order]
    return memory.parameters[AGE] * age - memory.parameters[JOB] * job


@kernel
def best_order(view, given, memory, space, i):
    """The open order of highest score for robot i, NIL if there is none."""
    found, highest = NIL, WORST
    identity = view.robots.identity[i]
    for order in range(view.orders.state.shape[0]):
        if is_open(view, given, order) and is_mine(view, order, identity):
            worth = score(view, space, memory, i, order)
            if worth > highest:
                found, highest = order, worth
    return found


@kernel
def bring(view, given, k, i):
    """Answer k: carry the load of robot i to its next stop, or to its target if that is full."""
    order = np.int64(view.robots.load[i])
    stop = next_stop(view, order)
    if stop != view.orders.target[order] and takes_load(view, given, stop):
        set_down(view, given, k, i, stop)
    else:
        deliver(view, given, k, i)


@kernel
def decide(view, asked, answers, memory, space):
    given = answers.allocation
    for k in range(asked.count[0]):
        if space.stop[0]:
            return
        i = np.int64(asked.robot[k])
        if asked.reason[k] == PICKED:
            bring(view, given, k, i)
        elif asked.reason[k] != PERIODIC:
            order = best_order(view, given, memory, space, i)
            if order != NIL:
                take_order(view, given, k, i, order)
            elif memory.parameters[PARKS]:
                given.verb[k] = PARK


class ShortestJob(Strategy):
    """The order that is done soonest, unless another one has waited long."""

    layer = "allocation"
    compiled = decide

    def reset(self, view):
        given = self.parameters
        weights = round(1000 * given.age), round(1000 * given.job)
        return memory_of(view, parameters=(*weights, int(given.idle == "park")))
