"""The schema of a scenario file: one struct for each section.

`automaton schema` derives the JSON Schema from the structs, and the reader its messages. `resolve`
checks what depends on the floor or on the chosen strategies.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from automaton.errors import InputError
from automaton.scenario.changing_floor import ChangingFloor as ChangingFloor
from automaton.scenario.changing_floor import Locations, Streets
from automaton.scenario.durations import Durations as Durations
from automaton.scenario.durations import Handling as Handling
from automaton.scenario.fleet import Area as Area
from automaton.scenario.fleet import Battery as Battery
from automaton.scenario.fleet import ChargeRange as ChargeRange
from automaton.scenario.fleet import Drain as Drain
from automaton.scenario.fleet import Fault as Fault
from automaton.scenario.fleet import Faults as Faults
from automaton.scenario.fleet import Fleet as Fleet
from automaton.scenario.fleet import TypeBattery
from automaton.scenario.orders import Orders as Orders
from automaton.scenario.pods import Pods, PodStation
from automaton.scenario.quantities import (
    CELLS,
    TIME,
    Parameters,
    Scale,
    StrategySpec,
    quantity,
    read_clock,
)
from automaton.scenario.quantities import ConfigSection as ConfigSection
from automaton.scenario.quantities import Direction as Direction
from automaton.scenario.quantities import NonEmptyText as NonEmptyText
from automaton.scenario.quantities import SingleLine as SingleLine
from automaton.units import ticks_and_time, unit

KindName = Literal[
    "wall",
    "floor",
    "track",
    "turntable",
    "shelf",
    "destination",
    "charger",
    "parking-bay",
    "rack",
    "dock",
    "station",
    "storage",
]

TICK_PATTERN = r"^(?=[^a-zA-Z]*[1-9])\d{1,9}(\.\d{1,12})? ?(?![eE][-+]?\d)[^\s\d.]\S*$"
MEMORY_PATTERN = r"^(?=[^a-zA-Z]*[1-9])\d{1,9}(\.\d+)? ?[KMGT]iB$"

MAX_MOVE_TICKS = 65_535  # ticks
MAX_REFINEMENT = 1000  # fine ticks in a tick

INSTEAD = "instead"  # in Meta.extra: new names of renamed values

Metre = Annotated[float, Meta(ge=-1_000_000, le=1_000_000)]

LAYER_NAMES = ("zoning", "charging", "allocation", "routing", "right_of_way")


class Units(ConfigSection, frozen=True, kw_only=True):
    """The duration of a tick and the side of a cell, for reports and for strategies that use
    minutes.
    """

    tick: Annotated[
        str,
        Meta(
            description='The duration of a tick: a number above 0 and a name, such as "1 cycle" or '
            '"0.5 s".',
            pattern=TICK_PATTERN,
        ),
    ] = "1 tick"

    cell: Annotated[
        Annotated[str, Meta(pattern=TICK_PATTERN)] | None,
        Meta(description='The side of a cell, such as "2.5 ft": a number above 0 and a name.'),
    ] = None
    clock: Annotated[
        SingleLine | None,
        Meta(
            description='Clock time of tick 0, such as "2026-03-02 06:00" or "06:00"; clock times '
            "in the scenario refer to it. Files whose times have an offset from UTC need an "
            'offset here, too: "2026-03-02 06:00+01:00".'
        ),
    ] = None

    origin: Annotated[
        tuple[Metre, Metre],
        Meta(
            description="The lower left corner of the floor in the coordinates of the site, [x, y] in "
            "metres. Logs of real robots and exported positions are in these coordinates."
        ),
    ] = (0.0, 0.0)
    rotation: Annotated[
        float,
        Meta(
            ge=-360,
            le=360,
            description="Degrees, counter-clockwise, from the x axis of the site to the lower side of "
            "the floor.",
        ),
    ] = 0.0

    def __post_init__(self) -> None:
        if self.clock is not None:
            try:
                read_clock(self.clock)
            except InputError as error:
                raise ValueError(f"clock {error.message}") from None

    @property
    def scale(self) -> Scale:
        """The scale for texts with units."""
        return Scale(self.tick, self.cell, read_clock(self.clock) if self.clock else None)


class Strategies(ConfigSection, frozen=True, kw_only=True):
    """The strategy of each layer: a name, or {name: NAME, ...parameters}."""

    zoning: Annotated[
        StrategySpec, Meta(description="Which robot serves which part of the floor.")
    ] = "none"
    charging: Annotated[StrategySpec, Meta(description="When and where a robot charges.")] = "none"
    allocation: Annotated[StrategySpec, Meta(description="Which order a robot does next.")] = (
        "independent"
    )
    routing: Annotated[StrategySpec, Meta(description="Which route a robot takes.")] = "shortest"
    right_of_way: Annotated[
        StrategySpec | None,
        Meta(
            description="Traffic control: which robot goes first where robots meet. null: automaton "
            "chooses. It chooses retreat if the routing is not shortest and robots follow its routes, "
            "if information is limited, or if the floor has no ring. Otherwise it chooses epibt if "
            "epibt supports the scenario, a turn or a move takes 2 ticks or more, at least half of all "
            "connections between neighbouring cells are open in both directions, and the floor has no "
            "closings, doors, blocks or lifts. Otherwise it chooses pibt."
        ),
    ] = None


class WorldRules(ConfigSection, frozen=True, kw_only=True):
    """Rules of motion that a scenario may change."""

    following: Annotated[
        Literal["convoy", "handover", "none"],
        Meta(
            description="When a robot may begin to move into a cell. none: only if the cell was free "
            "when the tick began; handover: also in the last tick of the move by which another robot "
            "leaves it; convoy: also in any other tick of that move.",
            extra={INSTEAD: {True: "handover", False: "none"}},
        ),
    ] = "convoy"
    access_cell: Annotated[
        Literal["fixed", "nearest"],
        Meta(
            description="The cell from which a slot is served. fixed: robots pick from the east if "
            "possible, and drop from the west; nearest: the access cell nearest to the robot, counted "
            "in rows and columns."
        ),
    ] = "fixed"
    traffic_zones: Annotated[
        Literal["undirected", "directed", "with-intersections"],
        Meta(
            description="Traffic zones: the stretches between intersections. undirected: one zone for "
            "each stretch; directed: one for each direction of travel; with-intersections: "
            "intersections are zones, too."
        ),
    ] = "undirected"
    slowdown: Annotated[
        Literal["none", "zones"],
        Meta(
            description="Slowdown by traffic. zones: a move that starts in a zone with m robots takes "
            "m times as long; none: no slowdown."
        ),
    ] = "none"
    extra_tick_probability: Annotated[
        float, Meta(ge=0, le=1, description="Probability that a move takes one tick more.")
    ] = 0.0
    distance_tables: Annotated[
        str,
        Meta(
            description='Greatest memory for distance tables, such as "512 MiB": a number and KiB, '
            "MiB, GiB or TiB. Tables are made when needed; the limit affects speed, not results. A "
            "strategy with its own weights, such as epibt with guidance lattice, may use as much again.",
            pattern=MEMORY_PATTERN,
        ),
    ] = "1 GiB"


class Radius(ConfigSection, frozen=True, kw_only=True):
    """A robot knows only what lies within a radius."""

    radius: Annotated[int, quantity(CELLS, ge=1, le=10_000, description="The radius, in cells.")]
    shape: Annotated[
        Literal["square", "circle"],
        Meta(
            description="Shape of the area within the radius. square: distances count in rows and in "
            "columns (Chebyshev); circle: distances are straight lines."
        ),
    ] = "square"
    orders: Annotated[
        Literal["all", "zones"],
        Meta(
            description="Orders that a robot knows. all: every order; zones: only orders and stations in "
            "its own service zone and in the zones of the robots that it knows."
        ),
    ] = "all"


class Stop(ConfigSection, frozen=True, kw_only=True):
    """When a run ends."""

    when: Annotated[
        Literal["parked", "delivered", "never", "on-targets"],
        Meta(
            description="Event that ends a run. delivered: all orders are delivered; parked: in "
            "addition, all robots are home again; on-targets: all robots stand in the last cells of "
            "their tasks (one-shot path finding); never: only max_duration."
        ),
    ] = "parked"
    max_duration: Annotated[
        int,
        quantity(
            TIME,
            ge=1,
            le=2_000_000_000,
            description="Greatest number of ticks of a run.",
        ),
    ] = 50_000
    at_limit: Annotated[
        Literal["end", "failure"] | None,
        Meta(
            description="Result of a run that reaches max_duration with open orders. end: finished, like "
            "a shift; failure: unfinished. Default: end if units.clock is set or `when` is "
            "never, else failure."
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.when == "never" and self.at_limit == "failure":
            raise ValueError(
                "stop has when: never and at_limit: failure, so that no run would ever be complete; "
                "leave at_limit out"
            )


class Measure(ConfigSection, frozen=True, kw_only=True):
    """The warm-up period. Task metrics exclude it; in sweeps and sizing, all metrics of runs that
    never end exclude it.
    """

    warm_up: Annotated[
        int,
        quantity(
            TIME,
            ge=0,
            le=2_000_000_000,
            description="Length of the warm-up period, in ticks.",
        ),
    ] = 0


class Scenario(ConfigSection, frozen=True, kw_only=True):
    """A scenario of automaton: a floor, a fleet, orders and the strategies that run them."""

    name: Annotated[SingleLine, Meta(description="The name in reports and recordings.")]
    summary: Annotated[SingleLine | None, Meta(description="One line for `automaton list`.")] = None
    layout: Annotated[
        Parameters,
        Meta(description="The floor: a generator, a picture, a file or a matrix."),
    ]
    fleet: Fleet
    areas: Annotated[
        dict[str, Area], Meta(description="Parts of the floor that are closed to some robots.")
    ] = msgspec.field(default_factory=dict)
    locations: Locations = msgspec.field(default_factory=dict)
    floor: ChangingFloor = ChangingFloor()
    streets: Annotated[
        Streets | None,
        Meta(
            description="Streets, which guide routes: robots prefer moves with low weights, and moves "
            "can be closed. A file, a pattern, or a list of streets. null: all moves have the weight 1."
        ),
    ] = None
    units: Units = Units()
    durations: Durations = Durations()
    orders: Orders = Orders(generator="full-shelves")
    pods: Pods = Pods()
    stations: Annotated[
        dict[SingleLine, PodStation],
        Meta(
            description="Stations with names; all other stations are identified by their numbers."
        ),
    ] = msgspec.field(default_factory=dict)
    strategy: Strategies = Strategies()
    world: WorldRules = WorldRules()
    battery: Annotated[
        Battery | None,
        Meta(description="The batteries of the robots; left out: energy is not simulated."),
    ] = None
    faults: Faults = Faults()
    information: Annotated[
        Literal["everything", "orders"] | Radius,
        Meta(
            description="What strategies see: everything, only the list of orders, or what lies "
            "within a radius."
        ),
    ] = "everything"
    stop: Stop = Stop()
    measure: Annotated[
        Measure | None,
        Meta(description="Measure task times and delays, and exclude a warm-up period."),
    ] = None
    refine: Annotated[
        int,
        Meta(
            ge=1,
            le=MAX_REFINEMENT,
            description="Number of simulated ticks per tick of this file. Durations are multiplied by "
            "this number, and rates are divided by it.",
        ),
    ] = 1
    decide: Annotated[
        Literal["coarse", "fine"],
        Meta(
            description="When strategies decide, if each tick is divided into `refine` fine ticks. "
            "coarse: only in the first fine tick of each tick, when robots also begin their "
            "operations; fine: in every fine tick."
        ),
    ] = "coarse"
    seed: Annotated[
        int, Meta(ge=0, le=2**63 - 1, description="The seed of all random draws of a run.")
    ] = 1

    @property
    def ends_at_limit(self) -> bool:
        """Whether a run is complete that reaches stop.max_duration."""
        if self.stop.at_limit is not None:
            return self.stop.at_limit == "end"
        return self.stop.when == "never" or self.units.clock is not None

    def _check_clock(self) -> None:
        """Rates by the hour of the week need a date, and a tick that is a time. Raises ValueError."""
        scale = self.units.scale
        if scale.clock is None:
            raise ValueError(
                "orders has arrivals with a profile of the week, but the date of tick 0 is unknown; "
                'set units.clock, such as units: {clock: "2026-03-02 06:00"}'
            )
        if scale.clock.day is None:
            raise ValueError(
                f"units has the clock '{self.units.clock}' without a date, but the profile of "
                "orders.arrivals needs one for its weekdays, such as '2026-03-02 06:00'"
            )
        try:
            scale.tick_seconds  # noqa: B018 - raises unless a tick is a time
        except InputError as error:
            text = f"orders has arrivals with a profile of orders per hour, but {error.message}"
            raise ValueError(text) from None

    def __post_init__(self) -> None:
        if self.orders.follows_profile:
            self._check_clock()
        tick = unit(self.units.tick)
        slowest = max(self.durations.moves)
        for kind in self.fleet.types:
            try:
                own = kind.durations.within(self.durations)
            except ValueError as error:
                raise ValueError(f"fleet has robots of the type {kind.name}, but {error}") from None
            if self.battery is None and kind.battery != TypeBattery():
                raise ValueError(
                    f"fleet has robots of the type {kind.name} with batteries, but the scenario has "
                    "none; set battery, which says the rest of them"
                )
            if self.battery is not None:
                try:
                    kind.battery.within(self.battery)
                except ValueError as error:
                    text = f"fleet has robots of the type {kind.name}, but {error}"
                    raise ValueError(text) from None
            slowest = max(slowest, kind.move_time_factor * max(own.moves))
        if slowest > MAX_MOVE_TICKS:
            raise ValueError(
                f"fleet has robots whose moves take {ticks_and_time(slowest, tick)} (move_time_factor x "
                f"durations.move), at most {ticks_and_time(MAX_MOVE_TICKS, tick)} are allowed"
            )
        if self.measure is not None and self.measure.warm_up >= self.stop.max_duration:
            raise ValueError(
                f"measure begins after {ticks_and_time(self.measure.warm_up, tick)} (warm_up), "
                f"but the run stops after {ticks_and_time(self.stop.max_duration, tick)} "
                "(stop.max_duration)"
            )


class LegendEntry(ConfigSection, frozen=True, kw_only=True):
    """What a symbol of a picture stands for."""

    kind: Annotated[
        KindName,
        Meta(description="The kind of cell."),
    ]
    capacity: Annotated[
        Literal[0, 1, 2] | None,
        Meta(
            description="Robots at a time: 1, 2 (one each way; at a charger both at once, whichever "
            "way they came) or 0 (any number)."
        ),
    ] = None
    exits: Annotated[
        tuple[Direction, ...] | None,
        Meta(
            description="Directions in which a robot may leave; a cell with a single exit is one-way."
        ),
    ] = None
    opens: Annotated[
        tuple[Direction, ...] | None,
        Meta(
            description="A robot enters and leaves over these sides alone; arrows do not count there."
        ),
    ] = None
    loaded: Annotated[
        bool, Meta(description="A shelf that holds a load, or storage with a pod.")
    ] = False


class PictureLayout(ConfigSection, frozen=True, kw_only=True):
    """A floor drawn in characters."""

    picture: Annotated[NonEmptyText, Meta(description="One line per row, one character per cell.")]
    legend: Annotated[dict[str, Any], Meta(description="Further symbols.")] = msgspec.field(
        default_factory=dict
    )


class MatrixLayout(ConfigSection, frozen=True, kw_only=True):
    """A floor of racks and docks as a CSV file of codes."""

    matrix: Annotated[
        NonEmptyText,
        Meta(
            description="Path, relative to the scenario. Codes: -1 wall, 0 free, 50 intersection, "
            "100 rack, 200 dock."
        ),
    ]
    capacity: Annotated[
        Literal[0, 1, 2],
        Meta(description="Robots at a time in a free cell: any number (0), 1, or 2."),
    ] = 0


class FileLayout(ConfigSection, frozen=True, kw_only=True):
    """A floor drawn in a separate file."""

    file: Annotated[NonEmptyText, Meta(description="Path, relative to the scenario.")]
    legend: Annotated[dict[str, Any], Meta(description="Further symbols.")] = msgspec.field(
        default_factory=dict
    )
