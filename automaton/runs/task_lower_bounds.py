"""The least time that a task takes: its legs driven on the empty floor."""

from __future__ import annotations

import numpy as np

from automaton.engine.distance_tables import UNREACHABLE
from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import end_of_stops, has_load, headings_of, limited_ticks
from automaton.engine.search import (
    STARTED,
    TURNED_AHEAD,
    TURNED_BEHIND,
    begin_search,
    distance,
    pop,
    reach,
)
from automaton.engine.state import (
    ACTION_MOVE,
    ACTION_TURN,
    MAY_TURN,
    NIL,
)
from automaton.strategy.placing import dropoff_cell, pickup_cell

POSE_MASK = (1 << 32) - 1  # a key of the queue: estimated ticks << 32 | pose


@kernel
def min_drive_ticks(view, workspace, which, out):
    """out[order] = least ticks of driving for each order in `which`: to its source, then to its target.

    With stops: from stop to stop.

    The first leg begins where and with the heading in which the order was taken, the second one
    with the heading in which the first one ends; of several that take the least ticks, the best
    counts. Slots are served from their access cells, by the type of robot that took the order last.
    UNREACHABLE if there is no way.
    """
    orders = view.orders
    for k in range(which.shape[0]):
        order = which[k]
        start = orders.dispatched_from[order] * view.grid.headings
        start += orders.dispatched_heading[order]
        robot_type = np.int64(orders.dispatched_type[order])
        origin = np.int64(orders.dispatched_from[order])
        if not has_load(orders, order):
            heading = np.int64(orders.dispatched_heading[order])
            out[order] = least_over_stops(view, workspace, robot_type, origin, heading, order)
            continue
        access_cell = pickup_cell(view, robot_type, orders.source[order], origin)
        if orders.first_stop[order] < orders.first_stop[order + 1]:
            heading = np.int64(orders.dispatched_heading[order])
            ticks = distance(view, workspace, robot_type, origin, heading, access_cell)
            loaded = robot_type + view.rules.loaded_types
            ticks += least_over_stops(view, workspace, loaded, access_cell, NIL, order)
            out[order] = min(ticks, UNREACHABLE)
            continue
        end = dropoff_cell(view, robot_type, last_slot(orders, order), access_cell)
        out[order] = least_by(view, workspace, robot_type, start, access_cell, end)


@kernel
def least_way_ticks(view, workspace, which, out):
    """out[k] = least ticks of driving the way of order which[k], from its load over its stops to its end.

    Without a load: from where and with the heading in which it was taken. Each leg else begins with
    the heading that is best for it. UNREACHABLE if there is no way.
    """
    orders = view.orders
    for k in range(which.shape[0]):
        order = which[k]
        robot_type = np.int64(orders.dispatched_type[order])
        here = np.int64(orders.dispatched_from[order])
        heading = np.int64(orders.dispatched_heading[order])
        loaded = has_load(orders, order)
        if loaded:
            here = pickup_cell(view, robot_type, orders.source[order], here)
            heading = np.int64(NIL)
            robot_type += view.rules.loaded_types
        ticks = np.int64(0)
        for stop in range(orders.first_stop[order], end_of_stops(view, order)):
            to = np.int64(view.stops.cell[stop])
            ticks += least_leg(view, workspace, robot_type, here, heading, to)
            here, heading = to, np.int64(NIL)
        if loaded:
            end = dropoff_cell(view, robot_type, last_slot(orders, order), here)
            ticks += least_leg(view, workspace, robot_type, here, heading, end)
        out[k] = min(ticks, UNREACHABLE)


@kernel
def last_slot(orders, order):
    """Where the load of an order that is done was to be brought; a pod: where it was stored."""
    target = np.int64(orders.target[order])
    return np.int64(orders.current_slot[order]) if target == NIL else target


@kernel
def least_leg(view, workspace, robot_type, here, heading, to):
    """Least ticks from a cell to another one; heading NIL: from that which is best."""
    best = np.int64(UNREACHABLE)
    for begin in range(view.grid.headings):
        if heading in (NIL, begin):
            best = min(best, distance(view, workspace, robot_type, here, begin, to))
    return best


