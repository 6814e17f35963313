"""The load of a zone in minutes (eq. 1-4) and the balance of all zones.

f_ij   loads from i to j        tot = base + sum f_ij        W the stations of the zone
g_ij   = (inflow of i) (outflow of j) / tot: empty trips; the paper prints the same sum twice
L      = sum over i, j in W, i != j of (f_ij + g_ij) between_ij / V  +  tot (t_u + t_l), V by robot
SVp    = sum over pairs of zones of |L_z - L_y| / ((zones - 1) sum L)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from automaton.engine.facilities import ServiceZones
from automaton.engine.jit.kernel import kernel
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    NIL,
    ORDER_CARRIED,
    ORDER_WAITING,
    Array,
    World,
)
from automaton.units import SECONDS_PER_UNIT
from strategies.zoning.transfer_stations import find_tips

UNDEFINED = -1.0  # balance of zones without any load


@kernel
def find_loads(roads, rules, flow, through, design, workspace):
    """workspace.load of all zones, from one flow (S, S) float64; returns the balance.

    through: 1 = what drives past a tip on its shortest way counts as the tip's (GA).
    """
    if through == 1:
        flow_past_tips(roads, flow, design, workspace)
    for z in range(design.transfer.shape[0]):
        members(design, workspace, z, rules.shared)
        if through == 1:
            workspace.load[z] = load_of(roads, rules, workspace.legs, workspace, z)
        else:
            workspace.load[z] = load_of(roads, rules, flow, workspace, z)
    return balance(workspace.load)


@kernel
def members(design, workspace, z, shared):
    """workspace.member: the stations of zone z, and its transfer stations if these are shared."""
    for s in range(design.zone.shape[0]):
        workspace.member[s] = 1 if design.zone[s] == z else 0
        if shared:
            for other in range(design.transfer.shape[0]):
                if design.transfer[z, other, s] == 1:
                    workspace.member[s] = 1


@kernel
def load_of(roads, rules, flow, workspace, z):
    """Minutes of work of the robot of zone z at the stations of workspace.member."""
    count = np.int64(0)
    for s in range(workspace.member.shape[0]):
        if workspace.member[s] == 1:
            workspace.listed[count] = s
            count += 1
    total = rules.base
    workspace.into[:] = 0.0
    workspace.out[:] = 0.0
    for a in range(count):
        i = workspace.listed[a]
        for b in range(count):
            j = workspace.listed[b]
            if i != j:
                total += flow[i, j]
                workspace.out[i] += flow[i, j]
                workspace.into[j] += flow[i, j]
    if total == 0.0:
        return 0.0
    cells = 0.0
    for a in range(count):
        i = workspace.listed[a]
        for b in range(count):
            j = workspace.listed[b]
            if i != j:
                empty = workspace.into[i] * workspace.out[j] / total
                cells += (flow[i, j] + empty) * roads.between[i, j]
    return cells * workspace.move_time_factor[z] / rules.speed + total * rules.handling


def work_minutes(flow: Array, between: Array, speed: float, handling: float) -> float:
    """Minutes of work of a flow between any stations, as `load_of` reckons them without a base.

    In NumPy: who looks at a run does not wait until a kernel is compiled. speed: cells per minute;
    handling: minutes to load and to unload.
    """
    total = float(flow.sum())
    if total == 0.0:
        return 0.0
    empty = np.outer(flow.sum(axis=0), flow.sum(axis=1)) / total
    return float(((flow + empty) * between).sum()) / speed + total * handling


@kernel
def flow_past_tips(roads, flow, design, workspace):
    """workspace.legs: the flow, and for tips i all that drives past i and then j of the same zone."""
    stations = flow.shape[0]
    find_tips(roads, design, workspace)
    workspace.legs[:] = 0.0
    for a in range(stations):
        for b in range(stations):
            if a == b or flow[a, b] == 0.0:
                continue
            count = stations_on_way(roads, workspace, a, b)
            for x in range(count):
                i = np.int64(workspace.listed[x])
                for y in range(x + 1, count):
                    j = np.int64(workspace.listed[y])
                    whole = i == a and j == b
                    if design.zone[i] == design.zone[j] and (whole or workspace.tip[i] == 1):
                        workspace.legs[i, j] += flow[a, b]


@kernel
def stations_on_way(roads, workspace, a, b):
    """workspace.listed: the stations on the shortest way from a to b, in its order; how many."""
    end = np.int64(roads.point[b])
    p = np.int64(roads.point[a])
    count = np.int64(0)
    while p != NIL:
        if roads.station[p] != NIL:
            workspace.listed[count] = roads.station[p]
            count += 1
        if p == end:
            break
        p = np.int64(roads.hop[p, end])
    return count


@kernel
def balance(load):
    """SVp, from 0 (equal) to 1 (one zone has it all), or UNDEFINED."""
    zones = load.shape[0]
    total = 0.0
    apart = 0.0
    for z in range(zones):
        total += load[z]
        for y in range(z):
            apart += abs(load[z] - load[y])
    if total == 0.0 or zones < 2:
        return UNDEFINED
    return apart / ((zones - 1) * total)


# The work of zones at a moment: minutes of driving and handling for what lies in their queues.


def minutes_of_zones(
    service_zones: ServiceZones, orders: Any, zones: Sequence[int], tick_s: float, duration: Array
) -> float:
    """Minutes (eq. 1-4) for orders that wait in the queues of zones, are fetched and carried.

    tick_s: seconds in a tick; duration: ticks by action.
    """
    mine = np.flatnonzero(np.isin(service_zones.queue, zones) & (service_zones.next_slot != NIL))
    mine = mine[mine < len(orders.state)]
    waits, carried = orders.state[mine] == ORDER_WAITING, orders.state[mine] == ORDER_CARRIED
    at = np.where(
        waits, orders.current_slot[mine], np.where(carried, service_zones.picked_from[mine], NIL)
    )
    here, there = (
        service_zones.station_of[at],
        service_zones.station_of[service_zones.next_slot[mine]],
    )
    legs = (at != NIL) & (here != NIL) & (there != NIL) & (here != there)
    flow = np.zeros(service_zones.roads.between.shape)
    np.add.at(flow, (here[legs], there[legs]), 1.0)
    handling = (
        tick_s * float(duration[ACTION_PICK] + duration[ACTION_DROP]) / SECONDS_PER_UNIT["min"]
    )
    return work_minutes(
        flow,
        service_zones.roads.between,
        SECONDS_PER_UNIT["min"] / (tick_s * float(duration[ACTION_MOVE])),
        handling,
    )


def work_of_each(world: World) -> Array:
    """(Z,) minutes of work of each zone, at the speed of the robot that serves it.

    A tick is a second where the scenario does not say.
    """
    tick_s = world.rules.tick_us / 1e6 if world.rules.tick_us else 1.0
    kinds = world.robots.type[world.robots.at_index[world.service_zones.server]].astype(np.int64)
    if loaded := world.rules.loaded_types:
        kinds = loaded + kinds % loaded  # work is to carry loads
    return np.array(
        [
            minutes_of_zones(
                world.service_zones, world.orders, [z], tick_s, world.rules.duration[kind]
            )
            for z, kind in enumerate(kinds.tolist())
        ]
    )


def unevenness(work: Array) -> float | None:
    """SVp, from 0 (all zones have as much to do) to 1 (one has it all); None without any work."""
    total = float(work.sum())
    if total == 0.0 or len(work) < 2:
        return None
    apart = float(np.abs(work[:, None] - work[None, :]).sum()) / 2
    return apart / ((len(work) - 1) * total)
