"""The parameters of right of way."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.carried_pods import carries_pods
from automaton.scenario.quantities import TIME, quantity
from automaton.scenario.robot_types import types_of
from automaton.scenario.schema import MAX_MOVE_TICKS, Scenario
from automaton.strategy.lookup import TAKES_SHORTEST_ROUTES, declares

MAX_GUIDED_SPEEDS = 7  # tables have a queue for 16 costs: two for each speed, and turns
MOST_TICKS: Final = 256  # each cell needs a word for each: 1 KiB at most
Moves = Annotated[int, Meta(ge=1, le=10_000)]
Wait = Annotated[int, quantity(TIME, ge=1, le=10_000)]
BOTH_INCLUDED = Meta(description="Range of random values: [from, to], both included.")
Span = Annotated[tuple[Wait, Wait], BOTH_INCLUDED]


class Waits(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How long a blocked robot waits, in ticks."""

    wait_empty: Span = (1, 5)
    wait_loaded: Span = (5, 10)

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            span = getattr(self, name)
            if isinstance(span, tuple) and span[0] > span[1]:
                raise ValueError(f"{name} must go from the smaller to the larger number")

    def check_scenario(self, scenario: Any, floor_plan: Any) -> str | None:
        """What is wrong: a wait that a refined tick makes too long."""
        longest = max(*self.wait_empty, *self.wait_loaded)
        if longest <= MAX_MOVE_TICKS:
            return None
        return f"its waits take {longest:,} ticks, at most {MAX_MOVE_TICKS:,} are allowed"


class RetreatParameters(Waits, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How long a blocked robot waits, and when and how far it retreats."""

    retries: Annotated[
        int, Meta(ge=1, le=254, description="Failed retries after which a robot may retreat.")
    ] = 1
    max_retries: Annotated[
        int, Meta(ge=1, le=254, description="Failed retries after which a robot always retreats.")
    ] = 2
    after_wait: Annotated[
        Literal["keep", "replan"],
        Meta(
            description="What a robot does that finds its next cell still occupied after a wait and "
            "does not retreat. keep: it keeps its plan; replan: it plans another route, and without a "
            "load it also chooses its order again (`go to 1` and `go to 12` of Grzejszczak and Nocon)."
        ),
    ] = "keep"
    retreat_moves: Annotated[tuple[Moves, Moves], BOTH_INCLUDED] = (1, 12)
    abort_wait: Span = (1, 5)  # ticks, when every way is closed
    idle_give_way: Annotated[
        bool, Meta(description="Whether idle robots make room for robots that need their cell.")
    ] = False

    def tuned_values(self, scenario: Any, floor_plan: Any) -> dict[str, tuple[Any, ...]]:
        """What is worth trying of each parameter."""
        return {}


class SteeringParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Of a right of way that says in each tick where robots go: it goes with no routes."""

    steers: ClassVar[bool] = True

    deadlock_patience: Annotated[
        int,
        quantity(
            TIME,
            ge=1,
            le=1_000_000,
            description="Age of a wait cycle, in ticks beyond the longest action of its robots, at "
            "which one of the robots steps aside.",
        ),
    ] = 64

    def check_scenario(self, scenario: Any, floor_plan: Any) -> str | None:
        """What these do not go with, or None."""
        if scenario.information == "orders":
            return (
                "robots make way for those that they see, and information orders shows them no further "
                "than their next cell: give a radius, or use retreat"
            )
        routing = scenario.strategy.routing
        name = routing if isinstance(routing, str) else routing.get("name")
        if declares("routing", name, TAKES_SHORTEST_ROUTES):
            return None
        return (
            f"it steers the robots, which follow no routes, so routing '{name}' would never be asked;"
            " leave strategy.routing out, or choose a right of way that follows routes: retreat (the "
            "default with such a routing), wait"
        )


class GuidedParameters(SteeringParameters, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Of a right of way whose robots can be guided by lattice weights."""

    guidance: Annotated[
        Literal["none", "lattice"],
        Meta(
            description="Guidance of routes. lattice: rows and columns are one-way streets in "
            "alternating directions, and a move against its street counts as three; its distance tables "
            "take up to world.distance_tables of additional memory. none: no guidance."
        ),
    ] = "none"

    def check_scenario(self, scenario: Any, floor_plan: Any) -> str | None:
        """What these do not go with, or None."""
        if self.guidance != "none":
            if carries_pods(scenario, floor_plan):
                return "its lattice weights know no storage; with pods, leave guidance out"
            if scenario.information != "everything":
                return "its lattice weights are for robots that see all others; leave guidance out"
            if len(np.unique(floor_plan.min_move_ticks)) > MAX_GUIDED_SPEEDS:
                return f"lattice weights go with {MAX_GUIDED_SPEEDS} speeds at most; leave guidance out"
        return super().check_scenario(scenario, floor_plan)

    def tuned_values(self, scenario: Any, floor_plan: Any) -> dict[str, tuple[Any, ...]]:
        """What is worth trying of each parameter."""
        pods = carries_pods(scenario, floor_plan)
        return {"guidance": ("none",) if pods else ("none", "lattice")}


class PibtParameters(GuidedParameters, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Whether robots that make way are guided."""


class EpibtParameters(GuidedParameters, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How far robots plan, which of them come first, and how much effort a tick may take."""

    depth: Annotated[
        int, Meta(ge=3, le=5, description="Number of actions that robots plan ahead.")
    ] = 3
    first: Annotated[
        Literal["nearest", "oldest"],
        Meta(
            description="Robots that plan first. nearest: robots closest to their goals, for "
            "throughput; oldest: robots whose last finished goal was longest ago, which lowers "
            "throughput and may stop a crowd. Robots on their way home always come last."
        ),
    ] = "nearest"
    repair_tries: Annotated[
        int, Meta(ge=0, le=100, description="Attempts per robot and tick to improve the plans.")
    ] = 0
    repair_pushes: Annotated[
        int,
        Meta(ge=1, le=1_000_000, description="Pushes after which such an attempt is abandoned."),
    ] = 100
    visits: Annotated[
        int,
        Meta(
            ge=1, le=100, description="Greatest number of times that a robot is pushed in a tick."
        ),
    ] = 10
    max_pushes: Annotated[
        int, Meta(ge=1, le=1_000_000, description="Pushes after which a robot keeps its plan.")
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


def horizon_of(depth: int, longest: int, wait: int = 1) -> int:
    """The ticks in which a plan is over that begins after the longest action.

    `wait`: ticks until robots are asked again, which is when they see what such an action has left.
    """
    return depth * longest + longest - wait


def capacity_objection(floor_plan: FloorPlan) -> str | None:
    """Return a sentence on the first cell that takes more than one robot, or None."""
    wrong = np.flatnonzero(floor_plan.drivable & (floor_plan.capacity != 1))
    if not len(wrong):
        return None
    x, y = floor_plan.xy(int(wrong[0]))
    capacity = int(floor_plan.capacity.reshape(-1)[wrong[0]])
    robots = f"{capacity} robots" if capacity else "any number of robots"
    return f"it plans on cells for one robot, found room for {robots} in ({x}, {y}); use pibt"
