"""PNG files for pictures of few colours: one byte per pixel, and a table of colours.

PNG (third edition), W3C Recommendation 2025, with the chunks for animations.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]  # (rows, columns) indices into the colours
Colour = tuple[int, int, int]

SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
INDEXED: Final = 3  # colour type
KEEP_FRAME: Final = 0  # a frame stays after its time
OVER: Final = 1  # blend over the previous frames


class Patch(NamedTuple):
    """The change of a frame, and its duration."""

    x: int
    y: int
    pixels: Pixels
    hundredths: int  # of a second


def png(pixels: Pixels, colours: Sequence[Colour]) -> bytes:
    """A still."""
    rows, columns = pixels.shape
    head = SIGNATURE + _header(columns, rows) + _table(colours)
    return head + _chunk(b"IDAT", _packed(pixels)) + _chunk(b"IEND", b"")


def animated_png(patches: Iterable[Patch], colours: Sequence[Colour]) -> bytes:
    """A looping animation; the first patch is the whole picture.

    In patches, number 255 is transparent; there are at most 255 `colours`.
    """
    frames: list[bytes] = []
    number, size = 0, (0, 0)
    for count, (x, y, pixels, hundredths) in enumerate(patches):
        rows, columns = pixels.shape
        size = size if count else (columns, rows)
        control = struct.pack(
            ">IIIIIHHBB", number, columns, rows, x, y, hundredths, 100, KEEP_FRAME, OVER
        )
        frames.append(_chunk(b"fcTL", control))
        packed = _packed(pixels)
        frames.append(
            _chunk(b"fdAT", struct.pack(">I", number + 1) + packed)
            if count
            else _chunk(b"IDAT", packed)
        )
        number += 2 if count else 1
    control = _chunk(b"acTL", struct.pack(">II", len(frames) // 2, 0))
    head = SIGNATURE + _header(*size) + _table_with_clear(colours) + control
    return b"".join((head, *frames, _chunk(b"IEND", b"")))


def _header(columns: int, rows: int) -> bytes:
    return _chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, INDEXED, 0, 0, 0))


def _table(colours: Sequence[Colour]) -> bytes:
    return _chunk(b"PLTE", bytes(channel for colour in colours for channel in colour))


def _table_with_clear(colours: Sequence[Colour]) -> bytes:
    """A table of 256 colours, the last one transparent."""
    filled = [*colours, *[(0, 0, 0)] * (256 - len(colours))]
    return _table(filled) + _chunk(b"tRNS", b"\xff" * 255 + b"\0")


def _packed(pixels: Pixels) -> bytes:
    unfiltered = np.zeros((pixels.shape[0], 1), np.uint8)  # filter type 0 of each row
    return zlib.compress(np.hstack((unfiltered, pixels)).tobytes(), 9)


def _chunk(name: bytes, content: bytes) -> bytes:
    checked = name + content
    return struct.pack(">I", len(content)) + checked + struct.pack(">I", zlib.crc32(checked))
