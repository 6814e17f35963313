"""The parameters of shortest job first. Imports no Numba."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.schema import Scenario
from strategies.allocation.load_parameters import (
    Storage,
    refusal_of_own_orders,
    tuned_storage,
)


class ShortestJobParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The weights of a score: age * (how long it waited) - job * (how long it takes)."""

    age: Annotated[float, Meta(ge=0, le=1000, description="C_A: weight of the waiting")] = 0.5
    job: Annotated[float, Meta(ge=0, le=1000, description="C_D: weight of the driving")] = 10.0
    idle: Annotated[
        Literal["park", "stay"], Meta(description="what robots without an order do")
    ] = "park"
    storage: Storage = "fixed"

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """The score of an order is the same rule for all robots."""
        return refusal_of_own_orders(scenario)

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """What is worth trying of each parameter."""
        return tuned_storage(scenario, floor_plan)
