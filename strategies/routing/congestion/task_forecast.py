"""What is expected of others by who knows their tasks and not their plans (Bhattathiri, Li & Kuhl).

Of each robot it is known where and when its task began, where it picks up and where it drops. It is
predicted on the paths of plain A*, as if no robot delayed it: at the ticks that follow from that,
or, where shares are predicted, at any time with the probability ticks in a zone / ticks of the
task.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import CLOCK_TICK, NIL
from automaton.strategy.kernels import dropoff_cell, pickup_cell
from strategies.routing.congestion.known_plans import DROPS, PICKS, append, append_path, zone_of
from strategies.routing.congestion.plan_forecast import begin_step, ticks_of_step
from strategies.routing.congestion.zone_forecast import (
    COLUMNS,
    HEADING,
    HORIZON,
    IN_BAY,
    PLACE,
    SHARES,
    SINCE,
    STEP,
    STEPS,
    TASK,
    TRAVEL,
    VISITS,
    WHOLE,
    ZONE,
    enter_zone,
    first_share,
    forget,
)


@kernel
def add_task_forecasts(view, workspace, memory):
    """Count all robots with the tasks that they have."""
    for i in range(view.robots.cell.shape[0]):
        memory.per_robot[i, VISITS] = 0
        add_task_forecast(view, workspace, memory, i)


@kernel
def add_task_forecast(view, workspace, memory, i):
    """Count robot i."""
    if view.robots.order[i] == NIL:
        memory.per_robot[i, TASK] = 0
        return
    plan_task(view, workspace, memory, i)
    if memory.parameters[SHARES]:
        share_zones(view, memory, i, 1)
    else:
        replay_task(view, memory, i)


@kernel
def remove_task_forecast(view, memory, i):
    """Take robot i out of what is expected."""
    if memory.parameters[SHARES] == 0:
        forget(memory, i)
    elif memory.per_robot[i, TASK] != 0:
        share_zones(view, memory, i, -1)


@kernel
def plan_task(view, workspace, memory, i):
    """Have robot i's row hold the way of its whole task; it stays there until the task is over."""
    orders, headings = view.orders, view.grid.headings
    order, row = np.int64(view.robots.order[i]), memory.per_robot[i]
    task = (np.int64(orders.dispatched[order]) << 32) | (order + 1)
    if row[TASK] == task:
        return
    row[TASK] = task
    row[STEPS] = 0
    robot_type, origin = view.robots.type[i], np.int64(orders.dispatched_from[order])
    access_cell = pickup_cell(view, robot_type, np.int64(orders.source[order]), origin)
    end = dropoff_cell(view, robot_type, np.int64(orders.target[order]), access_cell)
    if access_cell == NIL or end == NIL:
        return  # another type does a part of the way
    heading = np.int64(orders.dispatched_heading[order])
    pose = np.int64(orders.dispatched_from[order]) * headings + heading
    append_path(view, workspace, memory, i, pose, access_cell)
    if row[STEPS] > 0:
        heading = row[COLUMNS + row[STEPS] - 1] & (headings - 1)
    append(memory, i, PICKS)
    append_path(view, workspace, memory, i, access_cell * headings + heading, end)
    append(memory, i, DROPS)


@kernel
def begin_task(view, memory, i):
    """Put robot i back to where its task began."""
    order, row = np.int64(view.robots.order[i]), memory.per_robot[i]
    row[PLACE] = view.orders.dispatched_from[order]
    row[HEADING] = view.orders.dispatched_heading[order]
    row[TRAVEL] = row[HEADING]
    row[STEP] = 0
    row[IN_BAY] = 0


@kernel
def replay_task(view, memory, i):
    """Enter robot i's visits from now on, as if no robot had delayed it or will."""
    begin_task(view, memory, i)
    row, horizon = memory.per_robot[i], memory.parameters[HORIZON]
    row[ZONE] = NIL
    row[SINCE] = 0
    tick = np.int64(view.orders.dispatched[view.robots.order[i]]) - view.clock[CLOCK_TICK]
    while row[STEP] < row[STEPS] and tick < horizon:
        zone = zone_of(view.grid, row[PLACE], row[TRAVEL])
        enter_zone(memory, i, zone, max(tick, 0))
        tick += ticks_of_step(view, i, row, 0)
        begin_step(view, row)
    enter_zone(memory, i, NIL, min(max(tick, 0), horizon))


@kernel
def share_zones(view, memory, i, sign):
    """Add robot i's shares of its zones to those of all, or take them away (sign -1)."""
    row, first = memory.per_robot[i], first_share(memory)
    begin_task(view, memory, i)
    ticks = 0
    while row[STEP] < row[STEPS]:
        ticks += ticks_of_step(view, i, row, 0)
        begin_step(view, row)
    begin_task(view, memory, i)
    while row[STEP] < row[STEPS]:
        zone, began = zone_of(view.grid, row[PLACE], row[TRAVEL]), ticks_of_step(view, i, row, 0)
        if zone != NIL:
            memory.shared[first + zone] += sign * (began * WHOLE // ticks)
        begin_step(view, row)
