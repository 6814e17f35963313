"""Threshold charging: go to the nearest charger when the level is low, and charge fully.

POLICY_THRESHOLD            before a task at whose end the level would be below the threshold
POLICY_THRESHOLD_REACHABLE     also before a task from whose end no charger could be reached

The rule looks no farther ahead, so with LOOK a robot can come to less than nothing on its way to a
charger; the plan then says so in its lowest level.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.charge_path import waiting_at
from strategies.allocation.auction.charge_plan import add_detours, clear, stop_at
from strategies.allocation.auction.insertion import place_before
from strategies.allocation.auction.market import (
    BATTERY_FULL,
    INF_COST,
    POLICY_THRESHOLD_REACHABLE,
)


@kernel
def plan_threshold(costs, battery, scratch, place, charge, order, length):
    """Leave the stops of the rule in scratch.plan; returns the ticks of the measured list.

    INF_COST where the rule asks for a charger and none is there. A level below 0 is for the caller to
    judge (scratch.plan.lowest_charge[0]).
    """
    clear(scratch, charge, length)
    plan = scratch.plan
    plan.lowest_charge[0] = charge
    level = np.int64(charge)
    scratch.count.states[0] += length
    for i in range(length):
        task = np.int64(order[i])
        here = place_before(costs, place, order, i)
        then = (
            level
            - costs.energy[costs.robot_type[0], here, costs.begin[task]]
            - costs.use[costs.robot_type[0], task]
        )
        if is_low(battery, then, np.int64(costs.end[task])):
            charger = np.int64(battery.nearest[battery.robot_type[0], here])
            if charger == NIL:
                plan.cost[0] = INF_COST
                return INF_COST
            k = plan.stops[0]
            at = np.int64(battery.charger[charger])
            plan.stops[0] = k + 1
            plan.position[k] = i
            plan.charger[k] = charger
            done = plan.cost[0] - scratch.done_ticks[length] + scratch.done_ticks[i]
            wait = waiting_at(
                battery, scratch, charger, done + costs.ticks[costs.robot_type[0], here, at]
            )
            arrival = level - costs.energy[costs.robot_type[0], here, at]
            level = stop_at(battery, plan, k, arrival, np.int64(BATTERY_FULL), wait)
            plan.cost[0] += (
                costs.ticks[costs.robot_type[0], here, at]
                + costs.ticks[costs.robot_type[0], at, costs.begin[task]]
            )
            plan.cost[0] -= costs.ticks[costs.robot_type[0], here, costs.begin[task]]
            here = at
        level -= (
            costs.energy[costs.robot_type[0], here, costs.begin[task]]
            + costs.use[costs.robot_type[0], task]
        )
        plan.lowest_charge[0] = min(plan.lowest_charge[0], level)
    plan.end_charge[0] = level
    if plan.stops[0] > 0:
        scratch.count.plans[0] += 1
    add_detours(costs, battery, scratch, place, order)
    return plan.cost[0]


@kernel
def is_low(battery, level, place):
    """Whether a robot that would be at this place with this level charges first."""
    if level < battery.threshold:
        return True
    return (
        battery.policy == POLICY_THRESHOLD_REACHABLE
        and level < battery.reach[battery.robot_type[0], place]
    )
