"""Define the orders of a scenario file: what is to be carried, and when it is released."""

from __future__ import annotations

import itertools
from typing import Annotated, Final, Literal

from msgspec import Meta, field

from automaton.floor.cells import DESTINATION, DOCK, RACK, SHELF, STATION
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.field_types import (
    ConfigSection,
    NonEmptyText,
    Pair,
    SingleLine,
    Tick,
    Ticks,
    Weight,
)

DRAWN = ("dock-to-rack", "stations", "visits")  # generators that draw so many orders
ENDS: Final = {  # generator: kinds of slots where its orders begin and end
    "full-shelves": (SHELF, DESTINATION),
    "picture-loads": (SHELF, DESTINATION),
    "dock-to-rack": (DOCK, RACK),
    "stations": (STATION, STATION),
    "visits": (STATION, STATION),
}


class Mean(ConfigSection, frozen=True, kw_only=True):
    """A whole number from 1 on, drawn geometrically: what is memoryless in ticks."""

    mean: Annotated[float, Meta(ge=1, le=1_000_000, description="Its mean.")]


class Bursts(ConfigSection, frozen=True, kw_only=True):
    """Orders are released several at a time, the first of them at once."""

    size: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | Mean,
        Meta(description="Orders of a burst: so many, or drawn with this mean."),
    ]
    every: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | Mean,
        Meta(description="Ticks from a burst to the next: so many, or drawn with this mean."),
    ]


class ClosedLoop(ConfigSection, frozen=True, kw_only=True):
    """A closed loop: in the tick after a delivery the next order is released."""

    in_system: Annotated[
        int, Meta(ge=1, le=1_000_000, description="Orders that are open, until they are used up.")
    ]


class Arrivals(ConfigSection, frozen=True, kw_only=True):
    """When orders are released, if neither all at once nor with an interval."""

    bursts: Bursts | None = None
    closed_loop: ClosedLoop | None = None
    file: Annotated[
        NonEmptyText | None,
        Meta(
            description="The orders themselves, as CSV with the columns tick, from_x, from_y, to_x, "
            "to_y and, where they differ in it, weight; path relative to the scenario."
        ),
    ] = None

    def __post_init__(self) -> None:
        if sum(form is not None for form in (self.bursts, self.closed_loop, self.file)) != 1:
            raise ValueError("arrivals must have exactly one of bursts, closed_loop or file")


class WeightRange(ConfigSection, frozen=True, kw_only=True):
    """Weights drawn evenly for each order."""

    least: Annotated[Weight, Meta(description="The lightest.")] = field(name="from")
    most: Annotated[Weight, Meta(description="The heaviest.")] = field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least}) must not be above to ({self.most})")


class OrderLine(ConfigSection, frozen=True, kw_only=True):
    """One order: bring a load from one slot to another."""

    source: Annotated[Pair, Meta(description="The slot with the load.")] = field(name="from")
    target: Annotated[Pair, Meta(description="Where to bring it; a station itself: a visit.")] = (
        field(name="to")
    )
    release: Annotated[Tick, Meta(description="The tick in which it is released.")] = 0
    weight: Weight = 1


StationNumber = Annotated[int, Meta(ge=1, le=100_000, description="A station, from 1.")]


class Parts(ConfigSection, frozen=True, kw_only=True):
    """Parts of one type: they are worked on at one station after another."""

    route: Annotated[
        tuple[StationNumber, ...],
        Meta(min_length=1, description="The stations that a part goes through, by number."),
    ]
    count: Annotated[int, Meta(ge=1, le=1_000_000, description="How many parts there are.")] = 1
    name: Annotated[SingleLine | None, Meta(description="What reports call them.")] = None
    first_release: Annotated[
        Tick, Meta(description="The tick in which the first part arrives at its first station.")
    ] = 0
    interarrival_time: Annotated[
        Annotated[int, Meta(ge=0, le=1_000_000)] | Mean,
        Meta(description="Ticks from a part to the next: so many, or drawn with this mean."),
    ] = 0
    weight: Weight = 1

    def __post_init__(self) -> None:
        for here, then in itertools.pairwise(self.route):
            if here == then:
                raise ValueError(
                    f"a route must lead from one station to another, not {here}, {here}"
                )


class RandomProcessingTime(ConfigSection, frozen=True, kw_only=True):
    """A processing time that is random for each part and each station of its route."""

    mean: Annotated[float, Meta(ge=1, le=10_000, description="Mean ticks.")]
    distribution: Annotated[
        Literal["exponential"],
        Meta(description="Memoryless, in whole ticks from 1 on: the geometric distribution."),
    ] = "exponential"


