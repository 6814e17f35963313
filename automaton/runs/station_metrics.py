"""What stations did, from the jobs of automaton.build.parts: parts finished, and ticks of work."""

from __future__ import annotations

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL, Array, World
from automaton.runs.task_metrics import summed


def sums_of_parts(world: World, borders: Array) -> dict[str, Array]:
    """Of the parts that were finished in each stretch between borders: how many, and their ticks.

    Nothing without parts.
    """
    stations = world.stations
    if not len(stations.part):
        return {}
    ended = np.flatnonzero((stations.releases_order == NIL) & (stations.completion_tick != NIL))
    begun = np.full(int(stations.part.max()) + 1, NIL, np.int64)
    begun[stations.part[stations.part_arrivals]] = stations.arrival_tick[stations.part_arrivals]
    at = stations.completion_tick[ended]
    took = at - begun[stations.part[ended]]
    return {
        "parts_finished": summed(at, np.ones(len(at)), borders),
        "part_flow_times": summed(at, took, borders),
    }


def busy_ticks(world: World) -> Array:
    """(k,) ticks in which each station worked, what it works on now included."""
    stations, now = world.stations, int(world.clock[CLOCK_TICK])
    ended = np.flatnonzero(stations.completion_tick != NIL)
    count = len(stations.slot)
    busy = np.bincount(stations.station[ended], stations.processing_time[ended], count).astype(
        np.int64
    )
    working = np.flatnonzero(stations.in_service != NIL)
    since = stations.job_done_tick[working] - stations.processing_time[stations.in_service[working]]
    busy[working] += np.maximum(0, now - since)
    return busy
