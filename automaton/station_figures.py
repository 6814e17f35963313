"""What stations did: parts finished, how long they took, and the station that works most.

`station_figures` reads the works of automaton.world.work; nothing where no parts are worked on.
"""

from __future__ import annotations

import numpy as np

from automaton.world.state import NIL, TICK, Array, World


def station_figures(world: World) -> dict[str, float | int]:
    """The figures of stations, by the names of the glossary; none without parts.

    `part_time` is there once a part is finished.
    """
    stations = world.stations
    if not len(stations.part):
        return {}
    ended = np.flatnonzero((stations.frees == NIL) & (stations.done != NIL))
    begun = np.full(int(stations.part.max()) + 1, NIL, np.int64)
    begun[stations.part[stations.entering]] = stations.came[stations.entering]
    took = stations.done[ended] - begun[stations.part[ended]]
    busy = busy_ticks(world)
    most = int(np.argmax(busy))
    time = {"part_time": float(took.mean())} if len(ended) else {}
    return {
        "parts": len(ended),
        **time,
        "busiest_station": most + 1,
        "busiest": float(busy[most]) / max(1, int(world.clock[TICK])),
    }


def busy_ticks(world: World) -> Array:
    """(k,) ticks in which each station worked, what it works on now included."""
    stations, now = world.stations, int(world.clock[TICK])
    ended = np.flatnonzero(stations.done != NIL)
    count = len(stations.slot)
    busy = np.bincount(stations.station[ended], stations.ticks[ended], count).astype(np.int64)
    working = np.flatnonzero(stations.first != NIL)
    since = stations.until[working] - stations.ticks[stations.first[working]]
    busy[working] += np.maximum(0, now - since)
    return busy


def balance_figures(counted: dict[str, int]) -> dict[str, float | int]:
    """What zoning counted, with the time in balance as a share of the time that was watched."""
    figures: dict[str, float | int] = dict(counted)
    if "ticks_watched" in figures and "ticks_in_balance" in figures:
        watched, good = figures.pop("ticks_watched"), figures.pop("ticks_in_balance")
        if watched:
            figures["in_balance"] = good / watched
    return figures
