"""Intervals and effects for the metrics of independent runs, and how many runs they take.

    one mean      Student's interval, mean +- t(n - 1) s / sqrt(n)
    two, paired   mean and interval of the differences of runs with the same seed
    two, apart    difference of means; Welch's interval, degrees of freedom of Satterthwaite (1946)
    relative      a / b - 1, by the delta method on log a - log b, which stays correct for skewed ratios
    several       Holm's tests, and Bonferroni's intervals beside them

Runs of fleets are skewed: few runs give intervals that hold the truth too seldom, so below 60 runs
there is a warning that names skew and n. Resampling does not help: corrected bootstraps held the
mean of 10 runs with skew 0.65 to 0.89 in 93.4 %, Student's in 94.8. What both hold on shipped
scenarios is measured by tests/helpers/statistics_trials.py coverage.

Student's t distribution is own code and not SciPy, since `size` and `reproduce` need no extra and
importing `scipy.special` takes 0.3 s, this 0.01 s (two cores of an AMD EPYC); a test compares the two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]

STUDENT_MIN_RUNS: Final = 60  # runs from which there is no warning
DEFAULT_CONFIDENCE: Final = 0.95
ROUNDING: Final = 1e-12
NO_SPREAD_WARNING: Final = (
    "all runs have the same value: without spread the error of the mean is unknown"
)
MAX_LOG_RATIO: Final = math.log(1e6)  # from a ratio to the upper end of its interval
MIN_GROWTH: Final = 1.1  # of the runs from one round to the next
MAX_GROWTH: Final = 2.0
_NORMAL: Final = NormalDist()
_TERMS: Final = 500  # of a continued fraction
_EXACT: Final = 1e-15
_TINY: Final = 1e-300


class Interval(NamedTuple):
    """A figure and where its true value lies; low and high are None where nothing can be said."""

    value: float
    low: float | None
    high: float | None
    n: int  # runs
    method: str  # "t", "Welch", "delta", "none", or how else it was found
    level: float = DEFAULT_CONFIDENCE
    warning: str = ""

    @property
    def half(self) -> float | None:
        """Half of its width."""
        if self.low is None or self.high is None:
            return None
        return (self.high - self.low) / 2

    def not_below_zero(self) -> Interval:
        """The interval of what is never negative: without what lies below 0 it holds it as often."""
        return self if self.low is None or self.low >= 0 else self._replace(low=0.0)

    def holds(self, truth: float) -> bool:
        """Whether it contains a value; False without bounds."""
        if self.low is None or self.high is None:
            return False
        return self.low <= truth <= self.high


def mean_interval(values: Sequence[float] | Values, level: float = DEFAULT_CONFIDENCE) -> Interval:
    """The mean of independent runs, with Student's interval in their unit; none for one run.

    Fewer than STUDENT_MIN_RUNS runs have a warning. Raises ValueError without runs or for what is not a
    number.
    """
    x = checked(values)
    n, mean = len(x), float(x.mean())
    if n < 2:
        return Interval(mean, None, None, n, "none", level, few(x))
    if constant(x):
        return Interval(mean, mean, mean, n, "t", level, NO_SPREAD_WARNING)
    half = student(n - 1, level) * float(x.std(ddof=1)) / math.sqrt(n)
    return Interval(mean, mean - half, mean + half, n, "t", level, few(x))


def checked(values: Sequence[float] | Values, least: int = 1) -> Values:
    """The values as an array. Raises ValueError for too few, or for what is not a number."""
    x = np.asarray(values, np.float64)
    if x.ndim != 1 or len(x) < least:
        raise ValueError(f"at least {least} values are needed, not {x.size}")
    if not np.isfinite(x).all():
        raise ValueError("a value is not a number")
    return x


def constant(x: Values) -> bool:
    """Whether all runs gave the same, but for rounding."""
    return float(np.ptp(x)) <= ROUNDING * float(np.abs(x).max(initial=0))


def skewness(values: Sequence[float] | Values) -> float:
    """m3 / m2^1.5, without unit; 0 for fewer than 3 values or equal ones."""
    x = checked(values)
    if len(x) < 3 or constant(x):
        return 0.0
    deviations = x - x.mean()
    deviations /= np.abs(deviations).max()  # so that powers neither vanish nor overflow
    return float((deviations**3).mean() / (deviations**2).mean() ** 1.5)


def few(*samples: Values) -> str:
    """The warning about few runs, with the larger skew of several samples; "" for enough."""
    n = min(map(len, samples))
    if n >= STUDENT_MIN_RUNS:
        return ""
    if n < 2:
        return "one run gives no interval"
    skew = max(map(skewness, samples), key=abs)
    return (
        f"only {n} runs, skew {skew:.1f}: the coverage of the interval may be lower than "
        f"stated; {STUDENT_MIN_RUNS} runs are enough for most fleets"
    )


# Effects: by how much one set of runs differs from another.
#
# Pairing helps only where runs correlate: var(a - b) = var a + var b - 2 cov(a, b). So every effect
# tells the correlation r and the variance ratio var(a - b) / (var a + var b); above 1 pairing loses.


class Effect(NamedTuple):
    """a against b."""

    difference: Interval  # mean a - mean b, in the unit of the runs
    relative: Interval | None  # a / b - 1; None unless both means are above 0
    p: float  # two-sided, of no difference
    paired: bool
    correlation: float | None  # of runs with the same seed; None if they are not pairs
    variance_ratio: float | None  # below 1: pairing helps


def effect(
    a: Sequence[float] | Values,
    b: Sequence[float] | Values,
    paired: bool = False,
    level: float = DEFAULT_CONFIDENCE,
) -> Effect:
    """The effect of a against b. Raises ValueError: fewer than 2 runs, or pairs of unequal number."""
    x, y = checked(a, 2), checked(b, 2)
    pairs = len(x) == len(y)
    if paired and not pairs:
        raise ValueError(f"{len(x)} and {len(y)} runs are not pairs")
    difference = mean_interval(x - y, level) if paired else unpaired(x, y, level)
    return Effect(
        difference=difference,
        relative=relative(x, y, paired, level),
        p=_p_value(x, y, paired),
        paired=paired,
        correlation=correlation(x, y) if pairs else None,
        variance_ratio=variance_ratio(x, y) if pairs else None,
    )


def correlation(x: Values, y: Values) -> float:
    """Pearson's r of pairs; 0 where one of them does not vary."""
    if constant(x) or constant(y):
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])


