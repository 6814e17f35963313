"""The right of way of a scenario that names none: pibt, or retreat where pibt does not serve."""

from __future__ import annotations

from typing import Any, Final

import msgspec

from automaton.build.capabilities import FleetOnFloor
from automaton.floor.dead_ends import dead_ends_of
from automaton.scenario.schema import Scenario

STEERS: Final = "pibt"
FOLLOWS_ROUTES: Final = "retreat"
DEFAULT_ROUTING: Final = "shortest"  # what it plans can be left out where robots are steered


def with_right_of_way(scenario: Scenario, fleet: FleetOnFloor) -> Scenario:
    """The scenario with its right of way named."""
    if scenario.strategy.right_of_way is not None:
        return scenario
    name = FOLLOWS_ROUTES if why_not_steered(scenario, fleet) else STEERS
    strategy = msgspec.structs.replace(scenario.strategy, right_of_way=name)
    return msgspec.structs.replace(scenario, strategy=strategy)


def why_not_steered(scenario: Scenario, fleet: FleetOnFloor) -> str:
    """Why robots follow routes unless right of way is named; "" where they are steered."""
    routing: Any = scenario.strategy.routing
    name = routing.get("name") if isinstance(routing, dict) else routing
    if name != DEFAULT_ROUTING:
        return f"routing {name} plans their routes"
    if scenario.information != "everything":
        return "robots do not see all others"
    if has_ringless_part(fleet):
        return "the floor has no ring on which they pass each other"
    return ""


def has_ringless_part(fleet: FleetOnFloor) -> bool:
    """Whether robots drive in a part of the floor without a ring of cells."""
    return bool((dead_ends_of(fleet.floor_plan).ringless & fleet.within.any(axis=0)).any())
