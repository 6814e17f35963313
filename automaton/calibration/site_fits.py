"""Everything that a log says about a site: estimates by key of the scenario, and what cannot be said.

An estimate needs a least number of observations, and an operation must last longer than the usual gap
between two messages. What lacks either is named, without a number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration import battery_fits, duration_fits, motion_fits, stop_fits
from automaton.calibration.log_on_floor import placed
from automaton.calibration.motion_fits import FittedValue, MessagePairs, RobotTracks
from automaton.calibration.state_log import StateLog
from automaton.scenario.robot_types import RobotType, types_of
from automaton.units import count
from automaton.world.resolved import Resolved

Array = np.ndarray[Any, Any]

MIN_SPEED_PAIRS: Final = 100
MIN_TURNS: Final = 50
MIN_OPERATIONS: Final = 384  # mean to within 5 % if the standard deviation is half of it
MIN_DELAYS: Final = 400
MIN_BREAKDOWNS: Final = 10
MIN_BATTERY_S: Final = 7200.0  # of a robot
HOUR: Final = 3600.0
OPERATIONS: Final = {"pick": "pick", "drop": "drop", "handling": "serve"}  # action types of a log


class Thresholds(NamedTuple):
    """Guesses: how much slower than usual a slow stretch is, and the shortest delay that counts."""

    slow_share: float = stop_fits.SLOW_SHARE
    shortest_delay_s: float = stop_fits.SHORTEST_DELAY_S


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
    hours: float  # from the first message to the last
    estimates: dict[str, Estimate]
    unsaid: list[str]
    notes: list[str]
    operations: dict[str, duration_fits.DurationFit]  # those with an estimate
    delays: stop_fits.DelayFit | None
    repair: duration_fits.DurationFit | None
    towed: bool
    charging: tuple[tuple[float, float], ...]  # from percent, percent per second
    slow: list[stop_fits.SlowStretch]

    @property
    def extent(self) -> str:
        """How much was logged, as a sentence."""
        robots = count(self.robots, "robot")
        return f"{robots}, {self.hours:.3g} h, a message every {self.gap_s:.3g} s (median)"


class LoggedSite(NamedTuple):
    """A log on the floor of a scenario."""

    log: StateLog
    track: RobotTracks
    pairs: MessagePairs
    kind: Array  # (n,) type of the robot of each message
    types: tuple[RobotType, ...]
    gap: float
    metres: float  # side of a cell
    tick: float  # seconds
    error: float  # standard deviation of a duration through errors of the stamps


def site_of(log: StateLog, resolved: Resolved) -> LoggedSite:
    """The log on the floor of a scenario. Raises InputError."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    track = motion_fits.track_of(log, placed(log, floor_plan, scenario.units), floor_plan)
    types = types_of(scenario)
    gaps = np.diff(track.seconds)[log.usable[:-1]]
    return LoggedSite(
        log,
        track,
        motion_fits.pairs_of(track),
        type_of_robots(log.robots, scenario.fleet.counts)[log.samples.robot],
        types,
        motion_fits.message_gap(track.seconds, log.usable),
        float(scenario.units.scale.cell_metres),
        float(scenario.units.scale.tick_seconds),
        duration_fits.stamp_error(gaps),
    )


def type_of_robots(names: Sequence[str], counts: Sequence[int]) -> Array:
    """(robots,) the type of each robot: names that are numbers are those of the scenario, others are
    sorted."""
    robots = sum(counts)
    kinds = np.repeat(np.arange(len(counts)), counts) if counts else np.zeros(robots, np.int64)
    if all(name.isdecimal() and int(name) < len(kinds) for name in names):
        return np.array([kinds[int(name)] for name in names])
    places = np.argsort(np.argsort(np.array(names)))
    out: Array = kinds[np.minimum(places, len(kinds) - 1)] if len(kinds) else places * 0
    return out


class Fitting:
    """Collects estimates and what cannot be said."""

    def __init__(self, site: LoggedSite) -> None:
        self.site = site
        self.estimates: dict[str, Estimate] = {}
        self.unsaid: list[str] = []
        self.notes: list[str] = []
        # Usual speed at each message, in cells per second: fitted, else that of the scenario.
        self.usual = np.zeros(len(site.track.seconds))

    def has_enough(self, what: str, have: int, need: int, unit: str) -> bool:
        """Whether there are enough observations; if not, say so."""
        if have < need:
            self.unsaid.append(f"{what}: {have:,} of at least {count(need, unit)}")
        return have >= need

    def is_long_enough(self, what: str, seconds: float) -> bool:
        """Whether an operation lasts longer than the gap between messages; if not, say so."""
        gap = self.site.gap
        if seconds < gap:
            self.unsaid.append(f"{what}: shorter than the median gap between messages, {gap:.3g} s")
        return seconds >= gap

    def add(self, estimate: Estimate) -> None:
        """Take an estimate."""
        self.estimates[estimate.key] = estimate


