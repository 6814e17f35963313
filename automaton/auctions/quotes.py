"""What a list costs with its charging: the quote that a bid rests on."""

import numpy as np

from automaton.auctions.charge_path import READY
from automaton.auctions.charge_plan import clear, fits, plan_charging
from automaton.auctions.insertion import (
    cheapest_insertion,
    copy_inserted,
    energy_added,
    measure,
)
from automaton.auctions.market import (
    FILL_UP,
    INF,
    JOINT,
    LOOK,
    LOWEST,
    NO_CHARGING,
    POSITIONS,
    SAFE,
)
from automaton.auctions.single_stop import plan_single_stop
from automaton.auctions.threshold import plan_threshold
from automaton.compiled import kernel
from automaton.world.state import NIL


@kernel
def look_at(work, battery, robot_type):
    """Reckon with robots of a type from now on."""
    work.robot_type[0] = robot_type
    battery.robot_type[0] = robot_type


@kernel
def quote(work, battery, scratch, place, ready, charge, order, length):
    """Ticks until order[:length] is done, charging included, or INF; the plan is in scratch.plan.

    A robot that is at `place` in `ready` ticks, then with `charge` units.
    """
    measure(work, scratch, place, order, length)
    scratch.path[READY] = ready
    policy = battery.policy
    if policy == NO_CHARGING:
        clear(scratch, charge, length)
        return ready + scratch.done_ticks[length]
    if policy == LOOK or policy == SAFE:
        cost = plan_threshold(work, battery, scratch, place, charge, order, length)
        if scratch.plan.figures[LOWEST] < 0:
            cost = np.int64(INF)
    elif policy == FILL_UP:
        cost = plan_single_stop(work, battery, scratch, place, charge, order, length, 1)
    elif battery.curve.shape[0] > 1:
        cost = plan_single_stop(work, battery, scratch, place, charge, order, length, 0)
    else:
        cost = plan_charging(work, battery, scratch, place, charge, order, length)
    return np.int64(INF) if cost >= INF else ready + cost


@kernel
def quote_list(work, battery, fleet, scratch, r, order, length):
    """The quote of robot r for order[:length]."""
    look_at(work, battery, fleet.robot_type[r])
    place, ready = np.int64(fleet.place[r]), np.int64(fleet.ready[r])
    charge = np.int64(fleet.charge[r])
    return quote(work, battery, scratch, place, ready, charge, order, length)


@kernel
def settle(work, battery, fleet, scratch, r):
    """Make travel, energy and cost of robot r those of its list."""
    length = fleet.length[r]
    fleet.cost[r] = quote_list(work, battery, fleet, scratch, r, fleet.order[r], length)
    fleet.travel[r] = scratch.done_ticks[length]
    fleet.energy[r] = scratch.done_energy[length]


@kernel
def settle_all(work, battery, fleet, scratch):
    """`settle` for every robot."""
    for r in range(fleet.place.shape[0]):
        settle(work, battery, fleet, scratch, r)


@kernel
def insertion_quote(work, battery, fleet, scratch, r, task):
    """(position, ticks) of robot r's list with the task inserted; (NIL, INF): not at all.

    The robot's own list is settled.
    """
    length = np.int64(fleet.length[r])
    if length >= fleet.room[r] or fleet.cost[r] >= INF:
        return np.int64(NIL), np.int64(INF)
    look_at(work, battery, fleet.robot_type[r])
    order = fleet.order[r]
    first = min(np.int64(fleet.first[r]), length)
    place = np.int64(fleet.place[r])
    scratch.count[POSITIONS] += length + 1 - first
    position, added = cheapest_insertion(work, place, order, length, task, first)
    direct = fleet.ready[r] + fleet.travel[r] + added
    policy = battery.policy
    if policy == NO_CHARGING:
        return np.int64(position), np.int64(direct)
    if policy != LOOK and policy != SAFE:
        energy = fleet.energy[r] + energy_added(work, place, order, length, task, position)
        last = np.int64(work.end[task if position == length else order[length - 1]])
        if fits(battery, np.int64(fleet.charge[r]), energy, last):
            return np.int64(position), np.int64(direct)
    if policy == JOINT:
        return joint_insertion(work, battery, fleet, scratch, r, task, first)
    copy_inserted(order, length, task, position, scratch.order)
    cost = quote_list(work, battery, fleet, scratch, r, scratch.order, length + 1)
    return np.int64(position), cost


@kernel
def joint_insertion(work, battery, fleet, scratch, r, task, first):
    """The position that is cheapest with its charging; ties: the latest."""
    length = np.int64(fleet.length[r])
    best, least = np.int64(NIL), np.int64(INF)
    for position in range(first, length + 1):
        copy_inserted(fleet.order[r], length, task, position, scratch.order)
        cost = quote_list(work, battery, fleet, scratch, r, scratch.order, length + 1)
        if cost < INF and cost <= least:
            best, least = np.int64(position), cost
    return best, least
