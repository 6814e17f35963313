"""A row of words: only the characters that change are written, and words can be clicked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tui.render import styles
from tui.render.glyphs import Codes, code, text
from tui.render.styles import style
from tui.widgets.bindings import do
from tui.widgets.map_view import MapView


class Word(NamedTuple):
    """Something said in a line."""

    glyphs: tuple[int, ...]
    fg: int = styles.COLOUR_TEXT
    action: str = ""  # what a click on it does
    rank: int = 0  # on a narrow screen words of the highest rank go first
    codes: tuple[int, ...] = ()  # signs in styles of their own, as many as glyphs, in their place

    @property
    def text(self) -> str:
        """Of a word of ASCII."""
        return bytes(self.glyphs).decode("ascii")


def word(words: str, fg: int = styles.COLOUR_TEXT, action: str = "", rank: int = 0) -> Word:
    """A word of ASCII."""
    return Word(text(words), fg, action, rank)


class Line(MapView, can_focus=False):
    """Words from the left, and words from the right."""

    DEFAULT_CSS = "Line { height: 1; width: 1fr; }"
    GAP = 2

    def set_words(self, left: Sequence[Word], right: Sequence[Word] = ()) -> bool:
        """Show these; whether anything changed."""
        width = self.size.width
        if not width:
            return False
        left, right = _fitting(left, right, width, self.GAP)
        self._places: list[tuple[int, int, str]] = []
        codes = np.full(
            (1, width), code(style(styles.COLOUR_TEXT, styles.COLOUR_VOID), 0), np.uint32
        )
        at = 0
        for one in left:
            at = self._put(codes, at, one) + self.GAP
        at = width - _width(right, self.GAP)
        for one in right:
            at = self._put(codes, at, one) + self.GAP
        if self.shown is not None and np.array_equal(codes, self.shown):
            return False
        self.present(codes)
        return True

    def _put(self, codes: Codes, at: int, one: Word) -> int:
        row = codes[0, max(at, 0) : at + len(one.glyphs)]
        row[:] = code(
            style(one.fg, styles.COLOUR_VOID), np.array(one.glyphs[: len(row)], np.uint32)
        )
        if one.codes:
            row[:] = one.codes[: len(row)]
        self._places.append((at, at + len(one.glyphs), one.action))
        return at + len(one.glyphs)

    async def on_map_view_clicked(self, event: MapView.Clicked) -> None:
        event.stop()
        for begin, end, action in getattr(self, "_places", []):
            if action and begin <= event.column < end:
                await self.app.run_action(do(action))


def _width(words: Sequence[Word], gap: int) -> int:
    return sum(len(one.glyphs) + gap for one in words) - gap if words else 0


def _fitting(
    left: Sequence[Word], right: Sequence[Word], width: int, gap: int
) -> tuple[list[Word], list[Word]]:
    """What there is room for; of what has to go the highest rank goes first."""
    kept, end = list(left), list(right)
    while _width(kept, gap) + (_width(end, gap) + gap if end else 0) > width:
        least = max((*kept, *end), key=lambda one: one.rank)
        if not least.rank:
            break
        (kept if least in kept else end).remove(least)
    return kept, end
