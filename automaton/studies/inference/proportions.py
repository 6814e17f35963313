"""Shares of runs, and sequential tests of shares and means.

Clopper & Pearson (1934), for s of n runs with n fixed in advance: with I the incomplete beta function
and e = 1 - level, the interval goes from the p with I_p(s, n - s + 1) = e / 2 to the p with
I_p(s + 1, n - s) = 1 - e / 2. For s = 0 its upper end is 1 - (e / 2)^(1 / n), about 3.7 / n.

Wald (1945): after s runs that meet the target and f runs that miss it,

    L = s log(p1 / p0) + f log((1 - p1) / (1 - p0)),   p0 = share - zone, p1 = share + zone

the share is accepted as soon as L >= b and rejected as soon as L <= -b, with b = log((1 - e) / e).
A share of p0 or less passes with probability at most e / (1 - e), and a share of p1 or more fails with
the same probability: 5.3 % for e = 0.05. The sum of both probabilities is at most 2 e.

Confidence sequence from the beta mixture of all alternatives (Robbins 1970; beta-binomial boundary of
Howard, Ramdas, McAuliffe & Sekhon 2021): all p with

    B(a + s, b + f) / B(a, b) / (p^s (1 - p)^f) < 1 / (1 - level)

It is valid simultaneously for all numbers of runs, so the stopping time does not matter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.studies.inference.intervals import (
    DEFAULT_CONFIDENCE,
    Interval,
    Values,
    checked,
    incomplete_beta,
)

Verdict = Literal["meets", "fails", "undecided"]
Counts = NDArray[np.int64]

PRIOR: Final = (0.5, 0.5)  # a and b
HALVINGS: Final = 60
RUNS_PER_FORECAST_STEP: Final = 128  # whose verdicts are computed at once
RUNS_PER_BATCH: Final = 10  # runs
FIRST_STAGE_RUNS: Final = 20  # batches before the first decision: n0


class ShareTest(NamedTuple):
    """Wald's sequential test of two hypotheses on a share."""

    low: float  # p0
    high: float  # p1
    error: float  # of the first and of the second kind

    @property
    def bound(self) -> float:
        """The log-likelihood ratio that decides the test."""
        return math.log((1 - self.error) / self.error)

    @property
    def fewest(self) -> int:
        """The least number of runs to pass: if all meet the target."""
        return math.ceil(self.bound / math.log(self.high / self.low) - 1e-9)

    def ratio(self, met: Counts, missed: Counts) -> Values:
        """The log-likelihood ratio of `high` against `low`."""
        gain = math.log(self.high / self.low)
        loss = math.log((1 - self.high) / (1 - self.low))
        return met * gain + missed * loss

    def verdict(self, outcomes: Iterable[bool]) -> tuple[Verdict, int]:
        """The verdict on runs in their order, and the number of runs that decided it."""
        return _decided(self, outcomes)


class SureShare(NamedTuple):
    """The test whether the confidence sequence of a share lies above a given share, or below it."""

    share: float
    error: float  # 1 - level of the confidence sequence

    @property
    def bound(self) -> float:
        """The log-likelihood ratio of the mixture against `share` that decides the test."""
        return -math.log(self.error)

    @property
    def fewest(self) -> int:
        """The least number of runs to pass: if all meet the target."""
        most = 64
        while True:
            ratio = self.ratio(np.arange(1, most), np.zeros(most - 1, np.int64))
            if ratio[-1] >= self.bound:
                return 1 + int(np.argmax(ratio >= self.bound))
            most *= 2

    def ratio(self, met: Counts, missed: Counts) -> Values:
        """The log-likelihood ratio, negative where fewer than `share` of the runs meet the target."""
        runs = met + missed
        mixture = _log_rising(PRIOR[0], met) + _log_rising(PRIOR[1], missed)
        mixture -= _log_rising(sum(PRIOR), runs)
        gain = mixture - met * math.log(self.share) - missed * math.log1p(-self.share)
        signed: Values = np.where(met > self.share * runs, 1.0, -1.0) * np.maximum(gain, 0.0)
        return signed

    def verdict(self, outcomes: Iterable[bool]) -> tuple[Verdict, int]:
        """The verdict on runs in their order, and the number of runs that decided it."""
        return _decided(self, outcomes)


def _log_rising(a: float, counts: Counts) -> Values:
    """log(a (a + 1) ... (a + k - 1)) for each count k."""
    steps = np.log(a + np.arange(int(counts.max(initial=0))))
    products: Values = np.concatenate(([0.0], np.cumsum(steps)))
    return products[counts]


def _decided(test: ShareTest | SureShare, outcomes: Iterable[bool]) -> tuple[Verdict, int]:
    """The first of the runs after which the ratio of a test reaches its bound on either side."""
    good = np.fromiter(outcomes, np.int64)
    met = np.cumsum(good)
    ratio = test.ratio(met, np.arange(1, len(good) + 1) - met)
    decided = np.flatnonzero(np.abs(ratio) >= test.bound)
    if not len(decided):
        return "undecided", len(good)
    return "meets" if ratio[decided[0]] > 0 else "fails", int(decided[0]) + 1


