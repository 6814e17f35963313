"""What a list costs with its charging: the quote that a bid rests on."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.charge_plan import clear, fits, plan_charging
from strategies.allocation.auction.insertion import (
    cheapest_insertion,
    copy_inserted,
    energy_added,
    measure,
)
from strategies.allocation.auction.market import (
    INF_COST,
    POLICY_FILL_UP,
    POLICY_JOINT,
    POLICY_NO_CHARGING,
    POLICY_THRESHOLD,
    POLICY_THRESHOLD_REACHABLE,
)
from strategies.allocation.auction.single_stop import plan_single_stop
from strategies.allocation.auction.threshold_charging import plan_threshold


@kernel
def clear_counts(scratch):
    """Count what is done from now on."""
    count = scratch.count
    count.bids[0] = 0
    count.positions[0] = 0
    count.plans[0] = 0
    count.messages[0] = 0
    count.states[0] = 0


@kernel
def select_robot_type(costs, battery, robot_type):
    """Select the type of robots whose ticks and energy count from now on."""
    costs.robot_type[0] = robot_type
    battery.robot_type[0] = robot_type


@kernel
def quote(costs, battery, scratch, place, ready, charge, order, length):
    """Ticks until order[:length] is done, charging included, or INF_COST; the plan is in scratch.plan.

    A robot that is at `place` in `ready` ticks, then with `charge` units.
    """
    measure(costs, scratch, place, order, length)
    scratch.path.ready[0] = ready
    policy = battery.policy
    if policy == POLICY_NO_CHARGING:
        clear(scratch, charge, length)
        return ready + scratch.done_ticks[length]
    if policy == POLICY_THRESHOLD or policy == POLICY_THRESHOLD_REACHABLE:
        cost = plan_threshold(costs, battery, scratch, place, charge, order, length)
        if scratch.plan.lowest_charge[0] < 0:
            cost = np.int64(INF_COST)
    elif policy == POLICY_FILL_UP:
        cost = plan_single_stop(costs, battery, scratch, place, charge, order, length, 1)
    elif battery.curve.shape[1] > 1:
        cost = plan_single_stop(costs, battery, scratch, place, charge, order, length, 0)
    else:
        cost = plan_charging(costs, battery, scratch, place, charge, order, length)
    return np.int64(INF_COST) if cost >= INF_COST else ready + cost


@kernel
def quote_list(costs, battery, fleet, scratch, r, order, length):
    """The quote of robot r for order[:length]."""
    select_robot_type(costs, battery, fleet.robot_type[r])
    place, ready = np.int64(fleet.place[r]), np.int64(fleet.ready[r])
    charge = np.int64(fleet.charge[r])
    return quote(costs, battery, scratch, place, ready, charge, order, length)


@kernel
def settle(costs, battery, fleet, scratch, r):
    """Make travel, energy and cost of robot r those of its list."""
    length = fleet.length[r]
    fleet.cost[r] = quote_list(costs, battery, fleet, scratch, r, fleet.order[r], length)
    fleet.travel[r] = scratch.done_ticks[length]
    fleet.energy[r] = scratch.done_energy[length]


@kernel
def settle_all(costs, battery, fleet, scratch):
    """`settle` for every robot."""
    for r in range(fleet.place.shape[0]):
        settle(costs, battery, fleet, scratch, r)


@kernel
def insertion_quote(costs, battery, fleet, scratch, r, task):
    """(position, ticks) of robot r's list with the task inserted; (NIL, INF_COST): not at all.

    The robot's own list is settled.
    """
    length = np.int64(fleet.length[r])
    if length >= fleet.capacity[r] or fleet.cost[r] >= INF_COST:
        return np.int64(NIL), np.int64(INF_COST)
    select_robot_type(costs, battery, fleet.robot_type[r])
    order = fleet.order[r]
    first = min(np.int64(fleet.first[r]), length)
    place = np.int64(fleet.place[r])
    scratch.count.positions[0] += length + 1 - first
    position, added = cheapest_insertion(costs, place, order, length, task, first)
    direct = fleet.ready[r] + fleet.travel[r] + added
    policy = battery.policy
    if policy == POLICY_NO_CHARGING:
        return np.int64(position), np.int64(direct)
    if policy != POLICY_THRESHOLD and policy != POLICY_THRESHOLD_REACHABLE:
        energy = fleet.energy[r] + energy_added(costs, place, order, length, task, position)
        last = np.int64(costs.end[task if position == length else order[length - 1]])
        if fits(battery, np.int64(fleet.charge[r]), energy, last):
            return np.int64(position), np.int64(direct)
    if policy == POLICY_JOINT:
        return joint_insertion(costs, battery, fleet, scratch, r, task, first)
    copy_inserted(order, length, task, position, scratch.order)
    cost = quote_list(costs, battery, fleet, scratch, r, scratch.order, length + 1)
    return np.int64(position), cost


@kernel
def joint_insertion(costs, battery, fleet, scratch, r, task, first):
    """The position that is cheapest with its charging; ties: the latest."""
    length = np.int64(fleet.length[r])
    best, least = np.int64(NIL), np.int64(INF_COST)
    for position in range(first, length + 1):
        copy_inserted(fleet.order[r], length, task, position, scratch.order)
        cost = quote_list(costs, battery, fleet, scratch, r, scratch.order, length + 1)
        if cost < INF_COST and cost <= least:
            best, least = np.int64(position), cost
    return best, least
