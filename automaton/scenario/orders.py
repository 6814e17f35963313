"""The demand of a scenario and its release times: orders, lines, parts and tasks."""

from __future__ import annotations

import itertools
from typing import Annotated, Any, Final, Literal

from msgspec import Meta, field

from automaton.floor.floor_plan import DESTINATION, DOCK, RACK, SHELF, STATION
from automaton.scenario.arrivals import Arrivals, MeanTime
from automaton.scenario.quantities import (
    GAP,
    TIME,
    ConfigSection,
    Due,
    NamedCell,
    NonEmptyText,
    Pair,
    Shares,
    SingleLine,
    StopCount,
    StopRange,
    Tick,
    Ticks,
    Weight,
    WeightRange,
    check_shares,
    due_tick,
    quantity,
)
from automaton.scenario.quantities import MAX_STOPS as MAX_STOPS
from automaton.scenario.table_fields import (
    COORDINATE,
    FILE_OPTIONS,
    PRIORITY,
    Column,
    ColumnNames,
    DueField,
    NameField,
    NumberField,
    ReleaseField,
    TableOptions,
    column,
)

# Generators that draw `count` orders.
DRAWN_GENERATORS: Final = ("dock-to-rack", "stations", "visits", "tours")
MAX_DRAWN_LINES: Final = 1_000_000
MAX_STOP_TICKS: Final = 65_535
ENDS: Final = {  # generator: kinds of slots of its sources and targets
    "full-shelves": (SHELF, DESTINATION),
    "picture-loads": (SHELF, DESTINATION),
    "dock-to-rack": (DOCK, RACK),
    "stations": (STATION, STATION),
    "visits": (STATION, STATION),
}
DRAWN_ALONE: Final[dict[str, Any]] = {  # keys of random lines with their defaults
    "mean_interarrival_time": 0.0,
    "per_order": 1,
    "classes": None,
    "stations": "fewest-lines",
    "due": None,
}


CLASS_MEANING: Final = "The class of the order, such as express; metrics are printed by class."
OrderClass = Annotated[SingleLine | None, Meta(description=CLASS_MEANING)]


class TransportColumns(ColumnNames, frozen=True, kw_only=True):
    """Names of the columns of a file of transports; other columns are ignored."""

    rows = "orders"
    needed = ((("from",), ("from_x", "from_y")), (("to",), ("to_x", "to_y")))

    released: Annotated[Column, column("When the order is released.", ReleaseField)] = None
    source: Annotated[
        Column,
        column(
            "The slot with the load, by its name.", NameField, what="location", is_required=True
        ),
    ] = field(name="from", default=None)
    target: Annotated[
        Column,
        column(
            "The slot to which the load is brought, by its name.",
            NameField,
            what="location",
            is_required=True,
        ),
    ] = field(name="to", default=None)
    from_x: Annotated[Column, column("The x coordinate of the slot with the load.", COORDINATE)] = (
        None
    )
    from_y: Annotated[Column, column("The y coordinate of the slot with the load.", COORDINATE)] = (
        None
    )
    to_x: Annotated[
        Column, column("The x coordinate of the slot to which the load is brought.", COORDINATE)
    ] = None
    to_y: Annotated[
        Column, column("The y coordinate of the slot to which the load is brought.", COORDINATE)
    ] = None
    order: Annotated[Column, column("The number or name of the order.")] = None
    due: Annotated[
        Column,
        column(
            "When the order is due: a clock time, or ticks or a time after the release.", DueField
        ),
    ] = None
    priority: Annotated[
        Column, column("How urgent the order is, from -100 to 100; empty: 0.", PRIORITY)
    ] = None
    weight: Annotated[
        Column,
        column(
            "How heavy the load is; empty: 1.", NumberField, least=1, most=1_000_000_000, default=1
        ),
    ] = None
    order_class: Annotated[Column, column(CLASS_MEANING)] = field(name="class", default=None)


class Transports(TableOptions, frozen=True, kw_only=True):
    """A file of transport orders, each from one place to another."""

    columns: Annotated[
        TransportColumns | None,
        Meta(description="Names of the columns; null: the columns have the names of the keys."),
    ] = None


