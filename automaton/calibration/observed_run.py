"""A log of real robots as a recording: an observed run, which can be watched like a simulated one.

It has the floor and the fleet of a scenario, and as orders the orders or the loads of the log, each
released when it is first named. It has no decisions and no digests.
"""

from __future__ import annotations

import datetime
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from automaton.calibration.log_on_floor import placed
from automaton.calibration.motion_fits import observed_pace
from automaton.calibration.robot_timelines import (
    ObservedFleet,
    RobotTimeline,
    Ways,
    absent_robot,
    timeline_of,
)
from automaton.calibration.state_log import ORDER_PAUSE_MS, StateLog, numbers_of_robots
from automaton.engine.state import NIL, Array
from automaton.errors import InputError
from automaton.recording.contents import LAST_TICK
from automaton.recording.recorder import ObservedRecorder
from automaton.runs.headless import Outcome, outcome_of
from automaton.scenario.order_lines import plain_data
from automaton.scenario.schema import LAYER_NAMES, Scenario, Units
from automaton.world.resolve import Resolved, choose_strategies

MAX_OBSERVED_TICKS: Final = 20_000_000
MAX_ROBOT_TICKS: Final = 1_000_000_000  # ticks of all robots
MAX_ORDERS: Final = 200_000
# Checked by name, never asked.
STRATEGIES: Final = {"allocation": "independent", "routing": "shortest", "right_of_way": "wait"}
DAY_MS: Final = 86_400_000
FIRST_DAY: Final = datetime.datetime(1970, 1, 1)
NOT_OBSERVED: Final = (  # of the scenario: what was not observed
    *("pods", "faults", "streets", "floor", "areas", "world", "measure", "stations"),
    *("refine", "decide", "information"),
)


class ObservedRun(NamedTuple):
    """An observed run that was written."""

    simulation: Any  # automaton.runs.simulation.Simulation, at its last tick
    robots: int  # that sent messages
    jumps: int  # messages that find a robot elsewhere than the last one leads
    off_floor: int  # messages
    left_out: int  # orders and loads beyond MAX_ORDERS

    def outcome(self) -> Outcome:
        """The metrics of the run, as those of a simulated one."""
        return outcome_of(self.simulation)


def write_observed_run(log: StateLog, resolved: Resolved, path: Path) -> ObservedRun:
    """Write a log as a recording. Raises InputError."""
    resolved = resolved.unrefined
    track = placed(log, resolved.floor_plan, resolved.scenario.units)
    begin, tick_ms = _time_of_tick_0(log, resolved.scenario.units)
    tick = np.rint((log.samples.time - begin) / tick_ms).astype(np.int64)
    robots, ticks = resolved.scenario.fleet.robots, int(tick.max())
    if len(log.robots) > robots:
        raise InputError(
            f"the log has {len(log.robots):,} robots, but the scenario only {robots:,}; set "
            f"fleet.robots={len(log.robots)}"
        )
    numbers = numbers_of_robots(log.robots, robots).tolist()
    if ticks > MAX_OBSERVED_TICKS or ticks * robots > MAX_ROBOT_TICKS:
        days = (int(log.samples.time.max()) - begin) / DAY_MS
        raise InputError(
            f"the messages span {days:,.1f} days, more than an observed run holds; leave out those with "
            "wrong stamps, or split the log"
        )
    demand = _demand_of(log, tick)
    durations = resolved.scenario.durations
    pace, turn = observed_pace(track, tick_ms / 1000, durations.moves, durations.turns[0])
    resolved = _observed(resolved, demand, log, begin, turn)
    fleet = ObservedFleet(
        *(track, tick, demand.order, demand.load, Ways(resolved.floor_plan)),
        *(pace, turn, max(ticks, 1), ORDER_PAUSE_MS / tick_ms),
    )
    lines = _timelines(fleet, numbers, robots)
    changes = _sorted_changes([line.changes for line in lines])
    at_start = np.searchsorted(changes[:, 0], 1)
    observed = {
        "first": changes[:at_start],
        "robots": names_of(log, numbers, robots),
        "log": tuple(log.counts.sentences()),
        # Between two messages, and in a move, the time at which a robot leaves a cell is a guess.
        "gap": max(_gap_of(log, tick), 2 * max(durations.moves)),
    }
    with ObservedRecorder(path, resolved, observed) as file:
        file.write_ticks(np.stack([line.executed for line in lines], axis=1), changes[at_start:])
    jumps = sum(line.jumps for line in lines)
    return ObservedRun(file.shown, len(log.robots), jumps, track.off_floor, demand.left_out)


def _time_of_tick_0(log: StateLog, units: Units) -> tuple[int, float]:
    """The stamp of tick 0, and milliseconds in a tick: that of units.clock on the day of the log."""
    first, tick_ms = int(log.samples.time.min()), float(1000 * units.scale.tick_seconds)
    clock, begin = units.scale.clock, 0
    if clock is not None:
        days = 0 if clock.day is None else clock.day - FIRST_DAY.toordinal()
        begin = round(1000 * (clock.seconds - (clock.offset or 0))) + days * DAY_MS
    if 0 <= first - begin < DAY_MS:
        return begin, tick_ms
    return first // 1000 * 1000, tick_ms


