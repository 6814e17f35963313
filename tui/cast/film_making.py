"""From a recording to a file: a film of it, or a picture of one tick."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import BinaryIO, Final

from automaton.atomic_write import atomic_writer
from automaton.errors import InputError
from automaton.films.recorded_stretch import checked
from automaton.units import count
from tui.cast.asciicast import Frame, asciicast, duration, schedule
from tui.cast.film import Film
from tui.cast.film_request import Request
from tui.render.image_export import as_svg, as_text

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
