"""The robots of a scenario: number, types, batteries and breakdowns.

Also the areas that are closed to some robots.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Final, Literal

import msgspec
from msgspec import Meta

from automaton.scenario.durations import Distribution, TypeDurations
from automaton.scenario.quantities import (
    CHARGE_RATE,
    MOMENT,
    PROBABILITY,
    TIME,
    ConfigSection,
    Direction,
    LongTicks,
    Metres,
    NonEmptyText,
    Pair,
    SingleLine,
    StrategySpec,
    Ticks,
    Weight,
    quantity,
)

ONE_CELL: Final = dict.fromkeys(
    ("size", "trailers", "swept_turns"),
    "a robot takes one cell: choose units.cell at least as large as the largest robot",
)
Kinematics = Literal["rail", "differential", "omni"]
HEADING_COUNTS: Final[dict[Kinematics, int]] = {"omni": 1, "rail": 2, "differential": 4}
ALL, EMPTY, LOADED = GROUPS = ("all", "empty", "loaded")  # to which areas may be closed
Percent = Annotated[float, Meta(ge=0, le=100)]
Rate = Annotated[
    float, quantity(CHARGE_RATE, ge=0, le=100, description="Percent per tick of the operation.")
]
GivingRate = Annotated[
    float,
    quantity(
        CHARGE_RATE, ge=0.0001, le=100, description="Percent of a full battery per tick, above 0."
    ),
]


class Drain(ConfigSection, frozen=True, kw_only=True):
    """Energy use per tick of each operation, in percent of a full battery."""

    move: Rate
    turn: Rate = 0.0
    pick: Rate = 0.0
    drop: Rate = 0.0
    try_drop: Rate = 0.0
    wait: Annotated[
        Rate,
        Meta(
            description="Percent of a full battery per tick of standing on the floor, for any reason."
        ),
    ] = 0.0
    loaded_factor: Annotated[
        float, Meta(ge=0, le=10, description="Factor on the energy use of robots with a load.")
    ] = 1.0


class ChargeRange(ConfigSection, frozen=True, kw_only=True):
    """A random charge of each robot, uniformly distributed."""

    least: Annotated[Percent, Meta(description="The least charge, percent.")] = msgspec.field(
        name="from"
    )
    most: Annotated[Percent, Meta(description="The largest charge, percent.")] = msgspec.field(
        name="to"
    )

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least:g}) must not be above to ({self.most:g})")


class Battery(ConfigSection, frozen=True, kw_only=True):
    """The batteries of the robots."""

    drain: Drain
    charge_rate: Annotated[
        GivingRate | tuple[tuple[Percent, GivingRate], ...],
        Meta(
            description="Charge gained per tick at a charger, in percent; or a curve of [from, rate] "
            "pairs, the first from 0."
        ),
    ]
    initial_charge: Annotated[
        Percent | tuple[Percent, ...] | ChargeRange,
        Meta(
            description="Charge at the start, in percent: one value for all robots, one for each robot, "
            "or random values {from, to}."
        ),
    ] = 100.0
    reserve: Annotated[
        Percent,
        Meta(description="Charge, in percent, below which no charging strategy plans to go."),
    ] = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.charge_rate, tuple):
            since = [step[0] for step in self.charge_rate]
            if not since or since[0] != 0 or since != sorted(set(since)):
                raise ValueError("charge_rate must rise from 0, such as [[0, 1], [80, 0.5]]")


class TypeDrain(ConfigSection, frozen=True, kw_only=True):
    """Energy use of one type of robots per tick of each operation."""

    move: Annotated[
        Rate | None, Meta(description="Energy of a tick of moving: see battery.drain.")
    ] = None
    turn: Annotated[
        Rate | None, Meta(description="Energy of a tick of turning: see battery.drain.")
    ] = None
    pick: Annotated[
        Rate | None, Meta(description="Energy of a tick of picking: see battery.drain.")
    ] = None
    drop: Annotated[
        Rate | None, Meta(description="Energy of a tick of dropping: see battery.drain.")
    ] = None
    try_drop: Annotated[
        Rate | None, Meta(description="Energy of a tick of try_drop: see battery.drain.")
    ] = None
    wait: Annotated[
        Rate | None, Meta(description="Energy of a tick of standing: see battery.drain.")
    ] = None
    loaded_factor: Annotated[
        Annotated[float, Meta(ge=0, le=10)] | None,
        Meta(description="Factor on the energy use with a load: see battery.drain."),
    ] = None


class TypeBattery(ConfigSection, frozen=True, kw_only=True):
    """Batteries of one type of robots; missing keys are as in `battery`."""

    drain: Annotated[TypeDrain, Meta(description="Energy use of this type: see battery.drain.")] = (
        TypeDrain()
    )
    charge_rate: Annotated[
        GivingRate | tuple[tuple[Percent, GivingRate], ...] | None,
        Meta(description="Charging rate of this type: see battery.charge_rate."),
    ] = None
    initial_charge: Annotated[
        Percent | ChargeRange | None,
        Meta(
            description="Charge at the start, in percent: one value for all robots of the type, "
            "or random values {from, to}."
        ),
    ] = None
    reserve: Annotated[
        Percent | None, Meta(description="Reserve of this type, percent: see battery.reserve.")
    ] = None

    def within(self, usual: Battery) -> Battery:
        """This battery, completed by that of the fleet. Raises ValueError."""
        drain = msgspec.structs.replace(usual.drain, **_stated(self.drain))
        return Battery(**(msgspec.structs.asdict(usual) | _stated(self) | {"drain": drain}))


def _stated(section: msgspec.Struct) -> dict[str, Any]:
    """The keys of a section that are set."""
    return {
        name: value for name, value in msgspec.structs.asdict(section).items() if value is not None
    }


class TypeStrategy(ConfigSection, frozen=True, kw_only=True):
    """The strategies of one type of robots."""

    refused: ClassVar[dict[str, str]] = dict.fromkeys(
        ("zoning", "charging", "routing", "right_of_way"),
        "all robots have the same one; set it under strategy",
    )

    allocation: Annotated[
        StrategySpec | None,
        Meta(
            description="Strategy that chooses the next order of these robots: a name, or {name: "
            "NAME, ...parameters}; left out: as in strategy.allocation."
        ),
    ] = None


class FleetType(ConfigSection, frozen=True, kw_only=True):
    """One type of robots. Robots get their types by number: the lowest numbers belong to the first
    type.
    """

    refused: ClassVar[dict[str, str]] = ONE_CELL

    name: Annotated[
        SingleLine, Meta(description="Name of the type in areas, priorities and reports.")
    ]
    robots: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | None,
        Meta(description="Number of robots. One type may omit it and gets the remaining robots."),
    ] = None
    move_time_factor: Annotated[
        int, Meta(ge=1, le=1000, description="Factor on durations.move for this type.")
    ] = 1
    durations: Annotated[
        TypeDurations,
        Meta(description="Durations of this type; left out: as in durations."),
    ] = TypeDurations()
    battery: Annotated[
        TypeBattery, Meta(description="Batteries of this type; left out: as in battery.")
    ] = TypeBattery()
    payload: Annotated[
        Weight | None,
        Meta(description="The heaviest order that a robot of this type can carry; left out: any."),
    ] = None
    kinematics: Annotated[
        Kinematics | None,
        Meta(description="Kinematics of this type; left out: as in fleet.kinematics."),
    ] = None
    length: Annotated[
        Metres | None,
        Meta(description="Length of a robot of this type; left out: as in fleet.length."),
    ] = None
    width: Annotated[
        Metres | None,
        Meta(description="Width of a robot of this type; left out: as in fleet.width."),
    ] = None
    strategy: Annotated[
        TypeStrategy,
        Meta(description="Strategies of this type; left out: as in strategy."),
    ] = TypeStrategy()

    @property
    def own_allocation(self) -> str:
        """The name of the type's own allocation strategy, or ""."""
        spec = self.strategy.allocation
        return str(spec.get("name")) if isinstance(spec, dict) else spec or ""


