"""A run with its past: live or recorded, it can be shown at any tick, and branched off there."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from automaton.errors import InputError
from automaton.headless import strategies_blamed
from automaton.history.chronicle import Chronicle
from automaton.history.journal import DIGEST_EVERY as EVERY
from automaton.history.journal import Journal
from automaton.history.keyframes import Keyframes
from automaton.history.playback import Playback
from automaton.metrics import metrics_of
from automaton.recording.frames import Content, Recording, StoredFrames
from automaton.recording.header import changed, resolved_of
from automaton.scenario.branch import branched
from automaton.scenario.resolve import Resolved
from automaton.simulation import Simulation
from automaton.world.plan import FloorPlan
from automaton.world.state import DIGEST_EVERY, NIL, TICK

SLICE_S = 0.005  # of computing between two looks at the clock
KEYFRAME_S = 0.03  # of computing between two keyframes: what going back may cost


class Run:
    """What is known of a run, and the tick at which it is shown.

    The *front* is where new ticks are computed: the simulation itself, or the first pass over a
    recording. Another playback shows the past. All of it belongs to one thread; only `chronicle`
    may be read by others.
    """

    def __init__(self, header: Content, frames: StoredFrames, resolved: Resolved) -> None:
        self.header = header
        self.frames = frames
        self.resolved = resolved
        self.chronicle = Chronicle()
        self.give_up: Callable[[], bool] = lambda: False  # looked at while a past is computed
        self._past: Playback | None = None
        self._slice = 16  # ticks that take about SLICE_S
        self._since_keyframe = 0.0
        self._at = 0

    @property
    def plan(self) -> FloorPlan:
        """The floor."""
        return self.resolved.plan

    @property
    def tick(self) -> int:
        """The tick that is shown."""
        return self._at

    @property
    def trouble(self) -> str:
        """What goes wrong without ending the run, or ""."""
        return ""

    @property
    def failed(self) -> str:
        """Why a strategy cannot go on, which ended the run, or ""."""
        return ""

    @property
    def live(self) -> bool:
        """Whether further ticks can be computed by strategies."""
        return False

    @property
    def front(self) -> Simulation:
        """The simulation that is farthest."""
        raise NotImplementedError

    @property
    def head(self) -> int:
        """The last tick that can be shown without computing new ones."""
        return self.frames.last_tick

    @property
    def end(self) -> int | None:
        """The last tick that there will ever be, if that is known."""
        raise NotImplementedError

    @property
    def shown(self) -> Simulation:
        """The simulation in the state of the tick that is shown; not to be run."""
        if self._at == self.front.tick:
            return self.front
        self._look_back(self._at)  # the front may have gone on since
        return self._playback().simulation

    def show(self, tick: int, budget_s: float = SLICE_S) -> int:
        """Show a tick, or get nearer to it within the budget; returns the tick that is shown."""
        until = time.perf_counter() + budget_s
        tick = max(0, tick if self.end is None else min(tick, self.end))
        while True:
            if tick >= self.front.tick:
                self._at = self.front.tick
                try:
                    if tick == self._at or not self.extend(tick - self._at):
                        return self._at
                finally:
                    self._at = self.front.tick
            else:
                self._look_back(tick)
            if self._at == tick or time.perf_counter() >= until:
                return self._at

    def extend(self, most: int | None = None) -> bool:
        """Compute the next ticks, some milliseconds of them; False when there are none."""
        before = self.front.tick
        begun = time.perf_counter()
        self._compute(before + (self._slice if most is None else min(most, self._slice)))
        took = time.perf_counter() - begun
        if took < SLICE_S / 2 and self.front.tick - before == self._slice:
            self._slice *= 2
        elif took > 2 * SLICE_S and self._slice > 1:
            self._slice //= 2
        self._since_keyframe += took
        if self._since_keyframe >= KEYFRAME_S:
            self._since_keyframe = 0.0
            self.keyframes.keep(self.front.world, self.front.watch)
        return self.front.tick > before

    @property
    def keyframes(self) -> Keyframes:
        """The states that can be gone back to."""
        raise NotImplementedError

    def _compute(self, until: int) -> None:
        raise NotImplementedError

    def _playback(self) -> Playback:
        if self._past is None:
            self._past = Playback(self.header, self.frames, self.keyframes)
        return self._past

    def _look_back(self, tick: int) -> None:
        past = self._playback()
        try:
            past.go_to(tick)
        finally:
            self._at = past.tick

    def metrics(self) -> dict[str, float | int]:
        """The figures of the run up to the tick that is shown."""
        return metrics_of(self.shown)

    def branch(self, settings: tuple[str, ...], path: Path | None = None) -> LiveRun:
        """A live run with this past up to the shown tick, and other settings from there on.

        The past is computed again with its strategies, so that they remember it. Raises InputError
        when the settings do not fit, or when this version computes another past.
        """
        tick = self._at
        other = branched(self.resolved_at(tick), settings)
        run = LiveRun(resolved_of(self.header), self.header["seed"], path)
        run.give_up = self.give_up
        try:
            run.repeat(self.frames, self.header, tick)
            if run.front.digest != self.shown.digest:
                raise InputError(
                    f"computed again with its strategies, the run is another one at tick {tick}: "
                    "it was recorded by another version"
                )
            run.change(other, settings)
        except BaseException:
            run.journal.discard()
            raise
        return run

    def resolved_at(self, tick: int) -> Resolved:
        """The scenario that holds in the tick after `tick`, with its strategies."""
        return resolved_of(changed(self.header, self.frames.rules_at(tick)))

    def close(self) -> None:
        """Nothing more will be computed."""


class RecordedRun(Run):
    """A recording, whole or cut short."""

    def __init__(self, recording: Recording) -> None:
        frames = recording.stored()
        super().__init__(
            recording.header, frames, resolved_of(recording.header, with_strategies=False)
        )
        self.complete = recording.complete
        self._front = Playback(recording.header, frames, on_observe=self.chronicle)

    @property
    def front(self) -> Simulation:
        return self._front.simulation

    @property
    def end(self) -> int | None:
        return self.frames.last_tick

    @property
    def keyframes(self) -> Keyframes:
        return self._front.keyframes

    def _compute(self, until: int) -> None:
        self._front.go_to(until)


class LiveRun(Run):
    """A simulation under way; with `path` it is recorded there as well."""

    def __init__(self, resolved: Resolved, seed: int, path: Path | None = None) -> None:
        self.journal = Journal(resolved, seed)
        super().__init__(self.journal.header, self.journal.frames, resolved)
        with strategies_blamed(resolved):
            self._front = self._observed(resolved, seed)
        self._keyframes = Keyframes(self._front.world, self._front.watch)
        self.journal(self._front)  # the rules of the first tick are there from the beginning
        if path is not None:
            self.journal.write_to(path)
        self._repeating = False
        self._failed = ""

    def _observed(self, resolved: Resolved, seed: int) -> Simulation:
        simulation = Simulation(resolved, seed, on_record=self.journal, on_observe=self.chronicle)
        simulation.world.clock[DIGEST_EVERY] = EVERY
        return simulation

    @property
    def trouble(self) -> str:
        return self.journal.trouble

    @property
    def failed(self) -> str:
        return self._failed

    @property
    def live(self) -> bool:
        return not self._failed

    @property
    def front(self) -> Simulation:
        return self._front

    @property
    def head(self) -> int:
        return self._front.tick

    @property
    def end(self) -> int | None:
        limit = self.resolved.scenario.stop.at_most
        if self._failed or self._front.finished or self._front.tick >= limit:
            return self._front.tick
        return None

    @property
    def keyframes(self) -> Keyframes:
        return self._keyframes

    def _compute(self, until: int) -> None:
        if self._failed:
            return
        try:
            with strategies_blamed(self.resolved):
                self._front.run(until)
        except InputError as error:
            self._end_before(str(error))
            raise
        self._end()

    def _end(self) -> None:
        if self.end is not None and not self._repeating and not self._failed:
            self.journal.end(metrics_of(self._front))

    def _end_before(self, failure: str) -> None:
        """A strategy failed in the middle of a tick: the run ends with the tick before."""
        broken = self._front
        self.journal(broken)
        self.journal.flush()
        last = self.frames.last_tick
        broken.world.clock[TICK] = last  # those of the failed tick are in none of the buffers
        self.chronicle(broken)
        broken.world.clock[TICK] = last + 1
        self._failed = failure
        whole = Playback(self.header, self.frames, self._keyframes)
        whole.go_to(last)
        self._front = whole.simulation

    def _look_back(self, tick: int) -> None:
        if tick > self.frames.last_tick:
            self.journal.flush()
        super()._look_back(tick)

    def repeat(self, frames: StoredFrames, header: Content, tick: int) -> None:
        """Compute a recorded past again, its branches included, up to a tick."""
        self._repeating = True
        since = NIL  # the rules that hold were entered after this tick
        while self._front.tick < tick:
            rules = frames.rules_at(self._front.tick)
            if rules["tick"] != since:
                since = rules["tick"]
                if since or rules["settings"]:
                    self.change(resolved_of(changed(header, rules)), tuple(rules["settings"]))
            until = frames.next_rules(since)
            until = tick if until is None else min(tick, until)
            if self.give_up():
                raise InputError("the branch was given up")
            if not self.extend(until - self._front.tick):
                break  # the run ends sooner now
        self._repeating = False
        self._at = self._front.tick

    def change(self, resolved: Resolved, settings: tuple[str, ...]) -> None:
        """Go on under other rules from here."""
        self.resolved = resolved
        with strategies_blamed(resolved):
            self._front = self._front.continued(resolved)
        self._front.world.clock[DIGEST_EVERY] = EVERY
        self.journal.change(self._front, settings)

    def close(self) -> None:
        self._end()
        self.journal.close()
