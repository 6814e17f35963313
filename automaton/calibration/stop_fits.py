"""Stretches where robots are slow, delays, breakdowns and repairs.

A delay is time that a robot needs beyond its path at the usual speed, without an operation, a turn or
another robot ahead. A stretch is slow if the interval of its speeds lies below the usual speed by more
than a share. Both thresholds are guesses, so they are parameters.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.duration_fits import Censored
from automaton.calibration.log_on_floor import RobotTracks
from automaton.calibration.motion_fits import (
    LEVEL,
    FittedValue,
    drives_of,
    median_fit,
)
from automaton.calibration.state_log import MAX_GAP_MS
from automaton.floor.floor_plan import NIL

Array = np.ndarray[Any, Any]

MIN_SLOW_PAIRS: Final = 30
SLOW_SHARE: Final = 0.05  # below the usual speed
SHORTEST_DELAY_S: Final = 1.0
ERRORS: Final = 3  # standard deviations of the stamps that a delay must exceed
NEAR_MIDDLE: Final = (
    0.25  # cells; a pair counts for an edge if its middle is as near to that of the edge
)


class SlowStretch(NamedTuple):
    """Cells in a row or a column between which robots are slow."""

    first: tuple[int, int]  # x, y
    last: tuple[int, int]
    share: FittedValue  # of the usual speed
    speed: FittedValue  # m/s of the fastest robots there


def slow_stretches(
    track: RobotTracks, usual: Array, metres: float, slow_share: float = SLOW_SHARE
) -> list[SlowStretch]:
    """The slow stretches; `usual`: (n,) usual speed at each message, in cells per second."""
    chosen = np.flatnonzero(track.free & (usual > 0))
    step = track.step[:, chosen]
    way = abs(step)
    speed = way.sum(axis=0) / track.elapsed[chosen]
    share = speed / usual[chosen]
    middle = track.place[:, chosen] + step / 2
    out: list[SlowStretch] = []
    for axis, along in enumerate((way[0] >= way[1], way[1] > way[0])):
        place, line = middle[axis], np.round(middle[1 - axis]).astype(np.int64)
        edge = np.floor(place).astype(np.int64)
        near = along & (abs(place - edge - 0.5) <= NEAR_MIDDLE)
        for row, first, last in _slow_runs(line[near], edge[near], share[near], slow_share):
            inside = along & (line == row) & (place - way[axis] / 2 >= first)
            inside &= place + way[axis] / 2 <= last
            if inside.sum() < MIN_SLOW_PAIRS:
                inside = near & (line == row) & (edge >= first) & (edge < last)
            corners = [(first, row), (last, row)] if axis == 0 else [(row, first), (row, last)]
            limit = _fastest(speed[inside], usual[chosen][inside]).scaled(metres)
            out.append(SlowStretch(corners[0], corners[1], median_fit(share[inside]), limit))
    return sorted(out, key=lambda one: one.share.value)


def _fastest(speed: Array, usual: Array) -> FittedValue:
    """The speed of the robots that a limit slows down, not of those that are slower anyway."""
    fits = [median_fit(speed[usual == one]) for one in np.unique(usual)]
    return max((fit for fit in fits if fit.n >= len(speed) / 10), key=lambda fit: fit.value)


def _slow_runs(
    line: Array, edge: Array, share: Array, slow_share: float
) -> list[tuple[int, int, int]]:
    """(line, first cell, last cell) of runs of slow edges in lines."""
    if not len(share):
        return []
    order = np.lexsort((edge, line))
    line, edge, share = line[order], edge[order], share[order]
    first = np.flatnonzero(np.append(True, (np.diff(line) != 0) | (np.diff(edge) != 0)))
    groups = np.split(share, first[1:])
    slow: dict[tuple[int, int], Array] = {}
    level = 1 - (1 - LEVEL) / len(groups)  # of one interval, so that all hold together
    for begin, values in zip(first.tolist(), groups, strict=True):
        if len(values) >= MIN_SLOW_PAIRS and median_fit(values, level).high < 1 - slow_share:
            slow[int(line[begin]), int(edge[begin])] = values
    runs: list[list[tuple[int, int]]] = []
    for key in sorted(slow):
        if runs and runs[-1][-1] == (key[0], key[1] - 1):
            runs[-1].append(key)
        else:
            runs.append([key])
    out = []
    for run in runs:
        # Pairs reach into the edges beside a slow stretch and make these look slower than they are.
        middles = [float(np.median(slow[key])) for key in run]
        core = [key for key, one in zip(run, middles, strict=True) if one < (1 + min(middles)) / 2]
        out.append((run[0][0], core[0][1], core[-1][1] + 1))
    return out


class DelayFit(NamedTuple):
    """Delays of robots in motion."""

    rate: FittedValue  # per second
    lengths: Array  # (k,) seconds
    length: FittedValue | None  # mean


def fit_delays(
    track: RobotTracks, order: Array, usual: Array, error: float, shortest: float
) -> DelayFit:
    """The delays above `shortest` seconds; `order`: (n,) above 0 with one, `error`: of a duration."""
    drives = drives_of(track, usual, track.acts | track.near | (order == 0))
    free = drives.free & (drives.turns == 0)
    threshold = max(shortest / 2, ERRORS * error)
    is_late = free & (drives.late > threshold)
    # Errors of stamps cancel between neighbours, so a delay includes the pairs beside it.
    wide = is_late | (free & (np.roll(is_late, 1) | np.roll(is_late, -1)))
    number = np.cumsum(wide & ~np.roll(wide, 1))[wide] - 1
    lengths = np.bincount(number, drives.late[wide]) if len(number) else np.zeros(0)
    lengths = lengths[lengths >= shortest]
    exposure = float(drives.seconds[free].sum() - lengths.sum())
    length = None
    if len(lengths) > 1:
        mean, half = float(lengths.mean()), 1.96 * float(lengths.std()) / math.sqrt(len(lengths))
        length = FittedValue(mean, mean - half, mean + half, len(lengths))
    return DelayFit(poisson_fit(len(lengths), exposure), lengths, length)


def poisson_fit(events: int, exposure: float) -> FittedValue:
    """Events per unit of exposure, with the exact interval of a Poisson count (Garwood)."""
    from scipy.special import gammaincinv

    if exposure <= 0:
        return FittedValue(math.nan, 0.0, math.inf, 0)
    low = gammaincinv(events, 0.025) if events else 0.0
    high = gammaincinv(events + 1, 0.975)
    return FittedValue(events / exposure, float(low) / exposure, float(high) / exposure, events)


class Breakdowns(NamedTuple):
    """Breakdowns and repairs."""

    rate: FittedValue  # per second that a robot was up
    repairs: Censored  # times from breakdown to repair
    towed: int  # breakdowns after which the robot left the floor


def fit_breakdowns(track: RobotTracks, gaps: Array, error: float) -> Breakdowns:
    """The breakdowns; `gaps`, `error`: as those of Censored."""
    robot, down = track.log.samples.robot, track.log.samples.down
    linked = np.append(robot[1:] == robot[:-1], False)
    change = np.where(linked, np.diff(down.astype(np.int8), append=down[-1:]), 0)
    begins, ends = np.flatnonzero(change > 0) + 1, np.flatnonzero(change < 0)
    up = float(track.elapsed[linked & ~down & (track.elapsed <= MAX_GAP_MS / 1000)].sum())
    end = np.append(ends, len(down) - 1)[np.searchsorted(ends, begins)]
    is_over = (change[end] < 0) & (robot[end] == robot[begins])
    off = np.cumsum(np.append(0, track.cell == NIL))
    towed = off[np.where(is_over, end, begins) + 1] > off[begins]
    begin, end, seconds = begins[is_over], end[is_over], track.seconds
    times = seconds[begin] - seconds[begin - 1], seconds[end] - seconds[begin]
    after = seconds[end + 1] - seconds[end]
    repairs = Censored(*times, after, gaps, error)
    return Breakdowns(poisson_fit(len(begins), up), repairs, int(towed.sum()))
