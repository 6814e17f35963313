"""Combinatorial auctions: every robot bids for every bundle of tasks, and the best split wins.

Bids for bundles come from insertion in the order of items (the result is then the best of all m^n
allotments) or from Held & Karp's shortest paths (the result is then the optimum over all sequences,
without charging). Splitting takes O(m 3^n).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.strategy.api import NIL, SCRATCH, Array, InputError, Struct, field, kernel
from strategies.allocation.auction.market import BID_SCALE, INF_COST, cheapest_insertion, insert
from strategies.allocation.auction.quotes import clear_counts, quote_list, settle

MAX_BUNDLE_TASKS: Final = 12  # 2^12 bundles per robot, 3^12 splits between two robots
MAX_BUNDLE_ROBOTS: Final = 16
INFEASIBLE = (1 << 31) - 1  # ticks of a path that does not exist


class Bundles(Struct, role=SCRATCH):
    """Every subset S of n tasks, as a number with bit k for item k, and every one of R robots."""

    cost: Array = field("(R, 2^n) int64", "ticks of the bundle; INF_COST: not feasible")
    best: Array = field("(R, 2^n) int64", "the best objective of robots 0..r for S")
    part: Array = field("(R, 2^n) int32", "the part of S that robot r then takes")
    ends: Array = field(
        "(2^n, n) int32", "ticks of the shortest path through S that ends with item k"
    )
    chosen: Array = field("(R,) int32", "the bundle that each robot gets")
    trying: Array = field("(R,) int32", "scratch of the search")
    rest: Array = field("(R + 1,) int32", "scratch")
    total: Array = field("(R + 1,) int64", "scratch")
    most: Array = field("(R + 1,) int64", "scratch")


def bundles_for(robots: int, tasks: int) -> Bundles:
    """Raise InputError for sizes that are too large."""
    if tasks > MAX_BUNDLE_TASKS or robots > MAX_BUNDLE_ROBOTS:
        raise InputError(
            f"bundles of {tasks} tasks for {robots} robots are too many: "
            f"at most {MAX_BUNDLE_TASKS} tasks and {MAX_BUNDLE_ROBOTS} robots can be done exactly"
        )
    return Bundles.sized({"R": robots, "n": tasks, "2^n": 1 << tasks})


@kernel
def combinatorial(costs, battery, fleet, scratch, bundles, items, count, epsilon):
    """Bid by insertion for all bundles, and award the best split; return the objective or INF_COST."""
    clear_counts(scratch)
    robots = fleet.place.shape[0]
    bid_by_insertion(costs, battery, fleet, scratch, bundles, items, count)
    value = determine_winners(bundles, robots, count, epsilon)
    if value >= INF_COST:
        return value
    for r in range(robots):
        length = build_list(costs, fleet, scratch, items, count, r, np.int64(bundles.chosen[r]))
        for i in range(length):
            fleet.order[r, i] = scratch.order[i]
        fleet.length[r] = length
        settle(costs, battery, fleet, scratch, r)
    record_sales(bundles, scratch, robots, count)
    scratch.count.messages = robots * count + scratch.count.bids + robots
    return value


@kernel
def bid_by_insertion(costs, battery, fleet, scratch, bundles, items, count):
    """bundles.cost of every robot and subset, each item inserted in turn into the robot's list.

    Insertion is by ticks alone; charging is planned for the whole list.
    """
    for r in range(fleet.place.shape[0]):
        for subset in range(1 << count):
            length = build_list(costs, fleet, scratch, items, count, r, subset)
            cost = np.int64(INF_COST)
            if length != NIL:
                cost = quote_list(costs, battery, fleet, scratch, r, scratch.order, length)
            bundles.cost[r, subset] = cost
            scratch.count.bids += subset > 0


@kernel
def build_list(costs, fleet, scratch, items, count, r, subset):
    """scratch.order = robot r's list with the items of the subset; return its length, NIL: infeasible."""
    length = np.int64(fleet.length[r])
    for i in range(length):
        scratch.order[i] = fleet.order[r, i]
    for k in range(count):
        if (subset >> k) & 1 == 0:
            continue
        task = np.int64(items[k])
        if length >= fleet.capacity[r] or fleet.may_bid[r, task] == 0:
            return np.int64(NIL)
        first = min(np.int64(fleet.first[r]), length)
        place = np.int64(fleet.place[r])
        costs.robot_type = fleet.robot_type[r]
        position, _ = cheapest_insertion(costs, place, scratch.order, length, task, first)
        scratch.count.positions += length + 1 - first
        insert(scratch.order, length, task, position)
        length += 1
    return length


