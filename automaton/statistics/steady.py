"""Steady state: where the warm-up ends, and intervals for what goes on for ever.

MSER-5 (White 1997; White, Cobb & Spratt 2000): the series, averaged over replications and in
batches of 5, is cut at the d that makes

    sum over j > d of (Y_j - mean of those)^2 / (m - d)^2

least: the standard error of what is left. A minimum in the second half tells of a series that is
not stationary, or too short, and is refused.

Replication-deletion: each replication gives the mean of what it did after the cut; R >= 20.
Batch means: one long series in 10 to 30 batches, the most whose means pass von Neumann's test of
independence (1941): q = sum (Y_j+1 - Y_j)^2 / sum (Y_j - mean)^2 is near 2, with variance
4 (m - 2) / (m^2 - 1). (100 batches hold the truth in 92.3 % of cases instead of 95.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.statistics.intervals import (
    LEVEL,
    Interval,
    Values,
    checked,
    constant,
    mean_interval,
)
from automaton.statistics.student import normal_quantile, student

GROUP: Final = 5  # the 5 of MSER-5
FEWEST_REPLICATIONS: Final = 5  # for MSER-5
ENOUGH_REPLICATIONS: Final = 20  # for replication-deletion
MOST_BATCHES, FEWEST_BATCHES = 30, 10
INDEPENDENCE_LEVEL: Final = 0.1  # of von Neumann's test, two-sided


class Refused(ValueError):
    """Why no steady-state figure is given, as one sentence."""


class WarmUp(NamedTuple):
    """Where a warm-up ends."""

    cut: int  # observations to leave out at the beginning of each replication
    of: int  # observations of each replication
    replications: int


def mser5(series: Sequence[Sequence[float]] | npt.NDArray[np.float64]) -> WarmUp:
    """The warm-up of (replications, observations); raises Refused if it cannot be found."""
    y = np.asarray(series, np.float64)
    if y.ndim != 2 or y.shape[0] < FEWEST_REPLICATIONS:
        found = y.shape[0] if y.ndim == 2 else 1
        raise Refused(f"MSER-5 needs {FEWEST_REPLICATIONS} replications, there are {found}")
    groups = y.shape[1] // GROUP
    if groups < 10:
        raise Refused(f"MSER-5 needs {10 * GROUP} observations, there are {y.shape[1]}")
    averaged = y.mean(axis=0)[: groups * GROUP].reshape(groups, GROUP).mean(axis=1)
    cut = _least_error(averaged)
    if cut > groups // 2:
        raise Refused(
            f"not stationary or too short: MSER-5 would leave out {cut * GROUP:,} of "
            f"{y.shape[1]:,} observations"
        )
    return WarmUp(cut * GROUP, y.shape[1], y.shape[0])


def _least_error(y: Values) -> int:
    """The cut d with the least error of the mean of y[d:]; at least 5 are left."""
    m = len(y)
    left = m - np.arange(m - 4)
    sums = np.cumsum(y[::-1])[::-1][: m - 4]
    squares = np.cumsum(((y - y.mean()) ** 2)[::-1])[::-1][: m - 4]
    shift = sums / left - y.mean()
    error = np.maximum(squares - left * shift**2, 0.0) / left**2
    return int(np.argmin(error))


def replication_deletion(
    series: Sequence[Sequence[float]] | npt.NDArray[np.float64], cut: int, level: float = LEVEL
) -> Interval:
    """The steady-state mean from what each replication did after the cut. Raises Refused."""
    y = np.asarray(series, np.float64)
    if y.ndim != 2 or y.shape[0] < ENOUGH_REPLICATIONS:
        found = y.shape[0] if y.ndim == 2 else 1
        raise Refused(
            f"replication-deletion needs {ENOUGH_REPLICATIONS} replications, there are {found}"
        )
    if not 0 <= cut < y.shape[1]:
        raise Refused(f"a cut at {cut} leaves nothing of {y.shape[1]} observations")
    found_interval = mean_interval(y[:, cut:].mean(axis=1), level)
    return found_interval._replace(method=f"replication-deletion, {found_interval.method}")


def batch_means(series: Sequence[float] | Values, level: float = LEVEL) -> Interval:
    """The steady-state mean of one long series, its warm-up already cut off. Raises Refused."""
    y = checked(series)
    if len(y) < MOST_BATCHES * GROUP:
        raise Refused(f"batch means need {MOST_BATCHES * GROUP} observations, there are {len(y)}")
    for many in range(MOST_BATCHES, FEWEST_BATCHES - 1, -1):
        size = len(y) // many
        means = y[len(y) - many * size :].reshape(many, size).mean(axis=1)
        if independent(means):
            mean = float(means.mean())
            half = student(many - 1, level) * float(means.std(ddof=1)) / math.sqrt(many)
            return Interval(mean, mean - half, mean + half, many, f"{many} batch means", level)
    raise Refused(
        f"the means of {FEWEST_BATCHES} batches still depend on each other "
        "(von Neumann's test): the series is too short"
    )


def von_neumann(values: Sequence[float] | Values) -> float:
    """The ratio q of successive differences: near 2 for independent values, below if they persist."""
    x = checked(values, 3)
    if constant(x):
        return 2.0
    return float((np.diff(x) ** 2).sum() / ((x - x.mean()) ** 2).sum())


def independent(values: Sequence[float] | Values, error: float = INDEPENDENCE_LEVEL) -> bool:
    """Whether von Neumann's test finds no dependence between successive values."""
    m = len(values)
    deviation = math.sqrt(4 * (m - 2) / (m * m - 1))
    return abs(von_neumann(values) - 2) <= normal_quantile(1 - error / 2) * deviation
