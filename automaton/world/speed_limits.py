"""Speed limits: moves between some cells of the floor take at least so many ticks."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from automaton.errors import InputError
from automaton.floor.floor_plan import DRIVABLE, FloorPlan
from automaton.scenario.changing_floor import SpeedLimit
from automaton.scenario.document import Document
from automaton.scenario.schema import Scenario
from automaton.world.cell_sets import cells_of_set

MAX_SPEEDS: Final = 14  # distance tables have a queue for each, and for two more


def check_speed_limits(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Limits are of cells that robots drive on. Raises InputError."""
    for number, limit in enumerate(scenario.floor.speed_limits):
        name = f"speed limit {number + 1}"
        try:
            cells = cells_of_set(name, limit.cells, floor_plan)
            if not DRIVABLE[floor_plan.kind.flat[cells]].any():
                raise InputError(f"{name} has no cell on which robots drive")
        except InputError as error:
            keys = ("floor", "speed_limits", number, "cells")
            raise document.error(keys, error.message) from None
    speeds = len({limit.max_speed for limit in scenario.floor.speed_limits})
    if speeds > MAX_SPEEDS:
        text = f"floor.speed_limits has {speeds} different speeds, at most {MAX_SPEEDS} are allowed"
        raise document.error(("floor", "speed_limits"), text)


def with_speed_limits(floor_plan: FloorPlan, limits: tuple[SpeedLimit, ...]) -> FloorPlan:
    """The floor with the ticks that moves take at least; the same without limits."""
    if not limits:
        return floor_plan
    ticks = np.zeros((floor_plan.kind.size, 4), np.uint16)
    for limit in limits:
        inside = np.zeros(floor_plan.kind.size, np.bool_)
        inside[cells_of_set("", limit.cells, floor_plan)] = True
        for direction, offset in enumerate(floor_plan.offsets):
            # np.roll wraps round, but only through the border, where no robot drives.
            both = inside & np.roll(inside, -offset)
            ticks[both, direction] = np.maximum(ticks[both, direction], limit.max_speed)
    ticks.setflags(write=False)
    return replace(floor_plan, min_move_ticks=ticks)
