"""One-shot assignment: at most one task for each robot, least sum of costs (linear sum assignment).

Shortest augmenting paths with potentials (Jonker & Volgenant 1987), O(rows^2 x columns).
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.bids import award, bid
from strategies.allocation.auction.market import INF_COST
from strategies.allocation.auction.quotes import clear_counts

NO_EDGE = 1 << 50  # what a pair that may not be costs


@kernel
def linear_sum_assignment(cost, rows, columns, workspace):
    """workspace.row_of[:columns] = the row of each column, or NIL; rows <= columns.

    cost: (>= rows, >= columns) int64, pairs that may not be cost INF_COST; a row that only such pairs
    are left for stays without a column.
    """
    for j in range(columns + 1):
        workspace.row_of[j] = NIL
        workspace.column_price[j] = 0
    for i in range(rows):
        workspace.row_price[i] = 0
    for i in range(rows):
        # Column `columns` stands for the row that is entered.
        workspace.row_of[columns] = i
        j = augmenting_end(cost, columns, workspace)
        while j != columns:
            before = np.int64(workspace.parent_column[j])
            workspace.row_of[j] = workspace.row_of[before]
            j = before
    for j in range(columns):
        if workspace.row_of[j] != NIL and cost[workspace.row_of[j], j] >= INF_COST:
            workspace.row_of[j] = NIL


@kernel
def augmenting_end(cost, columns, workspace):
    """The free column at which the shortest augmenting path ends; prices are brought up to date."""
    for j in range(columns + 1):
        workspace.slack[j] = INF_COST
        workspace.seen[j] = 0
    here = np.int64(columns)
    while workspace.row_of[here] != NIL:
        workspace.seen[here] = 1
        row = np.int64(workspace.row_of[here])
        step, then = np.int64(INF_COST), np.int64(NIL)
        for j in range(columns):
            if workspace.seen[j] == 1:
                continue
            edge = min(cost[row, j], np.int64(NO_EDGE))
            reduced = edge - workspace.row_price[row] - workspace.column_price[j]
            if reduced < workspace.slack[j]:
                workspace.slack[j] = reduced
                workspace.parent_column[j] = here
            if workspace.slack[j] < step:
                step, then = workspace.slack[j], np.int64(j)
        for j in range(columns + 1):
            if workspace.seen[j] == 1:
                workspace.row_price[workspace.row_of[j]] += step
                workspace.column_price[j] -= step
            else:
                workspace.slack[j] -= step
        here = then
    return here


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
