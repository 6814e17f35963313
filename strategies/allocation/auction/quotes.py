"""Quotes: the cost of a list with its charging stops, on which bids are based.

A list is feasible without a stop if the level never falls below the reserve. Otherwise the policy
decides where the robot charges. All paths are shortest paths, so a detour never saves time or energy.
"""

import numpy as np

from automaton.strategy.api import (
    BATTERY_FULL,
    CURVE_RATE,
    NIL,
    charging_ticks,
    kernel,
    level_after,
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
def quote(costs, battery, scratch, place, ready, charge, order, length):
    """Ticks until order[:length] is done, including charging, or INF_COST; scratch.plan is the plan.

    The robot is at `place` in `ready` ticks, then with `charge` units.
    """
    measure(costs, scratch, place, order, length)
    scratch.path.ready = ready
    policy = battery.policy
    if policy == POLICY_NO_CHARGING:
        clear(scratch, charge, length)
        return ready + scratch.done_ticks[length]
    if policy == POLICY_THRESHOLD or policy == POLICY_THRESHOLD_REACHABLE:
        cost = plan_threshold(costs, battery, scratch, place, charge, order, length)
        if scratch.plan.lowest_charge < 0:
            cost = np.int64(INF_COST)
    elif policy == POLICY_FILL_UP:
        cost = plan_single_stop(costs, battery, scratch, place, charge, order, length, 1)
    elif battery.curve.shape[1] > 1:
        cost = plan_single_stop(costs, battery, scratch, place, charge, order, length, 0)
    else:
        cost = plan_charging(costs, battery, scratch, place, charge, order, length)
    return np.int64(INF_COST) if cost >= INF_COST else ready + cost


@kernel
def select_robot_type(costs, battery, robot_type):
    """Select the robot type for ticks and energy."""
    costs.robot_type = robot_type
    battery.robot_type = robot_type


@kernel
def quote_list(costs, battery, fleet, scratch, r, order, length):
    """The quote of robot r for order[:length]."""
    select_robot_type(costs, battery, fleet.robot_type[r])
    place, ready = np.int64(fleet.place[r]), np.int64(fleet.ready[r])
    charge = np.int64(fleet.charge[r])
    return quote(costs, battery, scratch, place, ready, charge, order, length)


@kernel
def settle(costs, battery, fleet, scratch, r):
    """Set travel, energy and cost of robot r from its list."""
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
    """(position, ticks) of robot r's list with the task inserted; (NIL, INF_COST) if infeasible.

    The robot's own list must be settled.
    """
    length = np.int64(fleet.length[r])
    if length >= fleet.capacity[r] or fleet.cost[r] >= INF_COST:
        return np.int64(NIL), np.int64(INF_COST)
    select_robot_type(costs, battery, fleet.robot_type[r])
    order = fleet.order[r]
    first = min(np.int64(fleet.first[r]), length)
    place = np.int64(fleet.place[r])
    scratch.count.positions += length + 1 - first
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
    """The cheapest position including charging; ties: the latest."""
    length = np.int64(fleet.length[r])
    best, least = np.int64(NIL), np.int64(INF_COST)
    for position in range(first, length + 1):
        copy_inserted(fleet.order[r], length, task, position, scratch.order)
        cost = quote_list(costs, battery, fleet, scratch, r, scratch.order, length + 1)
        if cost < INF_COST and cost <= least:
            best, least = np.int64(position), cost
    return best, least


@kernel
def clear_counts(scratch):
    """Reset the counters of effort."""
    count = scratch.count
    count.bids = 0
    count.positions = 0
    count.plans = 0
    count.messages = 0
    count.states = 0


@kernel
def fits(battery, charge, energy, last):
    """Whether a list that takes `energy` and ends at place `last` needs no charging."""
    tail = energy_to_charger(battery, last)
    return tail < INF_COST and charge - energy - tail >= battery.reserve[battery.robot_type]


@kernel
def energy_to_charger(battery, place):
    """Units that must remain at the end of a list to reach a charger; INF_COST: no charger in reach."""
    if battery.end_reach == 0:
        return np.int64(0)
    return np.int64(battery.reach[battery.robot_type, place])


@kernel
def waiting_at(battery, scratch, c, ticks):
    """Ticks that a robot waits at charger c if it arrives `ticks` after its departure.

    Earlier charging, which delays the arrival, is ignored, so the wait is never underestimated.
    """
    return max(np.int64(0), np.int64(battery.wait[c]) - scratch.path.ready - ticks)


@kernel
def clear(scratch, charge, length):
    """A plan without stops for the last measured list."""
    plan = scratch.plan
    plan.stops = 0
    plan.charging = 0
    plan.charger_wait = 0
    plan.gross = 0
    plan.net = 0
    plan.cost = scratch.done_ticks[length]
    plan.end_charge = charge - scratch.done_energy[length]
    plan.lowest_charge = plan.end_charge


@kernel
def stop_at(battery, plan, k, level, goal, wait):
    """Charge from `level` to `goal` at stop k of the plan, after a wait; return the new level."""
    duration = charging_ticks(battery.curve[battery.robot_type], level, goal)
    plan.waited[k] = wait
    plan.arrival[k] = level
    plan.duration[k] = duration
    plan.level[k] = level_after(battery.curve[battery.robot_type], level, duration, BATTERY_FULL)
    plan.lowest_charge = min(plan.lowest_charge, level)
    plan.charging += duration
    plan.charger_wait += wait
    plan.cost += duration + wait
    return plan.level[k]


@kernel
def add_detours(costs, battery, scratch, place, order):
    """Add the ticks of a stop: gross, to the charger, charging, and on; net, minus the replaced leg."""
    plan = scratch.plan
    for k in range(plan.stops):
        i = plan.position[k]
        at = np.int64(battery.charger[plan.charger[k]])
        before = place_before(costs, place, order, i)
        after = np.int64(costs.begin[order[i]])
        if k > 0 and plan.position[k - 1] == i:
            before = np.int64(battery.charger[plan.charger[k - 1]])
        else:
            plan.net -= costs.ticks[costs.robot_type, before, after]
        gross = plan.duration[k] + plan.waited[k] + costs.ticks[costs.robot_type, before, at]
        if k + 1 == plan.stops or plan.position[k + 1] != i:
            gross += costs.ticks[costs.robot_type, at, after]
        plan.gross += gross
        plan.net += gross


# Optimal insertion of charging: the shortest path over states (position i, charger c).
#
# In state (i, c) the robot drives to charger c between tasks i - 1 and i of its list. The first
# stretch must fit the robot's charge, each later one a full battery. With a linear curve the charging
# time depends only on the energy of the whole path, so the path that minimizes rate x ticks + energy is
# exact with any number of stops. Each stop then charges what the stretch to the next stop needs, in
# whole ticks.
#
# Ties: fewer ticks from the previous task to the charger, then the later position.


@kernel
def plan_charging(costs, battery, scratch, place, charge, order, length):
    """Leave the cheapest plan for the measured list in scratch.plan; return its ticks or INF_COST."""
    clear(scratch, charge, length)
    if length == 0 or fits(
        battery, charge, scratch.done_energy[length], np.int64(costs.end[order[length - 1]])
    ):
        return scratch.plan.cost
    scratch.count.plans += 1
    last = np.int64(NIL)
    if energy_to_charger(battery, costs.end[order[length - 1]]) < INF_COST:
        last = find_stops(costs, battery, scratch, place, charge, order, length)
    if last == NIL:
        scratch.plan.cost = INF_COST
        return INF_COST
    note_stops(battery, scratch, last)
    return charge_just_enough(costs, battery, scratch, place, charge, order, length)


@kernel
def find_stops(costs, battery, scratch, place, charge, order, length):
    """The last stop, i * C + c, of the best path through chargers, or NIL."""
    chargers = battery.charger.shape[0]
    path = scratch.path
    path.nodes = 0
    path.last = NIL
    path.best = INF_COST
    path.ticks_to_stop = INF_COST
    path.rest_ticks = scratch.done_ticks[length]
    path.rest_energy = scratch.done_energy[length]
    path.rest_energy += energy_to_charger(battery, costs.end[order[length - 1]])
    for i in range(length):
        in_reach = scratch.done_energy[i] <= charge - battery.reserve[battery.robot_type]
        if not in_reach and path.nodes == 0:
            break
        scratch.count.states += chargers
        reach_chargers(costs, battery, scratch, place, charge, order, i)
        nodes = path.nodes
        relax_to_end(costs, battery, scratch, place, order, i)
        goes_on = chargers > 1 and path.nodes > nodes
        if goes_on and relax_charger_to_charger(costs, battery, scratch, i):
            path.nodes = nodes
            relax_to_end(costs, battery, scratch, place, order, i)
    return path.last


@kernel
def reach_chargers(costs, battery, scratch, place, charge, order, i):
    """weight[i], parent[i]: the best paths to the chargers before task i, from the start or a stop."""
    rate = np.int64(battery.curve[battery.robot_type, 0, CURVE_RATE])
    before = place_before(costs, place, order, i)
    for c in range(battery.charger.shape[0]):
        at = np.int64(battery.charger[c])
        into_energy = costs.energy[costs.robot_type, before, at] + scratch.done_energy[i]
        best = np.int64(INF_COST)
        if into_energy <= charge - battery.reserve[battery.robot_type]:
            into_ticks = costs.ticks[costs.robot_type, before, at] + scratch.done_ticks[i]
            into_ticks += waiting_at(battery, scratch, c, into_ticks)
            best = rate * into_ticks + into_energy
        scratch.weight[i, c] = best
        scratch.parent[i, c] = NIL
        if scratch.path.nodes > 0:
            relax_from_stops(costs, battery, scratch, before, order, i, c)


@kernel
def relax_from_stops(costs, battery, scratch, before, order, i, c):
    """Improve weight[i, c], parent[i, c] by paths from the listed stops."""
    chargers = battery.charger.shape[0]
    rate = np.int64(battery.curve[battery.robot_type, 0, CURVE_RATE])
    at = np.int64(battery.charger[c])
    ticks_to, energy_to = costs.ticks[costs.robot_type], costs.energy[costs.robot_type]
    into_ticks = ticks_to[before, at] + scratch.done_ticks[i]
    into_ticks += waiting_at(battery, scratch, c, into_ticks)
    into_energy = energy_to[before, at] + scratch.done_energy[i]
    best, parent = scratch.weight[i, c], np.int64(NIL)
    for node in range(scratch.path.nodes):
        k, b = scratch.node[node] // chargers, scratch.node[node] % chargers
        if scratch.weight[k, b] >= best:
            continue
        stop = np.int64(battery.charger[b])
        after = np.int64(costs.begin[order[k]])
        energy = energy_to[stop, after] + into_energy - scratch.begun_energy[k]
        if energy > BATTERY_FULL - battery.reserve[battery.robot_type]:
            continue
        ticks = ticks_to[stop, after] + into_ticks - scratch.begun_ticks[k]
        weight = scratch.weight[k, b] + rate * ticks + energy
        if weight <= best:
            best, parent = weight, np.int64(k * chargers + b)
    scratch.weight[i, c] = best
    scratch.parent[i, c] = parent


@kernel
def relax_to_end(costs, battery, scratch, place, order, i):
    """Complete the list from each charger before task i, or store the charger as a stop."""
    chargers = battery.charger.shape[0]
    rate = np.int64(battery.curve[battery.robot_type, 0, CURVE_RATE])
    path = scratch.path
    before = place_before(costs, place, order, i)
    after = np.int64(costs.begin[order[i]])
    rest_ticks = path.rest_ticks - scratch.begun_ticks[i]
    rest_energy = path.rest_energy - scratch.begun_energy[i]
    for c in range(chargers):
        so_far = scratch.weight[i, c]
        at = np.int64(battery.charger[c])
        energy = costs.energy[costs.robot_type, at, after] + rest_energy
        total = so_far + rate * (costs.ticks[costs.robot_type, at, after] + rest_ticks) + energy
        if so_far >= INF_COST or total > path.best:
            continue  # no path from here improves the best known one
        if energy > BATTERY_FULL - battery.reserve[battery.robot_type]:
            scratch.node[path.nodes] = i * chargers + c
            path.nodes += 1
            continue
        # The end is in reach: another stop would only lengthen the path.
        detour = np.int64(costs.ticks[costs.robot_type, before, at])
        later = detour == path.ticks_to_stop and path.position != i
        if total < path.best or detour < path.ticks_to_stop or later:
            path.best, path.ticks_to_stop = total, detour
            path.last = i * chargers + c
            path.position = i


@kernel
def relax_charger_to_charger(costs, battery, scratch, i):
    """Add paths directly between chargers, for long paths between tasks; return whether any was found."""
    chargers = battery.charger.shape[0]
    rate = np.int64(battery.curve[battery.robot_type, 0, CURVE_RATE])
    most = BATTERY_FULL - battery.reserve[battery.robot_type]
    found = False
    changed = True
    while changed:
        changed = False
        for b in range(chargers):
            if scratch.weight[i, b] >= INF_COST:
                continue
            for c in range(chargers):
                here, there = battery.charger[b], battery.charger[c]
                between = np.int64(costs.energy[costs.robot_type, here, there])
                ticks = np.int64(costs.ticks[costs.robot_type, here, there])
                ticks += waiting_at(battery, scratch, c, scratch.done_ticks[i] + ticks)
                weight = scratch.weight[i, b] + rate * ticks + between
                if c != b and between <= most and weight < scratch.weight[i, c]:
                    scratch.weight[i, c] = weight
                    scratch.parent[i, c] = i * chargers + b
                    changed = True
                    found = True
    return found


@kernel
def note_stops(battery, scratch, last):
    """Write the stops of the path to the last stop to the plan, in driving order."""
    chargers = battery.charger.shape[0]
    stops = 0
    node = np.int64(last)
    while node != NIL:
        stops += 1
        node = np.int64(scratch.parent[node // chargers, node % chargers])
    scratch.plan.stops = stops
    node = np.int64(last)
    while node != NIL:
        stops -= 1
        scratch.plan.position[stops] = node // chargers
        scratch.plan.charger[stops] = node % chargers
        node = np.int64(scratch.parent[node // chargers, node % chargers])


@kernel
def charge_just_enough(costs, battery, scratch, place, charge, order, length):
    """At each stop of the plan, charge what the next stretch needs; return the ticks of the list."""
    plan = scratch.plan
    tail = energy_to_charger(battery, costs.end[order[length - 1]])
    ticks, energy = stretch(costs, battery, scratch, place, order, length, 0)
    level = np.int64(charge)
    plan.cost = ticks
    plan.lowest_charge = BATTERY_FULL
    for k in range(plan.stops):
        level -= energy
        ticks, energy = stretch(costs, battery, scratch, place, order, length, k + 1)
        spare = tail if k + 1 == plan.stops else np.int64(0)
        goal = max(level, energy + spare + battery.reserve[battery.robot_type])
        wait = waiting_at(battery, scratch, np.int64(plan.charger[k]), plan.cost)
        level = stop_at(battery, plan, k, level, goal, wait)
        plan.cost += ticks
    plan.end_charge = level - energy
    plan.lowest_charge = min(plan.lowest_charge, plan.end_charge)
    add_detours(costs, battery, scratch, place, order)
    return plan.cost


@kernel
def stretch(costs, battery, scratch, place, order, length, k):
    """(ticks, units) from stop k - 1 of the plan (the start for 0) to stop k, or to the end."""
    plan = scratch.plan
    ticks_to, energy_to = costs.ticks[costs.robot_type], costs.energy[costs.robot_type]
    to = plan.position[k] if k < plan.stops else length
    ticks, energy = scratch.done_ticks[to], scratch.done_energy[to]
    here = np.int64(place) if to == 0 else np.int64(costs.end[order[to - 1]])
    if k > 0:
        begun = plan.position[k - 1]
        here_before = np.int64(battery.charger[plan.charger[k - 1]])
        if begun == to:
            ticks, energy, here = np.int64(0), np.int64(0), here_before
        else:
            after = np.int64(costs.begin[order[begun]])
            ticks += ticks_to[here_before, after] - scratch.begun_ticks[begun]
            energy += energy_to[here_before, after] - scratch.begun_energy[begun]
    if k < plan.stops:
        at = np.int64(battery.charger[plan.charger[k]])
        ticks += ticks_to[here, at]
        energy += energy_to[here, at]
    return ticks, energy


# A single charging stop, by trying all positions and chargers: for tapering curves and fill-up.
#
# With a taper the charging time depends on the initial level, so each candidate's time is computed from
# the curve. Fill-up charges to the target and credits the charge left at the end:
#
#     score = ticks - (level at the end - reserve) / rate of the curve's first piece
#
# Ties as above.


@kernel
def plan_single_stop(costs, battery, scratch, place, charge, order, length, fill):
    """Leave the best plan with at most one stop in scratch.plan; several stops if one is not enough.

    fill: 1 = fill up to battery.target. Returns the ticks of the list, or INF_COST.
    """
    clear(scratch, charge, length)
    if length == 0 or fits(
        battery, charge, scratch.done_energy[length], np.int64(costs.end[order[length - 1]])
    ):
        return scratch.plan.cost
    position, charger = find_stop(costs, battery, scratch, place, charge, order, length, fill)
    if position == NIL:
        return plan_charging(costs, battery, scratch, place, charge, order, length)
    scratch.count.plans += 1
    plan = scratch.plan
    ticks, energy = costs.ticks[costs.robot_type], costs.energy[costs.robot_type]
    plan.stops = 1
    plan.position[0] = position
    plan.charger[0] = charger
    at = np.int64(battery.charger[charger])
    before = place_before(costs, place, order, position)
    after = np.int64(costs.begin[order[position]])
    arrival = charge - scratch.done_energy[position] - energy[before, at]
    rest = energy[at, after] + scratch.done_energy[length] - scratch.begun_energy[position]
    tail = energy_to_charger(battery, costs.end[order[length - 1]])
    plan.cost += ticks[before, at] + ticks[at, after]
    plan.cost -= ticks[before, after]
    then = scratch.done_ticks[position] + ticks[before, at]
    wait = waiting_at(battery, scratch, charger, then)
    goal = goal_of(battery, arrival, rest + tail, fill)
    level = stop_at(battery, plan, 0, arrival, goal, wait)
    plan.end_charge = level - rest
    plan.lowest_charge = min(arrival, level - rest)
    add_detours(costs, battery, scratch, place, order)
    return plan.cost


@kernel
def goal_of(battery, arrival, rest, fill):
    """The target level of charging: the need of the rest; for fill-up, at least the target."""
    goal = max(np.int64(arrival), rest + battery.reserve[battery.robot_type])
    return max(goal, np.int64(battery.target)) if fill == 1 else goal


@kernel
def find_stop(costs, battery, scratch, place, charge, order, length, fill):
    """(position, charger) of the best single stop, or (NIL, NIL)."""
    tail = energy_to_charger(battery, costs.end[order[length - 1]])
    reserve = np.int64(battery.reserve[battery.robot_type])
    curve = battery.curve[battery.robot_type]
    rate = np.int64(curve[0, CURVE_RATE])
    best, nearest = np.int64(INF_COST), np.int64(INF_COST)
    position, charger = np.int64(NIL), np.int64(NIL)
    if tail >= INF_COST:
        return position, charger
    ticks_to, energy_to = costs.ticks[costs.robot_type], costs.energy[costs.robot_type]
    for i in range(length):
        before = place_before(costs, place, order, i)
        after = np.int64(costs.begin[order[i]])
        scratch.count.states += battery.charger.shape[0]
        for c in range(battery.charger.shape[0]):
            at = np.int64(battery.charger[c])
            into = np.int64(ticks_to[before, at])
            arrival = charge - scratch.done_energy[i] - energy_to[before, at]
            rest = energy_to[at, after] + scratch.done_energy[length] - scratch.begun_energy[i]
            if arrival < reserve or rest + tail + reserve > BATTERY_FULL:
                continue
            goal = goal_of(battery, arrival, rest + tail, fill)
            duration = charging_ticks(curve, arrival, goal)
            ticks = scratch.done_ticks[length] + into + ticks_to[at, after]
            ticks += duration - ticks_to[before, after]
            ticks += waiting_at(battery, scratch, np.int64(c), scratch.done_ticks[i] + into)
            score = rate * ticks
            if fill == 1:
                score -= level_after(curve, arrival, duration, BATTERY_FULL) - rest - reserve
            later = into == nearest and i > position
            if score < best or (score == best and (into < nearest or later)):
                best, nearest, position, charger = score, into, np.int64(i), np.int64(c)
    return position, charger


# Threshold charging: go to the nearest charger when the level is low, and charge fully.
#
#     POLICY_THRESHOLD            before a task at whose end the level would be below the threshold
#     POLICY_THRESHOLD_REACHABLE  also before a task from whose end no charger could be reached
#
# The rule has no further lookahead, so with POLICY_THRESHOLD a robot may run empty on its path to a
# charger; the lowest level of the plan is then negative.


@kernel
def plan_threshold(costs, battery, scratch, place, charge, order, length):
    """Leave the stops of the rule in scratch.plan; return the ticks of the measured list.

    INF_COST if the rule needs a charger and none is reachable. The caller must check for a level below
    0 (scratch.plan.lowest_charge).
    """
    clear(scratch, charge, length)
    plan = scratch.plan
    plan.lowest_charge = charge
    level = np.int64(charge)
    ticks, energy = costs.ticks[costs.robot_type], costs.energy[costs.robot_type]
    use = costs.use[costs.robot_type]
    scratch.count.states += length
    for i in range(length):
        task = np.int64(order[i])
        here, begin = place_before(costs, place, order, i), costs.begin[task]
        then = level - energy[here, begin] - use[task]
        if is_low(battery, then, np.int64(costs.end[task])):
            charger = np.int64(battery.nearest[battery.robot_type, here])
            if charger == NIL:
                plan.cost = INF_COST
                return INF_COST
            k = plan.stops
            at = np.int64(battery.charger[charger])
            plan.stops = k + 1
            plan.position[k] = i
            plan.charger[k] = charger
            done = plan.cost - scratch.done_ticks[length] + scratch.done_ticks[i]
            wait = waiting_at(battery, scratch, charger, done + ticks[here, at])
            arrival = level - energy[here, at]
            level = stop_at(battery, plan, k, arrival, np.int64(BATTERY_FULL), wait)
            plan.cost += ticks[here, at] + ticks[at, begin]
            plan.cost -= ticks[here, begin]
            here = at
        level -= energy[here, begin] + use[task]
        plan.lowest_charge = min(plan.lowest_charge, level)
    plan.end_charge = level
    if plan.stops > 0:
        scratch.count.plans += 1
    add_detours(costs, battery, scratch, place, order)
    return plan.cost


@kernel
def is_low(battery, level, place):
    """Whether a robot must charge first if it would be at this place with this level."""
    if level < battery.threshold:
        return True
    return (
        battery.policy == POLICY_THRESHOLD_REACHABLE
        and level < battery.reach[battery.robot_type, place]
    )
