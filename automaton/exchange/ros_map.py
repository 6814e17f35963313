"""Maps of ROS, as map_server reads them, and the grey values of their images.

    image: hall.pgm           beside the file, or with its whole path
    resolution: 0.25          metres of a pixel
    origin: [-3.0, -2.0, 0.0] x, y and yaw of the lower left pixel
    negate: 0                 1: white is occupied
    occupied_thresh: 0.65     a pixel is occupied above this share of black,
    free_thresh: 0.196        free below that one, and else unknown
    mode: trinary             left out: trinary; scale is read as trinary; raw: greys are percent

Images are PGM (P5 and P2, any maxval), and PNG with the extra `plots`. The size of a file is compared
with its header before pixels are read.

    P5               P2: values as text, P5: as bytes, two of them above a maxval of 255.
    # a comment
    26 18            width, height
    255              maxval: the value of white

Sources: map_server of ROS and Nav2; Netpbm, pgm(5).
"""

from __future__ import annotations

import math
import os
import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError, nearest
from automaton.scenario.document import Document, parse
from automaton.scenario.text_files import quoted, read_text

MAX_PIXELS: Final = 40_000_000
MAX_IMAGE_SIDE: Final = 1_000_000
MAX_IMAGE_BYTES: Final = 160_000_000  # of a file
MAX_HEAD: Final = 8192  # bytes, comments included
MAX_MAXVAL: Final = 65_535
PGM: Final = (b"P2", b"P5")
PNG: Final = b"\x89PNG\r\n\x1a\n"
PNG_SIZE: Final = struct.Struct(">II")
PNG_HEAD: Final = 24  # bytes, up to width and height
HEADER_WORD: Final = re.compile(rb"(?:[ \t\r\n\v\f]|#[^\r\n]*[\r\n])*([^ \t\r\n\v\f#]+)")
COMMENT: Final = re.compile(rb"#[^\r\n]*")
DIGITS_AND_BLANKS: Final = b"0123456789 \t\r\n\v\f"
LONG_NUMBER: Final = re.compile(rb"[0-9]{6}")

Mask = npt.NDArray[np.bool_]
ROS_MODES: Final = ("trinary", "scale", "raw")
KEYS: Final = (
    *("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode"),
)
OPTIONAL_KEYS: Final = ("origin", "mode")
YAML_NUMBER: Final = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")
RESOLUTIONS: Final = (1e-4, 1e3)  # metres of a pixel
FARTHEST_ORIGIN: Final = 1e9  # farthest origin, in metres
WHITE_GREY: Final = 255  # greys are scaled to this range
MOST_PERCENT: Final = 100  # larger greys are unknown in mode raw
IMAGE_BEGINNINGS: Final = ("P2", "P5", "\ufffdPNG")


@dataclass(frozen=True, eq=False)
class RosMap:
    """A map in pixels, the upper row first."""

    resolution: Fraction  # metres of a pixel, as written
    origin: tuple[float, ...]  # x, y, yaw of the lower left pixel
    free: Mask  # (h, w)
    unknown: Mask  # (h, w); the rest is occupied
    mode: str
    unread: tuple[str, ...]  # keys that map_server does not use


def read_ros_map(path: Path) -> RosMap:
    """Read a map and its image. Raises InputError with file and line."""
    file = str(path)
    data, root = parse(_text(path), file)
    if not isinstance(data, dict):
        raise InputError("a map of ROS has keys such as image and resolution; found none", file)
    fields = _Fields(Document(data=data, file=file, root=root))
    fields.check_keys()
    mode = fields.mode()
    resolution = fields.number("resolution", *RESOLUTIONS)
    occupied, free = (fields.number(f"{name}_thresh", 0, 1) for name in ("occupied", "free"))
    negate, origin = fields.negate(), fields.origin()
    image = read_image(fields.image(path.parent))
    is_free, unknown = classes(image, mode, negate, occupied, free)
    return RosMap(
        resolution=Fraction(repr(resolution)),
        origin=origin,
        free=is_free,
        unknown=unknown,
        mode=mode,
        unread=tuple(key for key in data if key not in KEYS),
    )


def classes(
    image: ImageValues, mode: str, negate: bool, occupied: float, free: float
) -> tuple[Mask, Mask]:
    """(h, w) each: the free pixels, and the unknown ones."""
    grey = WHITE_GREY * np.arange(image.white + 1) / image.white  # of each value
    share = (
        grey / MOST_PERCENT
        if mode == "raw"
        else (grey if negate else WHITE_GREY - grey) / WHITE_GREY
    )
    is_unknown = (grey > MOST_PERCENT) & (mode == "raw")
    is_occupied = (share > occupied) & ~is_unknown
    is_free = (share < free) & ~is_occupied & ~is_unknown
    kind: npt.NDArray[np.uint8] = np.where(is_free, 1, np.where(is_occupied, 0, 2)).astype(np.uint8)
    kinds = kind[image.values]
    if image.clear is not None:
        kinds[image.clear] = 2
    return kinds == 1, kinds == 2


def _text(path: Path) -> str:
    """The text of the YAML file. Raises InputError, also for an image in its place."""
    with path.open("rb") as stream:
        if stream.read(4).decode("utf-8", "replace").startswith(IMAGE_BEGINNINGS):
            text = "is the image of a map; give the YAML file that names it"
            raise InputError(text, str(path))
    return read_text(path)


