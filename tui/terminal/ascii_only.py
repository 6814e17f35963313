"""Everything beside the maps in ASCII: frames, scroll bars, ellipses and what a name may hold.

Textual draws with characters that some terminals and fonts do not have. On its way to the terminal
each of them is replaced by what looks most like it.
"""

from __future__ import annotations

from typing import ClassVar

from rich.segment import Segment
from textual.color import Color
from textual.filter import LineFilter
from textual.scrollbar import ScrollBarRender

from tui.render.ascii_fallback import to_ascii


class AsciiOnly(LineFilter):
    """Replaces what is not ASCII; no line gets longer or shorter."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        return [
            segment if segment.control else segment._replace(text=to_ascii(segment.text))
            for segment in segments
        ]


class WholeCells(ScrollBarRender):
    """Scroll bars whose ends lie between two characters, so that none has to be cut in eighths."""

    VERTICAL_BARS: ClassVar = [" "]
    HORIZONTAL_BARS: ClassVar = [" "]
