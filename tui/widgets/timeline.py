"""The run so far: deliveries over time, marks of events, and the present; below, where time was lost.

0 ⣀⣠⣤⣀⣀⣴⣤✗⣀⣀3⣠█⋅⋅⋅⋅ 96     two columns of dots per character; nothing is known after the head

Several marks in one column appear as their number, in the colour of the most severe; zooming in
separates them. A strip below has the same columns: its rows are bands of rows of the floor, and its
heat is the robot time lost there.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from textual import events
from textual.binding import Binding
from textual.message import Message

from automaton.engine.observation import DELIVERED_ORDERS
from tui.render import styles
from tui.render.styles import ASCII, Codes, GlyphSet, code, style, text
from tui.terminal.map_view import MapView
from tui.widgets.bindings import do

if TYPE_CHECKING:
    from automaton.history.event_history import Curve


MIN_TICKS_SHOWN: Final = 16  # minimum number of shown ticks
MARGIN_SHARE: Final = 8  # a part that the present leaves moves, with 1/8 of it behind the present

DOT_LEVELS: Final = 4  # dots in a braille column
LEFT_DOTS: Final = np.array([0, 0x40, 0x44, 0x46, 0x47])  # filled from the bottom
RIGHT_DOTS: Final = np.array([0, 0x80, 0xA0, 0xB0, 0xB8])

HOTTEST: Final = styles.COLOUR_HEAT_8 - styles.COLOUR_HEAT_0  # level of the most lost time
SHORTEST: Final = 50  # minimum number of ticks of the whole row

# ends of the row for a run of unknown length, times 10^k
NICE_LENGTHS: Final = (10, 15, 20, 30, 50, 75)

MARK_KINDS: Final = ("redesign", "branch", "difference", "stop", "deadlock")  # the most severe last


class Mark(NamedTuple):
    """A mark at a tick."""

    tick: int
    kind: str  # one of MARK_KINDS


class Past(NamedTuple):
    """The content of a timeline."""

    tick: int
    head: int  # the last known tick
    end: int | None  # the final tick, if known
    curve: Curve  # the timeline shows its deliveries
    marks: tuple[Mark, ...] = ()
    lost: NDArray[np.int32] | None = None  # (N, 1 + bands): as automaton.history LostByRows


class Timeline(MapView, can_focus=True):
    """Click or drag to go to a tick, turn the wheel to zoom; arrow keys move by single ticks."""

    DEFAULT_CSS = "Timeline { height: 1; width: 1fr; }"
    BINDINGS: ClassVar = [
        Binding("left", "scrub(-1)", "Tick back", show=False),
        Binding("right", "scrub(1)", "Tick on", show=False),
        Binding("shift+left,pageup", "scrub(-10)", "10 back", show=False),
        Binding("shift+right,pagedown", "scrub(10)", "10 on", show=False),
        Binding("plus,equals_sign", f"app.{do('timeline_in')}", "Zoom in", show=False),
        Binding("minus", f"app.{do('timeline_out')}", "Zoom out", show=False),
        Binding("0", f"app.{do('timeline_whole')}", "Whole run", show=False),
    ]

    class Scrubbed(Message):
        """The user pointed at a tick."""

        def __init__(self, tick: int) -> None:
            super().__init__()
            self.tick = tick

    class Moved(Message):
        """The user moved by some ticks, negative for back."""

        def __init__(self, ticks: int) -> None:
            super().__init__()
            self.ticks = ticks

    past: Past | None = None
    part: TickRange | None = None  # the shown ticks; None: the whole run

    @property
    def track(self) -> Track:
        """The present places of ticks; requires content."""
        assert self.past is not None
        return track_of(self.part, span(self.past), self.size.width)

    def set_content(self, past: Past) -> bool:
        """Show a past; returns whether anything changed.

        A part that contained the present moves with it; any other part stays.
        """
        before, self.past = self.past, past
        if not self.size.width:
            return False
        if self.part is not None:
            end = span(past)
            here = before is None or before.tick in self.part
            self.part = self.part.within(end)
            self.part = self.part.following(past.tick, end) if here else self.part
        codes = picture(past, self.track, self.glyphs, self.has_focus)
        if self.size.height > 1:
            below = strip(past, self.track, self.glyphs, self.size.height - 1)
            codes = np.concatenate((codes, below))
        if self.shown is not None and np.array_equal(codes, self.shown):
            return False
        self.present(codes)
        return True

    def zoom(self, steps: int, at: int | None = None) -> None:
        """Zoom around `at` or the present tick, which stays in place. 0 steps: the whole run."""
        if self.past is None:
            return
        end, part = span(self.past), self.track.part
        if at is None:
            at, part = self.past.tick, part.following(self.past.tick, end)
        part = part.zoomed(steps, at, end)
        self.part = part if steps and part.ticks < end else None
        self.set_content(self.past)

    def action_scrub(self, ticks: int) -> None:
        self.post_message(self.Moved(ticks))

    def on_focus(self) -> None:
        if self.past is not None:
            self.set_content(self.past)

    on_blur = on_focus

    def on_mouse_down(self, event: events.MouseDown) -> None:
        super().on_mouse_down(event)
        self._point_at(event.x)

    def on_mouse_move(self, event: events.MouseMove) -> None:
        if self._held is not None:
            self._point_at(event.x)

    def _point_at(self, column: int) -> None:
        if self.past is not None:
            self.post_message(self.Scrubbed(min(self.track.tick_at(column), self.past.head)))

    def on_map_view_clicked(self, event: MapView.Clicked) -> None:
        event.stop()

    on_map_view_hovered = on_map_view_dragged = on_map_view_resized = on_map_view_clicked

    def on_map_view_wheeled(self, event: MapView.Wheeled) -> None:
        event.stop()
        back = event.direction in ("up", "left")
        if event.direction in ("left", "right") or event.shift or event.ctrl:
            self.post_message(self.Moved(-1 if back else 1))
        elif self.past is not None:
            self.zoom(1 if back else -1, self.track.tick_at(event.column))


def span(past: Past) -> int:
    """The last tick of the whole row; without a known end, one that seldom changes."""
    if past.end is not None:
        return max(past.end, 1)
    head = max(past.head, SHORTEST)
    power: int = 10 ** max(0, len(str(head)) - 2)
    while all(end * power < head for end in NICE_LENGTHS):
        power *= 10
    return next(end * power for end in NICE_LENGTHS if end * power >= head)


def picture(past: Past, track: Track, glyphs: GlyphSet, focused: bool) -> Codes:
    """(1, width) codes."""
    here, head = (track.column_of(tick) for tick in (past.tick, past.head))
    columns = np.arange(track.left, track.left + track.columns)
    gone = (columns <= here) & (past.tick >= track.part.first)
    fg = np.where(gone, styles.COLOUR_TEXT, styles.COLOUR_DIM)
    known = (columns <= head) & (past.head >= track.part.first)
    glyph = np.where(known, throughput(past, track, glyphs), glyphs.floor)
    codes = np.full(
        track.width, code(style(styles.COLOUR_TEXT, styles.COLOUR_VOID), glyphs.blank), np.uint32
    )
    codes[columns] = code(style(fg, styles.COLOUR_VOID), glyph)
    for column, sign in _signs(past, track, glyphs):
        codes[column] = sign
    at = codes[here : here + (past.tick in track.part)]
    at[:] = styles.with_background(at, styles.COLOUR_CURSOR if focused else styles.COLOUR_SELECTED)
    return _labelled(codes, track, glyphs).reshape(1, -1)


def strip(past: Past, track: Track, glyphs: GlyphSet, rows: int) -> Codes:
    """(rows, width) codes: where robots lost time, by columns of ticks and bands of the floor's rows.

    A character shows two bands, the upper above the lower.
    """
    blank = code(style(styles.COLOUR_TEXT, styles.COLOUR_VOID), glyphs.blank)
    codes = np.full((rows, track.width), blank, np.uint32)
    if past.lost is None or not len(past.lost):
        return codes
    edges = track.edges(track.columns)
    known = np.clip(edges, 0, past.head)
    bands = past.lost.shape[1] - 1
    sums = np.array([np.interp(known, past.lost[:, 0], band) for band in past.lost.T[1:]])
    rate = np.diff(sums) / np.maximum(np.diff(known), 1)
    levels = np.ceil(rate / max(rate.max(initial=0), 1e-9) * HOTTEST).astype(np.int64)
    shown = levels[np.arange(2 * rows) * bands // (2 * rows)]
    upper, lower = shown[0::2], shown[1::2]
    signs = code(
        style(styles.COLOUR_HEAT_0 + upper, styles.COLOUR_HEAT_0 + lower), glyphs.upper_half
    )
    if glyphs is ASCII or glyphs.shaded:
        most = np.maximum(upper, lower)
        plain = style(styles.COLOUR_TEXT, styles.COLOUR_VOID)
        signs = code(plain, np.array(glyphs.ramp, np.uint32)[most])
    codes[:, track.left : track.left + track.columns] = signs
    return codes


def _labelled(codes: Codes, track: Track, glyphs: GlyphSet) -> Codes:
    """The numbers of the first and last tick, bright if not those of the run."""
    more = {ord("<"): glyphs.one_way[2], ord(">"): glyphs.one_way[0]}
    zoomed = track.more_before or track.more_after
    fg = style(styles.COLOUR_LOADED if zoomed else styles.COLOUR_DIM, styles.COLOUR_VOID)
    for label, place in zip(track.labels, (0, -len(track.labels[1])), strict=True):
        signs = np.array([more.get(glyph, glyph) for glyph in text(label)], np.uint32)
        codes[place : place + len(signs) or None] = code(fg, signs)
    return codes


def throughput(past: Past, track: Track, glyphs: GlyphSet) -> NDArray[np.intp]:
    """(columns,) glyphs: deliveries in each half column, relative to the maximum."""
    edges = track.edges(2 * track.columns)
    deliveries = np.diff(past.curve.at(edges, DELIVERED_ORDERS))
    most = max(1, int(deliveries.max(initial=0)))
    heights = -(-deliveries * (DOT_LEVELS - 1) // most) + 1
    left, right = heights[0::2], heights[1::2]
    dots: NDArray[np.intp] = np.array(glyphs.braille)[LEFT_DOTS[left] | RIGHT_DOTS[right]]
    return dots


def _signs(past: Past, track: Track, glyphs: GlyphSet) -> Iterable[tuple[int, np.uint32]]:
    """Column and code of each mark, or of all marks in one column."""
    looks = {
        "deadlock": (glyphs.fault, styles.COLOUR_FAULT),
        "stop": (glyphs.stand, styles.COLOUR_CURSOR),
        "redesign": (ord("z"), styles.COLOUR_STATION),
        "branch": (ord("Y"), styles.COLOUR_LOADED),
        "difference": (ord("x"), styles.COLOUR_ROUTE),
    }
    there: dict[int, list[str]] = {}
    for mark in dict.fromkeys(past.marks):
        if track.part.first <= mark.tick <= track.part.last:
            there.setdefault(track.column_of(mark.tick), []).append(mark.kind)
    for column, kinds in there.items():
        sign, fg = looks[max(kinds, key=MARK_KINDS.index)]
        if len(kinds) == 1:
            yield column, code(style(fg, styles.COLOUR_VOID), sign)
        else:
            many = glyphs.digits[len(kinds)] if len(kinds) < 10 else ord("+")
            yield column, code(style(styles.COLOUR_VOID, fg), many)


# Places of ticks in the row.


class TickRange(NamedTuple):
    """A range of ticks of a run."""

    first: int
    last: int

    @property
    def ticks(self) -> int:
        return self.last - self.first

    def __contains__(self, tick: object) -> bool:
        return isinstance(tick, int) and self.first <= tick <= self.last

    def within(self, end: int) -> TickRange:
        """A range of the same length within 0 and the end."""
        ticks = min(self.ticks, end)
        first = min(max(self.first, 0), end - ticks)
        return TickRange(first, first + ticks)

    def zoomed(self, steps: int, at: int, end: int) -> TickRange:
        """Half as long per step, or twice for negative steps; the tick `at` stays in place."""
        ticks = self.ticks >> steps if steps > 0 else self.ticks << -steps
        ticks = min(max(ticks, MIN_TICKS_SHOWN), end)
        before = (at - self.first) * ticks // max(1, self.ticks)
        return TickRange(at - before, at - before + ticks).within(end)

    def following(self, tick: int, end: int) -> TickRange:
        """A range of this length that contains the tick: this one, or one moved towards it."""
        if tick in self:
            return self
        margin = self.ticks // MARGIN_SHARE
        first = tick - margin if tick > self.last else tick + margin - self.ticks
        return TickRange(first, first + self.ticks).within(end)


class Track(NamedTuple):
    """A part of a run, with its labels, in `width` columns.

    0 ⣀⣠⣤⣀⣀⣴⣤⣀⣀⣀⣠⣀ 50,000      the whole run
    ‹12,500 ⣀⣤⣀⣠⣀ 18,750›      a part of it, with more on either side
    """

    part: TickRange
    width: int
    more_before: bool = False
    more_after: bool = False

    @property
    def labels(self) -> tuple[str, str]:
        """The texts beside the track; < and > represent the signs for more."""
        first, last = (f"{tick:,}" for tick in self.part)
        return "<" * self.more_before + first, last + ">" * self.more_after

    @property
    def left(self) -> int:
        """The column in which the track begins."""
        return len(self.labels[0]) + 1

    @property
    def columns(self) -> int:
        """Number of columns of the track without labels."""
        return max(1, self.width - self.left - len(self.labels[1]) - 1)

    def column_of(self, tick: int) -> int:
        """The column of a tick."""
        along = (tick - self.part.first) * (self.columns - 1) // max(1, self.part.ticks)
        return self.left + min(max(along, 0), self.columns - 1)

    def tick_at(self, column: int) -> int:
        """The first tick of a column."""
        along = min(max(column - self.left, 0), self.columns - 1)
        return self.part.first - (-along * self.part.ticks // max(1, self.columns - 1))

    def edges(self, many: int) -> NDArray[np.int64]:
        """(many + 1,) ticks that divide the part into `many` equal pieces."""
        return np.linspace(*self.part, many + 1).astype(np.int64)


def track_of(part: TickRange | None, end: int, width: int) -> Track:
    """The track of a part, or of the whole run."""
    whole = TickRange(0, end)
    part = whole if part is None else part
    return Track(part, width, part.first > 0, part.last < end)
