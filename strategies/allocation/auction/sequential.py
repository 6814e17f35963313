"""Auctions of single items: sequential (SSI), by order of arrival, parallel, and one-shot assignment.

Items are tasks: items[:count] by arrival. Robots keep their current lists, which must be settled
(settle_all). scratch.sold has the winner by number of the item; NIL: no robot can do it. Messages are
counted as in the architecture: an announcement per item and receiving robot, each bid once, and an
award per sold item.
"""

import numpy as np

from automaton.strategy.api import NIL, kernel
from strategies.allocation.auction.market import BID_SCALE, INF_COST, copy_inserted, insert
from strategies.allocation.auction.quotes import clear_counts, insertion_quote, quote_list, settle
from strategies.linear_sum_assignment import linear_sum_assignment

BID_MIXED = 0  # rules of bidding
BID_AVERAGE_ADDED = 1
BID_AVERAGE = 2

# rules for the next item to sell, from all bids:
WINNER_LOWEST_BID = 0  # LB: the item with the lowest bid
WINNER_DIFFERENCE = 1  # BD: the largest difference of highest and lowest finite bid
WINNER_FEWEST_BIDDERS = 2  # FB: the fewest finite bids
WINNER_REGRET = 3  # regret-2: the largest difference of second lowest and lowest bid


@kernel
def sequential(costs, battery, fleet, scratch, items, count, rule, epsilon, winner, everybody):
    """Sell item by item by the rule `winner`; return the number of sold items.

    A sale changes only the winner's list, so only the winner bids again. With everybody = 1 all robots
    bid again, with the same result.
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
    scratch.count.messages += scratch.count.bids + sold
    return sold


@kernel
def by_arrival(costs, battery, fleet, scratch, items, count, rule, epsilon):
    """Sell each item separately, by arrival, to the lowest bid (Algorithm 2 of De Ryck et al.)."""
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
    scratch.count.messages += scratch.count.bids + sold
    return sold


@kernel
def parallel(costs, battery, fleet, scratch, items, count, rule, epsilon):
    """Sell all items at once for the current lists: each to its lowest bid; then insert them in sequence.

    A robot whose list has no room for an item that it won refuses the item.
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
    scratch.count.messages += scratch.count.bids + sold
    return sold


@kernel
def assign_once(costs, battery, fleet, scratch, workspace, items, count, rule, epsilon):
    """Give each robot at most one item, with the least sum of bids; return the number of sold items.

    workspace: for at least max(robots, count) rows and columns.
    """
    robots = fleet.place.shape[0]
    clear_counts(scratch)
    turned = robots > count
    for k in range(count):
        scratch.sold[k] = NIL
        for r in range(robots):
            offer = bid(costs, battery, fleet, scratch, r, np.int64(items[k]), rule, epsilon)
            scratch.count.messages += fleet.may_bid[r, items[k]]
            if turned:
                workspace.cost[k, r] = offer
            else:
                workspace.cost[r, k] = offer
    linear_sum_assignment(workspace.cost, min(robots, count), max(robots, count), workspace)
    given = np.int64(0)
    for j in range(max(robots, count)):
        i = np.int64(workspace.row_of[j])
        if i == NIL:
            continue
        k, r = (i, np.int64(j)) if turned else (np.int64(j), i)
        award(costs, battery, fleet, scratch, r, np.int64(items[k]))
        scratch.sold[k] = r
        given += 1
    scratch.count.messages += scratch.count.bids + given
    return given


@kernel
def begin(fleet, scratch, items, count):
    """Announce all items, and reset counters and sales."""
    clear_counts(scratch)
    for k in range(count):
        scratch.left[k] = k
        scratch.sold[k] = NIL
        scratch.needs_update[k] = 1
        for r in range(fleet.place.shape[0]):
            scratch.count.messages += fleet.may_bid[r, items[k]]


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
def award(costs, battery, fleet, scratch, r, task):
    """Insert the task into robot r's list as in its bid; return the position, NIL: infeasible."""
    position, cost = insertion_quote(costs, battery, fleet, scratch, r, task)
    if cost >= INF_COST:
        return np.int64(NIL)
    insert(fleet.order[r], fleet.length[r], task, position)
    fleet.length[r] += 1
    settle(costs, battery, fleet, scratch, r)
    return position


@kernel
def award_item(scratch, open_items, item, robot):
    """Remove the item from the open ones; return the number left."""
    scratch.sold[item] = robot
    at = 0
    while scratch.left[at] != item:
        at += 1
    for i in range(at, open_items - 1):
        scratch.left[i] = scratch.left[i + 1]
    return open_items - 1


# Bids of one robot for one task, in thousandths of a tick; c1, c2: its costs without and with it.
#
#     MiniSum    c2 - c1: for the total ticks of the fleet
#     MiniMax    c2: for the time when the last robot is done
#     mixed      epsilon x MiniSum + (1 - epsilon) x MiniMax
#     MiniAve    the increase of the sum of arrival times by the task (Lagoudakis et al. 2005),
#                or, in De Ryck et al., the mean arrival time with the task
#
# A robot without a feasible plan does not bid (INF_COST), whatever the rule.


