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

from automaton.calibration.log_on_floor import Placed
from automaton.calibration.state_log import StateLog
from automaton.floor.floor_plan import DIRECTION_VECTORS, EAST, NIL, NORTH, SOUTH, WEST, FloorPlan

Array = np.ndarray[Any, Any]

CELLS_AHEAD: Final = 4  # in which another robot obstructs
WINDOW_S: Final = 5.0  # over which a speed is taken if possible: stamps err by tenths of a second
SLOWEST: Final = 1e-3  # cells per second
ENOUGH_WINDOWS, MANY_WINDOWS = 100, 300
LATERAL: Final = 0.15  # cells; a straight pair does not move farther aside
STILL: Final = 0.15  # cells; noise of positions moves a standing robot less far
CORE: Final = 2.5  # standard deviations beyond which slow pairs were obstructed
LEVEL: Final = 0.95


class RobotTracks(NamedTuple):
    """A log on its floor: a row for each message."""

    robot: Array  # (n,) int32
    seconds: Array  # (n,) float64
    column: Array  # (n,) float64: cells to the right of the first cell; nan: not on the floor
    row: Array  # (n,) float64: cells below the first cell
    heading: Array  # (n,) int8: direction, clockwise from east
    loaded: Array  # (n,) bool
    acts: Array  # (n,) bool: an operation, a charger or an error keeps the robot
    driving: Array  # (n,) bool
    near: Array  # (n,) bool: another robot is ahead
    usable: Array  # (n,) bool: of this message and the next


class MessagePairs(NamedTuple):
    """A row for each message and the next."""

    seconds: Array  # (n,)
    across: Array  # (n,) cells to the right
    down: Array  # (n,) cells down
    straight: Array  # (n,) bool: nothing but a straight drive may lie between
    free: Array  # (n,) bool: straight, in motion at both messages, without a robot ahead


class FittedValue(NamedTuple):
    """An estimate with its 95 % interval."""

    value: float
    low: float
    high: float
    n: int  # observations

    def scaled(self, factor: float) -> FittedValue:
        """The same in another unit."""
        return FittedValue(self.value * factor, self.low * factor, self.high * factor, self.n)


def track_of(log: StateLog, placed: Placed, floor_plan: FloorPlan) -> RobotTracks:
    """The log of robots with the place of each message."""
    samples, cell = log.samples, placed.cell
    row, column = np.divmod(cell, floor_plan.stride)
    to_row, to_column = np.divmod(
        np.where(placed.to_cell == NIL, cell, placed.to_cell), floor_plan.stride
    )
    known = cell != NIL
    column = np.where(known, column - 1 + placed.share * (to_column - column), np.nan)
    row = np.where(known, row - 1 + placed.share * (to_row - row), np.nan)
    seconds = samples.time / 1000
    usable = log.usable & known & np.append(known[1:], False)
    return RobotTracks(
        robot=samples.robot,
        seconds=seconds,
        column=column,
        row=row,
        heading=placed.heading,
        loaded=samples.load > 0,
        acts=(samples.action > 0) | (samples.charging == 1) | samples.down,
        driving=samples.driving != 0,
        near=robots_ahead(seconds, usable, column, row, placed.heading),
        usable=usable,
    )


def message_gap(seconds: Array, usable: Array) -> float:
    """The median time between two messages of a robot; nan without pairs."""
    gaps = np.diff(seconds)[usable[:-1]]
    return float(np.median(gaps)) if len(gaps) else math.nan


def robots_ahead(seconds: Array, usable: Array, column: Array, row: Array, heading: Array) -> Array:
    """(n,) bool: another robot is in one of the cells ahead, or beside these, at about this time.

    Ahead is where a robot drives to until its next message; the heading decides if it stands.
    """
    gap = message_gap(seconds, usable)
    if math.isnan(gap):
        return np.zeros(len(seconds), bool)
    bins = np.round((seconds - seconds.min()) / gap).astype(np.int64)
    x = np.round(np.nan_to_num(column, nan=-64.0)).astype(np.int64) + 64
    y = np.round(np.nan_to_num(row, nan=-64.0)).astype(np.int64) + 64
    width, height = int(x.max()) + 64, int(y.max()) + 64
    occupied = np.unique((bins * width + x) * height + y)
    vectors = np.asarray(DIRECTION_VECTORS, np.int64).T
    across, down = (
        np.where(usable, np.nan_to_num(np.diff(one, append=one[-1:])), 0) for one in (column, row)
    )
    along_x = abs(across) >= abs(down)
    travel = np.where(along_x, np.where(across > 0, EAST, WEST), np.where(down > 0, SOUTH, NORTH))
    dx, dy = vectors[:, np.where(np.maximum(abs(across), abs(down)) > STILL, travel, heading)]
    out = np.zeros(len(seconds), bool)
    for ahead in range(1, CELLS_AHEAD + 1):
        for aside in (-1, 0, 1):
            cells_x, cells_y = x + ahead * dx - aside * dy, y + ahead * dy + aside * dx
            out |= np.isin((bins * width + cells_x) * height + cells_y, occupied)
    return out


