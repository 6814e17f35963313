"""Routes around the congestion to come (shared plans, searched in time).

All plans are replayed ahead with the slow zones of the world, so it is known how many robots will be
in which zone at which tick. Robots that need a route get the cheapest one through that, one after
another in the order of their identities, each seeing the routes of those before it. A detour around
robots that stood in the way is driven to its end: made anew, it would lead back to where they stand.
"""

import numpy as np

from automaton.strategy.kernels import (
    KEPT,
    OWN_PARAMETERS,
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
DETOUR = KEPT  # memory.own: 1 + the stand to which a detour leads, or 0


@kernel
def decide(view, asked, answers, memory, space):
    if asked.count[0] == 0:
        return
    beta = memory.parameters[BETA]
    foresee(view, space, memory)
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        steps = answers.routing.steps[k]
        detour = 1 + np.int64(view.robots.stand[i])
        if asked.reason[k] == PERIODIC and memory.own[i, DETOUR] == detour:
            continue
        forget(memory, i)
        length = NIL
        if asked.reason[k] == AROUND:
            length = find_in_time(view, space, memory, beta, i, True, steps)
        memory.own[i, DETOUR] = NIL + 1 if length == NIL else detour
        if length == NIL:
            length = find_in_time(view, space, memory, beta, i, False, steps)
        if length != NIL:
            answers.routing.length[k] = length
            foresee_one(view, space, memory, i, steps, length)
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
        return forecast_memory(view, self.parameters.horizon, (beta,))
