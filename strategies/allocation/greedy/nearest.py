"""A binary heap of pairs (key, tag): the least key first, of equal keys the least tag."""

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
from strategies.allocation.greedy.candidates import (
    TICK,
    enter_poses,
    is_offered_to_another,
    rest_of,
)


class PairHeap(Struct, role=SCRATCH):
    """The pairs; the first one is the least."""

    key: Array = field("(h,) int64")
    tag: Array = field("(h,) int64")
    size: Array = field("(1,) int64")


@kernel
def is_less(heap, a, b):
    """Whether the pair at a comes before the one at b."""
    return heap.key[a] < heap.key[b] or (heap.key[a] == heap.key[b] and heap.tag[a] < heap.tag[b])


@kernel
def swap(heap, a, b):
    heap.key[a], heap.key[b] = heap.key[b], heap.key[a]
    heap.tag[a], heap.tag[b] = heap.tag[b], heap.tag[a]


@kernel
def push_pair(heap, key, tag):
    at = heap.size[0]
    heap.size[0] = at + 1
    heap.key[at] = key
    heap.tag[at] = tag
    while at > 0 and is_less(heap, at, (at - 1) >> 1):
        swap(heap, at, (at - 1) >> 1)
        at = (at - 1) >> 1


@kernel
def drop_least(heap):
    """Take the least pair out."""
    last = heap.size[0] - 1
    heap.size[0] = last
    swap(heap, 0, last)
    at = 0
    while 2 * at + 1 < last:
        below = 2 * at + 1
        if below + 1 < last and is_less(heap, below + 1, below):
            below += 1
        if not is_less(heap, below, at):
            return
        swap(heap, at, below)
        at = below


# Searches on the empty floor that end with the first candidate: an order, or a robot for one.
#
# forwards from the pose of a robot, until a cell with a mark is reached backwards against the
# direction of travel, from where an order begins, until a robot is met
#
# Poses wait in buckets, one for each tick of cost, used in turn. So a search costs what lies nearer
# than its result, however large the floor is, and needs no table of distances for the thousands of
# cells in which orders begin. Costs are in thousandths of ticks and hold twice: an even number for a
# pair that is one already, the odd one above it for another, so that of equal ones the robot keeps
# what it has.


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


# Cheapest pair first: the cheapest pair of a robot and an order is made, then that of the others.
#
# cost 1000 x ticks to where the order begins, and what the parameter `rest` adds for its stops; ties:
# the pair that is one already, then the lower identity, then the earlier order
#
# Whoever is fewer searches: each robot its cheapest order, or each order its cheapest robot. The
# results wait in a heap. If the candidate of the least one is gone when its turn comes, it searches
# again among those that are left: its next result cannot be cheaper, so the pairs come out in the
# sequence of their costs, as if all robots x orders had been sorted.


TAG_BITS = 32
TAG_MASK = (1 << TAG_BITS) - 1


class Pairs(Struct, role=SCRATCH):
    """What has come out."""

    place: Array = field("(robots,) int32", "by storage index: of the robot's order, or NIL")
    candidate: Array = field("(h,) int32", "by robot or place: what its search has found")


@kernel
def match(view, stop, state, allowed):
    """Enter pairs; `allowed`: how many robots without an order may get one, NIL: all."""
    marks, seekers, pairs = state.marks, state.seekers, state.pairs
    for k in range(seekers.count[0]):
        pairs.place[seekers.robot[k]] = NIL
    state.heap.size[0] = 0
    if seekers.count[0] == 0 or marks.count[1] == 0:
        return
    if seekers.count[0] <= marks.count[1]:
        match_robots(view, stop, state, allowed)
    else:
        match_orders(view, stop, state, allowed)


@kernel
def match_robots(view, stop, state, allowed):
    """Each robot searches its order."""
    marks, seekers, pairs, heap = state.marks, state.seekers, state.pairs, state.heap
    for k in range(seekers.count[0]):
        if allowed != 0 or seekers.place[seekers.robot[k]] != NIL:
            search_order(view, stop, state, np.int64(seekers.robot[k]))
    while heap.size[0] > 0 and stop[0] == 0:
        i = np.int64(view.robots.at_index[heap.tag[0] >> TAG_BITS])
        place = np.int64(pairs.candidate[i])
        drop_least(heap)
        had_none = seekers.place[i] == NIL
        if had_none and allowed == 0:
            continue
        if marks.taken[place]:
            search_order(view, stop, state, i)
            continue
        marks.taken[place] = 1
        pairs.place[i] = place
        if had_none and allowed > 0:
            allowed -= 1


@kernel
def search_order(view, stop, state, i):
    """Robot i searches, and waits with what it found."""
    search = state.search
    find_order(view, stop, search, state.open_orders, state.marks, state.seekers, i)
    if search.found[1] != NIL:
        state.pairs.candidate[i] = search.found[1]
        tag = (np.int64(view.robots.identity[i]) << TAG_BITS) | search.found[1]
        push_pair(state.heap, search.found[0], tag)


@kernel
def match_orders(view, stop, state, allowed):
    """Each order searches its robot."""
    marks, seekers, pairs, heap = state.marks, state.seekers, state.pairs, state.heap
    enter_poses(seekers)
    if allowed == 0:
        leave_out_idle(seekers)
    for place in range(state.open_orders.count[0]):
        if marks.taken[place] == 0:
            search_robot(view, stop, state, place)
    while heap.size[0] > 0 and stop[0] == 0:
        i = np.int64(view.robots.at_index[heap.tag[0] >> TAG_BITS])
        place = heap.tag[0] & TAG_MASK
        drop_least(heap)
        if seekers.seeks[i] == 0:
            search_robot(view, stop, state, place)
            continue
        seekers.seeks[i] = 0
        pairs.place[i] = place
        if seekers.place[i] == NIL and allowed > 0:
            allowed -= 1
            if allowed == 0:
                leave_out_idle(seekers)


@kernel
def leave_out_idle(seekers):
    """Robots that have no order get none."""
    for k in range(seekers.count[0]):
        if seekers.place[seekers.robot[k]] == NIL:
            seekers.seeks[seekers.robot[k]] = 0


@kernel
def search_robot(view, stop, state, place):
    """The order at a place searches, and waits with what it found."""
    search = state.search
    find_robot(view, stop, search, state.open_orders, state.seekers, place)
    if search.found[1] != NIL:
        tag = (np.int64(view.robots.identity[search.found[1]]) << TAG_BITS) | place
        push_pair(state.heap, search.found[0], tag)