ProcessingTime = Ticks | RandomProcessingTime


class Orders(ConfigSection, frozen=True, kw_only=True):
    """What is to be carried: a generator of orders, a list or a file of them, or parts."""

    generator: Annotated[
        Literal["full-shelves", "picture-loads", "dock-to-rack", "stations", "visits"] | None,
        Meta(
            description="full-shelves: every shelf holds a load at the start; picture-loads: the "
            "shelves drawn as $ do. Each is brought to a destination drawn at random. "
            "dock-to-rack: so many loads wait at docks drawn at random, each for a rack drawn at "
            "random. stations: each load goes from a station to another one, both drawn at "
            "random. visits: stations drawn at random, where a robot has to come."
        ),
    ] = None
    count: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | None,
        Meta(description="How many orders there are, for generators that draw them."),
    ] = None
    mean_interarrival_time: Annotated[
        float,
        Meta(
            ge=0,
            le=1_000_000,
            description="Mean ticks between two orders: from the second tick on, one arrives in a "
            "tick with probability 1 / this, as Poisson arrivals in ticks. 0: all are known from "
            "the start.",
        ),
    ] = 0.0
    arrivals: Annotated[
        Arrivals | None, Meta(description="How they are released, or a file of orders.")
    ] = None
    weight: Annotated[
        Weight | WeightRange,
        Meta(description="Of the orders that generators make: all alike, or drawn {from, to}."),
    ] = 1
    listed: Annotated[tuple[OrderLine, ...] | None, Meta(description="The orders, one by one.")] = (
        field(name="list", default=None)
    )

    parts: Annotated[
        tuple[Parts, ...] | None,
        Meta(
            description="Parts that stations work on, one at a time, in the sequence of their "
            "coming. Each way from a station to the next one is an order; it is released when "
            "the work at the first is done."
        ),
    ] = None
    processing_time: Annotated[
        ProcessingTime | tuple[ProcessingTime, ...],
        Meta(
            description="Ticks of a job, one part at one station: at all stations, or one by one."
        ),
    ] = 1

    def __post_init__(self) -> None:
        given = [self.generator, self.listed, self.parts, self.file]
        if sum(form is not None for form in given) != 1:
            raise ValueError(
                "orders must have either a generator, a list, parts or arrivals from a file"
            )
        if self.parts is not None and not self.parts:
            raise ValueError("parts must hold at least one type of parts")
        if self.parts is None and self.processing_time != 1:
            raise ValueError("processing_time belongs to parts")
        if self.generator is None and self.weight != 1:
            raise ValueError("weight belongs to generators, or to each order or type of parts")
        if self.listed is not None and not self.listed:
            raise ValueError("list must hold at least one order")
        if self.generator in DRAWN and self.count is None:
            raise ValueError(f"the generator {self.generator} needs a count of orders")
        if self.generator not in DRAWN and self.count is not None:
            raise ValueError(f"count belongs to the generators {', '.join(DRAWN)}")
        self._check_arrivals()

    def _check_arrivals(self) -> None:
        if self.generator is None and self.mean_interarrival_time:
            raise ValueError("mean_interarrival_time belongs to generators of orders")
        if self.generator is None and self.arrivals is not None and self.file is None:
            raise ValueError("arrivals belong to generators of orders, unless they are a file")
        if self.mean_interarrival_time and self.arrivals is not None:
            raise ValueError("set either mean_interarrival_time or arrivals, not both")
        if 0 < self.mean_interarrival_time < 1:
            raise ValueError(
                "mean_interarrival_time must be 0 or at least 1: at most one order arrives per tick"
            )

    @property
    def file(self) -> str | None:
        """The file of orders, as the scenario names it."""
        return None if self.arrivals is None else self.arrivals.file

    @property
    def in_system(self) -> int:
        """Orders that a closed loop keeps open; 0: it is none."""
        loop = None if self.arrivals is None else self.arrivals.closed_loop
        return 0 if loop is None else loop.in_system


def kinds_of_sources(orders: Orders, floor_plan: FloorPlan) -> set[int]:
    """Return the kinds of slots where orders begin."""
    found = {
        int(floor_plan.kind.flat[floor_plan.cell(*line.source)]) for line in orders.listed or ()
    }
    if orders.generator is not None:
        found.add(ENDS[orders.generator][0])
    return found | ({STATION} if orders.parts is not None else set())
