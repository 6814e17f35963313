"""Improvement of lists after an auction: relocate a task, swap two, reverse a stretch (2-opt).

A move is taken as soon as it makes the objective smaller, or leaves it equal and makes the sum of
all costs smaller; the search ends when no move does.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from strategies.allocation.auction.insertion import cheapest_insertion, insert, remove
from strategies.allocation.auction.market import BID_SCALE, INF_COST
from strategies.allocation.auction.quotes import quote_list, settle


@kernel
def improve(costs, battery, fleet, scratch, epsilon):
    """Improve settled, feasible lists until no move helps; returns the number of moves taken."""
    robots = fleet.place.shape[0]
    moves = np.int64(0)
    found = True
    while found:
        found = False
        for r in range(robots):
            while two_opt(costs, battery, fleet, scratch, epsilon, r):
                found = True
                moves += 1
            for s in range(robots):
                while relocate(costs, battery, fleet, scratch, epsilon, r, s):
                    found = True
                    moves += 1
                while s > r and swap(costs, battery, fleet, scratch, epsilon, r, s):
                    found = True
                    moves += 1
    return moves


@kernel
def better(fleet, epsilon, r, cost_r, s, cost_s):
    """Whether costs cost_r, cost_s of robots r and s are an improvement; r == s: cost_r alone."""
    if cost_r >= INF_COST or cost_s >= INF_COST:
        return False
    rest, most = np.int64(0), np.int64(0)
    for other in range(fleet.cost.shape[0]):
        if other != r and other != s:
            rest += fleet.cost[other]
            most = max(most, fleet.cost[other])
    now_sum, now_most = rest + fleet.cost[r], max(most, fleet.cost[r])
    new_sum, new_most = rest + cost_r, max(most, cost_r)
    if s != r:
        now_sum, now_most = now_sum + fleet.cost[s], max(now_most, fleet.cost[s])
        new_sum, new_most = new_sum + cost_s, max(new_most, cost_s)
    now = epsilon * now_sum + (BID_SCALE - epsilon) * now_most
    new = epsilon * new_sum + (BID_SCALE - epsilon) * new_most
    return new < now or (new == now and new_sum < now_sum)


@kernel
def two_opt(costs, battery, fleet, scratch, epsilon, r):
    """Reverse one stretch of robot r's list, if that is better."""
    length = np.int64(fleet.length[r])
    order = fleet.order[r]
    for i in range(min(np.int64(fleet.first[r]), length), length):
        for j in range(i + 1, length):
            for k in range(length):
                scratch.order[k] = order[i + j - k] if i <= k <= j else order[k]
            cost = quote_list(costs, battery, fleet, scratch, r, scratch.order, length)
            if better(fleet, epsilon, r, cost, r, cost):
                for k in range(length):
                    order[k] = scratch.order[k]
                settle(costs, battery, fleet, scratch, r)
                return True
    return False


@kernel
def cost_without(costs, battery, fleet, scratch, r, position):
    """The quote of robot r's list without the task at this position; the list is in scratch.order."""
    length = np.int64(fleet.length[r])
    for k in range(length):
        scratch.order[k] = fleet.order[r, k]
    remove(scratch.order, length, position)
    return quote_list(costs, battery, fleet, scratch, r, scratch.order, length - 1)


@kernel
def cost_inserted(costs, battery, fleet, scratch, r, length, task):
    """(position, quote) of scratch.order[:length] with the task inserted; the list is left there."""
    first = min(np.int64(fleet.first[r]), length)
    place = np.int64(fleet.place[r])
    costs.robot_type[0] = fleet.robot_type[r]
    position, _ = cheapest_insertion(costs, place, scratch.order, length, task, first)
    insert(scratch.order, length, task, position)
    return position, quote_list(costs, battery, fleet, scratch, r, scratch.order, length + 1)


@kernel
def relocate(costs, battery, fleet, scratch, epsilon, r, s):
    """Move one task of robot r to where it is cheapest in robot s's list, if that is better."""
    if s != r and fleet.length[s] >= fleet.capacity[s]:
        return False
    length = np.int64(fleet.length[r])
    for i in range(min(np.int64(fleet.first[r]), length), length):
        task = np.int64(fleet.order[r, i])
        if fleet.may_bid[s, task] == 0:
            continue
        cost_r = cost_without(costs, battery, fleet, scratch, r, i)
        target = length - 1
        if s != r:
            target = np.int64(fleet.length[s])
            for k in range(target):
                scratch.order[k] = fleet.order[s, k]
        position, cost_s = cost_inserted(costs, battery, fleet, scratch, s, target, task)
        if s == r:
            cost_r = cost_s
        if better(fleet, epsilon, r, cost_r, s, cost_s):
            move(fleet, r, i, s, position)
            settle(costs, battery, fleet, scratch, r)
            settle(costs, battery, fleet, scratch, s)
            return True
    return False


@kernel
def move(fleet, r, i, s, position):
    """Take the task at i from robot r and insert it at `position` of robot s's list."""
    task = np.int64(fleet.order[r, i])
    remove(fleet.order[r], fleet.length[r], i)
    fleet.length[r] -= 1
    insert(fleet.order[s], fleet.length[s], task, position)
    fleet.length[s] += 1


@kernel
def swap(costs, battery, fleet, scratch, epsilon, r, s):
    """Exchange a task of robot r for one of robot s, each inserted where it is cheapest."""
    for i in range(min(fleet.first[r], fleet.length[r]), fleet.length[r]):
        given = np.int64(fleet.order[r, i])
        if fleet.may_bid[s, given] == 0:
            continue
        for j in range(min(fleet.first[s], fleet.length[s]), fleet.length[s]):
            taken = np.int64(fleet.order[s, j])
            if fleet.may_bid[r, taken] == 0:
                continue
            at_r, cost_r = exchanged(costs, battery, fleet, scratch, r, i, taken)
            at_s, cost_s = exchanged(costs, battery, fleet, scratch, s, j, given)
            if better(fleet, epsilon, r, cost_r, s, cost_s):
                replace(fleet, r, i, taken, at_r)
                replace(fleet, s, j, given, at_s)
                settle(costs, battery, fleet, scratch, r)
                settle(costs, battery, fleet, scratch, s)
                return True
    return False


@kernel
def exchanged(costs, battery, fleet, scratch, r, i, task):
    """(position, quote) of robot r's list with the task at i taken out and another inserted."""
    length = np.int64(fleet.length[r])
    for k in range(length):
        scratch.order[k] = fleet.order[r, k]
    remove(scratch.order, length, i)
    return cost_inserted(costs, battery, fleet, scratch, r, length - 1, task)


@kernel
def replace(fleet, r, i, task, position):
    """Take the task at i out of robot r's list and insert another at `position`."""
    remove(fleet.order[r], fleet.length[r], i)
    insert(fleet.order[r], fleet.length[r] - 1, task, position)
