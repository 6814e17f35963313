"""Cheapest pair first: the cheapest pair of a robot and an order is made, then that of the others.

    cost    1000 x ticks to where the order begins, and what the parameter `rest` adds for its stops;
            ties: the pair that is one already, then the lower identity, then the earlier order

Whoever is fewer searches: each robot its cheapest order, or each order its cheapest robot. The results
wait in a heap. If the candidate of the least one is gone when its turn comes, it searches again among
those that are left: its next result cannot be cheaper, so the pairs come out in the sequence of their
costs, as if all robots x orders had been sorted.
"""

import numpy as np

from automaton.engine.jit.structs import SCRATCH, Struct, field
from automaton.engine.state import NIL, Array
from automaton.strategy.kernels import kernel
from strategies.allocation.greedy.candidates import enter_poses
from strategies.allocation.greedy.nearest import find_order, find_robot
from strategies.allocation.greedy.pair_heap import drop_least, push_pair

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
