"""The parameters of EPIBT. Imports no Numba."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.robot_types import types_of
from automaton.scenario.schema import Scenario
from strategies.right_of_way.epibt.horizon import MOST_TICKS, horizon_of
from strategies.right_of_way.right_of_way_parameters import GuidedParameters


class EpibtParameters(GuidedParameters, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How far robots plan, which of them come first, and how much effort a tick may take."""

    depth: Annotated[int, Meta(ge=3, le=5, description="actions that robots plan ahead")] = 3
    first: Annotated[
        Literal["nearest", "oldest"],
        Meta(
            description="nearest: robots that are closest to their goals come first, for throughput; "
            "oldest: robots whose last finished goal was longest ago; less gets done, and a crowd may "
            "come to a stop. Robots on their way home come last"
        ),
    ] = "nearest"
    repair_tries: Annotated[
        int,
        Meta(ge=0, le=100, description="tries in a tick, for each robot, to improve the plans"),
    ] = 0
    repair_pushes: Annotated[
        int, Meta(ge=1, le=1_000_000, description="pushes after which such a try is given up")
    ] = 100
    visits: Annotated[
        int,
        Meta(ge=1, le=100, description="how often a robot may be pushed in a tick"),
    ] = 10
    max_pushes: Annotated[
        int, Meta(ge=1, le=1_000_000, description="pushes after which a robot keeps its plan")
    ] = 100_000

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Return what this scenario asks for that EPIBT does not plan, or None."""
        types = types_of(scenario)
        limit = int(floor_plan.min_move_ticks.max(initial=0))
        move = max(limit, *(ticks for one in types for ticks in one.moves))
        turn = max(ticks for one in types for ticks in one.turns)
        others = [one for one in scenario.fleet.all_kinematics if one != "differential"]
        if others:
            return (
                "it plans for robots with kinematics differential, found "
                f"{' and '.join(others)}; use pibt"
            )
        if horizon_of(self.depth, max(move, turn)) > MOST_TICKS:
            return (
                f"it plans {MOST_TICKS} ticks at most, too few for depth {self.depth} with "
                f"durations.move {move} and durations.turn {turn}; use pibt, or longer ticks"
            )
        if scenario.information != "everything":
            return "it plans for all robots at once, so information must be everything"
        return capacity_objection(floor_plan) or super().check_scenario(scenario, floor_plan)

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """What is worth trying of each parameter."""
        return {**super().tuned_values(scenario, floor_plan), "repair_tries": (0, 1)}


def capacity_objection(floor_plan: FloorPlan) -> str | None:
    """Return a sentence on the first cell that takes more than one robot, or None."""
    wrong = np.flatnonzero(floor_plan.drivable & (floor_plan.capacity != 1))
    if not len(wrong):
        return None
    x, y = floor_plan.xy(int(wrong[0]))
    capacity = int(floor_plan.capacity.reshape(-1)[wrong[0]])
    robots = f"{capacity} robots" if capacity else "any number of robots"
    return f"it plans on cells for one robot, found room for {robots} in ({x}, {y}); use pibt"
