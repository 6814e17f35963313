"""The work of zones at a moment: minutes of driving and handling for what lies in their queues."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from automaton.engine.facilities import ServiceZones
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
from strategies.zoning.design.zone_load import work_minutes


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
