"""Routes around the congestion to come (shared plans, searched in time).

All plans are replayed ahead with the slow zones of the world, so it is known how many robots will be
in which zone at which tick. Robots that need a route get the cheapest one through that, one after
another in the order of their identities, each seeing the routes of those before it. For comparison,
robots may predict less: where the others would be if no robot delayed them on the A* paths of their
tasks (`tasks`), or which share of their time each of them spends in a zone so (`task-averages`). A
detour around robots that stood in the way is driven to its end: made again, it would lead back to
where they stand.
"""

import numpy as np

from automaton.engine.state import NIL, REASON_PERIODIC
from automaton.strategy.kernels import kernel
from automaton.strategy.layer import Strategy
from strategies.routing.closed_cells import around_closed, around_what
from strategies.routing.congestion.congestion_parameters import SharedPlans
from strategies.routing.congestion.plan_forecast import forecast_all, forecast_one
from strategies.routing.congestion.task_forecast import (
    add_task_forecast,
    add_task_forecasts,
    remove_task_forecast,
)
from strategies.routing.congestion.time_dependent import time_dependent_path
from strategies.routing.congestion.zone_forecast import (
    CongestionState,
    congestion_state,
    forget,
    forget_all,
)


@kernel
def look_ahead(view, workspace, state):
    """Foresee all robots, by their plans or by their tasks alone."""
    if state.tasks_alone:
        add_task_forecasts(view, workspace, state)
    else:
        forecast_all(view, workspace, state)


@kernel
def leave_out(view, state, i):
    """Foresee all robots but this one."""
    if state.tasks_alone:
        remove_task_forecast(view, state, i)
    else:
        forget(state, i)


@kernel
def put_back(view, workspace, state, i, steps, length):
    """Foresee this robot, too, with its new route."""
    if state.tasks_alone:
        add_task_forecast(view, workspace, state, i)
    elif length != NIL:
        forecast_one(view, workspace, state, i, steps, length)


@kernel
def decide(view, batch, decisions, memory, workspace):
    if batch.count[0] == 0:
        return
    state = CongestionState.of(memory)
    look_ahead(view, workspace, state)
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        steps = decisions.routing.steps[k]
        detour = 1 + np.int64(view.robots.goal_cell[i])
        if batch.reason[k] == REASON_PERIODIC and state.detour[i] == detour:
            continue
        leave_out(view, state, i)
        length = NIL
        around = around_what(batch.reason[k])
        if around:
            length = time_dependent_path(view, workspace, state, i, around, steps)
        state.detour[i] = 0 if length == NIL else detour
        if length == NIL:
            length = time_dependent_path(view, workspace, state, i, 0, steps)
            length = around_closed(view, workspace, i, steps, length)
        if length != NIL:
            decisions.routing.route_length[k] = length
        put_back(view, workspace, state, i, steps, length)
    forget_all(state)


class Congestion(Strategy):
    """Least cost through the predicted traffic: a move costs 1 + beta for each other robot in its
    zone."""

    layer = "routing"
    Parameters = SharedPlans
    compiled = decide

    def __init__(self, parameters=None):
        super().__init__(parameters)
        self.period = self.parameters.replan_period

    def reset(self, view):
        return congestion_state(view, self.parameters)
