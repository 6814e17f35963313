"""A run with its past, live or recorded, which can be shown at any tick and branched there."""

from __future__ import annotations

import time
from collections.abc import Callable

from automaton.floor.floor_plan import FloorPlan
from automaton.history.event_history import EventHistory, LostByRows
from automaton.history.playback import Keyframes, Playback
from automaton.recording.contents import Content
from automaton.recording.frames import Recording, StoredFrames, changed, resolved_of
from automaton.runs.metrics import metrics_of
from automaton.runs.periods import Period, PeriodMarks, ticks_of_period
from automaton.runs.simulation import Simulation
from automaton.world.resolved import Resolved

COMPUTE_SLICE_S = 0.005  # computing time between two checks of the clock
KEYFRAME_S = 0.03  # computing time between two keyframes; limits the cost of going back
KEYFRAME_TIME_RATIO = 10  # least computing time between keyframes, in costs of the last keyframe


class WatchedRun:
    """A run and the tick at which it is shown.

    New ticks are computed at the *front*: the simulation itself, or the first pass over a recording.
    Another playback shows the past. The object belongs to one thread; other threads may only read
    `event_history`.
    """

    def __init__(self, header: Content, frames: StoredFrames, resolved: Resolved) -> None:
        self.header = header
        self.frames = frames
        self.resolved = resolved
        self.event_history = EventHistory()
        self.give_up: Callable[[], bool] = lambda: False  # polled while a past is computed again
        self._past: Playback | None = None
        # Ticks that take about COMPUTE_SLICE_S. The first ticks of a large fleet take seconds each.
        self._slice = 1
        self._since_keyframe = 0.0
        self._keyframe_took = 0.0
        self._at = 0
        self.lost = LostByRows(resolved.floor_plan.kind.size, resolved.floor_plan.stride)
        self.marks = PeriodMarks(ticks_of_period(resolved, None))  # at the front

    @property
    def floor_plan(self) -> FloorPlan:
        """The floor."""
        return self.resolved.floor_plan

    @property
    def tick(self) -> int:
        """The shown tick."""
        return self._at

    @property
    def shown(self) -> Simulation:
        """The simulation in the state of the shown tick; it must not be run."""
        if self._past is None or self._at == self.leading_simulation.tick:
            return self.leading_simulation
        return self._past.simulation

    @property
    def warning(self) -> str:
        """A problem that does not end the run, or ""."""
        return ""

    @property
    def failed(self) -> str:
        """The failure of a strategy that ended the run, or ""."""
        return ""

    @property
    def live(self) -> bool:
        """Whether strategies can compute further ticks."""
        return False

    @property
    def leading_simulation(self) -> Simulation:
        """The simulation at the front."""
        raise NotImplementedError

    @property
    def first(self) -> int:
        """The first tick that can be shown: 0, unless the oldest part of a long past was dropped."""
        return self.keyframes.ticks[0]

    @property
    def head(self) -> int:
        """The last tick that can be shown without computing new ticks."""
        return self.frames.last_tick

    @property
    def end(self) -> int | None:
        """The last tick of the run, if it is known."""
        raise NotImplementedError

    @property
    def keyframes(self) -> Keyframes:
        """The stored states from which the past is replayed."""
        raise NotImplementedError

    def show(self, tick: int, budget_s: float = COMPUTE_SLICE_S) -> int:
        """Show a tick, or as near to it as the budget allows; return the shown tick."""
        until = time.perf_counter() + budget_s
        tick = max(self.first, tick if self.end is None else min(tick, self.end))
        while True:
            if tick >= self.leading_simulation.tick:
                try:
                    computed = tick > self.leading_simulation.tick and self._advance(
                        tick - self.leading_simulation.tick
                    )
                finally:
                    self._at = self.leading_simulation.tick
                if not computed:
                    return self._at
            else:
                self._look_back(tick)
            if self._at == tick or time.perf_counter() >= until:
                return self._at

    def extend(self) -> bool:
        """Compute ticks ahead for some milliseconds; return whether any were left."""
        more = self._advance()
        if self._at != self.leading_simulation.tick:  # the front itself showed the tick before
            self._look_back(max(self._at, self.first))
        return more

    def _advance(self, most: int | None = None) -> bool:
        """Compute the next ticks, and store a keyframe from time to time."""
        before = self.leading_simulation.tick
        begun = time.perf_counter()
        until = before + (self._slice if most is None else min(most, self._slice))
        self._compute(min(until, self.marks.next_mark(before), self.lost.next_sample(before)))
        self.marks.look(self.leading_simulation)
        self.lost.look(self.leading_simulation, self.leading_simulation.tick == self.end)
        took = time.perf_counter() - begun
        if took < COMPUTE_SLICE_S / 2 and self.leading_simulation.tick - before == self._slice:
            self._slice *= 2
        elif took > 2 * COMPUTE_SLICE_S and self._slice > 1:
            self._slice //= 2
        self._since_keyframe += took
        if self._since_keyframe >= max(KEYFRAME_S, KEYFRAME_TIME_RATIO * self._keyframe_took):
            begun = time.perf_counter()
            self.keyframes.keep(self.leading_simulation.world, self.leading_simulation.observation)
            self._since_keyframe, self._keyframe_took = 0.0, time.perf_counter() - begun
        return self.leading_simulation.tick > before

    def _compute(self, until: int) -> None:
        raise NotImplementedError

    def _look_back(self, tick: int) -> None:
        if self._past is None:
            self._past = Playback(self.header, self.frames, self.keyframes)
        try:
            self._past.go_to(tick)
        finally:
            self._at = self._past.tick

    def metrics(self) -> dict[str, float | int]:
        """The metrics of the run up to the shown tick."""
        return metrics_of(self.shown)

    def periods(self) -> list[Period]:
        """The periods up to the shown tick; the last one may be shorter."""
        return self.marks.periods(self.shown) if self._at else []

    def resolved_at(self, tick: int) -> Resolved:
        """The scenario with its strategies that applies in the tick after `tick`."""
        return resolved_of(changed(self.header, self.frames.rules_at(tick)))

    def close(self) -> None:
        """End the computation."""


class ReplayedRun(WatchedRun):
    """A recording, complete or truncated."""

    def __init__(self, recording: Recording) -> None:
        frames = recording.stored()
        super().__init__(
            recording.header, frames, resolved_of(recording.header, with_strategies=False)
        )
        self.complete = recording.complete
        self._front = Playback(recording.header, frames, on_observe=self.event_history)

    @property
    def leading_simulation(self) -> Simulation:
        return self._front.simulation

    @property
    def end(self) -> int | None:
        return self.frames.last_tick

    @property
    def keyframes(self) -> Keyframes:
        return self._front.keyframes

    def _compute(self, until: int) -> None:
        self._front.go_to(until)