def pairs_of(track: RobotTracks) -> MessagePairs:
    """What lies between each message and the next."""
    seconds, across, down = (
        np.append(np.diff(one), 0.0) for one in (track.seconds, track.column, track.row)
    )

    def both(one: Array) -> Array:
        return np.append(one[:-1] & one[1:], False)

    def alike(one: Array) -> Array:
        return np.append(one[:-1] == one[1:], False)

    with np.errstate(invalid="ignore"):
        in_line = np.minimum(abs(across), abs(down)) < LATERAL
    straight = track.usable & (seconds > 0) & in_line & alike(track.heading)
    straight &= alike(track.loaded) & both(~track.acts)
    return MessagePairs(
        seconds, across, down, straight, straight & both(track.driving & ~track.near)
    )


def speed_windows(track: RobotTracks, pairs: MessagePairs, chosen: Array) -> Array:
    """Speeds over runs of free pairs, in windows of WINDOW_S and what remains of a run.

    Pairs at the ends of a run are left out where there are enough others: the robot may have stood there.
    """
    free = pairs.free & chosen
    gap = message_gap(track.seconds, track.usable)
    if gap < WINDOW_S / 2:
        inner = free & np.roll(free, 1) & np.roll(free, -1)
        for chosen_pairs, least, enough in (
            (inner, gap, MANY_WINDOWS),
            (free, 2 * gap, ENOUGH_WINDOWS),
        ):
            out = _windows(pairs, chosen_pairs, least)
            if len(out) >= enough:
                return out
    return _windows(pairs, free, gap)


def _windows(pairs: MessagePairs, free: Array, least: float) -> Array:
    """Speeds over windows of at least about `least` seconds."""
    run = np.cumsum(np.append(True, ~(free[1:] & free[:-1])))[free]
    if not len(run):
        return np.zeros(0)
    seconds = pairs.seconds[free]
    begin = np.flatnonzero(np.append(True, run[1:] != run[:-1]))
    before = np.cumsum(seconds) - seconds
    since = before - np.repeat(before[begin], np.diff(np.append(begin, len(run))))
    window = np.floor(since / WINDOW_S)
    first = np.flatnonzero(np.append(True, (run[1:] != run[:-1]) | (window[1:] != window[:-1])))
    time = np.add.reduceat(seconds, first)
    way = sum(abs(np.add.reduceat(one[free], first)) for one in (pairs.across, pairs.down))
    out: Array = (way / time)[time >= 0.8 * least]
    return out


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
    return FittedValue(1 / slowness.value, 1 / slowness.high, 1 / slowness.low, slowness.n)


def median_fit(values: Array, level: float = LEVEL) -> FittedValue:
    """The median with an interval of order statistics."""
    from scipy.special import bdtrik

    ordered = np.sort(values)
    n = len(ordered)
    rank = math.ceil(bdtrik((1 - level) / 2, n, 0.5))
    low, high = ordered[max(rank - 1, 0)], ordered[min(n - rank, n - 1)]
    return FittedValue(float(np.median(ordered)), float(low), float(high), n)


class Corners(NamedTuple):
    """Turns by 90 degrees between two straight drives; a row for each."""

    message: Array  # (k,) last message before the turn
    seconds: Array  # (k,) time beyond that of the path at the usual speed


def corners_of(track: RobotTracks, cells_per_second: Array) -> Corners:
    """Turns without an operation or a robot ahead; `cells_per_second`: (n,) usual speed at a message."""
    moving = np.flatnonzero(track.driving & ~np.isnan(track.column))
    first, last = moving[:-1], moving[1:]
    broken = np.cumsum(np.append(0, ~track.usable[:-1]))
    busy = np.cumsum(np.append(0, track.acts | track.near))
    turned = (track.heading[last] - track.heading[first]) % 4
    changes = np.append(0, np.cumsum(track.heading[1:] != track.heading[:-1]))
    free = (
        (broken[last] == broken[first])
        & (busy[last + 1] == busy[first])
        & (turned % 2 == 1)
        & (changes[last] - changes[first] == 1)
        & (track.loaded[first] == track.loaded[last])
        & (cells_per_second[first] > 0)
    )
    first, last = first[free], last[free]
    way = sum(abs(one[last] - one[first]) for one in (track.column, track.row))
    beyond = track.seconds[last] - track.seconds[first] - way / cells_per_second[first]
    known = ~np.isnan(beyond)
    return Corners(first[known], beyond[known])
