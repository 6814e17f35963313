"""Pixel films and stills of a stretch of a recording, painted frame by frame: GIF, PNG or MP4.

In GIF and PNG, frames have at most 255 colours and are stored as changes from the previous frame.
Frames are written one by one, so that a long film needs no more memory than a short one.
"""

from __future__ import annotations

import io
import os
import shutil
import struct
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.atomic_write import atomic_writer, cannot_write_error, put_in_place
from automaton.drawings.indexed_png import Colour, Patch, animated_png
from automaton.drawings.looks import PALETTE, Theme, rgb
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.films.painter import Painter, check_size, layout_of, pillow
from automaton.films.recorded_stretch import (
    RecordedStretch,
    checked,
    checked_range,
    play_stretch,
    story_moments,
)
from automaton.recording.recording_reader import read_recording
from automaton.units import count

if TYPE_CHECKING:
    from PIL.Image import Image

FILM_TICKS_PER_S: Final = 10  # at speed x1, as in the viewer
LAST_PAUSE: Final = 2  # seconds for which the last picture is shown
SLOW_S: Final = 2  # seconds before and after a moment of a story
FAST_S: Final = 4  # seconds between two of them
DEFAULT_FPS: Final = 20
MAX_FPS: Final = {".gif": 50, ".png": 100, ".mp4": 120}  # a GIF counts in hundredths of a second
MAX_FRAMES: Final = 6_000
SAMPLED: Final = 8  # frames sampled for the table of colours


