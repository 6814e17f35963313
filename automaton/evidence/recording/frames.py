"""The file of a recorded run: append-only frames, each sealed together with all before it.

    preamble   magic, format version
    frame      kind, length, last tick, CRC-32 of these, seal | payload: zlib(msgpack)
    ...        HEADER, CONDITIONS, KEYFRAME at tick 0, TICKS ..., KEYFRAME ..., END

The seal of a frame is a hash of the seal before it and of the frame; its CRC begins with the seal
before it as well. So only an end that is missing goes unnoticed: such a file is *cut short*, and
reads to its last whole frame. Whatever is changed, missing in the middle or doubled is *damage*.
Who alters a recording can compute seals as well: `verify` runs it again.
Arrays are stored little-endian; what repeats from tick to tick is stored so that zlib sees it.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, NamedTuple, Protocol

import msgspec
import numpy as np

from automaton.errors import InputError
from automaton.evidence.recording.contents import FRAME_KIND_CONDITIONS as FRAME_KIND_CONDITIONS
from automaton.evidence.recording.contents import FRAME_KIND_END as FRAME_KIND_END
from automaton.evidence.recording.contents import FRAME_KIND_HEADER as FRAME_KIND_HEADER
from automaton.evidence.recording.contents import FRAME_KIND_KEYFRAME as FRAME_KIND_KEYFRAME
from automaton.evidence.recording.contents import FRAME_KIND_TICKS as FRAME_KIND_TICKS
from automaton.evidence.recording.contents import Content as Content
from automaton.evidence.recording.contents import Frame as Frame
from automaton.evidence.recording.contents import array_out, read_content, unpacked_ticks
from automaton.evidence.recording.listed_orders import pack_listed, unpack_listed

RECORDING_FORMAT: Final = 6
MAGIC: Final = b"\x93AUTOMATON\r\n"  # not text, and spoilt by a transfer that changes line ends
PREAMBLE: Final = struct.Struct("<12sH")  # magic, format
FRAME: Final = struct.Struct("<BIQI16s")  # kind, bytes of the payload, tick, CRC-32, seal
CHECKED: Final = struct.Struct("<BIQ")  # the part of FRAME that the CRC covers

DECODED: Final = 4  # FRAME_KIND_TICKS frames that stay decoded
COMPRESSION: Final = 5  # of zlib: 6 takes 1.7 times as long for 3 % less


class Stored(Protocol):
    """One frame as it is stored, wherever its bytes are."""

    @property
    def kind(self) -> int: ...

    @property
    def tick(self) -> int:
        """The last one that it tells of."""

    @property
    def data(self) -> bytes | memoryview:
        """Compressed."""


class Payload(NamedTuple):
    """One frame as it is stored, with its bytes."""

    kind: int
    tick: int  # the last one that it tells of
    data: bytes | memoryview  # compressed
    at: int = 0  # where in a file it begins
    before: int = 0  # the last tick of the frames before it


Reader = Callable[[int, Any], Content]  # (number of the frame behind the header, the frame)


class StoredFrames:
    """The checked frames of a file or of a run under way, decoded one at a time as they are asked for.

    FRAME_KIND_TICKS frames can be found by tick; the last ones that were used stay decoded. `read`:
    checks what it decodes; frames of this process need no check.
    """

    def __init__(self, payloads: Sequence[Stored], read: Reader | None = None) -> None:
        self.payloads = payloads
        self.read = read
        self._last = array("q")  # the last tick of each FRAME_KIND_TICKS frame
        self._index_of = array("q")
        self._rules: list[Content] = []
        self._indexed = 0
        self._decoded: dict[int, Content] = {}

    def __iter__(self) -> Iterator[Frame]:
        for index, payload in enumerate(self.payloads):
            yield Frame(payload.kind, self._content(index))

    @property
    def last_tick(self) -> int:
        """The last tick that is there."""
        self._index()
        return self._last[-1] if self._last else 0

    def rules_at(self, tick: int) -> Content:
        """What holds in the tick after `tick`. Raises InputError if the frame is lost."""
        self._index()
        found = [rules for rules in self._rules if rules["tick"] <= tick]
        if not found:
            raise InputError("the recording is cut short before its first tick")
        return found[-1]

    def next_rules(self, tick: int) -> int | None:
        """The first tick after `tick` at which other rules begin to hold; None if none do."""
        self._index()
        return min((r["tick"] for r in self._rules if r["tick"] > tick), default=None)

    def ticks_with(self, tick: int) -> Content | None:
        """The FRAME_KIND_TICKS frame that holds a tick; None after the last one."""
        self._index()
        place = bisect_left(self._last, tick)
        if place == len(self._last):
            return None
        index = self._index_of[place]
        if index not in self._decoded:
            while len(self._decoded) >= DECODED:
                del self._decoded[next(iter(self._decoded))]
            self._decoded[index] = self._content(index)
        return self._decoded[index]

    def _content(self, index: int) -> Content:
        payload = self.payloads[index]
        if self.read is not None:
            return self.read(index, payload)
        return decode(payload.kind, payload.data)

    def _index(self) -> None:
        for index in range(self._indexed, len(self.payloads)):
            payload = self.payloads[index]
            if payload.kind == FRAME_KIND_TICKS:
                self._last.append(payload.tick)
                self._index_of.append(index)
            elif payload.kind == FRAME_KIND_CONDITIONS:
                self._rules.append(self._content(index))
        self._indexed = len(self.payloads)


@dataclass(frozen=True)
class Recording:
    """A recorded run, from a file or in memory; `frames` can be gone through again and again."""

    header: Content
    frames: Iterable[Frame]  # after the header
    complete: bool  # the FRAME_KIND_END frame is there: it was not cut short

    @property
    def ticks(self) -> int:
        """Ticks that are recorded."""
        if isinstance(self.frames, StoredFrames):
            return self.frames.last_tick
        return max((tick_of(kind, content) for kind, content in self.frames), default=0)

    def stored(self) -> StoredFrames:
        """The frames in the form in which ticks can be found."""
        if isinstance(self.frames, StoredFrames):
            return self.frames
        return StoredFrames([payload_of(kind, content) for kind, content in self.frames])


def preamble() -> bytes:
    """The first bytes of every recording."""
    return PREAMBLE.pack(MAGIC, RECORDING_FORMAT)


def tick_of(kind: int, content: Content) -> int:
    """The last tick that a frame tells of."""
    if kind == FRAME_KIND_HEADER:
        return 0
    if kind == FRAME_KIND_TICKS:
        return int(content["first"]) + len(content["executed"]) - 1
    return int(content["ticks" if kind == FRAME_KIND_END else "tick"])


def payload_of(kind: int, content: Content) -> Payload:
    """A frame as it is stored."""
    packed = content
    if kind == FRAME_KIND_TICKS:
        packed = _pack_ticks(content)
    elif kind in (FRAME_KIND_HEADER, FRAME_KIND_CONDITIONS):
        packed = pack_listed(content)
    data = zlib.compress(msgspec.msgpack.encode(packed, enc_hook=array_out), COMPRESSION)
    return Payload(kind, tick_of(kind, content), data)


class Chain:
    """Ties each frame of a file to all those before it."""

    def __init__(self) -> None:
        self._seal = hashlib.blake2b(preamble(), digest_size=16).digest()

    def framed(self, payload: Payload) -> bytes:
        """The next frame as bytes of the file."""
        kind, tick, data = payload[:3]
        head = CHECKED.pack(kind, len(data), tick)
        crc = zlib.crc32(head, zlib.crc32(self._seal))
        self._seal = self._sealed(head, data)
        return FRAME.pack(kind, len(data), tick, crc, self._seal) + data

    def leads_to(self, head: bytes) -> bool:
        """Whether this is the head of the frame that comes next."""
        checked = head[: CHECKED.size]
        return bool(zlib.crc32(checked, zlib.crc32(self._seal)) == FRAME.unpack(head)[3])

    def follow(self, head: bytes, data: bytes) -> bool:
        """Go on to the next frame; whether it is what was written."""
        self._seal = self._sealed(head[: CHECKED.size], data)
        return bool(self._seal == FRAME.unpack(head)[4])

    def _sealed(self, head: bytes, data: bytes | memoryview) -> bytes:
        seal = hashlib.blake2b(self._seal, digest_size=16)
        seal.update(head)
        seal.update(data)
        return seal.digest()


def encoded(header: Content, frames: Iterable[Frame]) -> bytes:
    """A whole recording as the bytes of a file."""
    chain = Chain()
    parts = [Frame(FRAME_KIND_HEADER, header), *frames]
    return preamble() + b"".join(chain.framed(payload_of(*part)) for part in parts)


def decode(
    kind: int, payload: bytes | memoryview, sizes: Mapping[str, int] = MappingProxyType({})
) -> Content:
    """The content of a frame, of the right types and of these sizes. Raises Unsound."""
    content = read_content(kind, payload)
    return unpacked_ticks(content, sizes) if kind == FRAME_KIND_TICKS else unpack_listed(content)


def _pack_ticks(content: Content) -> Content:
    """One line per robot and per digest; digests as what changed since those before."""
    due = np.flatnonzero(content["digests"].any(axis=1)).astype(np.int32)
    digests = content["digests"][due]
    changed = digests.copy()
    changed[1:] ^= digests[:-1]
    changes = content["changes"].T.astype(np.int64)
    changes[0] -= content["first"]
    return {
        "first": content["first"],
        "executed": np.ascontiguousarray(content["executed"].T),
        "decisions": content["decisions"],
        "changes": changes.astype(np.int32),
        "due": due,
        "digests": np.ascontiguousarray(changed.T),
    }
