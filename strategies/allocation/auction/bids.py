"""Bids of one robot for one task, in thousandths of a tick; c1, c2: its costs without and with it.

MiniSum      c2 - c1                  the ticks that the fleet drives in all
MiniMax      c2                       until the last robot is done
mixed        epsilon x MiniSum + (1 - epsilon) x MiniMax
MiniAve      the sum of arrival times with the task less that without (Lagoudakis et al. 2005), or,
             as De Ryck et al. word it, the mean arrival time with it

A robot that has no feasible plan bids nothing (INF_COST), before anything is mixed.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.insertion import copy_inserted, insert
from strategies.allocation.auction.market import BID_SCALE, INF_COST
from strategies.allocation.auction.quotes import insertion_quote, quote_list, settle

BID_MIXED = 0  # rules of bidding
BID_AVERAGE_ADDED = 1
BID_AVERAGE = 2


@kernel
def bid(costs, battery, fleet, scratch, r, task, rule, epsilon):
    """The bid of robot r; INF_COST where it cannot or may not do the task."""
    if fleet.may_bid[r, task] == 0:
        return np.int64(INF_COST)
    scratch.count.bids[0] += 1
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
    """Ticks until each task of a feasible list is done, added up."""
    quote_list(costs, battery, fleet, scratch, r, order, length)
    plan = scratch.plan
    now, total = np.int64(fleet.ready[r]), np.int64(0)
    here = np.int64(fleet.place[r])
    k = 0
    for i in range(length):
        task = np.int64(order[i])
        while k < plan.stops[0] and plan.position[k] == i:
            at = np.int64(battery.charger[plan.charger[k]])
            now += costs.ticks[costs.robot_type[0], here, at] + plan.duration[k] + plan.waited[k]
            here = at
            k += 1
        now += (
            costs.ticks[costs.robot_type[0], here, costs.begin[task]]
            + costs.inside[costs.robot_type[0], task]
        )
        total += now
        here = np.int64(costs.end[task])
    return total


@kernel
def award(costs, battery, fleet, scratch, r, task):
    """Insert the task into robot r's list as its bid predicted; returns the position, NIL: not at all."""
    position, cost = insertion_quote(costs, battery, fleet, scratch, r, task)
    if cost >= INF_COST:
        return np.int64(NIL)
    insert(fleet.order[r], fleet.length[r], task, position)
    fleet.length[r] += 1
    settle(costs, battery, fleet, scratch, r)
    return position
