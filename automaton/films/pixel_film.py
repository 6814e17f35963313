"""Films and stills of pixels: a stretch of a recording, painted frame by frame."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from automaton.atomic_write import atomic_writer, cannot_write_error
from automaton.drawings.indexed_png import animated_png
from automaton.drawings.palette import Theme
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.films.changed_patches import changed_patches
from automaton.films.film_layout import check_size, layout_of
from automaton.films.film_target import checked
from automaton.films.gif_file import gif
from automaton.films.mp4_file import ffmpeg, write_mp4
from automaton.films.painter import Painter, pillow
from automaton.films.recorded_stretch import RecordedStretch, checked_range, play_stretch
from automaton.films.shades import Pixels, Shades
from automaton.recording.recording_reader import read_recording
from automaton.units import count

if TYPE_CHECKING:
    from PIL.Image import Image

TICKS_PER_S: Final = 10  # at speed x1, as in the viewer
LAST_PAUSE: Final = 2  # seconds in which the last picture is seen
DEFAULT_FPS: Final = 20
MAX_FPS: Final = {".gif": 50, ".png": 100, ".mp4": 120}  # a GIF counts in hundredths of a second
MAX_FRAMES: Final = 6_000
SAMPLES: Final = 8  # frames from which the table of colours is made


@dataclass(frozen=True)
class PixelRequest:
    """What is to be shown of a recording, and how."""

    first: int | None = None  # tick
    last: int | None = None
    speed: Fraction = Fraction(1)  # x1 is ten ticks a second
    fps: int = DEFAULT_FPS
    size: tuple[int, int] | None = None  # pixels; None: as large as the floor needs
    follow: int = NIL  # robot
    theme: Theme = "dark"

    @property
    def rate(self) -> Fraction:
        """Ticks for each frame."""
        return TICKS_PER_S * self.speed / self.fps

    def frames(self, ticks: int) -> int:
        """How many frames go from a tick to one so many ticks later, both included."""
        return -(-ticks // self.rate) + 1  # rounded up


class PixelFilm:
    """The frames of a stretch of a recording."""

    def __init__(self, stretch: RecordedStretch, request: PixelRequest) -> None:
        self._stretch, self._request = stretch, request
        follows = request.follow != NIL
        layout = layout_of(stretch.floor.box, request.size, follows)
        self._painter = Painter(stretch.floor, layout, request.theme, request.follow)
        self.width, self.height = layout.width, layout.height

    @property
    def frames(self) -> int:
        """How many there are, the last tick included."""
        return self._request.frames(self._stretch.last - self._stretch.first)

    def times(self) -> list[int]:
        """When each frame is shown, in hundredths of a second."""
        return [round(Fraction(100 * number, self._request.fps)) for number in range(self.frames)]

    def image(self, number: int) -> Image:
        """One frame."""
        stretch = self._stretch
        tick = min(stretch.first + number * self._request.rate, Fraction(stretch.last))
        tick_shown, ticks = int(tick), stretch.last - stretch.first
        # A still says how far the run is.
        share = (tick - stretch.first) / ticks if ticks else tick / max(stretch.recorded, 1)
        words = stretch.time_words(tick_shown), stretch.fleet_words(tick_shown)
        moment = stretch.columns.moment_at(float(tick))
        return self._painter.frame(moment, stretch.title, words, float(share))

    def images(self) -> Iterator[Image]:
        """All frames."""
        return (self.image(number) for number in range(self.frames))

    def shades(self) -> Shades:
        """The colours of some frames all along the film."""
        picked = sorted({round(k * (self.frames - 1) / (SAMPLES - 1)) for k in range(SAMPLES)})
        return Shades([np.asarray(self.image(number)) for number in picked], self._request.theme)

    def numbered(self, shades: Shades) -> Iterator[tuple[int, Pixels]]:
        """Each frame with its time and the number of each pixel's colour."""
        for time, image in zip(self.times(), self.images(), strict=True):
            yield time, shades.numbers(np.asarray(image))


def make_pixel_film(recording: Path, request: PixelRequest, out: Path) -> str:
    """Write a GIF, an MP4 or an animated PNG; how many frames and bytes. Raises InputError."""
    suffix = out.suffix.lower()
    most = MAX_FPS[suffix]
    if request.fps > most:
        raise InputError(
            f"--fps {request.fps} is more than {suffix} plays: allowed are 1 to {most}"
        )
    path = _ready(request, out)
    if suffix == ".mp4":
        ffmpeg()
    run = read_recording(recording)
    first, last = checked_range(run, request.first, request.last)
    if (frames := request.frames(last - first)) > MAX_FRAMES:
        raise InputError(
            f"{frames:,} frames are more than a film holds, {MAX_FRAMES:,}: "
            "--from, --to, --speed and --fps make it shorter"
        )
    film = PixelFilm(play_stretch(run, first, last, request.follow), request)
    size = _write_mp4(film, request.fps, path) if suffix == ".mp4" else _write(film, suffix, path)
    seconds = (film.times()[-1] + 100 * LAST_PAUSE) / 100
    return (
        f"{count(film.frames, 'frame')}, {count(size, 'byte')}, "
        f"{seconds:,.1f} s of {film.width}x{film.height}"
    )


def make_pixel_picture(recording: Path, request: PixelRequest, out: Path, tick: int | None) -> str:
    """Write a PNG of one tick; its size. Raises InputError."""
    path = _ready(request, out)
    run = read_recording(recording)
    at = run.ticks if tick is None else tick
    film = PixelFilm(play_stretch(run, at, at, request.follow), request)
    file = io.BytesIO()
    film.image(0).save(file, "PNG", optimize=True)
    with atomic_writer(path) as target:
        target.write(file.getvalue())
    return f"tick {at:,}, {film.width}x{film.height}, {count(len(file.getvalue()), 'byte')}"


def _ready(request: PixelRequest, out: Path) -> Path:
    """Where to write. Raises InputError for what can be said before anything is played."""
    if request.size is not None:
        check_size(request.size)
    pillow()
    return checked(out)


def _write(film: PixelFilm, suffix: str, path: Path) -> int:
    """Write a GIF or an animated PNG; its size."""
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
