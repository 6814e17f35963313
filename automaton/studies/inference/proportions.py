"""Shares of runs, and sequential tests of shares and means: those of a search that stops when it knows.

Clopper & Pearson (1934), of s of n runs, n fixed beforehand: with I the incomplete beta function and
e = 1 - level, from the p with I_p(s, n - s + 1) = e / 2 to the p with I_p(s + 1, n - s) = 1 - e / 2.
Of none of n runs it reaches up to 1 - (e / 2)^(1 / n), about 3.7 / n.

Wald (1945): after s runs that meet the target and f that do not,

    L = s log(p1 / p0) + f log((1 - p1) / (1 - p0)),   p0 = share - zone, p1 = share + zone

the share is large enough as soon as L >= log((1 - e) / e), too small as soon as L <= -that.
A share of p0 or less passes with probability e / (1 - e) at most, one of p1 or more fails so: 5.3 % for
e = 0.05. Both together have 2 e at most.

Confidence sequence, from the beta mixture of all alternatives (Robbins 1970; the beta-binomial
boundary of Howard, Ramdas, McAuliffe & Sekhon 2021): all p with

    B(a + s, b + f) / B(a, b) / (p^s (1 - p)^f) < 1 / (1 - level)

hold at all numbers of runs at once, so that it does not matter when one stops.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Final, Literal, NamedTuple

import numpy as np

from automaton.studies.inference.intervals import (
    DEFAULT_CONFIDENCE,
    Interval,
    Values,
    checked,
    incomplete_beta,
)

Verdict = Literal["meets", "fails", "undecided"]

PRIOR: Final = (0.5, 0.5)  # a and b
HALVINGS: Final = 60
RUNS_PER_BATCH: Final = 10  # runs
FIRST_STAGE_RUNS: Final = 20  # batches before anything is decided: n0


class ShareTest(NamedTuple):
    """Wald's test of a share between two hypotheses."""

    low: float  # p0
    high: float  # p1
    error: float  # of both kinds

    @property
    def bound(self) -> float:
        """What the logarithm of the likelihood ratio must reach."""
        return math.log((1 - self.error) / self.error)

    @property
    def fewest(self) -> int:
        """Runs after which it can pass at the earliest: if all meet the target."""
        return math.ceil(self.bound / math.log(self.high / self.low) - 1e-9)

    def ratio(self, met: int, missed: int) -> float:
        """The logarithm of the likelihood ratio of high against low."""
        gain = math.log(self.high / self.low)
        loss = math.log((1 - self.high) / (1 - self.low))
        return met * gain + missed * loss

    def verdict(self, outcomes: Iterable[bool]) -> tuple[Verdict, int]:
        """The verdict on runs in their order, and after how many of them it fell."""
        met = missed = 0
        for good in outcomes:
            met, missed = met + good, missed + (not good)
            ratio = self.ratio(met, missed)
            if ratio >= self.bound:
                return "meets", met + missed
            if ratio <= -self.bound:
                return "fails", met + missed
        return "undecided", met + missed


def share_test(share: float, zone: float, error: float) -> ShareTest:
    """The test of share - zone against share + zone. Raises ValueError beyond 0..1."""
    if not (zone > 0 and share - zone > 0 and share + zone < 1):
        raise ValueError(
            f"share - zone and share + zone must lie between 0 and 1: {share:g} and {zone:g}"
        )
    if not 0 < error < 0.5:
        raise ValueError(f"an error lies between 0 and 0.5, not {error:g}")
    return ShareTest(share - zone, share + zone, error)


