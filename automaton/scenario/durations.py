"""How long the operations of robots take, in a scenario file: of the whole fleet, or of one type."""

from __future__ import annotations

from typing import Annotated, Final, NamedTuple

import msgspec
from msgspec import Meta

from automaton.scenario.field_types import ConfigSection, Ticks, TicksOrNone
from automaton.scenario.handling import Handling
from automaton.scenario.quantities import STEP, TIME, TURN, quantity

MAX_DURATION: Final = 10_000  # ticks of an operation

MoveTicks = Annotated[int, quantity(STEP, ge=1, le=MAX_DURATION)]
TurnTicks = Annotated[int, quantity(TURN, ge=1, le=MAX_DURATION)]


class MoveByLoad(ConfigSection, frozen=True, kw_only=True):
    """A move of robots that carry nothing, and of those with a load."""

    empty: Annotated[MoveTicks, Meta(description="Without a load.")]
    loaded: Annotated[MoveTicks, Meta(description="With any load.")]


class TurnByLoad(ConfigSection, frozen=True, kw_only=True):
    """A turn of robots that carry nothing, and of those with a load."""

    empty: Annotated[TurnTicks, Meta(description="Without a load.")]
    loaded: Annotated[TurnTicks, Meta(description="With any load.")]


class ByLoad(NamedTuple):
    """Ticks of an operation without a load, and with one."""

    empty: int
    loaded: int

    @property
    def differ(self) -> bool:
        """Whether a load makes a difference."""
        return self.empty != self.loaded


Move = MoveTicks | MoveByLoad
Turn = TurnTicks | TurnByLoad


class Durations(ConfigSection, frozen=True, kw_only=True):
    """How many ticks each operation takes."""

    move: Annotated[
        Move,
        Meta(description="To the next cell; or {empty, loaded}: without a load, and with one."),
    ] = 1
    turn: Annotated[Turn, Meta(description="By 90 degrees; or {empty, loaded}.")] = 1
    pick: Annotated[
        TicksOrNone, Meta(description="Take a load from a slot; 0: on arrival, within the move.")
    ] = 1
    drop: Annotated[
        TicksOrNone, Meta(description="Drop a load; 0: on arrival, within the move.")
    ] = 1
    try_drop: Annotated[Ticks, Meta(description="Look whether a load can be dropped.")] = 1
    handling_jitter: Annotated[
        int,
        quantity(
            TIME,
            ge=0,
            le=MAX_DURATION,
            description="Each pick and each drop takes up to this many ticks more, uniformly "
            "random.",
        ),
    ] = 0

    handling: Annotated[
        Handling, Meta(description="How long a visit at a station takes, for its lines.")
    ] = Handling()

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
    """What the operations of one type of robots take; what it leaves out is as in `durations`."""

    move: Annotated[Move | None, Meta(description="As durations.move.")] = None
    turn: Annotated[Turn | None, Meta(description="As durations.turn.")] = None
    pick: Annotated[TicksOrNone | None, Meta(description="As durations.pick.")] = None
    drop: Annotated[TicksOrNone | None, Meta(description="As durations.drop.")] = None
    try_drop: Annotated[Ticks | None, Meta(description="As durations.try_drop.")] = None

    def within(self, usual: Durations) -> Durations:
        """These durations, and the usual ones for what is left out. Raises ValueError."""
        own = {name: getattr(self, name) for name in self.__struct_fields__}
        stated = {name: value for name, value in own.items() if value is not None}
        return Durations(**(msgspec.structs.asdict(usual) | stated))


def by_load(stated: int | MoveByLoad | TurnByLoad) -> ByLoad:
    """A number for both, or a number for each."""
    if isinstance(stated, int):
        return ByLoad(stated, stated)
    return ByLoad(stated.empty, stated.loaded)
