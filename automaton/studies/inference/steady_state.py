"""Steady state: where the warm-up ends, and intervals for what goes on for ever.

MSER-5 (White 1997; White, Cobb & Spratt 2000): the series, averaged over replications and in
batches of 5, is cut at the d that makes

    sum over j > d of (Y_j - mean of those)^2 / (m - d)^2

least: the standard error of what is left. A minimum in the second half tells of a series that is
not stationary, or too short, and is refused.

Replication-deletion: each replication gives the mean of what it did after the cut; R >= 20.
Batch means: fewer replications, or one long series, in 10 batches or a few more. It is refused unless
each is as long as 8 times over which observations depend on each other, by single ones and by means of
more and more of them, and unless the means of 30 shorter batches pass von Neumann's test of
independence (1941): q = sum (Y_j+1 - Y_j)^2 / sum (Y_j - mean)^2 is near 2, with variance 4 (m - 2) /
(m^2 - 1). One of both is not enough: of AR(1) series with r = 0.98 and 1,000 observations the first of
30, 29, ..., 10 batches that passed held the truth in 79 %, and of the 3 % whose 30 pass 60 % do.

Deliveries in windows are a slow series under noise, which lag 1 alone does not show. Of 3,000
observations with 5 % of the variance from an AR(1) series with r = 0.995, and of 5 x 1,000 with 10 %
and r = 0.99 or 0.995, 97 % or more are refused. What 1,000 observations cannot show is a slow part that
happens to stay where it is: of such single series 80 to 97 % are refused, but intervals of the others
hold the truth in 46 to 75 %; 1 to 8 % of all series mislead (tests/helpers/statistics_trials.py batches).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.studies.inference.intervals import (
    DEFAULT_CONFIDENCE,
    Interval,
    Values,
    checked,
    constant,
    mean_interval,
    normal_quantile,
    student,
)

MSER_BATCH: Final = 5  # the 5 of MSER-5
MIN_REPLICATIONS: Final = 5  # for MSER-5
MIN_OBSERVATIONS: Final = 10 * MSER_BATCH  # likewise, of each
ENOUGH_REPLICATIONS: Final = 20  # for replication-deletion
MAX_BATCHES, MIN_BATCHES = 30, 10
# times over which observations depend on each other, that a batch must last
MIN_CORRELATION_TIMES: Final = 8
INDEPENDENCE_LEVEL: Final = 0.1  # of von Neumann's test, two-sided


class NotSteadyError(ValueError):
    """Why no steady-state figure is given, as one sentence."""


class WarmUp(NamedTuple):
    """Where a warm-up ends."""

    cut: int  # observations to leave out at the beginning of each replication
    of: int  # observations of each replication
    replications: int


def mser5(series: Sequence[Sequence[float]] | npt.NDArray[np.float64]) -> WarmUp:
    """The warm-up of (replications, observations); raises NotSteadyError if it cannot be found."""
    y = np.asarray(series, np.float64)
    if y.ndim != 2 or y.shape[0] < MIN_REPLICATIONS:
        found = y.shape[0] if y.ndim == 2 else 1
        raise NotSteadyError(f"MSER-5 needs {MIN_REPLICATIONS} replications, there are {found}")
    if y.shape[1] < MIN_OBSERVATIONS:
        raise NotSteadyError(
            f"MSER-5 needs {MIN_OBSERVATIONS} observations, there are {y.shape[1]}"
        )
    groups = y.shape[1] // MSER_BATCH
    averaged = y.mean(axis=0)[: groups * MSER_BATCH].reshape(groups, MSER_BATCH).mean(axis=1)
    cut = _least_error(averaged)
    if cut > groups // 2:
        raise NotSteadyError(_too_late(cut * MSER_BATCH, y.shape[1], "observations"))
    return WarmUp(cut * MSER_BATCH, y.shape[1], y.shape[0])


def mser5_of_means(means: Values) -> int:
    """How many to leave out of what is averaged over replications and groups already.

    Those that nothing tells of are NaN, and are passed over. Raises NotSteadyError.
    """
    known = np.flatnonzero(~np.isnan(means))
    fewest = MIN_OBSERVATIONS // MSER_BATCH
    if len(known) < fewest:
        raise NotSteadyError(
            f"MSER-5 needs {fewest} stretches that tell of it, there are {len(known)}"
        )
    cut = _least_error(means[known])
    if cut > len(known) // 2:
        raise NotSteadyError(_too_late(cut, len(known), "stretches of time"))
    return int(known[cut]) if cut else 0


def _too_late(cut: int, of: int, what: str) -> str:
    return f"not stationary or too short: MSER-5 would discard {cut:,} of {of:,} {what}"


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
    series: Sequence[Sequence[float]] | npt.NDArray[np.float64],
    cut: int,
    level: float = DEFAULT_CONFIDENCE,
) -> Interval:
    """The steady-state mean from what each replication did after the cut. Raises NotSteadyError."""
    y = np.asarray(series, np.float64)
    if y.ndim != 2 or y.shape[0] < ENOUGH_REPLICATIONS:
        found = y.shape[0] if y.ndim == 2 else 1
        raise NotSteadyError(
            f"replication-deletion needs {ENOUGH_REPLICATIONS} replications, there are {found}"
        )
    if not 0 <= cut < y.shape[1]:
        raise NotSteadyError(f"a cut at {cut} leaves nothing of {y.shape[1]} observations")
    found_interval = mean_interval(y[:, cut:].mean(axis=1), level)
    return found_interval._replace(method=f"replication-deletion, {found_interval.method}")


def batch_means(
    series: Sequence[float] | Sequence[Sequence[float]] | npt.NDArray[np.float64],
    level: float = DEFAULT_CONFIDENCE,
) -> Interval:
    """The steady-state mean of one long series or of a few, their warm-up already cut off.

    Several are (replications, observations), each cut into as many batches. Raises NotSteadyError.
    """
    y = np.atleast_2d(np.asarray(series, np.float64))
    checked(y.reshape(-1))
    replications, n = y.shape
    if y.size < MAX_BATCHES * MSER_BATCH:
        raise NotSteadyError(
            f"batch means need {MAX_BATCHES * MSER_BATCH} observations, there are {y.size}"
        )
    many = -(-MIN_BATCHES // replications)
    time = correlation_time(y, n // many * MIN_BATCHES // MAX_BATCHES)
    if n // many < MIN_CORRELATION_TIMES * time:
        needed = math.ceil(MIN_CORRELATION_TIMES * time) * many
        raise NotSteadyError(
            f"too short: its {n:,} observations depend on each other over about {time:,.0f}; "
            f"{needed:,} are needed"
        )
    finer = MAX_BATCHES // replications
    if finer > 1 and not independent(batched(y, finer)):
        raise NotSteadyError(
            f"too short: the means of {finer * replications} batches still depend on each other "
            "(von Neumann's test)"
        )
    means = batched(y, many)
    mean, of = float(means.mean()), f" of {replications} runs" if replications > 1 else ""
    half = student(len(means) - 1, level) * float(means.std(ddof=1)) / math.sqrt(len(means))
    method = f"{len(means)} batch means{of}"
    return Interval(mean, mean - half, mean + half, len(means), method, level)


def batched(y: npt.NDArray[np.float64], many: int) -> Values:
    """The means of so many batches of each row, one row after the other."""
    size = y.shape[1] // many
    last: Values = y[:, y.shape[1] - many * size :].reshape(-1, size).mean(axis=1)
    return last


def correlation_time(y: npt.NDArray[np.float64], longest: int = 1) -> float:
    """Over how many observations a row depends on itself: (1 + r) / (1 - r), with r at lag 1.

    So many observations of an AR(1) series tell as much of its mean as an independent one. Noise on
    top of a slow series hides it at lag 1, but not from means of b = 2, 4, 8, ... up to `longest`
    observations: where successive ones correlate, they tell b / 2 (1 + r) / (1 - r). Of an AR(1)
    series alone that is what lag 1 tells, until b is longer than that.
    """
    r, _ = succession(y)
    time, size = (1 + r) / (1 - r) if r > 0 else 1.0, 2
    while size <= longest:
        r, chance = succession(y[:, y.shape[1] % size :].reshape(len(y), -1, size).mean(axis=2))
        if r > chance:
            time = max(time, size / 2 * (1 + r) / (1 - r))
        size *= 2
    return time


def succession(y: npt.NDArray[np.float64]) -> tuple[float, float]:
    """The correlation of successive values in rows, about the mean of all of them.

    Beside it stands what independent values exceed in 5 %.
    """
    apart = y - y.mean()
    spread = float((apart**2).sum())
    r = float((apart[:, 1:] * apart[:, :-1]).sum()) / spread if spread > 0 else 0.0
    pairs = y.shape[0] * (y.shape[1] - 1)
    return r, normal_quantile(0.95) * math.sqrt(pairs) / y.size


def von_neumann(values: Sequence[float] | Values) -> float:
    """The ratio q of successive differences: near 2 for independent values, below if they persist."""
    x = checked(values, 3)
    if constant(x):
        return 2.0
    return float((np.diff(x) ** 2).sum() / ((x - x.mean()) ** 2).sum())


def independent(values: Sequence[float] | Values) -> bool:
    """Whether von Neumann's test finds no dependence between successive values."""
    m = len(values)
    deviation = math.sqrt(4 * (m - 2) / (m * m - 1))
    return abs(von_neumann(values) - 2) <= normal_quantile(1 - INDEPENDENCE_LEVEL / 2) * deviation
