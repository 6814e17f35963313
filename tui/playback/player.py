"""The player: plays, steps and jumps in its thread, and stops where a breakpoint becomes true.

It drives one or two runs by one clock, so that both are at the same tick.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from automaton.engine.state import NIL, Array
from automaton.errors import InputError
from automaton.history.breakpoints import Breakpoint
from automaton.history.divergence import Divergence
from automaton.history.live_run import LiveDivergence, LiveRun
from automaton.history.snapshot import Snapshot, take_snapshot
from automaton.history.watched_run import COMPUTE_SLICE_S, WatchedRun
from automaton.runs.run_diagnosis import DeadlockWatch
from tui.playback.playback_state import (
    LongTick,
    Overlays,
    PlaybackState,
    RecordedCells,
    RunFigures,
    TimeComparison,
    Trails,
    figures_of,
)

NORMAL_TICKS_PER_S: Final = 10.0  # at speed x1
REWIND: Final = 64.0  # maximum speed backwards

# Between two published states at full speed: less than between two pictures, but longer if the last
# state has not been read, since publishing takes the GIL.
STATE_INTERVAL_S: Final = 0.012
UNSEEN_S: Final = 1 / 30

FIGURES_S: Final = 0.3  # between two readings of the metrics, or
FIGURES_TIME_RATIO: Final = 10  # this multiple of the last one's duration, if longer

IDLE_S: Final = 0.5
RATE_S: Final = 0.5  # least time over which the speed is measured
RATE_TICKS: Final = 20  # least number of due ticks: one missing still counts as reached

PLAYER_JOIN_TIMEOUT_S: Final = 3.0  # to wait for an interrupted strategy
TICK_S: Final = 0.5  # to wait for the tick being computed
LONG_TICK_S: Final = 2.0  # after this time the tick being computed is shown,
WAITED_S: Final = 0.15  # or after this time, if a request waits for it

RUN_LETTERS = "AB"  # of two runs


class Player:
    """Owns the runs; use only `latest` and the requests, from any thread.

    Its thread does all work on the runs. The screen reads the latest PlaybackState and sends
    requests; neither waits for the simulation.
    """

    def __init__(self, runs: Sequence[WatchedRun], start: bool = True) -> None:
        self.runs = list(runs)
        self._requests: deque[Callable[[], None]] = deque()
        self._wake = threading.Condition()
        self._alive = True
        self._direction, self._speed = 0, 1.0
        self._tick = 0
        self._busy_since = math.inf  # start of the present computation
        self._goal: int | None = None  # a requested tick, however long it takes,
        self._stop_at_breakpoints = False  # and whether breakpoints stop before it
        self._anchor = (0.0, 0)  # time and tick when the clock was set
        self._rate = (0.0, 0, 0.0)  # time and tick of the last measurement; ticks per second
        self._selected, self._layer = NIL, ""
        self._breakpoints: list[Breakpoint] = []
        self._stops, self._stopped, self._error = 0, "", ""
        self._hit: Hit | None = None  # the breakpoint that stopped it
        self._stuck: int | None = None  # the deadlock that stopped it, which does so once
        self._may_be_stuck = True
        self._deadlocks = [DeadlockWatch() for _ in self.runs]
        self._overlays = [Overlays() for _ in self.runs]
        live = [run for run in self.runs if isinstance(run, LiveRun)]
        self._divergence = LiveDivergence(*live) if len(live) == 2 else None
        recorded = len(self.runs) == 2 and not live
        self._comparison = self._compare() if recorded else None
        self._trails: list[Trails] | None = None  # None: not shown
        self._figures: tuple[RunFigures, ...] = ()
        self._parted: Divergence | None = None
        self._figures_at = -math.inf  # earliest time of the next metrics during playback
        self._stale = True
        for run in self.runs:
            run.give_up = self._is_closing
        self.published: Callable[[], None] = lambda: None  # called in the thread for each new state
        self._playback = self._take_state(0)
        self._thread = threading.Thread(target=self._run_thread, name="player", daemon=True)
        if start:
            self._thread.start()

    def _compare(self) -> TimeComparison:
        """The comparison of two recordings."""
        cells = (
            RecordedCells(run.header, run.frames, run.resolved.scenario.units.scale.unit.size)
            for run in self.runs
        )
        return TimeComparison(*cells)

    def latest(self) -> PlaybackState:
        """Return the newest state without waiting."""
        self._seen = True
        return self._playback

    def computing(self) -> LongTick | None:
        """The tick being computed, if it takes long or makes a request wait; else None."""
        seconds, waited = time.monotonic() - self._busy_since, bool(self._requests)
        if seconds < (WAITED_S if waited else LONG_TICK_S):
            return None
        return LongTick(max(run.leading_simulation.tick for run in self.runs), seconds, waited)

    @property
    def thread(self) -> int:
        """The native id of the player's thread."""
        return self._thread.native_id or 0

    def play(self, direction: int = 1) -> None:
        """Play; -1: backwards."""
        self._enqueue_request(lambda: self._set_clock(direction, self._speed))

    def toggle(self, direction: int = 1) -> None:
        """Play in this direction, or pause if already playing (for forwards: in any direction)."""

        def turn() -> None:
            playing = self._direction == direction or (direction > 0 and self._direction != 0)
            if playing:
                self._halt()
            else:
                self._set_clock(direction, self._speed)

        self._enqueue_request(turn)

    def pause(self) -> None:
        """Pause at the shown tick."""
        self._enqueue_request(self._halt)

    def set_speed(self, factor: float) -> None:
        """Set the speed in units of NORMAL_TICKS_PER_S; math.inf: full speed."""
        self._enqueue_request(lambda: self._set_clock(self._direction, factor))

    def step(self, ticks: int) -> None:
        """Go by `ticks`, negative for back, and pause; a breakpoint on the way forward stops it."""
        self._enqueue_request(
            lambda: self._set_target(self._target + ticks, stop_at_breakpoints=True)
        )

    def seek(self, tick: int, stop_at_breakpoints: bool = False) -> None:
        """Go to a tick and pause; `stop_at_breakpoints`: stop at the first on the way forward."""
        self._enqueue_request(lambda: self._set_target(tick, stop_at_breakpoints))

    def select(self, robot: int) -> None:
        """Include the route of this robot, or NIL, in snapshots."""
        self._enqueue_request(lambda: self._choose(robot, self._layer))

    def show_layer(self, name: str) -> None:
        """Include the numbers of this layer, or "", in snapshots."""
        self._enqueue_request(lambda: self._choose(self._selected, name))

    def show_trails(self, on: bool) -> None:
        """Include trails in states or not."""
        self._enqueue_request(
            lambda: setattr(self, "_trails", [Trails() for _ in self.runs] if on else None)
        )

    def set_breakpoints(self, breakpoints: Sequence[Breakpoint]) -> None:
        """Stop where one of these becomes true."""
        self._enqueue_request(lambda: setattr(self, "_breakpoints", list(breakpoints)))

    def exchange(
        self, work: Callable[[WatchedRun], WatchedRun], done: Callable[[str], None]
    ) -> None:
        """Replace the first run by the result of `work`; `done` receives "" or an error.

        The player's thread calls both.
        """
        self._enqueue_request(lambda: self._exchange(work, done))

    def close(self) -> None:
        """End the thread and close the runs, which completes recordings."""
        with self._wake:
            self._alive = False
            self._wake.notify()
        if self._thread.is_alive():
            self._thread.join(TICK_S)
        if self._thread.is_alive():
            for run in self.runs:
                run.leading_simulation.interrupt()
            self._thread.join(PLAYER_JOIN_TIMEOUT_S)
        if self._thread.is_alive():
            return  # a strategy hangs; the recording so far is on disk
        for run in self.runs:
            run.close()

    def _enqueue_request(self, work: Callable[[], None]) -> None:
        with self._wake:
            self._requests.append(work)
            self._wake.notify()

    # Called in the player's thread.

    def _run_thread(self) -> None:
        while self._alive:
            try:
                self._handle_requests()
                if self._direction and not self._playback.playing:
                    self._publish_now()  # show that it plays, even if the first tick takes long
                busy = self._goal is not None or self._direction != 0
                if busy:
                    self._advance()
                else:
                    busy = self._look_ahead()
                if busy and self._until_next_tick() > COMPUTE_SLICE_S:
                    self._look_ahead()
                self._publish()
            except KeyboardInterrupt:
                return  # closing
            except Exception as error:
                self._fail(error)
                busy = False
            self._wait_for_request(busy)

    def _is_closing(self) -> bool:
        return not self._alive

    def _handle_requests(self) -> None:
        while self._requests:
            self._stale = True
            self._requests.popleft()()

    def _fail(self, error: Exception) -> None:
        """Halt and show the error; the screen stays alive."""
        self._error = sentence(error)
        self._halt()
        self._tick = min(run.tick for run in self.runs)
        with suppress(Exception):  # one error message is enough
            self._tick = self._show(self._tick)
        try:
            self._playback = self._take_state(self._playback.seq + 1)
        except Exception:  # fall back to the last state
            self._playback = replace(
                self._playback,
                seq=self._playback.seq + 1,
                error=self._error,
                playing=0,
                achieved=0.0,
            )
        self.published()

    def _wait_for_request(self, busy: bool) -> None:
        """Wait for a request, or until the clock asks for the next tick."""
        pause = self._until_next_tick() if busy else IDLE_S
        if pause <= 0 and (busy or self._requests):
            return
        with self._wake:
            if not self._requests and self._alive:
                self._wake.wait(pause)

    def _until_next_tick(self) -> float:
        if self._goal is not None or self._direction == 0 or math.isinf(self._clock_speed):
            return 0.0
        began, tick = self._anchor
        due = began + (abs(self._tick - tick) + 1) / self._ticks_per_second
        return min(due - time.monotonic(), IDLE_S)

    def _halt(self) -> None:
        self._goal = None
        self._set_clock(0, self._speed)

    def _set_clock(self, direction: int, speed: float) -> None:
        if direction and not self._direction:
            self._clear_stop()
        if (direction, speed) != (self._direction, self._speed):  # the measured speed is outdated
            self._rate = (time.monotonic(), self._tick, 0.0)
        self._direction, self._speed = direction, speed
        if direction:
            self._goal = None
        self._anchor = (time.monotonic(), self._tick)

    @property
    def _target(self) -> int:
        """The requested tick, or the shown one."""
        return self._tick if self._goal is None else self._goal

    def _set_target(self, tick: int, stop_at_breakpoints: bool = False) -> None:
        self._set_clock(0, self._speed)
        self._clear_stop()
        ends = [run.end for run in self.runs]
        last = math.inf if None in ends else max(end for end in ends if end is not None)
        self._goal, self._stop_at_breakpoints = int(max(0, min(tick, last))), stop_at_breakpoints

    def _clear_stop(self) -> None:
        """Clear the reason of the last stop."""
        self._hit, self._stopped, self._error, self._stuck = None, "", "", None

    def _choose(self, robot: int, layer: str) -> None:
        self._selected, self._layer = robot, layer

    def _exchange(
        self, work: Callable[[WatchedRun], WatchedRun], done: Callable[[str], None]
    ) -> None:
        try:
            fresh = work(self.runs[0])
        except Exception as error:
            done(sentence(error))
            return
        before, self.runs[0] = self.runs[0], fresh
        fresh.give_up = self._is_closing
        before.close()
        self._error, self._may_be_stuck = "", True
        self._set_target(fresh.tick)
        self._figures_at = -math.inf
        done("")

    def _advance(self) -> None:
        """Move all runs towards the tick of the clock or of a request."""
        goal = self._goal if self._goal is not None else self._due()
        stop_at_breakpoints = (
            self._stop_at_breakpoints if self._goal is not None else self._direction > 0
        )
        before = self._tick
        self._busy_since = time.monotonic()
        try:
            if stop_at_breakpoints and self._breakpoints and goal > before:
                self._step_until_breakpoint(goal)
            else:
                self._tick = self._show(goal)
        finally:
            self._busy_since = math.inf
        if self._tick != before:
            self._stale = True
            self._stop_if_stuck(forwards=self._tick > before)
        if self._tick == self._goal or (self._goal is not None and self._tick == before):
            self._report_lost_past()
            self._goal = None
            self._stale = True  # read the metrics of the final tick
        elif self._goal is None and self._at_an_end():
            self._set_clock(0, self._speed)
            self._stale = True
        elif math.isinf(self._clock_speed) or self._tick != goal:
            self._anchor = (time.monotonic(), self._tick)

    def _stop_if_stuck(self, forwards: bool) -> None:
        """Halt, once, where live runs can only repeat a deadlock."""
        fronts = [
            (watch, run.leading_simulation)
            for watch, run in zip(self._deadlocks, self.runs, strict=True)
            if run.live and run.end is None
        ]
        if not (self._may_be_stuck and forwards and fronts):
            return
        begun = [watch.begun(front) for watch, front in fronts if front.tick == self._tick]
        first = min((tick for tick in begun if tick is not None), default=None)
        if len(begun) == len(fronts) and None not in begun and first is not None:
            self._halt()
            self._stops += 1
            self._stuck, self._may_be_stuck = first, False

    def _report_lost_past(self) -> None:
        """Report a requested tick that a long run without a recording has discarded."""
        if self._goal is not None and self._goal < self._first <= self._tick:
            self._error = f"ticks before {self._first:,} are not kept any more"
            self._stale = True

    @property
    def _first(self) -> int:
        """The first tick that can be shown."""
        return max(run.first for run in self.runs)

    @property
    def _ticks_per_second(self) -> float:
        """Ticks a second."""
        return NORMAL_TICKS_PER_S * self._clock_speed

    @property
    def _clock_speed(self) -> float:
        """The speed in this direction."""
        return self._speed if self._direction > 0 else min(self._speed, REWIND)

    def _due(self) -> int:
        """The tick that is due by the clock."""
        began, tick = self._anchor
        if math.isinf(self._clock_speed):
            return self._tick + 2**30
        passed = int((time.monotonic() - began) * self._ticks_per_second)
        return max(0, tick + self._direction * passed)

    def _show(self, tick: int) -> int:
        """Show a tick in all runs, or the nearest one that all reach within a time slice."""
        if self._divergence is not None:
            return self._show_in_step(tick)
        reached = [run.show(tick) for run in self.runs]
        if len(self.runs) == 1:
            return reached[0]
        under_way = [at for at, run in zip(reached, self.runs, strict=True) if at != run.end]
        common = min(under_way, default=max(reached))
        for run in self.runs:
            while run.tick != common and run.tick != run.end:
                run.show(common)
        return common

    def _show_in_step(self, tick: int) -> int:
        """`_show` for two live runs: neither is computed farther than the other."""
        lead = max(self.runs, key=lambda run: math.inf if run.end is None else run.end)
        common = lead.show(tick)
        for run in self.runs:
            while run.tick != common and (run.end is None or run.tick != min(common, run.end)):
                run.show(common)
                if not self._alive:
                    return common
        return common

    def _step_until_breakpoint(self, tick: int) -> None:
        """Advance by single ticks for a time slice; stop where a breakpoint becomes true."""
        until = time.monotonic() + STATE_INTERVAL_S
        held = held_by(self._breakpoints, self.runs)
        while self._tick < tick and time.monotonic() < until and not self._at_an_end():
            self._tick = self._show(self._tick + 1)
            now = held_by(self._breakpoints, self.runs)
            hits = begun(self._breakpoints, held, now)
            if hits:
                self._stop_at(hits)
                return
            held = now

    def _stop_at(self, hits: Sequence[Hit]) -> None:
        self._halt()
        self._stops += 1
        self._hit, self._stopped = (
            hits[0],
            "; ".join(_hit_words(hit, len(self.runs)) for hit in hits),
        )

    def _at_an_end(self) -> bool:
        if self._direction < 0:
            return self._tick <= self._first
        return all(run.end is not None and self._tick >= run.end for run in self.runs)

    def _look_ahead(self) -> bool:
        """While idle, read ahead in recordings to learn their events."""
        before = [run.event_history.known for run in self.runs]
        for run in self.runs:
            if not run.live:
                run.extend()
        grown = before != [run.event_history.known for run in self.runs]
        self._stale = self._stale or grown
        return grown

    def _publish(self) -> None:
        now = time.monotonic()
        measured, tick, rate = self._rate
        if self._direction and now - measured >= max(RATE_S, RATE_TICKS / self._ticks_per_second):
            rate = abs(self._tick - tick) / (now - measured)
            self._rate = (now, self._tick, rate)
            self._stale = True
        pause = STATE_INTERVAL_S if self._seen else UNSEEN_S
        if self._stale and (now - self._published >= pause or not self._direction):
            self._publish_now()

    def _publish_now(self) -> None:
        self._playback = self._take_state(self._playback.seq + 1)
        self.published()

    def _take_state(self, seq: int) -> PlaybackState:
        self._stale = self._seen = False
        self._published = now = time.monotonic()
        if now >= self._figures_at or (not self._direction and self._goal is None):
            self._figures = tuple(figures_of(run) for run in self.runs)
            if self._divergence is not None:
                self._parted = self._divergence.look()
            took = time.monotonic() - now
            self._figures_at = now + max(FIGURES_S, FIGURES_TIME_RATIO * took)
        failed = next((run.failed for run in self.runs if run.failed), "")
        trouble = next((run.warning for run in self.runs if run.warning), "")
        return PlaybackState(
            seq=seq,
            tick=self._tick,
            runs=tuple(self.runs),
            snapshots=tuple(map(self._snapshot_of, self.runs, self._overlays)),
            figures=self._figures,
            playing=self._direction,
            asked=NORMAL_TICKS_PER_S * self._speed,
            achieved=self._rate[2] if self._direction else 0.0,
            head=max(run.head for run in self.runs),
            known=min(run.event_history.known for run in self.runs),
            ends=tuple(run.end for run in self.runs),
            live=self.runs[0].live,
            stops=self._stops,
            stopped=self._stopped,
            breakpoint_robots=() if self._hit is None else self._hit.robots,
            side=0 if self._hit is None else self._hit.side,
            error=self._error or trouble,
            failed=failed,
            divergence=self._parted,
            stuck=self._stuck,
            trails=tuple(
                trails.at(run.shown)
                for trails, run in zip(
                    self._trails or (), self.runs, strict=self._trails is not None
                )
            ),
        )

    def _snapshot_of(self, run: WatchedRun, overlays: Overlays) -> Snapshot:
        bare = take_snapshot(run.shown, self._selected, self._layer)
        playing = self._direction != 0 or self._goal is not None
        return overlays.laid_over(bare, run.shown, self._layer, playing, self._comparison)