class StartFile(ConfigSection, frozen=True, kw_only=True):
    """A file of start cells."""

    file: Annotated[
        NonEmptyText,
        Meta(
            description="A CSV file with the columns x, y and, if headings differ, heading (east, "
            "south, west, north); path relative to the scenario."
        ),
    ]


class Fleet(ConfigSection, frozen=True, kw_only=True):
    """The robots."""

    refused: ClassVar[dict[str, str]] = ONE_CELL

    robots: Annotated[int, Meta(ge=1, le=1_000_000, description="Number of robots.")]
    kinematics: Annotated[
        Kinematics,
        Meta(
            description="How robots drive. rail: they reverse freely and turn only on turntables; "
            "differential: each turn by 90 degrees takes time; omni: they drive in any direction "
            "without turning."
        ),
    ] = "differential"
    start: Annotated[
        Literal["parking-bays", "random", "racks"] | tuple[Pair, ...] | StartFile | None,
        Meta(
            description="Start cells of the robots: parking-bays, random, racks (in front of random "
            "racks), a list of cells, or a file. Left out: the robots drawn in the picture, else the "
            "parking bays, else random."
        ),
    ] = None
    heading: Annotated[
        Direction | tuple[Direction, ...] | None,
        Meta(
            description="Initial heading of differential robots: one for all, or one for each. Left out: "
            "each robot faces an exit of its cell; of several exits, the first of south, "
            "north, east and west."
        ),
    ] = None
    when_idle: Annotated[
        Literal["park", "leave"],
        Meta(
            description="What robots without work do. park: drive to their start cell; leave: "
            "disappear from the floor where they stand, and return there for an order."
        ),
    ] = "park"
    length: Annotated[
        Metres | None,
        Meta(
            description="Length of a robot, in metres. A robot always occupies one cell; `automaton "
            "check` warns if the robot is longer than the cell."
        ),
    ] = None
    width: Annotated[
        Metres | None, Meta(description="Width of a robot, in metres: see length.")
    ] = None
    types: Annotated[
        tuple[FleetType, ...],
        Meta(max_length=100, description="Types of robots; left out: all robots are alike."),
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
                raise ValueError(
                    f"types must not name a type {kind.name}: the word has another meaning in areas"
                )
            if kind.durations.turn is not None and self.kinematics_of(kind) == "omni":
                raise ValueError(
                    f"types gives {kind.name} durations.turn, but omni robots do not turn; leave it "
                    "out, or set kinematics"
                )
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"types contains {name} twice")
        rest = [kind.name for kind in self.types if kind.robots is None]
        if len(rest) > 1:
            raise ValueError(f"types must set robots for all types but one: {rest[0]} or {rest[1]}")
        given = sum(kind.robots or 0 for kind in self.types)
        if rest and given >= self.robots:
            raise ValueError(
                f"types list {given} robots and fleet.robots is {self.robots}: none is left for "
                f"{rest[0]}"
            )
        if self.types and not rest and given != self.robots:
            raise ValueError(f"types list {given} robots, but fleet.robots is {self.robots}")

    def kinematics_of(self, kind: FleetType) -> Kinematics:
        """The kinematics of a type."""
        return kind.kinematics or self.kinematics

    @property
    def all_kinematics(self) -> tuple[Kinematics, ...]:
        """The kinematics of the robots, each once, in the order of the types."""
        return tuple(dict.fromkeys(map(self.kinematics_of, self.types))) or (self.kinematics,)

    @property
    def counts(self) -> list[int]:
        """The number of robots of each type."""
        given = sum(kind.robots or 0 for kind in self.types)
        return [kind.robots or self.robots - given for kind in self.types]


