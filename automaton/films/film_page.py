"""A film as one HTML file (data and player), and the same film in a notebook."""

from __future__ import annotations

import html
import json
import math
import pathlib
import re
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from typing import Any, Final

import numpy as np

from automaton.atomic_write import atomic_writer
from automaton.drawings.looks import (
    CELL_LETTERS,
    DETAIL_SHIFT,
    KIND_MASK,
    SHAPE_CROSS,
    SHAPE_FILLED,
    SHAPE_PLUG,
    SHAPE_RING,
    SHAPE_SQUARE,
    SHAPE_THIN,
    STATE_COLOURS,
    THEMES,
    Theme,
    blended,
    colour_of,
    css,
    rgb,
)
from automaton.drawings.shapes import (
    FADED,
    MIN_DETAILED_CELL,
    MIN_NUMBER,
    Box,
    Disc,
    Label,
    Shape,
    name_in_cell,
    place_shapes,
    robot_shapes,
)
from automaton.engine.state import NIL
from automaton.films.recorded_stretch import (
    DIRECTION_SHIFT,
    FIGURES,
    PARTS_OF_CELL,
    SHAPE_SHIFT,
    RecordedStretch,
    cause_words,
    checked,
    deflated,
    play_stretch,
)
from automaton.floor.floor_plan import CELL_KINDS
from automaton.recording.recording_reader import read_recording
from automaton.units import count, percent
from automaton.vocabulary import COLOUR_WORDS, RobotState, phrase_of

GROUND: Final = (
    *("floor", "void", "text", "dim", "load", "selected", "waiting", "done", "cursor", "fault"),
    "turntable",
)
# The marks of the states in the key, each with a shape that a robot in it may have.
KEY_MARKS: Final = tuple(
    state | shape << SHAPE_SHIFT
    for state, shape in enumerate(
        (SHAPE_SQUARE, SHAPE_RING, SHAPE_PLUG, 0, SHAPE_FILLED, SHAPE_THIN, 0, SHAPE_CROSS)
    )
)


def make_page(
    recording: pathlib.Path,
    out: pathlib.Path,
    first: int | None,
    last: int | None,
    *,
    speed: float,
    follow: int,
    theme: Theme,
) -> str:
    """Write the page of a recording; returns its size in words. Raises InputError."""
    path = checked(out)
    run = read_recording(recording)
    stretch = play_stretch(run, first, last, follow)
    page = film_page(stretch, speed=speed, follow=follow, theme=theme).encode()
    with atomic_writer(path) as file:
        file.write(page)
    return f"{count(stretch.last - stretch.first + 1, 'tick')}, {count(len(page), 'byte')}"


def film_page(
    stretch: RecordedStretch, *, speed: float = 1, follow: int = NIL, theme: Theme = "dark"
) -> str:
    """The page of a stretch. `speed`: 1 is ten ticks per second; `follow`: a robot, or NIL."""
    film = _words(stretch) | {
        "title": stretch.title,
        "speed": speed,
        "follow": follow,
        "theme": theme,
        "columns": stretch.columns.packed(),
    }
    return page_of(stretch.title, film)


def _words(stretch: RecordedStretch) -> dict[str, Any]:
    """The page's data other than its columns."""
    floor, unit = stretch.floor, stretch.unit
    used = [int(look) for look in np.unique(floor.looks)]
    return {
        "box": floor.box,
        "robots": stretch.resolved.scenario.fleet.robots,
        "first": stretch.first,
        "last": stretch.last,
        "time_shares": [
            [name, percent(share), colour] for name, share, colour in stretch.time_shares
        ],
        "unit": {"size": float(unit.of(1)), "name": unit.plural},
        "battery": floor.battery,
        "headings": floor.headings,
        "parts": PARTS_OF_CELL,
        "figures": FIGURES,
        "causes": cause_words(),
        "states": [COLOUR_WORDS[name] for name in STATE_COLOURS],
        "doing": [phrase_of(state) for state in RobotState],
        "stride": floor.floor_plan.stride,
        "looks": deflated(floor.looks),  # with the border, for parking bays
        "kinds": {str(kind): one.name for kind, one in enumerate(CELL_KINDS)},
        "letters": CELL_LETTERS,
        "places": [
            [cell, [_packed(shape) for shape in place_shapes(kind, name_in_cell(names, math.inf))]]
            for cell, (kind, names) in floor.places.items()
        ],
        "detailed": MIN_DETAILED_CELL,
        "legible": MIN_NUMBER,
        "key": KEY_MARKS,
        "marks": _marks(stretch),
        "kind_mask": KIND_MASK,
        "detail_shift": DETAIL_SHIFT,
        "colours": {theme: _colours(used, theme) for theme in THEMES},
    }


def _marks(stretch: RecordedStretch) -> dict[str, Any]:
    """The shapes of robots, by their marks: as in pictures of pixels."""
    marks = {*stretch.columns.marks().tolist(), *KEY_MARKS}
    return {
        str(mark): [
            _packed(shape)
            for shape in robot_shapes(mark & 7, mark >> SHAPE_SHIFT, mark >> DIRECTION_SHIFT & 3)
        ]
        for mark in sorted(marks)
    }


def _packed(shape: Shape) -> list[Any]:
    """A shape as its kind, colour, line width and lengths."""
    if isinstance(shape, Box):
        return ["box", shape.colour, shape.line, shape.x, shape.y, shape.width, shape.height]
    if isinstance(shape, Disc):
        return ["disc", shape.colour, shape.line, shape.x, shape.y, shape.radius]
    if isinstance(shape, Label):
        return ["word", shape.colour, shape.text, shape.x, shape.y, shape.size]
    return ["line", shape.colour, shape.line, *(one for point in shape.points for one in point)]


def _colours(looks: list[int], theme: Theme) -> dict[str, Any]:
    """The colours of one theme in CSS notation."""
    return {
        "looks": {str(look): css(rgb(colour_of(look), theme)) for look in looks},
        "states": [css(rgb(name, theme)) for name in STATE_COLOURS],
        "inside": css(blended("wall", "floor", FADED, theme)),  # of blocks of walls
        **{name: css(rgb(name, theme)) for name in (*GROUND, *STATE_COLOURS)},
    }


def page_of(title: str, film: dict[str, Any]) -> str:
    """The page; it loads nothing, and its policy forbids loading."""
    here = files("automaton.films") / "web_film"
    text = json.dumps(film, separators=(",", ":"), ensure_ascii=True).replace("<", "\\u003c")
    page = (here / "page.html").read_text(encoding="utf-8")
    parts = {
        "TITLE": html.escape(title),
        "STYLE": (here / "player.css").read_text(encoding="utf-8"),
        "FILM": text,
        "PLAYER": (here / "player.js").read_text(encoding="utf-8"),
    }
    return re.sub(r"\[\[([A-Z]+)\]\]", lambda name: parts[name[1]], page)


# The page in a notebook: an iframe that holds the whole page.


@dataclass(frozen=True)
class NotebookFilm:
    """A self-contained film page; a notebook shows it, `save` writes it to a file."""

    page: str = field(repr=False)
    title: str
    height: int = 600  # pixels

    def save(self, path: str | pathlib.Path) -> None:
        """Write the page to a file. Raises InputError."""
        with atomic_writer(pathlib.Path(path)) as file:
            file.write(self.page.encode())

    def _repr_html_(self) -> str:
        """HTML for a notebook, in a frame that isolates the page's scripts."""
        return (
            f'<iframe srcdoc="{escape(self.page)}" sandbox="allow-scripts" title="{escape(self.title)}"'
            f' width="100%" height="{self.height}" style="border:0"></iframe>'
        )
