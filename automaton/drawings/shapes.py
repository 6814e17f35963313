"""Cells and robots as a few shapes, for SVG drawings and pixel images.

Lengths are in cells; (0, 0) is the upper left corner of a cell, and (1, 1) its lower right corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Final, NamedTuple

from automaton.drawings.looks import (
    CELL_LETTERS,
    DETAIL_INSIDE,
    DETAIL_SHIFT,
    DRAW_FAULT,
    DRAW_WAITING,
    KIND_MASK,
    SHAPE_CROSS,
    SHAPE_PLUG,
    SHAPE_RING,
    SHAPE_SQUARE,
    STATE_COLOURS,
    WITH_LOAD,
    colour_of,
)
from automaton.floor.floor_plan import (
    CELL_KINDS,
    DIRECTION_VECTORS,
    FLOOR,
    STORAGE,
    TRACK,
    TURNTABLE,
    WALL,
)

Point = tuple[float, float]


class Box(NamedTuple):
    """A rectangle, filled or, with a line width, hollow."""

    x: float
    y: float
    width: float
    height: float
    colour: str  # a name in PALETTE
    line: float = 0
    opacity: float = 1  # over the floor


class Disc(NamedTuple):
    """A circle, filled or, with a line width, hollow."""

    x: float
    y: float
    radius: float
    colour: str
    line: float = 0


class Path(NamedTuple):
    """A line through points."""

    points: tuple[Point, ...]
    colour: str
    line: float
    dashed: bool = False


class Label(NamedTuple):
    """A word centred on a point."""

    x: float
    y: float
    size: float
    text: str
    colour: str


Shape = Box | Disc | Path | Label

RADIUS: Final = 0.42  # of a robot
LOAD_SIDE: Final = 0.52  # of a load on it
MIN_DETAILED_CELL: Final = 13  # pixels; in smaller cells robots are discs and cells have no letters
MIN_NUMBER: Final = 8  # pixels; smaller numbers are left out
FADED: Final = 0.55  # opacity of places, and of walls inside a block
NAME_SIZE: Final = 0.28  # height of the name of a place
MAX_NAME: Final = 6  # characters of it that fit into a cell


PLACE_SIGNS: Final[dict[str, tuple[Shape, ...]]] = {
    "door": (Path(((0.25, 0.68), (0.25, 0.22), (0.75, 0.22), (0.75, 0.68)), "turntable", 0.07),),
    "lift": (
        Path(((0.36, 0.68), (0.36, 0.22)), "turntable", 0.07),
        Path(((0.24, 0.36), (0.36, 0.22), (0.48, 0.36)), "turntable", 0.07),
        Path(((0.64, 0.22), (0.64, 0.68)), "turntable", 0.07),
        Path(((0.52, 0.54), (0.64, 0.68), (0.76, 0.54)), "turntable", 0.07),
    ),
    "closing": (
        Disc(0.5, 0.5, 0.26, "turntable", 0.07),
        Path(((0.37, 0.5), (0.63, 0.5)), "turntable", 0.07),
    ),
}


@cache
def cell_shapes(look: int) -> tuple[Shape, ...]:
    """The shapes of a cell, painted over the floor or over the void."""
    kind, detail, colour = look & KIND_MASK, look >> DETAIL_SHIFT, colour_of(look)
    if kind == WALL:
        return (Box(0, 0, 1, 1, colour, opacity=FADED if detail == DETAIL_INSIDE else 1),)
    ground = Box(0, 0, 1, 1, "floor")
    if kind == FLOOR:
        mark = _chevron(detail - 1, colour) if detail else Box(0.46, 0.46, 0.08, 0.08, colour)
        return ground, mark
    if kind in (TRACK, TURNTABLE):
        sides = [d for d in range(4) if detail & 1 << d]
        rails = [Path(((0.5, 0.5), _towards(d, 0.5)), "track", 0.12) for d in sides]
        return ground, *rails, *([Disc(0.5, 0.5, 0.3, colour, 0.12)] if kind == TURNTABLE else ())
    if kind == STORAGE:
        return ground, Box(0.08, 0.08, 0.84, 0.84, colour, line=0.04)
    name = CELL_KINDS[kind].name
    block = Box(0.06, 0.06, 0.88, 0.88, colour, opacity=FADED)
    letter = CELL_LETTERS.get(name)
    return ground, block, *([Label(0.5, 0.5, 0.45, letter, "text")] if letter else ())


@cache
def place_shapes(kind: str, name: str) -> tuple[Shape, ...]:
    """The sign of an open door, a lift, or cells that are closed at times; below it a name, if any."""
    label = (Label(0.5, 0.83, NAME_SIZE, name, "dim"),) if name else ()
    return *PLACE_SIGNS.get(kind, ()), *label


def name_in_cell(names: Sequence[str], scale: float) -> str:
    """The first name that fits legibly into a cell of `scale` pixels, else ""."""
    short = next((name for name in names if len(name) <= MAX_NAME), "")
    return short if NAME_SIZE * scale >= MIN_NUMBER else ""


def load_shapes() -> tuple[Shape, ...]:
    """A load on a shelf, a pod in its cell, or a load that was left on the floor."""
    return (Box(0.2, 0.2, 0.6, 0.6, "load"),)


def shut_shapes() -> tuple[Shape, ...]:
    """A cell that no robot may enter now."""
    first, second = ((0.12, 0.12), (0.88, 0.88)), ((0.12, 0.88), (0.88, 0.12))
    frame = Box(0.06, 0.06, 0.88, 0.88, "fault", line=0.06)
    return frame, Path(first, "fault", 0.08), Path(second, "fault", 0.08)


@cache
def robot_shapes(state: int, shape: int, direction: int, name: str = "") -> tuple[Shape, ...]:
    """A robot: its body in the colour of its state, its front, its load, and its number on top."""
    colour, r = STATE_COLOURS[state], RADIUS
    if shape == SHAPE_SQUARE:
        side = 1.6 * r
        body: list[Shape] = [Box(0.5 - side / 2, 0.5 - side / 2, side, side, colour)]
    else:
        body = [Disc(0.5, 0.5, r, colour), Disc(0.5, 0.5, r, "floor", 0.05)]
    if state in (DRAW_WAITING, DRAW_FAULT) and shape != SHAPE_CROSS:
        body.append(Disc(0.5, 0.5, r - 0.06, "floor", 0.04))  # visible without colours
    if shape == SHAPE_CROSS:
        return *body, *_cross(0.2)
    if shape == SHAPE_RING:
        body.append(Disc(0.5, 0.5, 0.45 * r, "floor", 0.05))
    elif shape not in (SHAPE_SQUARE, SHAPE_PLUG):
        body.append(Disc(*_towards(direction, 0.8 * r), 0.2 * r, "floor"))
    if shape in WITH_LOAD:
        corner, side = 0.5 - LOAD_SIDE / 2, LOAD_SIDE
        body += [
            Box(corner, corner, side, side, "load"),
            Box(corner, corner, side, side, "floor", line=0.04),
        ]
    if name:
        body.append(Label(0.5, 0.5, number_size(name), name, "floor"))
    return tuple(body)


def number_size(name: str) -> float:
    """The height of a robot's number, which fits on its load."""
    return min(0.4, 0.9 / (len(name) + 0.5))


def is_legible(name: str, scale: float) -> bool:
    """Whether a robot's number can be read in cells of `scale` pixels."""
    return number_size(name) * scale >= MIN_NUMBER


def selection_shapes() -> tuple[Shape, ...]:
    """The ring around the selected robot."""
    return (Disc(0.5, 0.5, 0.58, "selected", 0.08),)


def _towards(direction: int, far: float) -> Point:
    dx, dy = DIRECTION_VECTORS[direction]
    return 0.5 + dx * far, 0.5 + dy * far


def _chevron(direction: int, colour: str) -> Path:
    dx, dy = DIRECTION_VECTORS[direction]
    r = 0.16
    points = ((-dx - dy, -dy + dx), (dx, dy), (-dx + dy, -dy - dx))
    return Path(tuple((0.5 + x * r, 0.5 + y * r) for x, y in points), colour, 0.07)


def _cross(r: float) -> list[Shape]:
    ends = (((-r, -r), (r, r)), ((-r, r), (r, -r)))
    return [
        Path(((0.5 + a[0], 0.5 + a[1]), (0.5 + b[0], 0.5 + b[1])), "floor", 0.07) for a, b in ends
    ]
