"""Which item is sold next, and to whom, from all bids: a row for each robot, INF_COST for no bid.

WINNER_LOWEST_BID      LB: the lowest bid of all
WINNER_DIFFERENCE  BD: the item whose highest and lowest finite bid lie farthest apart
WINNER_FEWEST_BIDDERS      FB: the item with the fewest finite bids
WINNER_REGRET      regret-2: the item whose second lowest and lowest bid lie farthest apart

Ties: the lower bid, then the earlier item, then the robot of lower number. An item that only one of
several robots can do differs without bound.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.market import INF_COST

WINNER_LOWEST_BID = 0
WINNER_DIFFERENCE = 1
WINNER_FEWEST_BIDDERS = 2
WINNER_REGRET = 3


@kernel
def note_best(scratch, r, open_items):
    """scratch.best[r] = the open item for which robot r bids lowest; NIL if it bids for none."""
    best, least = np.int64(NIL), np.int64(INF_COST)
    for i in range(open_items):
        k = scratch.left[i]
        if scratch.bid[r, k] < least:
            best, least = np.int64(k), scratch.bid[r, k]
    scratch.best[r] = best


@kernel
def lowest(scratch, robots):
    """(item, robot) of the lowest bid, from each robot's best; (NIL, NIL) if there is none."""
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
    """Enter robot r's bid for item k; the item is surveyed again only if that can matter."""
    old = scratch.bid[r, k]
    scratch.bid[r, k] = bid
    among = min(old, bid) <= scratch.second[k] or scratch.lowest_bidder[k] == r
    beyond = max(old, bid) >= scratch.high[k]
    if among or beyond:
        scratch.needs_update[k] = 1


@kernel
def summarize_bids(scratch, robots, k):
    """Set lowest, second and highest finite bid, the bidders and the lowest bidder of an item."""
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
    """How much a surveyed item is to be preferred, by the rule; larger is sooner."""
    if winner == WINNER_FEWEST_BIDDERS:
        return np.int64(-scratch.bidders[k])
    if scratch.bidders[k] == 1:
        return np.int64(INF_COST) if robots > 1 else np.int64(0)
    if winner == WINNER_DIFFERENCE:
        return scratch.high[k] - scratch.low[k]
    return scratch.second[k] - scratch.low[k]


@kernel
def most_urgent(scratch, robots, open_items, winner):
    """(item, robot) by WINNER_DIFFERENCE, WINNER_FEWEST_BIDDERS or WINNER_REGRET; (NIL, NIL) if no
    robot bids.
    """
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
