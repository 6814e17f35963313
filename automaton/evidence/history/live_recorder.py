"""A recorder that keeps its frames at hand, so that one can go back while the run goes on."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Final

from automaton.build.resolve import Resolved
from automaton.evidence.history.frame_store import FRAME_STORE_BYTES, FrameStore
from automaton.evidence.recording.frames import (
    FRAME,
    FRAME_KIND_HEADER,
    PREAMBLE,
    Content,
    Payload,
    StoredFrames,
    payload_of,
)
from automaton.evidence.recording.recorder import BaseRecorder, RecordingFile

DIGEST_TICKS: Final = 64  # digests of every tick would be most of a small fleet's recording


class LiveRecorder(BaseRecorder):
    """Keeps a run's frames: in a file if one is given, otherwise in memory within a budget."""

    digest_every = DIGEST_TICKS

    def __init__(
        self,
        resolved: Resolved,
        seed: int,
        path: Path | None = None,
        budget: int = FRAME_STORE_BYTES,
    ) -> None:
        """Raises InputError if the file cannot be written."""
        self._store = FrameStore(budget)
        self.frames = StoredFrames(self._store)
        self.write_error = ""  # why the file is not written any more
        self.file = None if path is None else RecordingFile(path)
        self._size = PREAMBLE.size  # of the file
        if self.file is not None:
            self._store.read_from(self.file.part)
        super().__init__(resolved, seed)

    @property
    def first(self) -> int:
        """The ticks after this one can be played again."""
        return self._store.first

    def write(self, kind: int, content: Content) -> None:
        payload = payload_of(kind, content)
        place = self._written(payload)
        if kind != FRAME_KIND_HEADER:
            self._store.append(payload, place)

    def _written(self, payload: Payload) -> int | None:
        """Where in the file its bytes are; a full disk ends the file, not the run."""
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
        """Write no more; what is there stays as FILE.part, an older FILE as it is."""
        if self.file is not None:
            with contextlib.suppress(OSError):  # what could not be written is tried once more
                self.file.abandon()

    def discard(self) -> None:
        """Nothing came of this run: leave no file, and an older one alone."""
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
