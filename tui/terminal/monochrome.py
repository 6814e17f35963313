"""Panels and dialogs without colours: what a bright background said, reversed video says."""

from __future__ import annotations

from functools import lru_cache

from rich.segment import Segment
from rich.style import Style
from textual.color import Color as TextualColor
from textual.filter import LineFilter

from tui.render.styles import Theme

MIDDLE = 0.2  # brightness between the backgrounds of text and those that make something stand out


class Colourless(LineFilter):
    """Takes all colours away, so that the terminal's own remain.

    Textual's filter for NO_COLOR makes greys of them, and sends those as true colours.
    """

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._dark = theme == "dark"

    def apply(self, segments: list[Segment], background: TextualColor) -> list[Segment]:
        return [
            Segment(text, None if style is None else _plain(style, self._dark), control)
            for text, style, control in segments
        ]


@lru_cache(maxsize=1024)
def _plain(style: Style, dark: bool) -> Style:
    plain = style.without_color
    bg = style.bgcolor
    if bg is None or bg.is_default:
        return plain
    bright = TextualColor.from_rich_color(bg).brightness
    stands_out = bright > MIDDLE if dark else bright < 1 - MIDDLE
    return plain + Style(reverse=True) if stands_out else plain