class ExpectedRuns(NamedTuple):
    """What a sequential test of a share takes for a fleet with a known share."""

    share: float  # the true one
    runs: float  # mean number to the verdict
    undecided: float  # probability of no verdict after the greatest number of runs


def expected_runs(
    test: ShareTest | SureShare, shares: Sequence[float], most: int
) -> list[ExpectedRuns]:
    """Exact means over all sequences of at most `most` runs, for each true share."""
    p = np.array(shares)[:, None]
    misses = np.arange(most + 1)
    alive = np.zeros((len(shares), most + 1))  # probability by misses of no verdict so far
    alive[:, 0] = 1.0
    runs, width = np.zeros(len(shares)), 1
    for first in range(1, most + 1, RUNS_PER_FORECAST_STEP):
        n = np.arange(first, min(first + RUNS_PER_FORECAST_STEP, most + 1))[:, None]
        width = min(
            width + len(n), most + 1
        )  # no verdict has more misses than before and these runs
        missed = np.minimum(misses[:width], n)
        is_decided = np.abs(test.ratio(n - missed, missed)) >= test.bound
        for decided in is_decided:
            runs += alive.sum(axis=1)
            moved = alive[:, : width - 1] * (1 - p)
            alive[:, :width] *= p
            alive[:, 1:width] += moved
            alive[:, :width][:, decided] = 0.0
        width = 1 + int(np.flatnonzero(alive.any(axis=0)).max(initial=0))
    ends = alive.sum(axis=1)
    return [
        ExpectedRuns(*one) for one in zip(shares, map(float, runs), map(float, ends), strict=True)
    ]


def most_misses_tail(runs: int, misses: int, share: float) -> float:
    """The probability of at most this many misses if `share` of the runs meet the target."""
    return 1.0 if misses >= runs else incomplete_beta(share, runs - misses, misses + 1)


def fixed_runs(share: float, error: float, misses: int = 0) -> int:
    """The least fixed number of runs with so many misses that shows a share, with this error."""
    low, high = misses, misses + 1
    while most_misses_tail(high, misses, share) > error:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (
            (low, middle) if most_misses_tail(middle, misses, share) <= error else (middle, high)
        )
    return high


def bound_rank(runs: int, share: float, error: float) -> int:
    """The greatest k so that the k-th worst of independent runs is a bound for a share of all runs.

    With probability 1 - error at least `share` of all runs are as good as the k-th worst, or better:
    otherwise fewer than k of the runs were worse than a quantile that more than 1 - share are (order
    statistics; Wilks 1941). 0: these runs are too few for any bound.
    """
    rank = 0
    while rank < runs and most_misses_tail(runs, rank, share) <= error:
        rank += 1
    return rank


def share_test(share: float, zone: float, error: float) -> ShareTest:
    """The test of share - zone against share + zone. Raises ValueError outside 0..1."""
    if not (zone > 0 and share - zone > 0 and share + zone < 1):
        raise ValueError(
            f"share - zone and share + zone must lie between 0 and 1: {share:g} and {zone:g}"
        )
    if not 0 < error < 0.5:
        raise ValueError(f"an error must lie between 0 and 0.5, not {error:g}")
    return ShareTest(share - zone, share + zone, error)


def exact_share(met: int, runs: int, level: float = DEFAULT_CONFIDENCE) -> Interval:
    """The share `met` / `runs` for a fixed number of runs, with the interval of Clopper and Pearson.

    Raises ValueError for invalid numbers.
    """
    if not 0 <= met <= runs or runs < 1 or not 0 < level < 1:
        raise ValueError(f"{met} of {runs} runs at level {level} are not a share")
    missed, tail = runs - met, (1 - level) / 2
    low = high = share = met / runs
    if met:
        low = _edge(lambda p: incomplete_beta(p, met, missed + 1) > tail, share, 0.0)
    if missed:
        high = _edge(lambda p: incomplete_beta(1 - p, missed, met + 1) > tail, share, 1.0)
    return Interval(share, low, high, runs, "Clopper-Pearson", level)


def confidence_sequence(met: int, runs: int, level: float = DEFAULT_CONFIDENCE) -> Interval:
    """The share of runs that meet a target, with an interval that is valid at any stopping time."""
    if not 0 <= met <= runs:
        raise ValueError(f"{met} of {runs} runs are not a share")
    if runs == 0:
        return Interval(math.nan, 0.0, 1.0, 0, "confidence sequence", level)
    missed, best = runs - met, met / runs
    a, b = PRIOR
    mixture = _log_beta(a + met, b + missed) - _log_beta(a, b)
    least = mixture + math.log(1 - level)  # least value of log(p^s (1 - p)^f)

    def inside(p: float) -> bool:
        part = met * math.log(p) if met else 0.0
        return part + (missed * math.log1p(-p) if missed else 0.0) > least

    low = 0.0 if met == 0 else _edge(inside, best, 0.0)
    high = 1.0 if missed == 0 else _edge(inside, best, 1.0)
    return Interval(best, low, high, runs, "confidence sequence", level)


