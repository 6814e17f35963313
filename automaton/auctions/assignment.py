"""One-shot assignment: at most one task for each robot, least sum of costs (linear sum assignment).

Shortest augmenting paths with potentials (Jonker & Volgenant 1987), O(rows^2 x columns).
"""

import numpy as np

from automaton.auctions.bids import award, bid
from automaton.auctions.market import BIDS, INF, MESSAGES
from automaton.compiled import kernel
from automaton.world.state import NIL

NO_EDGE = 1 << 50  # what a pair that may not be costs


@kernel
def linear_sum_assignment(cost, rows, columns, space):
    """space.row_of[:columns] = the row of each column, or NIL; rows <= columns.

    cost: (>= rows, >= columns) int64, pairs that may not be cost INF; a row that only such pairs
    are left for stays without a column.
    """
    for j in range(columns + 1):
        space.row_of[j] = NIL
        space.column_price[j] = 0
    for i in range(rows):
        space.row_price[i] = 0
    for i in range(rows):
        # Column `columns` stands for the row that is entered.
        space.row_of[columns] = i
        j = augmenting_end(cost, columns, space)
        while j != columns:
            before = np.int64(space.came[j])
            space.row_of[j] = space.row_of[before]
            j = before
    for j in range(columns):
        if space.row_of[j] != NIL and cost[space.row_of[j], j] >= INF:
            space.row_of[j] = NIL


@kernel
def augmenting_end(cost, columns, space):
    """The free column at which the shortest augmenting path ends; prices are brought up to date."""
    for j in range(columns + 1):
        space.slack[j] = INF
        space.seen[j] = 0
    here = np.int64(columns)
    while space.row_of[here] != NIL:
        space.seen[here] = 1
        row = np.int64(space.row_of[here])
        step, then = np.int64(INF), np.int64(NIL)
        for j in range(columns):
            if space.seen[j] == 1:
                continue
            edge = min(cost[row, j], np.int64(NO_EDGE))
            reduced = edge - space.row_price[row] - space.column_price[j]
            if reduced < space.slack[j]:
                space.slack[j] = reduced
                space.came[j] = here
            if space.slack[j] < step:
                step, then = space.slack[j], np.int64(j)
        for j in range(columns + 1):
            if space.seen[j] == 1:
                space.row_price[space.row_of[j]] += step
                space.column_price[j] -= step
            else:
                space.slack[j] -= step
        here = then
    return here


@kernel
def assign_once(work, battery, fleet, scratch, space, items, count, rule, epsilon):
    """Give each robot at most one of the items, with the least sum of bids; returns how many.

    space: for at least max(robots, count) rows and columns.
    """
    robots = fleet.place.shape[0]
    scratch.count[:] = 0
    turned = robots > count
    for k in range(count):
        scratch.sold[k] = NIL
        for r in range(robots):
            offer = bid(work, battery, fleet, scratch, r, np.int64(items[k]), rule, epsilon)
            scratch.count[MESSAGES] += fleet.heard[r, items[k]]
            if turned:
                space.cost[k, r] = offer
            else:
                space.cost[r, k] = offer
    linear_sum_assignment(space.cost, min(robots, count), max(robots, count), space)
    given = np.int64(0)
    for j in range(max(robots, count)):
        i = np.int64(space.row_of[j])
        if i == NIL:
            continue
        k, r = (i, np.int64(j)) if turned else (np.int64(j), i)
        award(work, battery, fleet, scratch, r, np.int64(items[k]))
        scratch.sold[k] = r
        given += 1
    scratch.count[MESSAGES] += scratch.count[BIDS] + given
    return given
