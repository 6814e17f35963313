"""Judge whether simulated runs agree with days of a site.

    day         the largest standardized deviation of its quantities, against those of the runs: each run
                is as likely as the day to have the largest, if the model is right
    band        mean of the runs +- the deviation that 95 % of days stay within, for all hours at once
    quantity    Student's test of the relative differences of days; Holm over all quantities
    tolerance   two one-sided tests at 5 % (Schuirmann 1987): the 90 % interval lies within +- tolerance

The p values of days are combined by Fisher's method. One day alone is judged by its band.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.fleet_trace import (
    HOURLY,
    LEAD_TIME,
    LEAD_TIME_P50,
    LEAD_TIME_P95,
    ORDERS_AN_HOUR,
    STRETCH,
)
from automaton.studies.inference.intervals import (
    Interval,
    effect,
    mean_interval,
    normal_quantile,
)

Array = np.ndarray[Any, Any]
Measures = Mapping[str, float]

ERROR: Final = 0.05  # of all tests of a comparison together
POWER: Final = 0.9
TOLERANCES: Final = {ORDERS_AN_HOUR: 0.05, LEAD_TIME: 0.1, LEAD_TIME_P50: 0.1, LEAD_TIME_P95: 0.1}
DECISIVE: Final = (ORDERS_AN_HOUR, LEAD_TIME)  # a model matches if both are within their tolerances
TINY: Final = 1e-9  # spread of what is 0 in all runs
LEAST_SPREAD: Final = 0.005  # of the mean: runs that all agree are not certain
LEAST_ORDER_SPREAD: Final = 0.5  # the same, of orders in an hour
TESTS: Final = 15  # about as many as a comparison makes
MIN_STRETCH_SHARE: Final = 0.002  # of the robot time; less busy stretches are not compared
MATCHES: Final = "matches"
DIFFERS: Final = "differs"
UNDECIDED: Final = "cannot be said"


def mean_of(values: Iterable[float]) -> float:
    """The mean of the values that are numbers; nan without any."""
    known = [value for value in values if math.isfinite(value)]
    return math.fsum(known) / len(known) if known else math.nan


class DayResult(NamedTuple):
    """A day beside its runs."""

    name: str
    begin: int  # milliseconds since 1970
    real: Measures
    runs: Sequence[Measures]

    def mean(self, quantity: str) -> float:
        """The mean of a quantity over the runs that have it."""
        return mean_of(run[quantity] for run in self.runs)


class DayBand(NamedTuple):
    """How a day compares with its runs, all hours and quantities at once."""

    p: float  # share of equally likely cases with so large a deviation
    hours: Array  # (h, 4) float: real, mean of the runs, low and high end of the band
    outside: tuple[str, ...]  # quantities outside the band: hours, then the largest deviations


class QuantityDifference(NamedTuple):
    """A quantity over all days: real relative to simulated."""

    quantity: str
    real: float  # means over the days
    simulated: float
    interval: Interval | None  # of the relative difference, 90 %; None: one day
    p: float  # adjusted; 1: one day
    tolerance: float | None
    verdict: str
    # To show that the difference is within the tolerance, or that there is one, at POWER; None: not
    # known, or no tolerance.
    days_needed: int | None

    @property
    def relative(self) -> float:
        """The relative difference."""
        return math.nan if self.interval is None else self.interval.value


class StretchDifference(NamedTuple):
    """Robot seconds a day on a stretch: real minus simulated."""

    stretch: int
    real: float
    simulated: float
    p: float  # adjusted for all tests of the comparison; 1: one day


class Agreement(NamedTuple):
    """The verdict on a model."""

    verdict: str
    bands: list[DayBand]
    p_days: float  # adjusted p of the bands of all days together
    differences: list[QuantityDifference]
    stretches: list[StretchDifference]  # by p, then by seconds

    @property
    def first(self) -> tuple[int, str] | None:
        """The number of the first day outside its band, and its first hour or quantity there."""
        for number, band in enumerate(self.bands):
            if band.outside and band.p <= ERROR:
                return number, band.outside[0]
        return None


def agreement(days: Sequence[DayResult]) -> Agreement:
    """Judge a model by days that it was not fitted to."""
    names = [name for name in days[0].real if not name.startswith((HOURLY, STRETCH))]
    bands = [day_band(day) for day in days]
    ratios = {name: relative_differences(days, name) for name in names}
    stretches = stretch_differences(days)
    quantities = [
        min((one.p for one in stretches), default=1.0),
        *(p_of_zero(ratios[name]) for name in names),
    ]
    p_days = combined([band.p for band in bands])
    if len(days) > 1:  # the bands cover all quantities, so they have half of the error
        p_days, least = min(1.0, 2 * p_days), quantities[0]
        quantities = [min(1.0, 2 * p) for p in holm(quantities)]
        stretches = [one._replace(p=min(1.0, one.p * quantities[0] / least)) for one in stretches]
    differences = [
        difference(days, name, ratios[name], p)
        for name, p in zip(names, quantities[1:], strict=True)
    ]
    verdict = verdict_of([p_days, *quantities], differences)
    return Agreement(verdict, bands, p_days, differences, stretches)


def verdict_of(adjusted: Sequence[float], differences: Sequence[QuantityDifference]) -> str:
    """The verdict of a comparison from the adjusted p of all its tests."""
    if min(adjusted) <= ERROR:
        return DIFFERS
    judged = [one for one in differences if one.quantity in DECISIVE]
    return MATCHES if all(one.verdict == MATCHES for one in judged) else UNDECIDED


# A day.


def day_band(day: DayResult) -> DayBand:
    """Compare a day with its runs, by the largest standardized deviation of all quantities."""
    names = [name for name in day.real if not name.startswith(STRETCH)]
    names = [name for name in names if math.isfinite(day.real[name])]
    runs = np.array([[run[name] for name in names] for run in day.runs])
    names = [
        name
        for name, is_known in zip(names, np.isfinite(runs).all(axis=0), strict=True)
        if is_known
    ]
    runs = runs[:, np.isfinite(runs).all(axis=0)]
    real = np.array([day.real[name] for name in names])
    floor = np.array([LEAST_ORDER_SPREAD if name.startswith(HOURLY) else 0.0 for name in names])
    n, mean = len(runs), runs.mean(axis=0)
    floor = np.maximum(np.maximum(floor, LEAST_SPREAD * np.abs(mean)), TINY)
    spread = np.maximum(runs.std(axis=0, ddof=1), floor)
    others_mean = (n * mean - runs) / (n - 1)
    squares = ((runs - mean) ** 2).sum(axis=0) - (runs - mean) ** 2 * n / (n - 1)
    others_spread = np.maximum(np.sqrt(np.maximum(squares, 0) / (n - 2)), floor)
    largest = np.max(np.abs(runs - others_mean) / others_spread, axis=1)
    deviation = np.abs(real - mean) / np.where(spread > 0, spread, 1)
    limit = np.sort(largest)[min(n, math.ceil((1 - ERROR) * (n + 1))) - 1]
    p = (1 + int((largest >= deviation.max()).sum())) / (n + 1)
    is_hour = np.array([name.startswith(HOURLY) for name in names])
    order = np.lexsort((-deviation * ~is_hour, ~is_hour))  # hours in their order, then by deviation
    outside = [names[number] for number in order.tolist() if deviation[number] > limit]
    ends = np.stack(
        [real, mean, np.maximum(mean - limit * spread, 0), mean + limit * spread], axis=1
    )
    return DayBand(p, ends[is_hour], tuple(outside))


def combined(values: Sequence[float]) -> float:
    """Fisher's combination of independent p values: the upper tail of chi-square."""
    half = -sum(map(math.log, values))
    if half <= 0:
        return 1.0
    logs = (k * math.log(half) - math.lgamma(k + 1) - half for k in range(len(values)))
    return min(1.0, math.fsum(map(math.exp, logs)))