@kernel
def bid(costs, battery, fleet, scratch, r, task, rule, epsilon):
    """The bid of robot r; INF_COST if it cannot or must not do the task."""
    if fleet.may_bid[r, task] == 0:
        return np.int64(INF_COST)
    scratch.count.bids += 1
    position, cost = insertion_quote(costs, battery, fleet, scratch, r, task)
    if cost >= INF_COST or fleet.cost[r] >= INF_COST:
        return np.int64(INF_COST)
    if rule == BID_MIXED:
        return BID_SCALE * cost - epsilon * fleet.cost[r]
    length = np.int64(fleet.length[r])
    without = np.int64(0)
    if rule == BID_AVERAGE_ADDED:
        without = sum_of_arrivals(costs, battery, fleet, scratch, r, fleet.order[r], length)
    copy_inserted(fleet.order[r], length, task, position, scratch.order)
    with_it = sum_of_arrivals(costs, battery, fleet, scratch, r, scratch.order, length + 1)
    if rule == BID_AVERAGE_ADDED:
        return BID_SCALE * (with_it - without)
    return BID_SCALE * with_it // (length + 1)


@kernel
def sum_of_arrivals(costs, battery, fleet, scratch, r, order, length):
    """The sum of the ticks until each task of a feasible list is done."""
    quote_list(costs, battery, fleet, scratch, r, order, length)
    plan = scratch.plan
    ticks, inside = costs.ticks[costs.robot_type], costs.inside[costs.robot_type]
    now, total = np.int64(fleet.ready[r]), np.int64(0)
    here = np.int64(fleet.place[r])
    k = 0
    for i in range(length):
        task = np.int64(order[i])
        while k < plan.stops and plan.position[k] == i:
            at = np.int64(battery.charger[plan.charger[k]])
            now += ticks[here, at] + plan.duration[k] + plan.waited[k]
            here = at
            k += 1
        now += ticks[here, costs.begin[task]] + inside[task]
        total += now
        here = np.int64(costs.end[task])
    return total


# The next item and its winner, from all bids: a row for each robot, INF_COST for no bid.
#
# Ties: the lower bid, then the earlier item, then the robot of lower number. An item that only one of
# several robots can do has an infinite difference.


@kernel
def note_best(scratch, r, open_items):
    """scratch.best[r] = the open item with the lowest bid of robot r, or NIL."""
    best, least = np.int64(NIL), np.int64(INF_COST)
    for i in range(open_items):
        k = scratch.left[i]
        if scratch.bid[r, k] < least:
            best, least = np.int64(k), scratch.bid[r, k]
    scratch.best[r] = best


@kernel
def lowest(scratch, robots):
    """(item, robot) of the lowest bid, from the best item of each robot; (NIL, NIL) without bids."""
    item, robot, least = np.int64(NIL), np.int64(NIL), np.int64(INF_COST)
    for r in range(robots):
        k = np.int64(scratch.best[r])
        if k != NIL:
            bid = scratch.bid[r, k]
            if bid < least or (bid == least and k < item):
                item, robot, least = k, np.int64(r), bid
    return item, robot


@kernel
def note_bid(scratch, r, k, bid):
    """Store robot r's bid for item k; mark the item as outdated only if its surveyed bids may change."""
    old = scratch.bid[r, k]
    scratch.bid[r, k] = bid
    among = min(old, bid) <= scratch.second[k] or scratch.lowest_bidder[k] == r
    beyond = max(old, bid) >= scratch.high[k]
    if among or beyond:
        scratch.needs_update[k] = 1


@kernel
def summarize_bids(scratch, robots, k):
    """Set lowest, second and highest finite bid, number of bidders and lowest bidder of an item."""
    low, second, high = np.int64(INF_COST), np.int64(INF_COST), np.int64(-INF_COST)
    bidders, lowest_bidder = 0, np.int64(NIL)
    for r in range(robots):
        bid = scratch.bid[r, k]
        if bid >= INF_COST:
            continue
        bidders += 1
        high = max(high, bid)
        if bid < low:
            low, second, lowest_bidder = bid, low, np.int64(r)
        elif bid < second:
            second = bid
    scratch.low[k], scratch.second[k], scratch.high[k] = low, second, high
    scratch.bidders[k] = bidders
    scratch.lowest_bidder[k] = lowest_bidder
    scratch.needs_update[k] = 0


@kernel
def urgency(scratch, robots, k, winner):
    """The preference of an item by the rule; larger is sold sooner."""
    if winner == WINNER_FEWEST_BIDDERS:
        return np.int64(-scratch.bidders[k])
    if scratch.bidders[k] == 1:
        return np.int64(INF_COST) if robots > 1 else np.int64(0)
    if winner == WINNER_DIFFERENCE:
        return scratch.high[k] - scratch.low[k]
    return scratch.second[k] - scratch.low[k]


@kernel
def most_urgent(scratch, robots, open_items, winner):
    """(item, robot) by WINNER_DIFFERENCE, WINNER_FEWEST_BIDDERS or WINNER_REGRET; or (NIL, NIL)."""
    item, most = np.int64(NIL), np.int64(-INF_COST)
    for i in range(open_items):
        k = np.int64(scratch.left[i])
        if scratch.needs_update[k] == 1:
            summarize_bids(scratch, robots, k)
        if scratch.bidders[k] == 0:
            continue
        value = urgency(scratch, robots, k, winner)
        lower = item != NIL and value == most and scratch.low[k] < scratch.low[item]
        if item == NIL or value > most or lower:
            item, most = k, value
    robot = np.int64(NIL) if item == NIL else np.int64(scratch.lowest_bidder[item])
    return item, robot