def variance_ratio(x: Values, y: Values) -> float:
    """var(x - y) / (var x + var y): 1 without correlation, less where pairing helps."""
    apart = float(x.var(ddof=1) + y.var(ddof=1))
    return float((x - y).var(ddof=1)) / apart if apart > 0 else 1.0


def unpaired(x: Values, y: Values, level: float = DEFAULT_CONFIDENCE) -> Interval:
    """mean x - mean y of independent samples, with Welch's interval."""
    difference, n = float(x.mean() - y.mean()), min(len(x), len(y))
    error, degrees = _welch(x, y)
    half = student(degrees, level) * error
    ends = difference - half, difference + half
    return Interval(difference, *ends, n, "Welch", level, few(x, y) if error else NO_SPREAD_WARNING)


def relative(
    x: Values, y: Values, paired: bool, level: float = DEFAULT_CONFIDENCE
) -> Interval | None:
    """mean x / mean y - 1 without unit, by the delta method; None unless both means are above 0.

    Without an upper end where it would be a million times the ratio.
    """
    a, b, n = float(x.mean()), float(y.mean()), min(len(x), len(y))
    if a <= 0 or b <= 0:
        return None
    if paired:
        scaled = x / a - y / b
        error, degrees = float(scaled.std(ddof=1)) / math.sqrt(n), float(n - 1)
    else:
        error, degrees = _welch(x / a, y / b)
    half, ratio = student(degrees, level) * error, a / b
    low = ratio * math.exp(-half) - 1
    high = ratio * math.exp(half) - 1 if half < MAX_LOG_RATIO else None
    return Interval(ratio - 1, low, high, n, "delta", level)


