"""A run that is computed while it is shown, and how one goes on from the past of another."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from automaton.engine.digest import DIGEST_NAMES
from automaton.engine.state import CLOCK_DIGEST_EVERY, CLOCK_TICK, NIL
from automaton.errors import InputError
from automaton.evidence.history.keyframes import Keyframes
from automaton.evidence.history.live_recorder import DIGEST_TICKS, LiveRecorder
from automaton.evidence.history.playback import Playback
from automaton.evidence.history.watched_run import COMPUTE_SLICE_S, Run
from automaton.evidence.recording.frames import Content, StoredFrames
from automaton.evidence.recording.header import changed, resolved_of
from automaton.runs.headless import attribute_strategy_errors
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, branched

ZONES = "service_zones."  # arrays of the state that change with the rules


class LiveRun(Run):
    """A simulation under way; with `path` it is recorded there as well."""

    def __init__(self, resolved: Resolved, seed: int, path: Path | None = None) -> None:
        """Raises InputError if a strategy or the file does not do; no new file is there then."""
        self.recorder = LiveRecorder(resolved, seed, path)
        super().__init__(self.recorder.header, self.recorder.frames, resolved)
        self._repeating = False
        self._failed = ""
        try:
            with attribute_strategy_errors(resolved):
                self._front = self._observed(resolved, seed)
            self._keyframes = Keyframes(self._front.world, self._front.observation)
            self.recorder(self._front)  # the rules of the first tick are there from the beginning
        except BaseException:
            self.recorder.discard()
            raise

    def _observed(self, resolved: Resolved, seed: int) -> Simulation:
        simulation = Simulation(
            resolved, seed, on_record=self.recorder, on_observe=self.event_history
        )
        simulation.world.clock[CLOCK_DIGEST_EVERY] = DIGEST_TICKS
        return simulation

    @property
    def warning(self) -> str:
        return self.recorder.write_error

    @property
    def failed(self) -> str:
        return self._failed

    @property
    def live(self) -> bool:
        return not self._failed

    @property
    def leading_simulation(self) -> Simulation:
        return self._front

    @property
    def head(self) -> int:
        return self._front.tick

    @property
    def end(self) -> int | None:
        limit = self.resolved.scenario.stop.max_duration
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
            with attribute_strategy_errors(self.resolved):
                self._front.run(until)
        except InputError as error:
            self._end_before(str(error))
            raise
        except KeyboardInterrupt:
            self._failed = "given up"  # the state is that of an unfinished tick
            raise
        self._forget(self.recorder.first)
        self._end()

    def _forget(self, first: int) -> None:
        """Ticks up to this one cannot be played any more: begin with a state after it."""
        if self._keyframes.ticks[-1] < first:
            self._keyframes.keep(self._front.world, self._front.observation)
        self._keyframes.forget_until(first)

    def _end(self) -> None:
        if self.end is not None and not self._repeating and not self._failed:
            self.recorder.end()

    def _end_before(self, failure: str) -> None:
        """A strategy failed in the middle of a tick: the run ends with the tick before."""
        broken = self._front
        self.recorder(broken)
        self.recorder.flush()
        last = self.frames.last_tick
        broken.world.clock[CLOCK_TICK] = last  # those of the failed tick are in none of the buffers
        self.event_history(broken)
        broken.world.clock[CLOCK_TICK] = last + 1
        self._failed = failure
        whole = Playback(self.header, self.frames, self._keyframes)
        whole.go_to(last)
        self._front = whole.simulation

    def show(self, tick: int, budget_s: float = COMPUTE_SLICE_S) -> int:
        if tick < self._front.tick:
            self._have(tick)
        return super().show(tick, budget_s)

    def _look_back(self, tick: int) -> None:
        self._have(tick)
        super()._look_back(max(tick, self.first))

    def _have(self, tick: int) -> None:
        """Let frames hold the tick, which may cost the oldest ones their place."""
        if tick > self.frames.last_tick:
            self.recorder.flush()
            self._forget(self.recorder.first)

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
            if not self._advance(until - self._front.tick):
                break  # the run ends sooner now
        self._repeating = False
        self._at = self._front.tick

    def change(self, resolved: Resolved, settings: tuple[str, ...]) -> None:
        """Go on under other rules from here."""
        self.resolved = resolved
        with attribute_strategy_errors(resolved):
            self._front = self._front.continue_with(resolved)
        self.recorder.change(self._front, settings)

    def close(self) -> None:
        self._end()
        self.recorder.close()


def branch_of(run: Run, settings: tuple[str, ...], path: Path | None = None) -> LiveRun:
    """A live run with the past of `run` up to the shown tick, and other settings from there on.

    The past is computed again with its strategies, so that they remember it. Raises InputError
    when the settings do not fit, or when this version computes another past.
    """
    tick = run.tick
    other = branched(run.resolved_at(tick), settings)
    held = run.frames.rules_at(tick)
    if held["tick"] == tick and held["settings"]:  # this past was branched off there as well
        settings = (*held["settings"], *settings)
    branch = LiveRun(resolved_of(run.header), run.header["seed"], path)
    branch.give_up = run.give_up
    try:
        branch.repeat(run.frames, run.header, tick)
        if not _same_past(branch.leading_simulation, run.shown, held["tick"] == tick):
            raise InputError(
                f"computed again with its strategies, the run is another one at tick {tick}: "
                "it was recorded by another version"
            )
        branch.change(other, settings)
    except BaseException:
        branch.recorder.discard()
        raise
    return branch


def _same_past(repeated: Simulation, shown: Simulation, branched_there: bool) -> bool:
    """Whether two states are one; a run that was branched off there shows zones of its branch."""
    differ = np.flatnonzero(repeated.digests() != shown.digests())
    names = [DIGEST_NAMES[index] for index in differ]
    return not names or (branched_there and all(name.startswith(ZONES) for name in names))
