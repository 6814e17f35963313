"""Orders of a file, each of which brings a load from one place to another."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Final, Literal, overload

import msgspec
import numpy as np
from msgspec import Meta, field
from numpy.typing import NDArray

from automaton.floor.cells import DESTINATION, DOCK, RACK, SHELF, STATION
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.order_fields import (
    NO_DUE,
    NOTHING,
    Column,
    ColumnNames,
    DueField,
    Field,
    NumberField,
    OrderFile,
    ReleaseField,
    TextField,
)
from automaton.scenario.pods import Line, LineDemand
from automaton.scenario.quantities import (
    GAP,
    TIME,
    ConfigSection,
    Due,
    DueAt,
    NamedCell,
    NonEmptyText,
    Pair,
    SingleLine,
    Tick,
    Ticks,
    Weight,
    due_tick,
    quantity,
)

FARTHEST: Final = 1_000_000
MAX_WEIGHT: Final = 1_000_000_000

PLACES: Final = (  # of each entry the fields of one group are needed
    (("from",), ("from_x", "from_y")),
    (("to",), ("to_x", "to_y")),
)
TRANSPORT_FIELDS: Final[tuple[Field, ...]] = (
    ReleaseField(),
    DueField(),
    TextField("order"),
    NumberField("priority", -100, 100, default=0),
    NumberField("weight", 1, MAX_WEIGHT, default=1),
    *(NumberField(name, 0, FARTHEST) for name in ("from_x", "from_y", "to_x", "to_y")),
)


class TransportColumns(ColumnNames, frozen=True, kw_only=True):
    """What the columns of a file of transports are called; others are not read."""

    released: Annotated[Column, Meta(description="When the order is released.")] = None
    source: Annotated[Column, Meta(description="The slot with the load, by its name.")] = field(
        name="from", default=None
    )
    target: Annotated[Column, Meta(description="Where to bring it, by its name.")] = field(
        name="to", default=None
    )
    from_x: Annotated[Column, Meta(description="The slot with the load: its column.")] = None
    from_y: Annotated[Column, Meta(description="And its row.")] = None
    to_x: Annotated[Column, Meta(description="Where to bring it: the column.")] = None
    to_y: Annotated[Column, Meta(description="And the row.")] = None
    order: Annotated[Column, Meta(description="The number or name of the order.")] = None
    due: Annotated[
        Column, Meta(description="Until when: a clock time, or ticks or a time after the release.")
    ] = None
    priority: Annotated[Column, Meta(description="From -100 to 100; empty: 0.")] = None
    weight: Annotated[Column, Meta(description="How heavy the load is; empty: 1.")] = None


class Transports(OrderFile, frozen=True, kw_only=True):
    """A file of orders, each of which brings a load from one place to another."""

    columns: Annotated[
        TransportColumns | None,
        Meta(description="What its columns are called; null: as the keys of this are."),
    ] = None


# The lines of a file, kept as columns: a tuple of a million of them would take 400 MB.
#
# A table is to be used as a tuple of lines, which are made when they are asked for. What goes through
# all of them takes a column of `line_column`.


LineColumn = NDArray[np.int32]
LINE_FIELDS = {"release": "released", "due": "due", "priority": "priority", "units": "units"}


class LineTable(Sequence[Line]):
    """The lines of a file: 32 bytes each, and the texts of their orders.

    `values`: (n,) by field, as automaton.scenario.table_files reads it: places among `orders`, `pods`,
    `skus` and `stations`, or NOTHING, and the tick in which a line is due, or NO_DUE.
    """

    def __init__(
        self,
        values: Mapping[str, LineColumn],
        orders: Sequence[str],
        pods: Sequence[str | int],
        skus: Sequence[str],
        stations: Sequence[str | int],
    ) -> None:
        self.values, self.orders, self.stations = values, orders, stations
        self.pods, self.skus = pods, skus

    def __len__(self) -> int:
        return len(self.values["pod"])

    @overload
    def __getitem__(self, index: int) -> Line: ...

    @overload
    def __getitem__(self, index: slice) -> LineTable: ...

    def __getitem__(self, index: int | slice) -> Line | LineTable:
        if isinstance(index, slice):
            values = {name: column[index] for name, column in self.values.items()}
            return LineTable(values, self.orders, self.pods, self.skus, self.stations)
        return next(iter(self[index:][:1] if index >= 0 else self[index:]))

    def __iter__(self) -> Iterator[Line]:
        names = ("order", "pod", "sku", "station", "released", "due", "priority", "units")
        rows = zip(*(self.values[name].tolist() for name in names), strict=True)
        for order, pod, sku, station, release, due, priority, units in rows:
            yield Line(
                order=None if order == NOTHING else self.orders[order],
                pod=None if pod == NOTHING else self.pods[pod],
                sku=None if sku == NOTHING else self.skus[sku],
                station=None if station == NOTHING else self.stations[station],
                release=release,
                due=None if due == NO_DUE else DueAt(at=due),
                priority=priority,
                units=units,
            )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence) or len(self) != len(other):
            return False
        return all(mine == theirs for mine, theirs in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]


def line_column(lines: Sequence[Line], name: str) -> LineColumn:
    """(n,) int32: the release, due, priority or units of lines; due: the tick, or NO_DUE."""
    if isinstance(lines, LineTable):
        return lines.values[LINE_FIELDS[name]]
    if name == "due":
        ticks = (line.due_tick for line in lines)
        return np.array([NO_DUE if tick is None else min(tick, NO_DUE) for tick in ticks], np.int32)
    return np.array([getattr(line, name) for line in lines], np.int32)


def line_texts(lines: Sequence[Line], name: str) -> tuple[LineColumn, Sequence[str]]:
    """What lines call their orders or SKUs: (n,) int32 places among the texts, or NOTHING; the texts."""
    if isinstance(lines, LineTable):
        return lines.values[name], lines.orders if name == "order" else lines.skus
    known: dict[str, int] = {}
    values = (getattr(line, name) for line in lines)
    places = [
        NOTHING if value is None else known.setdefault(str(value), len(known)) for value in values
    ]
    return np.array(places, np.int32), list(known)


def plain_data(value: Any) -> Any:
    """What a scenario, or a part of it, holds, as msgspec.to_builtins gives it; tables as lists."""
    return msgspec.to_builtins(value, enc_hook=_listed)


def _listed(value: Any) -> Any:
    if isinstance(value, LineTable):
        return list(value)
    raise NotImplementedError(f"no data: {type(value).__name__}")


# Define the orders of a scenario file: what is to be carried, and when it is released.


DRAWN = ("dock-to-rack", "stations", "visits", "tours")  # generators that draw so many orders
MAX_STOPS: Final = 64  # of an order
MAX_STOP_TICKS: Final = 65_535
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


class MeanTime(ConfigSection, frozen=True, kw_only=True):
    """A number of ticks from 1 on, drawn geometrically: what is memoryless in ticks."""

    mean: Annotated[float, quantity(GAP, ge=1, le=1_000_000, description="Its mean.")]


class Bursts(ConfigSection, frozen=True, kw_only=True):
    """Orders are released several at a time, the first of them at once."""

    size: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | Mean,
        Meta(description="Orders of a burst: so many, or drawn with this mean."),
    ]
    every: Annotated[
        Annotated[int, quantity(GAP, ge=1, le=1_000_000)] | MeanTime,
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

    def __post_init__(self) -> None:
        if (self.bursts is None) == (self.closed_loop is None):
            raise ValueError("arrivals must have either bursts or closed_loop")


class WeightRange(ConfigSection, frozen=True, kw_only=True):
    """Weights drawn evenly for each order."""

    least: Annotated[Weight, Meta(description="The lightest.")] = field(name="from")
    most: Annotated[Weight, Meta(description="The heaviest.")] = field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least}) must not be above to ({self.most})")


Cells = Annotated[tuple[Pair, ...], Meta(min_length=1, max_length=MAX_STOPS)]
StopCount = Annotated[int, Meta(ge=1, le=MAX_STOPS)]


class StopRange(ConfigSection, frozen=True, kw_only=True):
    """Numbers of stops drawn evenly for each order."""

    least: Annotated[StopCount, Meta(description="The fewest.")] = field(name="from")
    most: Annotated[StopCount, Meta(description="The most.")] = field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least}) must not be above to ({self.most})")


class Stop(ConfigSection, frozen=True, kw_only=True):
    """A stop at which a robot stands for some time."""

    at: Annotated[NamedCell, Meta(description="The cell in which the robot stands.")]
    ticks: Annotated[
        Annotated[int, quantity(TIME, ge=0, le=MAX_STOP_TICKS)],
        Meta(description="Ticks that it stands there; 0: it is enough that it comes."),
    ] = field(name="for", default=0)


# gc=False: 16 bytes less for each of a million, and no cycle of references leads through them.
class OrderLine(ConfigSection, frozen=True, kw_only=True, gc=False):
    """One order: bring a load from one slot to another, come to cells in turn, or both."""

    source: Annotated[NamedCell | None, Meta(description="The slot with the load.")] = field(
        name="from", default=None
    )
    target: Annotated[
        NamedCell | None,
        Meta(
            description="Where to bring it; a station itself: a visit. Left out for a pod: allocation "
            "chooses a storage cell."
        ),
    ] = field(name="to", default=None)
    stops: Annotated[
        Annotated[tuple[NamedCell | Stop, ...], Meta(min_length=1, max_length=MAX_STOPS)] | None,
        Meta(
            description="Cells in which a robot has to stand, in this order: with from and to, the "
            "robot that carries the load comes there on its way."
        ),
    ] = None
    release: Annotated[Tick, Meta(description="The tick in which it is released.")] = 0
    weight: Weight = 1
    priority: Annotated[
        Annotated[int, Meta(ge=-100, le=100)],
        Meta(
            description="Of the orders that it could do, a robot gets one of the highest priority."
        ),
    ] = 0
    due: Annotated[
        Due | None,
        Meta(description="Ticks after its release until which it is to be done, or {at: tick}."),
    ] = None

    def __post_init__(self) -> None:
        if self.source is None and self.target is None:
            if self.stops is None:
                raise ValueError("an order needs from and to, or stops")
            return
        if self.source is None:
            raise ValueError("the key 'from' is missing")

    @property
    def due_tick(self) -> int | None:
        """The tick until which it is to be done; None: it has no due time."""
        return due_tick(self.due, self.release)

    @property
    def has_load(self) -> bool:
        """Whether a load is to be brought somewhere."""
        return self.source is not None

    @property
    def stop_cells(self) -> tuple[tuple[int, int], ...]:
        """The cells of the stops."""
        return tuple(stop.at if isinstance(stop, Stop) else stop for stop in self.stops or ())

    @property
    def stop_ticks(self) -> tuple[int, ...]:
        """For how long a robot stands at each stop."""
        return tuple(stop.ticks if isinstance(stop, Stop) else 0 for stop in self.stops or ())

    @property
    def ends(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Where an order with a load begins and ends; that of a pod may have no end."""
        if self.source is None or self.target is None:
            raise ValueError("an order without a load, or a target, has no ends")
        return self.source, self.target


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
        Annotated[int, quantity(GAP, ge=0, le=1_000_000)] | MeanTime,
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

    mean: Annotated[float, quantity(TIME, ge=1, le=10_000, description="Mean ticks.")]
    distribution: Annotated[
        Literal["exponential"],
        Meta(description="Memoryless, in whole ticks from 1 on: the geometric distribution."),
    ] = "exponential"


