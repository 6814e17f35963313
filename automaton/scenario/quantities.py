"""The quantities of a scenario: what its numbers count, and the texts that may replace them.

    durations: {move: 1.5 m/s, pick: 20 s}      beside      durations: {move: 2, pick: 40}

A text is a number with a unit ("20 s", "1.5 m/s", "120/h", "9 %/h", "0:10:00") or a clock time
("2026-03-02 06:30", or "06:30" on the day of units.clock). A field of a struct declares what it counts
by `quantity(TIME, ...)` among its annotations, also in plug-ins. Texts are read as exact fractions;
automaton.scenario.validation rounds them where a field needs a whole number.
"""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import Annotated, Any, Final, Literal, NamedTuple

import msgspec
from msgspec import Meta

from automaton.errors import InputError, alternatives, nearest
from automaton.units import (
    LENGTH_UNITS,
    SPELLED,
    TIME_UNITS,
    Unit,
    exact_length,
    exact_time,
    length_unit,
    unit,
)

MAX_CHARACTERS: Final = 60
DECIMAL_NUMBER: Final = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]{1,2})?"
_AMOUNT: Final = re.compile(rf"\s*({DECIMAL_NUMBER})\s*(.*?)\s*", re.DOTALL)
_PARTS: Final = re.compile(r"\s*([0-9]{1,9}):([0-9]{2}):([0-9]{2}(?:\.[0-9]+)?)\s*")
_TWO_PARTS: Final = re.compile(r"\s*([0-9]{1,9}):([0-9]{2})\s*")
_COMMA: Final = re.compile(r"[0-9]\s*[,_'\u2009\u00a0]\s*[0-9]|[0-9] [0-9]")

CLOCK_EXAMPLES: Final = "'2026-03-02 06:30' or '06:30'"
_TIME: Final = r"([0-9]{1,2}):([0-9]{2})(?::([0-9]{2}(?:\.[0-9]+)?))?"
_DATE: Final = r"([0-9]{4})-([0-9]{1,2})-([0-9]{1,2})"
_MOMENT: Final = re.compile(rf"\s*(?:{_DATE}(?:[Tt]|\s+))?{_TIME}\s*")
_BARE_TIME: Final = re.compile(rf"\s*{_TIME}\s*")
_LIKE_A_DATE: Final = re.compile(r"\s*([0-9]{4}-[0-9]|[0-9]{1,2}[./][0-9]{1,2}[./][0-9])")
_ZONE: Final = re.compile(r"(Z|[-+][0-9]{1,2}(:?[0-9]{2})?)\s*$")
_OFFSET: Final = re.compile(r"\s*(Z|([-+])([0-9]{2}):([0-5][0-9]))\s*$")
SECONDS_OF_DAY: Final = 86_400
NO_DATE: Final = 0  # days since 0001-01-01 begin with 1
QUANTITY_KEY: Final = "quantity"  # key in Meta.extra for the quantity of a field
SCHEMA_KEY: Final = "x-quantity"  # likewise in a JSON Schema
PLACE_KEY: Final = "place"  # key for cells that may be written by name
PLACE_SCHEMA_KEY: Final = "x-place"
QUARTER_TURN: Final = 90  # degrees
LAST_TICK: Final = 2_000_000_000
SHARE_ERROR: Final = 0.001  # tolerance of the sum of shares


class Dimension(Enum):
    """The kinds of amounts, as errors name them."""

    TIME = "a time"
    LENGTH = "a length"
    CELLS = "a number of cells"
    SPEED = "a speed"
    CELL_SPEED = "a speed in cells"
    ANGLE_SPEED = "a speed of turning"
    RATE = "a rate"
    PERCENT_RATE = "percent per time"
    ANGLE = "an angle"
    PERCENT = "percent"
    NUMBER = "a number without a unit"


