"""The work of zones at a moment: minutes of driving and handling for what lies in their queues."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from automaton.world.partition import Partition
from automaton.world.state import CARRIED, DROP, MOVE, NIL, PICK, WAITING, Array, World
from automaton.zoning.load import work_minutes


def minutes_of_zones(
    zoning: Partition, orders: Any, zones: Sequence[int], tick_s: float, duration: Array
) -> float:
    """Minutes (eq. 1-4) for orders that wait in the queues of zones, are fetched and carried.

    tick_s: seconds in a tick; duration: ticks by action.
    """
    mine = np.flatnonzero(np.isin(zoning.queue, zones) & (zoning.stop != NIL))
    mine = mine[mine < len(orders.state)]
    waits, carried = orders.state[mine] == WAITING, orders.state[mine] == CARRIED
    at = np.where(waits, orders.place[mine], np.where(carried, zoning.leg[mine], NIL))
    here, there = zoning.station_of[at], zoning.station_of[zoning.stop[mine]]
    legs = (at != NIL) & (here != NIL) & (there != NIL) & (here != there)
    flow = np.zeros(zoning.roads.between.shape)
    np.add.at(flow, (here[legs], there[legs]), 1.0)
    handling = tick_s * float(duration[PICK] + duration[DROP]) / 60
    return work_minutes(flow, zoning.roads.between, 60 / (tick_s * float(duration[MOVE])), handling)


def work_of_each(world: World) -> Array:
    """(Z,) minutes of work of each zone; a tick is a second where the scenario does not say."""
    tick_s = world.rules.tick_us / 1e6 if world.rules.tick_us else 1.0
    zoning, duration = world.zoning, world.rules.duration[0]
    zones = range(len(zoning.server))
    return np.array([minutes_of_zones(zoning, world.orders, [z], tick_s, duration) for z in zones])


def unevenness(work: Array) -> float | None:
    """SVp, from 0 (all zones have as much to do) to 1 (one has it all); None without any work."""
    total = float(work.sum())
    if total == 0.0 or len(work) < 2:
        return None
    apart = float(np.abs(work[:, None] - work[None, :]).sum()) / 2
    return apart / ((len(work) - 1) * total)
