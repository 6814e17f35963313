"""The parameters of allocations that do not know all kinds of orders. Imports no Numba."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.carried_pods import carries_pods
from automaton.scenario.orders import has_tours, priorities_of
from automaton.scenario.schema import Scenario


def refusal_of_pods(scenario: Scenario, floor_plan: FloorPlan) -> str | None:
    """Return why a strategy that brings each load to a target does not fit, None if it does."""
    if not carries_pods(scenario, floor_plan):
        return None
    return (
        "it does not know pods, which go to stations and back into storage; shortest-job, first-come, "
        "independent and greedy do"
    )


def refusal_of_tours(scenario: Scenario, floor_plan: FloorPlan) -> str | None:
    """Return why an allocation that prices loads alone does not fit, None if it does."""
    if carries_pods(scenario, floor_plan):
        return refusal_of_pods(scenario, floor_plan)
    if not has_tours(scenario.orders):
        return None
    return "it knows only orders with a load, and some have stops; greedy and first-come do those"


def refusal_of_own_orders(scenario: Scenario) -> str | None:
    """Return why an allocation that gives any order to any robot does not fit, None if it does."""
    if scenario.orders.assign != "round-robin":
        return None
    return "it gives any order to any robot, and orders.assign is round-robin; greedy does that"


def refusal_of_priorities(scenario: Scenario) -> str | None:
    """Return why an allocation that does not look at priorities does not fit, None if it does."""
    if len(priorities_of(scenario.orders)) == 1:
        return None
    return "it knows no priorities, and orders have some; greedy and first-come do those"


Storage = Annotated[
    Literal["fixed", "nearest", "class", "random"],
    Meta(
        description="where a pod is stored after its trip: where it stood at the start, in the nearest "
        "free cell, in the nearest one of its class (pods.classes), or in any"
    ),
]


def tuned_storage(scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
    """Return the policies of storage that are worth trying: none where no pod is stored."""
    return {"storage": ("fixed", "nearest")} if carries_pods(scenario, floor_plan) else {}


class Storing(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Where pods are stored."""

    storage: Storage = "fixed"


class IndependentParameters(Storing, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """No further parameters."""

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """What is worth trying of each parameter."""
        return tuned_storage(scenario, floor_plan)


class FirstComeParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Which order comes first; but robots must not have orders of their own."""

    by: Annotated[
        Literal["arrival", "due"],
        Meta(
            description="the order that was released first, or the one that is due first: those without "
            "a due time last, ties by release"
        ),
    ] = "arrival"
    storage: Storage = "fixed"

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """One cursor goes over the orders for all robots of a type."""
        return refusal_of_own_orders(scenario)

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """What is worth trying of each parameter."""
        return tuned_storage(scenario, floor_plan)