ProcessingTime = Ticks | RandomProcessingTime


class Orders(ConfigSection, frozen=True, kw_only=True):
    """What is to be carried: a generator of orders, a list or a file of them, or parts."""

    generator: Annotated[
        Literal["full-shelves", "picture-loads", "dock-to-rack", "stations", "visits", "tours"]
        | None,
        Meta(
            description="full-shelves: every shelf holds a load at the start; picture-loads: the "
            "shelves drawn as $ do. Each is brought to a destination drawn at random. "
            "dock-to-rack: so many loads wait at docks drawn at random, each for a rack drawn at "
            "random. stations: each load goes from a station to another one, both drawn at "
            "random. visits: stations drawn at random, where a robot has to come. tours: robots "
            "have to come to `stops` cells in turn, drawn from all that they reach; no cell twice "
            "in succession."
        ),
    ] = None
    stops: Annotated[
        StopCount | StopRange,
        Meta(description="Stops of each order of the generator tours: so many, or {from, to}."),
    ] = 1
    count: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | None,
        Meta(description="How many orders there are, for generators that draw them."),
    ] = None
    mean_interarrival_time: Annotated[
        float,
        quantity(
            GAP,
            ge=0,
            le=1_000_000,
            description="Mean ticks between two orders: from the second tick on, one arrives in a "
            "tick with probability 1 / this, as Poisson arrivals in ticks. 0: all are known from "
            "the start.",
        ),
    ] = 0.0
    arrivals: Annotated[
        Arrivals | None, Meta(description="How they are released, if not all at once.")
    ] = None
    weight: Annotated[
        Weight | WeightRange,
        Meta(description="Of the orders that generators make: all alike, or drawn {from, to}."),
    ] = 1
    listed: Annotated[tuple[OrderLine, ...] | None, Meta(description="The orders, one by one.")] = (
        field(name="list", default=None)
    )
    transports: Annotated[
        Transports | None, Meta(description="The orders, as a CSV file of another system.")
    ] = None
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

    lines: Annotated[
        tuple[Line, ...] | LineDemand | None,
        Meta(
            description="Lines that pods are carried to stations for, one by one or drawn; the trips "
            "of the pods follow from them."
        ),
    ] = None

    tasks: Annotated[
        NonEmptyText | tuple[Cells, ...] | None,
        Meta(
            description="Orders without a load, each a list of cells in which a robot has to stand in "
            "turn: a file, relative to the scenario, or the lists themselves. In the file lines with # "
            "are skipped, the first line is the number of tasks, and each further one has cells "
            "row * width + column with commas between them."
        ),
    ] = None
    repeat: Annotated[
        bool, Meta(description="After the last of the tasks comes the first one again.")
    ] = False
    revealed: Annotated[
        Annotated[float, Meta(gt=0, le=1000)] | None,
        Meta(
            description="So many times the robots, tasks are known and not done, in the order of the "
            "list; null: all are known from the start."
        ),
    ] = None
    assign: Annotated[
        Literal["pool", "round-robin"],
        Meta(
            description="pool: any robot may do a task. round-robin: the j-th task of robot r of n is "
            "j n + r, one after another, and no other robot ever does it."
        ),
    ] = "pool"
    skip_reached: Annotated[
        bool,
        Meta(
            description="round-robin, repeated: a robot passes over a task in whose first cell it stands."
        ),
    ] = False

    def __post_init__(self) -> None:
        if self.generator != "tours" and self.stops != 1:
            raise ValueError("stops belong to the generator tours, or to each order of a list")
        given = [self.generator, self.listed, self.parts, self.lines, self.tasks, self.transports]
        if sum(form is not None for form in given) != 1:
            raise ValueError(
                "orders must have either a generator, a list, transports, lines, parts or tasks"
            )
        self._check_tasks()
        if self.parts is not None and not self.parts:
            raise ValueError("parts must hold at least one type of parts")
        if self.parts is None and self.processing_time != 1:
            raise ValueError("processing_time belongs to parts")
        if self.generator is None and self.weight != 1:
            raise ValueError("weight belongs to generators, or to each order or type of parts")
        if self.lines == ():
            raise ValueError("lines must hold at least one line")
        if self.listed is not None and not self.listed:
            raise ValueError("list must hold at least one order")
        if self.generator in DRAWN and self.count is None:
            raise ValueError(f"the generator {self.generator} needs a count of orders")
        if self.generator not in DRAWN and self.count is not None:
            raise ValueError(f"count belongs to the generators {', '.join(DRAWN)}")
        self._check_arrivals()

    def _check_tasks(self) -> None:
        if self.tasks is None:
            for name, is_set in (
                ("repeat", self.repeat),
                ("revealed", self.revealed is not None),
                ("assign", self.assign != "pool"),
                ("skip_reached", self.skip_reached),
            ):
                if is_set:
                    raise ValueError(f"{name} belongs to tasks")
            return
        if not self.tasks:
            raise ValueError("tasks must hold at least one task")
        if self.assign == "round-robin" and self.revealed is not None:
            raise ValueError(
                "revealed belongs to assign: pool; round-robin shows each robot one task"
            )
        if self.repeat and self.assign == "pool" and self.revealed is None:
            raise ValueError("repeat needs revealed, how many times the robots are open at once")
        if self.skip_reached and not (self.repeat and self.assign == "round-robin"):
            raise ValueError("skip_reached needs assign: round-robin and repeat: true")

    def _check_arrivals(self) -> None:
        if self.generator is None and self.mean_interarrival_time:
            raise ValueError("mean_interarrival_time belongs to generators of orders")
        if self.generator is None and self.arrivals is not None:
            raise ValueError("arrivals belong to generators of orders")
        if self.mean_interarrival_time and self.arrivals is not None:
            raise ValueError("set either mean_interarrival_time or arrivals, not both")
        if 0 < self.mean_interarrival_time < 1:
            raise ValueError(
                "mean_interarrival_time must be 0 or at least 1: at most one order arrives per tick"
            )

    def in_system(self, robots: int) -> int:
        """Return how many orders a closed loop of so many robots keeps open; 0: it is none."""
        if self.revealed is not None:
            return max(1, int(self.revealed * robots + 1e-9))
        loop = None if self.arrivals is None else self.arrivals.closed_loop
        return 0 if loop is None else loop.in_system


