"""Define the schema of a scenario file: one struct for each of its sections.

The structs are the schema: `automaton schema` derives the JSON Schema from them, the reader its
messages. What depends on the floor or on the chosen strategies is checked in `resolve`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from automaton.errors import InputError
from automaton.scenario.changing_floor import ChangingFloor as ChangingFloor
from automaton.scenario.changing_floor import Locations
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
MEMORY_PATTERN = r"^(?=[^a-zA-Z]*[1-9])\d{1,9}(\.\d+)? [KMGT]iB$"

MAX_MOVE_TICKS = 65_535  # ticks
MAX_REFINEMENT = 1000  # fine ticks in a tick

INSTEAD = "instead"  # in Meta.extra: what is now written for a value that was allowed before

LAYER_NAMES = ("zoning", "charging", "allocation", "routing", "right_of_way")


class Units(ConfigSection, frozen=True, kw_only=True):
    """What a tick and a cell stand for: for reports, and strategies that think in minutes."""

    tick: Annotated[
        str,
        Meta(
            description='A number above 0 and a name, such as "1 cycle" or "0.5 s".',
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
            description='The time of tick 0, such as "2026-03-02 06:00" or "06:00": clock times that '
            "the scenario names are counted from it. With an offset, "
            '"2026-03-02 06:00+01:00", it goes with files whose times have one.'
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.clock is not None:
            try:
                read_clock(self.clock)
            except InputError as error:
                raise ValueError(f"clock {error.message}") from None

    @property
    def scale(self) -> Scale:
        """What texts with units are measured by."""
        return Scale(self.tick, self.cell, read_clock(self.clock) if self.clock else None)


class Strategies(ConfigSection, frozen=True, kw_only=True):
    """The strategy of each layer: a name, or {name: NAME, ...parameters}."""

    zoning: Annotated[StrategySpec, Meta(description="Which robot serves which part.")] = "none"
    charging: Annotated[StrategySpec, Meta(description="When and where a robot charges.")] = "none"
    allocation: Annotated[StrategySpec, Meta(description="Which order a robot does next.")] = (
        "independent"
    )
    routing: Annotated[StrategySpec, Meta(description="Which cells it drives through.")] = (
        "shortest"
    )
    right_of_way: Annotated[
        StrategySpec | None,
        Meta(
            description="Who goes first where robots meet. null: pibt; but epibt where a turn or a "
            "move takes 2 ticks or more, at least half of all ways between neighbouring cells are "
            "open in both directions, nothing closes, opens or lifts on the floor, and epibt serves "
            "the scenario; and retreat where robots follow the routes of a routing other than "
            "shortest, where information is not everything, and on a floor without a ring, where "
            "robots cannot make way."
        ),
    ] = None


class WorldRules(ConfigSection, frozen=True, kw_only=True):
    """Rules of motion that a scenario may change."""

    following: Annotated[
        Literal["convoy", "handover", "none"],
        Meta(
            description="When a robot may begin to move into a cell. none: if the cell was free when "
            "the tick began; handover: also if its holder gives it up in this tick, the last one of "
            "the holder's move; convoy: also if its holder is on its way out.",
            extra={INSTEAD: {True: "handover", False: "none"}},
        ),
    ] = "convoy"
    access_cell: Annotated[
        Literal["fixed", "nearest"],
        Meta(
            description="Which cell a slot is served from. fixed: picks from the east if possible, "
            "drops from the west; nearest: the one with the least rows and columns to the robot."
        ),
    ] = "fixed"
    traffic_zones: Annotated[
        Literal["undirected", "directed", "with-intersections"],
        Meta(
            description="The stretches between intersections: one zone each, one for each "
            "direction of travel, or intersections as zones of their own, too."
        ),
    ] = "undirected"
    slowdown: Annotated[
        Literal["none", "zones"],
        Meta(
            description="zones: a move that starts in a zone with m robots takes m times as long."
        ),
    ] = "none"
    extra_tick_probability: Annotated[
        float, Meta(ge=0, le=1, description="Probability that a move takes one tick more.")
    ] = 0.0
    distance_tables: Annotated[
        str,
        Meta(
            description='Memory for tables of distances, such as "512 MiB": a number and KiB, MiB, '
            "GiB or TiB. It is taken as tables are needed, and decides nothing but the speed. A "
            "strategy with weights of its own, such as epibt with guidance lattice, may take as much "
            "again.",
            pattern=MEMORY_PATTERN,
        ),
    ] = "1 GiB"


class Radius(ConfigSection, frozen=True, kw_only=True):
    """A robot knows what lies within this many cells of it."""

    radius: Annotated[int, quantity(CELLS, ge=1, le=10_000, description="The distance in cells.")]
    shape: Annotated[
        Literal["square", "circle"],
        Meta(description="Along rows and columns (Chebyshev), or as the crow flies."),
    ] = "square"
    orders: Annotated[
        Literal["all", "zones"],
        Meta(
            description="zones: it knows only the orders and stations in its own zone and in those "
            "of the robots that it knows."
        ),
    ] = "all"


class Stop(ConfigSection, frozen=True, kw_only=True):
    """When a run ends."""

    when: Annotated[
        Literal["parked", "delivered", "never"],
        Meta(description="parked: all is delivered and every robot is home again."),
    ] = "parked"
    max_duration: Annotated[
        int,
        quantity(
            TIME,
            ge=1,
            le=2_000_000_000,
            description="Ticks after which a run ends in any case.",
        ),
    ] = 50_000


class Measure(ConfigSection, frozen=True, kw_only=True):
    """What the metrics of tasks count, and in sweeps and sizes all of runs that never end."""

    warm_up: Annotated[
        int,
        quantity(
            TIME,
            ge=0,
            le=2_000_000_000,
            description="Ticks at the beginning of a run that they leave out.",
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
        dict[str, Area], Meta(description="Parts of the floor that not every robot may enter.")
    ] = msgspec.field(default_factory=dict)
    locations: Locations = msgspec.field(default_factory=dict)
    floor: ChangingFloor = ChangingFloor()
    units: Units = Units()
    durations: Durations = Durations()
    orders: Orders = Orders(generator="full-shelves")
    pods: Pods = Pods()
    stations: Annotated[
        dict[SingleLine, PodStation],
        Meta(description="Stations with names; the others keep their numbers."),
    ] = msgspec.field(default_factory=dict)
    strategy: Strategies = Strategies()
    world: WorldRules = WorldRules()
    battery: Annotated[
        Battery | None, Meta(description="Robots run on batteries; left out: no energy is counted.")
    ] = None
    faults: Faults = Faults()
    information: Annotated[
        Literal["everything", "orders"] | Radius,
        Meta(description="What strategies see: everything, the order list only, or a radius."),
    ] = "everything"
    stop: Stop = Stop()
    measure: Annotated[
        Measure | None,
        Meta(description="Measure the tasks: how long they take, and by how much too long."),
    ] = None
    refine: Annotated[
        int,
        Meta(
            ge=1,
            le=MAX_REFINEMENT,
            description="How many times finer the run's tick is than the tick of this file: all numbers "
            "of ticks are multiplied by it, all rates divided.",
        ),
    ] = 1
    decide: Annotated[
        Literal["coarse", "fine"],
        Meta(
            description="When strategies decide in a refined run. coarse: in the first of `refine` "
            "ticks, and robots begin what they do in these, too; fine: in every tick."
        ),
    ] = "coarse"
    seed: Annotated[
        int, Meta(ge=0, le=2**63 - 1, description="Every random draw of a run follows from it.")
    ] = 1

    def __post_init__(self) -> None:
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
        Meta(description="Directions in which a robot may leave; one alone makes it one-way."),
    ] = None
    opens: Annotated[
        tuple[Direction, ...] | None,
        Meta(
            description="Sides over which alone a robot enters and leaves, whatever arrows say there."
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
    """A floor drawn in a file of its own."""

    file: Annotated[NonEmptyText, Meta(description="Path, relative to the scenario.")]
    legend: Annotated[dict[str, Any], Meta(description="Further symbols.")] = msgspec.field(
        default_factory=dict
    )
