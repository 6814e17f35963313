"""What is expected of others by who knows their tasks and not their plans (Bhattathiri, Li & Kuhl).

Of each robot it is known where and when its task began, where it picks up and where it drops. It is
predicted on the paths of plain A*, as if no robot delayed it: at the ticks that follow from that,
or, where shares are predicted, at any time with the probability ticks in a zone / ticks of the
task.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import CLOCK_TICK, NIL
from automaton.strategy.kernels import (
    dropoff_cell,
    heading_towards,
    pickup_cell,
    with_load,
    without_load,
)
from strategies.routing.congestion.known_plans import DROPS, PICKS, append, append_path, zone_of
from strategies.routing.congestion.plan_forecast import begin_step, ticks_of_step
from strategies.routing.congestion.zone_forecast import WHOLE, enter_zone, forget


@kernel
def add_task_forecasts(view, workspace, state):
    """Count all robots with the tasks that they have."""
    for i in range(view.robots.cell.shape[0]):
        state.visit_count[i] = 0
        add_task_forecast(view, workspace, state, i)


@kernel
def add_task_forecast(view, workspace, state, i):
    """Count robot i."""
    if view.robots.order[i] == NIL:
        state.task[i] = 0
        return
    plan_task(view, workspace, state, i)
    if state.shares:
        share_zones(view, state, i, 1)
    else:
        replay_task(view, state, i)


@kernel
def remove_task_forecast(view, state, i):
    """Take robot i out of what is expected."""
    if state.shares == 0:
        forget(state, i)
    elif state.task[i] != 0:
        share_zones(view, state, i, -1)


@kernel
def plan_task(view, workspace, state, i):
    """Plan the way of robot i's whole task; the plan stays until the task is over."""
    orders, headings, order = view.orders, view.grid.headings, np.int64(view.robots.order[i])
    task = (np.int64(orders.dispatched[order]) << 32) | (order + 1)
    if state.task[i] == task:
        return
    state.task[i] = task
    state.step_count[i] = 0
    if orders.source[order] == NIL:
        return  # without a load: its stops are planned one by one
    robot_type = without_load(view, np.int64(view.robots.type[i]))
    origin = np.int64(orders.dispatched_from[order])
    access_cell = pickup_cell(view, robot_type, np.int64(orders.source[order]), origin)
    end = dropoff_cell(view, robot_type, np.int64(orders.target[order]), access_cell)
    if access_cell == NIL or end == NIL:
        return  # another type does a part of the way
    heading = np.int64(orders.dispatched_heading[order])
    append_path(view, workspace, state, i, robot_type, origin * headings + heading, access_cell)
    if state.step_count[i] > 0:
        step = np.int64(state.steps[i, state.step_count[i] - 1])
        heading = heading_towards(view.grid, robot_type, step)
    append(state, i, PICKS)
    loaded = with_load(view, robot_type)
    append_path(view, workspace, state, i, loaded, access_cell * headings + heading, end)
    append(state, i, DROPS)


@kernel
def begin_task(view, state, i):
    """Put robot i back to where its task began."""
    order = np.int64(view.robots.order[i])
    state.place[i] = view.orders.dispatched_from[order]
    state.heading[i] = view.orders.dispatched_heading[order]
    state.travel[i] = state.heading[i]
    state.step[i] = 0
    state.in_bay[i] = 0
    state.robot_type[i] = without_load(view, np.int64(view.robots.type[i]))


@kernel
def replay_task(view, state, i):
    """Enter robot i's visits from now on, as if no robot had delayed it or will."""
    begin_task(view, state, i)
    state.zone[i] = NIL
    state.since[i] = 0
    tick = np.int64(view.orders.dispatched[view.robots.order[i]]) - view.clock[CLOCK_TICK]
    while state.step[i] < state.step_count[i] and tick < state.horizon:
        zone = zone_of(view.grid, state.place[i], state.travel[i])
        enter_zone(state, i, zone, max(tick, 0))
        tick += ticks_of_step(view, state, i, 0)
        begin_step(view, state, i)
    enter_zone(state, i, NIL, min(max(tick, 0), state.horizon))


@kernel
def share_zones(view, state, i, sign):
    """Add robot i's shares of its zones to those of all, or take them away (sign -1).

    A task that takes no time, such as a pick and a drop of 0 ticks where the robot is, has none.
    """
    begin_task(view, state, i)
    ticks = 0
    while state.step[i] < state.step_count[i]:
        ticks += ticks_of_step(view, state, i, 0)
        begin_step(view, state, i)
    if ticks == 0:
        return
    begin_task(view, state, i)
    while state.step[i] < state.step_count[i]:
        zone = zone_of(view.grid, state.place[i], state.travel[i])
        began = ticks_of_step(view, state, i, 0)
        if zone != NIL:
            state.zone_share[zone] += sign * (began * WHOLE // ticks)
        begin_step(view, state, i)
