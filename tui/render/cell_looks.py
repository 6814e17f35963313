"""The characters of a cell of the empty floor, for every look and every number of characters."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import (
    DETAIL_ONE_WAY,
    DETAIL_OUTSIDE,
    DETAIL_SHIFT,
    KIND_MASK,
    LOOK_COUNT,
)
from automaton.floor.cells import (
    ALONG_X,
    ALONG_Y,
    BAY,
    CHARGER,
    DESTINATION,
    DOCK,
    EXIT_EAST,
    FLOOR,
    RACK,
    SHELF,
    STATION,
    STORAGE,
    TRACK,
    TURNTABLE,
    WALL,
)
from tui.render import styles
from tui.render.cell_outlines import UNSIGNED, line_glyphs, outline
from tui.render.glyphs import ASCII, GlyphSet, code
from tui.render.scene import DETAIL_FULL_SHELF, DETAIL_PASSING, DETAIL_POD, DETAIL_UNLIMITED
from tui.render.styles import style

KIND_COLOURS = {  # of a kind of cell
    WALL: styles.COLOUR_WALL,
    FLOOR: styles.COLOUR_FLOOR_MARK,
    TRACK: styles.COLOUR_TRACK,
    TURNTABLE: styles.COLOUR_TURNTABLE,
    SHELF: styles.COLOUR_SHELF,
    DESTINATION: styles.COLOUR_DESTINATION,
    CHARGER: styles.COLOUR_CHARGER,
    BAY: styles.COLOUR_BAY,
    RACK: styles.COLOUR_RACK,
    DOCK: styles.COLOUR_DOCK,
    STATION: styles.COLOUR_STATION,
    STORAGE: styles.COLOUR_FLOOR_MARK,
}


# From afar a cell is a block of dots, which has more ink than a sign: shelves take the colours of
# marks there, so that robots stand out. So do storage cells.
STORING_KINDS = (SHELF, RACK, STORAGE)
FAR_SHELF = styles.COLOUR_FLOOR_MARK
FAR_LOAD = styles.COLOUR_RACK


def look(kind: int, detail: int = 0) -> int:
    """The number of a look."""
    return kind | detail << DETAIL_SHIFT


def colour_of(number: int) -> int:
    """The colour of a look."""
    kind, detail = number & KIND_MASK, number >> DETAIL_SHIFT
    if kind == SHELF and detail == DETAIL_FULL_SHELF:
        return styles.COLOUR_LOAD
    if kind == STORAGE and detail == DETAIL_POD:
        return styles.COLOUR_LOAD
    if kind == WALL and detail == DETAIL_OUTSIDE:
        return styles.COLOUR_FLOOR
    if kind == FLOOR and detail:
        return styles.COLOUR_FLOW
    return KIND_COLOURS[kind]


def sign_place(width: int, height: int) -> int:
    """The character of a cell that bears its sign, in reading order."""
    return 0 if height == 1 else (height - 1) // 2 * width + (width - 1) // 2


@lru_cache(maxsize=16)
def cell_codes(glyphs: GlyphSet, width: int, height: int = 1) -> NDArray[np.uint32]:
    """(LOOK_COUNT, height x width) codes. In a cell of one row a robot stands where its sign does."""
    table = np.zeros((LOOK_COUNT, height * width), np.uint32)
    for number in range(LOOK_COUNT):
        kind, detail = number & KIND_MASK, number >> DETAIL_SHIFT
        if kind not in KIND_COLOURS:
            continue  # more numbers than kinds
        first, rest = _characters(glyphs, kind, detail)
        fg = style(colour_of(number), styles.COLOUR_FLOOR)
        if height > 1:
            table[number] = code(fg, drawn_cell(glyphs, width, height, kind, detail, first, rest))
        else:
            table[number] = [code(fg, glyph) for glyph in [first] + [rest] * (width - 1)]
    return table


def drawn_cell(
    glyphs: GlyphSet, width: int, height: int, kind: int, detail: int, first: int, rest: int
) -> NDArray[np.uint32]:
    """(height x width) glyphs of a cell of several rows: an outline, and its sign where it has room."""
    if kind == WALL:
        return np.full(height * width, rest, np.uint32)
    if glyphs is ASCII and kind in STORING_KINDS:
        return filled(glyphs, width, height, first)
    frames = glyphs is not ASCII  # letters make none
    cells = line_glyphs(glyphs, outline(kind, detail, width, height, frames))
    if kind not in UNSIGNED or glyphs is ASCII or (kind == TURNTABLE and height > 2):
        cells[sign_place(width, height)] = first
    return cells


def filled(glyphs: GlyphSet, width: int, height: int, sign: int) -> NDArray[np.uint32]:
    """(height x width) a cell full of its sign, but for its edges."""
    cells = np.full((height, width), glyphs.blank, np.uint32)
    cells[: max(height - 1, 2), 1:-1] = sign
    return cells.reshape(-1)


def _characters(glyphs: GlyphSet, kind: int, detail: int) -> tuple[int, int]:
    """The first character of a cell, and what fills the others."""
    blank, line = glyphs.blank, glyphs.track[0]
    if kind == WALL:
        return (blank, blank) if detail == DETAIL_OUTSIDE else (glyphs.wall, glyphs.wall)
    if kind == FLOOR:
        marks = {DETAIL_PASSING: glyphs.passing, DETAIL_UNLIMITED: glyphs.unlimited}
        marks |= {DETAIL_ONE_WAY + d: glyphs.one_way[d] for d in range(4)}
        return marks.get(detail, glyphs.floor), blank
    if kind == TRACK and not detail & ALONG_X:
        return glyphs.track[1], blank
    if kind in (TRACK, TURNTABLE):
        sign = glyphs.crossing if detail & ALONG_Y else line
        sign = glyphs.turntable if kind == TURNTABLE else sign
        return sign, line if detail & EXIT_EAST else blank
    if kind == SHELF:
        return glyphs.load if detail == DETAIL_FULL_SHELF else glyphs.shelf, blank
    if kind == STORAGE:
        return glyphs.pod if detail == DETAIL_POD else glyphs.storage, blank
    signs = {
        DESTINATION: glyphs.destination,
        CHARGER: glyphs.charger,
        BAY: glyphs.bay,
        RACK: glyphs.rack,
        DOCK: glyphs.dock,
        STATION: glyphs.station,
    }
    return signs[kind], blank