@kernel
def least_over_stops(view, workspace, robot_type, here, heading, order):
    """Least ticks from a cell over the stops of an order, and to its target; UNREACHABLE if no way.

    `robot_type`: with the load, if the order has one.

    A bound: each leg but the first one begins with the heading that is best for it. Only the stops
    that were done since the order was last taken count. A stop takes its SERVE, and a tick at least
    but for the first one of a load.
    """
    orders, stops = view.orders, view.stops
    ticks, least = np.int64(0), np.int64(0 if has_load(orders, order) else 1)
    for stop in range(orders.first_stop[order], end_of_stops(view, order)):
        if stops.done[stop] < orders.dispatched[order]:
            continue
        to = np.int64(stops.cell[stop])
        leg = least_leg(view, workspace, robot_type, here, heading, to)
        ticks = min(ticks + max(leg + stops.ticks[stop], least), UNREACHABLE)
        here, heading, least = to, np.int64(NIL), np.int64(1)
    if has_load(orders, order):
        end = dropoff_cell(view, robot_type, last_slot(orders, order), here)
        ticks += least_leg(view, workspace, robot_type, here, heading, end)
    return min(ticks, UNREACHABLE)


@kernel
def least_by(view, workspace, robot_type, start, access_cell, end):
    """Least ticks from a pose to a cell, and from there with a load to another one.

    UNREACHABLE if there is no way.

    A* with the Manhattan estimate, to every heading in which the first cell is reached soonest.
    """
    headings = view.grid.headings
    if headings == 1:
        to_access_cell = distance(view, workspace, robot_type, start, 0, access_cell)
        loaded = robot_type + view.rules.loaded_types
        return to_access_cell + distance(view, workspace, loaded, access_cell, 0, end)
    search = begin_search(workspace)
    size = reach(
        workspace, search, 0, start, 0, estimate(view, robot_type, start, access_cell), STARTED
    )
    least = best = UNREACHABLE
    while size > 0 and workspace.stop[0] == 0:
        key = pop(workspace.heap, size)
        size -= 1
        pose = key & POSE_MASK
        ticks = workspace.cost[pose]
        if (key >> 32) > least:
            break
        if (key >> 32) != ticks + estimate(view, robot_type, pose, access_cell):
            continue  # a better way to this pose was found meanwhile
        if pose // headings == access_cell:
            least = ticks
            loaded = robot_type + view.rules.loaded_types
            best = min(
                best,
                ticks + distance(view, workspace, loaded, access_cell, pose % headings, end),
            )
        size = go_on(view, workspace, search, size, robot_type, pose, ticks, access_cell)
    return best


@kernel
def go_on(view, workspace, search, size, robot_type, pose, ticks, access_cell):
    """Enter the poses that follow on a pose into the queue; returns its size."""
    grid, duration, type_cell_flags = (
        view.grid,
        view.rules.duration[robot_type],
        view.grid.type_cell_flags[robot_type],
    )
    cell, heading = pose // grid.headings, pose % grid.headings
    headings = headings_of(grid, robot_type)
    for way in range(heading, 4, headings):
        if (type_cell_flags[cell] >> way) & 1:
            to = (cell + grid.offset[way]) * grid.headings + heading
            left = estimate(view, robot_type, to, access_cell)
            moved = ticks + limited_ticks(grid, duration[ACTION_MOVE], cell, way)
            size = reach(workspace, search, size, to, moved, left, way)
    if headings > 1 and type_cell_flags[cell] & MAY_TURN:
        left = estimate(view, robot_type, pose, access_cell)
        for k in range(2):
            to = cell * grid.headings + ((heading + 1 - 2 * k) & (headings - 1))
            how = TURNED_BEHIND if k else TURNED_AHEAD
            size = reach(workspace, search, size, to, ticks + duration[ACTION_TURN], left, how)
    return size


@kernel
def estimate(view, robot_type, pose, target):
    """Ticks from a pose to a cell at least."""
    cell, width = pose // view.grid.headings, view.grid.width
    left = abs(cell // width - target // width) + abs(cell % width - target % width)
    return left * view.rules.duration[robot_type, ACTION_MOVE]
