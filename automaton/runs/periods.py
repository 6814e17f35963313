"""A run by hour or any other period: flow, what robots did, how busy stations and chargers were.

A run whose report has no periods is measured by period, too: the bottleneck depends on when a
resource was saturated. Runs of a sweep keep theirs by quarter of an hour, so that a report can show the
means of several runs by hour or another multiple.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.engine.state import (
    ACTION_CHARGE,
    ACTION_DELAYED,
    ACTION_DOWN,
    MOST_PERIODS,
    NIL,
    Array,
    World,
)
from automaton.errors import InputError
from automaton.runs.metric_sums import PERIOD_COLUMNS, TRAFFIC_SUMS
from automaton.runs.metrics import Counted, counted
from automaton.runs.progress import asked_orders, has_lines
from automaton.runs.task_metrics import Measured, summed
from automaton.scenario.quantities import TIME, Dimension, clock_text, read_amount
from automaton.units import exact_time
from automaton.world.resolved import Resolved

HOUR_S: Final = 3600
MAX_PERIODS: Final = 10_000
MAX_KEPT_PERIODS: Final = 1000  # of a run of a sweep; beyond it, its periods are hours
QUARTERS: Final = 4  # of an hour
MAX_PERIOD_TEXT: Final = 40  # of a period as text
MAX_LOOKS: Final = 64  # beyond which an interval doubles
FIRST_INTERVAL: Final = 256  # ticks


class Period(NamedTuple):
    """What went on in a stretch of a run. Numbers of robots are means over its ticks."""

    begin: int  # the tick before the first one
    end: int  # the last one
    name: str  # the clock time of `begin`, or its tick
    done: float  # orders; where pods are carried, lines
    backlog: float  # of the same, known and not done at the end
    late: float | None  # orders that were due and are late; None without due times
    on_orders: float
    in_traffic: float  # robots that lose time in traffic
    in_station_queues: float
    charging: float
    to_chargers: float  # robots that drive to chargers
    for_chargers: float  # robots that lose time on the way to chargers
    aside: float  # robots that drive without an order or a charger
    down: float
    delayed: float
    refused: float  # robots that lose time to illegal decisions
    idle: float  # robots without an order, parked, or off the floor
    stations: tuple[float, ...]  # share of the time in which each station works or serves
    station_queues: tuple[float, ...]  # mean number of robots
    station_parts: tuple[float, ...]  # mean number of waiting parts; () if none are processed
    chargers: tuple[float, ...]  # share of the time of its places in which robots charge
    charger_queues: tuple[float, ...]
    places: tuple[int, ...]  # robots that charge at each charger at once

    @property
    def charging_places(self) -> float:
        """How many places of chargers were taken."""
        return sum(share * many for share, many in zip(self.chargers, self.places, strict=True))

    @property
    def charger_share(self) -> float:
        """Share of the time of all places of chargers in which robots charged."""
        return self.charging_places / max(sum(self.places), 1)

    @property
    def ticks(self) -> int:
        """How many it has."""
        return self.end - self.begin

    def as_json(self) -> dict[str, Any]:
        """The period as an object."""
        return {name: list(v) if isinstance(v, tuple) else v for name, v in self._asdict().items()}


class PeriodMarks:
    """Keeps what a run has counted at the ends of periods.

    `ticks`: of a period; 0: short enough to show when a resource was saturated.
    """

    def __init__(self, ticks: int = 0) -> None:
        self.is_fixed = ticks > 0
        self.ticks = ticks or FIRST_INTERVAL
        self._marks: list[Counted] = []

    def next_mark(self, tick: int) -> int:
        """The tick of the next mark after a tick."""
        return (tick // self.ticks + 1) * self.ticks

    def look(self, run: Measured) -> None:
        """Keep what a run has counted by now, if a period ends."""
        tick = int(run.world.clock.tick)
        if tick % self.ticks or not tick:
            return
        self._marks.append(counted(run))
        period = run.world.time_use.period
        period[0] = min(int(period[0]) + 1, MOST_PERIODS - 1)
        if not self.is_fixed and len(self._marks) > MAX_LOOKS:
            self.ticks *= 2
            self._marks = [one for one in self._marks if one.tick % self.ticks == 0]

    def periods(self, run: Measured) -> list[Period]:
        """The periods of a run up to now; the last one may be shorter."""
        now = counted(run)
        return periods_of(run, [*(one for one in self._marks if one.tick < now.tick), now])


def ticks_of_period(resolved: Resolved, text: str | None) -> int:
    """Ticks of a period such as "15min" or "500"; None: an hour, or 0 where a tick is not a time.

    Raises InputError for a text that is neither a time nor a number of ticks.
    """
    scale = resolved.scenario.units.scale
    if text is None:
        seconds = exact_time(scale.tick)
        hour = 0 if seconds is None else max(1, round(HOUR_S / seconds))
        is_long = hour * MAX_PERIODS < resolved.scenario.stop.max_duration
        return 0 if is_long else hour
    if len(text) > MAX_PERIOD_TEXT:
        raise InputError(f"--every has {len(text):,} characters; it takes ticks or a time")
    if text.strip().isdecimal():
        ticks = Fraction(int(text) * resolved.scenario.refine)
    else:
        try:
            ticks = TIME.number(read_amount(text, (Dimension.TIME,)), scale)
        except InputError as error:
            raise InputError(f"--every: {error.message}") from None
    if ticks < 1:
        raise InputError(f"--every {text} is less than a tick")
    periods = resolved.scenario.stop.max_duration / ticks
    if periods > MAX_PERIODS:
        raise InputError(
            f"--every {text} makes {math.ceil(periods):,} periods of the longest run; at most "
            f"{MAX_PERIODS:,} are allowed"
        )
    return round(ticks)


def kept_period(resolved: Resolved) -> int:
    """Ticks of the periods that a run of a sweep keeps; 0 for none, where a tick is not a time."""
    hour, longest = ticks_of_period(resolved, None), resolved.scenario.stop.max_duration
    if not hour or longest > hour * MAX_KEPT_PERIODS:
        return 0
    has_quarters = hour % QUARTERS == 0 and longest <= hour * MAX_KEPT_PERIODS // QUARTERS
    return hour // QUARTERS if has_quarters else hour


def period_columns(periods: Sequence[Period]) -> dict[str, list[float]]:
    """The PERIOD_COLUMNS of periods; a column that is not measured is empty."""
    columns: dict[str, list[float]] = {}
    for name in PERIOD_COLUMNS:
        values = [getattr(one, name) for one in periods]
        if name == "stations":
            values = [sum(one) / len(one) if one else None for one in values]
        elif name == "chargers":
            values = [one.charger_share if one.chargers else None for one in periods]
        columns[name] = [] if None in values else [float(one) for one in values]
    return columns


def kept_periods(resolved: Resolved, columns: Mapping[str, Sequence[float]]) -> list[Period]:
    """The periods of a run from their PERIOD_COLUMNS, with all stations and chargers as one."""
    periods = []
    for k, begin in enumerate(columns["begin"]):
        row: dict[str, Any] = {
            name: values[k] if values else None for name, values in columns.items()
        }
        for name in ("stations", "chargers"):
            row[name] = () if row[name] is None else (row[name],)
        name = moment(resolved.unrefined, int(begin) // resolved.scenario.refine)
        row |= {"begin": int(begin), "end": int(row["end"]), "name": name}
        places = (1,) * len(row["chargers"])
        periods.append(
            Period(**row, station_queues=(), station_parts=(), charger_queues=(), places=places)
        )
    return periods


def mean_period(periods: Sequence[Period]) -> Period:
    """The mean of the same period of several runs, in which it may end at different ticks."""
    first, ticks = periods[0], sum(one.ticks for one in periods)
    mean: dict[str, Any] = {
        name: sum(getattr(one, name) for one in periods) / len(periods)
        for name in ("done", "backlog")
    }
    late = [one.late for one in periods if one.late is not None]
    mean["late"] = sum(late) / len(late) if late else None
    for name in PERIOD_COLUMNS[PERIOD_COLUMNS.index("on_orders") : -2]:
        mean[name] = sum(getattr(one, name) * one.ticks for one in periods) / ticks
    for name in ("stations", "chargers"):
        shares = [getattr(one, name) for one in periods]
        pairs = [zip(shares, periods, strict=True)] if first._asdict()[name] else []
        mean |= {name: tuple(sum(s[0] * one.ticks for s, one in pair) / ticks for pair in pairs)}
    return first._replace(end=first.begin + round(ticks / len(periods)), **mean)


def moment(resolved: Resolved, tick: int) -> str:
    """When a tick is: its clock time where the scenario has one, else the tick."""
    scale = resolved.scenario.units.scale
    if scale.clock is None:
        return f"tick {tick:,}"
    return clock_text(scale.clock, Fraction(tick) * scale.tick_seconds)


def periods_of(run: Measured, marks: list[Counted]) -> list[Period]:
    """The stretches between marks; the first one begins with tick 0."""
    world, resolved = run.world, run.resolved
    borders = np.array([0, *(mark.tick for mark in marks)])
    done, backlog = flow(world, borders)
    late, parts = late_orders(world, borders), waiting_parts(world, borders)
    places = world.chargers.places[: len(marks[-1].charger_busy)].astype(np.int64)
    periods = []
    for k, mark in enumerate(marks):
        before = marks[k - 1] if k else mark.none()
        ticks = max(mark.tick - before.tick, 1)
        actions = (mark.actions - before.actions) / ticks
        # Moves of this period that were undone, even later, and not those of earlier ones.
        apart = world.time_use.undone[before.period + 1 : min(mark.period + 1, MOST_PERIODS - 1)]
        undone = float(apart.sum()) - (mark.undone - before.undone)
        # From the last period that is counted apart on, moves count when they are undone.
        undone += mark.undone_late - before.undone_late

        def robots(
            *names: str, mark: Counted = mark, since: Counted = before, of: int = ticks
        ) -> float:
            return sum(mark.sums.get(one, 0) - since.sums.get(one, 0) for one in names) / of

        periods.append(
            Period(
                before.tick,
                mark.tick,
                moment(resolved, before.tick),
                int(done[k]),
                int(backlog[k]),
                None if late is None else int(late[k]),
                robots("on_orders") - undone / ticks,
                robots(*TRAFFIC_SUMS) + undone / ticks,
                robots("lost_station_queue"),
                float(actions[ACTION_CHARGE]),
                robots("driving_to_chargers"),
                robots("lost_charger_queue"),
                robots("driving_aside"),
                float(actions[ACTION_DOWN]),
                float(actions[ACTION_DELAYED]),
                robots("lost_illegal"),
                len(world.robots.cell) - float(actions.sum()),
                tuple(((mark.station_busy - before.station_busy) / ticks).tolist()),
                tuple(((mark.station_queue - before.station_queue) / ticks).tolist()),
                tuple(parts[k].tolist()),
                tuple(((mark.charger_busy - before.charger_busy) / places / ticks).tolist()),
                tuple(((mark.charger_queue - before.charger_queue) / ticks).tolist()),
                tuple(places.tolist()),
            )
        )
    return periods


def flow(world: World, borders: Array) -> tuple[Array, Array]:
    """Orders, or lines where there are any: done in each stretch, and open at its end."""
    if has_lines(world):
        release, done = world.lines.release_tick.astype(np.int64), world.lines.done.astype(np.int64)
    else:
        orders = asked_orders(world)
        release, done = (
            np.where(orders.is_known, orders.release, np.iinfo(np.int64).max),
            orders.done,
        )
    ends = np.maximum(done[(done != NIL) & (done <= borders[-1])], 1)
    in_stretch = summed(ends, np.ones(len(ends)), borders)
    known = np.searchsorted(np.sort(release), borders[1:], side="right")
    return in_stretch, known - np.cumsum(in_stretch)


def waiting_parts(world: World, borders: Array) -> Array:
    """(stretches, k): mean number of parts in the queue of each station; k is 0 if none are processed."""
    jobs, now = world.stations, borders[-1]
    if not len(jobs.part):
        return np.empty((len(borders) - 1, 0))
    came = np.where(jobs.arrival_tick == NIL, now, jobs.arrival_tick)
    begun = np.where(jobs.completion_tick == NIL, now, jobs.completion_tick - jobs.processing_time)
    serving = jobs.in_service != NIL
    job = jobs.in_service[serving]
    begun[job] = jobs.job_done_tick[serving] - jobs.processing_time[job]
    shape = len(borders) + 1, len(jobs.slot)

    def since(ticks: Array) -> Array:
        """(borders, k): at each border, the ticks that have passed since these, of all jobs."""
        at = np.searchsorted(borders, ticks) * shape[1] + jobs.station
        count, total = (
            np.bincount(at, weights, math.prod(shape)).reshape(shape)[:-1].cumsum(0)
            for weights in (None, ticks)
        )
        passed: Array = borders[:, None] * count - total
        return passed

    waited = np.diff(since(came) - since(begun), axis=0)
    means: Array = waited / np.maximum(np.diff(borders), 1)[:, None]
    return means


def late_orders(world: World, borders: Array) -> Array | None:
    """Orders that came to be late in each stretch: due in it and not done by then."""
    orders = asked_orders(world)
    has_due = orders.is_known & (orders.due < np.iinfo(np.int32).max)
    if not has_due.any():
        return None
    due, done = orders.due[has_due], orders.done[has_due]
    is_late = (due < borders[-1]) & ((done == NIL) | (done > due))
    return summed(np.maximum(due[is_late] + 1, 1), np.ones(int(is_late.sum())), borders)
