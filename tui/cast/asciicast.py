"""The file format asciicast v2: a header, then what a terminal is sent and when, a line each.

{"version": 2, "width": 80, "height": 24, "title": "...", "env": {"TERM": "xterm-256color"}}
[0.0, "o", "\\u001b[?25l..."]      all of the first picture
[0.1, "o", "..."]                 what is different in the next one
[3.7, "o", "\\u001b[24;1H..."]     after a last pause the cursor is back
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Final, NamedTuple

from tui.cast.film import Film
from tui.render.encode import encode

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
