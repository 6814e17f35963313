"""Grey values of an image: PGM (P5 and P2, any maxval), and PNG with the extra `plots`.

    P5               P2: values as text, P5: as bytes, two of them above a maxval of 255.
    # a comment
    26 18            width, height
    255              maxval: the value of white

Source: Netpbm, pgm(5). Nothing is read before the file is known to be as large as its head says.
"""

from __future__ import annotations

import math
import os
import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError, nearest
from automaton.exchange.problem import connected_parts
from automaton.scenario.document import Document, parse, quoted, read_text
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


# Cells of an image of a floor: where the centre of a robot may be, and which cells hang together.
#
# pixels ####### cells, two pixels each way A robot's centre keeps half its width away #.....# . .
# from what is occupied. A cell is free where #.##### | such a pixel is left in it; an exit leads #.#
# . where such pixels touch across the border.
#
# Pixels and cells hang together with their four neighbours. (h, w) are rows and columns of pixels,
# (H, W) of cells, k pixels each way.


Mask = npt.NDArray[np.bool_]


class PixelCells(NamedTuple):
    """The cells of an image, cropped to those that are free."""

    free: Mask  # (H, W)
    east: Mask  # (H, W) whether an exit leads to the cell beside it
    south: Mask  # (H, W) likewise below it
    offset: tuple[int, int]  # pixels to the right of and below which the grid of cells begins
    first: tuple[int, int]  # column and row of the image, in pixels, where the first cell begins
    reached: int  # pixels that a robot's centre reaches
    pixels_kept: int  # of those, pixels that cells keep
    pieces: tuple[int, int]  # of these pixels, and of the cells
    passages_lost: int  # borders between two free cells that pixels cross, and no kept ones


def centres(open_: Mask, reach: int) -> Mask:
    """(h, w) pixels within whose Chebyshev distance `reach` all are open; outside none is."""
    if 2 * reach + 1 > min(open_.shape):
        return np.zeros_like(open_)
    window = 2 * reach + 1
    blocked = any_within(any_within(~open_, window, 0), window, 1)
    out = np.zeros_like(open_)
    out[reach : out.shape[0] - reach, reach : out.shape[1] - reach] = ~blocked
    return out


def reach_of(width: Fraction, pixel: Fraction) -> int:
    """Pixels that the centre of a robot of this width keeps away from what is occupied."""
    return max(0, ceil(width / (2 * pixel) - Fraction(1, 2)))


def any_within(mask: Mask, window: int, axis: int) -> Mask:
    """Whether any of `window` pixels along an axis is set, for each place where all of them exist."""
    rows = mask if axis == 0 else mask.T
    length = 1
    while 2 * length <= window:  # doubled, so that a wide window costs no more than its logarithm
        rows = rows[:-length] | rows[length:]
        length *= 2
    if length < window:
        rest = window - length
        rows = rows[:-rest] | rows[rest:]
    return rows if axis == 0 else rows.T


def cells_of(centre: Mask, k: int) -> PixelCells | None:
    """The cells of k x k pixels; None where a robot's centre can be nowhere."""
    if not centre.any():
        return None
    dx, dy = best_offset(centre, k)
    pixels, first = _on_grid(centre, k, dx, dy)
    largest = _largest_pieces(pixels, k)
    free = np.asarray(_by_cell(largest, k).any(axis=(1, 3)))
    east, south = _crossings(largest, k)
    crossed = [int(np.count_nonzero(mask)) for mask in _crossings(pixels, k)]
    return PixelCells(
        free=free,
        east=east,
        south=south,
        offset=(dx, dy),
        first=first,
        reached=int(np.count_nonzero(centre)),
        pixels_kept=int(np.count_nonzero(largest)),
        pieces=(int(connected_parts(centre).max()), len(piece_sizes(free, east, south))),
        passages_lost=sum(crossed) - int(np.count_nonzero(east)) - int(np.count_nonzero(south)),
    )


