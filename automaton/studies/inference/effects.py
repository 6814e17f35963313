"""Effects: by how much one set of runs differs from another, with an interval.

paired     mean and interval of the differences of runs with the same seed
unpaired   difference of means; Welch's interval with the degrees of freedom of Satterthwaite (1946)
relative   a / b - 1; by the delta method on log a - log b, which stays correct for skewed ratios

Pairing helps only where runs correlate: var(a - b) = var a + var b - 2 cov(a, b). So every effect
tells the correlation r and the variance ratio var(a - b) / (var a + var b); above 1 pairing loses.

Several comparisons at once have Holm's tests, and Bonferroni's intervals beside them. A family is what
one declared table compares. Holm (1979): the i-th smallest of m p values is multiplied by m - i + 1,
and never becomes less than one before it; the probability of any false finding in the family then
stays below the level, whatever depends on what.

How many runs a comparison needs until the interval of its difference is as narrow as wanted:

    paired     t(n - 1) sd(a - b) / sqrt(n) <= half
    unpaired   t(v) sqrt((var a + var b) / n) <= half, n runs of each; v: Satterthwaite (1946)

By the variances of runs that were made: a plan for the next study, or for the next round of one that
declared beforehand that it goes on until then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from automaton.studies.inference.intervals import (
    DEFAULT_CONFIDENCE,
    NO_SPREAD_WARNING,
    Interval,
    Values,
    checked,
    constant,
    few,
    mean_interval,
)
from automaton.studies.inference.t_distribution import student, tails

# from a ratio to the upper end of its interval, as a logarithm
MAX_LOG_RATIO: Final = math.log(1e6)


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
