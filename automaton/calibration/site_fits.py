"""Everything that a log says about a site: estimates by key of the scenario, and what cannot be said.

An estimate needs a least number of observations, and an operation must last longer than the usual gap
between two messages. What lacks either is named, without a number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration import battery_fits, duration_fits, motion_fits
from automaton.calibration.log_on_floor import RobotTracks, placed
from automaton.calibration.motion_fits import FittedValue as FittedValue
from automaton.calibration.state_log import StateLog, numbers_of_robots
from automaton.scenario.robot_types import type_of_each, types_of
from automaton.units import count
from automaton.world.resolved import Resolved

Array = np.ndarray[Any, Any]

MIN_SPEED_PAIRS: Final = 100
MIN_DRIVES: Final = 5
MIN_TURNS: Final = 50
MIN_OPERATIONS: Final = 384  # mean to within 5 % if the standard deviation is half of it
MIN_DELAYS: Final = 400
MIN_BREAKDOWNS: Final = 10
MIN_BATTERY_S: Final = 7200.0  # of a robot
HOUR: Final = 3600.0
OPERATIONS: Final = {"pick": "pick", "drop": "drop", "handling": "serve"}  # action types of a log


class Thresholds(NamedTuple):
    """Guesses: how much slower than usual a slow stretch is, and the shortest delay that counts."""

    slow_share: float = motion_fits.SLOW_SHARE
    shortest_delay_s: float = motion_fits.SHORTEST_DELAY_S


USUAL_THRESHOLDS: Final = Thresholds()


class Estimate(NamedTuple):
    """An estimate of a key of the scenario."""

    key: str  # such as durations.move.empty; of a type: fleet.types.NAME.durations.move.empty
    unit: str
    present: float | None  # the value of the scenario; None: it has none, or a random one
    fit: FittedValue
    observed: str  # "5,384 pairs of messages"
    remark: str = ""  # such as the family of a distribution


class SiteFits(NamedTuple):
    """The estimates of a log."""

    gap_s: float  # median time between two messages of a robot
    robots: int
    hours: float  # with messages
    estimates: dict[str, Estimate]
    unsaid: list[str]
    notes: list[str]
    operations: dict[str, duration_fits.DurationFit]  # pick, drop, handling; keys of types
    delays: motion_fits.DelayFit | None
    repair: duration_fits.DurationFit | None
    towed: bool
    charging: tuple[battery_fits.ChargeStep, ...]
    slow: list[motion_fits.SlowStretch]

    @property
    def extent(self) -> str:
        """How much was logged, as a sentence."""
        robots = count(self.robots, "robot")
        return f"{robots}, {self.hours:.3g} h, a message every {self.gap_s:.3g} s (median)"


class Fitting:
    """Collects estimates and what cannot be said."""

    def __init__(self, track: RobotTracks, resolved: Resolved, thresholds: Thresholds) -> None:
        scenario = resolved.scenario
        self.track, self.log = track, track.log
        self.thresholds = thresholds
        self.durations, self.types = scenario.durations, types_of(scenario)
        # (n,) type of the robot of each message
        kinds = type_of_each(scenario.fleet)
        numbers = np.minimum(numbers_of_robots(track.log.robots, len(kinds)), len(kinds) - 1)
        self.kind: Array = kinds[numbers][track.log.samples.robot]
        self.metres = float(scenario.units.scale.cell_metres)  # side of a cell
        self.tick = float(scenario.units.scale.tick_seconds)
        self.gaps = track.elapsed[track.log.usable]  # seconds
        # Usual speed at each message, in cells per second: fitted, else that of the scenario.
        self.usual = np.zeros(len(track.cell))
        self.estimates: dict[str, Estimate] = {}
        self.unsaid: list[str] = []
        self.notes: list[str] = []

    def has_enough(self, what: str, have: int, need: int, unit: str) -> bool:
        """Whether there are enough observations; if not, say so."""
        if have < need:
            self.unsaid.append(f"{what}: {have:,} of at least {count(need, unit)}")
        return have >= need

    def is_long_enough(self, what: str, seconds: float) -> bool:
        """Whether an operation lasts longer than the gap between messages; if not, say so."""
        gap = self.track.gap
        if seconds < gap:
            self.unsaid.append(f"{what}: shorter than the median gap between messages, {gap:.3g} s")
        return seconds >= gap

    def key(self, kind: int, key: str) -> str:
        """The key of a value of a type of robots."""
        name = self.types[kind].name
        return f"fleet.types.{name}.{key}" if name else key

    def present(self, name: str, kind: int | None) -> float:
        """Seconds of a pick or a drop in the scenario: of a type, or (None) of the fleet."""
        durations = self.durations if kind is None else self.types[kind].durations
        return float(getattr(durations, name) * self.tick)

    def seconds(self, name: str) -> Array:
        """(types,) seconds of a pick or a drop: fitted, else of the scenario."""
        key, usual = f"durations.{name}", self.estimates
        fits = [usual.get(self.key(kind, key), usual.get(key)) for kind in range(len(self.types))]
        return np.array(
            [fit.fit.value if fit else self.present(name, kind) for kind, fit in enumerate(fits)]
        )

    def error(self, name: str) -> float:
        """The largest relative standard error of a duration, of all types."""
        fits = [one.fit for key, one in self.estimates.items() if key.endswith(f"durations.{name}")]
        return max(
            ((fit.high - fit.low) / (2 * battery_fits.Z_95 * fit.value) for fit in fits),
            default=0.0,
        )

    def operations(self, chosen: Array) -> duration_fits.Censored:
        """The operations of some messages."""
        log, identity = self.log, self.log.samples.action_id
        return duration_fits.operations_of(self.track.seconds, log.usable, identity, chosen)

    def add(self, estimate: Estimate) -> None:
        """Take an estimate."""
        self.estimates[estimate.key] = estimate

    def add_duration(
        self, key: str, present: float | None, fit: duration_fits.DurationFit, what: str = "times"
    ) -> None:
        """Take the mean of a distribution."""
        value = FittedValue(fit.mean, fit.low, fit.high, fit.n)
        self.add(Estimate(key, "s", present, value, f"{fit.n:,} {what}", family_words(fit)))


def fit_site(
    log: StateLog,
    resolved: Resolved,
    operations: Mapping[str, str] = OPERATIONS,
    thresholds: Thresholds = USUAL_THRESHOLDS,
) -> SiteFits:
    """Fit a log; `operations`: action types by pick, drop and handling. Raises InputError."""
    track = placed(log, resolved.floor_plan, resolved.scenario.units)
    fitting = Fitting(track, resolved, thresholds)
    _fit_speeds(fitting)
    turns = _fit_turns(fitting)
    durations = _fit_operations(fitting, operations)
    slow = motion_fits.slow_stretches(track, fitting.usual, fitting.metres, thresholds.slow_share)
    delays = _fit_delays(fitting)
    repair, towed = _fit_breakdowns(fitting)
    charging = _fit_battery(fitting, turns)
    return SiteFits(
        track.gap,
        len(log.robots),
        (float(np.ptp(track.seconds)) - log.counts.silent_s) / HOUR,
        fitting.estimates,
        fitting.unsaid,
        fitting.notes,
        durations,
        delays,
        repair,
        towed,
        charging,
        slow,
    )


def _fit_speeds(fitting: Fitting) -> None:
    track, metres = fitting.track, fitting.metres
    for kind, robot_type in enumerate(fitting.types):
        moves = robot_type.moves
        for loaded, ticks in enumerate(moves):
            present = 1 / (ticks * fitting.tick)  # cells per second
            chosen = (fitting.kind == kind) & (track.loaded == loaded)
            fitting.usual[chosen] = present
            key = fitting.key(kind, f"durations.move.{moves._fields[loaded]}")
            pairs = int((track.free & chosen).sum())
            if not fitting.has_enough(key, pairs, MIN_SPEED_PAIRS, "message pair"):
                continue
            speeds, robots = motion_fits.speed_windows(track, chosen)
            if not fitting.has_enough(key, len(speeds), MIN_DRIVES, "straight drive"):
                continue
            fit = motion_fits.usual_speed(speeds)
            fitting.usual[chosen] = fit.value
            _name_slow_robots(fitting, speeds, robots, fit.value, key)
            fit = fit.scaled(metres)
            fitting.add(Estimate(key, "m/s", present * metres, fit, f"{pairs:,} pairs"))


def _name_slow_robots(
    fitting: Fitting, speeds: Array, robots: Array, usual: float, key: str
) -> None:
    """Note the robots whose speed differs from that of their type; `robots`: sorted."""
    numbers, first = np.unique(robots, return_index=True)
    for robot, own in zip(numbers.tolist(), np.split(speeds, first[1:]), strict=True):
        if len(own) < MIN_TURNS:
            continue
        fit, share = motion_fits.usual_speed(own), fitting.thresholds.slow_share
        if fit.high < usual * (1 - share) or fit.low > usual * (1 + share):
            speed, rest = (one * fitting.metres for one in (fit.value, usual))
            name = fitting.log.robots[robot]
            fitting.notes.append(f"robot {name}: {speed:.3g} m/s, others {rest:.3g} m/s ({key})")


def _fit_turns(fitting: Fitting) -> Array:
    """Fit the turns; return the seconds of a turn of each type, fitted or of the scenario."""
    messages, durations = motion_fits.corners_of(fitting.track, fitting.usual)
    turns = np.zeros(len(fitting.types))
    for kind, robot_type in enumerate(fitting.types):
        if robot_type.kinematics == "omni":
            continue
        present = robot_type.turns.empty * fitting.tick
        turns[kind] = present
        key = fitting.key(kind, "durations.turn")
        seconds = durations[fitting.kind[messages] == kind]
        if not fitting.has_enough(key, len(seconds), MIN_TURNS, "turn"):
            continue
        fit = motion_fits.median_fit(motion_fits.core(seconds, -1)).with_unseen()
        if fitting.is_long_enough(key, fit.value):
            turns[kind] = fit.value
            fitting.add(Estimate(key, "s", present, fit, f"{len(seconds):,} turns"))
    return turns


def _fit_operations(
    fitting: Fitting, operations: Mapping[str, str]
) -> dict[str, duration_fits.DurationFit]:
    """Fit handling, picks and drops, and the picks and drops of types that differ from the others."""
    log, out = fitting.log, {}
    known = [one.lower() for one in log.actions]
    for name, action in operations.items():
        if action.lower() not in known:
            rest = [one for one in known if one not in map(str.lower, operations.values())]
            others = f"; it has {', '.join(rest)}: use --action {name}=..." if rest else ""
            fitting.unsaid.append(f"durations.{name}: the log has no action {action}{others}")
            continue
        chosen = log.samples.action == known.index(action.lower()) + 1
        key = f"durations.{name}"
        data = fitting.operations(chosen)
        if not fitting.has_enough(key, data.n, MIN_OPERATIONS, "operation"):
            continue
        fit = duration_fits.fit_durations(data)
        if len(data.gaps) and not fitting.is_long_enough(key, fit.mean):
            continue
        present = None
        if name == "handling":
            fit = fit._replace(empirical=duration_fits.empirical_quantiles(data))
        else:
            present = fitting.present(name, None)
        out[name] = fit
        fitting.add_duration(key, present, fit)
        for kind in range(len(fitting.types) if present is not None else 0):
            own = fitting.operations(chosen & (fitting.kind == kind))
            if len(fitting.types) == 1 or own.n < MIN_OPERATIONS:
                continue
            of_type, usual = duration_fits.fit_durations(own), fitting.present(name, kind)
            if usual != present or not of_type.low <= fit.mean <= of_type.high:
                out[fitting.key(kind, key)] = of_type
                fitting.add_duration(fitting.key(kind, key), usual, of_type)
        if all(fitting.key(kind, key) in out for kind in range(len(fitting.types))):
            del fitting.estimates[key]  # a mixture
    return out


def family_words(fit: duration_fits.DurationFit) -> str:
    """The family of a distribution, and how well it describes the durations."""
    spread = {
        "uniform": f" {fit.mean * (1 - fit.spread):.3g} to {fit.mean * (1 + fit.spread):.3g} s",
        "lognormal": f", sd {fit.mean * fit.spread:.3g} s",
    }
    misfit = ", describes them poorly" if fit.p < duration_fits.REJECTED else ""
    return f"{fit.family}{spread.get(fit.family, '')}{misfit}"


def _fit_delays(fitting: Fitting) -> motion_fits.DelayFit | None:
    order = fitting.log.samples.order
    if not order.any():
        order = (fitting.log.samples.load > 0).astype(np.int32)
    if not order.any():
        fitting.unsaid.append("faults.delays: without orders and loads, idle robots look delayed")
        return None
    error, shortest = duration_fits.stamp_error(fitting.gaps), fitting.thresholds.shortest_delay_s
    fit = motion_fits.fit_delays(fitting.track, order, fitting.usual, error, shortest)
    key = "faults.delays"
    if not fitting.has_enough(key, fit.rate.n, MIN_DELAYS, "delay") or fit.length is None:
        return None
    if not fitting.is_long_enough(key, fit.length.value):
        return None
    observed = f"{fit.rate.n:,} delays"
    fitting.add(Estimate(f"{key}.probability", "/h", None, fit.rate.scaled(HOUR), observed))
    remark = f"shortest counted {shortest:g} s"
    fitting.add(Estimate(f"{key}.ticks", "s", None, fit.length, observed, remark))
    return fit


def _fit_breakdowns(fitting: Fitting) -> tuple[duration_fits.DurationFit | None, bool]:
    gaps = duration_fits.gap_quantiles(fitting.gaps), duration_fits.stamp_error(fitting.gaps)
    breakdowns = motion_fits.fit_breakdowns(fitting.track, *gaps)
    rate = breakdowns.rate
    low, high = (HOUR * one for one in (rate.low, rate.high))
    bounds = f"{1 / high:,.3g} to {1 / low:,.3g} h" if low else f"above {1 / high:,.3g} h"
    if rate.n < MIN_BREAKDOWNS:
        fitting.unsaid.append(
            f"faults.mtbf: {rate.n:,} of at least {count(MIN_BREAKDOWNS, 'breakdown')}; {bounds}"
        )
        return None, False
    mtbf = FittedValue(1 / (rate.value * HOUR), 1 / high, 1 / low, rate.n)
    fitting.add(Estimate("faults.mtbf", "h", None, mtbf, f"{rate.n:,} breakdowns"))
    if breakdowns.repairs.n < MIN_BREAKDOWNS:
        return None, breakdowns.towed > 0
    fit = duration_fits.fit_durations(breakdowns.repairs)
    key = "faults.repair_time" if breakdowns.towed else "faults.repair_in_place"
    fitting.add_duration(key, None, fit, "repairs")
    return fit, breakdowns.towed > 0


def _fit_battery(fitting: Fitting, turns: Array) -> tuple[battery_fits.ChargeStep, ...]:
    """Fit energy use; return the steps of the charging rate."""
    track, samples = fitting.track, fitting.log.samples
    charge = samples.charge
    if np.isnan(charge).all() or np.nanmax(charge) == np.nanmin(charge):
        fitting.unsaid.append("battery: the log shows no change of charge")
        return ()
    logged = float(np.median(np.bincount(samples.robot, track.elapsed * track.usable)))
    if logged < MIN_BATTERY_S:
        hours = math.floor(100 * logged / HOUR) / 100
        fitting.unsaid.append(f"battery: {hours:g} h of at least 2 h a robot")
        return ()
    kind, seconds = fitting.kind, {name: fitting.seconds(name) for name in ("pick", "drop")}
    own = {name: one[kind] for name, one in seconds.items()}
    states = battery_fits.state_seconds(track, fitting.usual, turns[kind], own)
    error = fitting.error
    errors = {name: (error(name), error(name)) for name in ("turn", *seconds)}
    errors["move"] = error("move.empty"), error("move.loaded")
    fit = battery_fits.fit_drains(track, states, errors)
    if fit is None:
        least = battery_fits.MIN_WINDOWS
        fitting.unsaid.append(f"battery.drain: the charge changes in fewer than {least} stretches")
    battery = fitting.types[0].battery
    shortest = {"turn": float(turns.min()), **{k: float(one.min()) for k, one in seconds.items()}}
    for name, drain in (fit.drains if fit else {}).items():
        key = f"battery.drain.{name}"
        if not fitting.is_long_enough(key, shortest.get(name, math.inf)):
            continue
        if drain.high - drain.low > battery_fits.MAX_INTERVAL * drain.value:
            low, high = drain.low * HOUR, drain.high * HOUR
            text = f"{key}: {low:.3g} to {high:.3g} %/h, not separable from other states"
            fitting.unsaid.append(text)
            continue
        present = getattr(battery.drain, name) * HOUR / fitting.tick if battery else None
        is_joint = fit is not None and fit.is_joint and name in battery_fits.PICK_AND_DROP
        remark = "picks and drops together" if is_joint else ""
        observed = f"{drain.n:,} windows"
        fitting.add(Estimate(key, "%/h", present, drain.scaled(HOUR), observed, remark))
    if fit and fit.loaded_factor:
        key, factor = "battery.drain.loaded_factor", fit.loaded_factor
        present = battery.drain.loaded_factor if battery else None
        fitting.add(Estimate(key, "", present, factor, f"{factor.n:,} windows"))
    steps = battery_fits.fit_charging(track)
    if not steps:
        fitting.unsaid.append("battery.charge_rate: less than a minute of charging")
    return steps
