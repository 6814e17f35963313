"""Where a jam is: the robot in the middle of it."""

from __future__ import annotations

import numpy as np

from automaton.engine.state import NIL
from automaton.floor.floor_plan import FloorPlan
from automaton.history.snapshot import Snapshot
from automaton.runs.progress import Jam


def middle_robot(jam: Jam, snapshot: Snapshot, floor_plan: FloorPlan) -> int:
    """Index in `jam.robots` of the one nearest to the middle between the corners of the jam."""
    cells = snapshot.robots.cell[list(jam.robots)]
    rows, columns = np.divmod(cells, floor_plan.stride)
    corners = [
        divmod(floor_plan.cell(*corner), floor_plan.stride) for corner in (jam.first, jam.last)
    ]
    row, column = np.mean(corners, axis=0)
    distance = np.where(cells == NIL, np.inf, abs(rows - row) + abs(columns - column))
    return int(np.argmin(distance))
