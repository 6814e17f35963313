"""Who may be matched with what: orders that wait, marked in the cells where they begin, and robots.

An order is called by its place in the list of open orders, which is in the sequence of the releases.
"""

import numpy as np

from automaton.engine.jit.structs import SCRATCH, Struct, field
from automaton.engine.state import (
    CLOCK_NEXT_RELEASE,
    GOAL_CHARGE,
    NIL,
    ORDER_DELIVERED,
    ORDER_WAITING,
    REASON_PERIODIC,
    Array,
)
from automaton.strategy.kernels import (
    UNREACHABLE,
    cell_beside,
    distance,
    end_of_stops,
    first_cell,
    has_load,
    has_place,
    kernel,
    next_stop_cell,
    pickup_cell,
    types_of_robots,
)

TICK = 1000  # the cost of a tick on the way to an order
PRIORITY = 1 << 34  # what a priority of 1 more is worth: more than any way
MOST_PRIORITY = 100


class OpenOrders(Struct):
    """Orders that are known and not done."""

    order: Array = field("(p,) int32", "in the sequence of their releases")
    count: Array = field("(1,) int64", "how many they are")
    cursor: Array = field("(1,) int64", "entries of orders.release_sequence that were looked at")
    rest: Array = field(
        "(w,) int64",
        "by order: the cost of what follows on its first stop, and of its priority; (0,): none",
    )


class Marks(Struct, role=SCRATCH):
    """The orders that robots may get now, in the cells where they begin."""

    taken: Array = field(
        "(p,) uint8", "1 = the order at this place is not, or no longer, to be had"
    )
    head: Array = field("(C,) int32", "the first mark of a cell; NIL between calls", default=NIL)
    following: Array = field("(k,) int32", "the next mark of the cell, or NIL")
    place: Array = field("(k,) int32", "of the order")
    cell: Array = field("(k,) int32")
    count: Array = field("(2,) int64", "marks; orders")
    least_rest: Array = field("(1,) int64", "the least of what follows on a first stop")


class Seekers(Struct, role=SCRATCH):
    """The robots that may get an order now; by storage index but for `robot`."""

    robot: Array = field("(robots,) int32", "storage indices")
    count: Array = field("(1,) int64")
    entry: Array = field("(robots,) int32", "its place in the batch")
    seeks: Array = field("(robots,) uint8", "1 = it is one of them; zero between calls")
    pose: Array = field(
        "(robots,) int32", "where it is free to drive on: cell * headings + heading"
    )
    delay: Array = field("(robots,) int64", "ticks until then")
    place: Array = field("(robots,) int32", "of the order that it has and may lose, or NIL")
    head: Array = field("(P,) int32", "the first robot at a pose; NIL between calls", default=NIL)
    following: Array = field("(robots,) int32", "the next robot at its pose, or NIL")


@kernel
def update_open_orders(view, open_orders):
    """Leave out what is done, and add what was released; returns the first place of that."""
    count = 0
    for place in range(open_orders.count[0]):
        order = open_orders.order[place]
        if view.orders.state[order] != ORDER_DELIVERED:
            open_orders.order[count] = order
            count += 1
    first = count
    for k in range(open_orders.cursor[0], view.clock[CLOCK_NEXT_RELEASE]):
        order = np.int64(view.orders.release_sequence[k])
        if order != NIL and view.orders.state[order] != ORDER_DELIVERED:
            open_orders.order[count] = order
            count += 1
    open_orders.cursor[0] = view.clock[CLOCK_NEXT_RELEASE]
    open_orders.count[0] = count
    return first


@kernel
def weigh_rest(view, workspace, open_orders, first, weight):
    """Enter what the orders from place `first` on cost beside the way to their first stop.

    What follows on it, in thousandths: from stop to stop as the first type of robots drives it, with
    the heading that is best each time; of a pod from where it stands, and back there. And more for each
    priority that is higher than theirs. Trips of pods change with their lines, so all are looked at.
    """
    orders = view.orders
    carries_pods = view.trips.pod.shape[0] > 0
    for place in range(0 if carries_pods else first, open_orders.count[0]):
        order = np.int64(open_orders.order[place])
        ticks, stop = np.int64(0), np.int64(orders.first_stop[order])
        pod_cell = NIL
        if weight and carries_pods and orders.current_slot[order] != NIL:
            pod_cell = np.int64(view.slots.cell[orders.current_slot[order]])
            ticks = visit_ticks(view, workspace, order, pod_cell, stop)
        for following in range(stop + 1, end_of_stops(view, order) if weight else stop):
            here = np.int64(view.stops.cell[following - 1])
            ticks += visit_ticks(view, workspace, order, here, following)
            stop = np.int64(following)
        if pod_cell != NIL:
            ticks += leg_ticks(view, workspace, order, np.int64(view.stops.cell[stop]), pod_cell)
        priority = np.int64(view.orders.priority[order])
        open_orders.rest[order] = weight * ticks + (MOST_PRIORITY - priority) * PRIORITY


