"""Optimal insertion of charging: the stops of a list, and how long the robot charges at each.

A list is feasible without a stop if the level never falls below the reserve. Otherwise each stop of
the best path charges as much as the stretch to the next one needs, in whole ticks.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from automaton.strategy.kernels import charging_ticks, level_after
from strategies.allocation.auction.charge_path import (
    energy_to_charger,
    find_stops,
    note_stops,
    waiting_at,
)
from strategies.allocation.auction.insertion import place_before
from strategies.allocation.auction.market import (
    BATTERY_FULL,
    INF_COST,
)


@kernel
def fits(battery, charge, energy, last):
    """Whether a list that takes `energy` and ends at place `last` needs no charging."""
    tail = energy_to_charger(battery, last)
    return tail < INF_COST and charge - energy - tail >= battery.reserve[battery.robot_type[0]]


@kernel
def clear(scratch, charge, length):
    """A plan without stops, of the list that was measured last."""
    plan = scratch.plan
    plan.stops[0] = 0
    plan.charging[0] = 0
    plan.charger_wait[0] = 0
    plan.gross[0] = 0
    plan.net[0] = 0
    plan.cost[0] = scratch.done_ticks[length]
    plan.end_charge[0] = charge - scratch.done_energy[length]
    plan.lowest_charge[0] = plan.end_charge[0]


@kernel
def plan_charging(costs, battery, scratch, place, charge, order, length):
    """Leave the cheapest plan for the measured list in scratch.plan; returns its ticks or INF_COST."""
    clear(scratch, charge, length)
    if length == 0 or fits(
        battery, charge, scratch.done_energy[length], np.int64(costs.end[order[length - 1]])
    ):
        return scratch.plan.cost[0]
    scratch.count.plans[0] += 1
    last = np.int64(NIL)
    if energy_to_charger(battery, costs.end[order[length - 1]]) < INF_COST:
        last = find_stops(costs, battery, scratch, place, charge, order, length)
    if last == NIL:
        scratch.plan.cost[0] = INF_COST
        return INF_COST
    note_stops(battery, scratch, last)
    return charge_just_enough(costs, battery, scratch, place, charge, order, length)


@kernel
def stretch(costs, battery, scratch, place, order, length, k):
    """(ticks, units) from stop k - 1 of the plan (the start for 0) to stop k, or to the end."""
    plan = scratch.plan
    to = plan.position[k] if k < plan.stops[0] else length
    ticks, energy = scratch.done_ticks[to], scratch.done_energy[to]
    here = np.int64(place) if to == 0 else np.int64(costs.end[order[to - 1]])
    if k > 0:
        begun = plan.position[k - 1]
        here_before = np.int64(battery.charger[plan.charger[k - 1]])
        if begun == to:
            ticks, energy, here = np.int64(0), np.int64(0), here_before
        else:
            after = np.int64(costs.begin[order[begun]])
            ticks += (
                costs.ticks[costs.robot_type[0], here_before, after] - scratch.begun_ticks[begun]
            )
            energy += (
                costs.energy[costs.robot_type[0], here_before, after] - scratch.begun_energy[begun]
            )
    if k < plan.stops[0]:
        at = np.int64(battery.charger[plan.charger[k]])
        ticks += costs.ticks[costs.robot_type[0], here, at]
        energy += costs.energy[costs.robot_type[0], here, at]
    return ticks, energy


@kernel
def charge_just_enough(costs, battery, scratch, place, charge, order, length):
    """At each stop of the plan, charge what the next stretch needs; returns the ticks of the list."""
    plan = scratch.plan
    tail = energy_to_charger(battery, costs.end[order[length - 1]])
    ticks, energy = stretch(costs, battery, scratch, place, order, length, 0)
    level = np.int64(charge)
    plan.cost[0] = ticks
    plan.lowest_charge[0] = BATTERY_FULL
    for k in range(plan.stops[0]):
        level -= energy
        ticks, energy = stretch(costs, battery, scratch, place, order, length, k + 1)
        spare = tail if k + 1 == plan.stops[0] else np.int64(0)
        goal = max(level, energy + spare + battery.reserve[battery.robot_type[0]])
        wait = waiting_at(battery, scratch, np.int64(plan.charger[k]), plan.cost[0])
        level = stop_at(battery, plan, k, level, goal, wait)
        plan.cost[0] += ticks
    plan.end_charge[0] = level - energy
    plan.lowest_charge[0] = min(plan.lowest_charge[0], plan.end_charge[0])
    add_detours(costs, battery, scratch, place, order)
    return plan.cost[0]


@kernel
def stop_at(battery, plan, k, level, goal, wait):
    """Charge from `level` to `goal` at stop k of the plan, after a wait; returns the level then."""
    duration = charging_ticks(battery.curve[battery.robot_type[0]], level, goal)
    plan.waited[k] = wait
    plan.arrival[k] = level
    plan.duration[k] = duration
    plan.level[k] = level_after(battery.curve[battery.robot_type[0]], level, duration, BATTERY_FULL)
    plan.lowest_charge[0] = min(plan.lowest_charge[0], level)
    plan.charging[0] += duration
    plan.charger_wait[0] += wait
    plan.cost[0] += duration + wait
    return plan.level[k]


@kernel
def add_detours(costs, battery, scratch, place, order):
    """Gross: to the charger, charging, and on; net: less the leg that this replaces."""
    plan = scratch.plan
    for k in range(plan.stops[0]):
        i = plan.position[k]
        at = np.int64(battery.charger[plan.charger[k]])
        before = place_before(costs, place, order, i)
        after = np.int64(costs.begin[order[i]])
        if k > 0 and plan.position[k - 1] == i:
            before = np.int64(battery.charger[plan.charger[k - 1]])
        else:
            plan.net[0] -= costs.ticks[costs.robot_type[0], before, after]
        gross = plan.duration[k] + plan.waited[k] + costs.ticks[costs.robot_type[0], before, at]
        if k + 1 == plan.stops[0] or plan.position[k + 1] != i:
            gross += costs.ticks[costs.robot_type[0], at, after]
        plan.gross[0] += gross
        plan.net[0] += gross