# gc=False: saves 16 bytes each, for up to a million; no reference cycle passes through them.
class Line(ConfigSection, frozen=True, kw_only=True, gc=False):
    """An order line: units from one pod, or from any pod with a SKU, at a station."""

    pod: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | SingleLine | None,
        Meta(description="The pod, by name or number from 1."),
    ] = None
    sku: Annotated[
        int | SingleLine | None,
        Meta(description="The SKU, picked from any pod that holds it; ignored if `pod` is set."),
    ] = None
    station: Annotated[
        int | SingleLine | None,
        Meta(
            description="The station, by name or number from 1; left out: the station of earlier "
            "lines of the order, else the one with the fewest open lines."
        ),
    ] = None
    order: Annotated[
        int | SingleLine | None,
        Meta(
            description="The order to which the line belongs; left out: the line is an order of its "
            "own."
        ),
    ] = None
    release: Annotated[Tick, Meta(description="The tick in which the line is released.")] = 0
    due: Annotated[
        Due | None,
        Meta(description="Due time: ticks after the release, or {at: tick}."),
    ] = None
    priority: Annotated[
        int, Meta(ge=-100, le=100, description="Priority: lines with larger numbers come first.")
    ] = 0
    units: Annotated[int, Meta(ge=0, le=1_000_000, description="Number of units to pick.")] = 1
    order_class: OrderClass = field(name="class", default=None)

    def __post_init__(self) -> None:
        if self.pod is None and self.sku is None:
            raise ValueError("a line needs a pod or a sku")

    @property
    def due_tick(self) -> int | None:
        """The due tick; None: no due time."""
        return due_tick(self.due, self.release)


class PerOrder(ConfigSection, frozen=True, kw_only=True):
    """A random number of lines from 1 on, geometrically distributed."""

    mean: Annotated[float, Meta(ge=1, le=1000, description="The mean number of lines.")]


class LineColumns(ColumnNames, frozen=True, kw_only=True):
    """Names of the columns of a file of lines; other columns are ignored."""

    rows = "lines"
    needed = ((("pod",), ("sku",)),)

    released: Annotated[Column, column("When the line is released.", ReleaseField)] = None
    pod: Annotated[Column, column("The pod, by name or number from 1.")] = None
    sku: Annotated[Column, column("The SKU, where no pod is named.")] = None
    station: Annotated[
        Column,
        column("The station, by name or number; empty: any.", NameField, what="station"),
    ] = None
    order: Annotated[Column, column("The order to which the line belongs.")] = None
    due: Annotated[
        Column,
        column(
            "When the line is due: a clock time, or ticks or a time after the release.", DueField
        ),
    ] = None
    priority: Annotated[
        Column, column("How urgent the line is, from -100 to 100; empty: 0.", PRIORITY)
    ] = None
    units: Annotated[
        Column,
        column(
            "Units that are picked, rounded up; empty: 1.",
            NumberField,
            least=1,
            most=1_000_000,
            default=1,
            rounds_up=True,
        ),
    ] = None
    order_class: Annotated[Column, column(CLASS_MEANING)] = field(name="class", default=None)


class LineDemand(TableOptions, frozen=True, kw_only=True):
    """Lines from a file, or random lines."""

    file: Annotated[
        NonEmptyText | None,
        Meta(
            description="A CSV file with a header line, an order line in each row and columns "
            "separated by semicolons, tabs or commas, or a workbook (.xlsx; needs "
            "fleet-automaton[excel]); path relative to the scenario. A pattern such as "
            "days/*.csv names several files: the seed of a run selects one, whose times count "
            "from midnight of its first day."
        ),
    ] = None  # type: ignore[assignment]
    columns: Annotated[
        LineColumns | None,
        Meta(description="Names of the columns; null: the columns have the names of the keys."),
    ] = None
    count: Annotated[
        Annotated[int, Meta(ge=1, le=MAX_DRAWN_LINES)] | None,
        Meta(description="Number of random lines."),
    ] = None
    mean_interarrival_time: Annotated[
        float,
        quantity(
            GAP,
            ge=0,
            le=1_000_000,
            description="Mean number of ticks between two orders. Each tick releases an order, with all "
            "its lines, with probability 1 / this value. 0: all are known from the start.",
        ),
    ] = 0.0
    per_order: Annotated[
        Annotated[int, Meta(ge=1, le=1000)] | PerOrder,
        Meta(description="Lines per order: a fixed number, or random with a mean."),
    ] = 1
    classes: Annotated[
        Shares | None,
        Meta(
            description="Share of lines for the pods of each class; left out: uniform over all pods."
        ),
    ] = None
    stations: Annotated[
        Literal["fewest-lines", "random"],
        Meta(
            description="The station of an order. fewest-lines: the one with the fewest open lines; "
            "random: any."
        ),
    ] = "fewest-lines"
    due: Annotated[
        Annotated[int, quantity(TIME, ge=0, le=2_000_000_000)] | None,
        Meta(description="Due time in ticks after the release; null: lines have no due time."),
    ] = None

    @property
    def drawn(self) -> int:
        """Number of random lines."""
        return self.count or 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.file is None) == (self.count is None):
            raise ValueError("lines are a list, or have either a count or a file")
        for name, default in (DRAWN_ALONE if self.count is None else FILE_OPTIONS).items():
            if getattr(self, name) != default:
                other = "count" if self.count is None else "file"
                raise ValueError(f"{name} belongs to lines with a {other}")
        if self.classes is not None:
            check_shares("classes", self.classes)
        if 0 < self.mean_interarrival_time < 1:
            raise ValueError(
                "mean_interarrival_time must be 0 or at least 1: at most one order arrives per tick"
            )


