"""The optimum without charging: Held & Karp's shortest path for each bundle, then the best split.

A path starts where the robot is and ends at any of its tasks; robots begin with empty lists.
"""

import numpy as np

from automaton.auctions.bundles import note_sales, split
from automaton.auctions.market import INF
from automaton.auctions.quotes import settle
from automaton.compiled import kernel
from automaton.world.state import NIL

INFEASIBLE = (1 << 31) - 1


@kernel
def shortest_paths(work, bundles, place, items, count):
    """bundles.ends[S, k] = ticks of the shortest path from `place` through S that ends with item k."""
    for k in range(count):
        task = np.int64(items[k])
        for subset in range(1 << count):
            bundles.ends[subset, k] = INFEASIBLE
        bundles.ends[1 << k, k] = (
            work.ticks[work.robot_type[0], place, work.begin[task]]
            + work.inside[work.robot_type[0], task]
        )
    for subset in range(1, 1 << count):
        for k in range(count):
            ticks = np.int64(bundles.ends[subset, k])
            if ticks == INFEASIBLE:
                continue
            here = np.int64(work.end[items[k]])
            for j in range(count):
                if (subset >> j) & 1 == 1:
                    continue
                task = np.int64(items[j])
                then = (
                    ticks
                    + work.ticks[work.robot_type[0], here, work.begin[task]]
                    + work.inside[work.robot_type[0], task]
                )
                if then < bundles.ends[subset | (1 << j), j]:
                    bundles.ends[subset | (1 << j), j] = then


@kernel
def bid_by_shortest_paths(work, fleet, bundles, items, count):
    """bundles.cost of every robot and subset, by the best sequence."""
    for r in range(fleet.place.shape[0]):
        work.robot_type[0] = fleet.robot_type[r]
        shortest_paths(work, bundles, np.int64(fleet.place[r]), items, count)
        bundles.cost[r, 0] = fleet.ready[r]
        for subset in range(1, 1 << count):
            least = np.int64(INFEASIBLE)
            size = 0
            for k in range(count):
                least = min(least, np.int64(bundles.ends[subset, k]))
                if (subset >> k) & 1 == 1:
                    size += 1
                    if fleet.heard[r, items[k]] == 0:
                        size = fleet.room[r] + 1
            too_many = size > fleet.room[r]
            bundles.cost[r, subset] = INF if too_many else fleet.ready[r] + least


@kernel
def write_path(work, bundles, items, count, subset, order):
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
                ticks += work.ticks[work.robot_type[0], work.end[items[k]], work.begin[after]]
            if ticks < best:
                best, item = ticks, np.int64(k)
        after = np.int64(items[item])
        order[at] = after
        left ^= np.int64(1) << item
    return length


@kernel
def exact(work, battery, fleet, scratch, bundles, items, count, epsilon):
    """Give every robot the list of the optimum, from empty lists; returns the objective, or INF."""
    robots = fleet.place.shape[0]
    scratch.count[:] = 0
    bid_by_shortest_paths(work, fleet, bundles, items, count)
    value = split(bundles, robots, count, epsilon)
    if value >= INF:
        return value
    for r in range(robots):
        work.robot_type[0] = fleet.robot_type[r]
        shortest_paths(work, bundles, np.int64(fleet.place[r]), items, count)
        chosen = np.int64(bundles.chosen[r])
        fleet.length[r] = write_path(work, bundles, items, count, chosen, fleet.order[r])
        settle(work, battery, fleet, scratch, r)
    note_sales(bundles, scratch, robots, count)
    return value
