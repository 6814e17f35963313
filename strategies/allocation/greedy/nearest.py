"""Searches on the empty floor that end with the first candidate: an order, or a robot for one.

    forwards    from the pose of a robot, until a cell with a mark is reached
    backwards   against the direction of travel, from where an order begins, until a robot is met

Poses wait in buckets, one for each tick of cost, used in turn. So a search costs what lies nearer than
its result, however large the floor is, and needs no table of distances for the thousands of cells in
which orders begin. Costs are in thousandths of ticks and hold twice: an even number for a pair that is
one already, the odd one above it for another, so that of equal ones the robot keeps what it has.
"""

import numpy as np

from automaton.engine.facilities import MAY_TURN
from automaton.engine.jit.structs import SCRATCH, Struct, field
from automaton.engine.state import ACTION_MOVE, ACTION_TURN, NIL, Array
from automaton.strategy.kernels import (
    can_do,
    cell_beside,
    has_load,
    headings_of,
    kernel,
    limited_ticks,
    next_stop_cell,
    pickup_cell,
    types_of_robots,
)
from strategies.allocation.greedy.candidates import TICK, is_offered_to_another, rest_of

U = np.uint64  # unsigned where it indexes: saves the test for a negative index
NOTHING = 1 << 60  # the cost of no candidate
COST_BITS = 32
COST_MASK = (1 << COST_BITS) - 1


class Search(Struct, role=SCRATCH):
    """Buckets, and what has been reached."""

    reached: Array = field("(P,) int64", "by pose: number of the search << 32 | cost")
    number: Array = field("(1,) int64", "searches so far")
    poses: Array = field("(1,) int64", "poses expanded so far: what searches have cost")
    bucket: Array = field(
        "(power of two,) int32",
        "the first entry of a cost, modulo their number; NIL between searches",
        default=NIL,
    )
    pose: Array = field("(E,) int32", "of an entry")
    following: Array = field("(E,) int32", "the next entry of its bucket, or NIL")
    entries: Array = field("(1,) int64")
    found: Array = field("(2,) int64", "cost, and place of the order or storage index of the robot")


@kernel
def begin(search):
    search.number[0] += 1
    search.entries[0] = 0
    search.found[0] = NOTHING
    search.found[1] = NIL


@kernel
def reach(search, pose, cost):
    """Enter a pose into the bucket of a cost unless it was reached cheaper."""
    before = search.reached[U(pose)]
    number = search.number[0]
    if before >> COST_BITS == number and before & COST_MASK <= cost:
        return
    search.reached[U(pose)] = (number << COST_BITS) | cost
    entry = search.entries[0]
    search.entries[0] = entry + 1
    at = U(cost & (search.bucket.shape[0] - 1))
    search.pose[U(entry)] = pose
    search.following[U(entry)] = search.bucket[at]
    search.bucket[at] = entry


@kernel
def next_cost(search, cost):
    """The least cost from `cost` on of which poses wait; NIL if none does."""
    size = search.bucket.shape[0]
    for more in range(size):
        if search.bucket[U((cost + more) & (size - 1))] != NIL:
            return cost + more
    return NIL


@kernel
def next_pose(search, cost):
    """The next pose that waits at a cost; NIL if none does."""
    at = U(cost & (search.bucket.shape[0] - 1))
    while search.bucket[at] != NIL:
        entry = U(search.bucket[at])
        search.bucket[at] = search.following[entry]
        pose = np.int64(search.pose[entry])
        if search.reached[U(pose)] & COST_MASK == cost:
            return pose
    return np.int64(NIL)


@kernel
def find_order(view, stop, search, open_orders, marks, seekers, i):
    """search.found: the cheapest order for robot i that is to be had, of equal ones the earliest."""
    begin(search)
    reach(search, np.int64(seekers.pose[i]), 0)
    robot_type, headings = np.int64(view.robots.type[i]), view.grid.headings
    shift = headings >> 1  # 1, 2 or 4 headings
    delay = TICK * seekers.delay[i]
    cost = next_cost(search, 0)
    while cost != NIL and stop[0] == 0:
        if 2 * (TICK * cost + delay + marks.least_rest[0]) > search.found[0]:
            break
        pose = next_pose(search, cost)
        if pose == NIL:
            cost = next_cost(search, cost)
            continue
        search.poses[0] += 1
        cell = pose >> shift
        if marks.head[U(cell)] != NIL:
            look_at_marks(view, search, open_orders, marks, seekers, i, cell, TICK * cost + delay)
        go_on(view, search, robot_type, cell, pose & (headings - 1), cost)
    search.bucket[:] = NIL


