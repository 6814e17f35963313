"""Cheapest pair first: the robot and the order that are nearest to each other, then the next pair.

The cost is exact ticks on the empty floor, from where the robot becomes free to the start of the order.
Orders without a load that are not begun may go to other robots: every `reassign` ticks all robots and
orders that are not under way are rematched, and a robot keeps its order unless a cheaper pair separates
them. A load that was picked up goes to its own target, a pod into storage.
"""

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    ACTION_TURN,
    CMD_PARK,
    NIL,
    REASON_PERIODIC,
    SCRATCH,
    STORAGE_POLICIES,
    Array,
    Strategy,
    Struct,
    field,
    is_due,
    kernel,
    place_load,
    places_load,
    take_order,
)
from strategies.allocation.allocation_parameters import GreedyParameters
from strategies.allocation.nearest import (
    OpenOrders,
    OrderMarks,
    PairSearch,
    Seekers,
    SortedMarks,
    clear_candidates,
    collect_seekers,
    enter_poses,
    find_order,
    find_robot,
    look_up_assigned,
    look_up_order,
    mark_orders,
    sort_marks,
    update_open_orders,
    weigh_rest,
)

TAG_BITS = 32
TAG_MASK = (1 << TAG_BITS) - 1


class PairHeap(Struct, role=SCRATCH):
    """A binary heap of pairs (key, tag): the least key first, ties by the least tag."""

    key: Array = field("(h,) int64")
    tag: Array = field("(h,) int64")
    size: int = field("() int64")


class Pairs(Struct, role=SCRATCH):
    """The matched pairs, and the results of searches."""

    place: Array = field("(robots,) int32", "by storage index: of the robot's order, or NIL")
    candidate: Array = field("(h,) int32", "result of the search, by robot or place")


class GreedyState(Struct):
    """Parameters, open orders, and scratch for matching."""

    rest: int = field("int64", "weight of the drive after the first stop, in thousandths")
    active: int = field("int64", "maximum number of robots with an order; NIL: all")
    parks: int = field("int64", "1: robots without an order drive home")
    storage: int = field("int64", "where pods are stored: its place among STORAGE_POLICIES")
    keeps_off: int = field(
        "() uint8", "1 = `active` now keeps open orders from robots", role=SCRATCH
    )
    open_orders: OpenOrders
    marks: OrderMarks
    by_rest: SortedMarks
    seekers: Seekers
    search: PairSearch
    heap: PairHeap
    pairs: Pairs


@kernel
def decide(view, batch, decisions, memory, workspace):
    out, state = decisions.allocation, GreedyState.of(memory)
    collect_seekers(view, batch, state.seekers, is_due(view, np.int64(batch.strategy)))
    if state.seekers.count > 0:
        first = update_open_orders(view, state.open_orders)
        if state.open_orders.rest.shape[0]:
            weigh_rest(view, workspace, state.open_orders, first, state.rest)
        mark_orders(view, out, state.open_orders, state.marks, state.seekers)
        sort_marks(view, workspace, state.open_orders, state.marks, state.by_rest)
        allowed = robots_allowed(view, state)
        match(view, workspace, state, allowed)
        state.keeps_off = is_kept_off(state, allowed)
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        if places_load(batch.reason[k]):
            place_load(view, out, workspace, k, i, state.storage)
    for k in range(state.seekers.count):
        enter_decision(view, out, state, batch, np.int64(state.seekers.robot[k]))
    clear_candidates(state.marks, state.seekers)


@kernel
def robots_allowed(view, state):
    """The number of robots without an order that may get one; NIL: all."""
    if state.active == NIL:
        return np.int64(NIL)
    have = 0
    for i in range(view.robots.order.shape[0]):
        have += view.robots.order[i] != NIL
    return max(np.int64(state.active) - have, np.int64(0))


@kernel
def is_kept_off(state, allowed):
    """Whether only `active` keeps robots from the remaining orders; `allowed`: as for match."""
    left = np.int64(state.marks.count[1])
    for k in range(state.seekers.count):
        i = np.int64(state.seekers.robot[k])
        if state.pairs.place[i] != NIL:
            left -= 1
            allowed -= state.seekers.place[i] == NIL
    return state.active != NIL and allowed <= 0 and left > 0


@kernel
def enter_decision(view, out, state, batch, i):
    """Write the decision of a robot that seeks an order: its new order, or none."""
    k, place = np.int64(state.seekers.entry[i]), np.int64(state.pairs.place[i])
    if place != NIL:
        order = np.int64(state.open_orders.order[place])
        if order != view.robots.order[i]:
            take_order(view, out, k, i, order)
    elif view.robots.order[i] == NIL and state.parks and state.keeps_off == 0:
        if batch.reason[k] != REASON_PERIODIC:
            out.command[k] = CMD_PARK


