"""The events of a run so far, and a few metrics over time.

Both are limited in size: when they grow too long, every second row of the metrics and the oldest events
are dropped.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from automaton.engine import observation as codes
from automaton.engine.observation import (
    CURVE_COLUMNS,
    EVENT_DEADLOCK,
    EVENT_ZONES_REDESIGNED,
)
from automaton.engine.state import BATTERY_PERCENT, Array
from automaton.runs.illegal_decisions import RULE_NAMES, IllegalDecision
from automaton.runs.simulation import Simulation

EVENT_FIELDS = 5
MAX_EVENTS: Final = 500_000  # 10 MB
MAX_TICKS_KEPT: Final = 1000  # of deadlocks and of redesigns
STRIP_BANDS: Final = 4  # bands of rows of the floor whose lost time the timeline shows
STRIP_SAMPLES: Final = 1024
STRIP_TICKS: Final = 8  # between two samples, until there are too many
MAX_CURVE_ROWS: Final = 1 << 18  # 3 MB; shorter runs keep a row for every tick


class Event(NamedTuple):
    """One event; `subject` is an order or NIL, `value` depends on the kind (world.waiting)."""

    tick: int
    code: int
    robot: int
    subject: int
    value: int


class Log(NamedTuple):
    """The stored rows, which are immutable."""

    rows: Array  # (N, columns) int32; the first column holds ticks, ascending
    dropped: int  # number of earlier rows that were dropped

    def index_at(self, tick: int) -> int:
        """The number of rows up to and including a tick."""
        return int(np.searchsorted(self.rows[:, 0], tick, side="right"))


class AppendLog:
    """An array to which rows are appended; readers in other threads see complete rows only.

    Beyond `most` rows, the older half is dropped.
    """

    def __init__(self, columns: int, most: int) -> None:
        self._most = most
        self._room = np.zeros((1024, columns), np.int32)
        self.log = Log(self._room[:0], 0)

    def append(self, rows: Array) -> None:
        """Add rows at the end."""
        kept, dropped = self.log
        count = len(kept) + len(rows)
        if count <= len(self._room):
            self._room[len(kept) : count] = rows
        else:
            going = count - self._most // 2 if count > self._most else 0
            whole = np.concatenate((kept, rows))[going:]
            count, dropped = len(whole), dropped + going
            self._room = np.zeros(
                (max(count, min(2 * count, self._most)), whole.shape[1]), np.int32
            )
            self._room[:count] = whole
        self.log = Log(self._room[:count], dropped)


class Curve(NamedTuple):
    """Metrics over time: row k belongs to tick (k + 1) * every."""

    rows: Array  # (N, CURVE_COLUMNS) int32; columns as in automaton.engine.observation
    every: int  # ticks between rows, a power of two
    ticks: int  # the last tick covered

    def at(self, ticks: Array, column: int) -> Array:
        """A metric at these ticks, from the last row at or before each tick.

        0 before the first row.
        """
        row = np.minimum(np.asarray(ticks) // self.every, len(self.rows)) - 1
        if not len(self.rows):
            return np.zeros(row.shape, np.int64)
        found: Array = np.where(row >= 0, self.rows[np.maximum(row, 0), column], 0).astype(np.int64)
        return found

    def until(self, tick: int) -> Curve:
        """The curve as of a tick."""
        tick = min(tick, self.ticks)
        return Curve(self.rows[: tick // self.every], self.every, tick)


class DownsampledSeries:
    """A curve to which a row is appended for each tick; it stores at most `most` rows."""

    def __init__(self, columns: int, most: int) -> None:
        self._most = most
        self._rows = AppendLog(columns, most)
        self.curve = Curve(self._rows.log.rows, 1, 0)

    def append(self, rows: Array) -> None:
        """Add the rows of the next ticks."""
        _, every, ticks = self.curve
        end = ticks + len(rows)
        while end // every > self._most:
            thin = self._rows.log.rows[1::2]
            self._rows = AppendLog(thin.shape[1], self._most)
            self._rows.append(thin)
            every *= 2
        first = every - 1 - ticks % every  # the first row whose tick is a multiple of `every`
        self._rows.append(rows[first::every])
        self.curve = Curve(self._rows.log.rows, every, end)


class EventHistory:
    """Events and metrics, to be passed to a simulation as `on_observe`; repeated ticks count once."""

    def __init__(self) -> None:
        self._events = AppendLog(EVENT_FIELDS, MAX_EVENTS)
        self._deadlocks = AppendLog(1, MAX_TICKS_KEPT)
        self._redesigns = AppendLog(1, MAX_TICKS_KEPT)
        self._curve = DownsampledSeries(CURVE_COLUMNS, MAX_CURVE_ROWS)

    def __call__(self, simulation: Simulation) -> None:
        """Take the contents of the observation buffers, and empty them."""
        observation, last = simulation.observation, int(simulation.world.clock.tick)
        rows = int(observation.count.curve_rows)
        fresh = min(rows, last - self.known)
        if fresh > 0:
            self._curve.append(observation.curve[rows - fresh : rows])
            events = observation.events[: observation.count.events]
            events = events[events[:, 0] > last - fresh]
            self._events.append(events)
            self._deadlocks.append(events[events[:, 1] == EVENT_DEADLOCK, :1])
            self._redesigns.append(events[events[:, 1] == EVENT_ZONES_REDESIGNED, :1])
        simulation.empty_observation()

    @property
    def known(self) -> int:
        """The last tick covered."""
        return self._curve.curve.ticks

    @property
    def log(self) -> Log:
        """The stored events by ascending tick: (N, 5) int32: tick, code, robot, subject, value."""
        return self._events.log

    @property
    def events(self) -> Array:
        """The rows of the log."""
        return self._events.log.rows

    @property
    def deadlocks(self) -> Array:
        """(N,) int32: the latest ticks with deadlocks."""
        ticks: Array = self._deadlocks.log.rows[:, 0]
        return ticks

    @property
    def redesigns(self) -> Array:
        """(N,) int32: the latest ticks in which stations changed their zones."""
        ticks: Array = self._redesigns.log.rows[:, 0]
        return ticks

    @property
    def curve(self) -> Curve:
        """The numbers of waiting and working robots and of deliveries over time."""
        return self._curve.curve

    def event(self, index: int) -> Event:
        """One event of the list."""
        return event_of(self.events[index])

    def index_at(self, tick: int) -> int:
        """The number of stored events up to and including a tick."""
        return self.log.index_at(tick)


class LostByRows:
    """The robot ticks lost in bands of rows of the floor, over time.

    Samples are at multiples of a number of ticks, which doubles when there are too many, and at the end.
    """

    def __init__(self, cells: int, stride: int) -> None:
        """`cells`: of the floor with its border; `stride`: cells in a row."""
        self._stride = stride
        height = cells // stride - 2  # without the border
        self._starts = 1 + np.unique(np.arange(STRIP_BANDS) * height // STRIP_BANDS)
        self._log = AppendLog(1 + len(self._starts), 2 * STRIP_SAMPLES)
        self._every = STRIP_TICKS

    def next_sample(self, tick: int) -> int:
        """The tick of the next sample after a tick."""
        return (tick // self._every + 1) * self._every

    @property
    def rows(self) -> Array:
        """(N, 1 + bands) int32: a tick, and the sum of each band, from the top, up to there."""
        return self._log.log.rows

    def look(self, simulation: Simulation, is_end: bool) -> None:
        """Take a sample, if one is due and later than the last one; `is_end`: of the run."""
        before, log = self.rows, self._log
        if simulation.tick % self._every and not is_end:
            return
        if len(before) and before[-1, 0] >= simulation.tick:
            return
        if len(before) >= STRIP_SAMPLES:
            self._every *= 2
            log = AppendLog(before.shape[1], 2 * STRIP_SAMPLES)
            log.append(before[before[:, 0] % self._every == 0])
        lost = simulation.observation.lost_ticks_by_cell[:, codes.LOST_EVER].reshape(
            -1, self._stride
        )
        sums = np.add.reduceat(lost.sum(1, dtype=np.int64)[:-1], self._starts)
        sample = np.minimum((simulation.tick, *sums), np.iinfo(np.int32).max)
        log.append(sample.reshape(1, -1))
        self._log = log  # complete: other threads read it meanwhile


def event_of(row: Array) -> Event:
    """A row of a log."""
    return Event(*(int(value) for value in row))


# Events in words, and the groups by which they are selected.


EVENT_GROUPS: Final = {  # groups of the list of events: name and codes
    "deliveries": (codes.EVENT_DELIVERED,),
    "deadlocks": (codes.EVENT_WAIT_CYCLE, codes.EVENT_DEADLOCK),
    "retreats": (codes.EVENT_RETREATED,),
    "picks": (codes.EVENT_PICKED, codes.EVENT_DROPPED, codes.EVENT_VISITED),
    "orders": (codes.EVENT_ORDER_TAKEN, codes.EVENT_ORDER_RETURNED),
    "parking bays": (codes.EVENT_LEFT_BAY, codes.EVENT_PARKED),
    "charging": (codes.EVENT_CHARGING,),
    "faults": (codes.EVENT_DEPLETED, codes.EVENT_FAILED, codes.EVENT_TOWED, codes.EVENT_BACK),
    "illegal": (codes.EVENT_ILLEGAL_DECISION,),
    "parts": (codes.EVENT_JOB_DONE, codes.EVENT_PART_FINISHED),
    "zones": (codes.EVENT_ZONES_REDESIGNED,),
}
TEXTS: Final = {
    codes.EVENT_ORDER_TAKEN: "takes order {subject}",
    codes.EVENT_PICKED: "picks up load {subject}",
    codes.EVENT_DROPPED: "drops load {subject}",
    codes.EVENT_DELIVERED: "delivers load {subject}",
    codes.EVENT_LEFT_BAY: "leaves its parking bay",
    codes.EVENT_PARKED: "is parked",
    codes.EVENT_RETREATED: "retreats {value} step{s}",
    codes.EVENT_ORDER_RETURNED: "returns order {subject}",
    codes.EVENT_CHARGING: "charges from {percent}",
    codes.EVENT_DEPLETED: "has an empty battery",
    codes.EVENT_FAILED: "breaks down",
    codes.EVENT_TOWED: "is towed",
    codes.EVENT_BACK: "is back",
    codes.EVENT_WAIT_CYCLE: "wait cycle of {value} closes",
    codes.EVENT_DEADLOCK: "deadlock of {value} robots",
    codes.EVENT_JOB_DONE: "station {station} is done with part {subject}",
    codes.EVENT_PART_FINISHED: "part {subject} is finished",
    codes.EVENT_ZONES_REDESIGNED: "zones redesigned: {value} station{s}",
    codes.EVENT_VISITED: "does a stop of order {subject}",
}
TRIP_TEXTS: Final = TEXTS | {  # if orders are trips of pods
    codes.EVENT_ORDER_TAKEN: "takes trip {subject}",
    codes.EVENT_PICKED: "picks up the pod of trip {subject}",
    codes.EVENT_DELIVERED: "stores the pod of trip {subject}",
    codes.EVENT_ORDER_RETURNED: "returns trip {subject}",
    codes.EVENT_VISITED: "was served for trip {subject}",
}
SUBJECTS: Final = (
    codes.EVENT_ORDER_TAKEN,
    codes.EVENT_PICKED,
    codes.EVENT_DROPPED,
    codes.EVENT_DELIVERED,
    codes.EVENT_ORDER_RETURNED,
    codes.EVENT_VISITED,
)


def event_words(
    event: Event, trips: bool = False, explain: Callable[..., IllegalDecision] | None = None
) -> str:
    """An event in a few words, without the robot; `explain` names an illegal decision in full."""
    if event.code == codes.EVENT_ILLEGAL_DECISION:
        if explain is None:
            return f"illegal decision: {RULE_NAMES[event.subject]} {event.value}"
        decision = explain(event.tick, event.robot, event.subject, event.value)
        return f"illegal decision of {decision.layer}: {decision.words}"
    plural = "" if event.value == 1 else "s"
    percent = f"{event.value / BATTERY_PERCENT:.0f} %"
    words = {"subject": event.subject, "value": event.value, "s": plural, "percent": percent}
    words["station"] = event.value + 1
    return (TRIP_TEXTS if trips else TEXTS)[event.code].format(**words)
