"""The table of built-in strategies: name, implementation, parameters. Imports no Numba."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from msgspec import Meta

from automaton.scenario.abilities import sources
from automaton.scenario.schema import Scenario
from automaton.strategy.entry import (
    DYNAMIC,
    MANUFACTURING,
    MULTIPLE,
    PROPERTIES,
    WAREHOUSE,
    Entry,
    NoParameters,
)
from automaton.world.cells import CELL_KINDS
from automaton.world.floor_plan import FloorPlan
from strategies.allocation.parameters import Auctions, ShortestJob
from strategies.charging.parameters import FillUp, Insertion, Opportunity, Threshold
from strategies.zoning.parameters import Annealing, Decentralized, Genetic, Monitoring

if TYPE_CHECKING:
    from automaton.scenario.resolve import Resolved

Span = Annotated[
    tuple[Annotated[int, Meta(ge=1, le=10_000)], Annotated[int, Meta(ge=1, le=10_000)]],
    Meta(description="[from, to], both included"),
]


class Waits(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How long a blocked robot waits, in ticks."""

    wait_empty: Span = (1, 5)
    wait_loaded: Span = (5, 10)

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            span = getattr(self, name)
            if isinstance(span, tuple) and span[0] > span[1]:
                raise ValueError(f"{name} must go from the smaller to the larger number")