# Over days.


def relative_differences(days: Sequence[DayResult], name: str) -> Sequence[float]:
    """Real / mean of the runs - 1 on each day that has both."""
    pairs = [(day.real[name], day.mean(name)) for day in days]
    known = [real / mean - 1 for real, mean in pairs if math.isfinite(real) and mean > 0]
    return spread_out(known)


def spread_out(values: Sequence[float], scale: float = 1.0) -> Sequence[float]:
    """Values of days with a standard deviation of at least LEAST_SPREAD of `scale`: days that all agree
    are not certain."""
    least = max(LEAST_SPREAD * scale, TINY)
    if len(values) < 2 or np.std(values, ddof=1) >= least:
        return values
    apart = np.resize([1.0, -1.0], len(values))
    apart[-1] *= 1 - len(values) % 2
    wide: list[float] = (np.mean(values) + least / np.std(apart, ddof=1) * apart).tolist()
    return wide


def p_of_zero(values: Sequence[float]) -> float:
    """The p value of Student's test that the mean is 0; 1 for fewer than 2 values."""
    if len(values) < 2:
        return 1.0
    return effect(values, np.zeros(len(values)), paired=True).p


def difference(
    days: Sequence[DayResult], name: str, values: Sequence[float], p: float
) -> QuantityDifference:
    """The difference of a quantity over all days, and its verdict."""
    tolerance, needed = TOLERANCES.get(name), None
    interval = mean_interval(values, 1 - 2 * ERROR) if values else None
    verdict = DIFFERS if p <= ERROR else UNDECIDED
    if interval is not None and interval.low is not None and interval.high is not None:
        spread = float(np.std(values, ddof=1))
        needed = None if tolerance is None else days_needed(spread, tolerance, interval.value)
        if tolerance is not None and -tolerance < interval.low and interval.high < tolerance:
            verdict = MATCHES
    real = mean_of(day.real[name] for day in days)
    simulated = mean_of(day.mean(name) for day in days)
    return QuantityDifference(name, real, simulated, interval, p, tolerance, verdict, needed)


