"""The parameters of allocations, and why they refuse scenarios."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from automaton.floor.floor_plan import ANY_LOADS, CELL_KINDS, FloorPlan
from automaton.scenario.order_lines import carries_pods, has_tours, kinds_of_sources, priorities_of
from automaton.scenario.quantities import CELLS, MOMENT, TIME, quantity
from automaton.scenario.schema import Scenario

DEFAULT_LIST_LENGTH = 8  # orders in a robot's list; fewer in a large fleet
MAX_LISTED_ORDERS = 1000  # orders in all lists together: bounds the memory of a market
MAX_BUNDLING_ROBOTS = 16  # robots for which all bundles are tried
Storage = Annotated[
    Literal["fixed", "nearest", "class", "random"],
    Meta(
        description="Storage cell of a pod after its trip. fixed: its initial cell; nearest: the "
        "nearest free cell; class: the nearest free cell of its class (pods.classes); random: any "
        "free cell."
    ),
]
Ticks = Annotated[int, quantity(TIME, ge=1, le=1_000_000)]
Tick = Annotated[int, quantity(MOMENT, ge=1, le=2_000_000_000)]
Fraction = Annotated[float, Meta(ge=0, le=1)]


def refusal_of_pods(scenario: Scenario, floor_plan: FloorPlan) -> str | None:
    """Return why a strategy that brings loads to targets cannot run this scenario, or None."""
    if not carries_pods(scenario, floor_plan):
        return None
    return (
        "it does not support pods, which go to stations and back into storage; use shortest-job, "
        "first-come, independent or greedy"
    )


def refusal_of_tours(scenario: Scenario, floor_plan: FloorPlan) -> str | None:
    """Return why an allocation that prices only loads cannot run this scenario, or None."""
    if carries_pods(scenario, floor_plan):
        return refusal_of_pods(scenario, floor_plan)
    if not has_tours(scenario.orders):
        return None
    return "it supports only orders with a load, but some have stops; use greedy or first-come"


def refusal_of_own_orders(scenario: Scenario) -> str | None:
    """Return why an allocation that gives any order to any robot cannot run this scenario, or None."""
    if scenario.orders.assign != "round-robin":
        return None
    return "it gives any order to any robot, but orders.assign is round-robin; use greedy"


def refusal_of_priorities(scenario: Scenario) -> str | None:
    """Return why an allocation that ignores priorities cannot run this scenario, or None."""
    if len(priorities_of(scenario.orders)) == 1:
        return None
    return "it ignores priorities, but some orders have one; use greedy or first-come"


def tuned_storage(scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
    """Return the storage policies to try in tuning; none without pods."""
    return {"storage": ("fixed", "nearest")} if carries_pods(scenario, floor_plan) else {}


class Storing(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The storage policy of pods."""

    storage: Storage = "fixed"


