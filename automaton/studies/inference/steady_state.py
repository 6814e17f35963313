"""Steady state: the end of the warm-up, and confidence intervals for steady-state means.

MSER-5 (White 1997; White, Cobb & Spratt 2000): the series is averaged over replications and in batches
of 5, and cut at the d that minimizes the standard error of the rest,

    sum over j > d of (Y_j - mean of those)^2 / (m - d)^2

A minimum in the second half means that the series is not stationary or too short; it is rejected.

Replication-deletion (20 or more replications): each replication contributes its mean after the cut.

Batch means (fewer replications, or one long series): about 10 batches, whose means have Student's
interval, widened by the correlation time tau of the N observations:

    half-width = t(batches - 1) s / sqrt(batches) (1 + (60 tau / N)^1.5)

Short batches hide variance, and a short series of a queue has not seen its long busy periods. Refusing
such series makes it worse, since those pass that misjudge themselves (after a test of independence, 83 %
of the intervals of M/M/1 with 5,000 customers held). So only series below 8 tau are refused. 60 and 1.5
come from trials, in which 93 % of intervals hold (`tests/helpers/statistics_trials.py batches`).
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
    mean_interval,
    normal_quantile,
    student,
)

MSER_BATCH: Final = 5  # the 5 of MSER-5
MIN_REPLICATIONS: Final = 5  # for MSER-5
MIN_OBSERVATIONS: Final = 10 * MSER_BATCH  # of each replication, for MSER-5
ENOUGH_REPLICATIONS: Final = 20  # for replication-deletion
MIN_BATCHES: Final = 10
LONGEST_MEANS: Final = 3  # of a batch, for the correlation time
MIN_OBSERVATIONS_OF_BATCHES: Final = 150
MIN_CORRELATION_TIMES: Final = 8  # least length of all series together
WIDENING, WIDENING_POWER = 60.0, 1.5  # by the correlation time


class NotSteadyError(ValueError):
    """No steady-state estimate is possible; the message gives the reason in one sentence."""


class WarmUp(NamedTuple):
    """The end of a warm-up."""

    cut: int  # observations to discard at the beginning of each replication
    of: int  # observations of each replication
    replications: int


def mser5(series: Sequence[Sequence[float]] | npt.NDArray[np.float64]) -> WarmUp:
    """Find the warm-up of a series (replications, observations). Raises NotSteadyError."""
    y = np.asarray(series, np.float64)
    if y.ndim != 2 or y.shape[0] < MIN_REPLICATIONS:
        found = y.shape[0] if y.ndim == 2 else 1
        raise NotSteadyError(f"MSER-5 needs {MIN_REPLICATIONS} replications, not {found}")
    if y.shape[1] < MIN_OBSERVATIONS:
        raise NotSteadyError(f"MSER-5 needs {MIN_OBSERVATIONS} observations, not {y.shape[1]}")
    groups = y.shape[1] // MSER_BATCH
    averaged = y.mean(axis=0)[: groups * MSER_BATCH].reshape(groups, MSER_BATCH).mean(axis=1)
    cut = _least_error(averaged)
    if cut > groups // 2:
        raise NotSteadyError(_too_late(cut * MSER_BATCH, y.shape[1], "observations"))
    return WarmUp(cut * MSER_BATCH, y.shape[1], y.shape[0])


def mser5_of_means(means: Values) -> int:
    """Number of means to discard from a series already averaged over replications and groups.

    Means without data are NaN and are ignored. Raises NotSteadyError.
    """
    known = np.flatnonzero(~np.isnan(means))
    fewest = MIN_OBSERVATIONS // MSER_BATCH
    if len(known) < fewest:
        raise NotSteadyError(f"MSER-5 needs {fewest} stretches of time with data, not {len(known)}")
    cut = _least_error(means[known])
    if cut > len(known) // 2:
        raise NotSteadyError(_too_late(cut, len(known), "stretches of time"))
    return int(known[cut]) if cut else 0


def _too_late(cut: int, of: int, what: str) -> str:
    return f"not stationary or too short: MSER-5 would discard {cut:,} of {of:,} {what}"


def _least_error(y: Values) -> int:
    """The cut d with the least standard error of the mean of y[d:]; at least 5 values remain."""
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
    """The steady-state mean from the means of replications after the cut. Raises NotSteadyError."""
    y = np.asarray(series, np.float64)
    if y.ndim != 2 or y.shape[0] < ENOUGH_REPLICATIONS:
        found = y.shape[0] if y.ndim == 2 else 1
        raise NotSteadyError(
            f"replication-deletion needs {ENOUGH_REPLICATIONS} replications, not {found}"
        )
    if not 0 <= cut < y.shape[1]:
        raise NotSteadyError(f"a cut at {cut} leaves nothing of {y.shape[1]} observations")
    found_interval = mean_interval(y[:, cut:].mean(axis=1), level)
    return found_interval._replace(method=f"replication-deletion, {found_interval.method}")


def batch_means(
    series: Sequence[float] | Sequence[Sequence[float]] | npt.NDArray[np.float64],
    level: float = DEFAULT_CONFIDENCE,
) -> Interval:
    """The steady-state mean of one long series or of several, without their warm-up.

    Several series are (replications, observations), each divided into equally many batches. Raises
    NotSteadyError.
    """
    y = np.atleast_2d(np.asarray(series, np.float64))
    checked(y.reshape(-1))
    replications, n = y.shape
    if y.size < MIN_OBSERVATIONS_OF_BATCHES:
        raise NotSteadyError(
            f"batch means need {MIN_OBSERVATIONS_OF_BATCHES} observations, not {y.size}"
        )
    many = -(-MIN_BATCHES // replications)
    time = correlation_time(y, n // many // LONGEST_MEANS)
    if y.size < MIN_CORRELATION_TIMES * time:
        needed = math.ceil(MIN_CORRELATION_TIMES * time / replications)
        raise NotSteadyError(
            f"too short for an interval: a correlation time of about {time:,.0f} observations needs "
            f"{needed:,} observations, not {n:,}"
        )
    means = batched(y, many)
    mean, of = float(means.mean()), f" of {replications} runs" if replications > 1 else ""
    half = student(len(means) - 1, level) * float(means.std(ddof=1)) / math.sqrt(len(means))
    half *= 1 + (WIDENING * time / y.size) ** WIDENING_POWER
    method = f"{len(means)} batch means{of}"
    return Interval(mean, mean - half, mean + half, len(means), method, level)


def batched(y: npt.NDArray[np.float64], many: int) -> Values:
    """The means of `many` batches of each row, row by row."""
    size = y.shape[1] // many
    last: Values = y[:, y.shape[1] - many * size :].reshape(-1, size).mean(axis=1)
    return last


def correlation_time(y: npt.NDArray[np.float64], longest: int = 1) -> float:
    """The correlation time of rows in observations: (1 + r) / (1 - r), with r at lag 1.

    For an AR(1) series, this number of observations has as much information on the mean as one
    independent observation. Noise can hide a slow series at lag 1, but not in means of b = 2, 4, 8, ...
    up to `longest` observations: if successive means correlate, they give b / 2 (1 + r) / (1 - r). For
    a pure AR(1) series this equals the value at lag 1 until b exceeds the correlation time.
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
    """The correlation of successive values in rows, about the mean of all values.

    The second result is the correlation that independent values exceed with probability 5 %.
    """
    apart = y - y.mean()
    spread = float((apart**2).sum())
    r = float((apart[:, 1:] * apart[:, :-1]).sum()) / spread if spread > 0 else 0.0
    pairs = y.shape[0] * (y.shape[1] - 1)
    return r, normal_quantile(0.95) * math.sqrt(pairs) / y.size