def has_tours(orders: Orders) -> bool:
    """Return whether any of the orders is one without a load."""
    listed = orders.listed or ()
    if orders.generator == "tours" or orders.tasks is not None:
        return True
    return any(line.stops is not None for line in listed)


def listed_lines(orders: Orders) -> Sequence[Line]:
    """Return the lines that are listed, one by one or in a file."""
    lines: Sequence[Line] | LineDemand | None = orders.lines
    return () if lines is None or isinstance(lines, LineDemand) else lines


def has_due_times(orders: Orders) -> bool:
    """Return whether any of the orders has a due time."""
    if isinstance(orders.lines, LineDemand):
        return orders.lines.due is not None
    return any(order.due is not None for order in orders.listed or ()) or bool(
        (line_column(listed_lines(orders), "due") != NO_DUE).any()
    )


def priorities_of(orders: Orders) -> list[int]:
    """Return the priorities that orders have, the highest first."""
    priorities = {line.priority for line in orders.listed or ()}
    priorities.update(np.unique(line_column(listed_lines(orders), "priority")).tolist())
    return sorted(priorities or {0}, reverse=True)


def kinds_of_sources(orders: Orders, floor_plan: FloorPlan) -> set[int]:
    """Return the kinds of slots where orders begin."""
    found = {
        int(floor_plan.kind.flat[floor_plan.cell(*line.source)])
        for line in orders.listed or ()
        if line.source is not None
    }
    if orders.generator in ENDS:
        found.add(ENDS[orders.generator][0])
    return found | ({STATION} if orders.parts is not None else set())
