"""The parameters of the charging strategies."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import msgspec
from msgspec import Meta

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.order_lines import carries_pods
from automaton.scenario.quantities import TIME, quantity
from automaton.scenario.schema import Scenario
from strategies.allocation.allocation_parameters import refusal_of_tours

Percent = Annotated[float, Meta(ge=0, le=100)]


class Quotes(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The inputs of charging estimates: paths and loads of orders."""

    keeps_way_back: ClassVar[bool] = (
        True  # every order taken leaves enough charge to reach a charger
    )

    count_queues: Annotated[
        bool, Meta(description="Whether robots already sent to a charger raise its cost.")
    ] = True
    check_idle_every: Annotated[
        int,
        quantity(
            TIME,
            ge=1,
            le=1_000_000,
            description="Ticks between checks of idle robots, which use energy while they wait.",
        ),
    ] = 50

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Orders without a load have no price."""
        return (
            None if carries_pods(scenario, floor_plan) else refusal_of_tours(scenario, floor_plan)
        )


class Insertion(Quotes, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How charging stops are inserted into a list of orders."""

    mode: Annotated[
        Literal["hierarchical", "joint"],
        Meta(
            description="How an order and its charging are inserted into a list. hierarchical: "
            "first the order where it costs least, then the charging; joint: both where they cost "
            "least together."
        ),
    ] = "hierarchical"
    never_strand: Annotated[
        bool, Meta(description="Whether a charger must be within reach at the end of every list.")
    ] = True


class FillUp(Quotes, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How far batteries are filled."""

    target: Annotated[Percent, Meta(description="Charge up to which robots charge, percent.")] = (
        100.0
    )


class Threshold(Quotes, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The charge that counts as low."""

    keeps_way_back: ClassVar[bool] = False

    threshold: Annotated[
        Percent, Meta(description="Charge below which robots charge, percent.")
    ] = 20.0
    mode: Annotated[
        Literal["threshold-only", "keep-charger-reachable"],
        Meta(
            description="When robots charge. threshold-only: before a task that would end below the "
            "threshold; keep-charger-reachable: also before a task after which no charger would be "
            "within reach."
        ),
    ] = "keep-charger-reachable"


class Opportunity(Quotes, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """When an idle robot charges."""

    start_below: Annotated[
        Percent, Meta(description="Charge below which idle robots charge, percent.")
    ] = 80.0
