"""Intervals of a mean of independent runs: Student's from 60 runs on, mostly a bootstrap below.

t     mean +- t(n - 1) s / sqrt(n)

BCa   quantiles of the means of resampled runs, at levels corrected for bias and acceleration
      (Efron 1987; Efron & Tibshirani 1993, chapter 14):
      a = sum(U^3) / (6 sum(U^2)^1.5),  U = deviations of the runs,
      level' = P(Z <= z0 + (z0 + z) / (1 - a (z0 + z))),  z0 = quantile of the share below the mean
      z = -+ sqrt(n / (n - 1)) t(n - 1): a resample spreads less than the runs it is drawn from
      (Hesterberg 2015, "expanded"). Plain BCa holds the truth less often than Student's: of table-top
      runs in 86.7 % at n = 10, 90.6 at 20, against 90.5 and 92.4; expanded in 91.2 and 93.2
      (tests/statistics_trials.py).

Below 60 runs Student's remains where resamples cannot show the ends: for fewer than 8 runs, and where
fewer than 20 of the resamples would lie beyond an end. At the levels of a family BCa ends with its
largest resample and gets no wider: of families of 20 intervals of 10 normal runs 23 % missed a mean
where 5 % are promised, of Student's 4 %; single intervals of 4 runs missed it in 12 and 5 %
(tests/statistics_trials.py families).

Runs of fleets are skewed: few runs give intervals that hold the truth too seldom, whatever the
method, so below 60 runs there is a warning that names skew and n.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.statistics.addressed import resamples
from automaton.statistics.student import normal_probability, normal_quantile, student

Values = npt.NDArray[np.float64]

ENOUGH: Final = 60  # runs from which Student's interval is used
LEVEL: Final = 0.95
FEWEST: Final = 8  # runs from which a bootstrap interval is used
RESAMPLES: Final = 4000
BEYOND: Final = 20  # resamples that a bootstrap interval needs beyond each end
BOOTSTRAP_SEED: Final = 1987
ROUNDING: Final = 1e-12
SAME: Final = (
    "all runs gave the same: without spread nothing is known of how far the mean may be off"
)


class Interval(NamedTuple):
    """A figure and where its true value lies; low and high are None where nothing can be said."""

    value: float
    low: float | None
    high: float | None
    n: int  # runs
    method: str  # "t", "BCa", "Welch", "delta" or "none"
    level: float = LEVEL
    warning: str = ""

    @property
    def half(self) -> float | None:
        """Half of its width."""
        if self.low is None or self.high is None:
            return None
        return (self.high - self.low) / 2

    def holds(self, truth: float) -> bool:
        """Whether it contains a value; False without bounds."""
        if self.low is None or self.high is None:
            return False
        return self.low <= truth <= self.high


def mean_interval(
    values: Sequence[float] | Values, level: float = LEVEL, seed: int = BOOTSTRAP_SEED
) -> Interval:
    """The mean of independent runs, with an interval in their unit.

    Student's from ENOUGH runs on, else BCa where resamples show its ends, with a warning; none for
    one run. Raises ValueError without runs or for what is no number.
    """
    x = checked(values)
    n, mean = len(x), float(x.mean())
    if n < 2:
        return Interval(mean, None, None, n, "none", level, few(x))
    if constant(x):
        return Interval(mean, mean, mean, n, "t", level, SAME)
    reach = expanded(n, n - 1, level)
    if not resampled(n, reach):
        half = student(n - 1, level) * float(x.std(ddof=1)) / math.sqrt(n)
        return Interval(mean, mean - half, mean + half, n, "t", level, few(x))
    means = x[resamples(seed, RESAMPLES, n)].mean(axis=1)
    low, high = bca(mean, means, x - mean, reach)
    return Interval(mean, low, high, n, "BCa", level, few(x))


def checked(values: Sequence[float] | Values, least: int = 1) -> Values:
    """The values as an array. Raises ValueError for too few, or for what is no number."""
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
    deviations = scaled(x - x.mean())
    return float((deviations**3).mean() / (deviations**2).mean() ** 1.5)


def scaled(x: Values) -> Values:
    """Values in units of the largest: powers of them neither vanish nor overflow."""
    largest = float(np.abs(x).max(initial=0))
    return x / largest if largest > 0 else x


def few(*samples: Values) -> str:
    """The warning about few runs, with the larger skew of several samples; "" for enough."""
    n = min(map(len, samples))
    if n >= ENOUGH:
        return ""
    if n < 2:
        return "one run gives no interval"
    skew = max(map(skewness, samples), key=abs)
    return (
        f"only {n} runs, skew {skew:.1f}: the interval may hold the truth less often "
        f"than it says; {ENOUGH} runs are enough for most fleets"
    )


def expanded(n: int, degrees: float, level: float) -> float:
    """Where the ends of a bootstrap interval of n runs lie, in standard deviations of resamples."""
    return math.sqrt(n / (n - 1)) * student(degrees, level)


def resampled(n: int, reach: float) -> bool:
    """Whether a bootstrap interval of n runs is used: enough resamples lie beyond its ends."""
    return FEWEST <= n < ENOUGH and RESAMPLES * normal_probability(-reach) >= BEYOND


def bca(value: float, replicates: Values, influence: Values, reach: float) -> tuple[float, float]:
    """The ends of a BCa interval of a statistic.

    `replicates`: the statistic of each resample; `influence`: how far each run moves it; `reach`:
    the ends before their correction, in standard deviations.
    """
    below = float(np.count_nonzero(replicates < value))
    below += float(np.count_nonzero(replicates == value)) / 2  # ties, where runs are whole numbers
    share = min(max(below / len(replicates), 0.5 / len(replicates)), 1 - 0.5 / len(replicates))
    z0 = normal_quantile(share)
    moves = scaled(influence)
    spread = float((moves**2).sum())
    acceleration = float((moves**3).sum()) / (6 * spread**1.5) if spread > 0 else 0.0
    ends = []
    for z in (z0 - reach, z0 + reach):
        shrunk = 1 - acceleration * z
        corrected = normal_probability(z0 + z / shrunk) if shrunk > 0 else float(z > 0)
        ends.append(float(np.quantile(replicates, corrected)))
    return ends[0], ends[1]