_OVER_TIME: Final = {
    Dimension.LENGTH: Dimension.SPEED,
    Dimension.CELLS: Dimension.CELL_SPEED,
    Dimension.ANGLE: Dimension.ANGLE_SPEED,
    Dimension.PERCENT: Dimension.PERCENT_RATE,
    Dimension.NUMBER: Dimension.RATE,
}
_COUNTS: Final = {
    **dict.fromkeys(("cell", "cells"), Dimension.CELLS),
    **dict.fromkeys(("deg", "°"), Dimension.ANGLE),
    "%": Dimension.PERCENT,
}


class Amount(NamedTuple):
    """A number with its unit; `value` is in seconds, metres, cells, degrees or percent."""

    text: str
    value: Fraction
    dimension: Dimension


def read_amount(text: str, wanted: Iterable[Dimension]) -> Amount:
    """An amount of any dimension; errors name the units of the expected ones. Raises InputError."""
    if len(text) > MAX_CHARACTERS:
        raise InputError(f"has {len(text):,} characters; expected a number with a unit")
    if match := _PARTS.fullmatch(text):
        return Amount(text.strip(), _hours_minutes_seconds(text, *match.groups()), Dimension.TIME)
    if match := _TWO_PARTS.fullmatch(text):
        raise InputError(_both_readings(text, *match.groups()))
    match = _AMOUNT.fullmatch(text)
    if match is None or _COMMA.search(text):
        raise InputError(_not_a_number(text))
    value, name = Fraction(match[1]), match[2]
    if not name:
        raise InputError(
            f"'{text}' is text without a unit; write the unit, or a plain number without quotes"
        )
    known = _unit(name)
    if known is None:
        raise InputError(_unknown_unit(text, name, wanted))
    factor, dimension = known
    return Amount(text.strip(), value * factor, dimension)


def _hours_minutes_seconds(text: str, hours: str, minutes: str, seconds: str) -> Fraction:
    if int(minutes) > 59 or Fraction(seconds) >= 60:
        raise InputError(f"'{text}': minutes and seconds of H:MM:SS go up to 59")
    return 3600 * int(hours) + 60 * int(minutes) + Fraction(seconds)


def _both_readings(text: str, first: str, last: str) -> str:
    minutes = f"{int(first) // 60}:{int(first) % 60:02}:{last}"
    return (
        f"'{text}' has two parts, which may be hours and minutes or minutes and seconds; write "
        f"three: '{first}:{last}:00' or '{minutes}'"
    )


def _not_a_number(text: str) -> str:
    if re.match(r"\s*-", text):
        return f"'{text}' must not be below 0"
    if _COMMA.search(text):
        return (
            f"'{text}' is not one number with a unit; write it with a decimal point and nothing between "
            "the digits, such as 1.5 s or 1000 s"
        )
    return f"'{text}' is not a number with a unit, such as 20 s"


def _unit(name: str) -> tuple[Fraction, Dimension] | None:
    """The value and the dimension of a unit; None: unknown unit."""
    above, slash, below = (part.strip() for part in name.partition("/"))
    if not slash:
        return _simple_unit(above)
    time = _simple_unit(below)
    if time is None or time[1] != Dimension.TIME:
        return None
    one = _simple_unit(above) if above else (Fraction(1), Dimension.NUMBER)
    if one is None or one[1] not in _OVER_TIME:
        return None
    return one[0] / time[0], _OVER_TIME[one[1]]


def _simple_unit(name: str) -> tuple[Fraction, Dimension] | None:
    if name in _COUNTS:
        return Fraction(1), _COUNTS[name]
    for table, dimension in ((TIME_UNITS, Dimension.TIME), (LENGTH_UNITS, Dimension.LENGTH)):
        for symbol, size in table.items():
            if name in (symbol, *SPELLED.get(symbol, ())):
                return size, dimension
    return None


def _unknown_unit(text: str, name: str, wanted: Iterable[Dimension]) -> str:
    names = list(unit_names(wanted))
    spelled = [long for one in names for long in SPELLED.get(one, ())]
    hint = nearest(name, [*names, *spelled])
    if re.search(r"[0-9]", name):
        return f"'{text}' is not one number with one unit; the units are {alternatives(names)}"
    return f"'{text}': there is no unit '{name}' here{hint}; the units are {alternatives(names)}"


