"""Group slots as stations, on floors that have no stations."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from automaton.floor.cells import NIL
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.reachability import slot_access, steps_from

Numbers = NDArray[Any]


@lru_cache(maxsize=8)
def grouped(floor_plan: FloorPlan, most: int) -> tuple[Numbers, Numbers]:
    """Slots grouped as stations: cells of the stations, and the station of each slot or NIL.

    The stations stand where slots are served from, far from each other: the first slot's cell, then
    again and again the cell that is farthest from all so far. A slot counts to the nearest station.
    """
    access = slot_access(floor_plan)
    stand = access.max(axis=1)
    served = np.flatnonzero(stand != NIL)
    chosen: list[int] = []
    best = np.full(len(served), np.iinfo(np.int32).max, np.int64)
    group = np.full(len(access), NIL, np.int32)
    while len(chosen) < most and len(served) and best.max() > 0:
        cell = int(stand[served[0 if not chosen else int(np.argmax(best))]])
        steps = steps_from(floor_plan, [cell])[stand[served]].astype(np.int64)
        steps[steps == NIL] = np.iinfo(np.int32).max
        nearer = steps < best
        best[nearer] = steps[nearer]
        group[served[nearer]] = len(chosen)
        chosen.append(cell)
    return np.array(chosen, np.int32), group
