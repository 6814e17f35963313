"""Panels and dialogs without colours: what a bright background said, reversed video says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, Literal, Protocol
from weakref import WeakKeyDictionary

from rich.color import Color, ColorSystem
from rich.segment import Segment
from rich.style import Style
from textual.app import App
from textual.color import Color as TextualColor
from textual.filter import ANSIToTruecolor, LineFilter, Monochrome
from textual.geometry import Region
from textual.strip import Strip

from tui.render.encode import encode
from tui.render.styles import TEXT_CONTRAST, XTERM, Depth, Theme, contrast

if TYPE_CHECKING:
    from tui.render.glyphs import Codes, GlyphSet
    from tui.render.styles import Look


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


# Panels and dialogs in 16 colours: each pair of colours keeps the contrast of text.
#
# Rich takes the nearest of the 16 for a foreground and for a background, each without the other,
# which made orange on white yellow on light grey, of a contrast of 1.7.


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


# Writes a map's difference to the terminal past Textual's compositor, where nothing covers the map.
#
# The compositor sends whole rows, 60 KB for 100 moving robots; the difference is 2 KB. This is the
# only module that uses names which Textual does not publish. `why_not` says which one is missing, if
# a new version has changed them; then the compositor draws the map, more slowly, and nothing breaks.


Renderer = Literal["auto", "direct", "textual"]

# The cursor is put back: Textual keeps it, hidden, at the caret of an input, where input methods look.
SAVE_CURSOR, RESTORE_CURSOR = "\x1b7", "\x1b8"
BEGIN_SYNCHRONIZED, END_SYNCHRONIZED = "\x1b[?2026h", "\x1b[?2026l"
WHERE_IS_THE_CURSOR = "\x1b[6n"


class LazyStrip(Strip):
    """A row whose segments are made when they are painted.

    The compositor asks for all rows of the map when any widget changes, and then sends few of them:
    making 57 rows takes 7 ms, as much as a panel's own update.
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


def row_strip(make: Callable[[], list[Segment]], cell_length: int) -> Strip:
    """A strip that is made late, if this version of Textual allows it."""
    if "_segments" in Strip.__slots__:
        return LazyStrip(make, cell_length)
    return Strip(make(), cell_length)


@dataclass
class Frame:
    """What goes to the terminal in one write, so that it never shows half a picture."""

    pieces: list[str] = field(default_factory=list)
    acknowledged: bool = False  # ask the terminal to answer when it has come this far
    asked: bool = False  # it was asked, if there is one
    size: int = 0  # bytes, known when it has been written


class Covered(Protocol):
    """A map, as far as the way past the compositor is concerned: other widgets may cover it."""

    @property
    def look(self) -> Look:
        """How it is drawn."""

    @property
    def glyphs(self) -> GlyphSet:
        """The characters that it is drawn with."""

    @property
    def screen(self) -> Any:
        """The screen that it is on."""


class Presenter:
    """The way past the compositor, for all maps of an app."""

    def __init__(self, app: App[Any], renderer: Renderer = "auto") -> None:
        self._app: Any = app
        self._renderer = renderer
        self._reason: str | None = None
        self._frame: Frame | None = None
        # For each map the table of visible widgets that was judged, and the map's free region.
        self._judged: WeakKeyDictionary[Covered, tuple[object, Region | None]]
        self._judged = WeakKeyDictionary()
        self.obstructed = False  # the last picture had to go through the compositor
        self.bytes = 0
        self.frames = 0

    def match(self, look: Look) -> None:
        """Show everything else at the depth of the maps, too."""
        filters = getattr(self._app, "_filters", None)
        if filters is None:
            return
        unfit: tuple[type, ...] = (Monochrome, Colourless, SixteenColours)
        if look.depth <= Depth.SIXTEEN:
            unfit += (ANSIToTruecolor,)  # one of 16 colours is not a certain shade
        filters[:] = [one for one in filters if not isinstance(one, unfit)]
        if look.depth == Depth.NONE:
            filters.append(Colourless(look.theme))
        elif look.depth == Depth.SIXTEEN:
            filters.append(SixteenColours())

    @property
    def why_not(self) -> str:
        """Why maps go through the compositor; empty if they are written directly."""
        if self._reason is None:
            reason = self._self_check()
            if self._app._driver is None:
                return reason
            self._reason = reason
        return self._reason

    def show(self, view: Covered, new: Codes, old: Codes) -> bool:
        """Write what differs; False if the compositor has to do it."""
        if self.why_not:
            return False
        region = self._free_region(view)
        self.obstructed = region is None or (region.height, region.width) != new.shape
        if region is None or self.obstructed:
            return False
        piece = encode(new, old, view.look, view.glyphs, top=region.y, left=region.x)
        if self._frame is not None:
            self._frame.pieces.append(piece)
        else:
            self._write(Frame([piece]))
        return True

    @contextmanager
    def frame(self) -> Iterator[Frame]:
        """Everything shown inside goes out in one write."""
        self._frame = frame = Frame()
        try:
            yield frame
        finally:
            self._frame = None
        self._write(frame)

    def queued(self) -> int:
        """Writes that wait in Textual's writer thread."""
        writer = getattr(self._app._driver, "_writer_thread", None)
        return 0 if writer is None else int(writer._queue.qsize())

    def terminal_resized(self) -> None:
        """Repaint: the terminal has cut its rows, even if it is back at the size it had before.

        Textual repaints only if it finds another size than the last time.
        """

        def repaint() -> None:
            if self._app.screen_stack:  # the app may have ended meanwhile
                self._app.screen.refresh()

        self._app.set_timer(0.1, repaint)

    def fail(self, error: BaseException) -> None:
        """End the app with this error, as if a handler of its own had raised it."""

        def raised() -> None:
            raise error

        self._app.call_later(raised)

    def _write(self, frame: Frame) -> None:
        app = self._app
        body = "".join(frame.pieces)
        if not (body or frame.acknowledged) or not app.is_running:
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

    def _free_region(self, view: Covered) -> Region | None:
        """Where the map is on the screen, or None if anything covers a part of it."""
        app = self._app
        screen: Any = view.screen
        if app._batch_count or app.screen is not screen:
            return None
        visible = screen._compositor.visible_widgets
        judged = self._judged.get(view)
        if judged is None or judged[0] is not visible:  # a new table after each change of layout
            judged = self._judged[view] = (visible, self._uncovered(view, visible))
        return judged[1]

    def _uncovered(self, view: Covered, visible: dict[Any, tuple[Region, Region]]) -> Region | None:
        """The rule of occlusion; widgets are listed from the front to the back."""
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
        """Look for every private name once, on the running app."""
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
            _ = app._batch_count + 0, app._sync_available, driver.write
            if not app.is_web:
                driver._writer_thread._queue.qsize()
        except AttributeError as error:
            return f"this version of Textual has changed: {error}"
        return ""
