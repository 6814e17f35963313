"""One-shot assignment: at most one task for each robot, least sum of bids."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.bids import award, bid
from strategies.allocation.auction.quotes import clear_counts
from strategies.linear_sum_assignment import linear_sum_assignment


@kernel
def assign_once(costs, battery, fleet, scratch, workspace, items, count, rule, epsilon):
    """Give each robot at most one of the items, with the least sum of bids; returns how many.

    workspace: for at least max(robots, count) rows and columns.
    """
    robots = fleet.place.shape[0]
    clear_counts(scratch)
    turned = robots > count
    for k in range(count):
        scratch.sold[k] = NIL
        for r in range(robots):
            offer = bid(costs, battery, fleet, scratch, r, np.int64(items[k]), rule, epsilon)
            scratch.count.messages[0] += fleet.may_bid[r, items[k]]
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
    scratch.count.messages[0] += scratch.count.bids[0] + given
    return given