Cells = Annotated[tuple[Pair, ...], Meta(min_length=1, max_length=MAX_STOPS)]
StopGroup = Literal["stations", "racks"]


class OrderStop(ConfigSection, frozen=True, kw_only=True):
    """A stop of an order, with the time for which the robot stands there."""

    at: Annotated[NamedCell, Meta(description="The cell in which the robot stands.")]
    ticks: Annotated[
        Annotated[int, quantity(TIME, ge=0, le=MAX_STOP_TICKS)],
        Meta(description="Ticks that the robot stands there; 0: arriving is enough."),
    ] = field(name="for", default=0)


# gc=False: saves 16 bytes each, for up to a million; no reference cycle passes through them.
class OrderLine(ConfigSection, frozen=True, kw_only=True, gc=False):
    """One order: carry a load from one slot to another, visit cells in sequence, or both."""

    source: Annotated[NamedCell | None, Meta(description="The slot with the load.")] = field(
        name="from", default=None
    )
    target: Annotated[
        NamedCell | None,
        Meta(
            description="The slot to which the load is carried. A pod that is carried to a station "
            "visits it. If a pod has no `to`, the allocation chooses a storage cell."
        ),
    ] = field(name="to", default=None)
    stops: Annotated[
        Annotated[tuple[NamedCell | OrderStop, ...], Meta(min_length=1, max_length=MAX_STOPS)]
        | None,
        Meta(
            description="Cells that a robot must visit in this sequence; with from and to, it visits "
            "them while it carries the load."
        ),
    ] = None
    release: Annotated[Tick, Meta(description="The tick in which the order is released.")] = 0
    weight: Weight = 1
    priority: Annotated[
        Annotated[int, Meta(ge=-100, le=100)],
        Meta(
            description="Priority: a robot gets an order of the highest priority among those that it "
            "can do."
        ),
    ] = 0
    due: Annotated[
        Due | None,
        Meta(description="Due time: ticks after the release, or {at: tick}."),
    ] = None
    order_class: OrderClass = field(name="class", default=None)

    def __post_init__(self) -> None:
        if self.source is None and self.target is None:
            if self.stops is None:
                raise ValueError("an order needs from and to, or stops")
            return
        if self.source is None:
            raise ValueError("the key 'from' is missing")

    @property
    def due_tick(self) -> int | None:
        """The due tick; None: no due time."""
        return due_tick(self.due, self.release)

    @property
    def has_load(self) -> bool:
        """Whether the order brings a load somewhere."""
        return self.source is not None

    @property
    def stop_cells(self) -> tuple[tuple[int, int], ...]:
        """The cells of the stops."""
        return tuple(stop.at if isinstance(stop, OrderStop) else stop for stop in self.stops or ())

    @property
    def stop_ticks(self) -> tuple[int, ...]:
        """The ticks for which a robot stands at each stop."""
        return tuple(stop.ticks if isinstance(stop, OrderStop) else 0 for stop in self.stops or ())

    @property
    def ends(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Source and target of an order with a load. Raises ValueError if one is missing."""
        if self.source is None or self.target is None:
            raise ValueError("an order without a load or without a target")
        return self.source, self.target


StationNumber = Annotated[int, Meta(ge=1, le=100_000, description="A station, from 1.")]


class Parts(ConfigSection, frozen=True, kw_only=True):
    """Parts of one type, processed at one station after another."""

    route: Annotated[
        tuple[StationNumber, ...],
        Meta(min_length=1, description="The route of a part: numbers of stations."),
    ]
    count: Annotated[int, Meta(ge=1, le=1_000_000, description="Number of parts.")] = 1
    name: Annotated[SingleLine | None, Meta(description="Name of the parts in reports.")] = None
    first_release: Annotated[
        Tick, Meta(description="The tick in which the first part arrives at its first station.")
    ] = 0
    interarrival_time: Annotated[
        Annotated[int, quantity(GAP, ge=0, le=1_000_000)] | MeanTime,
        Meta(description="Ticks from one part to the next: a fixed number, or random with a mean."),
    ] = 0
    weight: Weight = 1

    def __post_init__(self) -> None:
        for here, then in itertools.pairwise(self.route):
            if here == then:
                raise ValueError(
                    f"a route must lead from one station to another, not {here}, {here}"
                )


class RandomProcessingTime(ConfigSection, frozen=True, kw_only=True):
    """A random processing time, drawn for each part and station."""

    mean: Annotated[float, quantity(TIME, ge=1, le=10_000, description="Mean, in ticks.")]
    distribution: Annotated[
        Literal["exponential"],
        Meta(
            description="Distribution of the processing time. exponential: memoryless, in whole "
            "ticks from 1 on (a geometric distribution)."
        ),
    ] = "exponential"


ProcessingTime = Ticks | RandomProcessingTime


class Orders(ConfigSection, frozen=True, kw_only=True):
    """The demand: generated orders, a list or file of orders, parts, or lines for pods."""

    generator: Annotated[
        Literal["full-shelves", "picture-loads", "dock-to-rack", "stations", "visits", "tours"]
        | None,
        Meta(
            description="The generator of orders. full-shelves: every shelf holds a load at the "
            "start, to be carried to a random destination; picture-loads: only shelves drawn "
            "as $ hold such a load. dock-to-rack: `count` loads wait at random docks, each to "
            "be carried to a random rack. stations: each load goes from one random station to "
            "another. visits: a robot must visit a random station. tours: a robot must visit "
            "`stops` random cells in sequence; successive cells differ, unless `assign` is "
            "round-robin."
        ),
    ] = None
    stops: Annotated[
        StopCount | StopRange,
        Meta(description="Number of stops of each order of tours, or a range {from, to}."),
    ] = 1
    cells: Annotated[
        Literal["all", "no-dead-ends"] | tuple[StopGroup, StopGroup],
        Meta(
            description="Cells that tours may visit, among the cells that robots can reach. all: every "
            "cell; no-dead-ends: cells outside dead ends; [stations, racks], or any two of these: each "
            "robot alternates between the two groups, where racks means the cells above and below "
            "racks. A robot that starts in a cell of the first group begins with the second."
        ),
    ] = "all"
    count: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | None,
        Meta(
            description="Number of generated orders; with a profile of arrivals, the greatest number "
            "(optional)."
        ),
    ] = None
    mean_interarrival_time: Annotated[
        float,
        quantity(
            GAP,
            ge=0,
            le=1_000_000,
            description="Mean number of ticks between two orders. From the second tick on, each tick "
            "releases an order with probability 1 / this value (Poisson arrivals in discrete "
            "time). 0: all orders are known from the start.",
        ),
    ] = 0.0
    arrivals: Annotated[
        Arrivals | None,
        Meta(
            description="How orders are released: in bursts, in a closed loop, or by the hour of the "
            "week."
        ),
    ] = None
    weight: Annotated[
        Weight | WeightRange,
        Meta(
            description="Weight of generated orders: one value for all, or random values {from, to}."
        ),
    ] = 1
    listed: Annotated[tuple[OrderLine, ...] | None, Meta(description="A list of orders.")] = field(
        name="list", default=None
    )
    transports: Annotated[
        Transports | None, Meta(description="Orders from a CSV file or workbook of another system.")
    ] = None
    parts: Annotated[
        tuple[Parts, ...] | None,
        Meta(
            description="Parts that stations process one at a time, first come, first served. Each "
            "transport from a station to the next one is an order, released when the first station is "
            "done with the part."
        ),
    ] = None
    processing_time: Annotated[
        ProcessingTime | tuple[ProcessingTime, ...],
        Meta(description="Ticks to process a part: one value for all stations, or one for each."),
    ] = 1
    lines: Annotated[
        tuple[Line, ...] | LineDemand | None,
        Meta(
            description="Order lines, which make pods travel to stations: a list, a file, or "
            "random lines."
        ),
    ] = None
    tasks: Annotated[
        NonEmptyText | tuple[Cells, ...] | None,
        Meta(
            description="Tasks without a load: each is a list of cells that a robot must visit in "
            "sequence. Write the lists here, or name a file (path relative to the scenario). In the "
            "file, lines with # are skipped; the first line is the number of tasks, and each further "
            "line lists the cells of a task (row * width + column), separated by commas."
        ),
    ] = None
    repeat: Annotated[
        bool, Meta(description="Whether the list of tasks starts again after its last task.")
    ] = False
    revealed: Annotated[
        Annotated[float, Meta(gt=0, le=1000)] | None,
        Meta(
            description="How many unfinished tasks per robot are known at a time; null: all tasks "
            "are known from the start."
        ),
    ] = None
    assign: Annotated[
        Literal["pool", "round-robin"],
        Meta(
            description="Which robot may do a task or tour. pool: any robot. round-robin: robot r of n "
            "robots does the tasks r, r + n, r + 2 n and so on, and knows one of them at a "
            "time; tours then depend only on the seed and the robot."
        ),
    ] = "pool"
    skip_reached: Annotated[
        bool,
        Meta(
            description="Whether a robot skips a repeated task if it already stands in the first "
            "cell of the task."
        ),
    ] = False

    def __post_init__(self) -> None:
        self._check_tours()
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
        needs_count = self.generator in DRAWN_GENERATORS and not self.follows_profile
        if needs_count and self.count is None:
            raise ValueError(f"the generator {self.generator} needs a count of orders")
        if self.generator not in DRAWN_GENERATORS and self.count is not None:
            raise ValueError(f"count belongs to the generators {', '.join(DRAWN_GENERATORS)}")
        self._check_arrivals()

    def _check_tours(self) -> None:
        tours, alternate = self.generator == "tours", isinstance(self.cells, tuple)
        dealt_out = tours and self.assign == "round-robin"
        arrive = self.mean_interarrival_time > 0 or self.arrivals is not None
        for is_wrong, text in (
            (self.stops != 1 and not tours, "stops belong to the generator tours, or to each order of "
             "a list"),
            (self.cells != "all" and not tours, "cells belong to the generator tours"),
            (dealt_out and arrive, "assign: round-robin reveals one order per robot; leave out "
             "mean_interarrival_time and arrivals"),
            (alternate and not dealt_out, "two groups of cells need assign: round-robin"),
            (alternate and isinstance(self.stops, StopRange), "two groups of cells need a fixed number "
             "of stops, not a range"),
        ):  # fmt: skip
            if is_wrong:
                raise ValueError(text)

    def _check_tasks(self) -> None:
        if self.tasks is None:
            for name in ("repeat", "revealed", "skip_reached"):
                if getattr(self, name):
                    raise ValueError(f"{name} belongs to tasks")
            if self.assign != "pool" and self.generator != "tours":
                raise ValueError("assign belongs to tasks and to the generator tours")
            return
        if not self.tasks:
            raise ValueError("tasks must hold at least one task")
        if self.assign == "round-robin" and self.revealed is not None:
            raise ValueError(
                "revealed belongs to assign: pool; round-robin reveals one task per robot"
            )
        if self.repeat and self.assign == "pool" and self.revealed is None:
            raise ValueError("repeat needs revealed, the number of open tasks per robot")
        if self.skip_reached and not (self.repeat and self.assign == "round-robin"):
            raise ValueError("skip_reached needs assign: round-robin and repeat: true")

    def _check_arrivals(self) -> None:
        if self.generator is None and self.mean_interarrival_time:
            raise ValueError("mean_interarrival_time belongs to generators of orders")
        lines = self.lines if self.follows_profile else None
        is_open = isinstance(lines, LineDemand) and lines.drawn and not lines.mean_interarrival_time
        if self.generator is None and self.arrivals is not None and not is_open:
            raise ValueError(
                "arrivals belong to generators of orders, a profile to random lines, too"
            )
        if self.mean_interarrival_time and self.arrivals is not None:
            raise ValueError("set either mean_interarrival_time or arrivals, not both")
        if 0 < self.mean_interarrival_time < 1:
            raise ValueError(
                "mean_interarrival_time must be 0 or at least 1: at most one order arrives per tick"
            )

    @property
    def follows_profile(self) -> bool:
        """Whether orders arrive at the rates of a profile."""
        return self.arrivals is not None and self.arrivals.profile is not None

    @property
    def has_random_count(self) -> bool:
        """Whether the number of orders is random: those that arrive during the run."""
        return self.follows_profile and self.generator in DRAWN_GENERATORS

    @property
    def least_count(self) -> int:
        """The number of orders of a generator, or 1 if it is random."""
        return 1 if self.has_random_count else self.count or 0

    def in_system(self, robots: int) -> int:
        """Return the number of open orders of a closed loop with this number of robots, else 0."""
        if self.revealed is not None:
            return max(1, int(self.revealed * robots + 1e-9))
        loop = None if self.arrivals is None else self.arrivals.closed_loop
        return 0 if loop is None else loop.in_system
