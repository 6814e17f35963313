"""Panels and dialogs in 16 colours: each pair of colours keeps the contrast of text.

Rich takes the nearest of the 16 for a foreground and for a background, each without the other, which
made orange on white yellow on light grey, of a contrast of 1.7.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from rich.color import Color, ColorSystem
from rich.segment import Segment
from rich.style import Style
from textual.color import Color as TextualColor
from textual.filter import LineFilter

from tui.render.depth import Depth
from tui.render.styles import TEXT_CONTRAST, XTERM, contrast

GREYS: Final = (0, 7, 8, 15)
GREY: Final = 24  # the channels of a grey differ by less, of 255


class SixteenColours(LineFilter):
    """Colours that are among the 16 already, those of the map, stay as they are."""

    def apply(self, segments: list[Segment], background: TextualColor) -> list[Segment]:
        return [
            Segment(text, None if style is None else _legible(style), control)
            for text, style, control in segments
        ]


@lru_cache(maxsize=1024)
def _legible(style: Style) -> Style:
    fg, bg = style.color, style.bgcolor
    if fg is None or bg is None or fg.triplet is None or bg.triplet is None:
        return style
    below = bg.downgrade(ColorSystem.STANDARD).number
    assert below is not None
    number = _foreground(_channels(int(fg.triplet.hex[1:], 16)), below)
    return style + Style(color=Color.from_ansi(number), bgcolor=Color.from_ansi(below))


def _foreground(wanted: tuple[int, int, int], below: int) -> int:
    """The nearest of the 16 that can be read, of greys a grey; black or white always can be."""
    grey = max(wanted) - min(wanted) < GREY
    those = GREYS if grey else range(16)

    def distance(number: int) -> int:
        near = zip(wanted, _channels(XTERM[number]), strict=True)
        return sum((one - other) ** 2 for one, other in near)

    legible = (n for n in those if contrast(n, below, Depth.SIXTEEN) >= TEXT_CONTRAST)
    return min(legible, key=distance)


def _channels(value: int) -> tuple[int, int, int]:
    return value >> 16, value >> 8 & 255, value & 255