def _welch(x: Values, y: Values) -> tuple[float, float]:
    """Standard error of the difference of means, and its degrees of freedom."""
    u, v = float(x.var(ddof=1)) / len(x), float(y.var(ddof=1)) / len(y)
    if u + v <= 0:
        return 0.0, float(len(x) + len(y) - 2)
    share = u / (u + v)
    return math.sqrt(u + v), 1 / (share**2 / (len(x) - 1) + (1 - share) ** 2 / (len(y) - 1))


def _p_value(x: Values, y: Values, paired: bool) -> float:
    """Student's or Welch's; without spread, where they say 0, that of a permutation test.

    Of all ways to exchange runs, two set them apart as clearly as they were found: this one and its
    reverse, which samples of unequal size have not.
    """
    if paired:
        error, degrees = float((x - y).std(ddof=1)) / math.sqrt(len(x)), float(len(x) - 1)
    else:
        error, degrees = _welch(x, y)
    difference = float(x.mean() - y.mean())
    if error <= 1e-12 * abs(difference) or error == 0:
        ways = 2 ** len(x) if paired else math.comb(len(x) + len(y), len(x))
        return 1.0 if difference == 0 else (2 if len(x) == len(y) else 1) / ways
    return tails(difference / error, degrees)


# Several comparisons at once. A family is what one declared table compares. Holm (1979): the i-th
# smallest of m p values is multiplied by m - i + 1, and never becomes less than one before it; the
# probability of any false finding in the family then stays below the level, whatever depends on what.


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjusted p values in the order given, at most 1. Raises ValueError beyond 0..1."""
    if any(not 0 <= p <= 1 for p in p_values):
        raise ValueError("p values lie between 0 and 1")
    adjusted, largest = [0.0] * len(p_values), 0.0
    for rank, index in enumerate(sorted(range(len(p_values)), key=lambda i: p_values[i])):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[index]))
        adjusted[index] = largest
    return adjusted


def bonferroni(level: float, comparisons: int) -> float:
    """The level of each interval so that all of a family hold together with `level`."""
    if comparisons < 1 or not 0 < level < 1:
        raise ValueError("a family has at least one comparison and a level between 0 and 1")
    return 1 - (1 - level) / comparisons


# How many runs an interval takes until it reaches `half` to each side, by the variances of runs that
# were made: a plan for the next study, or for the next round of one that goes on until then.
#
#     paired    t(n - 1) sd(a - b) / sqrt(n) <= half
#     unpaired  t(v) sqrt((var a + var b) / n) <= half, n runs of each; v: Satterthwaite (1946)


def paired_runs(
    a: Sequence[float] | Values,
    b: Sequence[float] | Values,
    half: float,
    level: float = DEFAULT_CONFIDENCE,
) -> int:
    """Pairs of runs until the interval of the difference reaches `half` to each side, at least 2.

    `a` and `b`: runs with the same seeds, one below the other. Raises ValueError.
    """
    difference = checked(a, 2) - checked(b, 2)
    return fewest(float(difference.var(ddof=1)), 1.0, half, level)


def unpaired_runs(
    a: Sequence[float] | Values,
    b: Sequence[float] | Values,
    half: float,
    level: float = DEFAULT_CONFIDENCE,
) -> int:
    """Runs of each of two independent samples for the same, at least 2. Raises ValueError."""
    u, v = (float(checked(one, 2).var(ddof=1)) for one in (a, b))
    degrees = (u + v) ** 2 / (u * u + v * v) if u + v > 0 else 2.0
    return fewest(u + v, degrees, half, level)


def fewest(variance: float, degrees: float, half: float, level: float) -> int:
    """The smallest n from 2 on with t(degrees (n - 1)) sqrt(variance / n) <= half."""
    if half <= 0:
        raise ValueError(f"a precision is above 0, not {half}")

    def enough(n: int) -> bool:
        return student(degrees * (n - 1), level) * math.sqrt(variance / n) <= half

    low, high = 1, 2
    while not enough(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def next_round(n: int, wanted: int, at_most: int) -> int | None:
    """Runs of each point after the next round; None if `n` are enough, or are all there may be.

    `wanted`: the runs that the declared precision takes, by their variances. The smallest step keeps
    the looks at the data few; the largest keeps a first round whose runs differ much by chance from
    asking for far too many. Whoever stops when the interval is narrow stops more often where the variance
    happens to be small: a little less often than declared the interval holds the truth
    (tests/helpers/statistics_trials.py rounds measures it).
    """
    if wanted <= n or n >= at_most:
        return None
    least, most = math.ceil(MIN_GROWTH * n), math.floor(MAX_GROWTH * n)
    return min(at_most, max(least, min(most, wanted)))


# The normal distribution, and Student's:
#
#     P(|T| > t) = I_x(v / 2, 1 / 2),  x = v / (v + t^2)
#
# I is the regularized incomplete beta function, by its continued fraction (Abramowitz & Stegun 1964,
# 26.5.8, evaluated as in Lentz 1976).


def normal_quantile(probability: float) -> float:
    """z with P(Z <= z) = probability, which lies strictly between 0 and 1; else ValueError."""
    if not 0 < probability < 1:
        raise ValueError(f"a probability lies between 0 and 1, not {probability}")
    return _NORMAL.inv_cdf(probability)


def tails(t: float, degrees: float) -> float:
    """P(|T| >= |t|) with so many degrees of freedom (> 0): the two-sided p value of a t statistic."""
    if degrees <= 0:
        raise ValueError(f"degrees of freedom are above 0, not {degrees}")
    return 1.0 if t == 0 else incomplete_beta(degrees / (degrees + t * t), degrees / 2, 0.5)


@lru_cache(maxsize=4096)
def student(degrees: float, level: float = 0.95) -> float:
    """The factor of a two-sided interval: P(|T| <= factor) = level. Raises ValueError."""
    if not 0 < level < 1:
        raise ValueError(f"a level lies between 0 and 1, not {level}")
    low, high = 0.0, 1.0
    while tails(high, degrees) > 1 - level:
        low, high = high, 2 * high
    while high - low > 1e-12 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if tails(middle, degrees) > 1 - level else (low, middle)
    return (low + high) / 2


def incomplete_beta(x: float, a: float, b: float) -> float:
    """I_x(a, b) for 0 <= x <= 1 and a, b > 0."""
    if not 0 <= x <= 1 or a <= 0 or b <= 0:
        raise ValueError(f"no incomplete beta function of x = {x}, a = {a}, b = {b}")
    if x in (0, 1):
        return float(x)
    if x > (a + 1) / (a + b + 2):  # there the fraction of the other side converges fast
        return 1 - incomplete_beta(1 - x, b, a)
    log_front = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b)
    log_front += a * math.log(x) + b * math.log1p(-x)
    return math.exp(log_front) * _fraction(x, a, b) / a


def _fraction(x: float, a: float, b: float) -> float:
    c, d = 1.0, 1 / _off_zero(1 - (a + b) * x / (a + 1))
    value = d
    for m in range(1, _TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        for term in (even, odd):
            d = 1 / _off_zero(1 + term * d)
            c = _off_zero(1 + term / c)
            value *= c * d
        if abs(c * d - 1) < _EXACT:
            break
    return value


def _off_zero(value: float) -> float:
    return value if abs(value) > _TINY else _TINY
