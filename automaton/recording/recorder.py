"""Recorders: write the buffers of a running simulation as frames, to a file or to memory.

with Recorder(path, resolved, seed) as recorder:
    simulation = Simulation(resolved, seed, on_record=recorder)
    simulation.run()
    recorder.end()
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, Final, Self

import numpy as np

from automaton.atomic_write import put_in_place
from automaton.engine.decision_stream import words_until
from automaton.engine.digest import DIGEST_NAMES
from automaton.engine.observed_ticks import show_ticks
from automaton.engine.record_codes import KEYFRAME_TICKS
from automaton.engine.state import STRATEGY_COUNT, Array, Clock, Record
from automaton.errors import InputError
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_HEADER,
    FRAME_KIND_KEYFRAME,
    FRAME_KIND_TICKS,
    FRAME_TICKS,
    KEYFRAME_ARRAYS,
    Content,
    DecodedFrame,
)
from automaton.recording.frames import (
    Chain,
    Payload,
    Recording,
    header_of,
    payload_of,
    preamble,
    rules_of,
    state_of,
)
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.text_files import is_recording
from automaton.world.building import build_world, digest_interval
from automaton.world.resolved import Resolved

FRAME_SECONDS = 1.0  # data that a killed process may lose
# Most bytes of decisions and changes from several calls in one frame.
FRAME_BYTES = 16 << 20

Rows = tuple[Array, Array, Array, Array]  # actions (T, n), decisions (Y,), changes (X, 4), digests


class BaseRecorder:
    """The base of recorders: give one to Simulation as `on_record`; subclasses `write` frames."""

    digest_every: ClassVar[int | None] = None  # ticks between digests; None: by size

    def __init__(self, resolved: Resolved, seed: int) -> None:
        resolved = resolved.of_seed(seed)
        self._start, _ = build_world(resolved, seed)
        found = header_of(resolved, seed, self._start, DIGEST_NAMES)
        every = self.digest_every or digest_interval(self._start)
        self.header = {**found, "digest_every": every}
        self.ended = False
        self._simulation: Simulation | None = None
        self._pending: list[Rows] = []
        self._first = 1  # tick of the first pending row
        self._held = 0  # pending ticks
        self._keyframe_at = 0
        self._flushed_at = time.monotonic()
        self.write(FRAME_KIND_HEADER, self.header)

    def write(self, kind: int, content: Content) -> None:
        """Store a frame."""
        raise NotImplementedError

    def __call__(self, simulation: Simulation) -> None:
        """Take over the buffers of a simulation, and empty them."""
        self._begin(simulation)
        world, record = simulation.world, simulation.record
        rows = int(world.clock.recorded_ticks)
        if rows:
            if self._held + rows > FRAME_TICKS or self._bytes > FRAME_BYTES:
                self.flush()
            self._pending.append(self._rows(world.clock, record, rows))
            self._held += rows
        simulation.empty_record()
        due = time.monotonic() - self._flushed_at >= FRAME_SECONDS
        if self._held >= FRAME_TICKS or due:
            self.flush()
        tick = self._first + self._held - 1
        if tick % KEYFRAME_TICKS == 0 and tick > self._keyframe_at and world.clock.tick == tick:
            self.flush()
            self._keyframe(world)

    @property
    def _bytes(self) -> int:
        return sum(part[1].nbytes + part[2].nbytes for part in self._pending)

    def _begin(self, simulation: Simulation) -> None:
        """Before the first tick: write the initial conditions and the state."""
        if self._simulation is None:
            rules = rules_of(simulation)
            self.write(FRAME_KIND_CONDITIONS, {**rules, "tick": 0})
            self._keyframe(self._start)
        self._simulation = simulation

    def _rows(self, clock: Clock, record: Record, rows: int) -> Rows:
        # After an interrupt the buffers may hold rows of an unfinished tick: drop them.
        last = self._first + self._held + rows - 1
        changes = record.changes[: clock.change_rows]
        decisions = record.decisions[
            : words_until(record.decisions, int(clock.decision_words), last)
        ]
        kept = changes[changes[:, 0] <= last].copy()
        return record.executed[:rows].copy(), decisions.copy(), kept, record.digests[:rows].copy()

    def change(self, simulation: Simulation, settings: tuple[str, ...]) -> None:
        """The run continues as `simulation`, which was changed after this tick."""
        self.flush()
        self._simulation = simulation
        simulation.world.clock.digest_every = self.header["digest_every"]
        self.write(FRAME_KIND_CONDITIONS, rules_of(simulation, settings))

    def flush(self) -> None:
        """Write the pending ticks as a frame."""
        self._flushed_at = time.monotonic()
        if not self._pending:
            return
        parts = zip(*self._pending, strict=True)
        did, decisions, changes, digests = (np.concatenate(part) for part in parts)
        self._pending = []
        content = {
            "first": self._first,
            "executed": did,
            "decisions": decisions,
            "changes": changes,
            "digests": digests,
        }
        self.write(FRAME_KIND_TICKS, content)
        self._first += len(did)
        self._held = 0

    def end(self) -> None:
        """Write the last state, the outcome of the run and its metrics; this is the last frame."""
        if self.ended:
            return
        simulation = self._simulation
        if simulation is not None:
            self(simulation)
            self.flush()
            if simulation.tick > self._keyframe_at:
                self._keyframe(simulation.world)
            self.write(
                FRAME_KIND_END,
                {
                    "ticks": simulation.tick,
                    "finished": simulation.finished,
                    "digest": simulation.digest,
                    "metrics": metrics_of(simulation),
                },
            )
        self.ended = True

    def _keyframe(self, world: Any) -> None:
        state = state_of(world, KEYFRAME_ARRAYS)
        self._keyframe_at = int(world.clock.tick)
        self.write(FRAME_KIND_KEYFRAME, {"tick": self._keyframe_at, **state})


class MemoryRecorder(BaseRecorder):
    """Keeps the frames in a list, for tests and for immediate playback."""

    def __init__(self, resolved: Resolved, seed: int | None = None) -> None:
        self.frames: list[DecodedFrame] = []
        super().__init__(resolved, resolved.scenario.seed if seed is None else seed)

    def write(self, kind: int, content: Content) -> None:
        if kind != FRAME_KIND_HEADER:
            self.frames.append(DecodedFrame(kind, content))

    def recording(self) -> Recording:
        """The recording up to now; the run ends here."""
        self.end()
        return Recording(self.header, self.frames, complete=True)


class RecordingFile:
    """The file of a recording in progress.

    It is written as FILE.part and renamed when closed, so only a finished run replaces an existing
    file. Raises InputError if it cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.part = self.path.with_name(self.path.name + ".part")
        if self.path.is_dir():
            raise InputError("cannot write the recording: the path is a folder", str(path))
        try:
            if self.path.exists() and not is_recording(self.path):
                raise InputError("exists and is not a recording; not overwritten", str(path))
            self._file = self.part.open("wb")
        except OSError as error:
            raise InputError(f"cannot write the recording: {error.strerror}", str(path)) from None
        self._file.write(preamble())
        self._chain = Chain()

    def write(self, payload: Payload) -> None:
        """Append a frame; it persists even if this process dies."""
        self._file.write(self._chain.framed(payload))
        self._file.flush()

    def close(self) -> None:
        """Rename the file to its final name."""
        if self._file.closed:
            return
        os.fsync(self._file.fileno())
        self._file.close()
        put_in_place(self.part, self.path)

    def abandon(self) -> None:
        """Keep the data as FILE.part, and an older FILE unchanged."""
        self._file.close()


