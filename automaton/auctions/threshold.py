"""Threshold charging: go to the nearest charger when the level is low, and charge fully.

LOOK     before a task at whose end the level would be below the threshold
SAFE     also before a task from whose end no charger could be reached

The rule looks no farther ahead, so with LOOK a robot can come to less than nothing on its way to a
charger; the plan then says so in its lowest level.
"""

import numpy as np

from automaton.auctions.charge_path import waiting_at
from automaton.auctions.charge_plan import add_detours, clear, stop_at
from automaton.auctions.insertion import place_before
from automaton.auctions.market import BATTERY_FULL, COST, END, INF, LOWEST, PLANS, SAFE, STATES
from automaton.compiled import kernel
from automaton.world.state import NIL


@kernel
def plan_threshold(work, battery, scratch, place, charge, order, length):
    """Leave the stops of the rule in scratch.plan; returns the ticks of the measured list.

    INF where the rule asks for a charger and none is there. A level below 0 is for the caller to
    judge (scratch.plan.figures[LOWEST]).
    """
    clear(scratch, charge, length)
    plan = scratch.plan
    plan.figures[LOWEST] = charge
    level = np.int64(charge)
    scratch.count[STATES] += length
    for i in range(length):
        task = np.int64(order[i])
        here = place_before(work, place, order, i)
        then = (
            level
            - work.energy[work.robot_type[0], here, work.begin[task]]
            - work.use[work.robot_type[0], task]
        )
        if is_low(battery, then, np.int64(work.end[task])):
            charger = np.int64(battery.nearest[battery.robot_type[0], here])
            if charger == NIL:
                plan.figures[COST] = INF
                return INF
            k = plan.stops[0]
            at = np.int64(battery.charger[charger])
            plan.stops[0] = k + 1
            plan.position[k] = i
            plan.charger[k] = charger
            done = plan.figures[COST] - scratch.done_ticks[length] + scratch.done_ticks[i]
            wait = waiting_at(
                battery, scratch, charger, done + work.ticks[work.robot_type[0], here, at]
            )
            arrival = level - work.energy[work.robot_type[0], here, at]
            level = stop_at(battery, plan, k, arrival, np.int64(BATTERY_FULL), wait)
            plan.figures[COST] += (
                work.ticks[work.robot_type[0], here, at]
                + work.ticks[work.robot_type[0], at, work.begin[task]]
            )
            plan.figures[COST] -= work.ticks[work.robot_type[0], here, work.begin[task]]
            here = at
        level -= (
            work.energy[work.robot_type[0], here, work.begin[task]]
            + work.use[work.robot_type[0], task]
        )
        plan.figures[LOWEST] = min(plan.figures[LOWEST], level)
    plan.figures[END] = level
    if plan.stops[0] > 0:
        scratch.count[PLANS] += 1
    add_detours(work, battery, scratch, place, order)
    return plan.figures[COST]


@kernel
def is_low(battery, level, place):
    """Whether a robot that would be at this place with this level charges first."""
    if level < battery.threshold:
        return True
    return battery.policy == SAFE and level < battery.reach[battery.robot_type[0], place]
