"""The parameters of methods that pass loads along alleys. Imports no Numba."""

from __future__ import annotations

from typing import Any

import msgspec

from automaton.floor.cells import ANY, CELL_KINDS
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.orders import kinds_of_sources
from automaton.scenario.schema import Scenario
from strategies.allocation.load_parameters import refusal_of_priorities, refusal_of_tours


class Alleys(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """No parameters; but loads are looked for on shelves alone."""

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Loads at docks and stations belong to no alley: no robot would ever fetch them.

        An alley is the column from which its loads are picked up.
        """
        if scenario.world.access_cell != "fixed":
            return "its alleys are where loads are picked up; it needs world.access_cell: fixed"
        if refusal := refusal_of_tours(scenario, floor_plan) or refusal_of_priorities(scenario):
            return refusal
        begun = kinds_of_sources(scenario.orders, floor_plan)
        names = [f"{kind.name}s" for kind in CELL_KINDS if kind.holds == ANY and kind.code in begun]
        if not names:
            return None
        places = " and ".join(names)
        return (
            f"it finds loads on shelves alone, and orders begin at {places}; first-come takes those"
        )

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """What is worth trying of each parameter."""
        return {}