def best_offset(centre: Mask, k: int) -> tuple[int, int]:
    """The offset with most free cells: x, y in pixels; ties the upper, then the left one."""
    padded = np.pad(centre, k - 1)
    # [i, j]: it begins at i - k + 1, j - k + 1.
    windows = any_within(any_within(padded, k, 0), k, 1)
    height, width = (-(-size // k) * k for size in windows.shape)
    rounded_up = np.zeros((height, width), bool)
    rounded_up[: windows.shape[0], : windows.shape[1]] = windows
    cells = rounded_up.reshape(height // k, k, width // k, k).sum(axis=(0, 2), dtype=np.int64)
    dy, dx = divmod(int(np.roll(cells, (1, 1), (0, 1)).argmax()), k)
    return dx, dy


def _on_grid(centre: Mask, k: int, dx: int, dy: int) -> tuple[Mask, tuple[int, int]]:
    """The pixels of the cells around those that are set, and where the first cell begins."""
    top, bottom = _span(np.flatnonzero(centre.any(axis=1)), k, dy)
    left, right = _span(np.flatnonzero(centre.any(axis=0)), k, dx)
    pixels = np.zeros((bottom - top, right - left), bool)
    part = centre[max(top, 0) : bottom, max(left, 0) : right]
    y, x = max(-top, 0), max(-left, 0)
    pixels[y : y + part.shape[0], x : x + part.shape[1]] = part
    return pixels, (left, top)


def _span(places: npt.NDArray[np.intp], k: int, offset: int) -> tuple[int, int]:
    """Where the first cell begins and the last one ends."""
    begin = (int(places[0]) - offset) // k * k + offset
    return begin, begin + ((int(places[-1]) - begin) // k + 1) * k


def _by_cell(pixels: Mask, k: int) -> Mask:
    """Return (H, k, W, k) pixels by cell."""
    height, width = pixels.shape
    return pixels.reshape(height // k, k, width // k, k)


def _largest_pieces(pixels: Mask, k: int) -> Mask:
    """The largest piece in each cell, of equal ones the first as one reads."""
    parts = connected_parts(pixels, k)
    size = np.bincount(parts.reshape(-1))
    begins = parts != 0
    begins[:, 1:] &= parts[:, 1:] != parts[:, :-1]
    at = np.flatnonzero(begins)  # a pixel of each part is enough
    rows, columns = np.divmod(at, parts.shape[1])
    cell = np.zeros(len(size), np.int64)
    cell[parts.reshape(-1)[at]] = rows // k * (parts.shape[1] // k) + columns // k
    by_size = 1 + np.lexsort((-size[1:], cell[1:]))  # stable: the first as one reads comes first
    _, best = np.unique(cell[by_size], return_index=True)
    is_kept = np.zeros(len(size), bool)
    is_kept[by_size[best]] = True
    pixels_kept: Mask = is_kept[parts]
    return pixels_kept


def _crossings(pixels: Mask, k: int) -> tuple[Mask, Mask]:
    """(H, W) each: whether set pixels touch across the border to the east, and to the south."""
    cells = _by_cell(pixels, k)
    east, south = (np.zeros((cells.shape[0], cells.shape[2]), bool) for _ in range(2))
    east[:, :-1] = (cells[:, :, :-1, -1] & cells[:, :, 1:, 0]).any(axis=1)
    south[:-1] = (cells[:-1, -1] & cells[1:, 0]).any(axis=2)
    return east, south


def piece_sizes(free: Mask, east: Mask, south: Mask) -> npt.NDArray[np.int64]:
    """How many cells each piece has, by the number that `pieces_of` gives it, from 1."""
    sizes: npt.NDArray[np.int64] = np.bincount(pieces_of(free, east, south).reshape(-1))[1:]
    return sizes


def pieces_of(free: Mask, east: Mask, south: Mask) -> npt.NDArray[np.int32]:
    """(H, W) the piece of each cell that exits connect, from 1 as one reads; 0: it is not free."""
    height, width = free.shape
    ways = np.zeros((2 * height - 1, 2 * width - 1), bool)  # cells, and the ways between them
    ways[::2, ::2] = free
    ways[::2, 1::2] = east[:, :-1]
    ways[1::2, ::2] = south[:-1]
    return connected_parts(ways)[::2, ::2]


# Maps of ROS, as map_server reads them: a YAML file that names an image, and what its greys mean.
#
# image: hall.pgm beside the file, or with its whole path resolution: 0.25 metres of a pixel origin:
# [-3.0, -2.0, 0.0] x, y and yaw of the lower left pixel negate: 0 1: white is occupied
# occupied_thresh: 0.65 a pixel is occupied above this share of black, free_thresh: 0.196 free below
# that one, and else unknown mode: trinary left out: trinary; scale is read as trinary; raw: greys are
# percent
#
# Source: map_server of ROS and Nav2.


MODES: Final = ("trinary", "scale", "raw")
KEYS: Final = (
    *("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode"),
)
OPTIONAL: Final = ("origin", "mode")
NUMBER: Final = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")
RESOLUTIONS: Final = (1e-4, 1e3)  # metres of a pixel
FARTHEST: Final = 1e9  # of an origin
WHITE: Final = 255  # what greys are scaled to
MOST_PERCENT: Final = 100  # greys of raw above this are unknown
IMAGE_BEGINNINGS: Final = ("P2", "P5", "\ufffdPNG")


@dataclass(frozen=True, eq=False)
class RosMap:
    """A map in pixels, the upper row first."""

    resolution: Fraction  # metres of a pixel, as written
    origin: tuple[float, ...]  # x, y, yaw of the lower left pixel
    free: Mask  # (h, w)
    unknown: Mask  # (h, w); the rest is occupied
    mode: str
    unread: tuple[str, ...]  # keys that mean nothing to map_server


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
    """(h, w) each: the pixels that are free, and those of which nothing is known."""
    grey = WHITE * np.arange(image.white + 1) / image.white  # of each value
    share = grey / MOST_PERCENT if mode == "raw" else (grey if negate else WHITE - grey) / WHITE
    is_unknown = (grey > MOST_PERCENT) & (mode == "raw")
    is_occupied = (share > occupied) & ~is_unknown
    is_free = (share < free) & ~is_occupied & ~is_unknown
    kind: npt.NDArray[np.uint8] = np.where(is_free, 1, np.where(is_occupied, 0, 2)).astype(np.uint8)
    kinds = kind[image.values]
    if image.clear is not None:
        kinds[image.clear] = 2
    return kinds == 1, kinds == 2


def _text(path: Path) -> str:
    """The text of the YAML file. Raises InputError, also for the image itself."""
    with path.open("rb") as stream:
        if stream.read(4).decode("utf-8", "replace").startswith(IMAGE_BEGINNINGS):
            text = "is the image of a map; give the YAML file that names it"
            raise InputError(text, str(path))
    return read_text(path)


class _Fields:
    """The values of the YAML file, checked one by one; errors have the line of the key."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.data: Mapping[str, Any] = document.data

    def error(self, key: str, message: str) -> InputError:
        return self.document.error((key,), message)

    def check_keys(self) -> None:
        for key in KEYS:
            if key not in self.data and key not in OPTIONAL:
                hint = nearest(key, [name for name in self.data if name not in KEYS])
                text = f"a map of ROS has the key {key}, this one does not{hint}"
                raise InputError(text, self.document.file)

    def mode(self) -> str:
        mode = self.data.get("mode", MODES[0])
        if mode not in MODES:
            hint = nearest(str(mode), MODES)
            known = f"{', '.join(MODES[:-1])} or {MODES[-1]}"
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
        if len(numbers) != 3 or not all(abs(one) <= FARTHEST for one in numbers):
            text = f"origin must be three numbers, x, y and yaw, up to {FARTHEST:g}"
            raise self.error("origin", f"{text}; found {_shown(values)}")
        return tuple(numbers)

    def image(self, folder: Path) -> Path:
        name = self.data["image"]
        if not isinstance(name, str) or not name:
            raise self.error("image", f"image must be the name of a file, found {_shown(name)}")
        path = folder / name  # os.path takes a name that no file can have for one that there is not
        if not os.path.isfile(path):
            why = "is not a regular file" if os.path.exists(path) else "is not there"
            raise self.error("image", f"the image {quoted(name)} {why}")
        return path


def _number(value: Any) -> float:
    """A number, also as YAML 1.1 takes for text (5e-2); NaN for anything else."""
    if isinstance(value, str) and NUMBER.fullmatch(value) and len(value) < 40:
        return float(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    return float(value)


def _shown(value: Any) -> str:
    return quoted(value if isinstance(value, str) else repr(value))