def _edge(inside: Callable[[float], bool], good: float, bad: float) -> float:
    """The point between `good` (inside) and `bad` (outside) at which `inside` becomes false."""
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        if middle in (good, bad):
            break
        good, bad = (middle, bad) if inside(middle) else (good, middle)
    return good


def _log_beta(a: float, b: float) -> float:
    return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)


# Sequential tests of means: is a mean below a bound, and which of several means is best?
#
# Both tests follow a sum of differences until it leaves a triangle (Kim & Nelson 2001, with c = 1):
#
#     R(r) = max(0, h2 S2 / (2 d) - d r / 2),  h2 = 2 eta (n0 - 1),  eta = ((2 e)^(-2 / (n0 - 1)) - 1) / 2
#
# after r observations. S2 is the variance of the first n0 observations, d the indifference zone, and e
# the error of one comparison. Observations are means of batches of runs, because runs of fleets are
# skewed and the procedures assume normal observations (on single runs the error was 11 % at a nominal
# 5 %; on batches of 10 it stays within 5 %).
#
# Feasibility (Andradottir & Kim 2010; Batur & Kim 2010): the sum of y - bound leaves the triangle at
# the bottom ("meets") or at the top ("fails"). A mean that is at least d away from the bound gets the
# wrong verdict with probability at most e.
#
# Selection (Kim & Nelson 2001): system i is eliminated when its sum exceeds that of some system l by R
# of their differences. The best one is kept with probability 1 - error if it is better than the others
# by d; e is error / (k - 1), which is also valid for runs with common seeds.


class Region(NamedTuple):
    """The triangular continuation region of a sum."""

    zone: float  # d, in the unit of the observations
    error: float  # e
    first: int = FIRST_STAGE_RUNS  # n0

    @property
    def h2(self) -> float:
        """The constant h^2 of Kim & Nelson."""
        power = -2 / (self.first - 1)
        return float((2 * self.error) ** power - 1) * (self.first - 1)

    def width(self, variance: float, r: int) -> float:
        """R(r), in the unit of the observations."""
        return max(0.0, self.h2 * variance / (2 * self.zone) - self.zone * r / 2)


def region(zone: float, error: float, first: int = FIRST_STAGE_RUNS) -> Region:
    """Create a checked region. Raises ValueError."""
    if zone <= 0 or not 0 < error < 0.5 or first < 2:
        raise ValueError(f"zone {zone:g}, error {error:g} or n0 = {first} is out of range")
    return Region(zone, error, first)


def batches(values: Sequence[float] | Values) -> Values:
    """Means of complete batches of runs in their order; the remaining runs are ignored."""
    x = checked(values, 0)
    whole = len(x) // RUNS_PER_BATCH
    means: Values = x[: whole * RUNS_PER_BATCH].reshape(whole, RUNS_PER_BATCH).mean(axis=1)
    return means


def feasible(means: Values, bound: float, limits: Region) -> tuple[Verdict, int]:
    """The verdict whether the mean lies below a bound, and the number of batches that decided it."""
    if len(means) < limits.first:
        return "undecided", len(means)
    variance = float(means[: limits.first].var(ddof=1))
    sums = np.cumsum(means - bound)
    for r in range(limits.first, len(means) + 1):
        width = limits.width(variance, r)
        if sums[r - 1] <= -width:  # includes a sum of 0 once the triangle has closed
            return "meets", r
        if sums[r - 1] >= width:
            return "fails", r
    return "undecided", len(means)


class Selected(NamedTuple):
    """The result of Kim & Nelson's procedure."""

    left: tuple[int, ...]  # remaining systems; if one, it is the best
    batches: int  # of each remaining system at the end


def select_least(systems: Sequence[Values], zone: float, error: float) -> Selected:
    """Select the system with the least mean from batch means. Raises ValueError.

    Remaining systems have equally many batches; eliminated systems may have fewer, but at least the
    number at their elimination.
    """
    k = len(systems)
    if k < 2:
        return Selected(tuple(range(k)), min((len(means) for means in systems), default=0))
    limits = region(zone, error / (k - 1))
    if any(len(means) < limits.first for means in systems):
        return Selected(tuple(range(k)), 0)
    variance = [
        [float((a[: limits.first] - b[: limits.first]).var(ddof=1)) for b in systems]
        for a in systems
    ]
    sums = [np.cumsum(means) for means in systems]
    left = list(range(k))
    r = limits.first
    while True:
        widths = {(i, j): limits.width(variance[i][j], r) for i in left for j in left}
        kept = [
            i
            for i in left
            if all(sums[i][r - 1] <= sums[j][r - 1] + widths[i, j] for j in left if j != i)
        ]
        left = kept or left[:1]
        if len(left) > 1 and all(widths[i, j] == 0 for i in left for j in left):
            left = [min(left, key=lambda i: float(sums[i][r - 1]))]
        if len(left) == 1 or r >= min(len(systems[i]) for i in left):
            return Selected(tuple(left), r)
        r += 1
