"""Routes around the congestion to come (shared plans, searched in time).

All plans are replayed ahead with the slow zones of the world, so it is known how many robots will be
in which zone at which tick. Robots that need a route get the cheapest one through that, one after
another in the order of their identities, each seeing the routes of those before it. For comparison,
robots may predict less: where the others would be if no robot delayed them on the A* paths of their
tasks (`tasks`), or which share of their time each of them spends in a zone so (`task-averages`). A
detour around robots that stood in the way is driven to its end: made again, it would lead back to
where they stand.
"""

from collections.abc import Sequence

import numpy as np

from automaton.engine.state import NIL, REASON_AROUND_ROBOTS, REASON_PERIODIC, Memory, World
from automaton.strategy.kernels import kernel
from automaton.strategy.layer import Strategy, memory_of
from strategies.routing.congestion.congestion_parameters import SharedPlans
from strategies.routing.congestion.plan_forecast import forecast_all, forecast_one
from strategies.routing.congestion.task_forecast import (
    add_task_forecast,
    add_task_forecasts,
    remove_task_forecast,
)
from strategies.routing.congestion.time_dependent import time_dependent_path
from strategies.routing.congestion.zone_forecast import (
    KEPT,
    OWN_PARAMETERS,
    forget,
    forget_all,
    row_size,
    shared_size,
)

BETA = OWN_PARAMETERS
BY_TASKS = OWN_PARAMETERS + 1  # 1: nothing is known of the others but their tasks
DETOUR = KEPT  # memory.per_robot: 1 + the goal cell to which a detour leads, or 0


@kernel
def look_ahead(view, workspace, memory):
    """Foresee all robots, by their plans or by their tasks alone."""
    if memory.parameters[BY_TASKS]:
        add_task_forecasts(view, workspace, memory)
    else:
        forecast_all(view, workspace, memory)


@kernel
def leave_out(view, memory, i):
    """Foresee all robots but this one."""
    if memory.parameters[BY_TASKS]:
        remove_task_forecast(view, memory, i)
    else:
        forget(memory, i)


@kernel
def put_back(view, workspace, memory, i, steps, length):
    """Foresee this robot, too, with its new route."""
    if memory.parameters[BY_TASKS]:
        add_task_forecast(view, workspace, memory, i)
    elif length != NIL:
        forecast_one(view, workspace, memory, i, steps, length)


@kernel
def decide(view, batch, decisions, memory, workspace):
    if batch.count[0] == 0:
        return
    beta = memory.parameters[BETA]
    look_ahead(view, workspace, memory)
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        steps = decisions.routing.steps[k]
        detour = 1 + np.int64(view.robots.goal_cell[i])
        if batch.reason[k] == REASON_PERIODIC and memory.per_robot[i, DETOUR] == detour:
            continue
        leave_out(view, memory, i)
        length = NIL
        if batch.reason[k] == REASON_AROUND_ROBOTS:
            length = time_dependent_path(view, workspace, memory, beta, i, True, steps)
        memory.per_robot[i, DETOUR] = 0 if length == NIL else detour
        if length == NIL:
            length = time_dependent_path(view, workspace, memory, beta, i, False, steps)
        if length != NIL:
            decisions.routing.route_length[k] = length
        put_back(view, workspace, memory, i, steps, length)
    forget_all(memory)


def forecast_memory(
    view: World, horizon: int, own: Sequence[int] = (), shares: bool = False
) -> Memory:
    """Memory for `forecast_all` over so many ticks, at most 65,535.

    Nothing in it outlasts a call but memory.per_robot[:, KEPT], a number of the strategy's own for
    each robot. `own`: further parameters, in memory.parameters[OWN_PARAMETERS:]. `shares`: what is
    predicted of a zone is a share of all ticks (`add_task_forecasts`).
    """
    traffic_zone_count = view.grid.traffic_zone_count
    shared = shared_size(traffic_zone_count, horizon)
    return memory_of(
        view, row_size(horizon), shared, parameters=(horizon, traffic_zone_count, int(shares), *own)
    )


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
        beta = round(1000 * self.parameters.beta)
        knows = self.parameters.forecast
        own = (beta, int(knows != "plans"))
        return forecast_memory(view, self.parameters.horizon, own, shares=knows == "task-averages")
