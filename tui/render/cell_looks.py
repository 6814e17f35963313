"""The characters of a cell of the empty floor, for every look and every number of characters."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

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
from tui.render.glyphs import GlyphSet, code
from tui.render.scene import (
    DETAIL_FULL_SHELF,
    DETAIL_ONE_WAY,
    DETAIL_OUTSIDE,
    DETAIL_PASSING,
    DETAIL_POD,
    DETAIL_SHIFT,
    DETAIL_UNLIMITED,
    KIND_MASK,
    LOOK_COUNT,
)
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


@lru_cache(maxsize=16)
def cell_codes(glyphs: GlyphSet, width: int) -> NDArray[np.uint32]:
    """(LOOK_COUNT, width) codes. A cell's sign stands in its first column, where its robot stands."""
    table = np.zeros((LOOK_COUNT, width), np.uint32)
    for number in range(LOOK_COUNT):
        if number & KIND_MASK not in KIND_COLOURS:
            continue  # more numbers than kinds
        first, rest = _characters(glyphs, number & KIND_MASK, number >> DETAIL_SHIFT)
        fg = style(colour_of(number), styles.COLOUR_FLOOR)
        table[number] = [code(fg, glyph) for glyph in [first] + [rest] * (width - 1)]
    return table


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
