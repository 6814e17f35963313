"""A recorder that keeps its frames at hand, so that one can go back while the run goes on."""

from __future__ import annotations

import contextlib
from array import array
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final, overload

from automaton.errors import InputError
from automaton.evidence.recording.frames import (
    FRAME,
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_HEADER,
    FRAME_KIND_TICKS,
    PREAMBLE,
    Content,
    Payload,
    StoredFrames,
    payload_of,
)
from automaton.evidence.recording.recorder import BaseRecorder, RecordingFile
from automaton.world.resolve import Resolved

# bytes of frames in memory: millions of ticks of a small fleet
FRAME_STORE_BYTES: Final = 128 * 1024 * 1024
NOWHERE: Final = -1  # place of a frame that is in memory, or not kept


@dataclass(frozen=True, slots=True)
class StoredFrame:
    """One frame of a store; its bytes are fetched when they are asked for."""

    store: FrameStore
    index: int

    @property
    def kind(self) -> int:
        return self.store.kinds[self.index]

    @property
    def tick(self) -> int:
        """The last one that it covers."""
        return self.store.ticks[self.index]

    @property
    def data(self) -> bytes:
        """Compressed. Raises InputError if it is not kept, or not on the disk any more."""
        return self.store.bytes_of(self.index)


class FrameStore(Sequence[StoredFrame]):
    """Frames in their order.

    In memory only those are kept that playing needs, FRAME_KIND_TICKS and FRAME_KIND_CONDITIONS;
    when the former outgrow the budget, the oldest go: the past begins later then.
    """

    def __init__(self) -> None:
        self.budget = FRAME_STORE_BYTES
        self.kinds = array("b")
        self.ticks = array("q")
        self.first = 0  # what was before the ticks after this one is not kept
        self._place = array("q")  # of its bytes in the file, or NOWHERE
        self._size = array("q")
        self._memory: dict[int, bytes | memoryview] = {}
        self._may_go: deque[int] = deque()  # FRAME_KIND_TICKS frames in memory
        self._bytes = 0  # of them
        self._file: BinaryIO | None = None

    def __len__(self) -> int:
        return len(self._size)  # appended to last

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
        """The file that the places of `append` refer to, even when it gets another name or none."""
        self._file = path.open("rb")

    def append(self, payload: Payload, place: int | None = None) -> None:
        """Add a frame; `place`: where in the file its bytes begin, None if they are not there."""
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
            raise InputError(f"what happened before tick {self.first:,} is not kept any more")
        self._file.seek(place)
        data = self._file.read(size)
        if len(data) < size:
            raise InputError("the recording has become shorter while it was written", self._name)
        return data

    @property
    def _name(self) -> str:
        return "" if self._file is None else str(self._file.name)


DIGEST_TICKS: Final = 64  # digests of every tick would be most of a small fleet's recording


class LiveRecorder(BaseRecorder):
    """Keeps a run's frames: in a file if one is given, otherwise in memory within a budget."""

    digest_every = DIGEST_TICKS

    def __init__(self, resolved: Resolved, seed: int, path: Path | None = None) -> None:
        """Raises InputError if the file cannot be written."""
        self._store = FrameStore()
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