def names_of(log: StateLog, numbers: list[int], robots: int) -> tuple[str, ...]:
    """The name of each robot of the run; "" for one that sends no message."""
    names = dict(zip(numbers, log.robots, strict=True))
    return tuple(names.get(number, "")[:100] for number in range(robots))


class ObservedDemand(NamedTuple):
    """The orders of a log, and its loads without orders, as orders of a run."""

    release: Array  # (m,) tick in which each is first named
    order: Array  # (n,) of each message, or NIL
    load: Array  # (n,) likewise
    left_out: int


def _gap_of(log: StateLog, tick: Array) -> int:
    """Ticks from one message of a robot to the next, usually."""
    gaps = np.diff(tick)[log.usable[:-1]]
    return max(1, int(np.median(gaps))) if len(gaps) else 1


def _demand_of(log: StateLog, tick: Array) -> ObservedDemand:
    """The orders of a run; a load belongs to the order for which it is carried, and each carry of a load
    without one is an order."""
    samples = log.samples
    order = samples.order.astype(np.int64) - 1
    load = _known_before(samples.load, samples.robot).astype(np.int64) - 1
    # A load belongs to the order for which it was taken up, also when its robot has another one.
    begins = np.flatnonzero(np.diff(load, prepend=-2) | np.diff(samples.robot, prepend=NIL))
    orders = len(log.orders)
    of_carry = np.where(order[begins] != NIL, order[begins], orders + np.arange(len(begins)))
    load = np.where(load < 0, NIL, np.repeat(of_carry, np.diff(begins, append=len(load))))
    # The last entry is that of NIL.
    released = np.full(orders + len(begins) + 1, LAST_TICK, np.int64)
    for named in (order, load):
        np.minimum.at(released, named, tick)
    used = np.unique((order, load))
    used = used[used != NIL]
    used = used[np.argsort(released[used], kind="stable")]
    held, number = used[:MAX_ORDERS], np.full(len(released), NIL, np.int64)
    number[held] = np.arange(len(held))
    return ObservedDemand(released[held], number[order], number[load], len(used) - len(held))


def _known_before(values: Array, robot: Array) -> Array:
    """(n,) the last known value up to each message of a robot; 0 before the first. NIL: not known."""
    at = np.where(values != NIL, np.arange(len(values)), 0)
    begins = np.flatnonzero(np.diff(robot, prepend=NIL))
    at = np.maximum.accumulate(at)
    first = np.repeat(begins, np.diff(begins, append=len(values)))
    known: Array = np.where((at >= first) & (values[at] != NIL), values[at], 0)
    return known


def _observed(
    resolved: Resolved, demand: ObservedDemand, log: StateLog, begin: int, turn: int
) -> Resolved:
    """The scenario of an observed run, with the ticks of a turn that the log shows."""
    data = {
        key: value
        for key, value in plain_data(resolved.scenario).items()
        if key not in NOT_OBSERVED
    }
    x, y = resolved.floor_plan.xy(int(np.flatnonzero(resolved.floor_plan.drivable)[0]))
    clock = FIRST_DAY + datetime.timedelta(milliseconds=begin)
    data["name"] = f"{resolved.scenario.name} (observed)"
    data["units"] = {**data["units"], "clock": clock.isoformat(" ", "seconds")}
    releases = demand.release.tolist() or [LAST_TICK]  # a list holds an order at least
    data["orders"] = {"list": [{"stops": [{"at": [x, y]}], "release": at} for at in releases]}
    data["stop"] = {"when": "never", "max_duration": LAST_TICK}
    data["strategy"] = {**dict.fromkeys(LAYER_NAMES, "none"), **STRATEGIES}
    data["durations"] = {**data.get("durations", {}), "turn": turn}
    for kind in data["fleet"].get("types", []):
        kind.pop("strategy", None)
        kind.get("durations", {}).pop("turn", None)
    if not np.isfinite(log.samples.charge).any():
        data.pop("battery", None)
    scenario = msgspec.convert(data, Scenario)
    strategies = choose_strategies(scenario, resolved.floor_plan)
    return replace(
        resolved,
        scenario=scenario,
        strategies=strategies,
        own_allocations=(),
        days=(),
        coarse=None,
        observed=True,
    )


def _timelines(fleet: ObservedFleet, numbers: list[int], robots: int) -> list[RobotTimeline]:
    """The timeline of each robot of the run."""
    lines = [absent_robot(fleet.ticks)] * robots
    for number, rows in zip(numbers, fleet.track.log.rows_of_robots(), strict=True):
        lines[number] = timeline_of(fleet, rows)
    return lines


def _sorted_changes(changes: list[Array]) -> Array:
    """(k, 4) rows (tick, code, robot, value), by tick and code."""
    robots = np.repeat(np.arange(len(changes)), [len(rows) for rows in changes])
    tick, code, value = np.concatenate(changes).T
    order = np.lexsort((code, tick))
    return np.stack((tick, code, robots, value), axis=1)[order]
