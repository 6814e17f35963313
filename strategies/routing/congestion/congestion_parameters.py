"""The parameters of congestion-aware routes. Imports no Numba."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.carried_pods import carries_pods
from automaton.scenario.quantities import TIME, quantity
from automaton.scenario.schema import Scenario

NO_TASKS_OF_PODS = (
    "forecast {} knows the whole way of a load, and none of a pod to stations and back; use forecast "
    "plans"
)
MOST_PLANNED = 100_000_000  # robots x ticks of the plans that `congestion` keeps: 0.9 GB


class SharedPlans(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How far routes go around the traffic that is predicted from the plans of all robots."""

    beta: Annotated[
        float,
        Meta(
            ge=0,
            le=100,
            description="moves of detour that are worth meeting one robot less in a zone",
        ),
    ] = 2.0
    replan_period: Annotated[
        int,
        quantity(
            TIME, ge=0, le=1_000_000, description="ticks after which all robots plan again; 0 never"
        ),
    ] = 20
    horizon: Annotated[
        int, quantity(TIME, ge=1, le=10_000, description="ticks for which traffic is predicted")
    ] = 500

    forecast: Annotated[
        Literal["plans", "tasks", "task-averages"],
        Meta(
            description="plans: where the plans of all lead, and when, slow zones included; tasks: "
            "where A* would lead all on their tasks, undelayed; task-averages: as tasks, "
            "averaged over time."
        ),
    ] = "plans"

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Tasks are those of loads. The plans are kept in memory, 9 bytes for each robot and tick."""
        if self.forecast != "plans" and carries_pods(scenario, floor_plan):
            return NO_TASKS_OF_PODS.format(self.forecast)
        robots = scenario.fleet.robots
        if robots * self.horizon <= MOST_PLANNED:
            return None
        return (
            f"{robots:,} plans of {self.horizon:,} ticks do not fit into memory: robots x horizon may "
            f"be {MOST_PLANNED:,}, so with this fleet horizon at most {MOST_PLANNED // robots}"
        )
