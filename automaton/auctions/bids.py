"""Bids of one robot for one task, in thousandths of a tick; c1, c2: its costs without and with it.

MiniSum      c2 - c1                  the ticks that the fleet drives in all
MiniMax      c2                       until the last robot is done
mixed        epsilon x MiniSum + (1 - epsilon) x MiniMax
MiniAve      the sum of arrival times with the task less that without (Lagoudakis et al. 2005), or,
             as De Ryck et al. word it, the mean arrival time with it

A robot that has no feasible plan bids nothing (INF), before anything is mixed.
"""

import numpy as np

from automaton.auctions.insertion import copy_inserted, insert
from automaton.auctions.market import BIDS, INF, MIXED
from automaton.auctions.quotes import insertion_quote, quote_list, settle
from automaton.compiled import kernel
from automaton.world.state import NIL

MIX = 0  # rules of bidding
AVERAGE_ADDED = 1
AVERAGE = 2


@kernel
def bid(work, battery, fleet, scratch, r, task, rule, epsilon):
    """The bid of robot r; INF where it cannot or may not do the task."""
    if fleet.heard[r, task] == 0:
        return np.int64(INF)
    scratch.count[BIDS] += 1
    position, cost = insertion_quote(work, battery, fleet, scratch, r, task)
    if cost >= INF or fleet.cost[r] >= INF:
        return np.int64(INF)
    if rule == MIX:
        return MIXED * cost - epsilon * fleet.cost[r]
    length = np.int64(fleet.length[r])
    without = np.int64(0)
    if rule == AVERAGE_ADDED:
        without = sum_of_arrivals(work, battery, fleet, scratch, r, fleet.order[r], length)
    copy_inserted(fleet.order[r], length, task, position, scratch.order)
    with_it = sum_of_arrivals(work, battery, fleet, scratch, r, scratch.order, length + 1)
    if rule == AVERAGE_ADDED:
        return MIXED * (with_it - without)
    return MIXED * with_it // (length + 1)


@kernel
def sum_of_arrivals(work, battery, fleet, scratch, r, order, length):
    """Ticks until each task of a feasible list is done, added up."""
    quote_list(work, battery, fleet, scratch, r, order, length)
    plan = scratch.plan
    now, total = np.int64(fleet.ready[r]), np.int64(0)
    here = np.int64(fleet.place[r])
    k = 0
    for i in range(length):
        task = np.int64(order[i])
        while k < plan.stops[0] and plan.position[k] == i:
            at = np.int64(battery.charger[plan.charger[k]])
            now += work.ticks[work.robot_type[0], here, at] + plan.duration[k] + plan.waited[k]
            here = at
            k += 1
        now += (
            work.ticks[work.robot_type[0], here, work.begin[task]]
            + work.inside[work.robot_type[0], task]
        )
        total += now
        here = np.int64(work.end[task])
    return total


@kernel
def award(work, battery, fleet, scratch, r, task):
    """Insert the task into robot r's list as its bid predicted; returns the position, NIL: not at all."""
    position, cost = insertion_quote(work, battery, fleet, scratch, r, task)
    if cost >= INF:
        return np.int64(NIL)
    insert(fleet.order[r], fleet.length[r], task, position)
    fleet.length[r] += 1
    settle(work, battery, fleet, scratch, r)
    return position
