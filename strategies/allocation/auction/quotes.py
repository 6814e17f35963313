"""One charging stop, found by trying every position and charger: for tapering curves and fill-up.

With a taper the time to charge depends on the level at which it begins, so each candidate's time is
read off the curve. Fill-up charges to the target and credits what is left at the end:

    score = ticks - (level at the end - reserve) / rate of the curve's first piece

Ties: fewer ticks from the task before to the charger, then the later position.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.robot_states import BATTERY_FULL
from automaton.engine.state import NIL
from automaton.strategy.kernels import CURVE_RATE, charging_ticks, level_after
from strategies.allocation.auction.charging import (
    add_detours,
    clear,
    energy_to_charger,
    fits,
    plan_charging,
    plan_threshold,
    stop_at,
    waiting_at,
)
from strategies.allocation.auction.market import (
    INF_COST,
    POLICY_FILL_UP,
    POLICY_JOINT,
    POLICY_NO_CHARGING,
    POLICY_THRESHOLD,
    POLICY_THRESHOLD_REACHABLE,
    cheapest_insertion,
    copy_inserted,
    energy_added,
    measure,
    place_before,
)


@kernel
def plan_single_stop(costs, battery, scratch, place, charge, order, length, fill):
    """Leave the best plan with at most one stop in scratch.plan; several stops where one cannot do.

    fill: 1 = fill up to battery.target. Returns the ticks of the list, or INF_COST.
    """
    clear(scratch, charge, length)
    if length == 0 or fits(
        battery, charge, scratch.done_energy[length], np.int64(costs.end[order[length - 1]])
    ):
        return scratch.plan.cost[0]
    position, charger = find_stop(costs, battery, scratch, place, charge, order, length, fill)
    if position == NIL:
        return plan_charging(costs, battery, scratch, place, charge, order, length)
    scratch.count.plans[0] += 1
    plan = scratch.plan
    plan.stops[0] = 1
    plan.position[0] = position
    plan.charger[0] = charger
    at = np.int64(battery.charger[charger])
    before = place_before(costs, place, order, position)
    after = np.int64(costs.begin[order[position]])
    arrival = charge - scratch.done_energy[position] - costs.energy[costs.robot_type[0], before, at]
    rest = (
        costs.energy[costs.robot_type[0], at, after]
        + scratch.done_energy[length]
        - scratch.begun_energy[position]
    )
    tail = energy_to_charger(battery, costs.end[order[length - 1]])
    plan.cost[0] += (
        costs.ticks[costs.robot_type[0], before, at] + costs.ticks[costs.robot_type[0], at, after]
    )
    plan.cost[0] -= costs.ticks[costs.robot_type[0], before, after]
    wait = waiting_at(
        battery,
        scratch,
        charger,
        scratch.done_ticks[position] + costs.ticks[costs.robot_type[0], before, at],
    )
    goal = goal_of(battery, arrival, rest + tail, fill)
    level = stop_at(battery, plan, 0, arrival, goal, wait)
    plan.end_charge[0] = level - rest
    plan.lowest_charge[0] = min(arrival, level - rest)
    add_detours(costs, battery, scratch, place, order)
    return plan.cost[0]


@kernel
def goal_of(battery, arrival, rest, fill):
    """The level to charge to: what the rest needs, and when filling up at least the target."""
    goal = max(np.int64(arrival), rest + battery.reserve[battery.robot_type[0]])
    return max(goal, np.int64(battery.target)) if fill == 1 else goal


@kernel
def find_stop(costs, battery, scratch, place, charge, order, length, fill):
    """(position, charger) of the best single stop, or (NIL, NIL)."""
    tail = energy_to_charger(battery, costs.end[order[length - 1]])
    reserve = np.int64(battery.reserve[battery.robot_type[0]])
    curve = battery.curve[battery.robot_type[0]]
    rate = np.int64(curve[0, CURVE_RATE])
    best, nearest = np.int64(INF_COST), np.int64(INF_COST)
    position, charger = np.int64(NIL), np.int64(NIL)
    if tail >= INF_COST:
        return position, charger
    for i in range(length):
        before = place_before(costs, place, order, i)
        after = np.int64(costs.begin[order[i]])
        scratch.count.states[0] += battery.charger.shape[0]
        for c in range(battery.charger.shape[0]):
            at = np.int64(battery.charger[c])
            into = np.int64(costs.ticks[costs.robot_type[0], before, at])
            arrival = (
                charge - scratch.done_energy[i] - costs.energy[costs.robot_type[0], before, at]
            )
            rest = (
                costs.energy[costs.robot_type[0], at, after]
                + scratch.done_energy[length]
                - scratch.begun_energy[i]
            )
            if arrival < reserve or rest + tail + reserve > BATTERY_FULL:
                continue
            goal = goal_of(battery, arrival, rest + tail, fill)
            duration = charging_ticks(curve, arrival, goal)
            ticks = scratch.done_ticks[length] + into + costs.ticks[costs.robot_type[0], at, after]
            ticks += duration - costs.ticks[costs.robot_type[0], before, after]
            ticks += waiting_at(battery, scratch, np.int64(c), scratch.done_ticks[i] + into)
            score = rate * ticks
            if fill == 1:
                score -= level_after(curve, arrival, duration, BATTERY_FULL) - rest - reserve
            later = into == nearest and i > position
            if score < best or (score == best and (into < nearest or later)):
                best, nearest, position, charger = score, into, np.int64(i), np.int64(c)
    return position, charger


# What a list costs with its charging: the quote that a bid rests on.


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
