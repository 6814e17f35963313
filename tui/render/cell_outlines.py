"""Cells drawn in thin lines, where a cell is several rows high: quiet, so that robots stand out.

The lines are dots of braille, 2 x 4 in a character, on a grid of 2 width x 4 height dots.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from automaton.floor.cells import (
    BAY,
    CHARGER,
    DESTINATION,
    DOCK,
    EXIT_EAST,
    EXIT_NORTH,
    EXIT_SOUTH,
    EXIT_WEST,
    RACK,
    SHELF,
    STATION,
    STORAGE,
    TRACK,
    TURNTABLE,
)
from tui.render.glyphs import DOT_BITS, GlyphSet
from tui.render.scene import DETAIL_FULL_SHELF, DETAIL_POD

Dots = NDArray[np.bool_]  # (4 height, 2 width)
UNSIGNED: Final = (SHELF, RACK, STORAGE, BAY, TRACK, TURNTABLE)  # the lines say what it is


def line_glyphs(glyphs: GlyphSet, dots: Dots) -> NDArray[np.uint32]:
    """(height x width) the characters that show these dots, and blanks."""
    rows, columns = dots.shape[0] // 4, dots.shape[1] // 2
    grid = dots.reshape(rows, 4, columns, 2)
    pattern = (grid * DOT_BITS[None, :, None, :]).sum(axis=(1, 3))
    lines = np.array([glyphs.blank, *glyphs.lines[1:]], np.uint32)
    cells: NDArray[np.uint32] = lines[pattern].reshape(-1)
    return cells


def outline(kind: int, detail: int, width: int, height: int, frames: bool = True) -> Dots:
    """The lines of a kind of cell with its detail, see `looks_of`; without frames tracks alone."""
    dots = np.zeros((4 * height, 2 * width), bool)
    if kind in (TRACK, TURNTABLE):
        draw_exits(dots, detail, step=2)
    if not frames:
        return dots
    if kind == TURNTABLE:
        draw_ring(dots)
    elif kind in (SHELF, RACK):
        draw_box(dots)
    elif kind == STORAGE:
        draw_box(dots, step=2)
    elif kind == DESTINATION:
        draw_box(dots)
        dots[1, 2:-2] = False  # open above: loads go in
    elif kind in (BAY, CHARGER, DOCK, STATION):
        draw_corners(dots)
    if kind == RACK:
        dots[2:-2, dots.shape[1] // 2] = True
    if (kind == SHELF and detail == DETAIL_FULL_SHELF) or (
        kind == STORAGE and detail == DETAIL_POD
    ):
        fill(dots)
    return dots


def centre(dots: Dots) -> tuple[int, int]:
    """The dot, row and column, in which ways through a cell meet: it is in the character of signs."""
    rows, columns = dots.shape
    return (rows // 4 - 1) // 2 * 4 + 2, (columns // 2 - 1) // 2 * 2 + 1


def draw_exits(dots: Dots, exits: int, step: int = 1) -> None:
    """Lines from the centre to some sides; every second dot of them with step 2."""
    y, x = centre(dots)
    below, right = dots[y:, x], dots[y, x:]
    above, left = dots[y::-1, x], dots[y, x::-1]
    ways = ((EXIT_EAST, right), (EXIT_SOUTH, below), (EXIT_WEST, left), (EXIT_NORTH, above))
    for side, line in ways:
        if exits & side:
            line[::step] = True


def draw_box(dots: Dots, step: int = 1) -> None:
    """A frame that leaves a dot free all round; every second dot of it with step 2."""
    dots[1:-1:step, [1, -2]] = True
    dots[[1, -2], 1:-1:step] = True


def draw_corners(dots: Dots) -> None:
    """The corners of such a frame."""
    rows, columns = dots.shape
    draw_box(dots)
    dots[rows // 4 + 1 : -rows // 4 - 1] = False
    dots[:, columns // 4 + 1 : -columns // 4 - 1] = False


def draw_ring(dots: Dots) -> None:
    """A ring round the centre, and nothing within."""
    y, x = centre(dots)
    rows, columns = np.indices(dots.shape)
    radius = min(y, x, dots.shape[0] - 1 - y, dots.shape[1] - 1 - x)
    distance = np.hypot(rows - y, columns - x)
    dots[distance < radius] = False
    dots[(distance > radius - 0.5) & (distance < radius + 0.5)] = True


def fill(dots: Dots) -> None:
    """The inside of a frame."""
    dots[3:-3, 3:-3] = True
