"""The cheapest order for a robot, and the cheapest robot for an order.

Waiting orders are marked in the cells where they begin, seeking robots at their poses. An order is
identified by its place in the list of open orders, which is in the sequence of releases.
"""

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    ACTION_TURN,
    GOAL_CHARGE,
    MAY_TURN,
    NIL,
    ORDER_DELIVERED,
    ORDER_WAITING,
    REASON_PERIODIC,
    SCRATCH,
    UNREACHABLE,
    Array,
    Struct,
    can_do,
    cell_beside,
    distance,
    end_of_stops,
    field,
    first_cell,
    has_load,
    has_place,
    headings_of,
    kernel,
    limited_ticks,
    next_stop_cell,
    pickup_cell,
    tables_fit,
    types_of_robots,
)

TICK_COST = 1000  # the cost of a tick to the start of an order
PRIORITY = 1 << 34  # the value of 1 more in priority: more than any path
MOST_PRIORITY = 100
NO_CANDIDATE = 1 << 60  # the cost without a candidate
COST_BITS = 32
COST_MASK = (1 << COST_BITS) - 1
U = np.uint64  # unsigned as an index: avoids the test for negative values


class OpenOrders(Struct):
    """Known, unfinished orders."""

    order: Array = field("(p,) int32", "orders in the sequence of their releases")
    count: int = field("() int64", "number of orders")
    cursor: int = field(
        "() int64", "number of entries of orders.release_sequence already processed"
    )
    rest: Array = field(
        "(w,) int64",
        "by order: the cost after its first stop and of its priority; shape (0,): none",
    )


class OrderMarks(Struct, role=SCRATCH):
    """The available orders, by the cells where they begin."""

    taken: Array = field("(p,) uint8", "1 = the order at this place is not available")
    head: Array = field("(C,) int32", "the first mark of a cell; NIL between calls", default=NIL)
    following: Array = field("(k,) int32", "the next mark of the cell, or NIL")
    place: Array = field("(k,) int32", "of the order")
    cell: Array = field("(k,) int32")
    count: Array = field("(2,) int64", "marks; orders")
    least_rest: int = field("() int64", "the least cost after a first stop")
    by_robot: Array = field("(a,) int32", "by identity: place of the order assigned to it, or NIL")


class SortedMarks(Struct, role=SCRATCH):
    """The marks by the cost after the first stop of their orders, least first."""

    is_used: int = field("() uint8", "1 = these marks and distance tables replace searches")
    rest: Array = field("(t,) int64", "cost after the first stop")
    place: Array = field("(t,) int32", "of the order")
    cell: Array = field("(t,) int32")
    x: Array = field("(t,) int32")
    y: Array = field("(t,) int32")
    ahead: Array = field(
        "(t,) int32", "if its order is taken: a later mark, none between is available"
    )


class Seekers(Struct, role=SCRATCH):
    """The robots that may get an order now; by storage index, except `robot`."""

    robot: Array = field("(robots,) int32", "storage indices")
    count: int = field("() int64")
    entry: Array = field("(robots,) int32", "its place in the batch")
    seeks: Array = field("(robots,) uint8", "1 = it may get an order; zero between calls")
    pose: Array = field(
        "(robots,) int32", "pose in which it becomes free: cell * headings + heading"
    )
    delay: Array = field("(robots,) int64", "ticks until then")
    place: Array = field("(robots,) int32", "place of the order that it has and may lose, or NIL")
    head: Array = field("(P,) int32", "the first robot at a pose; NIL between calls", default=NIL)
    following: Array = field("(robots,) int32", "the next robot at its pose, or NIL")


@kernel
def update_open_orders(view, open_orders):
    """Drop finished orders and add released ones; return the first place of the latter."""
    count = 0
    for place in range(open_orders.count):
        order = open_orders.order[place]
        if view.orders.state[order] != ORDER_DELIVERED:
            open_orders.order[count] = order
            count += 1
    first = count
    for k in range(open_orders.cursor, view.clock.next_release):
        order = np.int64(view.orders.release_sequence[k])
        if order != NIL and view.orders.state[order] != ORDER_DELIVERED:
            open_orders.order[count] = order
            count += 1
    open_orders.cursor = view.clock.next_release
    open_orders.count = count
    return first


