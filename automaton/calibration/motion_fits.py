"""How robots move: speeds, turns, slow stretches, delays and breakdowns, from where messages show them.

    message       o----------o----------o----------o          time that a turn takes: time between
    heading       >          >          v          v          two messages in motion, less the path
    driving       yes        yes        no         yes        between them at the usual speed

Only robots without another one ahead show how fast they drive, and a median resists the rest: robots that
braked for something that no message shows. A stretch is slow if the interval of its speeds lies below the
usual speed by more than a share. A delay is time beyond that of the path, without a turn. Both thresholds
are guesses, so they are parameters. All positions are in cells, speeds in cells per second.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.duration_fits import Censored
from automaton.calibration.log_on_floor import STILL, RobotTracks
from automaton.calibration.state_log import MAX_GAP_MS

Array = np.ndarray[Any, Any]

WINDOW_S: Final = 5.0  # over which a speed is taken if possible: stamps err by tenths of a second
SLOWEST: Final = 1e-3  # cells per second
ENOUGH_WINDOWS, MANY_WINDOWS = 100, 300
CORE: Final = 2.5  # standard deviations beyond which slow pairs were obstructed
LEVEL: Final = 0.95
# Relative error of a speed through obstructions that no message shows. In calibration_trials.py, 95 %
# of 80 speeds of 20 sites err by less than 1.2 %, most of them downwards.
UNSEEN_ERROR: Final = 0.01
MIN_SLOW_PAIRS: Final = 30
SLOW_SHARE: Final = 0.05  # below the usual speed
SHORTEST_DELAY_S: Final = 1.0
ERRORS: Final = 3  # standard deviations of the stamps that a delay must exceed
MOVING: Final = 0.25  # share of the usual speed below which a robot stands
MIN_SHOWN: Final = 20  # drives or turns whose median an observed run uses
NEAR_MIDDLE: Final = 0.25  # cells; to the middle of an edge, for a pair of messages to count there


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
    """The drives; `cells_per_second`, `keeps`: (n,) usual speed, and whether something keeps a robot.

    Some logs call a robot that turns driving, so one that stands before and after a message does not.
    """
    expected = MOVING * cells_per_second * track.elapsed
    moves = np.hypot(*np.nan_to_num(track.step)) >= np.minimum(expected, STILL)
    moves |= ~track.usable
    in_motion = track.driving & (moves | np.append(True, moves[:-1]))
    moving = np.flatnonzero(in_motion & track.on_floor)
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


def observed_pace(
    track: RobotTracks, tick_s: float, moves: tuple[int, int], turn: int
) -> tuple[Array, int]:
    """Ticks of a move of each robot, (robots, 2), empty and loaded, and of a turn, as the log shows them.

    `moves`, `turn`: ticks in the scenario, which hold for what the log shows too rarely.
    """
    robot, loaded = track.log.samples.robot, track.loaded
    pace = np.tile(np.array(moves, np.float64), (len(track.log.robots), 1))
    for load in range(2):
        speeds, robots = speed_windows(track, loaded == load)
        numbers, first = np.unique(robots, return_index=True)
        of_robots = zip(numbers.tolist(), np.split(speeds, first)[1:], strict=True)
        for number, own in [(slice(None), speeds), *of_robots]:
            if len(own) >= MIN_SHOWN:
                pace[number, load] = np.median(core(1 / np.maximum(own, SLOWEST), -1)) / tick_s
    turns = corners_of(track, 1 / (pace[robot, loaded.astype(np.int64)] * tick_s))[1]
    if len(turns) >= MIN_SHOWN:
        turn = max(1, round(float(np.median(core(turns, -1))) / tick_s))
    return pace, turn


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
    before, after = np.append(False, is_late)[:-1], np.append(is_late, False)[1:]
    wide = is_late | (free & (before | after))
    number = np.cumsum(wide & ~np.append(False, wide)[:-1])[wide] - 1
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
    off = np.cumsum(np.append(0, ~track.on_floor))
    towed = off[np.where(is_over, end, begins) + 1] > off[begins]
    begin, end, seconds = begins[is_over], end[is_over], track.seconds
    times = seconds[begin] - seconds[begin - 1], seconds[end] - seconds[begin]
    after = seconds[end + 1] - seconds[end]
    repairs = Censored(*times, after, gaps, error)
    return Breakdowns(poisson_fit(len(begins), up), repairs, int(towed.sum()))
