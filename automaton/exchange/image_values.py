"""Grey values of an image: PGM (P5 and P2, any maxval), and PNG with the extra `plots`.

    P5               P2: values as text, P5: as bytes, two of them above a maxval of 255.
    # a comment
    26 18            width, height
    255              maxval: the value of white

Source: Netpbm, pgm(5). Nothing is read before the file is known to be as large as its head says.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.scenario.document import quoted
from automaton.units import count

MAX_PIXELS: Final = 40_000_000
MAX_SIDE: Final = 1_000_000
MAX_BYTES: Final = 160_000_000  # of a file
MAX_HEAD: Final = 8192  # bytes, comments included
MAX_MAXVAL: Final = 65_535
PGM: Final = (b"P2", b"P5")
PNG: Final = b"\x89PNG\r\n\x1a\n"
PNG_SIZE: Final = struct.Struct(">II")
PNG_HEAD: Final = 24  # bytes, up to width and height
WORD: Final = re.compile(rb"(?:[ \t\r\n\v\f]|#[^\r\n]*[\r\n])*([^ \t\r\n\v\f#]+)")
COMMENT: Final = re.compile(rb"#[^\r\n]*")
DIGITS: Final = b"0123456789 \t\r\n\v\f"
LONG: Final = re.compile(rb"[0-9]{6}")


class ImageValues(NamedTuple):
    """An image in grey: 0 is black, `white` is white."""

    values: npt.NDArray[Any]  # (height, width) uint8 or uint16
    white: int
    clear: npt.NDArray[np.bool_] | None = None  # (height, width) fully transparent, if any may be


def read_image(path: Path) -> ImageValues:
    """Read an image. Raises InputError."""
    file = str(path)
    if not os.path.isfile(path):
        raise InputError("is not a regular file", file)
    try:
        with path.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            if size > MAX_BYTES:
                most = f"an image may have {MAX_BYTES // 10**6} MB at most"
                raise InputError(f"has {size / 1e6:,.1f} MB; {most}", file)
            return _values(stream, size)
    except OSError as error:
        raise InputError(
            f"cannot be read: {(error.strerror or str(error)).lower()}", file
        ) from None
    except InputError as error:
        raise error.at(file) from None


def _values(stream: BinaryIO, size: int) -> ImageValues:
    head = stream.read(MAX_HEAD)
    if head[:2] in PGM:
        return _pgm(head, stream, size)
    if head.startswith(PNG):
        return _png(head, stream)
    raise InputError(
        "is neither PGM (P2, P5) nor PNG: it begins with " + quoted(repr(head[:4])[2:-1])
    )


def _pgm(head: bytes, stream: BinaryIO, size: int) -> ImageValues:
    words = _words(head)
    form, _ = next(words)
    numbers = [next(words, (b"", 0)) for _ in range(3)]
    for name, (word, _) in zip(("width", "height", "maxval"), numbers, strict=True):
        if not re.fullmatch(rb"[0-9]{1,10}", word):
            text = quoted(word.decode("latin-1"))
            raise InputError(
                f"the {name} in the head of a PGM must be a whole number, found {text}"
            )
    width, height, white = (int(word) for word, _ in numbers)
    _check_size(width, height)
    if not 1 <= white <= MAX_MAXVAL:
        raise InputError(f"the maxval of a PGM must be 1 to {MAX_MAXVAL:,}, found {white:,}")
    begin = numbers[2][1]
    stream.seek(begin + (form == b"P5"))  # one blank, then bytes
    if form == b"P2":
        values = _text_values(stream.read(), width * height)
    else:
        kind = np.dtype(">u2") if white > 255 else np.dtype(np.uint8)
        wanted = width * height * kind.itemsize
        _check_count(max(0, size - begin - 1) // kind.itemsize, width * height, "holds")
        values = np.frombuffer(stream.read(wanted), kind)
    if (most := int(values.max())) > white:
        raise InputError(f"has a pixel of {most:,} and a maxval of {white:,}")
    dtype = np.uint8 if white <= 255 else np.uint16
    return ImageValues(values.astype(dtype, copy=False).reshape(height, width), white)


def _words(head: bytes) -> Iterator[tuple[bytes, int]]:
    """Yield each word of a head, and where it ends."""
    at = 0
    while match := WORD.match(head, at):
        at = match.end()
        yield match[1], at


def _text_values(text: bytes, pixels: int) -> npt.NDArray[np.int32]:
    text = COMMENT.sub(b"", text)
    if other := text.translate(None, DIGITS):
        unreadable = quoted(other[:20].decode("latin-1"))
        raise InputError(f"a pixel of a PGM must be a whole number from 0 on, found {unreadable}")
    if LONG.search(text):
        raise InputError(f"a pixel of a PGM is at most {MAX_MAXVAL:,}, found a longer number")
    if len(text) > 8 * pixels + MAX_HEAD:
        raise InputError(f"holds more text than {pixels:,} pixels need")
    values: npt.NDArray[np.int32] = np.fromstring(text, np.int32, sep=" ")
    _check_count(len(values), pixels, "holds")
    return values[:pixels]


def _png(head: bytes, stream: BinaryIO) -> ImageValues:
    if len(head) < PNG_HEAD:
        raise InputError("is cut short: a PNG without its head")
    _check_size(*PNG_SIZE.unpack(head[PNG_HEAD - PNG_SIZE.size : PNG_HEAD]))
    try:
        from matplotlib.image import imread
    except ImportError as error:
        raise InputError(
            f"a PNG is read by matplotlib, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[plots]', or save it as PGM"
        ) from None
    stream.seek(0)
    try:
        shares = imread(stream, format="png")  # (h, w) or (h, w, 3 or 4) float32 from 0 to 1
    except Exception as error:  # whatever its reader raises for a broken file
        raise InputError(f"cannot be read as PNG: {error}") from None
    clear = shares[:, :, 3] == 0 if shares.ndim == 3 and shares.shape[2] == 4 else None
    grey = shares[:, :, :3].mean(axis=2) if shares.ndim == 3 else shares
    return ImageValues(np.rint(grey * MAX_MAXVAL).astype(np.uint16), MAX_MAXVAL, clear)


def _check_size(width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE) or width * height > MAX_PIXELS:
        raise InputError(
            f"says that it has {width:,} x {height:,} pixels; an image has 1 to {MAX_PIXELS:,} pixels, "
            f"and {MAX_SIDE:,} on a side at most"
        )


def _check_count(there: int, wanted: int, verb: str) -> None:
    if there < wanted:
        raise InputError(
            f"is cut short: its head says {count(wanted, 'pixel')}, it {verb} {there:,}"
        )
