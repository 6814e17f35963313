"""Energy use and charging, from the charge at each message.

The charge that a robot loses over some minutes is the sum of its seconds in each state times the energy
use of that state. A load multiplies energy use by a factor, for which the sum of squares is least. Energy
use is never negative, so the fit is by non-negative least squares. Charging is a rate for each range of
charge.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.motion_fits import STILL, FittedValue, RobotTracks

Array = np.ndarray[Any, Any]

DRAIN_STATES: Final = ("move", "turn", "pick", "drop", "wait")
WINDOWS_S: Final = (60.0, 3600.0)  # range of the length of windows
COMMON: Final = 0.05  # share of messages in motion
RESOLUTION_STEPS: Final = 50
RESAMPLES: Final = 200
TRIMS: Final = 2
OUTLIER: Final = 6.0  # medians of the absolute error
LOAD_FACTORS: Final = (0.5, 3.0)
MAX_CHARGE_STEPS: Final = 3
MIN_BIN_SECONDS: Final = 60.0  # of charging, for a rate
WORTH: Final = 0.05  # a further step must lower the squared error to this share of the variation


class DrainFit(NamedTuple):
    """Energy use in percent per second of each state that robots were in, and the factor of a load."""

    drains: dict[str, FittedValue]
    loaded_factor: FittedValue | None  # None: too few seconds with a load


def state_seconds(
    track: RobotTracks, usual: Array, turn_seconds: Array, operations: dict[str, float]
) -> dict[str, Array]:
    """(n,) seconds of each state between each message and the next; the rest of the time is waiting.

    `usual`: (n,) usual speed in cells per second; `turn_seconds`: (n,) of a turn; `operations`: seconds
    of a pick and of a drop. Time in motion is the path at the usual speed; a change of the load is a pick
    or a drop, even if no message shows it.
    """
    seconds = np.append(np.diff(track.seconds), 0.0)
    way = sum(abs(np.append(np.diff(one), 0.0)) for one in (track.column, track.row))
    moves = track.driving | np.append(track.driving[1:], False) | (way > STILL)
    with np.errstate(divide="ignore", invalid="ignore"):
        out = {"move": np.where(moves & (usual > 0), np.nan_to_num(way / usual), 0.0)}
    turned = np.append(np.diff(track.heading.astype(np.int64)), 0) % 4
    out["turn"] = turn_seconds * np.minimum(turned, 4 - turned)
    after = np.append(track.loaded[1:], track.loaded[-1:])
    out["pick"] = operations.get("pick", 0.0) * (~track.loaded & after)
    out["drop"] = operations.get("drop", 0.0) * (track.loaded & ~after)
    out["wait"] = seconds - sum(out.values())  # of some pairs below 0: a turn shows at its end
    return out


def fit_drains(
    track: RobotTracks, seconds: dict[str, Array], charge: Array, left_out: Array, seed: int = 0
) -> DrainFit | None:
    """The energy use; `charge`: (n,) percent, `left_out`: (n,) bool, charging or down.

    None: the log has no charge.
    """
    change = np.append(charge[:-1] - charge[1:], 0.0)
    usable = track.usable & ~left_out & ~np.append(left_out[1:], True) & ~np.isnan(change)
    rows = np.flatnonzero(usable)
    if not len(rows):
        return None
    begins = window_begins(track, window_seconds(change[rows], track.seconds))
    first = np.flatnonzero(begins[rows] | np.append(True, np.diff(rows) > 1))
    load = track.loaded & np.append(track.loaded[1:], False)
    half = track.loaded ^ np.append(track.loaded[1:], False)
    share = (load + 0.5 * half)[rows]
    shares = {"pick": 0.0 * share, "drop": 0.0 * share + 1}

    def by_window(one: Array) -> Array:
        out: Array = np.add.reduceat(one, first)
        return out

    names = [name for name in DRAIN_STATES if seconds[name][rows].sum() > 0]
    empty = np.stack(
        [by_window(seconds[name][rows] * (1 - shares.get(name, share))) for name in names], axis=1
    )
    loaded = np.stack(
        [by_window(seconds[name][rows] * shares.get(name, share)) for name in names], axis=1
    )
    lost = by_window(change[rows])
    # Windows whose charge is off for another reason do not count: most of them lie close together.
    for _ in range(TRIMS):
        at = _solve(empty, loaded, lost, True)
        beyond = abs(lost - (empty + at[-1] * loaded) @ at[:-1])
        usual = beyond <= OUTLIER * max(float(np.median(beyond)), 1e-9)
        empty, loaded, lost = empty[usual], loaded[usual], lost[usual]
    has_factor = loaded.sum() > 0.02 * (empty.sum() + loaded.sum()) and empty.sum() > 0
    rng = np.random.default_rng(seed)
    solutions = [_solve(empty, loaded, lost, has_factor)]
    for _ in range(RESAMPLES):
        pick = rng.integers(0, len(lost), len(lost))
        factor = solutions[0][-1] if has_factor else 1.0
        solutions.append(_solve(empty[pick], loaded[pick], lost[pick], has_factor, factor))
    table = np.array(solutions)
    ends = np.quantile(table[1:], (0.025, 0.975), axis=0)
    fits = [
        FittedValue(float(table[0, k]), float(ends[0][k]), float(ends[1][k]), len(lost))
        for k in range(table.shape[1])
    ]
    return DrainFit(dict(zip(names, fits, strict=False)), fits[-1] if has_factor else None)


def window_seconds(change: Array, seconds: Array) -> float:
    """The length of windows in which the charge falls by many steps of its resolution."""
    steps = abs(change[change != 0])
    if not len(steps):
        return WINDOWS_S[1]
    elapsed = float(np.median(np.diff(seconds))) * len(change)
    rate = float(steps.sum()) / max(elapsed, 1.0)
    return float(np.clip(RESOLUTION_STEPS * float(steps.min()) / rate, *WINDOWS_S))


def window_begins(track: RobotTracks, length: float) -> Array:
    """(n,) bool: messages at which windows begin, in motion and at the centre of a cell.

    So no operation belongs to two windows, and no move of a simulated robot, which uses its energy as it
    begins.
    """
    moving = track.driving & ~track.acts
    at_centre = (track.column % 1 == 0) & (track.row % 1 == 0)
    is_common = (moving & at_centre).sum() > COMMON * moving.sum()
    candidates = np.flatnonzero(moving & at_centre if is_common else moving)
    number = np.floor(track.seconds[candidates] / length)
    is_new = np.append(True, (np.diff(number) != 0) | (np.diff(track.robot[candidates]) != 0))
    out = np.zeros(len(track.seconds), bool)
    out[candidates[is_new[: len(candidates)]]] = True
    return out


def _solve(
    empty: Array, loaded: Array, lost: Array, has_factor: bool, near: float | None = None
) -> Array:
    """Energy use of each state, and the factor of a load; `near`: about this factor."""
    from scipy.optimize import minimize_scalar, nnls

    def residual(factor: float) -> float:
        return float(nnls(empty + factor * loaded, lost)[1])

    factor = 1.0
    if has_factor:
        ends = LOAD_FACTORS if near is None else (near - 0.2, near + 0.2)
        factor = float(
            minimize_scalar(residual, bounds=ends, method="bounded", options={"xatol": 1e-4}).x
        )
    return np.append(nnls(empty + factor * loaded, lost)[0], factor)


def fit_charging(
    track: RobotTracks, charge: Array, charging: Array
) -> tuple[tuple[float, float], ...]:
    """[from percent, percent per second] steps of the charging rate; () if too little was charged."""
    change = np.append(np.diff(charge), 0.0)
    seconds = np.append(np.diff(track.seconds), 0.0)
    both = (
        charging
        & np.append(charging[1:], False)
        & track.usable
        & ~np.isnan(change)
        & (charge < 99.5)
    )
    percent = np.clip(np.floor(charge[both]), 0, 99).astype(np.int64)
    time = np.bincount(percent, seconds[both], 100)
    gained = np.bincount(percent, change[both], 100)
    if time.sum() < MIN_BIN_SECONDS:
        return ()
    known = np.flatnonzero(time > 0)
    rate, weight = gained[known] / time[known], time[known]
    mean = float(np.average(rate, weights=weight))
    best = _steps(rate, weight, 1)
    for count in range(2, min(MAX_CHARGE_STEPS, len(known)) + 1):
        more = _steps(rate, weight, count)
        # A step is worth a key if what remains shrinks, and is more than a hundredth of the rate.
        before, after = _misfit(rate, weight, best), _misfit(rate, weight, more)
        if before > weight.sum() * (WORTH * mean) ** 2 and after < before / 2:
            best = more
    begins = [0, *best[1:]]
    ends = [*begins[1:], len(known)]
    steps: list[tuple[float, float]] = []
    for begin, end in zip(begins, ends, strict=True):
        value = float(np.average(rate[begin:end], weights=weight[begin:end]))
        steps.append((0.0 if not steps else float(known[begin]), value))
    return tuple(steps)


def _misfit(rate: Array, weight: Array, begins: list[int]) -> float:
    ends = [*begins[1:], len(rate)]
    return sum(_cost(rate[b:e], weight[b:e]) for b, e in zip(begins, ends, strict=True))


def _cost(rate: Array, weight: Array) -> float:
    mean = np.average(rate, weights=weight)
    return float((weight * (rate - mean) ** 2).sum())


def _steps(rate: Array, weight: Array, count: int) -> list[int]:
    """The first elements of `count` runs with the least squared error (dynamic programming)."""
    n = len(rate)
    cost = {(b, e): _cost(rate[b:e], weight[b:e]) for b in range(n) for e in range(b + 1, n + 1)}
    best: dict[tuple[int, int], tuple[float, list[int]]] = {
        (e, 1): (cost[0, e], [0]) for e in range(1, n + 1)
    }
    for k in range(2, count + 1):
        for e in range(k, n + 1):
            best[e, k] = min(
                (best[b, k - 1][0] + cost[b, e], [*best[b, k - 1][1], b]) for b in range(k - 1, e)
            )
    return best[n, count][1]
