"""How lines of a picture differ: by colour, by dashes and by marks, so also without colour."""

from __future__ import annotations

from typing import Final, NamedTuple


class LineStyle(NamedTuple):
    """One of them."""

    colour: str
    dashes: tuple[float, ...]  # lengths of strokes and gaps in points; (): drawn through
    marker: str  # as matplotlib names it
    path: str  # the same for SVG, about 0, 0


_CIRCLE: Final = "M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0z"
LINE_STYLES: Final = (
    LineStyle("#1f6fb4", (), "o", _CIRCLE),
    LineStyle("#d1602b", (6, 3), "s", "M-3.5,-3.5h7v7h-7z"),
    LineStyle("#2f8f4e", (2, 2.5), "^", "M0,-4.5L4.2,3.3H-4.2z"),
    LineStyle("#8a4fa3", (8, 3, 2, 3), "D", "M0,-4.7L4.7,0L0,4.7L-4.7,0z"),
    LineStyle("#b08900", (12, 4), "v", "M0,4.5L4.2,-3.3H-4.2z"),
    LineStyle("#0f8f8f", (4, 2, 1, 2, 1, 2), "P", "M-1.5,-4.5h3v3h3v3h-3v3h-3v-3h-3v-3h3z"),
    LineStyle("#b43a5b", (1, 2), "<", "M-4.5,0L3.3,-4.2V4.2z"),
    LineStyle("#5a5a5a", (10, 2, 4, 2), ">", "M4.5,0L-3.3,-4.2V4.2z"),
)


def line_style(index: int) -> LineStyle:
    """The style of a line by its place."""
    return LINE_STYLES[index % len(LINE_STYLES)]