def unit_names(dimensions: Iterable[Dimension]) -> Iterator[str]:
    """The symbols of the units of some dimensions: "ms", ..., "m/s", "km/h"."""
    for dimension in dimensions:
        if dimension == Dimension.TIME:
            yield from TIME_UNITS
        elif dimension == Dimension.LENGTH:
            yield from LENGTH_UNITS
        elif dimension == Dimension.CELLS:
            yield "cells"
        elif dimension == Dimension.SPEED:
            yield from (f"{name}/s" for name in LENGTH_UNITS)
            yield "km/h"
        else:
            above = {"CELL_SPEED": "cells", "ANGLE_SPEED": "deg", "PERCENT_RATE": "%"}
            name = above.get(dimension.name, "")
            yield from (f"{name}/{time}" for time in TIME_UNITS)


def rounded(exact: Fraction) -> int:
    """The nearest whole number; halves go up."""
    return math.floor(exact + Fraction(1, 2))


# Clock times.


class ClockTime(NamedTuple):
    """A clock time."""

    day: int | None  # days since 0001-01-01; None: no date
    seconds: Fraction  # since midnight
    offset: int | None = None  # seconds ahead of UTC, if the clock has an offset


def is_clock_time(text: str) -> bool:
    """Whether a text is or looks like a clock time, and not a duration of three parts."""
    match = _MOMENT.fullmatch(text)
    return has_date(text) or (match is not None and match[6] is None)


def has_date(text: str) -> bool:
    """Whether a text looks like a date, with a time or without."""
    match = _MOMENT.fullmatch(text)
    return _LIKE_A_DATE.match(text) is not None or (match is not None and match[1] is not None)


def is_of_three_parts(text: str) -> bool:
    """Whether a text is H:MM:SS, a duration that is also a time of the day."""
    match = _BARE_TIME.fullmatch(text)
    return match is not None and match[3] is not None


def read_moment(text: str) -> ClockTime:
    """A date with a time, or a time. Raises InputError."""
    match = _MOMENT.fullmatch(text)
    if match is None:
        raise InputError(_why_not(text))
    year, month, day, hours, minutes, seconds = match.groups()
    if int(hours) > 23 or int(minutes) > 59 or Fraction(seconds or 0) >= 60:
        raise InputError(f"'{text}' is not a time of the day; they go from 00:00 to 23:59")
    since_midnight = 3600 * int(hours) + 60 * int(minutes) + Fraction(seconds or 0)
    if year is None:
        return ClockTime(None, since_midnight)
    try:
        date = datetime.date(int(year), int(month), int(day))
    except ValueError:
        raise InputError(f"'{text}' is not a day of the calendar") from None
    return ClockTime(date.toordinal(), since_midnight)


def read_clock(text: str) -> ClockTime:
    """The time of tick 0: like other clock times, but a date may have an offset. Raises InputError."""
    match = _OFFSET.search(text)
    if match is None or not has_date(text):
        return read_moment(text)
    moment = read_moment(text[: match.start()])
    seconds = 3600 * int(match[3] or 0) + 60 * int(match[4] or 0)
    return moment._replace(offset=-seconds if match[2] == "-" else seconds)


def _why_not(text: str) -> str:
    if _ZONE.search(text) and _MOMENT.fullmatch(_ZONE.sub("", text)):
        return f"'{text}' has a time zone; write the local time, such as {CLOCK_EXAMPLES}"
    if _LIKE_A_DATE.match(text):
        return f"'{text}' is not a date with a time, such as '2026-03-02 06:30'"
    return f"'{text}' is not a clock time, such as {CLOCK_EXAMPLES}"


def clock_text(clock: ClockTime, seconds: Fraction) -> str:
    """The clock time a whole number of seconds after tick 0: "06:30"; on another day with its date.

    Without a date, the day of the clock is day 1.
    """
    days, rest = divmod(math.floor(clock.seconds + seconds), SECONDS_OF_DAY)
    time = f"{rest // 3600:02}:{rest // 60 % 60:02}"
    time += f":{rest % 60:02}" if rest % 60 else ""
    if not days:
        return time
    day = NO_DATE if clock.day is None else clock.day + days
    if not 1 <= day <= datetime.date.max.toordinal():
        return f"{time} on day {days + 1:,}"
    return f"{datetime.date.fromordinal(day)} {time}"


