"""The parameters of right of way. Imports no Numba."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from automaton.scenario.carried_pods import carries_pods
from automaton.scenario.quantities import TIME, quantity
from automaton.scenario.schema import MAX_MOVE_TICKS

MAX_GUIDED_SPEEDS = 7  # tables have a queue for 16 costs: two for each speed, and turns

Moves = Annotated[int, Meta(ge=1, le=10_000)]
Wait = Annotated[int, quantity(TIME, ge=1, le=10_000)]
BOTH_INCLUDED = Meta(description="[from, to], both included")
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
        int, Meta(ge=1, le=254, description="failed retries before it may retreat")
    ] = 1
    max_retries: Annotated[
        int, Meta(ge=1, le=254, description="failed retries after which it retreats in any case")
    ] = 2
    after_wait: Annotated[
        Literal["keep", "replan"],
        Meta(
            description="what a robot does that finds its next cell still held after a wait and does not "
            "retreat: keep its plan; or replan: without load it chooses again what to do, and it plans "
            "another route (`go to 1` and `go to 12` of Grzejszczak and Nocon)"
        ),
    ] = "keep"
    retreat_moves: Annotated[tuple[Moves, Moves], BOTH_INCLUDED] = (1, 12)
    abort_wait: Span = (1, 5)  # ticks, when every way is closed
    idle_give_way: Annotated[
        bool, Meta(description="idle robots make room for robots that want their cell")
    ] = False

    def tuned_values(self, scenario: Any, floor_plan: Any) -> dict[str, tuple[Any, ...]]:
        """What is worth trying of each parameter."""
        return {}


class SteeringParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Of a right of way that says in each tick where robots go: it goes with no routes."""

    deadlock_patience: Annotated[
        int,
        quantity(
            TIME,
            ge=1,
            le=1_000_000,
            description="ticks, beyond the longest action of its robots, after which one robot of a "
            "wait cycle steps aside",
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
        if name == "shortest":
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
            description="lattice: rows and columns are one-way streets by turns, and a move against "
            "its street counts as three; its distance tables take up to world.distance_tables of "
            "memory beside those of ticks"
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
