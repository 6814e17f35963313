"""A recorder that keeps its frames at hand, so that one can go back while the run goes on."""

from __future__ import annotations

import contextlib
from pathlib import Path

from automaton.recording.frames import HEADER, Content, Payload, StoredFrames, framed, payload_of
from automaton.recording.recorder import Capture, RecordingFile
from automaton.scenario.resolve import Resolved

DIGEST_EVERY = 64  # ticks; digests of every tick would be most of a small fleet's recording


class Journal(Capture):
    """Keeps a run's frames in memory, and in a file once it is told to."""

    def __init__(self, resolved: Resolved, seed: int) -> None:
        self._payloads: list[Payload] = []
        self._head: Payload | None = None
        self.frames = StoredFrames(self._payloads)
        self.file: RecordingFile | None = None
        self.trouble = ""  # why the file is not written any more
        super().__init__(resolved, seed)

    def write_to(self, path: Path) -> None:
        """Write all frames to a file, too, from the first on. Raises InputError if it cannot."""
        assert self._head is not None
        self.file = RecordingFile(path)
        for payload in (self._head, *self._payloads):
            self._append(payload)

    def write(self, kind: int, content: Content) -> None:
        payload = payload_of(kind, content)
        if kind == HEADER:
            self._head = payload
        else:
            self._payloads.append(payload)
        self._append(payload)

    def _append(self, payload: Payload) -> None:
        """A full disk ends the file, not the run."""
        if self.file is None or self.trouble:
            return
        try:
            self.file.write(framed(payload))
        except OSError as error:
            self.trouble = f"{self.file.path}: recording has stopped: {error.strerror}"
            self.abandon()

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
        if self.file is not None and not self.trouble:
            try:
                self.file.close()
            except OSError as error:
                self.trouble = f"{self.file.path}: cannot finish the recording: {error.strerror}"