def seconds_after(clock: ClockTime | None, text: str, may_precede: bool = False) -> Fraction:
    """Seconds from tick 0 to a clock time; `may_precede`: it may be before tick 0. Raises InputError."""
    moment = read_moment(text)
    if clock is None:
        raise InputError(
            f"'{text}' is a clock time, but the clock time of tick 0 is unknown; set units.clock, "
            f"such as units: {{clock: '{text}'}}"
        )
    days = 0
    if moment.day is not None:
        if clock.day is None:
            raise InputError(f"'{text}' has a date, but units.clock has none; set it with a date")
        days = moment.day - clock.day
    seconds = days * SECONDS_OF_DAY + moment.seconds - clock.seconds
    if seconds < 0 and not may_precede:
        bare = (
            "" if moment.day is not None else "; a time without a date is on the day of units.clock"
        )
        raise InputError(f"'{text}' is before tick 0, which is units.clock{bare}")
    return seconds


# Quantities.


@dataclass(frozen=True)
class Scale:
    """The exact size of a tick and of a cell."""

    tick: str  # as written
    cell: str | None = None
    clock: ClockTime | None = None  # the time of tick 0

    @property
    def unit(self) -> Unit:
        """The unit of a tick in reports."""
        return unit(self.tick)

    @property
    def tick_seconds(self) -> Fraction:
        """Seconds per tick. Raises InputError if a tick is not a time."""
        seconds = exact_time(self.tick)
        if seconds is None:
            raise InputError(
                f"units.tick is '{self.tick}', which is not a time in {alternatives(TIME_UNITS)}; "
                "set it, such as units: {tick: 0.5 s}"
            )
        return seconds

    def tick_at(self, text: str) -> int:
        """The tick in which a clock time falls, such as "06:30". Raises InputError."""
        return math.floor(seconds_after(self.clock, text) / self.tick_seconds)

    @property
    def cell_metres(self) -> Fraction:
        """Metres along the side of a cell. Raises InputError if the scenario does not define it."""
        if self.cell is None:
            raise InputError(
                "the size of a cell is unknown; set units.cell, such as units: {cell: 0.8 m}"
            )
        metres = exact_length(self.cell)
        if metres is None:
            known = alternatives(LENGTH_UNITS)
            raise InputError(f"units.cell is '{self.cell}', which is not a length in {known}")
        return metres

    @property
    def cell_unit_metres(self) -> Fraction:
        """Metres per unit of the side of a cell. Raises InputError."""
        metres = length_unit(self.cell or "")
        return self.cell_metres if metres is None else metres  # cell_metres raises the error


Rule = Callable[[Fraction, Scale], Fraction]  # from an amount to the number of a field


@dataclass(frozen=True, eq=False)
class Quantity:
    """What a number counts, and the texts that may replace it."""

    described: str  # in errors and documents: "a time such as 20 s"
    rules: Mapping[Dimension, Rule]
    counted: str = "tick"  # unit of a plain number, singular
    by_clock: bool = False  # clock times are allowed, also that of tick 0
    # A clock time becomes {at: tick} instead and may be before tick 0.
    after_release: bool = False

    def number(self, amount: Amount, scale: Scale) -> Fraction:
        """The exact number of a text. Raises InputError."""
        rule = self.rules.get(amount.dimension)
        if rule is None:
            minutes = amount.dimension == Dimension.LENGTH and Dimension.TIME in self.rules
            hint = "; minutes are min" if minutes else ""
            dimension = amount.dimension.value
            raise InputError(f"'{amount.text}' is {dimension}, expected {self.described}{hint}")
        return rule(amount.value, scale)


def _ticks(seconds: Fraction, scale: Scale) -> Fraction:
    return seconds / scale.tick_seconds


def _seconds(seconds: Fraction, scale: Scale) -> Fraction:
    # A time needs a tick that is a time.
    return _ticks(seconds, scale) * scale.tick_seconds


