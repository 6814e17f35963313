"""The cells of the queues of stations, and all that serve robots."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automaton.floor.cells import CHARGER, STATION, UNLIMITED
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.schema import Scenario


def queue_path(
    floor_plan: FloorPlan, at: tuple[int, int], corners: tuple[tuple[int, int], ...]
) -> list[int]:
    """Flat cells of a queue, the one next to the station first, by the corners of its path."""
    path: list[int] = []
    x, y = at
    for u, v in corners:
        while (x, y) != (u, v):
            x, y = (x + (u > x) - (u < x), y) if x != u else (x, y + (v > y) - (v < y))
            path.append(floor_plan.cell(x, y))
    return path


def service_cells(scenario: Scenario, floor_plan: FloorPlan) -> npt.NDArray[np.bool_]:
    """(C,) bool: stations, their queues and chargers, unless they hold any number of robots."""
    serving = np.isin(floor_plan.kind, (STATION, CHARGER)).reshape(-1)
    for station in scenario.stations.values():
        serving[queue_path(floor_plan, station.at, station.queue)] = True
    limited: npt.NDArray[np.bool_] = serving & (floor_plan.capacity.reshape(-1) != UNLIMITED)
    return limited