@kernel
def weigh_rest(view, workspace, open_orders, first, weight):
    """Set the costs of the orders from place `first` on, except the drive to their first stop.

    The cost after the first stop, in thousandths, is the drive from stop to stop of the first robot
    type, with the best heading at each stop; for a pod, from its cell and back there. A lower priority
    adds to the cost. Trips of pods change with their lines, so all are computed again.
    """
    orders = view.orders
    carries_pods = view.trips.pod.shape[0] > 0
    for place in range(0 if carries_pods else first, open_orders.count):
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
    """Ticks of a leg of an order with the best heading, 0 without a path."""
    robot_type = view.rules.loaded_types if has_load(view.orders, order) else 0
    leg = np.int64(UNREACHABLE)
    for heading in range(view.grid.headings):
        leg = min(leg, distance(view, workspace, robot_type, here, heading, to))
    return leg if leg < UNREACHABLE else np.int64(0)


@kernel
def visit_ticks(view, workspace, order, here, stop):
    """Ticks from a cell to a stop, plus the visit there."""
    leg = leg_ticks(view, workspace, order, here, np.int64(view.stops.cell[stop]))
    return max(leg + np.int64(view.stops.ticks[stop]), 1)


@kernel
def rest_of(open_orders, order):
    """The cost of an order after its first stop."""
    return np.int64(open_orders.rest[order]) if open_orders.rest.shape[0] else np.int64(0)


@kernel
def collect_seekers(view, batch, seekers, again):
    """List the robots of a batch that may get an order; `again`: also those with an order not begun."""
    robots, headings = view.robots, view.grid.headings
    seekers.count = 0
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        if not may_seek(view, i, batch.reason[k], again):
            continue
        seekers.robot[seekers.count] = i
        seekers.count += 1
        seekers.entry[i] = k
        seekers.seeks[i] = 1
        seekers.pose[i] = first_cell(robots, i) * headings + robots.heading[i]
        seekers.delay[i] = robots.busy[i]
        seekers.place[i] = NIL


@kernel
def may_seek(view, i, reason, again):
    """Whether robot i may get an order, by the reason for which it is in the batch."""
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
    """Mark the waiting orders that are free or belong to seeking robots."""
    marks.count[:] = 0
    marks.least_rest = 1 << 50
    marks.by_robot[:] = NIL
    for back in range(open_orders.count):
        place = open_orders.count - 1 - back  # the first mark of a cell is the earliest order
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
        if view.rules.assigned:
            marks.by_robot[order % view.robots.cell.shape[0]] = place
        marks.count[1] += 1
        marks.least_rest = min(marks.least_rest, rest_of(open_orders, order))
        if not has_load(view.orders, order):
            mark(marks, next_stop_cell(view, order), place)
        else:
            mark_load(view, marks, order, place)


@kernel
def mark_load(view, marks, order, place):
    """Mark an order in all cells from which a robot of any type can pick up its load."""
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
    """Mark the seeking robots at their poses; at each pose, the least identity is first."""
    for k in range(seekers.count):
        i = np.int64(seekers.robot[seekers.count - 1 - k])  # the batch is sorted by identity
        seekers.following[i] = seekers.head[seekers.pose[i]]
        seekers.head[seekers.pose[i]] = i


@kernel
def clear_candidates(marks, seekers):
    """Clear all marks for the next call."""
    for k in range(marks.count[0]):
        marks.head[marks.cell[k]] = NIL
    for k in range(seekers.count):
        i = seekers.robot[k]
        seekers.head[seekers.pose[i]] = NIL
        seekers.seeks[i] = 0


# Look-ups, if the distance tables of all marked cells fit the memory.
#
# Orders cost the ticks to their start plus the cost after it. If the latter differ, a search must go on
# for long after its first candidate. So the marks are sorted by the cost after the start, and a robot
# looks through them until the rest of them cost more than its best order even without a drive there.


