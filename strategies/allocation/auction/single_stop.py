"""One charging stop, found by trying every position and charger: for tapering curves and fill-up.

With a taper the time to charge depends on the level at which it begins, so each candidate's time is
read off the curve. Fill-up charges to the target and credits what is left at the end:

    score = ticks - (level at the end - reserve) / rate of the curve's first piece

Ties: fewer ticks from the task before to the charger, then the later position.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from automaton.strategy.kernels import CURVE_RATE, charging_ticks, level_after
from strategies.allocation.auction.charge_path import energy_to_charger, waiting_at
from strategies.allocation.auction.charge_plan import (
    add_detours,
    clear,
    fits,
    plan_charging,
    stop_at,
)
from strategies.allocation.auction.insertion import place_before
from strategies.allocation.auction.market import (
    BATTERY_FULL,
    INF_COST,
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