def sentence(error: Exception) -> str:
    """The error as a message to the user."""
    if isinstance(error, InputError):
        return str(error)
    return f"internal error, {type(error).__name__}: {error}"


# Breakpoints stop the clock at the first tick at which one becomes true in any run.


Held = list[list[Array]]  # by run and breakpoint: the robots for which it is true


class Hit(NamedTuple):
    """A breakpoint that has become true."""

    text: str
    side: int  # index of the run
    robots: tuple[int, ...]  # for which it was false a tick before


def held_by(points: Sequence[Breakpoint], runs: Sequence[WatchedRun]) -> Held:
    """The robots for which each breakpoint is true at the shown ticks."""
    return [[point.test(run.shown, run.floor_plan) for point in points] for run in runs]


def begun(points: Sequence[Breakpoint], before: Held, now: Held) -> list[Hit]:
    """Breakpoints that are true now and were not a tick before."""
    hits = []
    for side, (old, new) in enumerate(zip(before, now, strict=True)):
        for point, was, is_ in zip(points, old, new, strict=True):
            fresh = np.setdiff1d(is_, was)
            if len(fresh):
                hits.append(Hit(point.text, side, tuple(int(robot) for robot in fresh)))
    return hits


def _hit_words(hit: Hit, runs: int) -> str:
    """The reason of a stop; with two runs it names the run."""
    where = f"run {RUN_LETTERS[hit.side]}, " if runs > 1 else ""
    others = " and others" if len(hit.robots) > 1 else ""
    return f"{hit.text}: {where}robot {hit.robots[0]}{others}"
