"""Confidence intervals and effects for metrics of independent runs, and required sample sizes.

    one mean      Student's interval, mean +- t(n - 1) s / sqrt(n)
    two, paired   mean and interval of the differences of runs with the same seed
    two, unpaired difference of means; Welch's interval, degrees of freedom of Satterthwaite (1946)
    relative      the difference and its interval in shares of mean b
    several       Bonferroni's levels

Metrics of fleets are skewed, so intervals from few runs have too low coverage; with fewer than 60 runs
a warning states skew and n. Resampling does not help: for 10 runs with skew 0.65 to 0.89, corrected
bootstrap intervals covered the mean in 93.4 % of cases, Student's in 94.8 %.

Student's t distribution is implemented here, because `size` and `reproduce` must work without SciPy.
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

STUDENT_MIN_RUNS: Final = 60  # fewer runs give a warning
MIN_RUNS: Final = 5  # fewer runs give no interval that is wider than the mean
TOO_FEW: Final = "too few runs"
DEFAULT_CONFIDENCE: Final = 0.95
ROUNDING: Final = 1e-12
SQUARES_TO_0: Final = 1e-150
NO_SPREAD_WARNING: Final = "all runs have the same value: the error of the mean cannot be estimated"
MIN_GROWTH: Final = 1.1  # least growth factor of runs from one round to the next
MAX_GROWTH: Final = 2.0
_NORMAL: Final = NormalDist()
_TERMS: Final = 500  # of the continued fraction
_EXACT: Final = 1e-15
_TINY: Final = 1e-300


class Interval(NamedTuple):
    """An estimate with its confidence interval; low and high are None if no interval is known."""

    value: float
    low: float | None
    high: float | None
    n: int  # runs
    method: str  # "t", "Welch", "none", or how else it was found
    level: float = DEFAULT_CONFIDENCE
    warning: str = ""

    @property
    def half(self) -> float | None:
        """The half-width."""
        if self.low is None or self.high is None:
            return None
        return (self.high - self.low) / 2

    def not_below_zero(self) -> Interval:
        """The interval cut off at 0, for a quantity that is never negative; the coverage is the same."""
        return self if self.low is None or self.low >= 0 else self._replace(low=0.0)

    def times(self, factor: float) -> Interval:
        """The interval in another unit."""
        low, high = (None if end is None else end * factor for end in (self.low, self.high))
        return self._replace(value=self.value * factor, low=low, high=high)

    def unless_vague(self, mean: float | None = None) -> Interval:
        """Without its ends if fewer than MIN_RUNS runs make it wider than the mean it refers to.

        `mean`: of a difference, the mean that it is compared with.
        """
        if self.low is None or self.high is None or self.n >= MIN_RUNS:
            return self
        if self.high - self.low <= abs(self.value if mean is None else mean):
            return self
        why = f"{TOO_FEW}: the interval would be wider than the mean"
        return self._replace(low=None, high=None, warning=why)

    def holds(self, truth: float) -> bool:
        """Whether the interval contains a value; False without bounds."""
        if self.low is None or self.high is None:
            return False
        return self.low <= truth <= self.high


def mean_interval(values: Sequence[float] | Values, level: float = DEFAULT_CONFIDENCE) -> Interval:
    """The mean of independent runs with Student's interval, in their unit; one run has no interval.

    Fewer than STUDENT_MIN_RUNS runs give a warning. Raises ValueError without runs, or if a value is
    not a number.
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
    """The values as an array. Raises ValueError for too few, or if a value is not a number."""
    x = np.asarray(values, np.float64)
    if x.ndim != 1 or len(x) < least:
        raise ValueError(f"at least {least} values are needed, not {x.size}")
    if not np.isfinite(x).all():
        raise ValueError("a value is not a number")
    return x


def constant(x: Values) -> bool:
    """Whether all values are equal except for rounding, or for differences whose squares are 0."""
    return float(np.ptp(x)) <= max(SQUARES_TO_0, ROUNDING * float(np.abs(x).max(initial=0)))


def skewness(values: Sequence[float] | Values) -> float:
    """m3 / m2^1.5, dimensionless; 0 for fewer than 3 values or equal values."""
    x = checked(values)
    if len(x) < 3 or constant(x):
        return 0.0
    deviations = x - x.mean()
    deviations /= np.abs(deviations).max()  # keeps powers from underflow and overflow
    return float((deviations**3).mean() / (deviations**2).mean() ** 1.5)


