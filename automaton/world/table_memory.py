"""Whether there is memory for distance tables at all."""

from __future__ import annotations

import math

import numpy as np

from automaton.engine.distance_tables import least_table_bytes
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.document import Document
from automaton.scenario.robot_types import types_of
from automaton.scenario.schema import Scenario
from automaton.units import bytes_of, memory


def check_table_memory(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """A table of this floor fits world.distance_tables. Raises InputError."""
    text = scenario.world.distance_tables
    cells = int(np.count_nonzero(floor_plan.drivable))
    types = types_of(scenario)
    headings = max(one.headings for one in types)
    turns = [turn for one in types for turn in one.turns]
    moves = [ticks for one in types for ticks in one.moves]
    limits = np.flatnonzero(np.bincount(floor_plan.min_move_ticks.reshape(-1))).tolist()
    unit = math.gcd(*turns, *(max(move, limit) for move in moves for limit in (0, *limits)))
    size = least_table_bytes(cells, headings, max(turns) // unit)
    if size > bytes_of(text):
        raise document.error(
            ("world", "distance_tables"),
            f"world.distance_tables is {text}, but a table of the {cells:,} cells of this floor takes "
            f"{memory(size)}; set it to at least that",
        )