class Recorder(BaseRecorder):
    """Writes a recording to a file. Raises InputError if it cannot be written."""

    def __init__(self, path: str | Path, resolved: Resolved, seed: int) -> None:
        self._file = RecordingFile(path)
        super().__init__(resolved, seed)

    def write(self, kind: int, content: Content) -> None:
        self._file.write(payload_of(kind, content))

    def close(self) -> None:
        """Rename the file to its final name; without `end` before, it counts as cut short."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.end()
        elif not self.ended and self._simulation is not None:
            self(self._simulation)
            self.flush()
        if kind is None or issubclass(kind, KeyboardInterrupt):
            self.close()
        else:
            self._file.abandon()  # the run failed


# An observed run: its ticks are known in advance, without decisions and digests.


NO_DIGEST: Final = "0" * 16


class ObservedRecorder(Recorder):
    """Writes an observed run to a file. Raises InputError if it cannot be written."""

    def __init__(self, path: str | Path, resolved: Resolved, observed: Content) -> None:
        """`observed`: the part of the header that only observed runs have."""
        self._observed = observed
        self.shown = Simulation(
            resolved,
            on_observe=Simulation.empty_observation,
            strategies=(None,) * STRATEGY_COUNT,
        )
        super().__init__(path, resolved, resolved.scenario.seed)

    def write(self, kind: int, content: Content) -> None:
        if kind == FRAME_KIND_HEADER:
            self.header = content = {**content, "observed": self._observed}
        super().write(kind, content)

    def write_ticks(self, executed: Array, changes: Array) -> None:
        """Write all ticks and the end, and show them in `shown`.

        executed: (T + 1, n) uint16 actions, from tick 0. changes: (k, 4) int64 rows (tick, code,
        identity, value), by tick.
        """
        simulation = self.shown
        self.write(FRAME_KIND_CONDITIONS, rules_of(simulation))
        self._keyframe(simulation.world)
        self._show({"first": 0, "executed": executed[:1], "changes": self._observed["first"]}, 0)
        for first in range(1, len(executed), FRAME_TICKS):
            last = min(first + FRAME_TICKS, len(executed)) - 1
            begin, end = np.searchsorted(changes[:, 0], (first, last + 1))
            content = {
                "first": first,
                "executed": executed[first : last + 1],
                "decisions": np.zeros(0, np.int64),
                "changes": changes[begin:end],
                "digests": np.zeros(
                    (last + 1 - first, len(self.header["digest_names"])), np.uint64
                ),
            }
            self.write(FRAME_KIND_TICKS, content)
            self._show(content, last)
            if last % KEYFRAME_TICKS == 0 or last == len(executed) - 1:
                self._keyframe(simulation.world)
        end_of_run = {"ticks": simulation.tick, "finished": True, "digest": NO_DIGEST}
        self.write(FRAME_KIND_END, {**end_of_run, "metrics": metrics_of(simulation)})
        self.ended = True

    def _show(self, content: Content, last: int) -> None:
        world, observation = self.shown.world, self.shown.observation
        executed = np.array(content["executed"], np.uint16, order="C")
        changes = np.array(content["changes"], np.int64, order="C")
        while True:
            show_ticks(world, observation, executed, changes, content["first"], last)
            self.shown.empty_observation()
            if self.shown.tick >= last:
                return
