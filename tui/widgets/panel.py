"""Parts of panels and dialogs: a panel and its widget, lines of styled text, lists, fields.

Each panel is registered as an entry point of the group `automaton.panels`; the name of the entry is
that of the panel. The entry point is loaded before the first picture, so that it should import
little. The widget is loaded later.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.binding import Binding, BindingType
from textual.geometry import Region, Size
from textual.screen import ModalScreen
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.widgets import Input, TextArea

from automaton.engine.state import NIL
from automaton.floor.floor_plan import FloorPlan
from tui.playback.panel_view import CellChosen, RobotChosen, TickChosen, View, ZoneChosen
from tui.render.styles import GlyphSet

if TYPE_CHECKING:
    from automaton.engine.state import Array


Link = tuple[str, int]  # ("robot" | "cell" | "order" | "tick" or a panel's own word, number)

Line = tuple["Span", ...]
Parts = list["str | Span"]
Facts = list[tuple[str, Parts]]  # names and values

SPAN_LOOKS = ("plain", "dim", "title", "link", "term", "warn", "fault", "good", "cursor", "focus")

MENTION = re.compile(r"robot (\d+)|\((-?\d+), (-?\d+)\)")
PIECES = re.compile(r"\s+|\S+(?: %)?")  # "15 %" stays together

LABEL = 11  # columns of the name of a fact
MAX_LISTED_LINKS = 12  # links in a list; of more, only the number is given
NARROWEST = 20  # minimum width in columns for which lines are written
CUT = "..."  # at the end of a line that is too long
COLUMN_GAP = re.compile(r"  +(?=\S)")  # before a column, such as that of a fact's value


@dataclass
class Panel:
    """A panel: its tab, its key and its widget."""

    tab: str  # text of the tab
    widget: str  # "module:Class" of a PanelWidget, built by Class(signs, id=...)
    key: str = ""  # as Textual names keys
    label: str = ""  # in footer, palette and help
    meaning: str = ""  # in the help
    position: int = 1000  # of its tab; ours are below 100
    listed: int = 1000  # position of its key in the help; ours are below 100
    shown: bool = False  # in the footer
    action: str = ""  # in the table of bindings; for foreign panels "panel_NAME"
    name: str = ""  # that of its entry point


class PanelWidget:
    """The interface of a panel's widget, which must also be a Textual widget."""

    def show(self, view: View) -> None:
        """Show a view whose key has changed."""
        raise NotImplementedError

    def show_order(self, order: int) -> bool:
        """Show an order that was clicked; returns whether this panel shows orders."""
        return False

    def listed_events(self, view: View) -> Array | None:
        """(M,) int64 ascending indices of the listed events; None: it lists no events."""
        return None

    @property
    def focused_part(self) -> Any:
        """The widget to focus when the panel opens in place of the map."""
        return self


# The few signs other than letters. None is "ambiguous" in Unicode's table of East Asian widths: some
# terminals draw such characters two columns wide.


class Signs(NamedTuple):
    """The signs that panels draw."""

    rising: str  # sort order of a column
    falling: str
    before: str  # more on the left
    beyond: str
    here: str  # the present, or the current choice
    on: str
    off: str
    better: str  # the better of two metrics
    full: str  # of a bar
    half: str
    thin: str  # of a thin bar
    thin_half: str
    dots: bool  # whether there are braille patterns


UNICODE_SIGNS: Final = Signs("▴", "▾", "◃", "▹", "▸", "✓", "⋅", "◂", "⣿", "⡇", "⠶", "⠆", True)
ASCII_SIGNS: Final = Signs("^", "v", "<", ">", ">", "+", "-", "*", "#", "", "=", "", False)


def signs_of(glyphs: GlyphSet) -> Signs:
    """The signs that match the characters of the map."""
    return ASCII_SIGNS if glyphs.name == "ascii" else UNICODE_SIGNS


