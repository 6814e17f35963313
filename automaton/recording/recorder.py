"""Recorders: they empty the buffers of a running simulation into frames, in a file or in memory.

with Recorder(path, resolved, seed) as recorder:
    simulation = Simulation(resolved, seed, on_record=recorder)
    simulation.run()
    recorder.end(metrics)
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from automaton.errors import InputError
from automaton.kernels.digest import DIGEST_NAMES
from automaton.recording.frames import (
    END,
    HEADER,
    KEYFRAME,
    MAGIC,
    TICKS,
    Content,
    Frame,
    Recording,
    encode,
    preamble,
)
from automaton.recording.header import header_of, state_of
from automaton.scenario.resolve import Resolved
from automaton.simulation import Simulation
from automaton.world.build import build_world
from automaton.world.state import CHANGED, RECORDED, TICK, Array

FRAME_TICKS = 256  # at most in a frame
FRAME_SECONDS = 1.0  # what a killed process may lose
KEYFRAME_TICKS = 2048

# Routes are left out: they are the bulk of a state, and committed actions do not need them.
KEYFRAME_ARRAYS = {
    "robots": (
        *("cell", "claim", "heading", "travel", "action", "busy", "priority", "load", "order"),
        *("slot", "goal", "stand", "stay", "try_drop", "withdrawing", "blocked", "hold", "parked"),
        *("zone", "need", "reason"),
    ),
    "orders": ("state", "place", "by", "released", "delivered", "legs"),
    "slots": ("content", "by"),
}

Rows = tuple[Array, Array, Array]  # did (T, n), changes (X, 4), digests (T, D)


class Capture:
    """What all recorders do: give one to Simulation as `on_record`; subclasses `write` frames."""

    def __init__(self, resolved: Resolved, seed: int) -> None:
        world, _ = build_world(resolved, seed)
        self.header = header_of(resolved, seed, world, DIGEST_NAMES)
        self.ended = False
        self._simulation: Simulation | None = None
        self._pending: list[Rows] = []
        self._first = 1  # tick of the first pending row
        self._held = 0  # pending ticks
        self._next_keyframe = KEYFRAME_TICKS
        self._flushed_at = time.monotonic()
        self.write(HEADER, self.header)
        self._keyframe(world)

    def write(self, kind: int, content: Content) -> None:
        """Keep a frame."""
        raise NotImplementedError

    def __call__(self, simulation: Simulation) -> None:
        """Take what the buffers of a simulation hold, and empty them."""
        self._simulation = simulation
        world, record = simulation.world, simulation.record
        rows = int(world.clock[RECORDED])
        changes = record.changes[: world.clock[CHANGED]]
        if rows:
            # After an interrupt the changes of an unfinished tick may be there: they are not kept.
            last = self._first + self._held + rows - 1
            kept = changes[changes[:, 0] <= last].copy()
            self._pending.append((record.did[:rows].copy(), kept, record.digests[:rows].copy()))
            self._held += rows
        world.clock[RECORDED] = 0
        world.clock[CHANGED] = 0
        due = time.monotonic() - self._flushed_at >= FRAME_SECONDS
        if self._held >= FRAME_TICKS or due:
            self.flush()
        tick = self._first + self._held - 1
        if tick >= self._next_keyframe and world.clock[TICK] == tick:
            self.flush()
            self._keyframe(world)
            self._next_keyframe = tick + KEYFRAME_TICKS

    def flush(self) -> None:
        """Write the pending ticks as frames."""
        self._flushed_at = time.monotonic()
        if not self._pending:
            return
        did, changes, digests = (np.concatenate(part) for part in zip(*self._pending, strict=True))
        self._pending = []
        for begin in range(0, len(did), FRAME_TICKS):
            part = slice(begin, begin + FRAME_TICKS)
            first = self._first + begin
            inside = (changes[:, 0] >= first) & (changes[:, 0] < first + FRAME_TICKS)
            self.write(
                TICKS,
                {
                    "first": first,
                    "did": did[part],
                    "changes": changes[inside],
                    "digests": digests[part],
                },
            )
        self._first += len(did)
        self._held = 0

    def end(self, metrics: Content | None = None) -> None:
        """Write the last state and how the run ended; nothing can be recorded after it."""
        if self.ended:
            return
        simulation = self._simulation
        if simulation is not None:
            self(simulation)
            self.flush()
            self._keyframe(simulation.world)
            self.write(
                END,
                {
                    "ticks": simulation.tick,
                    "finished": simulation.finished,
                    "digest": simulation.digest,
                    "metrics": metrics or {},
                },
            )
        self.ended = True

    def _keyframe(self, world: Any) -> None:
        state = state_of(world, KEYFRAME_ARRAYS)
        self.write(KEYFRAME, {"tick": int(world.clock[TICK]), **state})


class MemoryRecorder(Capture):
    """Keeps the frames in a list, for tests and for whoever looks at a run at once."""

    def __init__(self, resolved: Resolved, seed: int | None = None) -> None:
        self.frames: list[Frame] = []
        super().__init__(resolved, resolved.scenario.seed if seed is None else seed)

    def write(self, kind: int, content: Content) -> None:
        if kind != HEADER:
            self.frames.append(Frame(kind, content))

    def recording(self) -> Recording:
        """What was recorded so far; the run ends here."""
        self.end()
        return Recording(self.header, self.frames, complete=True)


class Recorder(Capture):
    """Writes a recording to a file.

    It grows as FILE.part and takes its name when the run is over or interrupted, so that a file
    of that name is replaced only by a run that has an end. Raises InputError if it cannot write.
    """

    def __init__(self, path: str | Path, resolved: Resolved, seed: int) -> None:
        self.path = Path(path)
        self.part = self.path.with_name(self.path.name + ".part")
        if self.path.is_dir():
            raise InputError("cannot write the recording: this is a folder", str(path))
        try:
            if self.path.exists() and not self.path.read_bytes()[: len(MAGIC)] == MAGIC:
                raise InputError("is no recording, so it is not replaced by one", str(path))
            self._file = self.part.open("wb")
        except OSError as error:
            raise InputError(f"cannot write the recording: {error.strerror}", str(path)) from None
        self._file.write(preamble())
        super().__init__(resolved, seed)

    def write(self, kind: int, content: Content) -> None:
        self._file.write(encode(kind, content))
        self._file.flush()

    def close(self) -> None:
        """Give the file its name; without `end` before, it counts as cut short."""
        if self._file.closed:
            return
        os.fsync(self._file.fileno())
        self._file.close()
        os.replace(self.part, self.path)

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
            self._file.close()  # a run that failed leaves FILE.part and an older FILE alone
