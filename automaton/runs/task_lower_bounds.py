"""Lower bounds of task times: the legs of a task driven on the empty floor; detours by streets."""

from __future__ import annotations

import numpy as np

from automaton.engine.distance_tables import UNREACHABLE
from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import (
    end_of_stops,
    first_cell,
    has_load,
    headings_of,
    limited_ticks,
)
from automaton.engine.search import (
    STARTED,
    TURNED_AHEAD,
    TURNED_BEHIND,
    begin_search,
    distance,
    guided_heading,
    pop,
    reach,
    shortest_distance,
)
from automaton.engine.state import (
    ACTION_MOVE,
    ACTION_TURN,
    MAY_TURN,
    NIL,
)
from automaton.strategy.placing import dropoff_cell, pickup_cell

POSE_MASK = (1 << 32) - 1  # key of the priority queue: estimated ticks << 32 | pose


@kernel
def min_drive_ticks(view, workspace, which, out):
    """out[order] = least driving ticks of each order in `which`: to its source, then to its target.

    Orders with stops are driven from stop to stop.

    The first leg begins at the pose in which the order was taken, the second one with the heading in
    which the first one ends; of several headings that are equally fast, the best counts. Slots are
    served from their access cells, by the type of the robot that last took the order. UNREACHABLE if
    no way exists.
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
            ticks = shortest_distance(view, workspace, robot_type, origin, heading, access_cell)
            loaded = robot_type + view.rules.loaded_types
            ticks += least_over_stops(view, workspace, loaded, access_cell, NIL, order)
            out[order] = min(ticks, UNREACHABLE)
            continue
        end = dropoff_cell(view, robot_type, last_slot(orders, order), access_cell)
        out[order] = least_by(view, workspace, robot_type, start, access_cell, end)


@kernel
def least_way_ticks(view, workspace, which, out):
    """out[k] = least driving ticks of order which[k], from its load by way of its stops to its target.

    An order without a load starts at the pose in which it was taken. All other legs begin with their
    best heading. UNREACHABLE if no way exists.
    """
    for k in range(which.shape[0]):
        out[k] = ticks_of_legs(view, workspace, which[k], False, False)


@kernel
def guided_way_ticks(view, workspace, which, out):
    """out[k] = driving ticks of order which[k] on the empty floor, from the pose in which it was taken:
    by the ways that the weights of streets choose, and by the shortest ways.

    Each leg but the first begins with its best heading. Both 0 if no way exists.
    """
    for k in range(which.shape[0]):
        guided = ticks_of_legs(view, workspace, which[k], True, True)
        is_reached = guided < UNREACHABLE
        out[k, 0] = guided if is_reached else 0
        out[k, 1] = ticks_of_legs(view, workspace, which[k], True, False) if is_reached else 0


@kernel
def ticks_of_legs(view, workspace, order, with_fetching, is_guided):
    """Ticks of the legs of an order; `with_fetching`: also of that to its load; `is_guided`: by the ways
    of streets.
    """
    orders = view.orders
    robot_type, ticks = np.int64(orders.dispatched_type[order]), np.int64(0)
    here = np.int64(orders.dispatched_from[order])
    heading = np.int64(orders.dispatched_heading[order])
    loaded = has_load(orders, order)
    if loaded:
        source = pickup_cell(view, robot_type, orders.source[order], here)
        if with_fetching:
            ticks += ticks_of_leg(view, workspace, robot_type, here, heading, source, is_guided)
        here, heading = source, np.int64(NIL)
        robot_type += view.rules.loaded_types
    for stop in range(orders.first_stop[order], end_of_stops(view, order)):
        if view.stops.done[stop] < orders.dispatched[order]:
            continue
        to = np.int64(view.stops.cell[stop])
        ticks += ticks_of_leg(view, workspace, robot_type, here, heading, to, is_guided)
        here, heading = to, np.int64(NIL)
    if loaded:
        end = dropoff_cell(view, robot_type, last_slot(orders, order), here)
        ticks += ticks_of_leg(view, workspace, robot_type, here, heading, end, is_guided)
    return min(ticks, UNREACHABLE)


@kernel
def ticks_of_leg(view, workspace, robot_type, here, heading, to, is_guided):
    """Ticks of a leg; heading NIL: from the best heading, by cost where streets guide robots."""
    if not is_guided:
        return least_leg(view, workspace, robot_type, here, heading, to)
    if heading == NIL:
        heading = guided_heading(view, workspace, robot_type, here, to)
    return distance(view, workspace, robot_type, here, heading, to)


@kernel
def detour_ahead(view, workspace, i):
    """Ticks by which streets make the way of robot i to its goal longer than the shortest."""
    robots = view.robots
    here, goal = np.int64(first_cell(robots, i)), np.int64(robots.goal_cell[i])
    if here == NIL or goal == NIL:
        return np.int64(0)
    robot_type, heading = np.int64(robots.type[i]), np.int64(robots.heading[i])
    shortest = shortest_distance(view, workspace, robot_type, here, heading, goal)
    return distance(view, workspace, robot_type, here, heading, goal) - shortest


@kernel
def last_slot(orders, order):
    """The target slot of a finished order; for a pod the slot in which it was stored."""
    target = np.int64(orders.target[order])
    return np.int64(orders.current_slot[order]) if target == NIL else target


@kernel
def least_leg(view, workspace, robot_type, here, heading, to):
    """Least ticks from one cell to another; heading NIL: from the best heading."""
    best = np.int64(UNREACHABLE)
    for begin in range(view.grid.headings):
        if heading in (NIL, begin):
            best = min(best, shortest_distance(view, workspace, robot_type, here, begin, to))
    return best


@kernel
def least_over_stops(view, workspace, robot_type, here, heading, order):
    """Least ticks from a cell by way of an order's stops to its target; UNREACHABLE if no way exists.

    `robot_type`: the type with the load, if the order has one.

    A lower bound: each leg but the first begins with its best heading. Only stops done since the order
    was last taken count. Leg and SERVE of a stop take at least one tick together, except for the first
    stop of an order with a load.
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
    """Least ticks from a pose to a cell, and from there with a load to another cell.

    UNREACHABLE if no way exists.

    A* with the Manhattan estimate finds every heading in which the first cell is reached soonest.
    """
    headings = view.grid.headings
    if headings == 1:
        to_access_cell = shortest_distance(view, workspace, robot_type, start, 0, access_cell)
        loaded = robot_type + view.rules.loaded_types
        return to_access_cell + shortest_distance(view, workspace, loaded, access_cell, 0, end)
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
            continue  # outdated: a better way to this pose has been found
        if pose // headings == access_cell:
            least = ticks
            loaded = robot_type + view.rules.loaded_types
            best = min(
                best,
                ticks
                + shortest_distance(view, workspace, loaded, access_cell, pose % headings, end),
            )
        size = go_on(view, workspace, search, size, robot_type, pose, ticks, access_cell)
    return best


@kernel
def go_on(view, workspace, search, size, robot_type, pose, ticks, access_cell):
    """Enter the successors of a pose into the queue; return its size."""
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
    """A lower bound of the ticks from a pose to a cell (Manhattan distance)."""
    cell, width = pose // view.grid.headings, view.grid.width
    left = abs(cell // width - target // width) + abs(cell % width - target % width)
    return left * view.rules.duration[robot_type, ACTION_MOVE]
