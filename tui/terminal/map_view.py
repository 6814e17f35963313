"""A map widget: a rectangle of coded cells, written to the terminal past Textual's compositor.

The compositor sends whole rows, 60 KB for 100 moving robots; the difference between two pictures is
2 KB. Where nothing covers the map, the viewer therefore writes this difference to the terminal
itself, through private names of Textual. If a new version lacks one, `why_not` names it and the
compositor draws the map, more slowly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final
from weakref import WeakKeyDictionary

import numpy as np
from rich.color import Color, ColorSystem
from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.app import App
from textual.color import Color as TextualColor
from textual.filter import ANSIToTruecolor, LineFilter, Monochrome
from textual.geometry import Region
from textual.message import Message
from textual.strip import Strip
from textual.widget import Widget

from tui.render.encode import encode, runs
from tui.render.styles import TEXT_CONTRAST, XTERM, Depth, Theme, channels, contrast
from tui.terminal.options import Renderer

if TYPE_CHECKING:
    from tui.render.styles import Codes, GlyphSet, Look


WHEEL = {
    events.MouseScrollUp: "up",
    events.MouseScrollDown: "down",
    events.MouseScrollLeft: "left",
    events.MouseScrollRight: "right",
}

# Restore the cursor: Textual hides it at the caret of an input, where input methods look for it.
SAVE_CURSOR, RESTORE_CURSOR = "\x1b7", "\x1b8"

BEGIN_SYNCHRONIZED, END_SYNCHRONIZED = "\x1b[?2026h", "\x1b[?2026l"
WHERE_IS_THE_CURSOR = "\x1b[6n"

MIDDLE = 0.2  # brightness that separates ordinary backgrounds from highlights
GREYS: Final = (0, 7, 8, 15)
GREY: Final = 24  # a colour is grey if its channels (0 to 255) differ by less


class MapView(Widget, can_focus=True):
    """Shows codes and reports mouse events; knows nothing about robots.

    Border and title belong on its parent, since it fills its whole region. `shown` holds the codes
    that the terminal shows here or that the compositor's next repaint will put here. The compositor
    paints from `shown` only, so that overlays, resizes, screenshots and tests without a terminal
    all see the same picture, whether or not the compositor drew it.
    """

    ALLOW_SELECT = False
    DEFAULT_CSS = "MapView { width: 1fr; height: 1fr; }"

    class Happened(Message):
        """Base of all messages of a map: `control` is the map."""

        def __init__(self, view: MapView) -> None:
            super().__init__()
            self.view = view

        @property
        def control(self) -> MapView:
            return self.view

    class Resized(Happened):
        """The size of the map has changed."""

        def __init__(self, view: MapView, rows: int, columns: int) -> None:
            super().__init__(view)
            self.rows, self.columns = rows, columns

    class Clicked(Happened):
        """A button was pressed and released without a drag."""

        def __init__(self, view: MapView, event: events.Click) -> None:
            super().__init__(view)
            self.row, self.column = event.y, event.x
            self.button = event.button  # 1 left, 2 middle, 3 right
            self.shift, self.ctrl = event.shift, event.ctrl
            self.double = event.chain == 2

    class Dragged(Happened):
        """The mouse moved by `rows` and `columns` with a button down."""

        def __init__(self, view: MapView, rows: int, columns: int, button: int) -> None:
            super().__init__(view)
            self.rows, self.columns, self.button = rows, columns, button

    class Wheeled(Happened):
        """The wheel turned by a notch: up, down, left or right."""

        def __init__(self, view: MapView, event: events.MouseEvent) -> None:
            super().__init__(view)
            self.row, self.column = event.y, event.x
            self.direction = WHEEL[type(event)]
            self.shift, self.ctrl = event.shift, event.ctrl

    class Hovered(Happened):
        """The mouse moved to another character; row and column are -1 after it has left."""

        def __init__(self, view: MapView, row: int, column: int) -> None:
            super().__init__(view)
            self.row, self.column = row, column

    def __init__(
        self,
        presenter: Presenter,
        look: Look,
        glyphs: GlyphSet,
        *,
        id: str | None = None,
        classes: str | None = None,
    ) -> None:
        super().__init__(id=id, classes=classes)
        self._presenter = presenter
        self._look = look
        self._glyphs = glyphs
        presenter.match(look)
        self.shown: Codes | None = None
        self._below: Callable[[], Codes] | None = None  # makes the text under pixels
        self._strips: list[Strip | None] = []  # by row; None: made on demand
        self._hovered = (-1, -1)
        self._held: tuple[int, int, int] | None = None  # row, column, button
        self._dragged = False

    @property
    def look(self) -> Look:
        return self._look

    @property
    def glyphs(self) -> GlyphSet:
        return self._glyphs

    def set_appearance(self, look: Look, glyphs: GlyphSet) -> None:
        """Set colours and characters; the codes stay."""
        self._look, self._glyphs = look, glyphs
        self._presenter.match(look)
        self._strips = [None] * len(self._strips)
        self.refresh()

    def present(self, codes: Codes) -> None:
        """Show codes of shape (rows, columns), which are copied."""
        self._below = None
        if self.shown is None or self.shown.shape != codes.shape:
            self.shown = codes.copy()
            self._strips = [None] * len(codes)
            self.refresh()
            return
        changed = np.flatnonzero((codes != self.shown).any(axis=1))
        if not changed.size:
            return
        if not self._presenter.show(self, codes, self.shown):
            # Whole rows: Textual sends every region from the left edge of the map anyway.
            self.refresh(*(Region(0, int(row), codes.shape[1], 1) for row in changed))
        self.shown[changed] = codes[changed]
        for row in changed:
            self._strips[row] = None

    def cover(self, codes: Callable[[], Codes]) -> None:
        """Note that pixels cover the map; `codes` makes the text when the compositor needs it."""
        self._below = codes

    def render_lines(self, crop: Region) -> list[Strip]:
        """The rows of `shown`; Textual calls it for repaints, screenshots and mouse positions."""
        strips = [self.render_line(row) for row in range(crop.y, crop.bottom)]
        if crop.x == 0 and all(strip.cell_length == crop.width for strip in strips):
            return strips
        blank = self._look.rich(0)
        return [strip.crop_extend(crop.x, crop.right, blank) for strip in strips]

    def render_line(self, y: int) -> Strip:
        """One row, cached until it changes."""
        if self._below is not None:
            self.shown, self._below = self._below().copy(), None
            self._strips = [None] * len(self.shown)
        if self.shown is None or y >= len(self._strips):
            return Strip.blank(self.size.width, self._look.rich(0))
        strip = self._strips[y]
        if strip is None:
            codes = self.shown[y]
            strip = self._strips[y] = row_strip(lambda: self._segments_of(codes), len(codes))
        return strip

    def _segments_of(self, codes: Codes) -> list[Segment]:
        rich = self._look.rich
        return [Segment(text, rich(style)) for text, style in runs(codes, self._glyphs)]

    def on_resize(self, event: events.Resize) -> None:
        self.post_message(self.Resized(self, event.size.height, event.size.width))

    def on_mouse_down(self, event: events.MouseDown) -> None:
        self._held = (event.y, event.x, event.button)
        self._dragged = False
        self.capture_mouse()

    def on_mouse_up(self) -> None:
        self._held = None
        self.release_mouse()

    def on_click(self, event: events.Click) -> None:
        if not self._dragged:
            self.post_message(self.Clicked(self, event))

    def on_mouse_move(self, event: events.MouseMove) -> None:
        if self._held is not None:
            row, column, button = self._held
            if (event.y, event.x) != (row, column):
                self._held, self._dragged = (event.y, event.x, button), True
                self.post_message(self.Dragged(self, event.y - row, event.x - column, button))
        elif (event.y, event.x) != self._hovered:
            self._hovered = (event.y, event.x)
            self.post_message(self.Hovered(self, event.y, event.x))

    def on_leave(self) -> None:
        self._hovered = (-1, -1)
        self.post_message(self.Hovered(self, -1, -1))

    def _on_wheel(self, event: events.MouseEvent) -> None:
        event.stop()
        self.post_message(self.Wheeled(self, event))

    on_mouse_scroll_up = on_mouse_scroll_down = _on_wheel
    on_mouse_scroll_left = on_mouse_scroll_right = _on_wheel


def row_strip(make: Callable[[], list[Segment]], cell_length: int) -> Strip:
    """A strip made lazily, if this version of Textual allows it."""
    if "_segments" in Strip.__slots__:
        return LazyStrip(make, cell_length)
    return Strip(make(), cell_length)


class LazyStrip(Strip):
    """A row that makes its segments when it is painted.

    When any widget changes, the compositor asks for all rows of the map but sends only a few.
    Making 57 rows takes 7 ms, as much as the update of a panel.
    """

    __slots__ = ("_made", "_make")

    def __init__(self, make: Callable[[], list[Segment]], cell_length: int) -> None:
        self._make = make
        super().__init__((), cell_length)
        self._made: list[Segment] | None = None

    @property
    def _segments(self) -> list[Segment]:
        if self._made is None:
            self._made = self._make()
        return self._made

    @_segments.setter
    def _segments(self, segments: list[Segment]) -> None:
        self._made = segments


@dataclass
class TerminalFrame:
    """The pieces of one write to the terminal, which so never shows half a picture."""

    pieces: list[str] = field(default_factory=list)
    acknowledged: bool = False  # request an answer once the terminal has read the frame
    asked: bool = False  # the request was sent: there is a terminal
    size: int = 0  # bytes, set after the write


class Presenter:
    """Writes all maps of an app to the terminal, past the compositor."""

    def __init__(self, app: App[Any], renderer: Renderer = "auto") -> None:
        self._app: Any = app
        self._renderer = renderer
        self._reason: str | None = None
        self._frame: TerminalFrame | None = None
        # By map: the table of visible widgets that was checked, and the map's uncovered region.
        self._judged: WeakKeyDictionary[MapView, tuple[object, Region | None]]
        self._judged = WeakKeyDictionary()
        self.obstructed = False  # the last picture went through the compositor
        self.bytes = 0
        self.frames = 0

    def match(self, look: Look) -> None:
        """Show all other widgets at the colour depth of the maps, too."""
        filters = getattr(self._app, "_filters", None)
        if filters is None:
            return
        unfit: tuple[type, ...] = (Monochrome, Colourless, SixteenColours)
        if look.depth <= Depth.SIXTEEN:
            unfit += (ANSIToTruecolor,)  # the terminal defines its 16 colours
        filters[:] = [one for one in filters if not isinstance(one, unfit)]
        if look.depth == Depth.NONE:
            filters.append(Colourless(look.theme))
        elif look.depth == Depth.SIXTEEN:
            filters.append(SixteenColours())

    @property
    def why_not(self) -> str:
        """Why maps go through the compositor; "" if they are written directly."""
        if self._reason is None:
            reason = self._self_check()
            if self._app._driver is None:
                return reason
            self._reason = reason
        return self._reason

    def show(self, view: MapView, new: Codes, old: Codes) -> bool:
        """Write the differences; returns False if the compositor must draw them."""
        if self.why_not:
            return False
        region = self._free_region(view)
        self.obstructed = region is None or (region.height, region.width) != new.shape
        if region is None or self.obstructed:
            return False
        self.add(encode(new, old, view.look, view.glyphs, top=region.y, left=region.x))
        return True

    def uncovered(self, view: MapView) -> Region | None:
        """The region of a map on the screen, or None if anything covers it or nothing may be drawn."""
        return None if self.why_not else self._free_region(view)

    def add(self, piece: str) -> None:
        """Write sequences with the present frame, if any."""
        if self._frame is not None:
            self._frame.pieces.append(piece)
        else:
            self._write(TerminalFrame([piece]))

    @contextmanager
    def frame(self) -> Iterator[TerminalFrame]:
        """Inside the context, gather pictures and send them in one write."""
        self._frame = frame = TerminalFrame()
        try:
            yield frame
        finally:
            self._frame = None
        self._write(frame)

    def queued(self) -> int:
        """Number of writes that wait in Textual's writer thread."""
        writer = getattr(self._app._driver, "_writer_thread", None)
        return 0 if writer is None else int(writer._queue.qsize())

    def terminal_resized(self) -> None:
        """Repaint: the terminal has cut its rows, even if its size is the old one again.

        Textual itself repaints only if the size differs from the last one.
        """

        def repaint() -> None:
            if self._app.screen_stack:  # the app may have ended
                self._app.screen.refresh()

        self._app.set_timer(0.1, repaint)

    def fail(self, error: BaseException) -> None:
        """End the app with this error, as if one of its handlers had raised it."""

        def raised() -> None:
            raise error

        self._app.call_later(raised)

    def _write(self, frame: TerminalFrame) -> None:
        app = self._app
        body = "".join(frame.pieces)
        if not (body or frame.acknowledged) or not (app.is_running or app._exit):
            return
        text = f"{SAVE_CURSOR}{body}{RESTORE_CURSOR}" if body else ""
        if body and app._sync_available:
            text = f"{BEGIN_SYNCHRONIZED}{text}{END_SYNCHRONIZED}"
        frame.asked = frame.acknowledged and not app.is_headless
        if frame.asked:
            text += WHERE_IS_THE_CURSOR
        frame.size = len(text.encode())
        self.bytes += frame.size
        self.frames += 1
        app._driver.write(text)

    def _free_region(self, view: MapView) -> Region | None:
        """The region of the map on the screen, or None if anything covers a part of it."""
        app = self._app
        screen: Any = view.screen
        if app._batch_count or app.screen is not screen:
            return None
        visible = screen._compositor.visible_widgets
        judged = self._judged.get(view)
        if judged is None or judged[0] is not visible:  # new after each layout
            judged = self._judged[view] = (visible, self._uncovered(view, visible))
        return judged[1]

    def _uncovered(self, view: MapView, visible: dict[Any, tuple[Region, Region]]) -> Region | None:
        """The region of the map unless a widget in front overlaps it (`visible`: front first)."""
        if view not in visible:
            return None
        region, clip = visible[view]
        if not clip.contains_region(region):
            return None
        for widget, (other, other_clip) in visible.items():
            if widget is view:
                break
            if other.intersection(other_clip).overlaps(region):
                return None
        return region

    def _self_check(self) -> str:
        """Try every private name once on the running app; returns what is wrong, or ""."""
        app = self._app
        driver = getattr(app, "_driver", None)
        if self._renderer == "textual":
            return "asked for"
        if driver is None:
            return "no terminal yet"
        if app.is_headless or app.is_inline:
            return "no terminal of its own"
        try:
            app.screen._compositor.visible_widgets.items()
            _ = app._batch_count + 0, app._sync_available, driver.write, App._display, app._exit
            if not app.is_web:
                driver._writer_thread._queue.qsize()
        except AttributeError as error:
            return f"this version of Textual has changed: {error}"
        return ""


# All other widgets at the colour depth of the maps.


class Colourless(LineFilter):
    """Removes all colours in favour of the terminal's own; highlights become reverse video.

    Textual's filter for NO_COLOR turns colours into greys and sends these as true colours.
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


class SixteenColours(LineFilter):
    """Maps each pair of colours to legible ones of the 16; the map's are among these and stay.

    Rich picks the nearest colours of foreground and background independently: orange on white
    became yellow on light grey, with a contrast of 1.7.
    """

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
    number = _foreground(channels(int(fg.triplet.hex[1:], 16)), below)
    return style + Style(color=Color.from_ansi(number), bgcolor=Color.from_ansi(below))


def _foreground(wanted: tuple[int, int, int], below: int) -> int:
    """The nearest legible colour of the 16, for a grey a grey; black or white is always legible."""
    grey = max(wanted) - min(wanted) < GREY
    those = GREYS if grey else range(16)

    def distance(number: int) -> int:
        near = zip(wanted, channels(XTERM[number]), strict=True)
        return sum((one - other) ** 2 for one, other in near)

    legible = (n for n in those if contrast(n, below, Depth.SIXTEEN) >= TEXT_CONTRAST)
    return min(legible, key=distance)
