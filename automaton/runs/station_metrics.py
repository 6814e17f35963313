"""What stations did to which pods are carried: visits, lines, and shares of the time of a run."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL
from automaton.runs.task_metrics import Measured
from automaton.world.pods import station_names


class Station(NamedTuple):
    """What a station did up to now."""

    station: str  # its name, or its number from 1
    visits: int  # that are over
    lines_done: int
    service_share: float  # of the time: it served a robot
    # Lines were open for it, it had no break, and no robot in its cell or queue.
    starved_share: float


def metrics_by_station(run: Measured) -> list[dict[str, Any]]:
    """For each station, in the order of numbers, what Station has; () where no pods are carried."""
    world = run.world
    names = station_names(run.resolved)
    stations, elapsed = world.pod_stations, max(int(world.clock[CLOCK_TICK]), 1)
    done_at = world.stops.cell[world.stops.done != NIL]
    visited = stations.station_at[done_at] if names else NOTHING
    done = world.lines.served_at[world.lines.done != NIL]
    visits, lines = (
        np.bincount(of[of != NIL], minlength=len(names)).tolist() for of in (visited, done)
    )
    return [
        Station(
            name,
            visits[k],
            lines[k],
            int(stations.served_ticks[k]) / elapsed,
            int(stations.starved_ticks[k]) / elapsed,
        )._asdict()
        for k, name in enumerate(names)
    ]


NOTHING = np.zeros(0, np.int32)
