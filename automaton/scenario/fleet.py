"""What a scenario file may say of its robots: how many, of which types, and where they may not go."""

from __future__ import annotations

from typing import Annotated, ClassVar, Final, Literal

import msgspec
from msgspec import Meta

from automaton.scenario.durations import TypeDurations
from automaton.scenario.energy_and_faults import TypeBattery
from automaton.scenario.quantities import (
    ConfigSection,
    Direction,
    NonEmptyText,
    Pair,
    SingleLine,
    StrategySpec,
    Weight,
)

ONE_CELL: Final = dict.fromkeys(
    ("size", "trailers", "swept_turns"),
    "a robot takes one cell: choose units.cell at least as large as the largest robot",
)
Kinematics = Literal["rail", "differential", "omni"]
HEADING_COUNTS: Final[dict[Kinematics, int]] = {"omni": 1, "rail": 2, "differential": 4}
ALL, EMPTY, LOADED = GROUPS = ("all", "empty", "loaded")  # of robots, to which areas may be closed


class TypeStrategy(ConfigSection, frozen=True, kw_only=True):
    """The strategies that robots of a type have to themselves."""

    refused: ClassVar[dict[str, str]] = dict.fromkeys(
        ("zoning", "charging", "routing", "right_of_way"),
        "all robots have the same one; set it under strategy",
    )

    allocation: Annotated[
        StrategySpec | None,
        Meta(
            description="Which order such a robot does next: a name, or {name: NAME, "
            "...parameters}; left out: as in strategy.allocation."
        ),
    ] = None


class FleetType(ConfigSection, frozen=True, kw_only=True):
    """Robots that are alike; where the fleet has several types, robots have them by identity."""

    refused: ClassVar[dict[str, str]] = ONE_CELL

    name: Annotated[SingleLine, Meta(description="What areas, priorities and reports call them.")]
    robots: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | None,
        Meta(description="How many there are; one type may leave it out: the rest."),
    ] = None
    move_time_factor: Annotated[
        int, Meta(ge=1, le=1000, description="A move takes so many times durations.move.")
    ] = 1
    durations: Annotated[
        TypeDurations, Meta(description="How long its operations take; left out: as in durations.")
    ] = TypeDurations()
    battery: Annotated[TypeBattery, Meta(description="Its batteries; left out: as in battery.")] = (
        TypeBattery()
    )
    payload: Annotated[
        Weight | None, Meta(description="The heaviest order that it carries; left out: any.")
    ] = None
    kinematics: Annotated[
        Kinematics | None, Meta(description="How it drives; left out: as in fleet.kinematics.")
    ] = None
    strategy: Annotated[
        TypeStrategy, Meta(description="Its own strategies; left out: as in strategy.")
    ] = TypeStrategy()

    @property
    def own_allocation(self) -> str:
        """The name of its own allocation strategy, "" where it has none."""
        spec = self.strategy.allocation
        return str(spec.get("name")) if isinstance(spec, dict) else spec or ""


class StartFile(ConfigSection, frozen=True, kw_only=True):
    """The cells where robots begin, as a file."""

    file: Annotated[
        NonEmptyText,
        Meta(
            description="A CSV file with the columns x, y and, where robots face different ways, "
            "heading (east, south, west, north); path relative to the scenario."
        ),
    ]