def _ticks_of_one(rate: Fraction, scale: Scale) -> Fraction:
    if not rate:
        raise InputError("a speed or a rate must be above 0")
    return 1 / rate / scale.tick_seconds


def _ticks_of_a_cell(speed: Fraction, scale: Scale) -> Fraction:
    return _ticks_of_one(speed, scale) * scale.cell_metres


def _ticks_of_a_turn(speed: Fraction, scale: Scale) -> Fraction:
    return _ticks_of_one(speed, scale) * QUARTER_TURN


def _in_a_tick(rate: Fraction, scale: Scale) -> Fraction:
    return rate * scale.tick_seconds


def _cells(metres: Fraction, scale: Scale) -> Fraction:
    return metres / scale.cell_metres


def _lengths(metres: Fraction, scale: Scale) -> Fraction:
    return metres / scale.cell_unit_metres


TIME: Final = Quantity("a time such as 20 s", {Dimension.TIME: _ticks})
MOMENT: Final = Quantity(
    "a time such as 20 s, or a clock time such as '06:30'", {Dimension.TIME: _ticks}, by_clock=True
)
DUE: Final = Quantity(
    "a time after release such as 30 min, or a clock time such as '14:30'",
    {Dimension.TIME: _ticks},
    by_clock=True,
    after_release=True,
)
STEP: Final = Quantity(
    "a time such as 2 s, or a speed such as 1.5 m/s",
    {
        Dimension.TIME: _ticks,
        Dimension.SPEED: _ticks_of_a_cell,
        Dimension.CELL_SPEED: _ticks_of_one,
    },
)
TURN: Final = Quantity(
    "a time such as 2 s, or a speed such as 90 deg/s",
    {Dimension.TIME: _ticks, Dimension.ANGLE_SPEED: _ticks_of_a_turn},
)
GAP: Final = Quantity(
    "a time such as 30 s, or a rate such as 120/h",
    {Dimension.TIME: _ticks, Dimension.RATE: _ticks_of_one},
)
PROBABILITY: Final = Quantity("a rate such as 0.1/h", {Dimension.RATE: _in_a_tick}, "")
SHARE_LIMIT: Final = Quantity(
    "percent, such as 2 %", {Dimension.PERCENT: lambda percent, _: percent / 100}, ""
)
CHARGE_RATE: Final = Quantity(
    "percent per time, such as 9 %/h", {Dimension.PERCENT_RATE: _in_a_tick}, "percent per tick"
)
CELLS: Final = Quantity(
    "a length such as 5 m",
    {Dimension.LENGTH: _cells, Dimension.CELLS: lambda cells, _: cells},
    "cell",
)
LENGTH: Final = Quantity(
    "a length such as 5 m",
    {
        Dimension.LENGTH: _lengths,
        Dimension.CELLS: lambda cells, scale: _lengths(cells * scale.cell_metres, scale),
    },
    "",
)
METRES: Final = Quantity(
    "a length such as 1.2 m", {Dimension.LENGTH: lambda metres, scale: metres}, "m"
)
SECONDS: Final = Quantity("a time such as 90 s", {Dimension.TIME: _seconds}, "s")
MINUTES: Final = Quantity(
    "a time such as 5 min",
    {Dimension.TIME: lambda value, scale: _seconds(value, scale) / 60},
    "min",
)


def quantity(of: Quantity, **said: Any) -> Meta:
    """The annotation of a field that holds a quantity; `said`: further arguments of Meta."""
    return Meta(extra={QUANTITY_KEY: of}, extra_json_schema={SCHEMA_KEY: of.described}, **said)


def place() -> Meta:
    """The annotation of a field that holds a cell [x, y] or the name of one."""
    return Meta(extra={PLACE_KEY: True}, extra_json_schema={PLACE_SCHEMA_KEY: True})