@kernel
def sort_marks(view, workspace, open_orders, marks, by_rest):
    """Sort the marks if orders are weighed and the tables fit."""
    count, types = marks.count[0], types_of_robots(view)
    is_weighed = open_orders.rest.shape[0] > 0 and view.trips.pod.shape[0] == 0
    by_rest.is_used = is_weighed and tables_fit(workspace, types * count)
    if by_rest.is_used == 0:
        return
    for k in range(count):
        by_rest.rest[k] = rest_of(open_orders, open_orders.order[marks.place[k]])
        by_rest.ahead[k] = k
    for at in range(count // 2 - 1, -1, -1):
        sink(by_rest, at, count)
    for last in range(count - 1, 0, -1):
        exchange(by_rest, 0, last)
        sink(by_rest, 0, last)
    for at in range(count):
        k = by_rest.ahead[at]
        by_rest.place[at] = marks.place[k]
        by_rest.cell[at] = marks.cell[k]
        by_rest.y[at] = marks.cell[k] // view.grid.width
        by_rest.x[at] = marks.cell[k] - by_rest.y[at] * view.grid.width
        by_rest.ahead[at] = at + 1


@kernel
def sink(by_rest, at, size):
    """Restore the heap of the greatest costs below `at`, for heapsort of `rest` and `ahead`."""
    while 2 * at + 1 < size:
        below = 2 * at + 1
        if below + 1 < size and by_rest.rest[below + 1] > by_rest.rest[below]:
            below += 1
        if by_rest.rest[below] <= by_rest.rest[at]:
            return
        exchange(by_rest, at, below)
        at = below


@kernel
def exchange(by_rest, a, b):
    by_rest.rest[a], by_rest.rest[b] = by_rest.rest[b], by_rest.rest[a]
    by_rest.ahead[a], by_rest.ahead[b] = by_rest.ahead[b], by_rest.ahead[a]


@kernel
def next_available(by_rest, marks, at):
    """The first mark of an available order from `at` on, or the number of marks."""
    later, count = at, marks.count[0]
    while later < count and marks.taken[U(by_rest.place[U(later)])]:
        later = np.int64(by_rest.ahead[U(later)])
    while at < later:
        following = np.int64(by_rest.ahead[U(at)])
        by_rest.ahead[U(at)] = later
        at = following
    return later


@kernel
def look_up_order(view, workspace, search, open_orders, marks, by_rest, seekers, i):
    """As find_order, by distance tables instead of a search."""
    search.found[0], search.found[1] = NO_CANDIDATE, NIL
    robot_type, headings = np.int64(view.robots.type[i]), view.grid.headings
    pose, had = np.int64(seekers.pose[i]), np.int64(seekers.place[i])
    cell, heading = pose // headings, pose % headings
    y = cell // view.grid.width
    x = cell - y * view.grid.width
    delay = TICK_COST * seekers.delay[i]
    move = TICK_COST * np.int64(view.rules.duration[robot_type, ACTION_MOVE])
    at = next_available(by_rest, marks, np.int64(0))
    while at < marks.count[0]:
        cost = delay + by_rest.rest[U(at)]
        if 2 * cost > search.found[0]:
            return
        near = move * (abs(by_rest.x[U(at)] - x) + abs(by_rest.y[U(at)] - y))
        if 2 * (cost + near) <= search.found[0]:
            to, place = np.int64(by_rest.cell[U(at)]), np.int64(by_rest.place[U(at)])
            if begins_here(view, i, np.int64(open_orders.order[place]), to):
                ticks = distance(view, workspace, robot_type, cell, heading, to)
                if ticks < UNREACHABLE:
                    offer(search, 2 * (cost + TICK_COST * ticks) + (place != had), place)
        at = next_available(by_rest, marks, at + 1)


@kernel
def look_up_assigned(view, workspace, search, open_orders, marks, seekers, i):
    """As find_order, if orders are assigned to robots: the only available order of robot i."""
    search.found[0], search.found[1] = NO_CANDIDATE, NIL
    place = np.int64(marks.by_robot[view.robots.identity[i]])
    if place == NIL:
        return
    order, headings = np.int64(open_orders.order[place]), view.grid.headings
    to, pose = next_stop_cell(view, order), np.int64(seekers.pose[i])
    robot_type = np.int64(view.robots.type[i])
    ticks = distance(view, workspace, robot_type, pose // headings, pose % headings, to)
    if ticks < UNREACHABLE and can_do(view, i, order):
        cost = TICK_COST * (ticks + seekers.delay[i]) + rest_of(open_orders, order)
        offer(search, 2 * cost + (place != seekers.place[i]), place)


# Searches on the empty floor that end at the first candidate.
#
#     forwards    from the pose of a robot to a cell with a mark
#     backwards   against the direction of travel, from the start of an order to a robot
#
# Open poses are in buckets, one for each tick of cost, used cyclically. So a search expands only poses
# nearer than its result, for any size of floor, and needs no distance tables for the thousands of cells
# in which orders begin. Results are in thousandths of ticks, doubled: even for an existing pair, plus
# one for a new pair, so that a robot keeps its order in a tie.


class PairSearch(Struct, role=SCRATCH):
    """Buckets and labels."""

    reached: Array = field("(P,) int64", "by pose: number of the search << 32 | cost")
    number: int = field("() int64", "number of searches")
    poses: int = field("() int64", "number of expanded poses, the cost of searches")
    bucket: Array = field(
        "(power of two,) int32",
        "the first entry of a cost, modulo the number of buckets; NIL between searches",
        default=NIL,
    )
    pose: Array = field("(E,) int32", "of an entry")
    following: Array = field("(E,) int32", "the next entry of its bucket, or NIL")
    entries: int = field("() int64")
    found: Array = field("(2,) int64", "cost, and the order's place or the robot's storage index")


@kernel
def find_order(view, stop, search, open_orders, marks, seekers, i):
    """search.found: the cheapest available order for robot i, ties by the earliest."""
    begin(search)
    reach(search, np.int64(seekers.pose[i]), 0)
    robot_type, headings = np.int64(view.robots.type[i]), view.grid.headings
    shift = headings >> 1  # 1, 2 or 4 headings
    delay = TICK_COST * seekers.delay[i]
    cost = next_cost(search, 0)
    while cost != NIL and stop[0] == 0:
        if 2 * (TICK_COST * cost + delay + marks.least_rest) > search.found[0]:
            break
        pose = next_pose(search, cost)
        if pose == NIL:
            cost = next_cost(search, cost)
            continue
        search.poses += 1
        cell = pose >> shift
        if marks.head[U(cell)] != NIL:
            look_at_marks(
                view, search, open_orders, marks, seekers, i, cell, TICK_COST * cost + delay
            )
        go_on(view, search, robot_type, cell, pose & (headings - 1), cost)
    search.bucket[:] = NIL


@kernel
def look_at_marks(view, search, open_orders, marks, seekers, i, cell, cost):
    """Keep the best order that begins in a cell which robot i reaches at this cost."""
    had = np.int64(seekers.place[i])
    weighed = open_orders.rest.shape[0] > 0
    k = marks.head[cell]
    while k != NIL and marks.taken[marks.place[k]]:
        k = marks.following[k]
    marks.head[cell] = k  # taken orders before it are never examined again
    while k != NIL:
        place = np.int64(marks.place[k])
        order = np.int64(open_orders.order[place])
        if marks.taken[place] == 0 and begins_here(view, i, order, cell):
            offer(search, 2 * (cost + rest_of(open_orders, order)) + (place != had), place)
            if not weighed and had == NIL:
                return  # the other orders of the cell cost the same and are later
        k = marks.following[k]


@kernel
def begins_here(view, i, order, cell):
    """Whether robot i can do an order and begin it in this cell."""
    if not can_do(view, i, order) or is_offered_to_another(view, i, order):
        return False
    if not has_load(view.orders, order) or view.rules.nearest_access:
        return True
    slot = np.int64(view.orders.current_slot[order])
    return pickup_cell(view, np.int64(view.robots.type[i]), slot, NIL) == cell


@kernel
def is_offered_to_another(view, i, order):
    """Whether the trip of a pod is reserved for another robot under the pod."""
    holder = view.orders.reserved_by[order]
    return view.trips.pod.shape[0] > 0 and holder != NIL and holder != view.robots.identity[i]


@kernel
def offer(search, cost, candidate):
    """Keep a candidate if it is cheaper than the best one, or precedes it at the same cost."""
    if cost < search.found[0] or (cost == search.found[0] and candidate < search.found[1]):
        search.found[0] = cost
        search.found[1] = candidate


@kernel
def go_on(view, search, robot_type, cell, heading, cost):
    """Reach the successors of a pose."""
    grid, duration = view.grid, view.rules.duration
    flags = np.int64(grid.type_cell_flags[U(robot_type), U(cell)])
    headings, own = grid.headings, headings_of(grid, robot_type)
    for direction in range(heading, 4, own):
        if (flags >> direction) & 1:
            after = cell + grid.offset[U(direction)]
            usual = duration[U(robot_type), U(ACTION_MOVE)]
            moved = cost + limited_ticks(grid, usual, cell, direction)
            reach(search, after * headings + heading, moved)
    if own > 1 and flags & MAY_TURN:
        turned = cost + duration[robot_type, ACTION_TURN]
        reach(search, cell * headings + ((heading + 1) & (own - 1)), turned)
        reach(search, cell * headings + ((heading - 1) & (own - 1)), turned)


@kernel
def find_robot(view, stop, search, open_orders, seekers, place):
    """search.found: the cheapest robot for the order at a place, ties by the least identity."""
    order = np.int64(open_orders.order[place])
    search.found[0], search.found[1] = NO_CANDIDATE, NIL
    for robot_type in range(types_of_robots(view)):
        cost, robot = search.found[0], search.found[1]
        begin(search)
        search.found[0], search.found[1] = cost, robot
        reach_begin(view, search, robot_type, order)
        search_back(view, stop, search, open_orders, seekers, robot_type, order, place)
        search.bucket[:] = NIL


@kernel
def reach_begin(view, search, robot_type, order):
    """Reach the cells where robots of a type begin an order, in all headings."""
    headings, own = view.grid.headings, headings_of(view.grid, robot_type)
    for direction in range(4):
        if not has_load(view.orders, order):
            cell = next_stop_cell(view, order)
        elif view.rules.nearest_access:
            cell = cell_beside(view, np.int64(view.orders.current_slot[order]), direction)
        else:
            slot = np.int64(view.orders.current_slot[order])
            cell = pickup_cell(view, robot_type, slot, NIL)
        if cell != NIL:
            for heading in range(own):
                reach(search, cell * headings + heading, 0)


@kernel
def search_back(view, stop, search, open_orders, seekers, robot_type, order, place):
    """Search backwards from the reached poses until no robot can be cheaper than the best one."""
    headings, rest = view.grid.headings, rest_of(open_orders, order)
    shift = headings >> 1
    cost = next_cost(search, 0)
    while cost != NIL and stop[0] == 0:
        if 2 * (TICK_COST * cost + rest) > search.found[0]:
            return
        pose = next_pose(search, cost)
        if pose == NIL:
            cost = next_cost(search, cost)
            continue
        search.poses += 1
        i = np.int64(seekers.head[pose])
        while i != NIL:
            fits = seekers.seeks[i] and view.robots.type[i] == robot_type
            if fits and can_do(view, i, order) and not is_offered_to_another(view, i, order):
                ticks = TICK_COST * (cost + seekers.delay[i]) + rest
                offer_robot(view, search, 2 * ticks + (place != seekers.place[i]), i)
            i = np.int64(seekers.following[i])
        go_back(view, search, robot_type, pose >> shift, pose & (headings - 1), cost)


@kernel
def offer_robot(view, search, cost, i):
    """Keep robot i if it is cheaper than the best one, or precedes it at the same cost."""
    identity, best = view.robots.identity, search.found[1]
    equal = cost == search.found[0] and best != NIL
    if cost < search.found[0] or (equal and identity[i] < identity[best]):
        search.found[0] = cost
        search.found[1] = i


@kernel
def go_back(view, search, robot_type, cell, heading, cost):
    """Reach the predecessors of a pose."""
    grid, duration, headings = view.grid, view.rules.duration, view.grid.headings
    flags, own = grid.type_cell_flags[robot_type], headings_of(grid, robot_type)
    for direction in range(heading, 4, own):
        before = cell - grid.offset[direction]
        if 0 <= before < flags.shape[0] and (np.int64(flags[before]) >> direction) & 1:
            usual = duration[robot_type, ACTION_MOVE]
            moved = cost + limited_ticks(grid, usual, before, direction)
            reach(search, before * headings + heading, moved)
    if own > 1 and np.int64(flags[cell]) & MAY_TURN:
        turned = cost + duration[robot_type, ACTION_TURN]
        reach(search, cell * headings + ((heading + 1) & (own - 1)), turned)
        reach(search, cell * headings + ((heading - 1) & (own - 1)), turned)


# The buckets.


@kernel
def begin(search):
    search.number += 1
    search.entries = 0
    search.found[0] = NO_CANDIDATE
    search.found[1] = NIL


@kernel
def reach(search, pose, cost):
    """Put a pose into the bucket of a cost unless it was reached at a lower cost."""
    before = search.reached[U(pose)]
    number = search.number
    if before >> COST_BITS == number and before & COST_MASK <= cost:
        return
    search.reached[U(pose)] = (number << COST_BITS) | cost
    entry = search.entries
    search.entries = entry + 1
    at = U(cost & (search.bucket.shape[0] - 1))
    search.pose[U(entry)] = pose
    search.following[U(entry)] = search.bucket[at]
    search.bucket[at] = entry


@kernel
def next_cost(search, cost):
    """The least cost from `cost` on with open poses, or NIL."""
    size = search.bucket.shape[0]
    for more in range(size):
        if search.bucket[U((cost + more) & (size - 1))] != NIL:
            return cost + more
    return NIL


@kernel
def next_pose(search, cost):
    """The next open pose at a cost, or NIL."""
    at = U(cost & (search.bucket.shape[0] - 1))
    while search.bucket[at] != NIL:
        entry = U(search.bucket[at])
        search.bucket[at] = search.following[entry]
        pose = np.int64(search.pose[entry])
        if search.reached[U(pose)] & COST_MASK == cost:
            return pose
    return np.int64(NIL)