class Fleet(ConfigSection, frozen=True, kw_only=True):
    """The robots."""

    refused: ClassVar[dict[str, str]] = ONE_CELL

    robots: Annotated[int, Meta(ge=1, le=1_000_000, description="Number of robots.")]
    kinematics: Annotated[
        Kinematics,
        Meta(
            description="rail: reverses freely, turns only on turntables; differential: every turn "
            "by 90 degrees takes time; omni: drives in any direction without turning."
        ),
    ] = "differential"
    start: Annotated[
        Literal["parking-bays", "random", "racks"] | tuple[Pair, ...] | StartFile | None,
        Meta(
            description="Where robots begin: parking-bays, random, racks (in front of random "
            "racks), a list of cells, or a file of them. Left out: where the picture draws "
            "robots, else in parking bays if the floor has any, else random."
        ),
    ] = None
    heading: Annotated[
        Direction | tuple[Direction, ...] | None,
        Meta(
            description="Which way differential robots face at the start: all the same way, or one "
            "by one. Left out: along a way out of their cell, south before north, east and west."
        ),
    ] = None
    when_idle: Annotated[
        Literal["park", "leave"],
        Meta(
            description="What robots without work do. park: drive to where they began; leave: "
            "leave the floor where they stand, and come back there for an order."
        ),
    ] = "park"
    types: Annotated[
        tuple[FleetType, ...],
        Meta(max_length=100, description="Types of robots; left out: all are alike."),
    ] = ()

    def __post_init__(self) -> None:
        if self.heading is not None and "differential" not in self.all_kinematics:
            others = " and ".join(self.all_kinematics)
            raise ValueError(f"heading belongs to differential robots, not to {others}")
        if isinstance(self.heading, tuple) and len(self.heading) != self.robots:
            raise ValueError(
                f"heading lists {len(self.heading)} directions, but fleet.robots is {self.robots}"
            )
        names = [kind.name for kind in self.types]
        for kind in self.types:
            if kind.name in GROUPS:
                raise ValueError(f"types must not name a type {kind.name}: areas mean others by it")
            if kind.durations.turn is not None and self.kinematics_of(kind) == "omni":
                raise ValueError(
                    f"types gives {kind.name} durations.turn, but omni robots do not turn; leave it "
                    "out, or set kinematics"
                )
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"types names {name} twice")
        rest = [kind.name for kind in self.types if kind.robots is None]
        if len(rest) > 1:
            raise ValueError(
                f"types must say how many robots all but one are: {rest[0]} or {rest[1]}"
            )
        given = sum(kind.robots or 0 for kind in self.types)
        if rest and given >= self.robots:
            raise ValueError(
                f"types list {given} robots of fleet.robots {self.robots}: none is left "
                f"for {rest[0]}"
            )
        if self.types and not rest and given != self.robots:
            raise ValueError(f"types list {given} robots, but fleet.robots is {self.robots}")

    def kinematics_of(self, kind: FleetType) -> Kinematics:
        """How the robots of a type drive."""
        return kind.kinematics or self.kinematics

    @property
    def all_kinematics(self) -> tuple[Kinematics, ...]:
        """How its robots drive, each way once, in the order of the types."""
        return tuple(dict.fromkeys(map(self.kinematics_of, self.types))) or (self.kinematics,)

    @property
    def counts(self) -> list[int]:
        """How many robots there are of each type."""
        given = sum(kind.robots or 0 for kind in self.types)
        return [kind.robots or self.robots - given for kind in self.types]


class Area(ConfigSection, frozen=True, kw_only=True):
    """A rectangle of the floor that is closed to some robots."""

    first: Annotated[Pair, Meta(description="A corner of it.")] = msgspec.field(name="from")
    last: Annotated[Pair, Meta(description="The opposite corner; both belong to it.")] = (
        msgspec.field(name="to")
    )
    closed_to: Annotated[
        tuple[SingleLine, ...],
        Meta(
            description="Who must not enter it: types by name, all, empty (robots without a load) or "
            "loaded (those with one)."
        ),
    ]

    def holds(self, x: int, y: int) -> bool:
        """Whether a cell belongs to it."""
        (x0, y0), (x1, y1) = self.first, self.last
        return min(x0, x1) <= x <= max(x0, x1) and min(y0, y1) <= y <= max(y0, y1)

    def __post_init__(self) -> None:
        if not self.closed_to:
            raise ValueError("closed_to must name a type of robots, or be all, empty or loaded")
