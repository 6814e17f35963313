"""Where to charge: the shortest path over states (position i, charger c).

In state (i, c) the robot drives to charger c between tasks i - 1 and i of its list. The first stretch
must fit into what the robot has, each later one into a full battery. With a linear curve the charging
time depends on the energy of the whole way alone, so the path that minimises rate x ticks + energy is
exact with any number of stops. Ways are shortest ways: a detour never saves time or energy.

Ties: fewer ticks from the task before to the charger, then the later position.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.robot_states import BATTERY_FULL
from automaton.engine.state import NIL
from automaton.strategy.kernels import CURVE_RATE, charging_ticks, level_after
from strategies.allocation.auction.market import INF_COST, POLICY_THRESHOLD_REACHABLE, place_before


@kernel
def energy_to_charger(battery, place):
    """Units that must be left at the end of a list for the way to a charger; INF_COST: none is there."""
    if battery.end_reach == 0:
        return np.int64(0)
    return np.int64(battery.reach[battery.robot_type[0], place])


@kernel
def waiting_at(battery, scratch, c, ticks):
    """Ticks that a robot waits at charger c when it comes there `ticks` after setting out.

    Charging before that, which makes it come later, is not counted: the wait is never too short.
    """
    return max(np.int64(0), np.int64(battery.wait[c]) - scratch.path.ready[0] - ticks)


@kernel
def find_stops(costs, battery, scratch, place, charge, order, length):
    """The last stop, i * C + c, of the best way through chargers; NIL if there is none."""
    chargers = battery.charger.shape[0]
    path = scratch.path
    path.nodes[0] = 0
    path.last[0] = NIL
    path.best[0] = INF_COST
    path.ticks_to_stop[0] = INF_COST
    path.rest_ticks[0] = scratch.done_ticks[length]
    path.rest_energy[0] = scratch.done_energy[length]
    path.rest_energy[0] += energy_to_charger(battery, costs.end[order[length - 1]])
    for i in range(length):
        in_reach = scratch.done_energy[i] <= charge - battery.reserve[battery.robot_type[0]]
        if not in_reach and path.nodes[0] == 0:
            break
        scratch.count.states[0] += chargers
        reach_chargers(costs, battery, scratch, place, charge, order, i)
        nodes = path.nodes[0]
        relax_to_end(costs, battery, scratch, place, order, i)
        if (
            chargers > 1
            and path.nodes[0] > nodes
            and relax_charger_to_charger(costs, battery, scratch, i)
        ):
            path.nodes[0] = nodes
            relax_to_end(costs, battery, scratch, place, order, i)
    return path.last[0]


@kernel
def reach_chargers(costs, battery, scratch, place, charge, order, i):
    """weight[i], parent[i]: the best ways to the chargers before task i, from the start or a stop."""
    rate = np.int64(battery.curve[battery.robot_type[0], 0, CURVE_RATE])
    before = place_before(costs, place, order, i)
    for c in range(battery.charger.shape[0]):
        at = np.int64(battery.charger[c])
        into_energy = costs.energy[costs.robot_type[0], before, at] + scratch.done_energy[i]
        best = np.int64(INF_COST)
        if into_energy <= charge - battery.reserve[battery.robot_type[0]]:
            into_ticks = costs.ticks[costs.robot_type[0], before, at] + scratch.done_ticks[i]
            into_ticks += waiting_at(battery, scratch, c, into_ticks)
            best = rate * into_ticks + into_energy
        scratch.weight[i, c] = best
        scratch.parent[i, c] = NIL
        if scratch.path.nodes[0] > 0:
            relax_from_stops(costs, battery, scratch, before, order, i, c)


@kernel
def relax_from_stops(costs, battery, scratch, before, order, i, c):
    """Improve weight[i, c], parent[i, c] by ways from the stops that are noted."""
    chargers = battery.charger.shape[0]
    rate = np.int64(battery.curve[battery.robot_type[0], 0, CURVE_RATE])
    at = np.int64(battery.charger[c])
    into_ticks = costs.ticks[costs.robot_type[0], before, at] + scratch.done_ticks[i]
    into_ticks += waiting_at(battery, scratch, c, into_ticks)
    into_energy = costs.energy[costs.robot_type[0], before, at] + scratch.done_energy[i]
    best, parent = scratch.weight[i, c], np.int64(NIL)
    for node in range(scratch.path.nodes[0]):
        k, b = scratch.node[node] // chargers, scratch.node[node] % chargers
        if scratch.weight[k, b] >= best:
            continue
        stop = np.int64(battery.charger[b])
        after = np.int64(costs.begin[order[k]])
        energy = (
            costs.energy[costs.robot_type[0], stop, after] + into_energy - scratch.begun_energy[k]
        )
        if energy > BATTERY_FULL - battery.reserve[battery.robot_type[0]]:
            continue
        ticks = costs.ticks[costs.robot_type[0], stop, after] + into_ticks - scratch.begun_ticks[k]
        weight = scratch.weight[k, b] + rate * ticks + energy
        if weight <= best:
            best, parent = weight, np.int64(k * chargers + b)
    scratch.weight[i, c] = best
    scratch.parent[i, c] = parent


@kernel
def relax_to_end(costs, battery, scratch, place, order, i):
    """Drive on to the end from each charger before task i, or note it as one to go on from."""
    chargers = battery.charger.shape[0]
    rate = np.int64(battery.curve[battery.robot_type[0], 0, CURVE_RATE])
    path = scratch.path
    before = place_before(costs, place, order, i)
    after = np.int64(costs.begin[order[i]])
    rest_ticks = path.rest_ticks[0] - scratch.begun_ticks[i]
    rest_energy = path.rest_energy[0] - scratch.begun_energy[i]
    for c in range(chargers):
        so_far = scratch.weight[i, c]
        at = np.int64(battery.charger[c])
        energy = costs.energy[costs.robot_type[0], at, after] + rest_energy
        total = so_far + rate * (costs.ticks[costs.robot_type[0], at, after] + rest_ticks) + energy
        if so_far >= INF_COST or total > path.best[0]:
            continue  # what goes on from here is no better than the best that is known
        if energy > BATTERY_FULL - battery.reserve[battery.robot_type[0]]:
            scratch.node[path.nodes[0]] = i * chargers + c
            path.nodes[0] += 1
            continue
        # The end is in reach: another stop would only make the way longer.
        detour = np.int64(costs.ticks[costs.robot_type[0], before, at])
        later = detour == path.ticks_to_stop[0] and path.position[0] != i
        if total < path.best[0] or detour < path.ticks_to_stop[0] or later:
            path.best[0], path.ticks_to_stop[0], path.last[0] = (
                total,
                detour,
                i * chargers + c,
            )
            path.position[0] = i


@kernel
def relax_charger_to_charger(costs, battery, scratch, i):
    """Ways from one charger straight to another, where the way between tasks is long; found any?"""
    chargers = battery.charger.shape[0]
    rate = np.int64(battery.curve[battery.robot_type[0], 0, CURVE_RATE])
    found = False
    changed = True
    while changed:
        changed = False
        for b in range(chargers):
            if scratch.weight[i, b] >= INF_COST:
                continue
            for c in range(chargers):
                between = np.int64(
                    costs.energy[costs.robot_type[0], battery.charger[b], battery.charger[c]]
                )
                ticks = np.int64(
                    costs.ticks[costs.robot_type[0], battery.charger[b], battery.charger[c]]
                )
                ticks += waiting_at(battery, scratch, c, scratch.done_ticks[i] + ticks)
                weight = scratch.weight[i, b] + rate * ticks + between
                if (
                    c != b
                    and between <= BATTERY_FULL - battery.reserve[battery.robot_type[0]]
                    and weight < scratch.weight[i, c]
                ):
                    scratch.weight[i, c] = weight
                    scratch.parent[i, c] = i * chargers + b
                    changed = True
                    found = True
    return found


@kernel
def note_stops(battery, scratch, last):
    """Write the way to the last stop into the plan, in the order of driving."""
    chargers = battery.charger.shape[0]
    stops = 0
    node = np.int64(last)
    while node != NIL:
        stops += 1
        node = np.int64(scratch.parent[node // chargers, node % chargers])
    scratch.plan.stops[0] = stops
    node = np.int64(last)
    while node != NIL:
        stops -= 1
        scratch.plan.position[stops] = node // chargers
        scratch.plan.charger[stops] = node % chargers
        node = np.int64(scratch.parent[node // chargers, node % chargers])


# Optimal insertion of charging: the stops of a list, and how long the robot charges at each.
#
# A list is feasible without a stop if the level never falls below the reserve. Otherwise each stop of
# the best path charges as much as the stretch to the next one needs, in whole ticks.


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


# Threshold charging: go to the nearest charger when the level is low, and charge fully.
#
# POLICY_THRESHOLD before a task at whose end the level would be below the threshold
# POLICY_THRESHOLD_REACHABLE also before a task from whose end no charger could be reached
#
# The rule looks no farther ahead, so with LOOK a robot can come to less than nothing on its way to a
# charger; the plan then says so in its lowest level.


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
