"""The file format asciicast v2: a header, then what a terminal is sent and when, a line each.

{"version": 2, "width": 80, "height": 24, "title": "...", "env": {"TERM": "xterm-256color"}}
[0.0, "o", "\u001b[?25l..."]      all of the first picture
[0.1, "o", "..."]                 what is different in the next one
[3.7, "o", "\u001b[24;1H..."]     after a last pause the cursor is back
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from automaton.atomic_write import atomic_writer
from automaton.errors import InputError
from automaton.films.recorded_stretch import checked
from automaton.units import count
from tui.cast.film import Film, Request
from tui.render.encode import as_svg, as_text, encode

TICKS_PER_S: Final = 10  # at speed x1, as in the viewer
LAST_PAUSE: Final = 2  # seconds in which the last picture is seen
HIDE_CURSOR: Final = "\x1b[?25l"
SHOW_CURSOR: Final = "\x1b[?25h"
CLEAR: Final = "\x1b[0m\x1b[2J"  # a terminal may be larger than the film


class Frame(NamedTuple):
    """A tick, and when it is shown."""

    time: Fraction  # seconds
    tick: int


def schedule(first: int, last: int, speed: Fraction, fps: int) -> list[Frame]:
    """The frames that bring a new tick, the last one included."""
    frames = [Frame(Fraction(0), first)]
    rate = TICKS_PER_S * speed / fps  # ticks for each frame
    while (shown := frames[-1].tick) < last:
        number = math.ceil((shown + 1 - first) / rate)
        tick = min(first + math.floor(number * rate), last)
        frames.append(Frame(Fraction(number, fps), tick))
    return frames


def asciicast(film: Film, frames: list[Frame]) -> Iterator[str]:
    """The lines of the file; the same recording and request give the same lines."""
    yield _line(_header(film))
    shown = None
    pictures = film.codes_at(frame.tick for frame in frames)
    for (time, _), codes in zip(frames, pictures, strict=True):
        sent = encode(codes, shown, film.look, film.glyphs)
        if shown is None:
            sent = HIDE_CURSOR + CLEAR + sent
        yield _event(time, sent)
        shown = codes
    yield _event(duration(frames), f"\x1b[{film.rows};1H{SHOW_CURSOR}")


def duration(frames: list[Frame]) -> Fraction:
    """Seconds, with the last pause."""
    return frames[-1].time + LAST_PAUSE


def _header(film: Film) -> dict[str, object]:
    """No time stamp: it would make every file another one."""
    return {
        "version": 2,
        "width": film.columns,
        "height": film.rows,
        "title": f"automaton: {film.title}",
        "env": {"TERM": "xterm-256color"},
    }


def _event(time: Fraction, sent: str) -> str:
    return _line([round(float(time), 6), "o", sent])


def _line(content: object) -> str:
    return json.dumps(content, ensure_ascii=False) + "\n"


# From a recording to a file: a film of it, or a picture of one tick.


STANDARD_OUTPUT: Final = Path("-")
SUFFIX: Final = ".cast"


def make_film(recording: Path, request: Request, out: Path | None) -> None:
    """Write an asciicast, and say how large it is. Raises InputError."""
    path = out or recording.with_suffix(SUFFIX)
    target = path if path == STANDARD_OUTPUT else checked(path)
    if target != STANDARD_OUTPUT and path.suffix != SUFFIX:
        raise InputError(
            f"{str(path)!r} names no film: allowed are FILE.gif, FILE.mp4, FILE.png and FILE.cast; "
            "--html makes a page"
        )
    film = Film(recording, request)
    first = film.checked(request.first)
    last = film.last if request.last is None else film.checked(request.last)
    if first > last:
        raise InputError(f"there is nothing from tick {first:,} to tick {last:,}")
    frames = schedule(first, last, request.speed, request.fps)
    if target == STANDARD_OUTPUT:
        said = _write(film, frames, sys.stdout.buffer)
        print(f"automaton: {said}", file=sys.stderr)
        return
    with atomic_writer(target) as file:
        said = _write(film, frames, file)
    print(f"{path}: {said}")


def _write(film: Film, frames: list[Frame], file: BinaryIO) -> str:
    """Write the lines, and say how large it has become."""
    events, size = -1, 0  # the header is none
    for line in asciicast(film, frames):
        size += file.write(line.encode())
        events += 1
    seconds = f"{float(duration(frames)):,.1f} s"
    return f"{count(events, 'event')}, {count(size, 'byte')}, {seconds} of {film.size}"


def make_picture(recording: Path, request: Request, out: Path, tick: int | None) -> str:
    """Write a still, as an SVG or as text by the file's suffix; its size. Raises InputError."""
    if out.suffix not in (".svg", ".txt"):
        raise InputError(
            f"{str(out)!r} names no picture: allowed are FILE.png, FILE.svg and FILE.txt"
        )
    path = checked(out)
    film = Film(recording, request)
    tick = film.checked(film.last if tick is None else tick)
    (codes,) = film.codes_at([tick])
    if out.suffix == ".txt":
        drawn = as_text(codes, film.glyphs).encode()
    else:
        drawn = as_svg(codes, film.look, film.glyphs, film.title).encode()
    with atomic_writer(path) as file:
        file.write(drawn)
    return f"tick {tick:,}, {film.size}, {count(len(drawn), 'byte')}"
