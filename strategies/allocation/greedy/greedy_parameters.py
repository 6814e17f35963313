"""The parameters of greedy allocation. Imports no Numba."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.quantities import TIME, quantity
from automaton.scenario.schema import Scenario
from strategies.allocation.load_parameters import Storing, tuned_storage

Ticks = Annotated[int, quantity(TIME, ge=1, le=1_000_000)]


class GreedyParameters(Storing, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Which pairs of robots and orders are cheap, and which may be parted again."""

    rest: Annotated[
        float,
        Meta(
            ge=0,
            le=100,
            description="weight of the ticks from an order's first stop to its last one, against "
            "those to its first stop; above 0 short orders come first",
        ),
    ] = 0.0
    reassign: Annotated[
        Ticks | None,
        Meta(
            description="ticks after which robots and orders without a load that are not begun are "
            "matched again; null: a robot keeps what it has taken"
        ),
    ] = None
    active: Annotated[
        Annotated[int, Meta(ge=1)] | None,
        Meta(description="so many robots have an order at once at most; null: all may"),
    ] = None
    idle: Annotated[
        Literal["park", "stay"],
        Meta(
            description="what robots without an order do; those that `active` keeps from an open one "
            "stay"
        ),
    ] = "park"

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """What is worth trying of each parameter."""
        return {"rest": (0.0, 1.0), **tuned_storage(scenario, floor_plan)}
