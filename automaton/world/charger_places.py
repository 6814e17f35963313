"""How many robots charge at a charger at once: its capacity.

Elsewhere two robots share a cell only in opposite directions; at a charger of capacity 2 they stand
side by side, whichever way they came. So its cell is one without a limit, and a block of two.
"""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import numpy.typing as npt

from automaton.floor.cells import CHARGER, UNLIMITED
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.changing_floor import Block
from automaton.scenario.schema import Scenario
from automaton.world.cell_sets import cells_of_set


def with_shared_chargers(floor_plan: FloorPlan) -> FloorPlan:
    """The floor whose chargers for two robots have no limit of their own; the same if it has none."""
    shared = shared_chargers(floor_plan)
    if not len(shared):
        return floor_plan
    capacity = floor_plan.capacity.copy()
    capacity.flat[shared] = UNLIMITED
    capacity.setflags(write=False)
    return replace(floor_plan, capacity=capacity)


def shared_chargers(floor_plan: FloorPlan) -> npt.NDArray[np.int64]:
    """The flat cells of chargers for two robots."""
    return np.flatnonzero((floor_plan.kind == CHARGER) & (floor_plan.capacity == 2))


def with_charger_blocks(scenario: Scenario, floor_plan: FloorPlan) -> Scenario:
    """The scenario with a block of two for each charger for two robots, which limits it."""
    blocks = list(scenario.floor.blocks)
    for cell in shared_chargers(floor_plan).tolist():
        block = msgspec.convert({"cells": [floor_plan.xy(cell)], "max_robots": 2}, Block)
        if block not in blocks:
            blocks.append(block)
    floor = msgspec.structs.replace(scenario.floor, blocks=tuple(blocks))
    return msgspec.structs.replace(scenario, floor=floor)


def places_of_chargers(scenario: Scenario, floor_plan: FloorPlan) -> dict[int, int]:
    """How many robots charge at once, by the flat cell of each charger; all, where there is no limit."""
    places = {
        cell: 1 if floor_plan.capacity.flat[cell] != UNLIMITED else scenario.fleet.robots
        for cell in np.flatnonzero(floor_plan.kind == CHARGER).tolist()
    }
    for block in scenario.floor.blocks:
        cells = cells_of_set("", block.cells, floor_plan)
        if len(cells) == 1 and cells[0] in places:
            places[cells[0]] = min(places[cells[0]], block.max_robots)
    return places
