"""Shares of runs: an exact interval, a sequential test, an interval that stopping does not spoil.

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
from collections.abc import Callable, Iterable
from typing import Final, Literal, NamedTuple

from automaton.studies.inference.intervals import DEFAULT_CONFIDENCE, Interval
from automaton.studies.inference.t_distribution import incomplete_beta

Verdict = Literal["meets", "fails", "undecided"]

PRIOR: Final = (0.5, 0.5)  # a and b
HALVINGS: Final = 60


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
