"""The frames of a run under way: on the disk where it is recorded, else in memory within a budget."""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final, overload

from automaton.errors import InputError
from automaton.evidence.recording.frames import FRAME_KIND_CONDITIONS, FRAME_KIND_TICKS, Payload

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
        """The last one that it tells of."""
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

    def __init__(self, budget: int = FRAME_STORE_BYTES) -> None:
        self.budget = budget
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
        """The file that `append` tells places of, even when it gets another name or none."""
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
