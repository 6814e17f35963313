"""Means compared sequentially: is one below a bound, and which of several is the best?

Both watch a sum of differences until it leaves a triangle (Kim & Nelson 2001, with c = 1):

    R(r) = max(0, h2 S2 / (2 d) - d r / 2),   h2 = 2 eta (n0 - 1),
    eta = ((2 e)^(-2 / (n0 - 1)) - 1) / 2

after r observations; S2 is the variance of the first n0, d the indifference zone, e the error of
one comparison. Observations are means of batches of runs: runs of fleets are skewed, and the
procedures assume normal ones (on single runs they erred in 11 % at 5 %; on batches of 10 it holds).

Feasibility (Andradottir & Kim 2010; Batur & Kim 2010): the sum of y - bound leaves the triangle
below, "meets", or above, "fails". A mean d or more on one side is put on the other with probability
e at most.

Selection (Kim & Nelson 2001): i drops out when its sum exceeds that of some l by R of their
differences. The best is kept with probability 1 - error if it is better than the others by d; e is
error / (k - 1), which holds also for runs with common seeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from automaton.studies.inference.intervals import Values, checked
from automaton.studies.inference.proportions import Verdict

RUNS_PER_BATCH: Final = 10  # runs
FIRST_STAGE_RUNS: Final = 20  # batches before anything is decided: n0


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
