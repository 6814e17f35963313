"""A run that is computed while it is shown, and branches from the past of another run.

Its frames are stored, so that one can go back and branch while the run continues.
"""

from __future__ import annotations

import contextlib
from array import array
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final, overload

import numpy as np

from automaton.engine.digest import DIGEST_NAMES
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.history.divergence import (
    DIFFERENT_START,
    Divergence,
    begin_alike,
    compared,
    first_action,
)
from automaton.history.playback import Keyframes, Playback
from automaton.history.watched_run import COMPUTE_SLICE_S, WatchedRun
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_HEADER,
    FRAME_KIND_TICKS,
    Content,
)
from automaton.recording.frames import (
    FRAME,
    PREAMBLE,
    Payload,
    StoredFrames,
    changed,
    check_simulated,
    payload_of,
    resolved_of,
)
from automaton.recording.recorder import BaseRecorder, RecordingFile
from automaton.runs.headless import attribute_strategy_errors
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, branched

ZONES = "service_zones."  # arrays of the state that change with the rules


class LiveRun(WatchedRun):
    """A simulation in progress; `path`: a file to record it to."""

    def __init__(self, resolved: Resolved, seed: int, path: Path | None = None) -> None:
        """Raises InputError if a strategy or the file fails; no new file is left then."""
        self.recorder = LiveRecorder(resolved, seed, path)
        super().__init__(self.recorder.header, self.recorder.frames, resolved)
        self._repeating = False
        self._failed = ""
        try:
            with attribute_strategy_errors(resolved):
                self._front = self._observed(resolved, seed)
            self._keyframes = Keyframes(self._front.world, self._front.observation)
            self.recorder(self._front)  # records the rules of the first tick at once
        except BaseException:
            self.recorder.discard()
            raise

    def _observed(self, resolved: Resolved, seed: int) -> Simulation:
        simulation = Simulation(
            resolved, seed, on_record=self.recorder, on_observe=self.event_history
        )
        simulation.world.clock.digest_every = DIGEST_TICKS
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
            self._failed = "given up"  # the state belongs to an unfinished tick
            raise
        self._forget(self.recorder.first)
        self._end()

    def _forget(self, first: int) -> None:
        """Drop keyframes before `first`, since earlier ticks cannot be replayed any more."""
        if self._keyframes.ticks[-1] < first:
            self._keyframes.keep(self._front.world, self._front.observation)
        self._keyframes.forget_until(first)

    def _end(self) -> None:
        if self.end is not None and not self._repeating and not self._failed:
            self.recorder.end()

    def _end_before(self, failure: str) -> None:
        """End the run with the tick before the one in which a strategy failed."""
        broken = self._front
        self.recorder(broken)
        self.recorder.flush()
        last = self.frames.last_tick
        broken.world.clock.tick = last  # the buffers hold no events of the failed tick
        self.event_history(broken)
        broken.world.clock.tick = last + 1
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
        """Make sure that frames contain the tick; this may drop the oldest frames."""
        if tick > self.frames.last_tick:
            self.recorder.flush()
            self._forget(self.recorder.first)

    def repeat(self, frames: StoredFrames, header: Content, tick: int) -> None:
        """Compute a recorded past again up to a tick, including its branches."""
        self._repeating = True
        since = NIL  # the tick after which the present rules apply
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
                break  # the run ends earlier this time
        self._repeating = False
        self._at = self._front.tick

    def change(self, resolved: Resolved, settings: tuple[str, ...]) -> None:
        """Continue under other rules."""
        self.resolved = resolved
        with attribute_strategy_errors(resolved):
            self._front = self._front.continue_with(resolved)
        self.recorder.change(self._front, settings)

    def close(self) -> None:
        self._end()
        self.recorder.close()


def branch_of(run: WatchedRun, settings: tuple[str, ...], path: Path | None = None) -> LiveRun:
    """A live run with the past of `run` up to the shown tick, and changed settings from there on.

    The past is computed again with its strategies, so that they have the right memory. Raises
    InputError if the settings do not fit, or if this version computes a different past.
    """
    check_simulated(run.header, "a branch")
    tick = run.tick
    other = branched(run.resolved_at(tick), settings)
    held = run.frames.rules_at(tick)
    if held["tick"] == tick and held["settings"]:  # the past has a branch at this tick as well
        settings = (*held["settings"], *settings)
    branch = LiveRun(resolved_of(run.header), run.header["seed"], path)
    branch.give_up = run.give_up
    try:
        branch.repeat(run.frames, run.header, tick)
        if not _same_past(branch.leading_simulation, run.shown, held["tick"] == tick):
            raise InputError(
                f"computed again with its strategies, the run differs at tick {tick}: "
                "it was recorded by another version"
            )
        branch.change(other, settings)
    except BaseException:
        branch.recorder.discard()
        raise
    return branch