class Area(ConfigSection, frozen=True, kw_only=True):
    """A rectangle of the floor that is closed to some robots."""

    first: Annotated[Pair, Meta(description="One corner of the rectangle.")] = msgspec.field(
        name="from"
    )
    last: Annotated[
        Pair, Meta(description="The opposite corner; both corners belong to the area.")
    ] = msgspec.field(name="to")
    closed_to: Annotated[
        tuple[SingleLine, ...],
        Meta(
            description="Robots that must not enter: names of types, all, empty (robots without a "
            "load) or loaded (robots with a load)."
        ),
    ]

    def holds(self, x: int, y: int) -> bool:
        """Whether a cell belongs to the area."""
        (x0, y0), (x1, y1) = self.first, self.last
        return min(x0, x1) <= x <= max(x0, x1) and min(y0, y1) <= y <= max(y0, y1)

    def __post_init__(self) -> None:
        if not self.closed_to:
            raise ValueError("closed_to must name a type of robots, or be all, empty or loaded")


class Fault(ConfigSection, frozen=True, kw_only=True):
    """One robot breaks down."""

    robot: Annotated[int, Meta(ge=0, le=999_999, description="The number of the robot, from 0.")]
    at: Annotated[
        int, quantity(MOMENT, ge=1, le=2_000_000_000, description="The tick of the breakdown.")
    ]


