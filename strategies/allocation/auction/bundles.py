"""Combinatorial auctions: every robot bids for every bundle, and the bundles are split at the best.

Bids for bundles come from insertion in the order of items (the best of all m^n allotments then) or
from Held & Karp's shortest paths (the optimum over all sequences then). Splitting takes O(m 3^n).
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.insertion import cheapest_insertion, insert
from strategies.allocation.auction.market import (
    BID_SCALE,
    INF_COST,
)
from strategies.allocation.auction.quotes import clear_counts, quote_list, settle


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
            scratch.count.bids[0] += subset > 0


@kernel
def build_list(costs, fleet, scratch, items, count, r, subset):
    """scratch.order = robot r's list with the items of the subset; its length, NIL: not at all."""
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
        costs.robot_type[0] = fleet.robot_type[r]
        position, _ = cheapest_insertion(costs, place, scratch.order, length, task, first)
        scratch.count.positions[0] += length + 1 - first
        insert(scratch.order, length, task, position)
        length += 1
    return length


@kernel
def determine_winners(bundles, robots, count, epsilon):
    """bundles.chosen = the split of all items with the least objective; returns it, or INF_COST."""
    if epsilon == 0 or epsilon == BID_SCALE:
        return winners_by_subsets(bundles, robots, count, epsilon)
    return winners_by_search(bundles, robots, count, epsilon)


@kernel
def winners_by_subsets(bundles, robots, count, epsilon):
    """Dynamic programming, for the largest cost alone (epsilon 0) or the sum alone (1000)."""
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
    """The bundle of robot r on the branch that is being tried."""
    if r == robots - 1:
        return np.int64(bundles.rest[r])
    return np.int64(bundles.rest[r] ^ bundles.rest[r + 1])


@kernel
def combinatorial(costs, battery, fleet, scratch, bundles, items, count, epsilon):
    """Bids by insertion for all bundles, split at the best, and awarded; the objective, or INF_COST."""
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
    scratch.count.messages[0] = robots * count + scratch.count.bids[0] + robots
    return value


@kernel
def record_sales(bundles, scratch, robots, count):
    """scratch.sold by the bundles that are chosen."""
    for k in range(count):
        for r in range(robots):
            if (bundles.chosen[r] >> k) & 1 == 1:
                scratch.sold[k] = r
