"""Where to charge: the shortest path over states (position i, charger c).

In state (i, c) the robot drives to charger c between tasks i - 1 and i of its list. The first stretch
must fit into what the robot has, each later one into a full battery. With a linear curve the charging
time depends on the energy of the whole way alone, so the path that minimises rate x ticks + energy is
exact with any number of stops. Ways are shortest ways: a detour never saves time or energy.

Ties: fewer ticks from the task before to the charger, then the later position.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from automaton.strategy.kernels import CURVE_RATE
from strategies.allocation.auction.insertion import place_before
from strategies.allocation.auction.market import BATTERY_FULL, INF_COST


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