class DelayTicks(ConfigSection, frozen=True, kw_only=True):
    """A range of durations, in ticks."""

    least: Annotated[Ticks, Meta(description="The shortest duration.")] = msgspec.field(name="from")
    most: Annotated[Ticks, Meta(description="The longest duration.")] = msgspec.field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least}) must not be above to ({self.most})")


class Bell(ConfigSection, frozen=True, kw_only=True):
    """A normal distribution, limited to a range. Mean and standard deviation are shares of the
    width of the range; the mean counts from its least value.
    """

    mean_ratio: Annotated[float, Meta(ge=0, le=1, description="Mean, as a share of the range.")] = (
        0.5
    )
    sd_ratio: Annotated[
        float, Meta(ge=0, le=10, description="Standard deviation, as a share of the range.")
    ] = 0.22


class BellDelays(ConfigSection, frozen=True, kw_only=True):
    """Normally distributed delays."""

    gaussian: Bell


class Delays(ConfigSection, frozen=True, kw_only=True):
    """Random delays of robots, as in the League of Robot Runners 2026."""

    probability: Annotated[
        float,
        quantity(
            PROBABILITY,
            gt=0,
            le=1,
            description="Probability per tick that a delay of a robot on the floor begins.",
        ),
    ]
    ticks: Annotated[DelayTicks, Meta(description="Duration of a delay.")]
    events: Annotated[
        Literal["bernoulli", "poisson"],
        Meta(
            description="How delays begin. bernoulli: one draw per robot; poisson: the number of "
            "newly delayed robots is Poisson distributed; its mean is `probability` times the "
            "number of robots that may be delayed."
        ),
    ] = "bernoulli"
    distribution: Annotated[
        Literal["uniform"] | BellDelays,
        Meta(
            description="Distribution of the duration. uniform: all values equally likely; {gaussian: "
            "{mean_ratio, sd_ratio}}: normal, rounded, and limited to the range of ticks."
        ),
    ] = "uniform"
    of: Annotated[
        tuple[Literal["move", "turn"], ...],
        Meta(
            description="Operations that a delay lengthens. Other operations take their usual "
            "time; after them, the robot stands for the rest of the delay."
        ),
    ] = ("move", "turn")

    def __post_init__(self) -> None:
        if self.probability >= 1:
            raise ValueError("probability must be below 1: with 1 robots would be delayed forever")


class Faults(ConfigSection, frozen=True, kw_only=True):
    """Breakdowns, delays and repairs of robots."""

    listed: Annotated[tuple[Fault, ...], Meta(description="A list of breakdowns.")] = msgspec.field(
        name="list", default=()
    )
    failure_probability: Annotated[
        float,
        quantity(
            PROBABILITY,
            ge=0,
            le=1,
            description="Probability per tick that a robot on the floor breaks down.",
        ),
    ] = 0.0
    mtbf: Annotated[
        Annotated[float, quantity(TIME, ge=1, le=1e9)] | None,
        Meta(
            description="The mean time between failures of a robot on the floor, in ticks; it sets "
            "failure_probability to 1 / mtbf."
        ),
    ] = None
    tow_after: Annotated[
        LongTicks | None,
        Meta(
            description="Ticks after which a robot that is down is towed; null: it is never towed."
        ),
    ] = 300
    repair_time: Annotated[
        LongTicks | None,
        Meta(description="Ticks from towing until the robot is back; null: it never comes back."),
    ] = 600
    repair_in_place: Annotated[
        LongTicks | Distribution | None,
        Meta(
            description="Duration of a repair on the spot, after which the robot continues with its "
            "load and order; null: robots that break down are towed. Robots without charge are always "
            "towed."
        ),
    ] = None
    delays: Annotated[
        Delays | None, Meta(description="Random delays of robots; null: no delays.")
    ] = None
    charge: Annotated[
        Percent | Literal["kept"],
        Meta(
            description="Charge with which a repaired robot comes back, percent. kept: the charge at "
            "which it was towed, but at least battery.reserve if the battery was empty."
        ),
    ] = "kept"

    def __post_init__(self) -> None:
        if self.mtbf is not None and self.failure_probability:
            raise ValueError("mtbf and failure_probability are alternatives; set one of them")

    @property
    def probability(self) -> float:
        """The probability that a robot on the floor fails in a tick."""
        return self.failure_probability if self.mtbf is None else 1 / self.mtbf