@kernel
def determine_winners(bundles, robots, count, epsilon):
    """bundles.chosen = the split of all items with the least objective; return it or INF_COST."""
    if epsilon == 0 or epsilon == BID_SCALE:
        return winners_by_subsets(bundles, robots, count, epsilon)
    return winners_by_search(bundles, robots, count, epsilon)


@kernel
def winners_by_subsets(bundles, robots, count, epsilon):
    """Dynamic programming, for only the largest cost (epsilon 0) or only the sum (1000)."""
    everything = (1 << count) - 1
    for subset in range(everything + 1):
        bundles.best[0, subset] = bundles.cost[0, subset]
        bundles.part[0, subset] = subset
    for r in range(1, robots):
        for subset in range(everything + 1):
            best, part = np.int64(INF_COST), np.int64(0)
            own = np.int64(subset)
            while True:
                others = bundles.best[r - 1, subset ^ own]
                mine = bundles.cost[r, own]
                value = (
                    max(others, mine) if epsilon == 0 else min(others + mine, np.int64(INF_COST))
                )
                if value < best:
                    best, part = value, own
                if own == 0:
                    break
                own = (own - 1) & subset
            bundles.best[r, subset] = best
            bundles.part[r, subset] = part
    left = np.int64(everything)
    for r in range(robots - 1, -1, -1):
        bundles.chosen[r] = bundles.part[r, left]
        left ^= bundles.chosen[r]
    best = bundles.best[robots - 1, everything]
    return np.int64(INF_COST) if best >= INF_COST else BID_SCALE * best


@kernel
def winners_by_search(bundles, robots, count, epsilon):
    """Branch and bound over the bundles of robot after robot, for any epsilon."""
    best = np.int64(INF_COST)
    bundles.rest[0] = (1 << count) - 1
    bundles.trying[0] = bundles.rest[0]
    bundles.total[0] = 0
    bundles.most[0] = 0
    r = 0
    while r >= 0:
        own = np.int64(bundles.trying[r])
        if own < 0:  # every bundle of this robot is tried
            r -= 1
            continue
        rest = np.int64(bundles.rest[r])
        last = r == robots - 1
        bundles.trying[r] = NIL if own == 0 or last else (own - 1) & rest
        cost = bundles.cost[r, own]
        if cost >= INF_COST:
            continue
        total, most = bundles.total[r] + cost, max(bundles.most[r], cost)
        value = epsilon * total + (BID_SCALE - epsilon) * most
        if value >= best:
            continue
        if last:
            best = value
            for other in range(robots):
                bundles.chosen[other] = tried_bundle(bundles, other, robots)
            continue
        r += 1
        bundles.rest[r] = rest ^ own
        bundles.trying[r] = bundles.rest[r]
        bundles.total[r] = total
        bundles.most[r] = most
    return best


@kernel
def tried_bundle(bundles, r, robots):
    """The bundle of robot r on the current branch."""
    if r == robots - 1:
        return np.int64(bundles.rest[r])
    return np.int64(bundles.rest[r] ^ bundles.rest[r + 1])


@kernel
def record_sales(bundles, scratch, robots, count):
    """scratch.sold from the chosen bundles."""
    for k in range(count):
        for r in range(robots):
            if (bundles.chosen[r] >> k) & 1 == 1:
                scratch.sold[k] = r


