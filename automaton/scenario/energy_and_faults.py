"""Define the batteries of robots in a scenario file, and the robots that go down."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from automaton.scenario.durations import Distribution
from automaton.scenario.quantities import (
    CHARGE_RATE,
    MOMENT,
    PROBABILITY,
    TIME,
    ConfigSection,
    LongTicks,
    Ticks,
    quantity,
)

Percent = Annotated[float, Meta(ge=0, le=100)]
Rate = Annotated[
    float, quantity(CHARGE_RATE, ge=0, le=100, description="Percent of a full battery in a tick.")
]
GivingRate = Annotated[
    float, quantity(CHARGE_RATE, ge=0.0001, le=100, description="Percent of it in a tick.")
]


class Drain(ConfigSection, frozen=True, kw_only=True):
    """What a tick of each operation takes from the battery, percent of a full one."""

    move: Rate
    turn: Rate = 0.0
    pick: Rate = 0.0
    drop: Rate = 0.0
    try_drop: Rate = 0.0
    wait: Annotated[Rate, Meta(description="Standing on the floor, whatever the reason.")] = 0.0
    loaded_factor: Annotated[
        float, Meta(ge=0, le=10, description="How many times as much it takes with a load.")
    ] = 1.0


class ChargeRange(ConfigSection, frozen=True, kw_only=True):
    """Charges drawn for each robot."""

    least: Annotated[Percent, Meta(description="Percent.")] = msgspec.field(name="from")
    most: Annotated[Percent, Meta(description="Percent.")] = msgspec.field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least:g}) must not be above to ({self.most:g})")


class Battery(ConfigSection, frozen=True, kw_only=True):
    """The batteries of the robots; the same for all."""

    drain: Drain
    charge_rate: Annotated[
        GivingRate | tuple[tuple[Percent, GivingRate], ...],
        Meta(
            description="What a tick at a charger gives, in percent; or a curve: [from, rate] "
            "pairs, the first from 0."
        ),
    ]
    initial_charge: Annotated[
        Percent | tuple[Percent, ...] | ChargeRange,
        Meta(description="Percent at the start: for all, one by one, or drawn {from, to}."),
    ] = 100.0
    reserve: Annotated[
        Percent, Meta(description="Percent that plans of charging strategies never go below.")
    ] = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.charge_rate, tuple):
            since = [step[0] for step in self.charge_rate]
            if not since or since[0] != 0 or since != sorted(set(since)):
                raise ValueError("charge_rate must rise from 0, such as [[0, 1], [80, 0.5]]")


class TypeDrain(ConfigSection, frozen=True, kw_only=True):
    """What a tick of each operation takes from batteries of one type of robots."""

    move: Annotated[Rate | None, Meta(description="As battery.drain.move.")] = None
    turn: Annotated[Rate | None, Meta(description="As battery.drain.turn.")] = None
    pick: Annotated[Rate | None, Meta(description="As battery.drain.pick.")] = None
    drop: Annotated[Rate | None, Meta(description="As battery.drain.drop.")] = None
    try_drop: Annotated[Rate | None, Meta(description="As battery.drain.try_drop.")] = None
    wait: Annotated[Rate | None, Meta(description="As battery.drain.wait.")] = None
    loaded_factor: Annotated[
        Annotated[float, Meta(ge=0, le=10)] | None,
        Meta(description="As battery.drain.loaded_factor."),
    ] = None


class TypeBattery(ConfigSection, frozen=True, kw_only=True):
    """The batteries of one type of robots; what it leaves out is as in `battery`."""

    drain: Annotated[TypeDrain, Meta(description="As battery.drain.")] = TypeDrain()
    charge_rate: Annotated[
        GivingRate | tuple[tuple[Percent, GivingRate], ...] | None,
        Meta(description="As battery.charge_rate."),
    ] = None
    initial_charge: Annotated[
        Percent | ChargeRange | None,
        Meta(description="Percent at the start: of all robots of the type, or drawn {from, to}."),
    ] = None
    reserve: Annotated[Percent | None, Meta(description="As battery.reserve.")] = None

    def within(self, usual: Battery) -> Battery:
        """This battery, and the usual one for what is left out. Raises ValueError."""
        drain = msgspec.structs.replace(usual.drain, **_stated(self.drain))
        return Battery(**(msgspec.structs.asdict(usual) | _stated(self) | {"drain": drain}))


def _stated(section: msgspec.Struct) -> dict[str, Any]:
    """What a section says."""
    return {
        name: value for name, value in msgspec.structs.asdict(section).items() if value is not None
    }


class Fault(ConfigSection, frozen=True, kw_only=True):
    """One robot breaks down."""

    robot: Annotated[int, Meta(ge=0, le=999_999, description="Its number, from 0.")]
    at: Annotated[int, quantity(MOMENT, ge=1, le=2_000_000_000, description="In this tick.")]


class DelayTicks(ConfigSection, frozen=True, kw_only=True):
    """Durations from one to another."""

    least: Annotated[Ticks, Meta(description="The shortest.")] = msgspec.field(name="from")
    most: Annotated[Ticks, Meta(description="The longest.")] = msgspec.field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least}) must not be above to ({self.most})")


class Bell(ConfigSection, frozen=True, kw_only=True):
    """A normal distribution within a range, in shares of its width from its least value on."""

    mean_ratio: Annotated[float, Meta(ge=0, le=1, description="Where its mean is.")] = 0.5
    sd_ratio: Annotated[float, Meta(ge=0, le=10, description="Its standard deviation.")] = 0.22


class BellDelays(ConfigSection, frozen=True, kw_only=True):
    """Delays that last about as long as each other."""

    gaussian: Bell


class Delays(ConfigSection, frozen=True, kw_only=True):
    """Robots that stand for a while now and then, as in the League of Robot Runners 2026."""

    probability: Annotated[
        float,
        quantity(
            PROBABILITY,
            gt=0,
            le=1,
            description="With which a robot on the floor that is not delayed is so from a tick on.",
        ),
    ]
    ticks: Annotated[DelayTicks, Meta(description="How long a delay lasts.")]
    events: Annotated[
        Literal["bernoulli", "poisson"],
        Meta(
            description="bernoulli: each robot by itself; poisson: as many robots as a Poisson number "
            "says whose mean is probability times the robots that may be delayed."
        ),
    ] = "bernoulli"
    distribution: Annotated[
        Literal["uniform"] | BellDelays,
        Meta(
            description="uniform: all durations alike; {gaussian: {mean_ratio, sd_ratio}}: normal, "
            "rounded, and what is beyond ticks at its ends."
        ),
    ] = "uniform"
    of: Annotated[
        tuple[Literal["move", "turn"], ...],
        Meta(
            description="Which operations under way take longer by the delay; others go on, and the "
            "robot stands for the rest of the delay after them."
        ),
    ] = ("move", "turn")

    def __post_init__(self) -> None:
        if self.probability >= 1:
            raise ValueError(
                "probability must be below 1: with 1 a robot is delayed again as soon as a delay ends, "
                "for ever"
            )


class Faults(ConfigSection, frozen=True, kw_only=True):
    """Robots that go down, and what becomes of them."""

    listed: Annotated[tuple[Fault, ...], Meta(description="Breakdowns, one by one.")] = (
        msgspec.field(name="list", default=())
    )
    failure_probability: Annotated[
        float,
        quantity(
            PROBABILITY,
            ge=0,
            le=1,
            description="Probability that a robot on the floor fails in a tick.",
        ),
    ] = 0.0
    mtbf: Annotated[
        Annotated[float, quantity(TIME, ge=1, le=1e9)] | None,
        Meta(
            description="The mean time between failures of a robot on the floor, in ticks; instead of "
            "failure_probability, which is 1 / this."
        ),
    ] = None
    tow_after: Annotated[
        LongTicks | None,
        Meta(description="A robot that is down is towed after so many ticks; null: it stays."),
    ] = 300
    repair_time: Annotated[
        LongTicks | None,
        Meta(description="It is back after so many ticks more; null: never."),
    ] = 600
    repair_in_place: Annotated[
        LongTicks | Distribution | None,
        Meta(
            description="A robot that breaks down is not towed: it stands for so long, with its load "
            "and its order, and goes on; null: it is towed. Robots without charge are towed anyway."
        ),
    ] = None
    delays: Annotated[
        Delays | None, Meta(description="Robots that stand for a while; null: none does.")
    ] = None
    charge: Annotated[
        Percent | Literal["kept"],
        Meta(
            description="Percent with which it comes back. kept: what its battery held when it was "
            "towed, but battery.reserve at least if it ran empty."
        ),
    ] = "kept"

    def __post_init__(self) -> None:
        if self.mtbf is not None and self.failure_probability:
            raise ValueError("mtbf and failure_probability say the same; set one of them")

    @property
    def probability(self) -> float:
        """With which a robot on the floor fails in a tick."""
        return self.failure_probability if self.mtbf is None else 1 / self.mtbf