def fit_site(
    site: LoggedSite,
    operations: Mapping[str, str] = OPERATIONS,
    thresholds: Thresholds = USUAL_THRESHOLDS,
) -> SiteFits:
    """All estimates of a log; `operations`: action types by pick, drop and handling."""
    fitting = Fitting(site)
    _fit_speeds(fitting)
    turns = _fit_turns(fitting)
    durations = _fit_operations(fitting, operations)
    slow = stop_fits.slow_stretches(
        site.pairs, site.track, fitting.usual, site.metres, thresholds.slow_share
    )
    delays = _fit_delays(fitting, thresholds.shortest_delay_s)
    repair, towed = _fit_breakdowns(fitting)
    charging = _fit_battery(fitting, turns, durations)
    seconds = site.track.seconds
    return SiteFits(
        site.gap,
        len(site.log.robots),
        float(seconds.max() - seconds.min()) / HOUR if len(seconds) else 0.0,
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


def type_key(site: LoggedSite, kind: int, key: str) -> str:
    """The key of a value of a type of robots."""
    name = site.types[kind].name
    return f"fleet.types.{name}.{key}" if name else key


def _fit_speeds(fitting: Fitting) -> None:
    site = fitting.site
    for kind, robot_type in enumerate(site.types):
        moves = robot_type.durations.moves
        for loaded, ticks in enumerate((moves.empty, moves.loaded)):
            present = 1 / (ticks * robot_type.move_time_factor * site.tick)  # cells per second
            chosen = (site.kind == kind) & (site.track.loaded == loaded)
            fitting.usual[chosen] = present
            key = type_key(site, kind, f"durations.move.{'loaded' if loaded else 'empty'}")
            pairs = int((site.pairs.free & chosen).sum())
            if not fitting.has_enough(key, pairs, MIN_SPEED_PAIRS, "pair of messages"):
                continue
            speeds = motion_fits.speed_windows(site.track, site.pairs, chosen)
            if not fitting.has_enough(key, len(speeds), 5, "straight drive"):
                continue
            fit = motion_fits.usual_speed(speeds)
            fitting.usual[chosen] = fit.value
            _name_slow_robots(fitting, chosen, fit.value, key)
            fitting.add(
                Estimate(
                    key,
                    "m/s",
                    present * site.metres,
                    fit.scaled(site.metres),
                    f"{pairs:,} pairs",
                )
            )


def _name_slow_robots(fitting: Fitting, chosen: Array, usual: float, key: str) -> None:
    """Note the robots whose speed differs from that of their type."""
    site = fitting.site
    for robot, name in enumerate(site.log.robots):
        own = chosen & (site.track.robot == robot)
        if (site.pairs.free & own).sum() < MIN_SPEED_PAIRS:
            continue
        speeds = motion_fits.speed_windows(site.track, site.pairs, own)
        if len(speeds) < MIN_TURNS:
            continue
        fit = motion_fits.usual_speed(speeds)
        if fit.high < usual * (1 - stop_fits.SLOW_SHARE) or fit.low > usual * (
            1 + stop_fits.SLOW_SHARE
        ):
            speed, rest = fit.value * site.metres, usual * site.metres
            fitting.notes.append(f"robot {name}: {speed:.3g} m/s, others {rest:.3g} m/s ({key})")


def _fit_turns(fitting: Fitting) -> Array:
    """Fit the turns; return the seconds of a turn of each type, fitted or of the scenario."""
    site = fitting.site
    corners = motion_fits.corners_of(site.track, fitting.usual)
    turns = np.zeros(len(site.types))
    for kind, robot_type in enumerate(site.types):
        if robot_type.kinematics == "omni":
            continue
        present = robot_type.turns.empty * site.tick
        turns[kind] = present
        key = type_key(site, kind, "durations.turn")
        seconds = corners.seconds[site.kind[corners.message] == kind]
        if not fitting.has_enough(key, len(seconds), MIN_TURNS, "turn"):
            continue
        fit = motion_fits.median_fit(motion_fits.core(seconds, -1))
        if fitting.is_long_enough(key, fit.value):
            turns[kind] = fit.value
            fitting.add(Estimate(key, "s", present, fit, f"{len(seconds):,} turns"))
    return turns


def _fit_operations(
    fitting: Fitting, operations: Mapping[str, str]
) -> dict[str, duration_fits.DurationFit]:
    site = fitting.site
    out = {}
    for name, action in operations.items():
        if action not in site.log.actions:
            fitting.unsaid.append(f"durations.{name}: the log has no action {action}")
            continue
        chosen = site.log.samples.action == site.log.actions.index(action) + 1
        identity = site.log.samples.action_id
        data = duration_fits.operations_of(site.track.seconds, site.log.usable, identity, chosen)
        if not fitting.has_enough(f"durations.{name}", data.n, MIN_OPERATIONS, "operation"):
            continue
        fit = duration_fits.fit_durations(data)
        if len(data.gaps) and not fitting.is_long_enough(f"durations.{name}", fit.mean):
            continue
        out[name] = fit
        durations = site.types[0].durations
        present = None
        if name != "handling":
            present = getattr(durations, name) * site.tick
        fitting.add(
            Estimate(
                f"durations.{name}",
                "s",
                present,
                FittedValue(fit.mean, fit.low, fit.high, fit.n),
                f"{fit.n:,} times",
                family_words(fit),
            )
        )
    return out


def family_words(fit: duration_fits.DurationFit) -> str:
    """The family of a distribution, and how well it describes the durations."""
    spread = {
        "uniform": f" {fit.mean * (1 - fit.spread):.3g} to {fit.mean * (1 + fit.spread):.3g} s",
        "lognormal": f", sd {fit.mean * fit.spread:.3g} s",
    }
    misfit = ", describes them poorly" if fit.p < duration_fits.REJECTED else ""
    return f"{fit.family}{spread.get(fit.family, '')}{misfit}"


def _fit_delays(fitting: Fitting, shortest: float) -> stop_fits.DelayFit | None:
    site = fitting.site
    order = site.log.samples.order
    order = order if order.any() else np.ones_like(order)
    fit = stop_fits.fit_delays(site.track, order, fitting.usual, site.error, shortest)
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
    site = fitting.site
    gaps = duration_fits.gap_quantiles(np.diff(site.track.seconds)[site.log.usable[:-1]])
    breakdowns = stop_fits.fit_breakdowns(site.track, site.log.samples.down, gaps, site.error)
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
    interval = FittedValue(fit.mean, fit.low, fit.high, fit.n)
    fitting.add(Estimate(key, "s", None, interval, f"{fit.n:,} repairs", family_words(fit)))
    return fit, breakdowns.towed > 0


def _fit_battery(
    fitting: Fitting, turns: Array, durations: Mapping[str, duration_fits.DurationFit]
) -> tuple[tuple[float, float], ...]:
    """Fit energy use; return the steps of the charging rate."""
    site, samples = fitting.site, fitting.site.log.samples
    charge = samples.charge
    if np.isnan(charge).all() or np.nanmax(charge) == np.nanmin(charge):
        fitting.unsaid.append("battery: the log shows no change of charge")
        return ()
    seconds = np.append(np.diff(site.track.seconds), 0.0)
    by_robot = np.bincount(samples.robot, seconds * site.track.usable)
    logged = float(np.median(by_robot))
    if logged < MIN_BATTERY_S:
        fitting.unsaid.append(f"battery: {logged / HOUR:.2g} h of at least 2 h a robot")
        return ()
    usual_durations = site.types[0].durations
    known = {
        name: durations[name].mean
        if name in durations
        else getattr(usual_durations, name) * site.tick
        for name in ("pick", "drop")
    }
    states = battery_fits.state_seconds(site.track, fitting.usual, turns[site.kind], known)
    off = (samples.charging == 1) | samples.down
    fit = battery_fits.fit_drains(site.track, states, charge, off)
    battery = site.types[0].battery
    for name, drain in (fit.drains if fit else {}).items():
        shortest = {"turn": float(turns.min()), **known}.get(name, math.inf)
        if not fitting.is_long_enough(f"battery.drain.{name}", shortest):
            continue
        present = getattr(battery.drain, name) * HOUR / site.tick if battery else None
        key = f"battery.drain.{name}"
        fitting.add(Estimate(key, "%/h", present, drain.scaled(HOUR), f"{drain.n:,} windows"))
    if fit and fit.loaded_factor:
        present = battery.drain.loaded_factor if battery else None
        observed = f"{fit.loaded_factor.n:,} windows"
        fitting.add(
            Estimate("battery.drain.loaded_factor", "", present, fit.loaded_factor, observed)
        )
    steps = battery_fits.fit_charging(site.track, charge, samples.charging == 1)
    if not steps:
        fitting.unsaid.append("battery.charge_rate: less than a minute of charging")
    return steps
