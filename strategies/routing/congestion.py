"""Routes around the congestion to come (shared plans, searched in time).

All plans are replayed ahead with the slow zones of the world, so it is known how many robots will be
in which zone at which tick. Robots that need a route get the cheapest one through that, one after
another in the order of their identities, each seeing the routes of those before it. For comparison,
robots may foresee less: where the others would be if nobody delayed them on the A* paths of their tasks
(`tasks`), or which share of their time each of them spends in a zone so (`shares`). A detour around
robots that stood in the way is driven to its end: made anew, it would lead back to where they stand.
"""

import numpy as np

from automaton.strategy.kernels import (
    KEPT,
    OWN_PARAMETERS,
    expect,
    expect_no_more,
    expect_one,
    find_in_time,
    forecast_memory,
    foresee,
    foresee_one,
    forget,
    forget_all,
    kernel,
)
from automaton.strategy.layer import Strategy
from automaton.world.state import AROUND, NIL, PERIODIC
from strategies.catalogue import SharedPlans

BETA = OWN_PARAMETERS
BY_TASKS = OWN_PARAMETERS + 1  # 1: nothing is known of the others but their tasks
DETOUR = KEPT  # memory.own: 1 + the stand to which a detour leads, or 0


@kernel
def look_ahead(view, space, memory):
    """Foresee all robots, by their plans or by their tasks alone."""
    if memory.parameters[BY_TASKS]:
        expect(view, space, memory)
    else:
        foresee(view, space, memory)


@kernel
def leave_out(view, memory, i):
    """Foresee all robots but this one."""
    if memory.parameters[BY_TASKS]:
        expect_no_more(view, memory, i)
    else:
        forget(memory, i)


@kernel
def put_back(view, space, memory, i, steps, length):
    """Foresee this robot, too, with its new route."""
    if memory.parameters[BY_TASKS]:
        expect_one(view, space, memory, i)
    elif length != NIL:
        foresee_one(view, space, memory, i, steps, length)


@kernel
def decide(view, asked, answers, memory, space):
    if asked.count[0] == 0:
        return
    beta = memory.parameters[BETA]
    look_ahead(view, space, memory)
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        steps = answers.routing.steps[k]
        detour = 1 + np.int64(view.robots.stand[i])
        if asked.reason[k] == PERIODIC and memory.own[i, DETOUR] == detour:
            continue
        leave_out(view, memory, i)
        length = NIL
        if asked.reason[k] == AROUND:
            length = find_in_time(view, space, memory, beta, i, True, steps)
        memory.own[i, DETOUR] = 0 if length == NIL else detour
        if length == NIL:
            length = find_in_time(view, space, memory, beta, i, False, steps)
        if length != NIL:
            answers.routing.length[k] = length
        put_back(view, space, memory, i, steps, length)
    forget_all(memory)


class Congestion(Strategy):
    """Least cost through the foreseen traffic: a move costs 1 + beta for each other robot in its zone."""

    layer = "routing"
    Parameters = SharedPlans
    compiled = decide

    def __init__(self, parameters=None):
        super().__init__(parameters)
        self.every = self.parameters.every

    def reset(self, view):
        beta = round(1000 * self.parameters.beta)
        knows = self.parameters.foresees
        own = (beta, int(knows != "plans"))
        return forecast_memory(view, self.parameters.horizon, own, shares=knows == "shares")