def _same_past(repeated: Simulation, shown: Simulation, branched_there: bool) -> bool:
    """Whether two states are equal, except for zones that a branch at this tick has changed."""
    differ = np.flatnonzero(repeated.digests() != shown.digests())
    names = [DIGEST_NAMES[index] for index in differ]
    return not names or (branched_there and all(name.startswith(ZONES) for name in names))


# A recorder whose frames stay accessible: in memory, or in the file that it writes.


# Limit of frames in memory: millions of ticks of a small fleet.
FRAME_STORE_BYTES: Final = 128 * 1024 * 1024
NOWHERE: Final = -1  # place of a frame that is in memory or dropped


@dataclass(frozen=True, slots=True)
class StoredFrame:
    """One frame of a store; its bytes are read on demand."""

    store: FrameStore
    index: int

    @property
    def kind(self) -> int:
        return self.store.kinds[self.index]

    @property
    def tick(self) -> int:
        """The last tick of the frame."""
        return self.store.ticks[self.index]

    @property
    def data(self) -> bytes:
        """The compressed bytes. Raises InputError if they were dropped or are missing on disk."""
        return self.store.bytes_of(self.index)


class FrameStore(Sequence[StoredFrame]):
    """Frames in their order.

    Memory holds only frames needed for playback, FRAME_KIND_TICKS and FRAME_KIND_CONDITIONS. When the
    former exceed the budget, the oldest are dropped, and the past begins later.
    """

    def __init__(self) -> None:
        self.budget = FRAME_STORE_BYTES
        self.kinds = array("b")
        self.ticks = array("q")
        self.first = 0  # ticks up to this one were dropped
        self._place = array("q")  # offset of the bytes in the file, or NOWHERE
        self._size = array("q")
        self._memory: dict[int, bytes | memoryview] = {}
        self._may_go: deque[int] = deque()  # droppable frames in memory: FRAME_KIND_TICKS
        self._bytes = 0  # total size of these frames
        self._file: BinaryIO | None = None

    def __len__(self) -> int:
        return len(self._size)  # `append` extends this array last

    @overload
    def __getitem__(self, index: int) -> StoredFrame: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[StoredFrame]: ...
    def __getitem__(self, index: int | slice) -> StoredFrame | Sequence[StoredFrame]:
        if isinstance(index, slice):
            return [StoredFrame(self, at) for at in range(*index.indices(len(self)))]
        if index >= len(self):
            raise IndexError(index)
        return StoredFrame(self, index)

    def read_from(self, path: Path) -> None:
        """Open the file that the places of `append` refer to; it may be renamed or deleted later."""
        self._file = path.open("rb")

    def append(self, payload: Payload, place: int | None = None) -> None:
        """Add a frame; `place`: offset of its bytes in the file, or None if they are not there."""
        index = len(self)
        self.kinds.append(payload.kind)
        self.ticks.append(payload.tick)
        self._place.append(NOWHERE if place is None else place)
        self._size.append(len(payload.data))
        if place is None and payload.kind in (FRAME_KIND_TICKS, FRAME_KIND_CONDITIONS):
            self._memory[index] = payload.data
        if place is None and payload.kind == FRAME_KIND_TICKS:
            self._may_go.append(index)
            self._bytes += len(payload.data)
            self._keep_to_budget()

    def _keep_to_budget(self) -> None:
        while self._bytes > self.budget and len(self._may_go) > 1:
            index = self._may_go.popleft()
            self._bytes -= len(self._memory.pop(index))
            self.first = self.ticks[index]

    def bytes_of(self, index: int) -> bytes:
        """The bytes of a frame."""
        if index in self._memory:
            return bytes(self._memory[index])
        place, size = self._place[index], self._size[index]
        if place == NOWHERE or self._file is None:
            raise InputError(f"the part of the run before tick {self.first:,} is no longer stored")
        self._file.seek(place)
        data = self._file.read(size)
        if len(data) < size:
            raise InputError("the recording was truncated while it was written", self._name)
        return data

    @property
    def _name(self) -> str:
        return "" if self._file is None else str(self._file.name)


