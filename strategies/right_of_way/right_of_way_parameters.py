"""The parameters of right of way."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.order_lines import carries_pods
from automaton.scenario.quantities import TIME, quantity
from automaton.scenario.robot_types import types_of
from automaton.scenario.schema import MAX_MOVE_TICKS, Scenario
from automaton.strategy.lookup import TAKES_SHORTEST_ROUTES, declares

MAX_GUIDED_SPEEDS = 7  # a table has 16 queues, one per cost: two for each speed, and one for turns
MOST_TICKS: Final = 256  # each cell needs a word per tick: at most 1 KiB
Moves = Annotated[int, Meta(ge=1, le=10_000)]
Wait = Annotated[int, quantity(TIME, ge=1, le=10_000)]
Ticks = Annotated[int, quantity(TIME, ge=1, le=1_000_000)]
Span = tuple[Wait, Wait]


def random_ticks(clause: str) -> Any:
    """The meaning of a parameter: a range of random ticks, and what happens for so long."""
    return Meta(description=f"Ticks that {clause}: random, [from, to], both included.")


class Waits(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How long a blocked robot waits, in ticks."""

    wait_empty: Annotated[Span, random_ticks("a robot without a load waits to retry")] = (1, 5)
    wait_loaded: Annotated[Span, random_ticks("a robot with a load waits to retry")] = (5, 10)

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            span = getattr(self, name)
            if isinstance(span, tuple) and span[0] > span[1]:
                raise ValueError(f"{name} must be [smaller, larger]")

    def check_scenario(self, scenario: Any, floor_plan: Any) -> str | None:
        """Return an error if a refined tick makes a wait too long, else None."""
        longest = max(*self.wait_empty, *self.wait_loaded)
        if longest <= MAX_MOVE_TICKS:
            return None
        return f"its waits take up to {longest:,} ticks; at most {MAX_MOVE_TICKS:,} are allowed"


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
            description="Reaction of a robot whose next cell is still occupied after a wait, if it does "
            "not retreat. keep: it keeps its plan; replan: it plans another route, and without a "
            "load it also chooses its order again (`go to 1` and `go to 12` of Grzejszczak and Nocon)."
        ),
    ] = "keep"
    retreat_moves: Annotated[
        tuple[Moves, Moves],
        Meta(description="Number of moves of a retreat: random, [from, to], both included."),
    ] = (1, 12)
    abort_wait: Annotated[Span, random_ticks("a robot waits if no retreat is possible")] = (1, 5)
    idle_give_way: Annotated[
        bool, Meta(description="Whether idle robots make room for robots that need their cell.")
    ] = False

    def tuned_values(self, scenario: Any, floor_plan: Any) -> dict[str, tuple[Any, ...]]:
        """Return the values of each parameter to try in tuning."""
        return {}


class SteeringParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The parameters of a right of way that steers robots in each tick and uses no routes."""

    steers: ClassVar[bool] = True

    deadlock_patience: Annotated[
        int,
        quantity(
            TIME,
            ge=1,
            le=1_000_000,
            description="Ticks before a wait cycle is broken: once the cycle has lasted for the longest "
            "action of its robots plus this many ticks, one robot steps aside.",
        ),
    ] = 64

    def check_scenario(self, scenario: Any, floor_plan: Any) -> str | None:
        """Return a conflict with the scenario, or None."""
        if scenario.information == "orders":
            return (
                "robots make way for robots that they see, but with information: orders they see only "
                "their next cell; set a radius, or use retreat"
            )
        routing = scenario.strategy.routing
        name = routing if isinstance(routing, str) else routing.get("name")
        if declares("routing", name, TAKES_SHORTEST_ROUTES):
            return None
        return (
            f"it steers the robots and uses no routes, so routing '{name}' would have no effect;"
            " leave strategy.routing out, or choose a right of way that follows routes: retreat (the "
            "default with such a routing) or wait"
        )


class GuidedParameters(SteeringParameters, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The parameters of a right of way with optional lattice weights."""

    guidance: Annotated[
        Literal["none", "lattice"],
        Meta(
            description="Guidance of routes. lattice: rows and columns are streets with alternating "
            "directions, and a move against its street costs as much as three moves; the distance "
            "tables need additional memory, at most world.distance_tables. none: no guidance."
        ),
    ] = "none"

    def check_scenario(self, scenario: Any, floor_plan: Any) -> str | None:
        """Return a conflict with the scenario, or None."""
        if self.guidance != "none":
            if len(floor_plan.move_weights):
                return "its lattice weights would replace those of streets; leave guidance out"
            if carries_pods(scenario, floor_plan):
                return "its lattice weights do not support storage; with pods, leave guidance out"
            if scenario.information != "everything":
                return "its lattice weights need information: everything; leave guidance out"
        return super().check_scenario(scenario, floor_plan)

    def tuned_values(self, scenario: Any, floor_plan: Any) -> dict[str, tuple[Any, ...]]:
        """Return the values of each parameter to try in tuning."""
        pods = carries_pods(scenario, floor_plan)
        return {"guidance": ("none",) if pods else ("none", "lattice")}


