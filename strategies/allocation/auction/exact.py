"""The optimum without charging: Held & Karp's shortest path for each bundle, then the best split.

A path starts where the robot is and ends at any of its tasks; robots begin with empty lists.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.bundles import determine_winners, record_sales
from strategies.allocation.auction.market import INF_COST
from strategies.allocation.auction.quotes import clear_counts, settle

INFEASIBLE = (1 << 31) - 1


@kernel
def shortest_paths(costs, bundles, place, items, count):
    """bundles.ends[S, k] = ticks of the shortest path from `place` through S that ends with item k."""
    for k in range(count):
        task = np.int64(items[k])
        for subset in range(1 << count):
            bundles.ends[subset, k] = INFEASIBLE
        bundles.ends[1 << k, k] = (
            costs.ticks[costs.robot_type[0], place, costs.begin[task]]
            + costs.inside[costs.robot_type[0], task]
        )
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
                then = (
                    ticks
                    + costs.ticks[costs.robot_type[0], here, costs.begin[task]]
                    + costs.inside[costs.robot_type[0], task]
                )
                if then < bundles.ends[subset | (1 << j), j]:
                    bundles.ends[subset | (1 << j), j] = then


@kernel
def bid_by_shortest_paths(costs, fleet, bundles, items, count):
    """bundles.cost of every robot and subset, by the best sequence."""
    for r in range(fleet.place.shape[0]):
        costs.robot_type[0] = fleet.robot_type[r]
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
def write_path(costs, bundles, items, count, subset, order):
    """order = the tasks of the subset by its shortest path; returns how many."""
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
                ticks += costs.ticks[costs.robot_type[0], costs.end[items[k]], costs.begin[after]]
            if ticks < best:
                best, item = ticks, np.int64(k)
        after = np.int64(items[item])
        order[at] = after
        left ^= np.int64(1) << item
    return length


@kernel
def exact(costs, battery, fleet, scratch, bundles, items, count, epsilon):
    """Give every robot the list of the optimum, from empty lists; returns the objective, or INF_COST."""
    robots = fleet.place.shape[0]
    clear_counts(scratch)
    bid_by_shortest_paths(costs, fleet, bundles, items, count)
    value = determine_winners(bundles, robots, count, epsilon)
    if value >= INF_COST:
        return value
    for r in range(robots):
        costs.robot_type[0] = fleet.robot_type[r]
        shortest_paths(costs, bundles, np.int64(fleet.place[r]), items, count)
        chosen = np.int64(bundles.chosen[r])
        fleet.length[r] = write_path(costs, bundles, items, count, chosen, fleet.order[r])
        settle(costs, battery, fleet, scratch, r)
    record_sales(bundles, scratch, robots, count)
    return value
