"""One charging stop, found by trying every position and charger: for tapering curves and fill-up.

With a taper the time to charge depends on the level at which it begins, so each candidate's time is
read off the curve. Fill-up charges to the target and credits what is left at the end:

    score = ticks - (level at the end - reserve) / rate of the curve's first piece

Ties: fewer ticks from the task before to the charger, then the later position.
"""

import numpy as np

from automaton.auctions.charge_path import tail_of, waiting_at
from automaton.auctions.charge_plan import (
    add_detours,
    clear,
    fits,
    plan_charging,
    stop_at,
)
from automaton.auctions.insertion import place_before
from automaton.auctions.market import BATTERY_FULL, COST, END, INF, LOWEST, PLANS, STATES
from automaton.compiled import kernel
from automaton.strategy.kernels import CURVE_RATE, charging_ticks, level_after
from automaton.world.state import NIL


@kernel
def plan_single_stop(work, battery, scratch, place, charge, order, length, fill):
    """Leave the best plan with at most one stop in scratch.plan; several stops where one cannot do.

    fill: 1 = fill up to battery.target. Returns the ticks of the list, or INF.
    """
    clear(scratch, charge, length)
    if length == 0 or fits(
        battery, charge, scratch.done_energy[length], np.int64(work.end[order[length - 1]])
    ):
        return scratch.plan.figures[COST]
    position, charger = find_stop(work, battery, scratch, place, charge, order, length, fill)
    if position == NIL:
        return plan_charging(work, battery, scratch, place, charge, order, length)
    scratch.count[PLANS] += 1
    plan = scratch.plan
    plan.stops[0] = 1
    plan.position[0] = position
    plan.charger[0] = charger
    at = np.int64(battery.charger[charger])
    before = place_before(work, place, order, position)
    after = np.int64(work.begin[order[position]])
    arrival = charge - scratch.done_energy[position] - work.energy[work.robot_type[0], before, at]
    rest = (
        work.energy[work.robot_type[0], at, after]
        + scratch.done_energy[length]
        - scratch.begun_energy[position]
    )
    tail = tail_of(battery, work.end[order[length - 1]])
    plan.figures[COST] += (
        work.ticks[work.robot_type[0], before, at] + work.ticks[work.robot_type[0], at, after]
    )
    plan.figures[COST] -= work.ticks[work.robot_type[0], before, after]
    wait = waiting_at(
        battery,
        scratch,
        charger,
        scratch.done_ticks[position] + work.ticks[work.robot_type[0], before, at],
    )
    goal = goal_of(battery, arrival, rest + tail, fill)
    level = stop_at(battery, plan, 0, arrival, goal, wait)
    plan.figures[END] = level - rest
    plan.figures[LOWEST] = min(arrival, level - rest)
    add_detours(work, battery, scratch, place, order)
    return plan.figures[COST]


@kernel
def goal_of(battery, arrival, rest, fill):
    """The level to charge to: what the rest needs, and when filling up at least the target."""
    goal = max(np.int64(arrival), rest + battery.reserve)
    return max(goal, np.int64(battery.target)) if fill == 1 else goal


@kernel
def find_stop(work, battery, scratch, place, charge, order, length, fill):
    """(position, charger) of the best single stop, or (NIL, NIL)."""
    tail = tail_of(battery, work.end[order[length - 1]])
    rate = np.int64(battery.curve[0, CURVE_RATE])
    best, nearest = np.int64(INF), np.int64(INF)
    position, charger = np.int64(NIL), np.int64(NIL)
    if tail >= INF:
        return position, charger
    for i in range(length):
        before = place_before(work, place, order, i)
        after = np.int64(work.begin[order[i]])
        scratch.count[STATES] += battery.charger.shape[0]
        for c in range(battery.charger.shape[0]):
            at = np.int64(battery.charger[c])
            into = np.int64(work.ticks[work.robot_type[0], before, at])
            arrival = charge - scratch.done_energy[i] - work.energy[work.robot_type[0], before, at]
            rest = (
                work.energy[work.robot_type[0], at, after]
                + scratch.done_energy[length]
                - scratch.begun_energy[i]
            )
            if arrival < battery.reserve or rest + tail + battery.reserve > BATTERY_FULL:
                continue
            goal = goal_of(battery, arrival, rest + tail, fill)
            duration = charging_ticks(battery.curve, arrival, goal)
            ticks = scratch.done_ticks[length] + into + work.ticks[work.robot_type[0], at, after]
            ticks += duration - work.ticks[work.robot_type[0], before, after]
            ticks += waiting_at(battery, scratch, np.int64(c), scratch.done_ticks[i] + into)
            score = rate * ticks
            if fill == 1:
                score -= (
                    level_after(battery.curve, arrival, duration, BATTERY_FULL)
                    - rest
                    - battery.reserve
                )
            later = into == nearest and i > position
            if score < best or (score == best and (into < nearest or later)):
                best, nearest, position, charger = score, into, np.int64(i), np.int64(c)
    return position, charger