class IndependentParameters(Storing, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """No further parameters."""

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """Return the values of each parameter to try in tuning."""
        return tuned_storage(scenario, floor_plan)


class FirstComeParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The order of the orders; it supports no pre-assigned orders."""

    by: Annotated[
        Literal["arrival", "due"],
        Meta(
            description="Rule of choice. arrival: the order that was released first; due: the "
            "order that is due first; orders without a due time come last, and ties go by "
            "release."
        ),
    ] = "arrival"
    storage: Storage = "fixed"

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Refuse pre-assigned orders, since one cursor serves all robots of a type."""
        return refusal_of_own_orders(scenario)

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """Return the values of each parameter to try in tuning."""
        return tuned_storage(scenario, floor_plan)


class Alleys(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """No parameters; loads must be on shelves."""

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Refuse loads at docks and stations: they belong to no alley, so no robot would fetch them.

        An alley is the column from which its loads are picked up.
        """
        if scenario.world.access_cell != "fixed":
            return "its alleys are where loads are picked up; it needs world.access_cell: fixed"
        if refusal := refusal_of_tours(scenario, floor_plan) or refusal_of_priorities(scenario):
            return refusal
        begun = kinds_of_sources(scenario.orders, floor_plan)
        names = [
            f"{kind.name}s" for kind in CELL_KINDS if kind.holds == ANY_LOADS and kind.code in begun
        ]
        if not names:
            return None
        places = " and ".join(names)
        return f"it finds loads only on shelves, but orders begin at {places}; use first-come"

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """Return the values of each parameter to try in tuning."""
        return {}


class ShortestJobParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The weights of a score: age * (waiting time) - job * (duration), also per order line."""

    age: Annotated[float, Meta(ge=0, le=1000, description="C_A: weight of the waiting time.")] = 0.5
    job: Annotated[float, Meta(ge=0, le=1000, description="C_D: weight of the driving time.")] = (
        10.0
    )
    per_line: Annotated[
        bool,
        Meta(
            description="Whether the driving time of a trip of a pod is divided by the number of its "
            "order lines, so that pods with many open lines at their stations come first."
        ),
    ] = False
    idle: Annotated[
        Literal["park", "stay"], Meta(description="Behavior of robots without an order.")
    ] = "park"
    storage: Storage = "fixed"

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Refuse pre-assigned orders, since the rule of the score is the same for all robots."""
        return refusal_of_own_orders(scenario)

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """Return the values of each parameter to try in tuning."""
        per_line = {"per_line": (False, True)} if scenario.orders.lines is not None else {}
        return {**tuned_storage(scenario, floor_plan), **per_line}


class GreedyParameters(Storing, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The cost of pairs of robots and orders, and when pairs may be rematched."""

    rest: Annotated[
        float,
        Meta(
            ge=0,
            le=100,
            description="Weight of the drive from the first to the last stop of an order, relative to "
            "the drive to its first stop; above 0, short orders come first.",
        ),
    ] = 0.0
    reassign: Annotated[
        Ticks | None,
        Meta(
            description="Ticks between two reassignments of the orders that no robot has begun and that "
            "have no load, among the robots that have such an order or none. null: a robot "
            "keeps its order."
        ),
    ] = None
    active: Annotated[
        Annotated[int, Meta(ge=1)] | None,
        Meta(description="Greatest number of robots with an order at a time; null: no limit."),
    ] = None
    idle: Annotated[
        Literal["park", "stay"],
        Meta(
            description="Behavior of robots without an order. park: they drive home; stay: they "
            "stay where they are. Robots that get no order because of `active` always stay."
        ),
    ] = "park"

    def tuned_values(self, scenario: Scenario, floor_plan: FloorPlan) -> dict[str, tuple[Any, ...]]:
        """Return the values of each parameter to try in tuning."""
        return {"rest": (0.0, 1.0), **tuned_storage(scenario, floor_plan)}


class EpsilonSchedule(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """An epsilon that changes linearly from one value to another."""

    first: Annotated[Fraction, Meta(description="epsilon at the start")] = msgspec.field(
        name="from"
    )
    last: Annotated[Fraction, Meta(description="epsilon from tick `until` on")] = msgspec.field(
        name="to"
    )
    until: Annotated[Tick, Meta(description="tick from which it is constant")]


class Auctions(Storing, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The mechanism, bids and auctioneers of an auction."""

    mechanism: Annotated[
        Literal[
            "sequential", "arrival", "parallel", "combinatorial", "genetic", "exact", "assignment"
        ],
        Meta(
            description="Auction mechanism. sequential: orders are sold one by one, and the "
            "winner bids again; arrival: each order goes to the lowest bid, in the sequence of "
            "arrival; parallel: all orders are sold at once; combinatorial: bids on bundles of "
            "the ten oldest orders; genetic: the genetic algorithm of the paper, for the twelve "
            "oldest orders; exact: the optimum of the paper, for the ten oldest orders and fleets "
            "without batteries; assignment: one order for each robot."
        ),
    ] = "sequential"
    bid_rule: Annotated[
        Literal["mixed", "average", "average-paper"],
        Meta(
            description="Value of a bid. mixed: epsilon x MiniSum + (1 - epsilon) x MiniMax; average: "
            "the increase of the sum of arrival times; average-paper: the mean arrival time."
        ),
    ] = "mixed"
    epsilon: Annotated[
        Fraction | EpsilonSchedule | Literal["load"],
        Meta(
            description="Weight of MiniSum (1) against MiniMax (0). {from, to, until}: a weight "
            "that changes linearly until a tick; load: a weight that rises towards 1 with the "
            "number of waiting orders per robot."
        ),
    ] = 0.5
    winner_rule: Annotated[
        Literal["lowest", "difference", "fewest", "regret"],
        Meta(
            description="Order that a sequential auction sells next. lowest: lowest bid (LB); "
            "difference: largest difference of highest and lowest bid (BD); fewest: fewest "
            "bidders (FB); regret: largest difference of second lowest and lowest bid."
        ),
    ] = "lowest"
    local_search: Annotated[
        bool, Meta(description="Whether a local search over all lists follows each auction.")
    ] = False
    max_orders_per_robot: Annotated[
        int, Meta(ge=1, le=64, description="Greatest number of orders in the list of a robot.")
    ] = DEFAULT_LIST_LENGTH
    max_items: Annotated[
        int, Meta(ge=1, le=1000, description="Greatest number of orders in an auction.")
    ] = 100
    auctioneer: Annotated[
        Literal["central", "fixed", "time", "token"],
        Meta(
            description="Auctioneer. central: one auctioneer for all robots; fixed: `auctioneers` "
            "robots, each of which sells the orders nearest to it; time: one robot at a time, for "
            "`auctioneer_term` ticks; token: one robot at a time, for one auction."
        ),
    ] = "central"
    auctioneers: Annotated[
        int, Meta(ge=1, le=1000, description="Number of auctioneers, for auctioneer: fixed.")
    ] = 2
    auctioneer_term: Annotated[
        int,
        quantity(
            TIME,
            ge=1,
            le=1_000_000,
            description="Term of an auctioneer in ticks, for auctioneer: time.",
        ),
    ] = 100
    region: Annotated[
        Literal["auctioneer", "order"],
        Meta(
            description="Centre of the announcement radius. auctioneer: robots around the "
            "auctioneer may bid; order: robots around the order may bid."
        ),
    ] = "auctioneer"
    announcement_radius: Annotated[
        Annotated[int, quantity(CELLS, ge=1, le=100_000)] | None,
        Meta(
            description="Radius of announcements in cells, doubled while no robot bids; null: orders "
            "are announced to all robots."
        ),
    ] = None
    reauction_after: Annotated[
        Annotated[int, quantity(TIME, ge=0, le=1_000_000)] | None,
        Meta(
            description="Greatest delay, in ticks, with which a robot may finish its list of orders; a "
            "robot that expects a longer delay returns its list. null: no list is returned."
        ),
    ] = None
    while_charging: Annotated[
        Literal["release", "keep"],
        Meta(
            description="What happens to the orders of a robot that charges, queues for a charger, or is "
            "about to. release: the robot returns them as soon as another robot has no order "
            "left; keep: it keeps them."
        ),
    ] = "release"

    def __post_init__(self) -> None:
        asked_for = {
            "auctioneers is for auctioneer: fixed": self.auctioneers != 2
            and self.auctioneer != "fixed",
            "auctioneer_term is for auctioneer: time": self.auctioneer_term != 100
            and self.auctioneer != "time",
            "winner_rule is for mechanism: sequential": self.winner_rule != "lowest"
            and self.mechanism != "sequential",
            "region: order needs an announcement_radius": self.region == "order"
            and self.announcement_radius is None,
            "announcement_radius needs region: order, or another auctioneer": self.announcement_radius
            is not None
            and self.region == "auctioneer"
            and self.auctioneer == "central",
        }
        for sentence, wrong in asked_for.items():
            if wrong:
                raise ValueError(sentence)

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Refuse sizes that are too large; the optimum supports only small fleets without charging."""
        refusal = (
            None if scenario.orders.lines is not None else refusal_of_tours(scenario, floor_plan)
        )
        if refusal := refusal or refusal_of_priorities(scenario):
            return refusal
        robots = scenario.fleet.robots
        if scenario.information != "everything":
            return (
                "an auction needs information: everything; its own announcement_radius and region "
                "limit which robots may bid"
            )
        if robots > MAX_LISTED_ORDERS or (
            robots * self.max_orders_per_robot > MAX_LISTED_ORDERS
            and self.max_orders_per_robot > DEFAULT_LIST_LENGTH
        ):
            return (
                f"{robots:,} lists of {self.max_orders_per_robot} orders are too many for one "
                "market: robots x max_orders_per_robot "
                f"may be {MAX_LISTED_ORDERS:,}"
            )
        if self.auctioneer == "fixed" and self.auctioneers > robots:
            return f"auctioneers is {self.auctioneers}, and fleet.robots is {robots}"
        if self.mechanism == "exact" and scenario.battery is not None:
            return (
                "the mechanism exact ignores charging; use combinatorial, or leave out the battery"
            )
        if self.mechanism in ("exact", "combinatorial") and robots > MAX_BUNDLING_ROBOTS:
            return (
                f"the mechanism {self.mechanism} tries all ways to split orders among at most "
                f"{MAX_BUNDLING_ROBOTS} robots, and fleet.robots is {robots}"
            )
        return None
