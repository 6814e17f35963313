"""The file of a recorded run: append-only frames, each checked by a CRC of its own.

    preamble   magic, format version
    frame      kind, length, CRC-32 | payload: zlib(msgpack)
    ...        HEADER, then KEYFRAME at tick 0, TICKS ..., KEYFRAME ..., END

A file cut short at any byte, or damaged, still reads to its last whole frame before that place.
Arrays are stored little-endian; what repeats from tick to tick is stored so that zlib sees it.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError

FORMAT: Final = 1
MAGIC: Final = b"\x93AUTOMATON\r\n"  # not text, and spoilt by a transfer that changes line ends
PREAMBLE: Final = struct.Struct("<12sH")  # magic, format
FRAME: Final = struct.Struct("<BII")  # kind, bytes of the payload, CRC-32 of both and the payload
CHECKED: Final = struct.Struct("<BI")  # the part of FRAME that the CRC covers

HEADER: Final = 1  # what the run follows from
TICKS: Final = 2  # committed actions, changes and digests of consecutive ticks
KEYFRAME: Final = 3  # the state after a tick
END: Final = 4  # how the run ended; a recording without it was cut short

ARRAY_CODE: Final = 1  # msgpack extension: (dtype, shape, bytes)

Content = dict[str, Any]


class Frame(NamedTuple):
    """One frame, decoded."""

    kind: int
    content: Content


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
        last = 0
        for kind, content in self.frames:
            if kind == TICKS:
                last = content["first"] + len(content["did"]) - 1
        return last


class StoredFrames:
    """The checked frames of a file's bytes, decoded one at a time as they are asked for."""

    def __init__(self, data: bytes, spans: list[tuple[int, int, int]]) -> None:
        self._data = data
        self._spans = spans  # kind, first byte and end of each payload

    def __iter__(self) -> Iterator[Frame]:
        for kind, begin, end in self._spans:
            yield Frame(kind, decode(kind, self._data[begin:end]))


def preamble() -> bytes:
    """The first bytes of every recording."""
    return PREAMBLE.pack(MAGIC, FORMAT)


def encode(kind: int, content: Content) -> bytes:
    """A frame as bytes, its check included."""
    packed = _pack_ticks(content) if kind == TICKS else content
    payload = zlib.compress(msgspec.msgpack.encode(packed, enc_hook=_array_out), 6)
    crc = zlib.crc32(payload, zlib.crc32(CHECKED.pack(kind, len(payload))))
    return FRAME.pack(kind, len(payload), crc) + payload


def decode(kind: int, payload: bytes) -> Content:
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
    spans, damage = _whole_frames(data)
    if not spans or spans[0][0] != HEADER:
        raise InputError("the recording is cut short or damaged before its first frame ends", file)
    stored = StoredFrames(data, spans)
    header = next(iter(stored)).content
    complete = not damage and spans[-1][0] == END
    return Recording(header, StoredFrames(data, spans[1:]), complete, damage)


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


def _whole_frames(data: bytes) -> tuple[list[tuple[int, int, int]], str]:
    """(kind, begin, end) of the payloads up to the first frame that fails, and how it fails."""
    spans: list[tuple[int, int, int]] = []
    at = PREAMBLE.size
    view = memoryview(data)
    while at + FRAME.size <= len(data):
        kind, length, crc = FRAME.unpack_from(data, at)
        begin = at + FRAME.size
        end = begin + length
        if end > len(data):
            break
        if zlib.crc32(view[begin:end], zlib.crc32(CHECKED.pack(kind, length))) != crc:
            return spans, f"frame {len(spans)} at byte {at} is damaged"
        spans.append((kind, begin, end))
        at = end
    return spans, ""


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
    """One line per robot and per digest; digests as what changed since the tick before."""
    digests = content["digests"]
    changed = digests.copy()
    changed[1:] ^= digests[:-1]
    changes = content["changes"].T.astype(np.int64)
    changes[0] -= content["first"]
    return {
        "first": content["first"],
        "did": np.ascontiguousarray(content["did"].T),
        "changes": changes.astype(np.int32),
        "digests": np.ascontiguousarray(changed.T),
    }


def _unpack_ticks(content: Content) -> Content:
    changes = content["changes"].T.astype(np.int64)
    changes[:, 0] += content["first"]
    return {
        "first": content["first"],
        "did": np.ascontiguousarray(content["did"].T),
        "changes": changes,
        "digests": np.bitwise_xor.accumulate(content["digests"].T, axis=0),
    }