def bar(share: float, width: int, signs: Signs, thin: bool = False) -> str:
    """A bar of at most `width` columns; any positive share is visible."""
    full, half = (signs.thin, signs.thin_half) if thin else (signs.full, signs.half)
    steps = 2 if half else 1
    long = min(width * steps, max(round(share * width * steps), int(share > 0)))
    return (full * (long // steps) + half * (long % steps)).ljust(width)


# Lines of styled text with links.


class Span(NamedTuple):
    """Text in one look, maybe a link."""

    text: str
    look: str | Style = "plain"  # one of SPAN_LOOKS, or a style
    link: Link | None = None


def line(*parts: str | Span) -> Line:
    """A line of plain texts and spans."""
    return tuple(Span(part) if isinstance(part, str) else part for part in parts)


def dim(text: str) -> Span:
    return Span(text, "dim")


def title(text: str) -> Span:
    return Span(text, "title")


def term(text: str, link: Link, width: int) -> tuple[Span, ...]:
    """A word with an explanation, padded to a column."""
    return Span(text, "term", link), Span(" " * max(0, width - len(text)))


def robot_link(robot: int) -> Span:
    return Span(f"robot {robot}", "link", ("robot", robot))


def order_link(order: int, name: str = "order") -> Span:
    return Span(f"{name} {order}", "link", ("order", order))


def tick_link(tick: int) -> Span:
    """A link to a tick; ticks before the run are plain text."""
    return Span(f"tick {tick:,}", "link", ("tick", tick)) if tick >= 0 else Span(f"tick {tick:,}")


def cell_link(floor_plan: FloorPlan, cell: int) -> Span:
    x, y = floor_plan.xy(cell)
    return Span(f"({x}, {y})", "link", ("cell", cell))


def linked(text: str, floor_plan: FloorPlan, look: str = "plain") -> Line:
    """A sentence in which robots and cells are links."""
    spans: list[Span] = []
    at = 0
    for mention in MENTION.finditer(text):
        spans.append(Span(text[at : mention.start()], look))
        robot, x, y = mention.groups()
        spans.append(
            robot_link(int(robot))
            if robot is not None
            else cell_link(floor_plan, floor_plan.cell(int(x), int(y)))
        )
        at = mention.end()
    return tuple(span for span in (*spans, Span(text[at:], look)) if span.text)


def several(links: list[Span]) -> Parts:
    """A list of links; of those beyond MAX_LISTED_LINKS only the number."""
    parts: Parts = []
    for link in links[:MAX_LISTED_LINKS]:
        parts += [link, ", "]
    if len(links) > MAX_LISTED_LINKS:
        return [*parts[:-1], f" and {len(links) - MAX_LISTED_LINKS:,} more"]
    return parts[:-1]


def length(spans: Iterable[Span]) -> int:
    """Number of columns of a line."""
    return sum(len(span.text) for span in spans)


def wrapped(spans: Line, width: int, indent: int = 0, first: int = 0) -> list[Line]:
    """A line wrapped between words; links are never broken.

    The first line is indented by `first`, the others by `indent`.
    """
    lines: list[list[Span]] = [[Span(" " * first)] if first else []]
    for word in _words(spans):
        gap = Span(" ", word[0].look if not word[0].link else "plain")
        fits = length(lines[-1]) + 1 + length(word) <= width
        if length(lines[-1]) <= (indent if len(lines) > 1 else first):
            lines[-1].extend(word)
        elif fits:
            lines[-1].extend((gap, *word))
        else:
            lines.append([Span(" " * indent), *word] if indent else list(word))
    return [tuple(one) for one in lines]


def broken(spans: Line, width: int) -> list[Line]:
    """A line as it is if it fits; else the rest follows below its last column."""
    chars = "".join(span.text for span in spans).rstrip()
    starts = [start for start in _starts(spans) if len(chars[:start].rstrip()) <= width]
    if len(chars) <= width or not starts or not starts[-1]:
        return [spans]
    gaps = [gap.end() for gap in COLUMN_GAP.finditer(chars, 0, starts[-1])]
    indent = next((end for end in reversed(gaps) if end <= width // 2), 2)
    return [_part(spans, 0, starts[-1]), *wrapped(_part(spans, starts[-1]), width, indent, indent)]


def _starts(spans: Line) -> list[int]:
    """The columns at which words begin; links are never broken."""
    starts, at, glued = [], 0, False
    for span in spans:
        for piece in [span.text] if span.link else PIECES.findall(span.text):
            if not piece.isspace() and not glued:
                starts.append(at)
            glued = not piece.isspace()
            at += len(piece)
    return starts


def _part(spans: Line, start: int, end: int | None = None) -> Line:
    """The characters of a line from `start` to `end`."""
    parts, at = [], 0
    for span in spans:
        stop = None if end is None else max(0, end - at)
        parts.append(span._replace(text=span.text[max(0, start - at) : stop]))
        at += len(span.text)
    return tuple(part for part in parts if part.text)


def cut(spans: Line, width: int) -> Line:
    """A line of at most `width` columns that shows whether it is cut; numbers are never cut."""
    chars = "".join(span.text for span in spans)
    if len(chars.rstrip()) <= width:
        return spans
    end = max(0, width - len(CUT))
    start = chars.rfind(" ", 0, end + 1) + 1
    if start > width // 2 or re.search(r"\d", chars[start:].partition(" ")[0]):
        end = start  # between two words
    head = _part(spans, 0, len(chars[:end].rstrip()))
    return (*head, Span(CUT[:width], head[-1].look if head else "plain"))


def _words(spans: Line) -> list[list[Span]]:
    """The pieces between blanks; a piece may consist of several spans."""
    words: list[list[Span]] = []
    glued = False
    for span in spans:
        pieces = [span.text] if span.link else PIECES.findall(span.text)
        for piece in pieces:
            if piece.isspace():
                glued = False
                continue
            part = span._replace(text=piece)
            if glued:
                words[-1].append(part)
            else:
                words.append([part])
            glued = True
    return words


def fact_lines(facts: Iterable[tuple[str, Parts]], width: int) -> list[Line]:
    """The lines of all facts with a value."""
    return [row for name, parts in facts if parts for row in fact(name, *parts, width=width)]


def fact(name: str, *parts: str | Span, width: int, label: int = LABEL) -> list[Line]:
    """A name and its value in two columns."""
    value = wrapped(line(*parts), width - label)
    labels = [name, *[""] * (len(value) - 1)]
    return [(dim(one.ljust(label)), *spans) for one, spans in zip(labels, value, strict=True)]


# Lists.


class Rows(ScrollView, can_focus=True, inherit_bindings=False):
    """A scrolled list of lines under a fixed heading; only visible lines are made.

    Subclasses define the content of a row and the effect of choosing it.
    """

    ALLOW_SELECT = False
    COMPONENT_CLASSES: ClassVar[set[str]] = {f"rows--{look}" for look in SPAN_LOOKS}
    DEFAULT_CSS = """
    Rows {
        height: 1fr; padding: 0 0 0 1; scrollbar-size-vertical: 1; scrollbar-gutter: stable;
        overflow-x: hidden; overflow-y: auto; background: $background; color: $foreground;
        & > .rows--plain { color: $foreground; }
        & > .rows--dim { color: $foreground 70%; }
        & > .rows--title { text-style: bold; color: $foreground; }
        & > .rows--link { text-style: underline; color: $text-primary; }
        & > .rows--term { color: $foreground 70%; text-style: underline; }
        & > .rows--warn { color: $text-warning; }
        & > .rows--fault { text-style: bold; color: $text-error; }
        & > .rows--good { color: $text-success; }
        & > .rows--focus { text-style: reverse bold underline; color: $foreground; }
        & > .rows--cursor { text-style: reverse; color: $foreground; }
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "move(-1)", "Up", show=False),
        Binding("down", "move(1)", "Down", show=False),
        Binding("pageup", "page(-1)", "Page up", show=False),
        Binding("pagedown", "page(1)", "Scroll", key_display="pgdn"),
        Binding("enter", "follow_cursor", "Open", show=False),
    ]

    def __init__(self, signs: Signs = UNICODE_SIGNS, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.signs = signs
        self.heading: list[Line] = []
        self.cursor = 0  # index of a row
        self._count = 0
        self._seen: dict[int, Line] = {}  # last painted content, by line of the widget

    def row(self, index: int) -> Line:
        """The content of a row."""
        raise NotImplementedError

    def chosen(self, index: int) -> None:
        """React to a click on a row, or to enter."""

    def follow(self, link: Link, column: int = 0) -> None:
        """Follow a link that was clicked `column` columns from its left end."""
        kind, number = link
        messages = {
            "robot": RobotChosen,
            "cell": CellChosen,
            "tick": TickChosen,
            "zone": ZoneChosen,
        }
        self.post_message(messages[kind](number))

    @property
    def width(self) -> int:
        """Number of columns for text."""
        return max(NARROWEST, self.scrollable_content_region.width)  # also while hidden

    @property
    def lines_for_rows(self) -> int:
        """Number of rows that fit."""
        return max(1, self.scrollable_content_region.height - len(self.heading))

    def update_rows(self, count: int) -> None:
        """Set the number of rows, and repaint visible rows with changed content."""
        self._count = count
        self.cursor = max(0, min(self.cursor, count - 1))
        size = Size(self.width, len(self.heading) + count)
        if size != self.virtual_size:
            self.virtual_size = size
        for y, before in list(self._seen.items()):
            if self._line(y) != before:
                self.refresh(Region(0, y, self.width, 1))

    def _line(self, y: int) -> Line:
        """The content of a line of the widget."""
        if y < len(self.heading):
            return cut(self.heading[y], self.width)
        index = self._index(y)
        if index == NIL:
            return ()
        shown = cut(self.row(index), self.width)
        return self.marked(shown) if index == self.cursor and self.shows_cursor else shown

    @property
    def shows_cursor(self) -> bool:
        """Whether to highlight the row under the cursor."""
        return self.has_focus

    def marked(self, shown: Line) -> Line:
        """The highlighted row under the cursor."""
        rest = Span(" " * max(0, self.width - length(shown)))
        return tuple(span._replace(look="cursor") for span in (*shown, rest))

    def _index(self, y: int) -> int:
        """The row in a line of the widget, or NIL."""
        index = self.scroll_offset.y + y - len(self.heading)
        return index if y >= len(self.heading) and index < self._count else NIL

    def render_line(self, y: int) -> Strip:
        shown = self._seen[y] = self._line(y)
        base = self.style_of("plain")
        strip = Strip([Segment(span.text, self.style_of(span.look)) for span in shown])
        return strip.simplify().adjust_cell_length(self.width, base)

    def style_of(self, look: str | Style) -> Style:
        """The style of a look in the present theme."""
        if isinstance(look, Style):
            return look
        return self.get_component_rich_style(f"rows--{look}")

    def span_at(self, x: int, y: int) -> tuple[Span | None, int]:
        """The span at a place of the widget, and the place's distance from its left end."""
        for span in self._line(y):
            if x < len(span.text):
                return span, x
            x -= len(span.text)
        return None, 0

    def on_click(self, event: events.Click) -> None:
        """Follow a link, or choose a row."""
        offset = event.get_content_offset(self)
        if offset is None:
            return
        event.stop()
        index = self._index(offset.y)
        if index != NIL:
            self.cursor = index
            self.update_rows(self._count)
        span, column = self.span_at(offset.x, offset.y)
        if span is not None and span.link is not None:
            self.follow(span.link, column)
        elif index != NIL:
            self.chosen(index)

    def on_focus(self) -> None:
        self.update_rows(self._count)

    def on_blur(self) -> None:
        self.update_rows(self._count)

    def on_unmount(self) -> None:
        self._seen.clear()

    def on_resize(self) -> None:
        self._seen.clear()
        self.refresh()  # discard lines that Textual has cached for the old size

    def action_move(self, rows: int) -> None:
        """Move the cursor."""
        if self._count:
            self.cursor = max(0, min(self.cursor + rows, self._count - 1))
            self.keep_in_sight(self.cursor)
            self.update_rows(self._count)

    def action_page(self, pages: int) -> None:
        """Move the cursor by a page."""
        self.action_move(pages * self.lines_for_rows)

    def action_follow_cursor(self) -> None:
        """Choose the row under the cursor."""
        if self._count:
            self.chosen(self.cursor)

    def keep_in_sight(self, index: int) -> None:
        """Scroll as little as needed to show a row."""
        top = self.scroll_offset.y
        nearest = max(index - self.lines_for_rows + 1, min(top, index))
        if nearest != top:
            self.scroll_to(y=nearest, animate=False, force=True)

    def in_sight(self, index: int) -> bool:
        """Whether a row is visible."""
        return 0 <= index - self.scroll_offset.y < self.lines_for_rows


class TextPanel(Rows, PanelWidget):
    """A panel of text lines; up and down move from link to link.

    Subclasses write the lines for a width; they are rewritten only after changes. Longer lines are
    broken between words.
    """

    ends: Sequence[int] = ()  # numbers of lines after which the panel may end

    def __init__(self, signs: Signs = UNICODE_SIGNS, *, id: str | None = None) -> None:
        super().__init__(signs, id=id)
        self.view: View | None = None
        self.lines: list[Line] = []
        self.explained: Link | None = None  # the word whose explanation is shown
        self._key: tuple[object, ...] = ()
        self._link = 0  # index of the link under the cursor, among all links

    def panel_lines(self, view: View, width: int) -> list[Line]:
        """The lines of the panel."""
        raise NotImplementedError

    def cache_key(self, view: View) -> tuple[object, ...]:
        """The values on which the lines depend."""
        return view.key

    def show(self, view: View) -> None:
        """Update the lines for a view."""
        self.view = view
        key = (*self.cache_key(view), self.width)
        if key != self._key:
            self._key = key
            self.write(self.panel_lines(view, self.width))

    def write(self, lines: list[Line]) -> None:
        """Show these lines."""
        rows = [broken(one, self.width) for one in lines]
        self.lines = [row for one in rows for row in one]
        before = (0, *accumulate(map(len, rows)))
        self.ends = [before[end] for end in self.ends]
        self._place_cursor()
        self.update_rows(len(self.lines))

    def explain(self, link: Link) -> None:
        """Show or hide the explanation of a word."""
        self.explained = None if link == self.explained else link
        if self.view is not None:
            self.write(self.panel_lines(self.view, self.width))

    def explanation(self, link: Link, text: str, width: int) -> list[Line]:
        """The lines of a word's explanation, if shown."""
        if link != self.explained:
            return []
        return wrapped(line(dim(text)), width, indent=2, first=2)

    def row(self, index: int) -> Line:
        return self.lines[index]

    def marked(self, shown: Line) -> Line:
        """A line with the link under the cursor highlighted."""
        place = self._place()
        return tuple(
            span._replace(look="cursor") if at == place[1] else span
            for at, span in enumerate(shown)
        )

    def links(self) -> list[tuple[int, int, Span]]:
        """Row, index in the row and span of each link, except bars and curves."""
        return [
            (row, at, span)
            for row, shown in enumerate(self.lines)
            for at, span in enumerate(shown)
            if span.link is not None and span.look in ("link", "term")
        ]

    def _place(self) -> tuple[int, int]:
        places = self.links()
        return places[self._link][:2] if places else (0, -1)

    def _place_cursor(self) -> None:
        self._link = max(0, min(self._link, len(self.links()) - 1))
        self.cursor = self._place()[0]

    def action_move(self, rows: int) -> None:
        """Move to another link, or scroll if there is no other."""
        before = self._link
        self._link += rows
        self._place_cursor()
        if self._link == before or not self.in_sight(self.cursor):
            self.scroll_relative(y=rows, animate=False, force=True)
        if self._link != before:
            self.keep_in_sight(self.cursor)
        self.update_rows(len(self.lines))

    def action_page(self, pages: int) -> None:
        """Scroll by a page."""
        self.scroll_relative(y=pages * self.lines_for_rows, animate=False, force=True)

    def action_follow_cursor(self) -> None:
        """Follow the link under the cursor."""
        places = self.links()
        link = places[self._link][2].link if places else None
        if link is not None:
            self.follow(link)

    def on_resize(self) -> None:
        super().on_resize()
        if self.view is not None:
            self.show(self.view)


# Text fields in which keys take effect in the order of typing.
#
# Textual 8.2 passes printable characters to the field at once, but runs the action of a bound key,
# such as backspace, only after the key has passed the queues of all parents. Characters of the same
# read are entered before, and backspace deletes the last of these. Here the field itself runs the
# bound action, its own or one of its parents', before it takes the next key.

if TYPE_CHECKING:
    from textual.dom import DOMNode as _Node
else:
    _Node = object


class KeysInOrder(_Node):
    """A mixin; it precedes Textual's widget among the bases of a field."""

    async def _on_key(self, event: events.Key) -> None:
        if event.is_printable:
            return
        for node in self.ancestors_with_self:
            for binding in node._bindings.key_to_bindings.get(event.key, ()):
                if await self.app.run_action(binding.action, node):
                    event.stop()
                    event.prevent_default()
                    return
            if isinstance(node, ModalScreen):
                return


class TypedInput(KeysInOrder, Input):
    """A field of one line."""


class TypedText(KeysInOrder, TextArea):
    """A field of several lines."""