@kernel
def leg_ticks(view, workspace, order, here, to):
    """Ticks of a leg of an order with the heading that is best, 0 if there is no way."""
    robot_type = view.rules.loaded_types if has_load(view.orders, order) else 0
    leg = np.int64(UNREACHABLE)
    for heading in range(view.grid.headings):
        leg = min(leg, distance(view, workspace, robot_type, here, heading, to))
    return leg if leg < UNREACHABLE else np.int64(0)


@kernel
def visit_ticks(view, workspace, order, here, stop):
    """Ticks from a cell to a stop, and of the visit there."""
    leg = leg_ticks(view, workspace, order, here, np.int64(view.stops.cell[stop]))
    return max(leg + np.int64(view.stops.ticks[stop]), 1)


@kernel
def rest_of(open_orders, order):
    """The cost of what follows on the first stop of an order."""
    return np.int64(open_orders.rest[order]) if open_orders.rest.shape[0] else np.int64(0)


@kernel
def collect_seekers(view, batch, seekers, again):
    """List the robots of a batch that may get an order; `again`: and those that have not begun theirs."""
    robots, headings = view.robots, view.grid.headings
    seekers.count[0] = 0
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        if not may_seek(view, i, batch.reason[k], again):
            continue
        seekers.robot[seekers.count[0]] = i
        seekers.count[0] += 1
        seekers.entry[i] = k
        seekers.seeks[i] = 1
        seekers.pose[i] = first_cell(robots, i) * headings + robots.heading[i]
        seekers.delay[i] = robots.busy[i]
        seekers.place[i] = NIL


@kernel
def may_seek(view, i, reason, again):
    """Whether robot i, asked for a reason, may get an order."""
    robots, order = view.robots, view.robots.order[i]
    if robots.load[i] != NIL:
        return False
    if order != NIL:
        return (
            again and view.orders.state[order] == ORDER_WAITING and not has_load(view.orders, order)
        )
    if robots.goal_type[i] == GOAL_CHARGE and robots.charging_interruptible[i] == 0:
        return False
    return again or reason != REASON_PERIODIC


@kernel
def mark_orders(view, out, open_orders, marks, seekers):
    """Mark the orders that wait and are free, or are those of robots that seek."""
    marks.count[:] = 0
    marks.least_rest[0] = 1 << 50
    for back in range(open_orders.count[0]):
        place = (
            open_orders.count[0] - 1 - back
        )  # so that the marks of a cell begin with the earliest
        order = np.int64(open_orders.order[place])
        marks.taken[place] = 1
        if view.orders.state[order] != ORDER_WAITING or out.order_taken[order]:
            continue
        holder = np.int64(view.orders.reserved_by[order])
        if view.trips.pod.shape[0] > 0 and not has_place(view, order):
            continue
        if holder != NIL:
            i = np.int64(view.robots.at_index[holder])
            if seekers.seeks[i] == 0:
                continue
            if view.robots.order[i] == order:
                seekers.place[i] = place
        marks.taken[place] = 0
        marks.count[1] += 1
        marks.least_rest[0] = min(marks.least_rest[0], rest_of(open_orders, order))
        if not has_load(view.orders, order):
            mark(marks, next_stop_cell(view, order), place)
        else:
            mark_load(view, marks, order, place)


@kernel
def is_offered_to_another(view, i, order):
    """Whether the trip of a pod is reserved for a robot beneath it that is not robot i."""
    holder = view.orders.reserved_by[order]
    return view.trips.pod.shape[0] > 0 and holder != NIL and holder != view.robots.identity[i]


@kernel
def mark_load(view, marks, order, place):
    """Mark an order in the cells from which robots of any type pick up its load."""
    slot = np.int64(view.orders.current_slot[order])
    if view.rules.nearest_access:
        for direction in range(4):
            cell = cell_beside(view, slot, direction)
            if cell != NIL:
                mark(marks, cell, place)
        return
    for robot_type in range(types_of_robots(view)):
        cell = pickup_cell(view, robot_type, slot, NIL)
        known = cell == NIL
        for other in range(robot_type):
            known = known or pickup_cell(view, other, slot, NIL) == cell
        if not known:
            mark(marks, cell, place)


@kernel
def mark(marks, cell, place):
    k = marks.count[0]
    marks.count[0] = k + 1
    marks.place[k] = place
    marks.cell[k] = cell
    marks.following[k] = marks.head[cell]
    marks.head[cell] = k


@kernel
def enter_poses(seekers):
    """Enter the robots that seek at their poses, of each pose the least identity first."""
    for k in range(seekers.count[0]):
        i = np.int64(seekers.robot[seekers.count[0] - 1 - k])  # the batch is sorted by identity
        seekers.following[i] = seekers.head[seekers.pose[i]]
        seekers.head[seekers.pose[i]] = i


@kernel
def clear_candidates(marks, seekers):
    """Leave nothing behind for the next call."""
    for k in range(marks.count[0]):
        marks.head[marks.cell[k]] = NIL
    for k in range(seekers.count[0]):
        i = seekers.robot[k]
        seekers.head[seekers.pose[i]] = NIL
        seekers.seeks[i] = 0
