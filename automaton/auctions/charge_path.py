"""Where to charge: the shortest path over states (position i, charger c).

In state (i, c) the robot drives to charger c between tasks i - 1 and i of its list. The first stretch
must fit into what the robot has, each later one into a full battery. With a linear curve the charging
time depends on the energy of the whole way alone, so the path that minimises rate x ticks + energy is
exact with any number of stops. Ways are shortest ways: a detour never saves time or energy.

Ties: fewer ticks from the task before to the charger, then the later position.
"""

import numpy as np

from automaton.auctions.insertion import place_before
from automaton.auctions.market import FULL, INF, STATES
from automaton.compiled import kernel
from automaton.world.state import NIL


@kernel
def tail_of(battery, place):
    """Units that must be left at the end of a list for the way to a charger; INF: none is there."""
    if battery.end_reach == 0:
        return np.int64(0)
    return np.int64(battery.reach[place])


@kernel
def find_stops(work, battery, scratch, place, charge, order, length):
    """The last stop, i * C + c, of the best way through chargers; NIL if there is none."""
    chargers = battery.charger.shape[0]
    rate = np.int64(battery.curve_rate[0])
    span = np.int64(FULL) - battery.reserve
    end_ticks, end_energy = scratch.done_ticks[length], scratch.done_energy[length]
    end_energy += tail_of(battery, work.end[order[length - 1]])
    best, nearest, last = np.int64(INF), np.int64(INF), np.int64(NIL)
    for i in range(length):
        before = place_before(work, place, order, i)
        after = np.int64(work.begin[order[i]])
        scratch.count[STATES] += chargers
        for c in range(chargers):
            reach_charger(work, battery, scratch, before, charge, order, i, c)
        if chargers > 1:
            hop(work, battery, scratch, i)
        rest_ticks = end_ticks - scratch.begun_ticks[i]
        rest_energy = end_energy - scratch.begun_energy[i]
        for c in range(chargers):
            so_far = scratch.weight[i, c]
            if so_far >= best:
                scratch.weight[i, c] = INF  # nothing that goes on from here is better
                continue
            at = np.int64(battery.charger[c])
            energy = work.energy[at, after] + rest_energy
            total = so_far + rate * (work.ticks[at, after] + rest_ticks) + energy
            if energy > span:
                continue
            # From here the end is in reach: another stop only makes the way longer.
            scratch.weight[i, c] = INF
            detour = np.int64(work.ticks[before, at])
            if total < best or (total == best and detour <= nearest):
                if total == best and detour == nearest and last // chargers == i:
                    continue
                best, nearest, last = total, detour, np.int64(i * chargers + c)
    return last


@kernel
def reach_charger(work, battery, scratch, before, charge, order, i, c):
    """weight[i, c], back[i, c]: the best way to charger c before task i, from the start or a stop."""
    chargers = battery.charger.shape[0]
    rate = np.int64(battery.curve_rate[0])
    at = np.int64(battery.charger[c])
    into_ticks = work.ticks[before, at] + scratch.done_ticks[i]
    into_energy = work.energy[before, at] + scratch.done_energy[i]
    best, back = np.int64(INF), np.int64(NIL)
    if into_energy <= charge - battery.reserve:
        best = rate * into_ticks + into_energy
    for k in range(i):
        after = np.int64(work.begin[order[k]])
        for b in range(chargers):
            if scratch.weight[k, b] >= best:
                continue
            stop = np.int64(battery.charger[b])
            energy = work.energy[stop, after] + into_energy - scratch.begun_energy[k]
            if energy > FULL - battery.reserve:
                continue
            ticks = work.ticks[stop, after] + into_ticks - scratch.begun_ticks[k]
            weight = scratch.weight[k, b] + rate * ticks + energy
            if weight <= best:
                best, back = weight, np.int64(k * chargers + b)
    scratch.weight[i, c] = INF if best >= INF else best + rate * battery.wait[c]
    scratch.back[i, c] = back


@kernel
def hop(work, battery, scratch, i):
    """Ways from one charger straight to another, where the way between tasks is long."""
    chargers = battery.charger.shape[0]
    rate = np.int64(battery.curve_rate[0])
    changed = True
    while changed:
        changed = False
        for b in range(chargers):
            if scratch.weight[i, b] >= INF:
                continue
            for c in range(chargers):
                between = np.int64(work.energy[battery.charger[b], battery.charger[c]])
                ticks = work.ticks[battery.charger[b], battery.charger[c]] + battery.wait[c]
                weight = scratch.weight[i, b] + rate * ticks + between
                if c != b and between <= FULL - battery.reserve and weight < scratch.weight[i, c]:
                    scratch.weight[i, c] = weight
                    scratch.back[i, c] = i * chargers + b
                    changed = True


@kernel
def note_stops(battery, scratch, last):
    """Write the way to the last stop into the plan, in the order of driving."""
    chargers = battery.charger.shape[0]
    stops = 0
    node = np.int64(last)
    while node != NIL:
        stops += 1
        node = np.int64(scratch.back[node // chargers, node % chargers])
    scratch.plan.stops[0] = stops
    node = np.int64(last)
    while node != NIL:
        stops -= 1
        scratch.plan.position[stops] = node // chargers
        scratch.plan.charger[stops] = node % chargers
        node = np.int64(scratch.back[node // chargers, node % chargers])