def with_texts(schema: Any) -> Any:
    """A JSON Schema in which texts are allowed for quantities, and names for cells."""
    if isinstance(schema, list):
        return [with_texts(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    inner = {key: with_texts(value) for key, value in schema.items()}
    if inner.pop(PLACE_SCHEMA_KEY, False):
        outer = {key: inner.pop(key) for key in ("description", "default") if key in inner}
        name = {"type": "string", "description": "a name of locations"}
        return {**outer, "anyOf": [inner, name]}
    if SCHEMA_KEY not in inner:
        return inner
    described = inner.pop(SCHEMA_KEY)
    if "anyOf" in inner:
        return {**inner, "anyOf": [*inner["anyOf"], _text_schema(described)]}
    outer = {key: inner.pop(key) for key in ("description", "default") if key in inner}
    return {**outer, "anyOf": [inner, _text_schema(described)]}


def _text_schema(described: str) -> dict[str, Any]:
    return {
        "type": "string",
        "description": described,
        "pattern": r"^\s*[0-9.]",
        SCHEMA_KEY: described,
    }


# Shared types of fields.

Direction = Literal["east", "south", "west", "north"]
Weight = Annotated[
    int, Meta(ge=1, le=1_000_000_000, description="Weight, in the unit of the payloads.")
]
Pair = Annotated[tuple[int, int], Meta(description="A cell [x, y], from the upper left.")]
NonEmptyText = Annotated[str, Meta(min_length=1)]
Parameters = dict[str, Any]
StrategySpec = str | Parameters  # a strategy: its name, or {name: NAME, ...parameters}
SingleLine = Annotated[str, Meta(min_length=1, max_length=200, pattern=r"^[^\r\n]*$")]
Shares = dict[SingleLine, Annotated[float, Meta(ge=0, le=1)]]  # of classes of pods
Ticks = Annotated[int, quantity(TIME, ge=1, le=10_000, description="A duration in ticks.")]
TicksOrNone = Annotated[
    int, quantity(TIME, ge=0, le=10_000, description="A duration in ticks, or 0.")
]
Metres = Annotated[float, quantity(METRES, gt=0, le=100, description="A length in metres.")]
LongTicks = Annotated[int, quantity(TIME, ge=1, le=10_000_000, description="A duration in ticks.")]
Tick = Annotated[int, quantity(MOMENT, ge=0, le=2_000_000_000, description="A tick.")]
NamedCell = Annotated[Pair, place()]  # written as [x, y] or by its name


class ConfigSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A section of a scenario: immutable; unknown keys are errors."""


class WeightRange(ConfigSection, frozen=True, kw_only=True):
    """A range of weights; each order draws one, uniformly distributed."""

    least: Annotated[Weight, Meta(description="The least weight.")] = msgspec.field(name="from")
    most: Annotated[Weight, Meta(description="The greatest weight.")] = msgspec.field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least}) must not be above to ({self.most})")


MAX_STOPS: Final = 64  # of an order
StopCount = Annotated[int, Meta(ge=1, le=MAX_STOPS)]


class StopRange(ConfigSection, frozen=True, kw_only=True):
    """A range of the number of stops; each order draws one, uniformly distributed."""

    least: Annotated[StopCount, Meta(description="The least number of stops.")] = msgspec.field(
        name="from"
    )
    most: Annotated[StopCount, Meta(description="The greatest number of stops.")] = msgspec.field(
        name="to"
    )

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least}) must not be above to ({self.most})")


class DueAt(ConfigSection, frozen=True, kw_only=True):
    """A due time that does not depend on the release."""

    at: Annotated[
        int,
        quantity(
            MOMENT,
            ge=-LAST_TICK,
            le=LAST_TICK,
            description="The tick; an order that is due before tick 0 is late from the start.",
        ),
    ]


Due = Annotated[int, quantity(DUE, ge=0, le=LAST_TICK)] | DueAt


def check_shares(name: str, shares: Mapping[str, float]) -> None:
    """Shares add up to 1. Raises ValueError."""
    total = sum(shares.values())
    if abs(total - 1) > SHARE_ERROR:
        raise ValueError(f"{name} must add up to 1, found {total:.4g}")


def due_tick(due: Due | None, release: int) -> int | None:
    """The due tick of something with a release tick; None: no due time."""
    return due.at if isinstance(due, DueAt) else None if due is None else release + due