class RetreatParameters(Waits, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How long a blocked robot waits, and when and how far it retreats."""

    retries: Annotated[
        int, Meta(ge=1, le=254, description="failed retries before it may retreat")
    ] = 1
    max_retries: Annotated[
        int, Meta(ge=1, le=254, description="failed retries after which it retreats in any case")
    ] = 2
    retreat_moves: Span = (1, 12)
    abort_wait: Span = (1, 5)  # ticks, when every way is closed
    idle_give_way: Annotated[
        bool, Meta(description="idle robots make room for robots that want their cell")
    ] = False


class Alleys(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """No parameters; but loads are looked for on shelves alone."""

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Loads at docks and stations belong to no alley: no robot would ever fetch them."""
        begun = sources(scenario, floor_plan)
        names = [
            f"{robot_type.name}s"
            for robot_type in CELL_KINDS
            if robot_type.is_source and robot_type.code in begun
        ]
        if not names:
            return None
        places = " and ".join(names)
        return (
            f"it finds loads on shelves alone, and orders begin at {places}; first-come takes those"
        )


class TieBreaking(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Which of several paths of equal cost A* returns."""

    tie_break: Annotated[
        Literal["fifo", "larger_g", "random"],
        Meta(
            description="Of cells with the same estimate it expands first the one found first "
            "(fifo), the one "
            "farthest from the start (larger_g), or a random one, by seed and leg (random)."
        ),
    ] = "larger_g"


Share = Annotated[float, Meta(gt=0, le=1)]


class NetworkFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """A network of one's own."""

    network: Annotated[
        str,
        Meta(
            min_length=1,
            description="A file written by `automaton train traffic`, found from the scenario's folder.",
        ),
    ]


class Avoidance(TieBreaking, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """What is predicted of other robots, and how many of them in a zone are too many."""

    predictor: Annotated[
        Literal["exact", "noisy", "network"] | NetworkFile,
        Meta(
            description="exact: the zones on the others' A* paths; noisy: some of them missed and "
            "others added, by precision and recall; network: what a trained network says, the "
            "shipped one, for warehouse-100, or that of a file."
        ),
    ] = "exact"
    precision: Annotated[
        Share | None, Meta(description="noisy: the share of the predicted zones that are right.")
    ] = None
    recall: Annotated[
        Share | None, Meta(description="noisy: the share of the used zones that are predicted.")
    ] = None
    prevalence: Annotated[
        Annotated[float, Meta(gt=0, lt=1)] | None,
        Meta(
            description="noisy: the share of all zones that a task uses on average; on it depends "
            "how many others are predicted. Left out: as in warehouse-100, 27.5 of 522."
        ),
    ] = None
    max_threshold: Annotated[
        int, Meta(ge=1, le=1000, description="Zones with A others are closed, A = 1 to this.")
    ] = 6

    def __post_init__(self) -> None:
        given = [value is not None for value in (self.precision, self.recall)]
        if self.predictor == "noisy" and not all(given):
            raise ValueError("predictor: noisy needs precision and recall")
        if self.predictor != "noisy" and (any(given) or self.prevalence is not None):
            raise ValueError("precision, recall and prevalence are for predictor: noisy only")

    @property
    def files(self) -> tuple[Path, ...]:
        """The file of a network of one's own."""
        return (Path(self.predictor.network),) if isinstance(self.predictor, NetworkFile) else ()

    @property
    def network(self) -> Path:
        """The file of the network that is installed, or of one's own."""
        from automaton.strategy.network import shipped

        return shipped("warehouse-100") if self.predictor == "network" else self.files[0]

    def check_files(self, resolved: Resolved) -> None:
        """Raises InputError for a network that cannot be read, or is one of another floor."""
        from automaton.strategy.network import network_for, whole_layers
        from automaton.world.floor import floor_for
        from automaton.world.rules import rules_for
        from automaton.world.types import types_of

        if self.predictor in ("exact", "noisy"):
            return
        scenario = resolved.scenario
        kinematics, durations = scenario.fleet.kinematics, scenario.durations
        driving = (kinematics, durations.move, durations.turn, scenario.world.traffic_zones)
        grid = floor_for(resolved.floor_plan, *driving, types_of(scenario)).grid
        duration = rules_for(scenario, scenario.seed).duration[0]
        whole_layers(network_for(grid, duration, self.network))

    def resolve_paths(self, folder: Path) -> Avoidance:
        """The same with that file found from a folder."""
        for file in self.files:
            found = os.path.abspath(folder / file)
            return msgspec.structs.replace(self, predictor=NetworkFile(network=found))
        return self


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
        Meta(ge=0, le=1_000_000, description="ticks after which all robots plan again; 0 never"),
    ] = 20
    horizon: Annotated[
        int, Meta(ge=1, le=10_000, description="ticks for which traffic is predicted")
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
        """The plans are kept in memory, 16 bytes for each robot and tick."""
        robots = scenario.fleet.robots
        if robots * self.horizon <= MOST_PLANNED:
            return None
        return (
            f"{robots:,} plans of {self.horizon:,} ticks do not fit into memory: robots x horizon may "
            f"be {MOST_PLANNED:,}, so with this fleet horizon at most {MOST_PLANNED // robots}"
        )


MOST_PLANNED = 100_000_000  # robots x ticks of the plans that `congestion` keeps: 1.6 GB


CATALOGUE: dict[str, dict[str, Entry]] = {
    "zoning": {
        "static": Entry(
            "strategies.zoning.repairing:StaticZones",
            Monitoring,
            "zones that stay; out of balance, robots share orders",
        ),
        "annealing": Entry(
            "strategies.zoning.repairing:AnnealedZones",
            Annealing,
            "zones redesigned by simulated annealing (Ho & Liao; Keith & La)",
            (DYNAMIC, MANUFACTURING),
        ),
        "genetic": Entry(
            "strategies.zoning.repairing:BredZones",
            Genetic,
            "zones redesigned by a genetic algorithm (Keith & La)",
            (MULTIPLE, DYNAMIC, MANUFACTURING, WAREHOUSE),
        ),
        "decentralized": Entry(
            "strategies.zoning.decentralized:DecentralizedZones",
            Decentralized,
            "robots in range of each other negotiate their zones (DDZ; Keith & La)",
            PROPERTIES,
        ),
    },
    "charging": {
        "insertion": Entry(
            "strategies.charging.quoted:InsertCharging",
            Insertion,
            "optimal insertion: the charger, place in the list and time that cost least (De Ryck)",
        ),
        "threshold": Entry(
            "strategies.charging.quoted:ThresholdCharging",
            Threshold,
            "threshold-100: below 20 % to the nearest charger, until it is full (De Ryck)",
        ),
        "fill-up": Entry(
            "strategies.charging.quoted:FillUpCharging",
            FillUp,
            "as insertion, but charge up to a target where the list needs a charger",
        ),
        "opportunity": Entry(
            "strategies.charging.quoted:OpportunityCharging",
            Opportunity,
            "idle robots charge at free chargers, and leave for orders that they can finish",
        ),
    },
    "allocation": {
        "independent": Entry(
            "strategies.allocation.independent:Independent",
            NoParameters,
            "nearest unreserved order, carried to its destination (Grzejszczak & Nocon, alg. 1)",
        ),
        "cooperative": Entry(
            "strategies.allocation.cooperative:Cooperative",
            Alleys,
            "bucket brigade: loads are passed from table to table (Grzejszczak & Nocon, alg. 2)",
        ),
        "adaptive": Entry(
            "strategies.allocation.adaptive:Adaptive",
            Alleys,
            "each robot carries or passes a load, whichever costs less by its own experience",
        ),
        "first-come": Entry(
            "strategies.allocation.first_come:FirstCome",
            NoParameters,
            "oldest unreserved order, carried to its destination",
        ),
        "shortest-job": Entry(
            "strategies.allocation.shortest_job:ShortestJob",
            ShortestJob,
            "shortest job first with aging, in the robot's zone if there are zones (Keith & La)",
        ),
        "auction": Entry(
            "strategies.allocation.auction:Auction",
            Auctions,
            "auctions with charging in the bids: sequential, parallel, combinatorial, ... (De Ryck)",
        ),
        "independent-python": Entry(
            "strategies.allocation.independent_python:IndependentPython",
            NoParameters,
            "the tutorial: 'independent' in plain Python, equal digests",
        ),
    },
    "routing": {
        "shortest": Entry(
            "strategies.routing.shortest:Shortest",
            NoParameters,
            "the path of least ticks, turns included",
        ),
        "astar": Entry(
            "strategies.routing.astar:AStar",
            TieBreaking,
            "A*: a path of fewest ticks, one of several by a tie-breaking rule",
        ),
        "traffic-avoidance": Entry(
            "strategies.routing.traffic_avoidance:TrafficAvoidance",
            Avoidance,
            "A* around zones where many robots are predicted (Shaji Bhattathiri, Li & Kuhl)",
        ),
        "congestion": Entry(
            "strategies.routing.congestion:Congestion",
            SharedPlans,
            "around the traffic predicted from all robots' plans, zone by zone and tick by tick",
        ),
    },
    "right_of_way": {
        "retreat": Entry(
            "strategies.right_of_way.withdraw:Withdraw",
            RetreatParameters,
            "wait, retry, then retreat by a random number of moves (Grzejszczak & Nocon)",
        ),
        "wait": Entry(
            "strategies.right_of_way.wait:Wait",
            Waits,
            "wait and retry for ever: shows which deadlocks a floor has",
        ),
    },
}
