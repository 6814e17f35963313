"""Speed limits: moves between some cells of the floor take at least so many ticks."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.build.queues import queue_path
from automaton.floor.floor_plan import DRIVABLE, FloorPlan
from automaton.scenario.changing_floor import CellRectangle, MarkedCells, SpeedLimit
from automaton.scenario.document import Document, Keys
from automaton.scenario.schema import Scenario

MAX_SPEEDS: Final = 14  # distance tables tell so many ticks of moves and two more apart

Cells = npt.NDArray[np.int64]


def check_speed_limits(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Limits are of cells that robots drive on. Raises InputError."""
    for number, limit in enumerate(scenario.floor.speed_limits):
        keys: Keys = ("floor", "speed_limits", number, "cells")
        check_marked_cells(document, keys, limit.cells, floor_plan)
    speeds = len({limit.max_speed for limit in scenario.floor.speed_limits})
    if speeds > MAX_SPEEDS:
        text = f"floor.speed_limits has {speeds} different speeds, at most {MAX_SPEEDS} are allowed"
        raise document.error(("floor", "speed_limits"), text)


def check_marked_cells(
    document: Document, keys: Keys, cells: MarkedCells, floor_plan: FloorPlan
) -> None:
    """Corners lie on the floor and follow on each other along it. Raises InputError."""
    ends: tuple[str | int, ...] = ("from", "to")
    if isinstance(cells, CellRectangle):
        corners: tuple[tuple[int, int], ...] = (cells.first, cells.last)
    else:
        corners, ends = cells, tuple(range(len(cells)))
        for (x, y), (u, v) in itertools.pairwise(corners):
            if x != u and y != v:
                text = f"the path goes from [{x}, {y}] to [{u}, {v}], along no row and no column"
                raise document.error(keys, text)
    for end, (x, y) in zip(ends, corners, strict=True):
        if not floor_plan.holds(x, y):
            size = f"(x 0..{floor_plan.width - 1}, y 0..{floor_plan.height - 1})"
            text = f"the corner [{x}, {y}] lies outside the floor {size}"
            raise document.error((*keys, end), text)
    if not DRIVABLE[floor_plan.kind.flat[marked_cells(floor_plan, cells)]].any():
        raise document.error(keys, "robots drive on none of these cells")


def marked_cells(floor_plan: FloorPlan, cells: MarkedCells) -> Cells:
    """Flat cells of a rectangle, or of the path along some corners."""
    if isinstance(cells, CellRectangle):
        (x, y), (u, v) = cells.first, cells.last
        columns = np.arange(min(x, u), max(x, u) + 1)
        rows = np.arange(min(y, v), max(y, v) + 1)
        result: Cells = ((rows[:, None] + 1) * floor_plan.stride + columns + 1).reshape(-1)
        return result
    path = queue_path(floor_plan, cells[0], cells[1:])
    return np.unique(np.array([floor_plan.cell(*cells[0]), *path], np.int64))


def with_speed_limits(floor_plan: FloorPlan, limits: tuple[SpeedLimit, ...]) -> FloorPlan:
    """The floor with the ticks that moves take at least; the same without limits."""
    if not limits:
        return floor_plan
    ticks = np.zeros((floor_plan.kind.size, 4), np.uint16)
    for limit in limits:
        inside = np.zeros(floor_plan.kind.size, np.bool_)
        inside[marked_cells(floor_plan, limit.cells)] = True
        for direction, offset in enumerate(floor_plan.offsets):
            # np.roll wraps round, but only through the border, where nobody drives.
            both = inside & np.roll(inside, -offset)
            ticks[both, direction] = np.maximum(ticks[both, direction], limit.max_speed)
    ticks.setflags(write=False)
    return replace(floor_plan, min_move_ticks=ticks)
