"""How orders arrive over time: in bursts, in a closed loop, or by the hour of the week.

    arrivals: {bursts: {size: 5, every: 200}}
    arrivals: {closed_loop: {in_system: 6}}
    arrivals: {profile: week.csv, batch: {uniform: {from: 1, to: 4}}, scale: 1.2}

A profile has the orders of each hour of the week. Orders arrive in batches, so batches arrive at the
rate of the hour divided by the mean size of a batch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Final

from msgspec import Meta, field

from automaton.scenario.quantities import (
    GAP,
    SECONDS_OF_DAY,
    ClockTime,
    ConfigSection,
    NonEmptyText,
    quantity,
)

WEEKDAYS: Final = 7
HOURS_OF_DAY: Final = 24
HOURS_OF_WEEK: Final = WEEKDAYS * HOURS_OF_DAY
SECONDS_OF_HOUR: Final = 3600
MAX_BATCH: Final = 100_000
MAX_RATE: Final = 1_000_000  # orders per hour


class Mean(ConfigSection, frozen=True, kw_only=True):
    """A random whole number from 1 on, geometrically distributed."""

    mean: Annotated[float, Meta(ge=1, le=1_000_000, description="The mean of the number.")]


class MeanTime(ConfigSection, frozen=True, kw_only=True):
    """A random number of ticks from 1 on, geometrically distributed (memoryless)."""

    mean: Annotated[float, quantity(GAP, ge=1, le=1_000_000, description="The mean of the number.")]


class Bursts(ConfigSection, frozen=True, kw_only=True):
    """Orders are released in bursts, the first one at the start."""

    size: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | Mean,
        Meta(description="Orders of a burst: a fixed number, or random with a mean."),
    ]
    every: Annotated[
        Annotated[int, quantity(GAP, ge=1, le=1_000_000)] | MeanTime,
        Meta(
            description="Ticks from one burst to the next: a fixed number, or random with a mean."
        ),
    ]


class ClosedLoop(ConfigSection, frozen=True, kw_only=True):
    """A closed loop: each delivery releases the next order, one tick later."""

    in_system: Annotated[
        int,
        Meta(
            ge=1,
            le=1_000_000,
            description="Number of orders that are open at a time, until no order is left.",
        ),
    ]


# Batches of a profile.

Size = Annotated[float, Meta(ge=0, le=MAX_BATCH)]


class SizeRange(ConfigSection, frozen=True, kw_only=True):
    """A uniformly distributed batch size."""

    least: Annotated[Size, Meta(description="The smallest size.")] = field(name="from")
    most: Annotated[Size, Meta(description="The largest size.")] = field(name="to")

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"from ({self.least:g}) must not be above to ({self.most:g})")


class LognormalSize(ConfigSection, frozen=True, kw_only=True):
    """A batch size whose logarithm is normally distributed."""

    mean: Annotated[float, Meta(gt=0, le=MAX_BATCH, description="Mean, in orders.")]
    sd: Annotated[float, Meta(ge=0, le=MAX_BATCH, description="Standard deviation, in orders.")]


class BatchSize(ConfigSection, frozen=True, kw_only=True):
    """A random batch size, rounded half up, at least 1. Set exactly one distribution."""

    uniform: SizeRange | None = None
    lognormal: LognormalSize | None = None
    empirical: Annotated[
        Annotated[tuple[Size, ...], Meta(min_length=1, max_length=1_000_000)] | None,
        Meta(description="A list of sizes, each equally likely."),
    ] = None
    exponential: Annotated[
        Annotated[float, Meta(ge=1, le=MAX_BATCH)] | None,
        Meta(description="Mean of a geometric distribution from 1 on."),
    ] = None

    def __post_init__(self) -> None:
        stated = (self.uniform, self.lognormal, self.empirical, self.exponential)
        if sum(form is not None for form in stated) != 1:
            raise ValueError("batch must be one of uniform, lognormal, empirical and exponential")


# Rates by the hour of the week.


class HourlyRate(ConfigSection, frozen=True, kw_only=True):
    """The rate of orders in one hour of the week."""

    weekday: Annotated[int, Meta(ge=1, le=WEEKDAYS, description="The day, 1 to 7 from Monday.")]
    hour: Annotated[int, Meta(ge=0, le=HOURS_OF_DAY - 1, description="The hour, 0 to 23.")]
    orders: Annotated[
        float, Meta(ge=0, le=MAX_RATE, description="Mean number of orders that arrive in the hour.")
    ]

    @property
    def of_week(self) -> int:
        """The number of the hour in the week, from 0."""
        return (self.weekday - 1) * HOURS_OF_DAY + self.hour


class Arrivals(ConfigSection, frozen=True, kw_only=True):
    """How orders are released: in bursts, in a closed loop, or by the hour of the week."""

    bursts: Bursts | None = None
    closed_loop: ClosedLoop | None = None
    profile: Annotated[
        NonEmptyText | tuple[HourlyRate, ...] | None,
        Meta(
            description="Rates by the hour of the week: a list, or a CSV file (path relative to the "
            "scenario) with the columns weekday (1 to 7 from Monday), hour (0 to 23) and orders (mean "
            "number of orders in the hour). Days without rows have no orders. A profile needs a date "
            "in units.clock. Orders arrive until the run ends or `count` orders have arrived."
        ),
    ] = None
    batch: Annotated[
        Annotated[int, Meta(ge=1, le=MAX_BATCH)] | BatchSize,
        Meta(description="Orders of a profile that arrive at once: a fixed number, or random."),
    ] = 1
    scale: Annotated[
        float, Meta(gt=0, le=1000, description="Factor on all rates of a profile.")
    ] = 1.0

    def __post_init__(self) -> None:
        forms = (self.bursts, self.closed_loop, self.profile)
        if sum(form is not None for form in forms) != 1:
            raise ValueError("arrivals must have exactly one of bursts, closed_loop and profile")
        if self.profile is None:
            for name, is_set in (("batch", self.batch != 1), ("scale", self.scale != 1.0)):
                if is_set:
                    raise ValueError(f"{name} belongs to arrivals with a profile")
        if isinstance(self.profile, tuple):
            _check_hours([rate.of_week for rate in self.profile])

    @property
    def rates(self) -> list[float]:
        """(168,) scaled orders per hour from Monday 0:00 on; the file of a profile has been read."""
        rates = [0.0] * HOURS_OF_WEEK
        for rate in self.profile if isinstance(self.profile, tuple) else ():
            rates[rate.of_week] = rate.orders * self.scale
        return rates


def _check_hours(hours: Sequence[int]) -> None:
    """Each hour of a weekday that appears is there once. Raises ValueError."""
    if not hours:
        raise ValueError("profile must hold at least one day")
    for index, hour in enumerate(hours):
        if hour in hours[:index]:
            raise ValueError(f"profile has two rates for {hour_text(hour)}")
    for day, hour in missing_hours(hours):
        raise ValueError(f"profile has no rate for {hour_text(day * HOURS_OF_DAY + hour)}")


def missing_hours(hours: Sequence[int]) -> list[tuple[int, int]]:
    """(day from 0, hour) of the hours that are missing of days that appear among hours of the week."""
    days = sorted({hour // HOURS_OF_DAY for hour in hours})
    present = set(hours)
    return [
        (day, hour)
        for day in days
        for hour in range(HOURS_OF_DAY)
        if day * HOURS_OF_DAY + hour not in present
    ]


def hour_text(hour: int) -> str:
    """An hour of the week in the words of a profile: "weekday 1, hour 6"."""
    return f"weekday {hour // HOURS_OF_DAY + 1}, hour {hour % HOURS_OF_DAY}"


def second_of_week(clock: ClockTime) -> float:
    """Seconds from Monday 0:00 to the time of a clock, which has a date."""
    assert clock.day is not None, "checked: the clock has a date"
    return (clock.day - 1) % WEEKDAYS * SECONDS_OF_DAY + float(clock.seconds)  # day 1: a Monday


def expected_orders(rates: Sequence[float], begin: float, seconds: float) -> float:
    """The mean number of orders in a time that begins at a second of the week."""
    weeks, rest = divmod(seconds, HOURS_OF_WEEK * SECONDS_OF_HOUR)
    total, at = weeks * math.fsum(rates), begin
    while rest > 0:
        hour = math.floor(at / SECONDS_OF_HOUR)
        stretch = min((hour + 1) * SECONDS_OF_HOUR - at, rest)
        total += rates[hour % HOURS_OF_WEEK] * stretch / SECONDS_OF_HOUR
        at, rest = (hour + 1) * SECONDS_OF_HOUR, rest - stretch
    return total