# The optimum without charging: Held & Karp's shortest path for each bundle, then the best split.
#
# A path starts at the robot and ends at any of its tasks; robots start with empty lists.


@kernel
def exact(costs, battery, fleet, scratch, bundles, items, count, epsilon):
    """Give every robot its optimal list, from empty lists; return the objective or INF_COST."""
    robots = fleet.place.shape[0]
    clear_counts(scratch)
    bid_by_shortest_paths(costs, fleet, bundles, items, count)
    value = determine_winners(bundles, robots, count, epsilon)
    if value >= INF_COST:
        return value
    for r in range(robots):
        costs.robot_type = fleet.robot_type[r]
        shortest_paths(costs, bundles, np.int64(fleet.place[r]), items, count)
        chosen = np.int64(bundles.chosen[r])
        fleet.length[r] = write_path(costs, bundles, items, count, chosen, fleet.order[r])
        settle(costs, battery, fleet, scratch, r)
    record_sales(bundles, scratch, robots, count)
    return value


@kernel
def bid_by_shortest_paths(costs, fleet, bundles, items, count):
    """bundles.cost of every robot and subset, by the best sequence."""
    for r in range(fleet.place.shape[0]):
        costs.robot_type = fleet.robot_type[r]
        shortest_paths(costs, bundles, np.int64(fleet.place[r]), items, count)
        bundles.cost[r, 0] = fleet.ready[r]
        for subset in range(1, 1 << count):
            least = np.int64(INFEASIBLE)
            size = 0
            for k in range(count):
                least = min(least, np.int64(bundles.ends[subset, k]))
                if (subset >> k) & 1 == 1:
                    size += 1
                    if fleet.may_bid[r, items[k]] == 0:
                        size = fleet.capacity[r] + 1
            too_many = size > fleet.capacity[r]
            bundles.cost[r, subset] = INF_COST if too_many else fleet.ready[r] + least


@kernel
def shortest_paths(costs, bundles, place, items, count):
    """bundles.ends[S, k] = ticks of the shortest path from `place` through S that ends with item k."""
    ticks_to, inside = costs.ticks[costs.robot_type], costs.inside[costs.robot_type]
    for k in range(count):
        task = np.int64(items[k])
        for subset in range(1 << count):
            bundles.ends[subset, k] = INFEASIBLE
        bundles.ends[1 << k, k] = ticks_to[place, costs.begin[task]] + inside[task]
    for subset in range(1, 1 << count):
        for k in range(count):
            ticks = np.int64(bundles.ends[subset, k])
            if ticks == INFEASIBLE:
                continue
            here = np.int64(costs.end[items[k]])
            for j in range(count):
                if (subset >> j) & 1 == 1:
                    continue
                task = np.int64(items[j])
                then = ticks + ticks_to[here, costs.begin[task]] + inside[task]
                if then < bundles.ends[subset | (1 << j), j]:
                    bundles.ends[subset | (1 << j), j] = then


@kernel
def write_path(costs, bundles, items, count, subset, order):
    """order = the tasks of the subset along its shortest path; return their number."""
    length = np.int64(0)
    left = np.int64(subset)
    while left != 0:
        length += 1
        left &= left - 1
    left = np.int64(subset)
    after = np.int64(NIL)
    for at in range(length - 1, -1, -1):
        best, item = np.int64(1) << 60, np.int64(NIL)
        for k in range(count):
            ticks = np.int64(bundles.ends[left, k])
            if (left >> k) & 1 == 0:
                continue
            if after != NIL:
                ticks += costs.ticks[costs.robot_type, costs.end[items[k]], costs.begin[after]]
            if ticks < best:
                best, item = ticks, np.int64(k)
        after = np.int64(items[item])
        order[at] = after
        left ^= np.int64(1) << item
    return length
