"""Rounding errors of times, speeds and rates that become whole numbers, and the tick that reduces them.

    durations.move 1.5 m/s: 1.6 ticks -> 2, 25 % slower

Times and lengths become whole ticks and cells, rates of batteries whole units of charge. Numbers without
a unit are ticks, even if a tick is not a second: `check` says how they were read.

    read in ticks of 0.5 s: durations.pick 30 (15 s), orders.mean_interarrival_time 60 (30 s)
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any, Final, NamedTuple

from automaton.engine.state import BATTERY_PERCENT
from automaton.errors import InputError, Keys
from automaton.scenario.order_lines import plain_data
from automaton.scenario.quantities import Dimension, Scale, rounded
from automaton.scenario.schema import Scenario
from automaton.scenario.validation import Conversion, Plan, dotted, plan_of
from automaton.units import Unit, duration, number
from automaton.world.resolved import Resolved

TOLERANCE: Final = Fraction(2, 100)
SMALLEST_SHOWN: Final = Fraction(1, 1000)  # smaller errors of durations and rates do not matter
TICKS_TO_CHOOSE_FROM: Final = tuple(
    Fraction(text) for text in ("1", "0.5", "0.25", "0.2", "0.1", "0.05", "0.02", "0.01")
)  # seconds
MOST_CONVERSIONS: Final = 20
MOST_KEYS: Final = 12  # of plain numbers


class Rounding(NamedTuple):
    """A conversion as the world counts it."""

    conversion: Conversion
    exact: Fraction
    value: int
    counted: str  # for one: "tick"

    @property
    def error(self) -> Fraction:
        """By how much the value is too large, as a share of the exact value."""
        return self.value / self.exact - 1 if self.exact else Fraction(0)

    @property
    def matters(self) -> bool:
        """Whether the error is large enough to be shown; a point in time must be exact."""
        if self.conversion.is_moment:
            return self.exact != self.value
        return abs(self.error) >= SMALLEST_SHOWN

    def line(self, tick: Unit) -> str:
        """The text, its exact value, its value in the world, and their difference."""
        written = f"{self.conversion.key} {self.conversion.text}"
        counted = f"{shown(self.exact)} {self.counted}{'' if self.exact == 1 else 's'}"
        return f"{written}: {counted} -> {self.value:,}, {self.difference(tick)}"

    def difference(self, tick: Unit) -> str:
        """The error as text: "25 % slower"; for points in time: "0.2 s later"."""
        off = self.value - self.exact
        if self.conversion.is_moment:
            value, name = duration(abs(float(off)), tick)
            return f"{number(value)} {name} {'later' if off > 0 else 'earlier'}"
        more, less = ("longer", "shorter")
        if self.conversion.is_over_time:
            more, less = ("slower", "faster")
        elif self.conversion.dimension == Dimension.PERCENT_RATE:
            more, less = ("more", "less")
        return f"{in_percent(abs(self.error))} {more if off > 0 else less}"

    def error_with(self, tick: Fraction, former: Fraction) -> Fraction:
        """The error, as a share, if a tick had this number of seconds instead of `former`."""
        per_tick = self.conversion.dimension == Dimension.PERCENT_RATE
        exact = self.exact * (tick / former if per_tick else former / tick)
        if not exact:
            return exact
        bounds = self.conversion.bounds
        value = rounded(exact)
        if bounds.is_whole and not bounds.hold(value):
            return Fraction(1)
        return abs(value / exact - 1)


def roundings(resolved: Resolved) -> list[Rounding]:
    """All texts of a scenario that were rounded for its world."""
    conversions = list(resolved.conversions)
    for _, choice in resolved.choices:
        conversions += choice.conversions
    return [one for one in map(_rounding, conversions) if one is not None]


def _rounding(conversion: Conversion) -> Rounding | None:
    if conversion.dimension == Dimension.PERCENT_RATE:
        from automaton.world.rules import charge_units  # needs Numba, as most checks do not

        exact, value = conversion.exact * BATTERY_PERCENT, charge_units(conversion.value)
        return Rounding(conversion, exact, value, "unit")
    if not conversion.bounds.is_whole:
        return None
    return Rounding(conversion, conversion.exact, int(conversion.value), conversion.counted)


def conversion_lines(resolved: Resolved) -> list[str]:
    """A line for each conversion with an error that matters, by key; only the worst if there are many."""
    tick = resolved.scenario.units.scale.unit
    inexact = [one for one in roundings(resolved) if one.matters]
    inexact_lines = [one.line(tick) for one in inexact[:MOST_CONVERSIONS]]
    if len(inexact) > MOST_CONVERSIONS:
        inexact.sort(key=lambda one: -abs(one.error))
        inexact_lines = [one.line(tick) for one in inexact[:MOST_CONVERSIONS]]
        inexact_lines.append(
            f"... and {len(inexact) - MOST_CONVERSIONS:,} more with smaller errors"
        )
    return inexact_lines


def coarse_conversions(resolved: Resolved) -> list[str]:
    """Warn about large conversion errors, and name the largest tick without any."""
    durations = [one for one in roundings(resolved) if not one.conversion.is_moment]
    groups = (
        [one for one in durations if one.counted != "cell"],
        [one for one in durations if one.counted == "cell"],
    )
    scale, sentences = resolved.scenario.units.scale, []
    for group in groups:
        worst = max(group, key=lambda one: abs(one.error), default=None)
        if worst is not None and abs(worst.error) > TOLERANCE:
            hint = "only a different units.cell changes this"
            if worst.counted != "cell":
                hint = _fitting_tick(group, scale.tick_seconds)
            sentences.append(f"{worst.line(scale.unit)}; {hint}")
    return sentences


def _fitting_tick(group: list[Rounding], former: Fraction) -> str:
    within = f"within {in_percent(TOLERANCE)}"
    for tick in TICKS_TO_CHOOSE_FROM:
        if all(one.error_with(tick, former) <= TOLERANCE for one in group):
            return f"with units.tick: {shown(tick)} s all times are {within}"
    first, last = TICKS_TO_CHOOSE_FROM[0], TICKS_TO_CHOOSE_FROM[-1]
    return f"no tick from {shown(first)} to {shown(last)} s keeps all times {within}"


def plain_number_line(data: dict[str, Any], scale: Scale) -> str:
    """The keys whose plain numbers are ticks that are not seconds, each with its first number; or ""."""
    try:
        if scale.tick_seconds == 1:
            return ""
    except InputError:  # a tick is not a time
        return ""
    first: dict[str, float] = {}
    for keys, value in _ticks_in(data, plan_of(Scenario), ()):
        if value > 1:
            first.setdefault(".".join(key for key in keys if isinstance(key, str)), value)
    words = []
    for key, ticks in list(first.items())[:MOST_KEYS]:
        time, unit = duration(ticks, scale.unit)
        words.append(f"{key} {number(ticks)} ({number(time)} {unit})")
    if not words:
        return ""
    more = f" and {len(first) - MOST_KEYS} more keys" if len(first) > MOST_KEYS else ""
    return f"read in ticks of {scale.tick}: {', '.join(words)}{more}"


def tick_values(scenario: Scenario) -> dict[str, float]:
    """The numbers of ticks of a scenario by key, such as "stations.P1.breaks[0].from"."""
    plain = plain_data(scenario)
    return {dotted(keys): value for keys, value in _ticks_in(plain, plan_of(Scenario), ())}


def _ticks_in(value: Any, plan: Plan, keys: Keys) -> Iterator[tuple[Keys, float]]:
    """The plain numbers of ticks, with their keys."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        if plan.place is not None and plan.place.quantity.counted == "tick":
            yield keys, value
    elif isinstance(value, dict):
        for name, inner in value.items():
            following = plan.fields.get(name, plan.values)
            if following is not None:
                yield from _ticks_in(inner, following, (*keys, name))
    elif isinstance(value, list | tuple) and plan.items:
        for index, inner in enumerate(value):
            following = plan.items[min(index, len(plan.items) - 1)]
            yield from _ticks_in(inner, following, (*keys, index))


def shown(value: Fraction) -> str:
    """A number with up to six digits."""
    return f"{float(value):,.6g}"


def in_percent(share: Fraction) -> str:
    """A share as percent, with two digits below 10: "0.36 %", "25 %"."""
    percent = 100 * float(share)
    return f"{percent:.2g} %" if percent < 10 else f"{percent:,.0f} %"