@kernel
def look_at_marks(view, search, open_orders, marks, seekers, i, cell, cost):
    """Robot i gets to a cell for so much: is an order that begins there the best so far?"""
    had = np.int64(seekers.place[i])
    weighed = open_orders.rest.shape[0] > 0
    k = marks.head[cell]
    while k != NIL and marks.taken[marks.place[k]]:
        k = marks.following[k]
    marks.head[cell] = k  # those before it are taken, and looked at no more
    while k != NIL:
        place = np.int64(marks.place[k])
        order = np.int64(open_orders.order[place])
        if marks.taken[place] == 0 and begins_here(view, i, order, cell):
            offer(search, 2 * (cost + rest_of(open_orders, order)) + (place != had), place)
            if not weighed and had == NIL:
                return  # the others of the cell cost the same, and came later
        k = marks.following[k]


@kernel
def begins_here(view, i, order, cell):
    """Whether robot i does an order, and begins it in this cell."""
    if not can_do(view, i, order) or is_offered_to_another(view, i, order):
        return False
    if not has_load(view.orders, order) or view.rules.nearest_access:
        return True
    slot = np.int64(view.orders.current_slot[order])
    return pickup_cell(view, np.int64(view.robots.type[i]), slot, NIL) == cell


@kernel
def offer(search, cost, candidate):
    """Keep a candidate if it is cheaper than the one found, or comes before it at the same cost."""
    if cost < search.found[0] or (cost == search.found[0] and candidate < search.found[1]):
        search.found[0] = cost
        search.found[1] = candidate


@kernel
def go_on(view, search, robot_type, cell, heading, cost):
    """Reach the poses that follow on a pose."""
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
    """search.found: the cheapest robot for the order at a place, of equal ones the least identity."""
    order = np.int64(open_orders.order[place])
    search.found[0], search.found[1] = NOTHING, NIL
    for robot_type in range(types_of_robots(view)):
        cost, robot = search.found[0], search.found[1]
        begin(search)
        search.found[0], search.found[1] = cost, robot
        reach_begin(view, search, robot_type, order)
        search_back(view, stop, search, open_orders, seekers, robot_type, order, place)
        search.bucket[:] = NIL


@kernel
def reach_begin(view, search, robot_type, order):
    """Reach the cells where robots of a type begin an order, with any of their headings."""
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
    """Go back from what is reached until no robot can be cheaper than the one found."""
    headings, rest = view.grid.headings, rest_of(open_orders, order)
    shift = headings >> 1
    cost = next_cost(search, 0)
    while cost != NIL and stop[0] == 0:
        if 2 * (TICK * cost + rest) > search.found[0]:
            return
        pose = next_pose(search, cost)
        if pose == NIL:
            cost = next_cost(search, cost)
            continue
        search.poses[0] += 1
        i = np.int64(seekers.head[pose])
        while i != NIL:
            fits = seekers.seeks[i] and view.robots.type[i] == robot_type
            if fits and can_do(view, i, order) and not is_offered_to_another(view, i, order):
                ticks = TICK * (cost + seekers.delay[i]) + rest
                offer_robot(view, search, 2 * ticks + (place != seekers.place[i]), i)
            i = np.int64(seekers.following[i])
        go_back(view, search, robot_type, pose >> shift, pose & (headings - 1), cost)


@kernel
def offer_robot(view, search, cost, i):
    """Keep robot i if it is cheaper than the one found, or comes before it at the same cost."""
    identity, best = view.robots.identity, search.found[1]
    equal = cost == search.found[0] and best != NIL
    if cost < search.found[0] or (equal and identity[i] < identity[best]):
        search.found[0] = cost
        search.found[1] = i


@kernel
def go_back(view, search, robot_type, cell, heading, cost):
    """Reach the poses from which a robot comes to a pose."""
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