def exact_share(met: int, runs: int, level: float = DEFAULT_CONFIDENCE) -> Interval:
    """The share of a fixed number of runs in which something happens, by Clopper and Pearson.

    Raises ValueError for what is not a share.
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
    """The share of runs that meet a target, valid whenever one stops; without unit."""
    if not 0 <= met <= runs:
        raise ValueError(f"{met} of {runs} runs are not a share")
    if runs == 0:
        return Interval(math.nan, 0.0, 1.0, 0, "confidence sequence", level)
    missed, best = runs - met, met / runs
    a, b = PRIOR
    mixture = _log_beta(a + met, b + missed) - _log_beta(a, b)
    least = mixture + math.log(1 - level)  # of the logarithm of p^s (1 - p)^f

    def inside(p: float) -> bool:
        part = met * math.log(p) if met else 0.0
        return part + (missed * math.log1p(-p) if missed else 0.0) > least

    low = 0.0 if met == 0 else _edge(inside, best, 0.0)
    high = 1.0 if missed == 0 else _edge(inside, best, 1.0)
    return Interval(best, low, high, runs, "confidence sequence", level)


def _edge(inside: Callable[[float], bool], good: float, bad: float) -> float:
    """Where `inside` ends between a point within and one without."""
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        if middle in (good, bad):
            break
        good, bad = (middle, bad) if inside(middle) else (good, middle)
    return good


def _log_beta(a: float, b: float) -> float:
    return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)


# Means compared sequentially: is one below a bound, and which of several is the best?
#
# Both watch a sum of differences until it leaves a triangle (Kim & Nelson 2001, with c = 1):
#
#     R(r) = max(0, h2 S2 / (2 d) - d r / 2),  h2 = 2 eta (n0 - 1),  eta = ((2 e)^(-2 / (n0 - 1)) - 1) / 2
#
# after r observations; S2 is the variance of the first n0, d the indifference zone, e the error of
# one comparison. Observations are means of batches of runs: runs of fleets are skewed, and the
# procedures assume normal ones (on single runs they erred in 11 % at 5 %; on batches of 10 it holds).
#
# Feasibility (Andradottir & Kim 2010; Batur & Kim 2010): the sum of y - bound leaves the triangle
# below, "meets", or above, "fails". A mean d or more on one side is put on the other with probability
# e at most.
#
# Selection (Kim & Nelson 2001): i drops out when its sum exceeds that of some l by R of their
# differences. The best is kept with probability 1 - error if it is better than the others by d; e is
# error / (k - 1), which holds also for runs with common seeds.


class Region(NamedTuple):
    """The triangle that a sum must leave."""

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
    """A checked region. Raises ValueError."""
    if zone <= 0 or not 0 < error < 0.5 or first < 2:
        raise ValueError(f"zone {zone:g}, error {error:g} or n0 = {first} is out of range")
    return Region(zone, error, first)


def batches(values: Sequence[float] | Values) -> Values:
    """Means of whole batches of runs in their order; what is left over waits for more."""
    x = checked(values, 0)
    whole = len(x) // RUNS_PER_BATCH
    means: Values = x[: whole * RUNS_PER_BATCH].reshape(whole, RUNS_PER_BATCH).mean(axis=1)
    return means


def feasible(means: Values, bound: float, limits: Region) -> tuple[Verdict, int]:
    """Whether the mean lies below a bound, and after how many batches that is known."""
    if len(means) < limits.first:
        return "undecided", len(means)
    variance = float(means[: limits.first].var(ddof=1))
    sums = np.cumsum(means - bound)
    for r in range(limits.first, len(means) + 1):
        width = limits.width(variance, r)
        if sums[r - 1] <= -width:  # at the very bound, too, once the triangle has closed
            return "meets", r
        if sums[r - 1] >= width:
            return "fails", r
    return "undecided", len(means)


class Selected(NamedTuple):
    """What Kim & Nelson's procedure has come to."""

    left: tuple[int, ...]  # systems still in; one: the best
    batches: int  # of each system when it ended


def select_least(systems: Sequence[Values], zone: float, error: float) -> Selected:
    """The system with the least mean, from batch means of equal number. Raises ValueError.

    Those that have dropped out may be given with as many batches as they had then, or more.
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
