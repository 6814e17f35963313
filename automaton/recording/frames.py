"""The file of a recorded run: append-only frames, each checked by a CRC of its own.

    preamble   magic, format version
    frame      kind, length, last tick, CRC-32 | payload: zlib(msgpack)
    ...        HEADER, CONDITIONS, KEYFRAME at tick 0, TICKS ..., KEYFRAME ..., END

A file cut short at any byte, or damaged, still reads to its last whole frame before that place.
Arrays are stored little-endian; what repeats from tick to tick is stored so that zlib sees it.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError

FORMAT: Final = 2
MAGIC: Final = b"\x93AUTOMATON\r\n"  # not text, and spoilt by a transfer that changes line ends
PREAMBLE: Final = struct.Struct("<12sH")  # magic, format
FRAME: Final = struct.Struct("<BIQI")  # kind, bytes of the payload, tick, CRC-32 of all of it
CHECKED: Final = struct.Struct("<BIQ")  # the part of FRAME that the CRC covers

HEADER: Final = 1  # what the run follows from
TICKS: Final = 2  # decisions, committed actions, changes and digests of consecutive ticks
KEYFRAME: Final = 3  # the state after a tick
END: Final = 4  # how the run ended; a recording without it was cut short
CONDITIONS: Final = (
    5  # what holds from the next tick on: at tick 0, and where a run was branched off
)

DECODED: Final = 4  # TICKS frames that stay decoded
ARRAY_CODE: Final = 1  # msgpack extension: (dtype, shape, bytes)

Content = dict[str, Any]


class Frame(NamedTuple):
    """One frame, decoded."""

    kind: int
    content: Content


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


class StoredFrames:
    """The checked frames of a file or of a run under way, decoded one at a time as they are asked for.

    TICKS frames can be found by tick; the last ones that were used stay decoded.
    """

    def __init__(self, payloads: Sequence[Stored]) -> None:
        self.payloads = payloads
        self._last = array("q")  # the last tick of each TICKS frame
        self._index_of = array("q")
        self._rules: list[Content] = []
        self._indexed = 0
        self._decoded: dict[int, Content] = {}

    def __iter__(self) -> Iterator[Frame]:
        for payload in self.payloads:
            yield Frame(payload.kind, decode(payload.kind, payload.data))

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
            raise InputError("the recording is cut short or damaged before its first tick")
        return found[-1]

    def next_rules(self, tick: int) -> int | None:
        """The first tick after `tick` at which other rules begin to hold; None if none do."""
        self._index()
        return min((r["tick"] for r in self._rules if r["tick"] > tick), default=None)

    def ticks_with(self, tick: int) -> Content | None:
        """The TICKS frame that holds a tick; None after the last one."""
        self._index()
        place = bisect_left(self._last, tick)
        if place == len(self._last):
            return None
        index = self._index_of[place]
        if index not in self._decoded:
            while len(self._decoded) >= DECODED:
                del self._decoded[next(iter(self._decoded))]
            self._decoded[index] = decode(TICKS, self.payloads[index].data)
        return self._decoded[index]

    def _index(self) -> None:
        for index in range(self._indexed, len(self.payloads)):
            payload = self.payloads[index]
            if payload.kind == TICKS:
                self._last.append(payload.tick)
                self._index_of.append(index)
            elif payload.kind == CONDITIONS:
                self._rules.append(decode(CONDITIONS, payload.data))
        self._indexed = len(self.payloads)


@dataclass(frozen=True)
class Recording:
    """A recorded run, from a file or in memory; `frames` can be gone through again and again."""

    header: Content
    frames: Iterable[Frame]  # after the header
    complete: bool  # the END frame is there and nothing is damaged
    damage: str = ""  # where a frame fails its check; "" for a file that is whole or just cut short

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
    return PREAMBLE.pack(MAGIC, FORMAT)


def tick_of(kind: int, content: Content) -> int:
    """The last tick that a frame tells of."""
    if kind == HEADER:
        return 0
    if kind == TICKS:
        return int(content["first"]) + len(content["did"]) - 1
    return int(content["ticks" if kind == END else "tick"])


def payload_of(kind: int, content: Content) -> Payload:
    """A frame as it is stored."""
    packed = _pack_ticks(content) if kind == TICKS else content
    data = zlib.compress(msgspec.msgpack.encode(packed, enc_hook=_array_out), 6)
    return Payload(kind, tick_of(kind, content), data)


def framed(payload: Payload) -> bytes:
    """A frame as bytes of the file, its check included."""
    kind, tick, data = payload
    crc = zlib.crc32(data, zlib.crc32(CHECKED.pack(kind, len(data), tick)))
    return FRAME.pack(kind, len(data), tick, crc) + data


def encode(kind: int, content: Content) -> bytes:
    """A frame as bytes of the file."""
    return framed(payload_of(kind, content))


def decode(kind: int, payload: bytes | memoryview) -> Content:
    """The content of a frame whose check was right."""
    content: Content = msgspec.msgpack.decode(zlib.decompress(payload), ext_hook=_array_in)
    return _unpack_ticks(content) if kind == TICKS else content


def read_recording(path: str | Path) -> Recording:
    """Open a recording and check all its frames.

    Raises InputError for what is no recording, has another format, or lost its header.
    """
    file = str(path)
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"cannot read the recording: {error.strerror}", file) from None
    _check_preamble(data, file)
    payloads, damage = _whole_frames(data)
    if not payloads or payloads[0].kind != HEADER:
        raise InputError("the recording is cut short or damaged before its first frame ends", file)
    header = decode(HEADER, payloads[0].data)
    complete = not damage and payloads[-1].kind == END
    return Recording(header, StoredFrames(payloads[1:]), complete, damage)


def _check_preamble(data: bytes, file: str) -> None:
    if not data:
        raise InputError("the file is empty, not a recording", file)
    if data[: len(MAGIC)] != MAGIC[: len(data)]:
        raise InputError("this is not a recording of automaton", file)
    if len(data) < PREAMBLE.size:
        raise InputError("the recording is cut short before its first frame ends", file)
    version = PREAMBLE.unpack_from(data)[1]
    if version != FORMAT:
        raise InputError(
            f"the recording has format {version}, this version of automaton reads format {FORMAT}",
            file,
        )


def _whole_frames(data: bytes) -> tuple[list[Payload], str]:
    """The frames up to the first one that fails, and how it fails."""
    payloads: list[Payload] = []
    at = PREAMBLE.size
    view = memoryview(data)
    while at + FRAME.size <= len(data):
        kind, length, tick, crc = FRAME.unpack_from(data, at)
        begin = at + FRAME.size
        end = begin + length
        if end > len(data):
            break
        if zlib.crc32(view[begin:end], zlib.crc32(CHECKED.pack(kind, length, tick))) != crc:
            return payloads, f"frame {len(payloads)} at byte {at} is damaged"
        payloads.append(Payload(kind, tick, view[begin:end]))
        at = end
    return payloads, ""


def _array_out(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    little = np.ascontiguousarray(value, value.dtype.newbyteorder("<"))
    described = (little.dtype.str, little.shape, little.tobytes())
    return msgspec.msgpack.Ext(ARRAY_CODE, msgspec.msgpack.encode(described))


def _array_in(code: int, data: memoryview) -> NDArray[Any]:
    if code != ARRAY_CODE:
        raise ValueError(f"unknown extension {code}")
    dtype, shape, content = msgspec.msgpack.decode(data)
    array: NDArray[Any] = np.frombuffer(content, np.dtype(dtype)).reshape(shape)
    return array


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
        "did": np.ascontiguousarray(content["did"].T),
        "decisions": content["decisions"],
        "changes": changes.astype(np.int32),
        "due": due,
        "digests": np.ascontiguousarray(changed.T),
    }


def _unpack_ticks(content: Content) -> Content:
    changes = content["changes"].T.astype(np.int64)
    changes[:, 0] += content["first"]
    did = np.ascontiguousarray(content["did"].T)
    digests = np.zeros((len(did), len(content["digests"])), np.uint64)
    digests[content["due"]] = np.bitwise_xor.accumulate(content["digests"].T, axis=0)
    return {
        "first": content["first"],
        "did": did,
        "decisions": content["decisions"],
        "changes": changes,
        "digests": digests,
    }
