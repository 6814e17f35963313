"""Speeds and turns of robots, from where they were at each message.

    message       o----------o----------o----------o          time that a turn takes: time between
    heading       >          >          v          v          two messages in motion, less the path
    driving       yes        yes        no         yes        between them at the usual speed

Only robots without another one ahead show how fast they drive, and a median resists the rest: robots that
braked for something that no message shows. All positions are in cells, speeds in cells per second.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.log_on_floor import RobotTracks
from automaton.floor.floor_plan import NIL

Array = np.ndarray[Any, Any]

WINDOW_S: Final = 5.0  # over which a speed is taken if possible: stamps err by tenths of a second
SLOWEST: Final = 1e-3  # cells per second
ENOUGH_WINDOWS, MANY_WINDOWS = 100, 300
CORE: Final = 2.5  # standard deviations beyond which slow pairs were obstructed
LEVEL: Final = 0.95
# Relative error of a speed through obstructions that no message shows. In calibration_trials.py, 95 %
# of 80 speeds of 20 sites err by less than 1.2 %, most of them downwards.
UNSEEN_ERROR: Final = 0.01


class FittedValue(NamedTuple):
    """An estimate with its 95 % interval."""

    value: float
    low: float
    high: float
    n: int  # observations

    def scaled(self, factor: float) -> FittedValue:
        """The same in another unit."""
        return FittedValue(self.value * factor, self.low * factor, self.high * factor, self.n)

    def with_unseen(self) -> FittedValue:
        """The same with an interval that allows for obstructions that no message shows."""
        value, error = self.value, UNSEEN_ERROR * self.value
        ends = (math.hypot(value - self.low, error), math.hypot(self.high - value, error))
        return FittedValue(value, value - ends[0], value + ends[1], self.n)


def speed_windows(track: RobotTracks, chosen: Array) -> tuple[Array, Array]:
    """Speeds over runs of free pairs, in windows of WINDOW_S and what remains of a run, and their robots.

    Pairs at the ends of a run are left out where there are enough others: the robot may have stood there.
    """
    free = track.free & chosen
    if track.gap < WINDOW_S / 2:
        inner = free & np.roll(free, 1) & np.roll(free, -1)
        for pairs, least, enough in (
            (inner, track.gap, MANY_WINDOWS),
            (free, 2 * track.gap, ENOUGH_WINDOWS),
        ):
            speeds, robots = _windows(track, pairs, least)
            if len(speeds) >= enough:
                return speeds, robots
    return _windows(track, free, track.gap)


def _windows(track: RobotTracks, free: Array, least: float) -> tuple[Array, Array]:
    """Speeds and robots of windows of at least about `least` seconds."""
    run = np.cumsum(np.append(True, ~(free[1:] & free[:-1])))[free]
    if not len(run):
        return np.zeros(0), np.zeros(0, np.int64)
    seconds = track.elapsed[free]
    begin = np.flatnonzero(np.diff(run, prepend=0))
    before = np.cumsum(seconds) - seconds
    since = before - np.repeat(before[begin], np.diff(begin, append=len(run)))
    window = np.floor(since / WINDOW_S)
    first = np.flatnonzero((np.diff(run, prepend=0) != 0) | (np.diff(window, prepend=0) != 0))
    time = np.add.reduceat(seconds, first)
    way = abs(np.add.reduceat(track.step[:, free], first, axis=1)).sum(axis=0)
    is_long = time >= 0.8 * least
    return (way / time)[is_long], track.log.samples.robot[free][first][is_long]


def core(values: Array, sign: int = 1) -> Array:
    """Values without those that obstructions made lower (with `sign` -1: higher) than the rest.

    The spread is that of the other half, so that the values left out do not widen it.
    """
    middle = np.median(values)
    for _ in range(20):
        beyond = sign * (values - middle)
        upper = beyond[beyond >= 0]
        spread = 1.4826 * np.median(upper) if len(upper) else 0.0
        near: Array = values[abs(beyond) <= CORE * max(spread, 1e-9 + 1e-6 * abs(middle))]
        after = np.median(near)
        if after == middle:
            break
        middle = after
    return near


def usual_speed(speeds: Array) -> FittedValue:
    """The median speed without obstructed drives.

    These are named by their time for a cell: errors of stamps are symmetric in it, not in the speed.
    """
    slowness = median_fit(core(1 / np.maximum(speeds, SLOWEST), -1))
    ends = 1 / slowness.high, 1 / slowness.low
    return FittedValue(1 / slowness.value, *ends, slowness.n).with_unseen()


def median_fit(values: Array, level: float = LEVEL) -> FittedValue:
    """The median with an interval of order statistics."""
    from scipy.special import bdtrik

    ordered = np.sort(values)
    n = len(ordered)
    rank = math.ceil(bdtrik((1 - level) / 2, n, 0.5))
    low, high = ordered[max(rank - 1, 0)], ordered[min(n - rank, n - 1)]
    return FittedValue(float(np.median(ordered)), float(low), float(high), n)


class Drives(NamedTuple):
    """What lies between each message in motion and the next one in motion; a row for each."""

    message: Array  # (k,) the first
    seconds: Array  # (k,) between both
    late: Array  # (k,) seconds beyond those of the path at the usual speed; 0 unless free
    free: Array  # (k,) bool: all messages are usable, nothing kept the robot, its load is the same
    turns: Array  # (k,) how often the heading changes
    quarters: Array  # (k,) by which it has changed at the end, 0 to 3


def drives_of(track: RobotTracks, cells_per_second: Array, keeps: Array) -> Drives:
    """The drives; `cells_per_second`, `keeps`: (n,) usual speed, and whether something keeps a robot."""
    moving = np.flatnonzero(track.driving & (track.cell != NIL))
    first, last = moving[:-1], moving[1:]
    broken = np.cumsum(np.append(0, ~track.usable[:-1]))
    busy = np.cumsum(np.append(0, keeps))
    changes = np.append(0, np.cumsum(np.diff(track.heading) != 0))
    free = (broken[last] == broken[first]) & (busy[last + 1] == busy[first])
    free &= (track.loaded[first] == track.loaded[last]) & (cells_per_second[first] > 0)
    seconds = track.seconds[last] - track.seconds[first]
    way = abs(track.place[:, last] - track.place[:, first]).sum(axis=0)
    late = np.where(free, seconds - way / np.where(free, cells_per_second[first], 1), 0.0)
    quarters = (track.heading[last] - track.heading[first]) % 4
    return Drives(first, seconds, late, free, changes[last] - changes[first], quarters)


def corners_of(track: RobotTracks, cells_per_second: Array) -> tuple[Array, Array]:
    """Messages before turns by 90 degrees, without an operation or a robot ahead; their seconds."""
    drives = drives_of(track, cells_per_second, track.acts | track.near)
    chosen = drives.free & (drives.turns == 1) & (drives.quarters % 2 == 1)
    return drives.message[chosen], drives.late[chosen]
