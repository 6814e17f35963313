"""The right of way of a scenario that names none: what serves its robots best, as strategies declare."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from automaton.floor.dead_ends import dead_ends_of
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.robot_types import types_of
from automaton.scenario.schema import Scenario
from automaton.strategy.entry import ROUTED, SLOW_STEERED, STEERED
from automaton.strategy.lookup import default_for, parameters_type
from automaton.world.capabilities import FleetOnFloor

DEFAULT_ROUTING: Final = "shortest"  # what it plans can be left out where robots are steered
TWO_WAY_SHARE: Final = 0.5  # of pairs of cells; in one-way aisles neither planner is always ahead


class Default(NamedTuple):
    """A right of way that was not named, and why it is not the usual one; "" where it is."""

    name: str
    why: str


def with_right_of_way(scenario: Scenario, fleet: FleetOnFloor) -> Scenario:
    """The scenario with its right of way named."""
    if scenario.strategy.right_of_way is not None:
        return scenario
    name = default_right_of_way(scenario, fleet).name
    strategy = msgspec.structs.replace(scenario.strategy, right_of_way=name)
    return msgspec.structs.replace(scenario, strategy=strategy)


def default_right_of_way(scenario: Scenario, fleet: FleetOnFloor) -> Default:
    """The right of way of this scenario unless it is named."""
    why_not = why_not_steered(scenario, fleet)
    if why_not:
        return Default(default_for("right_of_way", ROUTED), why_not)
    planner = default_for("right_of_way", SLOW_STEERED)
    parameters: Any = parameters_type("right_of_way", planner)()
    if (
        has_slow_actions(scenario, fleet.floor_plan)
        and not scenario.floor.has_gates  # before which plans of several ticks may jam: bad-day
        and two_way_share(fleet.floor_plan) >= TWO_WAY_SHARE
        and parameters.check_scenario(scenario, fleet.floor_plan) is None
    ):
        why = "turns or moves take several ticks, and most ways are open in both directions"
        return Default(planner, why)
    return Default(default_for("right_of_way", STEERED), "")


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


def has_slow_actions(scenario: Scenario, floor_plan: FloorPlan) -> bool:
    """Whether a turn or a move takes 2 ticks or more, speed limits included."""
    types = types_of(scenario)
    longest = max(ticks for one in types for ticks in (*one.moves, *one.turns))
    return max(longest, int(floor_plan.min_move_ticks.max(initial=0))) > 1


def two_way_share(floor_plan: FloorPlan) -> float:
    """The share of pairs of neighbouring cells with a way between them that have one both ways."""
    exits = floor_plan.exits.reshape(-1)
    one_way = both_ways = 0
    for direction, offset in enumerate(floor_plan.offsets[:2]):
        there = exits >> direction & 1
        back = np.roll(exits, -offset) >> (direction ^ 2) & 1
        both_ways += int((there & back).sum())
        one_way += int((there ^ back).sum())
    return both_ways / max(1, both_ways + one_way)


def has_ringless_part(fleet: FleetOnFloor) -> bool:
    """Whether robots drive in a part of the floor without a ring of cells."""
    return bool((dead_ends_of(fleet.floor_plan).ringless & fleet.within.any(axis=0)).any())
