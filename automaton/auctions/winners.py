"""Which item is sold next, and to whom, from all bids: a row for each robot, INF for no bid.

LOWEST      LB: the lowest bid of all
DIFFERENCE  BD: the item whose highest and lowest finite bid lie farthest apart
FEWEST      FB: the item with the fewest finite bids
REGRET      regret-2: the item whose second lowest and lowest bid lie farthest apart

Ties: the lower bid, then the earlier item, then the robot of lower number. An item that only one of
several robots can do differs without bound.
"""

import numpy as np

from automaton.auctions.market import INF
from automaton.compiled import kernel
from automaton.world.state import NIL

LOWEST = 0
DIFFERENCE = 1
FEWEST = 2
REGRET = 3


@kernel
def note_best(scratch, r, open_items):
    """scratch.best[r] = the open item for which robot r bids lowest; NIL if it bids for none."""
    best, least = np.int64(NIL), np.int64(INF)
    for i in range(open_items):
        k = scratch.left[i]
        if scratch.bid[r, k] < least:
            best, least = np.int64(k), scratch.bid[r, k]
    scratch.best[r] = best


@kernel
def lowest(scratch, robots):
    """(item, robot) of the lowest bid, from each robot's best; (NIL, NIL) if there is none."""
    item, robot, least = np.int64(NIL), np.int64(NIL), np.int64(INF)
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
    among = min(old, bid) <= scratch.second[k] or scratch.keenest[k] == r
    beyond = max(old, bid) >= scratch.high[k]
    if among or beyond:
        scratch.stale[k] = 1


@kernel
def survey(scratch, robots, k):
    """Lowest, second and highest finite bid, bidders and the keenest robot, of an item."""
    low, second, high = np.int64(INF), np.int64(INF), np.int64(-INF)
    bidders, keenest = 0, np.int64(NIL)
    for r in range(robots):
        bid = scratch.bid[r, k]
        if bid >= INF:
            continue
        bidders += 1
        high = max(high, bid)
        if bid < low:
            low, second, keenest = bid, low, np.int64(r)
        elif bid < second:
            second = bid
    scratch.low[k], scratch.second[k], scratch.high[k] = low, second, high
    scratch.bidders[k] = bidders
    scratch.keenest[k] = keenest
    scratch.stale[k] = 0


@kernel
def urgency(scratch, robots, k, winner):
    """How much a surveyed item is to be preferred, by the rule; larger is sooner."""
    if winner == FEWEST:
        return np.int64(-scratch.bidders[k])
    if scratch.bidders[k] == 1:
        return np.int64(INF) if robots > 1 else np.int64(0)
    if winner == DIFFERENCE:
        return scratch.high[k] - scratch.low[k]
    return scratch.second[k] - scratch.low[k]


@kernel
def most_urgent(scratch, robots, open_items, winner):
    """(item, robot) by DIFFERENCE, FEWEST or REGRET; (NIL, NIL) if no robot bids."""
    item, most = np.int64(NIL), np.int64(-INF)
    for i in range(open_items):
        k = np.int64(scratch.left[i])
        if scratch.stale[k] == 1:
            survey(scratch, robots, k)
        if scratch.bidders[k] == 0:
            continue
        value = urgency(scratch, robots, k, winner)
        lower = item != NIL and value == most and scratch.low[k] < scratch.low[item]
        if item == NIL or value > most or lower:
            item, most = k, value
    robot = np.int64(NIL) if item == NIL else np.int64(scratch.keenest[item])
    return item, robot