def days_needed(spread: float, tolerance: float, mean: float = 0.0) -> int:
    """Days that show with POWER that the mean lies within a tolerance, else that it differs from 0.

    `spread`: standard deviation of the relative differences of days, of which `mean` is the mean if it
    is beyond the tolerance. 4, 11 and 44 days for 3, 5 and 10 % at a tolerance of 5 %.
    """
    z = normal_quantile(1 - ERROR) + normal_quantile(1 - (1 - POWER) / 2)
    if abs(mean) >= tolerance:
        # Among some ten tests, adjusted for their number and the bands.
        z, tolerance = normal_quantile(1 - ERROR / (4 * TESTS)) + normal_quantile(POWER), abs(mean)
    return max(2, math.ceil((z * spread / tolerance) ** 2))


def stretch_differences(days: Sequence[DayResult]) -> list[StretchDifference]:
    """The busy stretches, those whose difference is least likely by chance first."""
    names = [name for name in days[0].real if name.startswith(STRETCH)]
    real = np.array([[day.real[name] for name in names] for day in days]).reshape(len(days), -1)
    simulated = np.array([[day.mean(name) for name in names] for day in days]).reshape(real.shape)
    both = (real + simulated).sum(axis=0)
    busy = np.flatnonzero(both >= MIN_STRETCH_SHARE * both.sum())
    apart = real - simulated
    scale = both / (2 * len(days))
    adjusted = holm([p_of_zero(spread_out(apart[:, at], float(scale[at]))) for at in busy])
    ranked = [
        StretchDifference(
            number, float(real[:, number].mean()), float(simulated[:, number].mean()), p
        )
        for number, p in zip(busy.tolist(), adjusted, strict=True)
    ]
    return sorted(ranked, key=lambda one: (one.p, -abs(one.real - one.simulated)))


def holm(values: Sequence[float]) -> list[float]:
    """Holm's adjusted p values (1979), in the order of the values."""
    adjusted, highest = [1.0] * len(values), 0.0
    for rank, number in enumerate(np.argsort(values, kind="stable").tolist()):
        highest = max(highest, min(1.0, (len(values) - rank) * values[number]))
        adjusted[number] = highest
    return adjusted