class PibtParameters(GuidedParameters, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Whether robots that make way are guided, and which of several equal steps they prefer."""

    admits_one: ClassVar[bool] = True  # to each dead end

    ties: Annotated[
        Literal["hash", "fixed"],
        Meta(
            description="Choice among steps of equal cost; straight on always comes first. hash: random "
            "for each robot and tick; fixed: west, east, south, north, which lets flows form. "
            "On dense floors the choice changes throughput by up to 5 % either way "
            "(`automaton reproduce guidance`)."
        ),
    ] = "hash"


class EpibtParameters(GuidedParameters, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The planning depth, the order of robots, and the effort per tick."""

    depth: Annotated[
        int, Meta(ge=3, le=5, description="Number of actions that robots plan ahead.")
    ] = 3
    first: Annotated[
        Literal["nearest", "oldest", "shortest"],
        Meta(
            description="Robots that plan first. nearest: robots closest to their goals, for "
            "throughput; shortest: robots with the shortest way left to the end of their "
            "orders, including all stops; oldest: robots that finished their last goal "
            "longest ago, which lowers throughput and may block a crowd. Robots on their way "
            "home always come last."
        ),
    ] = "nearest"
    starved_after: Annotated[
        Ticks | None,
        Meta(
            description="Ticks after which a robot that has finished no goal plans before all "
            "others; of several such robots, the one that has waited longest plans first. "
            "null: never."
        ),
    ] = None
    drivers: Annotated[
        Annotated[int, Meta(ge=1)] | None,
        Meta(
            description="Number of robots that drive to their goals: those that plan first. The others "
            "only make room for them. null: all robots drive. If drivers is set, every move "
            "and turn must take one tick."
        ),
    ] = None
    repair_tries: Annotated[
        int, Meta(ge=0, le=100, description="Attempts per robot and tick to improve the plans.")
    ] = 0
    repair_pushes: Annotated[
        int, Meta(ge=1, le=1_000_000, description="Pushes after which an attempt to improve ends.")
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
        """Return a feature of this scenario that EPIBT does not support, or None."""
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
        if self.drivers is not None and max(move, turn) > 1:
            return (
                "with drivers every move and turn must take one tick, found durations.move "
                f"{move} and durations.turn {turn}; leave drivers out"
            )
        if scenario.information != "everything":
            return "it plans for all robots at once, so information must be everything"
        return capacity_objection(floor_plan) or super().check_scenario(scenario, floor_plan)

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """Return the values of each parameter to try in tuning."""
        return {**super().tuned_values(scenario, floor_plan), "repair_tries": (0, 1)}


def horizon_of(depth: int, longest: int, wait: int = 1) -> int:
    """The ticks until the end of a plan that begins after the longest action.

    `wait`: ticks until robots decide again and see the result of such an action.
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
