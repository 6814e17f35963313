"""The parameters of auctions. Imports no Numba."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.quantities import CELLS, MOMENT, TIME, quantity
from automaton.scenario.schema import Scenario
from strategies.allocation.load_parameters import (
    Storing,
    refusal_of_priorities,
    refusal_of_tours,
)

Tick = Annotated[int, quantity(MOMENT, ge=1, le=2_000_000_000)]
Fraction = Annotated[float, Meta(ge=0, le=1)]


class EpsilonSchedule(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """An epsilon that goes evenly from one value to another."""

    first: Annotated[Fraction, Meta(description="at the start")] = msgspec.field(name="from")
    last: Annotated[Fraction, Meta(description="from tick `until` on")] = msgspec.field(name="to")
    until: Annotated[Tick, Meta(description="tick from which it stays")]


DEFAULT_LIST_LENGTH = 8  # orders in a robot's list, unless the fleet is too large for so many
MAX_LISTED_ORDERS = 1000  # orders in all lists together: bounds the memory of a market


class Auctions(Storing, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How orders are auctioned among the robots, and by which auctioneers."""

    mechanism: Annotated[
        Literal[
            "sequential", "arrival", "parallel", "combinatorial", "genetic", "exact", "assignment"
        ],
        Meta(
            description="sequential: one by one, the winner bids again; arrival: each order to the "
            "lowest bid, in arrival order; parallel: all at once; combinatorial: bundles, small "
            "cases; "
            "genetic, exact: the benchmarks of the paper, exact without batteries and with the "
            "ten oldest orders; assignment: one order for each robot."
        ),
    ] = "sequential"
    bid_rule: Annotated[
        Literal["mixed", "average", "average-paper"],
        Meta(
            description="mixed: epsilon x MiniSum + (1 - epsilon) x MiniMax; average: what an order "
            "adds to the sum of arrival times; average-paper: the mean arrival time."
        ),
    ] = "mixed"
    epsilon: Annotated[
        Fraction | EpsilonSchedule | Literal["load"],
        Meta(
            description="1 is MiniSum, 0 MiniMax; {from, to, until} changes it with time; load: the "
            "more orders wait for each robot, the nearer to 1."
        ),
    ] = 0.5
    winner_rule: Annotated[
        Literal["lowest", "difference", "fewest", "regret"],
        Meta(
            description="sequential: which order is sold next: that of the lowest bid (LB), of the "
            "biggest difference (BD), with the fewest bidders (FB), or of the largest regret."
        ),
    ] = "lowest"
    local_search: Annotated[
        bool, Meta(description="local search over all lists after each auction")
    ] = False
    max_orders_per_robot: Annotated[
        int, Meta(ge=1, le=64, description="orders in a robot's list")
    ] = DEFAULT_LIST_LENGTH
    max_items: Annotated[int, Meta(ge=1, le=1000, description="orders in an auction")] = 100
    auctioneer: Annotated[
        Literal["central", "fixed", "time", "token"],
        Meta(
            description="central: one for all robots; fixed: `auctioneers` robots, each sells the "
            "orders nearest to it; time, token: one robot at a time, passed on after "
            "`auctioneer_term` ticks, "
            "or after each auction."
        ),
    ] = "central"
    auctioneers: Annotated[int, Meta(ge=1, le=1000, description="fixed: how many")] = 2
    auctioneer_term: Annotated[
        int, quantity(TIME, ge=1, le=1_000_000, description="time: ticks")
    ] = 100
    region: Annotated[
        Literal["auctioneer", "order"],
        Meta(
            description="which robots may bid: those around the auctioneer, or those around the "
            "order"
        ),
    ] = "auctioneer"
    announcement_radius: Annotated[
        Annotated[int, quantity(CELLS, ge=1, le=100_000)] | None,
        Meta(description="in cells; doubled while no robot bids; null: announced to all robots"),
    ] = None
    reauction_after: Annotated[
        Annotated[int, quantity(TIME, ge=0, le=1_000_000)] | None,
        Meta(description="a robot this many ticks late returns its list; null: never"),
    ] = None
    while_charging: Annotated[
        Literal["release", "keep"],
        Meta(
            description="release: a robot that is to charge, queues or charges returns its list "
            "as soon as another robot has no order left; keep: it keeps its list."
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
        """The optimum is known for small fleets alone, and without charging."""
        refusal = (
            None if scenario.orders.lines is not None else refusal_of_tours(scenario, floor_plan)
        )
        if refusal := refusal or refusal_of_priorities(scenario):
            return refusal
        robots = scenario.fleet.robots
        if scenario.information != "everything":
            return (
                "an auction needs information: everything; its own announcement_radius and "
                "region limit which robots "
                "may bid"
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


MAX_BUNDLING_ROBOTS = 16  # robots whose bundles are all tried