class _Fields:
    """The values of the YAML file, each checked; errors have the line of the key."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.data: Mapping[str, Any] = document.data

    def error(self, key: str, message: str) -> InputError:
        return self.document.error((key,), message)

    def check_keys(self) -> None:
        for key in KEYS:
            if key not in self.data and key not in OPTIONAL_KEYS:
                hint = nearest(key, [name for name in self.data if name not in KEYS])
                text = f"the key {key} of the map of ROS is missing{hint}"
                raise InputError(text, self.document.file)

    def mode(self) -> str:
        mode = self.data.get("mode", ROS_MODES[0])
        if mode not in ROS_MODES:
            hint = nearest(str(mode), ROS_MODES)
            known = f"{', '.join(ROS_MODES[:-1])} or {ROS_MODES[-1]}"
            raise self.error("mode", f"mode must be {known}, found {_shown(mode)}{hint}")
        return str(mode)

    def number(self, key: str, least: float, most: float) -> float:
        value = _number(self.data[key])
        if not least <= value <= most:
            text = f"{key} must be a number from {least:g} to {most:g}"
            raise self.error(key, f"{text}, found {_shown(self.data[key])}")
        return value

    def negate(self) -> bool:
        value = self.data["negate"]
        if value not in (0, 1):
            raise self.error("negate", f"negate must be 0 or 1, found {_shown(value)}")
        return bool(value)

    def origin(self) -> tuple[float, ...]:
        values = self.data.get("origin", [0, 0, 0])
        numbers = [_number(one) for one in values] if isinstance(values, list) else []
        if len(numbers) != 3 or not all(abs(one) <= FARTHEST_ORIGIN for one in numbers):
            text = f"origin must be three numbers, x, y and yaw, up to {FARTHEST_ORIGIN:g}"
            raise self.error("origin", f"{text}; found {_shown(values)}")
        return tuple(numbers)

    def image(self, folder: Path) -> Path:
        name = self.data["image"]
        if not isinstance(name, str) or not name:
            raise self.error("image", f"image must be the name of a file, found {_shown(name)}")
        path = folder / name  # for os.path, an impossible name does not exist
        if not os.path.isfile(path):
            why = "is not a regular file" if os.path.exists(path) else "is not there"
            raise self.error("image", f"the image {quoted(name)} {why}")
        return path


def _number(value: Any) -> float:
    """A number, also in a form that YAML 1.1 reads as text (5e-2); NaN for anything else."""
    if isinstance(value, str) and YAML_NUMBER.fullmatch(value) and len(value) < 40:
        return float(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    return float(value)


def _shown(value: Any) -> str:
    return quoted(value if isinstance(value, str) else repr(value))


# Images.


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
            if size > MAX_IMAGE_BYTES:
                most = f"an image may have {MAX_IMAGE_BYTES // 10**6} MB at most"
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
                f"the {name} in the header of a PGM must be a whole number, found {text}"
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
        raise InputError(f"has a pixel value of {most:,}, above its maxval of {white:,}")
    dtype = np.uint8 if white <= 255 else np.uint16
    return ImageValues(values.astype(dtype, copy=False).reshape(height, width), white)


def _words(head: bytes) -> Iterator[tuple[bytes, int]]:
    """Yield each word of a header, and its end."""
    at = 0
    while match := HEADER_WORD.match(head, at):
        at = match.end()
        yield match[1], at


def _text_values(text: bytes, pixels: int) -> npt.NDArray[np.int32]:
    text = COMMENT.sub(b"", text)
    if other := text.translate(None, DIGITS_AND_BLANKS):
        unreadable = quoted(other[:20].decode("latin-1"))
        raise InputError(f"a pixel of a PGM must be a whole number from 0 on, found {unreadable}")
    if LONG_NUMBER.search(text):
        raise InputError(f"a pixel of a PGM is at most {MAX_MAXVAL:,}, found a longer number")
    if len(text) > 8 * pixels + MAX_HEAD:
        raise InputError(f"holds more text than {pixels:,} pixels need")
    values: npt.NDArray[np.int32] = np.fromstring(text, np.int32, sep=" ")
    _check_count(len(values), pixels, "holds")
    return values[:pixels]


def _png(head: bytes, stream: BinaryIO) -> ImageValues:
    if len(head) < PNG_HEAD:
        raise InputError("is truncated: the PNG has no header")
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
    except Exception as error:  # a broken file may raise anything
        raise InputError(f"cannot be read as PNG: {error}") from None
    clear = shares[:, :, 3] == 0 if shares.ndim == 3 and shares.shape[2] == 4 else None
    grey = shares[:, :, :3].mean(axis=2) if shares.ndim == 3 else shares
    return ImageValues(np.rint(grey * MAX_MAXVAL).astype(np.uint16), MAX_MAXVAL, clear)


def _check_size(width: int, height: int) -> None:
    if (
        not (1 <= width <= MAX_IMAGE_SIDE and 1 <= height <= MAX_IMAGE_SIDE)
        or width * height > MAX_PIXELS
    ):
        raise InputError(
            f"declares {width:,} x {height:,} pixels; allowed are 1 to {MAX_PIXELS:,} pixels and "
            f"at most {MAX_IMAGE_SIDE:,} per side"
        )


def _check_count(there: int, wanted: int, verb: str) -> None:
    if there < wanted:
        raise InputError(
            f"is truncated: its header declares {wanted:,} pixels, it {verb} {there:,}"
        )
