"""The characters of a cell of the empty floor, for every look and every number of characters."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from automaton.world.cells import (
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
    TRACK,
    TURNTABLE,
    WALL,
)
from tui.render import styles
from tui.render.glyphs import GlyphSet, code
from tui.render.scene import CROWD, DETAIL_SHIFT, FULL, KIND_MASK, LOOKS, ONE_WAY, OUTSIDE, PASSING
from tui.render.styles import style

INKS = {  # of a kind of cell
    WALL: styles.WALL,
    FLOOR: styles.FLOOR_MARK,
    TRACK: styles.TRACK,
    TURNTABLE: styles.TURNTABLE,
    SHELF: styles.SHELF,
    DESTINATION: styles.DESTINATION,
    CHARGER: styles.CHARGER,
    BAY: styles.BAY,
    RACK: styles.RACK,
    DOCK: styles.DOCK,
    STATION: styles.STATION,
}


# From afar a cell is a block of dots, which has more ink than a sign: shelves take the colours of
# marks there, so that robots stand out.
FAR_SHELF = styles.FLOOR_MARK
FAR_LOAD = styles.TRACK


def look(kind: int, detail: int = 0) -> int:
    """The number of a look."""
    return kind | detail << DETAIL_SHIFT


def ink_of(number: int) -> int:
    """The colour of a look."""
    kind, detail = number & KIND_MASK, number >> DETAIL_SHIFT
    if kind == SHELF and detail == FULL:
        return styles.LOAD
    if kind == WALL and detail == OUTSIDE:
        return styles.FLOOR
    if kind == FLOOR and detail:
        return styles.FLOW
    return INKS[kind]


@lru_cache(maxsize=16)
def cell_codes(glyphs: GlyphSet, width: int) -> NDArray[np.uint32]:
    """(LOOKS, width) codes. A cell's sign stands in its first column, where its robot stands."""
    table = np.zeros((LOOKS, width), np.uint32)
    for number in range(LOOKS):
        if number & KIND_MASK not in INKS:
            continue  # more numbers than kinds
        first, rest = _characters(glyphs, number & KIND_MASK, number >> DETAIL_SHIFT)
        ink = style(ink_of(number), styles.FLOOR)
        table[number] = [code(ink, glyph) for glyph in [first] + [rest] * (width - 1)]
    return table


def _characters(glyphs: GlyphSet, kind: int, detail: int) -> tuple[int, int]:
    """The first character of a cell, and what fills the others."""
    blank, line = glyphs.blank, glyphs.track[0]
    if kind == WALL:
        return (blank, blank) if detail == OUTSIDE else (glyphs.wall, glyphs.wall)
    if kind == FLOOR:
        marks = {PASSING: glyphs.passing, CROWD: glyphs.unlimited}
        marks |= {ONE_WAY + d: glyphs.one_way[d] for d in range(4)}
        return marks.get(detail, glyphs.floor), blank
    if kind == TRACK and not detail & ALONG_X:
        return glyphs.track[1], blank
    if kind in (TRACK, TURNTABLE):
        sign = glyphs.crossing if detail & ALONG_Y else line
        sign = glyphs.turntable if kind == TURNTABLE else sign
        return sign, line if detail & EXIT_EAST else blank
    if kind == SHELF:
        return glyphs.load if detail == FULL else glyphs.shelf, blank
    signs = {
        DESTINATION: glyphs.destination,
        CHARGER: glyphs.charger,
        BAY: glyphs.bay,
        RACK: glyphs.rack,
        DOCK: glyphs.dock,
        STATION: glyphs.station,
    }
    return signs[kind], blank
