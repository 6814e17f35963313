"""Cheapest insertion into an open path: where a task adds the fewest ticks to a list.

A task is inserted as a whole: one that is picked up and delivered takes its inner way along, and the
pair stays together, because a robot carries one load.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.allocation.auction.market import INF_COST


@kernel
def place_before(costs, place, order, i):
    """The place from which a robot that starts at `place` drives to task i of its list."""
    if i == 0:
        return np.int64(place)
    return np.int64(costs.end[order[i - 1]])


@kernel
def cheapest_insertion(costs, place, order, length, task, first):
    """(position, ticks added) of `task` in order[:length]; ties: the latest position.

    Positions below `first` stay as they are (1: the robot is on its way to its first task).
    """
    ticks = costs.ticks[costs.robot_type[0]]
    enter, leave = np.int64(costs.begin[task]), np.int64(costs.end[task])
    before = np.int64(place)
    at, least = NIL, INF_COST
    for i in range(length):
        after = np.int64(costs.begin[order[i]])
        added = ticks[before, enter] + ticks[leave, after] - ticks[before, after]
        if i >= first and added <= least:
            at, least = i, added
        before = np.int64(costs.end[order[i]])
    added = np.int64(ticks[before, enter])
    if added <= least:
        at, least = length, added
    return at, least + costs.inside[costs.robot_type[0], task]


@kernel
def energy_added(costs, place, order, length, task, position):
    """Units that `task` adds to the list at this position."""
    energy, robot_type = costs.energy[costs.robot_type[0]], costs.robot_type[0]
    before = place_before(costs, place, order, position)
    added = np.int64(energy[before, costs.begin[task]]) + costs.use[robot_type, task]
    if position < length:
        after = costs.begin[order[position]]
        added += energy[costs.end[task], after] - energy[before, after]
    return added


@kernel
def copy_inserted(order, length, task, position, out):
    """out[:length + 1] = the list with the task at this position."""
    for i in range(position):
        out[i] = order[i]
    out[position] = task
    for i in range(position, length):
        out[i + 1] = order[i]


@kernel
def insert(order, length, task, position):
    """The same in place; order has room."""
    for i in range(length, position, -1):
        order[i] = order[i - 1]
    order[position] = task


@kernel
def remove(order, length, position):
    """Take the task at this position out of order[:length]."""
    for i in range(position, length - 1):
        order[i] = order[i + 1]


@kernel
def measure(costs, scratch, place, order, length):
    """Ticks and energy along the list, without charging, into done_* and begun_* of the scratch."""
    robot_type = costs.robot_type[0]
    ticks_to, energy_to = costs.ticks[robot_type], costs.energy[robot_type]
    inside, use = costs.inside[robot_type], costs.use[robot_type]
    ticks, energy = np.int64(0), np.int64(0)
    before = np.int64(place)
    for i in range(length):
        task = np.int64(order[i])
        scratch.done_ticks[i] = ticks
        scratch.done_energy[i] = energy
        ticks += ticks_to[before, costs.begin[task]]
        energy += energy_to[before, costs.begin[task]]
        scratch.begun_ticks[i] = ticks
        scratch.begun_energy[i] = energy
        ticks += inside[task]
        energy += use[task]
        before = np.int64(costs.end[task])
    scratch.done_ticks[length] = ticks
    scratch.done_energy[length] = energy