def few(*samples: Values) -> str:
    """The warning about few runs, with the largest skew of several samples; "" for enough runs."""
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


# Effects: the difference between two sets of runs.
#
# Pairing helps only if runs correlate: var(a - b) = var a + var b - 2 cov(a, b). Every effect therefore
# states the correlation r and the variance ratio var(a - b) / (var a + var b); above 1, pairing hurts.


class Effect(NamedTuple):
    """The effect of a against b."""

    difference: Interval  # mean a - mean b, in the unit of the runs
    relative: Interval | None  # in shares of mean b; None unless this is above 0
    p: float  # two-sided; null hypothesis: no difference
    paired: bool
    correlation: float | None  # of runs with the same seed; None if they are not pairs
    variance_ratio: float | None  # below 1: pairing helps


def effect(
    a: Sequence[float] | Values,
    b: Sequence[float] | Values,
    paired: bool = False,
    level: float = DEFAULT_CONFIDENCE,
) -> Effect:
    """The effect of a against b. Raises ValueError for fewer than 2 runs or incomplete pairs."""
    x, y = checked(a, 2), checked(b, 2)
    pairs = len(x) == len(y)
    if paired and not pairs:
        raise ValueError(f"{len(x)} and {len(y)} runs are not pairs")
    reference = float(y.mean())
    difference = mean_interval(x - y, level) if paired else unpaired(x, y, level)
    difference, p = difference.unless_vague(reference), _p_value(x, y, paired)
    if difference.warning == NO_SPREAD_WARNING and 1 - level <= p < 1:
        difference = difference._replace(low=None, high=None)  # without width it would exclude 0
    return Effect(
        difference=difference,
        relative=relative(difference, reference, float(x.min())),
        p=p,
        paired=paired,
        correlation=correlation(x, y) if pairs else None,
        variance_ratio=variance_ratio(x, y) if pairs else None,
    )


def relative(difference: Interval, reference: float, least: float) -> Interval | None:
    """A difference in shares of the mean that is compared with; None unless this is above 0.

    It is cut at -1 if no run is below 0 (`least`: the smallest).
    """
    if reference <= 0:
        return None
    share = difference.times(1 / reference)
    is_cut = share.low is not None and share.low < -1 and least >= 0
    return share._replace(low=-1.0) if is_cut else share


def correlation(x: Values, y: Values) -> float:
    """Pearson's r of pairs; 0 if one of the samples does not vary."""
    if constant(x) or constant(y):
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])


def variance_ratio(x: Values, y: Values) -> float:
    """var(x - y) / (var x + var y): 1 without correlation, less if pairing helps."""
    apart = float(x.var(ddof=1) + y.var(ddof=1))
    return float((x - y).var(ddof=1)) / apart if apart > 0 else 1.0


def unpaired(x: Values, y: Values, level: float = DEFAULT_CONFIDENCE) -> Interval:
    """mean x - mean y of independent samples, with Welch's interval."""
    difference, n = float(x.mean() - y.mean()), min(len(x), len(y))
    if constant(x) and constant(y):
        return Interval(difference, difference, difference, n, "Welch", level, NO_SPREAD_WARNING)
    error, degrees = _welch(x, y)
    half = student(degrees, level) * error
    return Interval(difference, difference - half, difference + half, n, "Welch", level, few(x, y))


def _welch(x: Values, y: Values) -> tuple[float, float]:
    """The standard error of the difference of means, and its degrees of freedom (Welch)."""
    u, v = float(x.var(ddof=1)) / len(x), float(y.var(ddof=1)) / len(y)
    if u + v <= 0:
        return 0.0, float(len(x) + len(y) - 2)
    share = u / (u + v)
    return math.sqrt(u + v), 1 / (share**2 / (len(x) - 1) + (1 - share) ** 2 / (len(y) - 1))


def _p_value(x: Values, y: Values, paired: bool) -> float:
    """The p value of Student's or Welch's test; without variance, of a permutation test.

    Without variance the t tests would give 0. Of all permutations of the runs, two are as extreme as
    the observed one: itself, and its reverse, which exists only for samples of equal size.
    """
    difference = float(x.mean() - y.mean())
    if constant(x - y) if paired else constant(x) and constant(y):
        ways = 2 ** len(x) if paired else math.comb(len(x) + len(y), len(x))
        is_none = abs(difference) <= ROUNDING * max(np.abs(x).max(), np.abs(y).max())
        return 1.0 if is_none else (2 if len(x) == len(y) else 1) / ways
    if paired:
        error, degrees = float((x - y).std(ddof=1)) / math.sqrt(len(x)), float(len(x) - 1)
    else:
        error, degrees = _welch(x, y)
    return tails(difference / error, degrees)


