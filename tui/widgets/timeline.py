"""The run so far in one row: deliveries over time, what happened when, and where we are.

⣀⣠⣤⣀⣀⣴⣤✗⣀⣀⣠█⋅⋅⋅⋅⋅⋅     two columns of dots in a character; behind the head nothing is known yet
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from textual import events
from textual.binding import Binding
from textual.message import Message

from tui.render import styles
from tui.render.glyphs import Codes, GlyphSet, code
from tui.render.styles import style
from tui.widgets.map_view import MapView

LEVELS: Final = 4  # dots in a column of braille
LEFT_DOTS: Final = np.array([0, 0x40, 0x44, 0x46, 0x47])  # filled from below
RIGHT_DOTS: Final = np.array([0, 0x80, 0xA0, 0xB0, 0xB8])
SHORTEST: Final = 64  # ticks in the whole row at least


class Mark(NamedTuple):
    """Something at a tick that deserves a sign."""

    tick: int
    kind: str  # deadlock, stop, branch or difference


class Past(NamedTuple):
    """What a timeline shows."""

    tick: int
    head: int  # the last tick that is known
    end: int | None  # the last one that there will be
    delivered: NDArray[np.int32]  # (known,) orders delivered up to tick 1, 2, ...
    marks: tuple[Mark, ...] = ()


class Timeline(MapView, can_focus=True):
    """Click and drag to go to a tick, turn the wheel or use the arrow keys for single ones."""

    DEFAULT_CSS = "Timeline { height: 1; width: 1fr; }"
    BINDINGS: ClassVar = [
        Binding("left", "scrub(-1)", "Tick back", show=False),
        Binding("right", "scrub(1)", "Tick on", show=False),
        Binding("shift+left,pageup", "scrub(-10)", "10 back", show=False),
        Binding("shift+right,pagedown", "scrub(10)", "10 on", show=False),
    ]

    class Scrubbed(Message):
        """A tick was pointed at."""

        def __init__(self, tick: int) -> None:
            super().__init__()
            self.tick = tick

    class Moved(Message):
        """So many ticks on, or back."""

        def __init__(self, ticks: int) -> None:
            super().__init__()
            self.ticks = ticks

    past: Past | None = None

    def tell(self, past: Past) -> bool:
        """Show this; whether anything changed."""
        self.past = past
        if not self.size.width:
            return False
        codes = picture(past, self.size.width, self.glyphs, self.has_focus)
        if self.shown is not None and np.array_equal(codes, self.shown):
            return False
        self.present(codes)
        return True

    def action_scrub(self, ticks: int) -> None:
        self.post_message(self.Moved(ticks))

    def on_focus(self) -> None:
        if self.past is not None:
            self.tell(self.past)

    on_blur = on_focus

    def on_mouse_down(self, event: events.MouseDown) -> None:
        super().on_mouse_down(event)
        self._point_at(event.x)

    def on_mouse_move(self, event: events.MouseMove) -> None:
        if self._held is not None:
            self._point_at(event.x)

    def _point_at(self, column: int) -> None:
        if self.past is not None:
            tick = tick_at(column, self.past, self.size.width)
            self.post_message(self.Scrubbed(tick))

    def on_map_view_clicked(self, event: MapView.Clicked) -> None:
        event.stop()

    on_map_view_hovered = on_map_view_dragged = on_map_view_resized = on_map_view_clicked

    def on_map_view_wheeled(self, event: MapView.Wheeled) -> None:
        event.stop()
        self.post_message(self.Moved(-1 if event.direction in ("up", "left") else 1))


def span(past: Past) -> int:
    """The tick at the right end: of a run without a known end one that seldom changes."""
    if past.end is not None:
        return max(past.end, 1)
    longest = SHORTEST
    while longest < past.head:
        longest += longest // 2
    return longest


def column_of(tick: int, past: Past, width: int) -> int:
    """Where a tick is shown."""
    return min(width - 1, tick * (width - 1) // span(past))


def tick_at(column: int, past: Past, width: int) -> int:
    """The first tick that is shown there; only known ones can be shown."""
    column = min(max(column, 0), width - 1)
    return min(-(-column * span(past) // max(1, width - 1)), past.head)


def picture(past: Past, width: int, glyphs: GlyphSet, focused: bool) -> Codes:
    """(1, width) codes."""
    here, head = (column_of(tick, past, width) for tick in (past.tick, past.head))
    columns = np.arange(width)
    ink = np.where(columns <= here, styles.TEXT, styles.DIM)
    glyph = np.where(columns <= head, throughput(past, width, glyphs), glyphs.floor)
    codes: Codes = code(style(ink, styles.VOID), glyph)
    for column, sign, colour in _signs(past, width, glyphs):
        codes[column] = code(style(colour, styles.VOID), sign)
    at = codes[here : here + 1]
    at[:] = styles.repapered(at, styles.CURSOR if focused else styles.SELECTED)
    return codes.reshape(1, -1)


def throughput(past: Past, width: int, glyphs: GlyphSet) -> NDArray[np.intp]:
    """(width,) glyphs: deliveries in each half of a column, beside the most in any."""
    edges = np.linspace(0, span(past), 2 * width + 1).astype(np.int64)
    known = np.minimum(edges, len(past.delivered))
    total = np.where(known > 0, past.delivered[known - 1], 0) if known.any() else known
    deliveries = np.diff(total)
    most = max(1, int(deliveries.max(initial=0)))
    heights = -(-deliveries * (LEVELS - 1) // most) + 1
    left, right = heights[0::2], heights[1::2]
    dots: NDArray[np.intp] = np.array(glyphs.braille)[LEFT_DOTS[left] | RIGHT_DOTS[right]]
    return dots


def _signs(past: Past, width: int, glyphs: GlyphSet) -> Iterable[tuple[int, int, int]]:
    """Column, glyph and ink of each mark."""
    looks = {
        "deadlock": (glyphs.fault, styles.FAULT),
        "stop": (glyphs.stand, styles.CURSOR),
        "branch": (ord("Y"), styles.LOADED),
        "difference": (ord("x"), styles.MARKED),
    }
    for mark in past.marks:
        yield column_of(mark.tick, past, width), *looks[mark.kind]