@dataclass(frozen=True)
class PixelRequest:
    """The requested stretch of a recording and its form."""

    first: int | None = None  # tick
    last: int | None = None
    speed: Fraction = Fraction(1)  # 1 is ten ticks per second
    fps: int = DEFAULT_FPS
    size: tuple[int, int] | None = None  # pixels; None: as large as the floor needs
    follow: int = NIL  # robot
    theme: Theme = "dark"
    story: bool = False  # slow at the moments of a story, fast between them

    @property
    def rate(self) -> Fraction:
        """Ticks per frame."""
        return FILM_TICKS_PER_S * self.speed / self.fps

    def frames(self, ticks: int) -> int:
        """Number of frames for this number of ticks, including first and last."""
        return -(-ticks // self.rate) + 1  # rounded up


class PixelFilm:
    """The frames of a stretch of a recording."""

    def __init__(self, stretch: RecordedStretch, request: PixelRequest) -> None:
        self._stretch, self._request = stretch, request
        follows = request.follow != NIL
        layout = layout_of(stretch.floor.box, request.size, follows)
        self._painter = Painter(stretch.floor, layout, request.theme, request.follow)
        self._moments = story_moments(stretch) if request.story else []
        self._ticks = list(self._paced())
        self.width, self.height = layout.width, layout.height

    @property
    def frames(self) -> int:
        """Number of frames, including one for the last tick."""
        return len(self._ticks)

    def _paced(self) -> Iterator[Fraction]:
        """The tick of each frame."""
        at, last = Fraction(self._stretch.first), Fraction(self._stretch.last)
        rate = self._request.rate
        width, most = SLOW_S * FILM_TICKS_PER_S * self._request.speed, FAST_S * self._request.fps
        for moment in self._moments:
            begin = min(max(at, moment.tick - width), last)
            end = min(max(begin, moment.tick + width), last)
            for to, step in ((begin, max(rate, (begin - at) / most)), (end, rate)):
                while at < to:
                    yield at
                    at += step
                at = to if step > rate else max(at, to)
        while at < last:
            yield at
            at += rate
        yield last

    def _caption(self, tick: int) -> str:
        """The line above a picture: the moment of the story that is near, or the run."""
        width = SLOW_S * FILM_TICKS_PER_S * self._request.speed
        near = [one for one in self._moments if abs(one.tick - tick) <= width]
        nearest = min(near, key=lambda one: abs(one.tick - tick), default=None)
        return self._stretch.title if nearest is None else nearest.caption

    def times(self) -> list[int]:
        """The time of each frame in hundredths of a second."""
        return [round(Fraction(100 * number, self._request.fps)) for number in range(self.frames)]

    def image(self, number: int) -> Image:
        """One frame."""
        stretch = self._stretch
        tick = self._ticks[number]
        tick_shown, ticks = int(tick), stretch.last - stretch.first
        # The progress bar of a still shows the progress of the run.
        share = (tick - stretch.first) / ticks if ticks else tick / max(stretch.recorded, 1)
        words = stretch.time_words(tick_shown), stretch.fleet_words(tick_shown)
        moment = stretch.columns.moment_at(float(tick))
        return self._painter.frame(moment, self._caption(tick_shown), words, float(share))

    def images(self) -> Iterator[Image]:
        """All frames."""
        return (self.image(number) for number in range(self.frames))

    def shades(self) -> FilmColours:
        """The colours of frames sampled along the film."""
        picked = sorted({round(k * (self.frames - 1) / (SAMPLED - 1)) for k in range(SAMPLED)})
        return FilmColours(
            [np.asarray(self.image(number)) for number in picked], self._request.theme
        )

    def numbered(self, shades: FilmColours) -> Iterator[tuple[int, Pixels]]:
        """Each frame as its time and its pixels' colour numbers."""
        for time, image in zip(self.times(), self.images(), strict=True):
            yield time, shades.numbers(np.asarray(image))


class FilmPair(PixelFilm):
    """The frames of two recordings side by side; a shorter one stays at its last frame."""

    def __init__(self, one: PixelFilm, other: PixelFilm) -> None:
        self._films, self._request = (one, other), one._request
        self.width = one.width + other.width
        self.height = max(one.height, other.height)

    @property
    def frames(self) -> int:
        return max(film.frames for film in self._films)

    def image(self, number: int) -> Image:
        both: Image = pillow().Image.new("RGB", (self.width, self.height))
        left = 0
        for film in self._films:
            both.paste(film.image(min(number, film.frames - 1)), (left, 0))
            left += film.width
        return both


def range_of(recordings: Sequence[Path], first: int | None, last: int | None) -> tuple[int, int]:
    """The ticks of a film of the longest recording: a shorter one stays at its last picture."""
    runs = map(read_recording, recordings)
    return checked_range(max(runs, key=lambda run: run.ticks), first, last)


def film_of(recordings: Sequence[Path], request: PixelRequest, first: int, last: int) -> PixelFilm:
    """The film of a recording, or of two side by side. Raises InputError."""
    films = []
    for path in recordings:
        run = read_recording(path)
        begin, end = min(first, run.ticks), min(last, run.ticks)
        films.append(PixelFilm(play_stretch(run, begin, end, request.follow), request))
    return FilmPair(*films) if len(films) == 2 else films[0]


def make_pixel_film(recordings: Sequence[Path], request: PixelRequest, out: Path) -> str:
    """Write a GIF, MP4 or animated PNG of a recording, or of two side by side; returns its size in
    words. Raises InputError.
    """
    suffix = out.suffix.lower()
    most = MAX_FPS[suffix]
    if request.fps > most:
        raise InputError(
            f"--fps {request.fps} is more than {suffix} plays: allowed are 1 to {most}"
        )
    path = _ready(request, out)
    if suffix == ".mp4":
        ffmpeg()
    first, last = range_of(recordings, request.first, request.last)
    if not request.story and (frames := request.frames(last - first)) > MAX_FRAMES:
        raise InputError(
            f"{frames:,} frames are more than a film holds, {MAX_FRAMES:,}: "
            "--from, --to, --speed and --fps make it shorter"
        )
    film = film_of(recordings, request, first, last)
    size = _write_mp4(film, request.fps, path) if suffix == ".mp4" else _write(film, suffix, path)
    seconds = (film.times()[-1] + 100 * LAST_PAUSE) / 100
    return (
        f"{count(film.frames, 'frame')}, {count(size, 'byte')}, "
        f"{seconds:,.1f} s of {film.width}x{film.height}"
    )


def make_pixel_picture(
    recordings: Sequence[Path], request: PixelRequest, out: Path, tick: int | None
) -> str:
    """Write a PNG of one tick, of one or two recordings; returns its size in words. Raises InputError."""
    path = _ready(request, out)
    at, end = range_of(recordings, tick, None)
    at = end if tick is None else at
    film = film_of(recordings, request, at, at)
    file = io.BytesIO()
    film.image(0).save(file, "PNG", optimize=True)
    with atomic_writer(path) as target:
        target.write(file.getvalue())
    return f"tick {at:,}, {film.width}x{film.height}, {count(len(file.getvalue()), 'byte')}"


def _ready(request: PixelRequest, out: Path) -> Path:
    """The file to write. Raises InputError for errors known before playing."""
    if request.size is not None:
        check_size(request.size)
    pillow()
    return checked(out)


def _write(film: PixelFilm, suffix: str, path: Path) -> int:
    """Write a GIF or an animated PNG; returns its size in bytes."""
    shades = film.shades()
    patches = changed_patches(film.numbered(shades), 100 * LAST_PAUSE)
    is_gif = suffix == ".gif"
    parts = gif(patches, shades.colours) if is_gif else [animated_png(patches, shades.colours)]
    with atomic_writer(path) as file:
        return sum(file.write(part) for part in parts)


def _write_mp4(film: PixelFilm, fps: int, path: Path) -> int:
    def frames() -> Iterable[bytes]:
        last = b""
        for image in film.images():
            last = image.tobytes()
            yield last
        yield from [last] * (LAST_PAUSE * fps - 1)

    try:
        return write_mp4(frames(), film.width, film.height, fps, path)
    except OSError as error:
        raise cannot_write_error(error.strerror or str(error), path) from error


# The table of colours of a film.


Pixels = NDArray[np.uint8]

MAX_COLOURS: Final = 255  # one further number means unchanged
AS_BEFORE: Final = 255
UNKNOWN_COLOUR: Final = 256


class FilmColours:
    """The colours of a theme, and the most frequent other colours of some pictures."""

    def __init__(self, pictures: Iterable[NDArray[np.uint8]], theme: Theme) -> None:
        """`pictures`: arrays (rows, columns, 3)."""
        base = [_packed(np.array(rgb(name, theme), np.uint8)) for name in PALETTE]
        chosen = list(dict.fromkeys(int(one) for one in base))
        pixels = np.concatenate([_packed(picture).reshape(-1) for picture in pictures])
        colours, times = np.unique(pixels, return_counts=True)
        by_frequency = colours[np.lexsort((colours, -times))].tolist()
        known = set(chosen)
        chosen += [one for one in by_frequency if one not in known][: MAX_COLOURS - len(chosen)]
        self._colours = np.array(chosen, np.int64)
        self._number = np.full(1 << 24, UNKNOWN_COLOUR, np.uint16)  # by colour
        self._number[self._colours] = np.arange(len(chosen))

    @property
    def colours(self) -> list[tuple[int, int, int]]:
        """Red, green and blue by colour number."""
        return [(one >> 16, one >> 8 & 255, one & 255) for one in self._colours.tolist()]

    def numbers(self, picture: NDArray[np.uint8]) -> Pixels:
        """(rows, columns) the number of the nearest colour for each pixel."""
        packed = _packed(picture)
        numbers = self._number[packed]
        unknown = numbers == UNKNOWN_COLOUR
        if unknown.any():
            for one in np.unique(packed[unknown]).tolist():
                self._number[one] = self._nearest(one)
            numbers = self._number[packed]
        return numbers.astype(np.uint8)

    def _nearest(self, colour: int) -> int:
        mine = np.array([colour >> 16, colour >> 8 & 255, colour & 255])
        away = ((np.array(self.colours) - mine) ** 2).sum(axis=1)
        return int(np.argmin(away))


def _packed(picture: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Red, green and blue packed into one number."""
    wide: Any = picture.astype(np.int64)
    packed: NDArray[np.int64] = wide[..., 0] << 16 | wide[..., 1] << 8 | wide[..., 2]
    return packed


# Patches: the smallest rectangle that changes in a frame, and its duration.


def changed_patches(frames: Iterable[tuple[int, Pixels]], last_pause: int) -> Iterator[Patch]:
    """The patches of frames with durations in hundredths of a second; equal frames are merged.

    `last_pause`: hundredths of a second for which the last picture is shown. The first patch is the
    whole picture. In later patches, unchanged pixels have the number AS_BEFORE.
    """
    shown: Pixels | None = None
    waiting: tuple[int, int, int, Pixels] | None = None  # time, x, y and pixels of a patch
    for time, pixels in frames:
        if shown is None:
            patch = (0, 0, pixels)
        else:
            different = pixels != shown
            if not different.any():
                continue
            patch = _cut(pixels, different)
        if waiting is not None:
            begun, x, y, cut = waiting
            yield Patch(x, y, cut, time - begun)
        waiting, shown = (time, *patch), pixels
    if waiting is not None:
        yield Patch(*waiting[1:], last_pause)


def _cut(pixels: Pixels, different: np.ndarray) -> tuple[int, int, Pixels]:
    rows, columns = (np.flatnonzero(different.any(axis=axis)) for axis in (1, 0))
    place = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    cut = np.where(different[place], pixels[place], np.uint8(AS_BEFORE)).astype(np.uint8)
    return int(columns[0]), int(rows[0]), cut


# Graphics Interchange Format, version 89a (CompuServe, 1990): one table of colours, then patches.
# Pillow compresses the pixels of each patch.


TABLE_OF_256: Final = 0xF7  # a global table of 256 colours, 8 bits per channel
REPEAT_FOREVER: Final = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
KEEP_WITH_CLEAR: Final = 0x05  # a frame stays after its time; one number is transparent
END: Final = b"\x3b"
COLOURS_AT: Final = 13  # bytes before the table of colours
DESCRIPTOR: Final = 10  # bytes before an image's pixels, after 0x2C


def gif(patches: Iterable[Patch], colours: Sequence[Colour]) -> Iterator[bytes]:
    """The parts of the file; the first patch is the whole picture."""
    table = bytes(channel for colour in colours for channel in colour).ljust(768, b"\0")
    for number, (x, y, pixels, hundredths) in enumerate(patches):
        rows, columns = pixels.shape
        if not number:
            yield b"GIF89a" + struct.pack("<HHBBB", columns, rows, TABLE_OF_256, 0, 0)
            yield table + REPEAT_FOREVER
        yield struct.pack("<BBBBHBB", 0x21, 0xF9, 4, KEEP_WITH_CLEAR, hundredths, AS_BEFORE, 0)
        yield struct.pack("<BHHHHB", 0x2C, x, y, columns, rows, 0) + _compressed(pixels)
    yield END


def _compressed(pixels: Pixels) -> bytes:
    """The compressed pixels of an image, cut out of a GIF file of this image."""
    file = io.BytesIO()
    image = pillow().Image.fromarray(pixels)
    image.putpalette(bytes(768))
    image.save(file, "GIF", optimize=False, interlace=False)
    content = file.getvalue()
    at = COLOURS_AT + 3 * (2 << (content[10] & 7)) if content[10] & 0x80 else COLOURS_AT
    while content[at] == 0x21:  # skip extensions: blocks with a length, the last one empty
        at += 2
        while content[at]:
            at += 1 + content[at]
        at += 1
    local = content[at + DESCRIPTOR - 1]
    at += DESCRIPTOR + (3 * (2 << (local & 7)) if local & 0x80 else 0)
    return content[at:-1]


# MP4, by the program ffmpeg if installed.


SAME_BYTES: Final = ("-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact")
FOR_PLAYERS: Final = ("-pix_fmt", "yuv420p", "-movflags", "+faststart")


def ffmpeg() -> str:
    """The path of ffmpeg. Raises InputError if it is not installed."""
    program = shutil.which("ffmpeg")
    if program is None:
        raise InputError(
            "an MP4 is made by the program ffmpeg, which is not installed: install the package ffmpeg, "
            "or write FILE.gif"
        )
    return program


def write_mp4(frames: Iterable[bytes], width: int, height: int, fps: int, path: Path) -> int:
    """Write frames of RGB bytes; returns the file's size. Raises InputError, OSError."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    command = [
        *(ffmpeg(), "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{width}x{height}", "-r", str(fps), "-i", "-", "-an", "-c:v", "libx264"),
        *("-crf", "20", *FOR_PLAYERS, *SAME_BYTES, "-f", "mp4", str(part)),
    ]
    try:
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=said, stderr=said)
            try:
                _send(process, frames)
            except BaseException:
                process.kill()
                raise
            finally:
                status = process.wait()
            if status:
                said.seek(0)
                lines = said.read().decode(errors="replace").strip().splitlines() or ["no reason"]
                raise InputError(f"ffmpeg could not make the film: {lines[-1].strip()}", str(path))
        put_in_place(part, path)
        return path.stat().st_size
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _send(process: subprocess.Popen[bytes], frames: Iterable[bytes]) -> None:
    """Send the frames to ffmpeg; if it ends early, its exit status says why."""
    assert process.stdin is not None
    with suppress(BrokenPipeError), process.stdin:
        for frame in frames:
            process.stdin.write(frame)