DIGEST_TICKS: Final = 64  # digests of every tick would fill most of a small fleet's recording


class LiveRecorder(BaseRecorder):
    """Stores the frames of a run in a file, or in memory within a budget."""

    digest_every = DIGEST_TICKS

    def __init__(self, resolved: Resolved, seed: int, path: Path | None = None) -> None:
        """Raises InputError if the file cannot be written."""
        self._store = FrameStore()
        self.frames = StoredFrames(self._store)
        self.write_error = ""  # the error that stopped writing
        self.file = None if path is None else RecordingFile(path)
        self._size = PREAMBLE.size  # of the file
        if self.file is not None:
            self._store.read_from(self.file.part)
        super().__init__(resolved, seed)

    @property
    def first(self) -> int:
        """Only ticks after this one can be replayed."""
        return self._store.first

    def write(self, kind: int, content: Content) -> None:
        payload = payload_of(kind, content)
        place = self._written(payload)
        if kind != FRAME_KIND_HEADER:
            self._store.append(payload, place)

    def _written(self, payload: Payload) -> int | None:
        """Write a frame; return the offset of its bytes. A full disk ends the file, not the run."""
        if self.file is None or self.write_error:
            return None
        place = self._size + FRAME.size
        try:
            self.file.write(payload)
        except OSError as error:
            self.write_error = f"{self.file.path}: recording has stopped: {error.strerror}"
            self.abandon()
            return None
        self._size = place + len(payload.data)
        return place

    def abandon(self) -> None:
        """Stop writing; the written part stays as FILE.part, and an older FILE is unchanged."""
        if self.file is not None:
            with contextlib.suppress(OSError):  # unwritten bytes are flushed once more
                self.file.abandon()

    def discard(self) -> None:
        """Delete the file of a failed run, but leave an older one unchanged."""
        self.abandon()
        if self.file is not None:
            self.file.part.unlink(missing_ok=True)

    def close(self) -> None:
        """Write what is pending and give the file its name."""
        if self._simulation is not None and not self.ended:
            self(self._simulation)
            self.flush()
        if self.file is not None and not self.write_error:
            try:
                self.file.close()
            except OSError as error:
                self.write_error = (
                    f"{self.file.path}: cannot finish the recording: {error.strerror}"
                )


# Two live runs side by side.


class LiveDivergence:
    """Searches for the tick at which two live runs diverge, as far as both are computed.

    Frames are compared only when positions or operations differ, since a comparison writes short
    frames to the recordings.
    """

    def __init__(self, one: LiveRun, other: LiveRun) -> None:
        self._runs = (one, other)
        same = begin_alike(one.header, other.header)
        self._settled = not same
        self.result: Divergence | None = None if same else Divergence(0, DIFFERENT_START)
        self._compared_until = 0

    def look(self) -> Divergence | None:
        """Compare the new ticks; None as long as the runs are equal and one of them continues."""
        one, other = (run.leading_simulation for run in self._runs)
        ended = all(run.end is not None for run in self._runs)
        tick = min(one.tick, other.tick)
        if self._settled or not (ended or (tick > self._compared_until and _differ(one, other))):
            return self.result
        for run in self._runs:
            run.recorder.flush()
        mine, its = (run.frames for run in self._runs)
        try:
            new = self._compared_until + 1
            self.result = compared(mine, its) if ended else first_action(mine, its, new)
        except InputError:
            text = "the runs differ; the first different tick is no longer stored"
            self.result = Divergence(None, text)
        self._settled = self.result is not None
        self._compared_until = tick
        return self.result


def _differ(one: Simulation, other: Simulation) -> bool:
    """Whether positions or numbers of operations differ at the same tick."""
    if one.tick != other.tick:
        return False
    first, second = (simulation.world for simulation in (one, other))
    mine, its = (world.robots.at_index for world in (first, second))
    same = np.array_equal(first.robots.cell[mine], second.robots.cell[its])
    operations = first.tally.operations[mine], second.tally.operations[its]
    return not (same and np.array_equal(*operations))
