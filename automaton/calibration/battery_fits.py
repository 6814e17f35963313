"""Energy use and charging, from the charge at each message.

The charge that a robot loses over some minutes is the sum of its seconds in each state times the energy
use of that state. A load multiplies energy use by a factor, for which the sum of squares is least. Energy
use is never negative, so the fit is by non-negative least squares. Charging is a rate for each range of
charge.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.log_on_floor import STILL, RobotTracks
from automaton.calibration.motion_fits import FittedValue

Array = np.ndarray[Any, Any]

DRAIN_STATES: Final = ("move", "turn", "pick", "drop", "wait")
PICK_AND_DROP: Final = ("pick", "drop")
# Relative widths of intervals: of picks and drops with values of their own, and of all states.
MAX_SEPARATE_INTERVAL: Final = 0.15
MAX_INTERVAL: Final = 0.5
MIN_WINDOWS: Final = 20
CHARGE_WINDOW_S: Final = 60.0  # between the begins of windows, about
LONG_WINDOW_S: Final = 300.0  # if these may cut an operation
ROUNDED: Final = 0.25  # share of pairs with a change of charge, below which it is rounded
COMMON: Final = 0.05  # share of messages in motion
RESAMPLES: Final = 200
TRIMS: Final = 2
OUTLIER: Final = 6.0  # medians of the absolute error
MIN_SHARE: Final = 0.02  # of time with a load, for its factor
LOAD_FACTORS: Final = (0.5, 3.0)
MAX_CHARGE_STEPS: Final = 3
FULL: Final = 99.5  # percent from which chargers trickle
MIN_BIN_SECONDS: Final = 60.0  # of charging, for a rate
Z_95: Final = 1.96  # standard errors to the ends of a 95 % interval
WORTH: Final = 0.05  # a further step must lower the squared error to this share of the variation


class DrainFit(NamedTuple):
    """Energy use in percent per second of each state that robots were in, and the factor of a load."""

    drains: dict[str, FittedValue]
    loaded_factor: FittedValue | None  # None: too few seconds with a load
    is_joint: bool  # picks and drops have one value: as many of both are in most windows

    def width(self, name: str) -> float:
        """The width of the interval of a state relative to its value, at least a tenth of the largest."""
        low, high = self.drains[name][1:3]
        least = max(one.value for one in self.drains.values()) / 10
        return (high - low) / max(self.drains[name].value, least, 1e-12)


def state_seconds(
    track: RobotTracks, usual: Array, turn_seconds: Array, operations: Mapping[str, Array]
) -> dict[str, Array]:
    """(2, n) seconds of each state between each message and the next, without a load and with one.

    `usual`: (n,) usual speed in cells per second; `turn_seconds`: (n,) of a turn; `operations`: (n,)
    seconds of a pick and of a drop. Time in motion is the path at the usual speed; a change of the load
    is a pick or a drop, even if no message shows it. The rest of the time is waiting.
    """
    way = abs(track.step).sum(axis=0)
    moves = track.driving | np.append(track.driving[1:], False) | (way > STILL)
    with np.errstate(divide="ignore", invalid="ignore"):
        move = np.where(moves & (usual > 0), np.nan_to_num(way / usual), 0.0)
    turned = np.append(np.diff(track.heading.astype(np.int64)), 0) % 4
    turn = turn_seconds * np.minimum(turned, 4 - turned)
    loaded = np.stack((track.loaded, np.append(track.loaded[1:], False)))
    share = np.stack((1 - loaded.mean(axis=0), loaded.mean(axis=0)))
    # Of some pairs, waiting is below 0: a turn shows at its end, an operation at a change of the load.
    out = {
        "move": share * move,
        "turn": share * turn,
        "wait": share * (track.elapsed - move - turn),
    }
    acts = np.stack((track.acts, np.append(track.acts[1:], False)))
    for name, before in (("pick", 0), ("drop", 1)):
        changes = track.usable & (loaded[0] == before) & (loaded[1] != before)
        seconds = changes * operations[name]
        out[name] = np.zeros_like(share)
        out[name][before] = seconds  # uses energy as without, as with the load
        # The load changes at the begin of an operation, at its end, or between: when the robot acts.
        acting = acts[:, changes].sum(axis=1)
        side = acting / acting.sum() if acting.any() else np.full(2, 0.5)
        out["wait"][before] -= side[0] * seconds
        out["wait"][1 - before] -= side[1] * seconds
    return out


def fit_drains(
    track: RobotTracks,
    seconds: Mapping[str, Array],
    errors: Mapping[str, tuple[float, float]],
    seed: int = 0,
) -> DrainFit | None:
    """The energy use, from the `seconds` of each state; None: too few windows.

    `errors`: relative standard errors of the seconds of a state, without a load and with one.
    """
    samples = track.log.samples
    change = np.append(samples.charge[:-1] - samples.charge[1:], 0.0)
    off = (samples.charging == 1) | samples.down
    rows = np.flatnonzero(track.usable & ~off & ~np.append(off[1:], True) & np.isfinite(change))
    if not len(rows):
        return None
    begins = window_begins(track, change, rows)[rows]
    breaks = np.diff(rows, prepend=-1) > 1
    first = np.flatnonzero(begins | breaks)
    lost = np.add.reduceat(change[rows], first)
    # Windows that begin or end elsewhere, as at a charger, cut an operation.
    is_complete = begins[first] & np.append((begins & ~breaks)[first[1:]], False)
    if is_complete.sum() < MIN_WINDOWS:
        return None
    table = {
        name: np.add.reduceat(one[:, rows], first, axis=1)[:, is_complete]
        for name, one in seconds.items()
        if one[:, rows].sum() > 0
    }
    states = [name for name in DRAIN_STATES if name in table]
    fit = _fit_table(table, lost[is_complete], [(name,) for name in states], errors, seed)
    has_both = all(name in states for name in PICK_AND_DROP)
    if not has_both or max(map(fit.width, PICK_AND_DROP)) < MAX_SEPARATE_INTERVAL:
        return fit
    groups = [PICK_AND_DROP, *((name,) for name in states if name not in PICK_AND_DROP)]
    joint = _fit_table(table, lost[is_complete], groups, errors, seed)
    # One value for two states does not say more about each than a value of its own.
    wide = {name: _around(joint.drains[name], fit.drains[name]) for name in PICK_AND_DROP}
    return joint._replace(drains={**joint.drains, **wide})


def _around(one: FittedValue, other: FittedValue) -> FittedValue:
    """A value with an interval that holds that of another fit, too."""
    return one._replace(low=min(one.low, other.low), high=max(one.high, other.high))


def _fit_table(
    seconds: Mapping[str, Array],
    lost: Array,
    groups: Sequence[tuple[str, ...]],
    errors: Mapping[str, tuple[float, float]],
    seed: int,
) -> DrainFit:
    """The energy use of groups of states, from the `seconds` and the charge lost in each window."""
    table = np.stack([sum(seconds[name] for name in group) for group in groups], axis=2)
    # Windows whose charge is off for another reason do not count: most of them lie close together.
    for _ in range(TRIMS):
        at = _solve(table, lost, True)
        beyond = abs(lost - (table[0] + at[-1] * table[1]) @ at[:-1])
        usual = beyond <= OUTLIER * max(float(np.median(beyond)), 1e-9)
        table, lost = table[:, usual], lost[usual]
    has_factor = bool(table[1].sum() > MIN_SHARE * table.sum() and table[0].sum() > 0)
    best = _solve(table, lost, has_factor)
    # Windows are drawn again, and the seconds of states err as fitted durations do.
    rng, resampled = np.random.default_rng(seed), []
    spread = np.array([errors.get(group[0], (0.0, 0.0)) for group in groups]).T
    for _ in range(RESAMPLES):
        drawn = rng.integers(0, len(lost), len(lost))
        more = table[:, drawn] * (spread * rng.normal(size=spread.shape))[:, None]
        more[:, :, [group == ("wait",) for group in groups]] -= more.sum(axis=2, keepdims=True)
        near = float(best[-1])
        resampled.append(_solve(table[:, drawn] + more, lost[drawn], has_factor, near))
    ends = np.quantile(resampled, (0.025, 0.975), axis=0)
    fits = [
        FittedValue(value, low, high, len(lost))
        for value, low, high in np.stack((best, *ends), axis=1).tolist()
    ]
    drains = {name: fit for group, fit in zip(groups, fits, strict=False) for name in group}
    return DrainFit(drains, fits[-1] if has_factor else None, PICK_AND_DROP in groups)


def window_begins(track: RobotTracks, change: Array, rows: Array) -> Array:
    """(n,) bool: messages at which windows begin; `change`: (n,) loss of charge until the next message.

    That is in motion at the centre of a cell, so that no operation belongs to two windows, and no move of
    a simulated robot, which uses its energy as it begins. If the charge is rounded, so that few of the
    pairs in `rows` show a change, it is where the rounded charge changes: only there it is exact.
    """
    if np.count_nonzero(change[rows]) < ROUNDED * len(rows):
        candidates, length = rows[change[rows] != 0] + 1, LONG_WINDOW_S
    else:
        moving, length = track.driving & ~track.acts, CHARGE_WINDOW_S
        at_centre = moving & (track.place % 1 == 0).all(axis=0)
        candidates = np.flatnonzero(
            at_centre if at_centre.sum() > COMMON * moving.sum() else moving
        )
    number = np.floor(track.seconds[candidates] / length)
    robot = track.log.samples.robot[candidates]
    is_new = (np.diff(number, prepend=-1) != 0) | (np.diff(robot, prepend=-1) != 0)
    out = np.zeros(len(change), np.bool_)
    out[candidates[is_new]] = True
    return out


def _solve(table: Array, lost: Array, has_factor: bool, near: float | None = None) -> Array:
    """Energy use of each state, and the factor of a load; `near`: about this factor.

    `table`: (2, windows, states) seconds without a load and with one.
    """
    from scipy.optimize import minimize_scalar, nnls

    def fit(factor: float) -> tuple[Array, float]:
        out: tuple[Array, float] = nnls(table[0] + factor * table[1], lost)
        return out

    factor = 1.0
    if has_factor:
        ends = LOAD_FACTORS if near is None else (near - 0.2, near + 0.2)
        options = {"xatol": 1e-4}
        search = minimize_scalar(
            lambda one: fit(one)[1], bounds=ends, method="bounded", options=options
        )
        factor = float(search.x)
    return np.append(fit(factor)[0], factor)


class ChargeStep(NamedTuple):
    """The charging rate from a charge on."""

    percent: float
    rate: FittedValue  # percent per second


def fit_charging(track: RobotTracks) -> tuple[ChargeStep, ...]:
    """The steps of the charging rate; () if too little was charged."""
    charge, charging = track.log.samples.charge, track.log.samples.charging == 1
    change = np.append(np.diff(charge), 0.0)
    both = charging & np.append(charging[1:], False) & track.usable & (charge < FULL)
    both &= np.isfinite(change)
    rows = np.flatnonzero(both)
    rows = rows[_between_changes(rows, change)]
    percent = np.clip(np.floor(charge[rows]), 0, 99).astype(np.int64)
    time = np.bincount(percent, track.elapsed[rows], 100)
    gained = np.bincount(percent, change[rows], 100)
    if time.sum() < MIN_BIN_SECONDS:
        return ()
    known = np.flatnonzero(time > 0)
    rate, weight = gained[known] / time[known], time[known]
    mean = float(np.average(rate, weights=weight))
    misfit, begins = math.inf, [0]
    for steps in range(1, min(MAX_CHARGE_STEPS, len(known)) + 1):
        after, more = _steps(rate, weight, steps)
        # A step is worth a key if what remains shrinks, and is more than a hundredth of the rate.
        if steps == 1 or (misfit > weight.sum() * (WORTH * mean) ** 2 and after < misfit / 2):
            misfit, begins = after, more
    parts = zip(np.split(rate, begins[1:]), np.split(weight, begins[1:]), strict=True)
    starts = [0.0, *known[begins[1:]].astype(float).tolist()]
    rates = (_mean_rate(part, of) for part, of in parts)
    return tuple(ChargeStep(*step) for step in zip(starts, rates, strict=True))


def _mean_rate(rates: Array, seconds: Array) -> FittedValue:
    """The rate over all seconds, from that of each percent; the spread of these gives the interval."""
    mean, n = float(np.average(rates, weights=seconds)), len(rates)
    if n < 2:
        return FittedValue(mean, 0.0, math.inf, n)
    squares = float((seconds**2 * (rates - mean) ** 2).sum())
    half = Z_95 * math.sqrt(squares * n / (n - 1)) / float(seconds.sum())
    return FittedValue(mean, max(mean - half, 0.0), mean + half, n)


def _between_changes(rows: Array, change: Array) -> Array:
    """(k,) bool: rows after the first change and up to the last one of those without a gap between them.

    Only where a rounded charge changes is it exact.
    """
    if not len(rows):
        return np.zeros(0, np.bool_)
    changes = (change[rows] != 0).astype(np.int64)
    begins = np.flatnonzero(np.diff(rows, prepend=-2) > 1)
    lengths = np.diff(begins, append=len(rows))
    before = np.cumsum(changes) - changes
    since = before - np.repeat(before[begins], lengths)
    out: Array = (since > 0) & (since < np.repeat(np.add.reduceat(changes, begins), lengths))
    return out


def _steps(rate: Array, weight: Array, steps: int) -> tuple[float, list[int]]:
    """The least squared error of `steps` runs, and the first element of each."""
    sums = [np.append(0, np.cumsum(weight * rate**power)) for power in (0, 1, 2)]
    choices = list(itertools.combinations(range(1, len(rate)), steps - 1))
    ends = np.array(choices, np.int64).reshape(len(choices), steps - 1)
    edge = np.ones((len(ends), 1), np.int64)
    one, other = np.hstack((0 * edge, ends)), np.hstack((ends, len(rate) * edge))
    weights, first, second = (total[other] - total[one] for total in sums)
    cost = (second - first**2 / weights).sum(axis=1)
    best = int(cost.argmin())
    return float(cost[best]), one[best].tolist()