class Greedy(Strategy):
    """Match the cheapest pair of a free robot and an open order first; `reassign` rematches pairs."""

    layer = "allocation"
    Parameters = GreedyParameters
    compiled = decide

    def __init__(self, parameters=None):
        super().__init__(parameters)
        self.period = self.parameters.reassign or 0

    def reset(self, view):
        parameters, robots = self.parameters, len(view.robots.cell)
        cells, headings = len(view.grid.kind), int(view.grid.headings)
        places = most_open_orders(view)
        with_loads = bool((view.orders.source != NIL).any())
        poses = cells * headings
        steps = view.rules.duration[:, [ACTION_MOVE, ACTION_TURN]]
        limit = view.grid.min_move_ticks.max(initial=0)
        sizes = {"p": places, "C": cells, "P": poses, "robots": robots}
        sizes |= {"k": 4 * places if with_loads else places, "h": robots, "E": 4 * poses + 8}
        sizes |= {
            "w": len(view.orders.state) if parameters.rest or len(view.rules.priorities) > 1 else 0,
            "a": robots if view.rules.assigned else 0,
            "power of two": 1 << int(max(steps.max(), limit)).bit_length(),
        }
        sizes["t"] = sizes["k"] if sizes["w"] else 0
        return GreedyState(
            rest=round(1000 * parameters.rest),
            active=NIL if parameters.active is None else parameters.active,
            parks=int(parameters.idle == "park"),
            storage=STORAGE_POLICIES.index(parameters.storage),
            keeps_off=0,
            open_orders=OpenOrders.sized(sizes),
            marks=OrderMarks.sized(sizes),
            by_rest=SortedMarks.sized(sizes, is_used=0),
            seekers=Seekers.sized(sizes),
            search=PairSearch.sized(sizes),
            heap=PairHeap.sized(sizes),
            pairs=Pairs.sized(sizes),
        )


def most_open_orders(view):
    """The maximum number of known, unfinished orders at a time."""
    if view.rules.in_system:
        return int(view.rules.in_system)
    orders = len(view.orders.state)
    return min(orders, len(view.robots.cell)) if view.rules.assigned else orders


# Matching: the smaller side searches: each robot its cheapest order, or each order its cheapest robot.
#
# A pair costs 1000 x ticks to the start of the order, plus the share of its stops by the parameter
# `rest`. Ties: an existing pair, then the lower identity, then the earlier order. The results wait in a
# heap. If the candidate of the least result is already taken, its search is repeated among the rest. The
# new result cannot be cheaper, so pairs come out in the sequence of their costs, as if all robots x
# orders had been sorted.


@kernel
def match(view, workspace, state, allowed):
    """Match pairs; `allowed`: number of robots without an order that may get one, NIL: all."""
    marks, seekers, pairs = state.marks, state.seekers, state.pairs
    for k in range(seekers.count):
        pairs.place[seekers.robot[k]] = NIL
    state.heap.size = 0
    if seekers.count == 0 or marks.count[1] == 0:
        return
    if seekers.count <= marks.count[1]:
        match_robots(view, workspace, state, allowed)
    else:
        match_orders(view, workspace.stop, state, allowed)


@kernel
def match_robots(view, workspace, state, allowed):
    """Let each robot search its cheapest order."""
    marks, seekers, pairs, heap = state.marks, state.seekers, state.pairs, state.heap
    for k in range(seekers.count):
        if allowed != 0 or seekers.place[seekers.robot[k]] != NIL:
            search_order(view, workspace, state, np.int64(seekers.robot[k]))
    while heap.size > 0 and workspace.stop[0] == 0:
        i = np.int64(view.robots.at_index[heap.tag[0] >> TAG_BITS])
        place = np.int64(pairs.candidate[i])
        drop_least(heap)
        had_none = seekers.place[i] == NIL
        if had_none and allowed == 0:
            continue
        if marks.taken[place]:
            search_order(view, workspace, state, i)
            continue
        marks.taken[place] = 1
        pairs.place[i] = place
        if had_none and allowed > 0:
            allowed -= 1


@kernel
def search_order(view, workspace, state, i):
    """Find an order for robot i, and push the result."""
    search, orders, marks, seekers = state.search, state.open_orders, state.marks, state.seekers
    if view.rules.assigned:
        look_up_assigned(view, workspace, search, orders, marks, seekers, i)
    elif state.by_rest.is_used:
        look_up_order(view, workspace, search, orders, marks, state.by_rest, seekers, i)
    else:
        find_order(view, workspace.stop, search, orders, marks, seekers, i)
    if search.found[1] != NIL:
        state.pairs.candidate[i] = search.found[1]
        tag = (np.int64(view.robots.identity[i]) << TAG_BITS) | search.found[1]
        push_pair(state.heap, search.found[0], tag)


@kernel
def match_orders(view, stop, state, allowed):
    """Let each order search its cheapest robot."""
    marks, seekers, pairs, heap = state.marks, state.seekers, state.pairs, state.heap
    enter_poses(seekers)
    if allowed == 0:
        leave_out_idle(seekers)
    for place in range(state.open_orders.count):
        if marks.taken[place] == 0:
            search_robot(view, stop, state, place)
    while heap.size > 0 and stop[0] == 0:
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
    """Exclude robots without an order."""
    for k in range(seekers.count):
        if seekers.place[seekers.robot[k]] == NIL:
            seekers.seeks[seekers.robot[k]] = 0


@kernel
def search_robot(view, stop, state, place):
    """Search for the order at a place, and push the result."""
    search = state.search
    find_robot(view, stop, search, state.open_orders, state.seekers, place)
    if search.found[1] != NIL:
        tag = (np.int64(view.robots.identity[search.found[1]]) << TAG_BITS) | place
        push_pair(state.heap, search.found[0], tag)


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
    at = heap.size
    heap.size = at + 1
    heap.key[at] = key
    heap.tag[at] = tag
    while at > 0 and is_less(heap, at, (at - 1) >> 1):
        swap(heap, at, (at - 1) >> 1)
        at = (at - 1) >> 1


@kernel
def drop_least(heap):
    """Remove the least pair."""
    last = heap.size - 1
    heap.size = last
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
