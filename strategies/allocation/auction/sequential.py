"""Auctions of single items: sequential (SSI), by order of arrival, and parallel.

Items are tasks: items[:count] by arrival. Robots keep the lists that they have; settle_all first.
Who won an item is in scratch.sold, by number of the item; NIL: no robot can do it.

Messages are counted as the architecture would send them: an announcement for each robot that hears
of an item, each bid once, and an award for each item sold.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.bids import award, bid
from strategies.allocation.auction.market import INF_COST
from strategies.allocation.auction.quotes import clear_counts
from strategies.allocation.auction.winners import (
    WINNER_LOWEST_BID,
    lowest,
    most_urgent,
    note_best,
    note_bid,
)


@kernel
def begin(fleet, scratch, items, count):
    """Announce all items; nothing is counted yet and nothing sold."""
    clear_counts(scratch)
    for k in range(count):
        scratch.left[k] = k
        scratch.sold[k] = NIL
        scratch.needs_update[k] = 1
        for r in range(fleet.place.shape[0]):
            scratch.count.messages[0] += fleet.may_bid[r, items[k]]


@kernel
def bid_for_all(costs, battery, fleet, scratch, items, open_items, r, rule, epsilon):
    """Robot r bids for every open item."""
    for i in range(open_items):
        k = scratch.left[i]
        task = np.int64(items[k])
        offer = bid(costs, battery, fleet, scratch, r, task, rule, epsilon)
        note_bid(scratch, r, np.int64(k), offer)
    note_best(scratch, r, open_items)


@kernel
def award_item(scratch, open_items, item, robot):
    """Take the item off the open ones; returns how many are left."""
    scratch.sold[item] = robot
    at = 0
    while scratch.left[at] != item:
        at += 1
    for i in range(at, open_items - 1):
        scratch.left[i] = scratch.left[i + 1]
    return open_items - 1


@kernel
def sequential(costs, battery, fleet, scratch, items, count, rule, epsilon, winner, everybody):
    """Sell item by item by the rule `winner`; returns how many were sold.

    After a sale only the winner's list has changed, so only it bids again. With everybody = 1 all
    robots do, with the same result.
    """
    robots = fleet.place.shape[0]
    begin(fleet, scratch, items, count)
    for r in range(robots):
        bid_for_all(costs, battery, fleet, scratch, items, count, r, rule, epsilon)
    open_items = np.int64(count)
    while open_items > 0:
        if winner == WINNER_LOWEST_BID:
            item, robot = lowest(scratch, robots)
        else:
            item, robot = most_urgent(scratch, robots, open_items, winner)
        if item == NIL:
            break
        award(costs, battery, fleet, scratch, robot, np.int64(items[item]))
        open_items = award_item(scratch, open_items, item, robot)
        for r in range(robots):
            if r == robot or everybody == 1:
                bid_for_all(costs, battery, fleet, scratch, items, open_items, r, rule, epsilon)
            elif scratch.best[r] == item:
                note_best(scratch, r, open_items)
    sold = np.int64(count) - open_items
    scratch.count.messages[0] += scratch.count.bids[0] + sold
    return sold


@kernel
def by_arrival(costs, battery, fleet, scratch, items, count, rule, epsilon):
    """Each item on its own, as it comes, to the lowest bid (Algorithm 2 of De Ryck et al.)."""
    begin(fleet, scratch, items, count)
    sold = np.int64(0)
    for k in range(count):
        task = np.int64(items[k])
        robot, least = np.int64(NIL), np.int64(INF_COST)
        for r in range(fleet.place.shape[0]):
            offer = bid(costs, battery, fleet, scratch, r, task, rule, epsilon)
            if offer < least:
                robot, least = np.int64(r), offer
        if robot != NIL:
            award(costs, battery, fleet, scratch, robot, task)
            scratch.sold[k] = robot
            sold += 1
    scratch.count.messages[0] += scratch.count.bids[0] + sold
    return sold


@kernel
def parallel(costs, battery, fleet, scratch, items, count, rule, epsilon):
    """All items at once, by the lists as they are: each to its lowest bid, then inserted in turn.

    A robot whose list has no room left for what it won refuses it.
    """
    begin(fleet, scratch, items, count)
    for k in range(count):
        task = np.int64(items[k])
        least = np.int64(INF_COST)
        for r in range(fleet.place.shape[0]):
            offer = bid(costs, battery, fleet, scratch, r, task, rule, epsilon)
            if offer < least:
                scratch.sold[k] = r
                least = offer
    sold = np.int64(0)
    for k in range(count):
        r = np.int64(scratch.sold[k])
        if r == NIL:
            continue
        if award(costs, battery, fleet, scratch, r, np.int64(items[k])) == NIL:
            scratch.sold[k] = NIL
        else:
            sold += 1
    scratch.count.messages[0] += scratch.count.bids[0] + sold
    return sold


@kernel
def objective(fleet, epsilon):
    """epsilon x the sum of the costs + (1 - epsilon) x the largest, in thousandths; or INF_COST."""
    total, most = np.int64(0), np.int64(0)
    for r in range(fleet.cost.shape[0]):
        if fleet.cost[r] >= INF_COST:
            return np.int64(INF_COST)
        total += fleet.cost[r]
        most = max(most, fleet.cost[r])
    return epsilon * total + (1000 - epsilon) * most
