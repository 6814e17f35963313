"""Zones as tints and letters, whatever layer they are of.

Where there are no colours, or the same ones, a letter tells touching zones apart: ddd+ee
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import KIND_MASK
from automaton.engine.state import NIL
from automaton.floor.cells import FLOOR, TRACK
from tui.render import styles
from tui.render.canvas import Canvas
from tui.render.glyphs import GLYPH_BITS, GLYPHS, Codes, GlyphSet, code
from tui.render.styles import style

# The six that stay farthest apart under all three kinds of colour blindness, in both themes; the
# last one is rarely needed.
TINTS: Final = (
    *(styles.COLOUR_ZONE_0, styles.COLOUR_ZONE_1, styles.COLOUR_ZONE_2),
    *(styles.COLOUR_ZONE_5, styles.COLOUR_ZONE_7, styles.COLOUR_ZONE_4),
)
TINT_CODES: Final = tuple(map(ord, "defghi"))  # by tint, for no colours; none is a sign in ASCII
TINT_COLOURS: Final = np.array(TINTS, np.uint32)
TINT_LETTERS: Final = np.array(TINT_CODES, np.uint32)
TRANSFER_COLOUR: Final = styles.COLOUR_TEXT  # of a station between two zones


def draw_tints(canvas: Canvas, zone_tints: NDArray[np.int8]) -> None:
    """Cells tinted by zone. Free floor bears a letter that is seen without colours only.

    A straight track bears it in its own colour; other cells keep their signs and bear it beside.
    """
    layer = canvas.scene.map_layer
    tints = canvas.cells(zone_tints).reshape(-1)
    looks = canvas.cells(canvas.scene.floor.looks.reshape(-1)).reshape(-1)
    index = np.flatnonzero(tints != NIL)
    tint = tints[index]
    canvas.set_background(index, TINT_COLOURS[tint][:, None])
    letters, foregrounds = TINT_LETTERS[tint], TINT_COLOURS[tint]
    plain = (looks[index] & KIND_MASK if layer.whole_floor else looks[index]) == FLOOR
    rails = looks[index] & KIND_MASK == TRACK
    canvas.flat[index[plain], canvas.sign] = code(style(foregrounds, foregrounds), letters)[plain]
    tracks = style(np.full(len(index), styles.COLOUR_TRACK), foregrounds)
    canvas.flat[index[rails], canvas.sign] = code(tracks, letters)[rails]
    if canvas.width > 1:
        beside = canvas.flat[index, 1] & GLYPHS == canvas.glyphs.blank
        signed = beside & ~plain & ~rails
        canvas.flat[index[signed], 1] = code(style(foregrounds, foregrounds), letters)[signed]
    layer.draw_signs(canvas, tints, looks)


def paint_tints(pixels: NDArray[np.uint8], tints: NDArray[np.int8]) -> None:
    """Pixels in the tints of their zones."""
    inside = tints != NIL
    pixels[inside] = TINT_COLOURS[tints[inside]]


def sign_tints(codes: Codes, pixels: NDArray[np.uint8], thin: bool = False) -> Codes:
    """A character whose halves have one tint bears its letter, unseen where there are colours.

    thin: ways are no wider than half a character, and there are no colours: one half is enough, and
    stations bear their signs.
    """
    top = pixels[0::2]
    whole = (top == pixels[1::2]) & np.isin(top, TINT_COLOURS)
    if thin:
        bottom = pixels[1::2]
        whole = np.isin(top, TINT_COLOURS) | np.isin(bottom, TINT_COLOURS)
        top = np.where(np.isin(top, TINT_COLOURS), top, bottom)
    letter_of: NDArray[Any] = np.zeros(len(styles.COLOURS), np.uint32)
    letter_of[TINT_COLOURS] = TINT_LETTERS
    fg = top[whole].astype(np.uint32)
    signed = codes.copy()
    signed[whole] = (style(fg, fg) << np.uint32(GLYPH_BITS)) | letter_of[fg]
    if thin:
        for sign, its_fg in (
            (GlyphSet.station, styles.COLOUR_DIM),
            (GlyphSet.transfer, TRANSFER_COLOUR),
        ):
            here = (pixels[0::2] == its_fg) | (pixels[1::2] == its_fg)
            signed[here] = code(style(its_fg, styles.COLOUR_FLOOR), sign)
    return signed