# Multiple comparisons. A family is the set of comparisons that are corrected together.


def bonferroni(level: float, comparisons: int) -> float:
    """The level of each interval that gives all intervals of a family the simultaneous `level`."""
    if comparisons < 1 or not 0 < level < 1:
        raise ValueError("a family has at least one comparison and a level between 0 and 1")
    return 1 - (1 - level) / comparisons


# The number of runs that an interval needs to reach the half-width `half`, from the variances of existing
# runs: for planning the next study, or the next round of a study with a target precision.
#
#     paired    t(n - 1) sd(a - b) / sqrt(n) <= half
#     unpaired  t(v) sqrt((var a + var b) / n) <= half, n runs of each; v: Satterthwaite (1946)


def paired_runs(
    a: Sequence[float] | Values,
    b: Sequence[float] | Values,
    half: float,
    level: float = DEFAULT_CONFIDENCE,
) -> int:
    """Number of pairs for which the interval of the difference has half-width `half`, at least 2.

    `a` and `b`: runs with the same seeds in the same order. Raises ValueError.
    """
    difference = checked(a, 2) - checked(b, 2)
    return fewest(float(difference.var(ddof=1)), 1.0, half, level)


def unpaired_runs(
    a: Sequence[float] | Values,
    b: Sequence[float] | Values,
    half: float,
    level: float = DEFAULT_CONFIDENCE,
) -> int:
    """Runs of each of two independent samples for half-width `half`, at least 2. Raises ValueError."""
    u, v = (float(checked(one, 2).var(ddof=1)) for one in (a, b))
    degrees = (u + v) ** 2 / (u * u + v * v) if u + v > 0 else 2.0
    return fewest(u + v, degrees, half, level)


def fewest(variance: float, degrees: float, half: float, level: float) -> int:
    """The smallest n >= 2 with t(degrees (n - 1)) sqrt(variance / n) <= half."""
    if half <= 0:
        raise ValueError(f"a precision must be above 0, not {half}")

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
    """Runs of each point after the next round; None if `n` are enough or the maximum.

    `wanted`: the estimated number of runs for the declared precision. A minimum step limits the number
    of interim analyses. A maximum step limits the cost of a first round whose variance is high by
    chance. Stopping at a narrow interval favours samples with a low variance, so the coverage is
    slightly lower than declared (`tests/helpers/statistics_trials.py rounds` measures it).
    """
    if wanted <= n or n >= at_most:
        return None
    least, most = math.ceil(MIN_GROWTH * n), math.floor(MAX_GROWTH * n)
    return min(at_most, max(least, min(most, wanted)))


# The normal distribution, and Student's t distribution:
#
#     P(|T| > t) = I_x(v / 2, 1 / 2),  x = v / (v + t^2)
#
# I is the regularized incomplete beta function, computed by its continued fraction (Abramowitz & Stegun
# 1964, 26.5.8) with Lentz's method (1976).


def normal_quantile(probability: float) -> float:
    """z with P(Z <= z) = probability. Raises ValueError unless 0 < probability < 1."""
    if not 0 < probability < 1:
        raise ValueError(f"a probability must lie between 0 and 1, not {probability}")
    return _NORMAL.inv_cdf(probability)


def tails(t: float, degrees: float) -> float:
    """P(|T| >= |t|) for `degrees` > 0 of freedom: the two-sided p value of a t statistic."""
    if degrees <= 0:
        raise ValueError(f"degrees of freedom must be above 0, not {degrees}")
    return 1.0 if t == 0 else incomplete_beta(degrees / (degrees + t * t), degrees / 2, 0.5)


@lru_cache(maxsize=4096)
def student(degrees: float, level: float = 0.95) -> float:
    """The factor of a two-sided interval: P(|T| <= factor) = level. Raises ValueError."""
    if not 0 < level < 1:
        raise ValueError(f"a level must lie between 0 and 1, not {level}")
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
        raise ValueError(f"the incomplete beta function is undefined for x = {x}, a = {a}, b = {b}")
    if x in (0, 1):
        return float(x)
    if x > (a + 1) / (a + b + 2):  # the fraction of 1 - x converges faster
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
