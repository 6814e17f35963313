"""Durations in a scenario file: operations of robots, and visits at stations.

Durations of operations hold for the whole fleet or for one type of robots. A visit takes a time per
visit, per line and per unit.
"""

from __future__ import annotations

from typing import Annotated, Final, NamedTuple

import msgspec
from msgspec import Meta, field

from automaton.scenario.quantities import (
    STEP,
    TIME,
    TURN,
    ConfigSection,
    NonEmptyText,
    Ticks,
    TicksOrNone,
    quantity,
)

LONGEST = 65_535  # ticks

Duration = Annotated[
    float, quantity(TIME, ge=0, le=LONGEST, description="A duration in ticks, not rounded.")
]
Mean = Annotated[float, quantity(TIME, gt=0, le=LONGEST, description="Mean, in ticks.")]

MAX_DURATION: Final = 10_000  # ticks of an operation
MoveTicks = Annotated[int, quantity(STEP, ge=1, le=MAX_DURATION)]
TurnTicks = Annotated[int, quantity(TURN, ge=1, le=MAX_DURATION)]


class Uniform(ConfigSection, frozen=True, kw_only=True):
    """A uniformly distributed duration."""

    least: Annotated[Duration, Meta(description="The shortest duration.")] = field(name="from")
    most: Annotated[Duration, Meta(description="The longest duration.")] = field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least:g}) must not be above to ({self.most:g})")


class Lognormal(ConfigSection, frozen=True, kw_only=True):
    """A duration whose logarithm is normally distributed."""

    mean: Mean
    sd: Annotated[
        float, quantity(TIME, ge=0, le=LONGEST, description="Standard deviation, in ticks.")
    ]


class Distribution(ConfigSection, frozen=True, kw_only=True):
    """A random duration. Set exactly one distribution."""

    uniform: Uniform | None = None
    lognormal: Lognormal | None = None
    empirical: Annotated[
        Annotated[tuple[Duration, ...], Meta(min_length=1, max_length=1_000_000)]
        | NonEmptyText
        | None,
        Meta(
            description="A list of durations, each equally likely; or a CSV file of durations, "
            "relative to the scenario."
        ),
    ] = None
    column: Annotated[
        NonEmptyText | None, Meta(description="The column of the file in `empirical`.")
    ] = None
    exponential: Annotated[
        Mean | None,
        Meta(
            description="Mean of an exponentially distributed duration, in whole ticks of at least 1 (a "
            "geometric distribution)."
        ),
    ] = None

    def __post_init__(self) -> None:
        stated = (self.uniform, self.lognormal, self.empirical, self.exponential)
        if sum(form is not None for form in stated) != 1:
            raise ValueError(
                "a distribution must be one of uniform, lognormal, empirical and exponential"
            )
        if isinstance(self.empirical, str) != (self.column is not None):
            raise ValueError("a file of durations needs a column, and a column needs a file")
        if self.exponential is not None and self.exponential < 1:
            raise ValueError(f"exponential must be at least a tick, found {self.exponential:g}")


class Handling(ConfigSection, frozen=True, kw_only=True):
    """Handling time of a visit at a station, during which the robot holds its pod: the sum of
    three parts.
    """

    visit: Annotated[Duration, Meta(description="Ticks per visit.")] = 0.0
    line: Annotated[Duration | Distribution, Meta(description="Ticks per line.")] = 0.0
    unit: Annotated[Duration, Meta(description="Ticks per unit of a line.")] = 0.0


# Operations.


class MoveByLoad(ConfigSection, frozen=True, kw_only=True):
    """Durations of a move without and with a load."""

    empty: Annotated[MoveTicks, Meta(description="Duration without a load.")]
    loaded: Annotated[MoveTicks, Meta(description="Duration with any load.")]


class TurnByLoad(ConfigSection, frozen=True, kw_only=True):
    """Durations of a turn without and with a load."""

    empty: Annotated[TurnTicks, Meta(description="Duration without a load.")]
    loaded: Annotated[TurnTicks, Meta(description="Duration with any load.")]


class ByLoad(NamedTuple):
    """Ticks of an operation without a load, and with one."""

    empty: int
    loaded: int

    @property
    def differ(self) -> bool:
        """Whether a load changes the duration."""
        return self.empty != self.loaded


Move = MoveTicks | MoveByLoad
Turn = TurnTicks | TurnByLoad


class Durations(ConfigSection, frozen=True, kw_only=True):
    """The duration of each operation, in ticks."""

    move: Annotated[
        Move, Meta(description="Duration of a move; {empty, loaded}: without and with a load.")
    ] = 1
    turn: Annotated[
        Turn,
        Meta(description="Duration of a 90 degree turn; {empty, loaded}: without and with a load."),
    ] = 1
    pick: Annotated[
        TicksOrNone,
        Meta(description="Duration of a pick; 0: the robot picks up on arrival, within the move."),
    ] = 1
    drop: Annotated[
        TicksOrNone,
        Meta(description="Duration of a drop; 0: the robot drops on arrival, within the move."),
    ] = 1
    try_drop: Annotated[Ticks, Meta(description="Duration of an attempt to drop a load.")] = 1
    handling_jitter: Annotated[
        int,
        quantity(
            TIME,
            ge=0,
            le=MAX_DURATION,
            description="Greatest random extra duration of a pick or a drop, in ticks, uniformly "
            "distributed.",
        ),
    ] = 0

    handling: Annotated[Handling, Meta(description="Handling time of a visit at a station.")] = (
        Handling()
    )

    def __post_init__(self) -> None:
        if self.handling_jitter and not (self.pick and self.drop):
            raise ValueError(
                "handling_jitter makes picks and drops longer, so set both to at least 1"
            )

    @property
    def moves(self) -> ByLoad:
        """Ticks of a move."""
        return by_load(self.move)

    @property
    def turns(self) -> ByLoad:
        """Ticks of a turn."""
        return by_load(self.turn)


class TypeDurations(ConfigSection, frozen=True, kw_only=True):
    """Durations of one type of robots; missing keys are as in `durations`."""

    move: Annotated[Move | None, Meta(description="Ticks of a move: see durations.")] = None
    turn: Annotated[Turn | None, Meta(description="Ticks of a turn: see durations.")] = None
    pick: Annotated[TicksOrNone | None, Meta(description="Ticks of a pick: see durations.")] = None
    drop: Annotated[TicksOrNone | None, Meta(description="Ticks of a drop: see durations.")] = None
    try_drop: Annotated[Ticks | None, Meta(description="Ticks of a try_drop: see durations.")] = (
        None
    )

    def within(self, usual: Durations) -> Durations:
        """These durations, completed by those of the fleet. Raises ValueError."""
        own = {name: getattr(self, name) for name in self.__struct_fields__}
        stated = {name: value for name, value in own.items() if value is not None}
        return Durations(**(msgspec.structs.asdict(usual) | stated))


def by_load(stated: int | MoveByLoad | TurnByLoad) -> ByLoad:
    """A number for both, or a number for each."""
    if isinstance(stated, int):
        return ByLoad(stated, stated)
    return ByLoad(stated.empty, stated.loaded)
