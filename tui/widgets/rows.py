"""A scrolled list of lines under a fixed heading, of which only those in sight are ever made."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

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
from tui.playback.panel_view import CellChosen, RobotChosen, TickChosen, ZoneChosen
from tui.widgets.styled_lines import SPAN_LOOKS, UNICODE, Line, Link, Signs, Span, length

MESSAGE_CLASSES = {"robot": RobotChosen, "cell": CellChosen, "tick": TickChosen, "zone": ZoneChosen}


NARROWEST = 20  # columns for which lines are made


class Rows(ScrollView, can_focus=True, inherit_bindings=False):
    """Subclasses say what is in a row, and what choosing one means."""

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
        Binding("pagedown", "page(1)", "Page down", show=False),
        Binding("enter", "follow_cursor", "Open", show=False),
    ]

    def __init__(self, signs: Signs = UNICODE, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.signs = signs
        self.heading: list[Line] = []
        self.cursor = 0  # a row
        self._count = 0
        self._seen: dict[int, Line] = {}  # by line of the widget, as it was painted last

    def row(self, index: int) -> Line:
        """What a row says."""
        raise NotImplementedError

    def chosen(self, index: int) -> None:
        """A row was clicked, or enter pressed on it."""

    def follow(self, link: Link, column: int = 0) -> None:
        """A part of a line that leads somewhere was clicked, so many columns from its left end."""
        kind, number = link
        self.post_message(MESSAGE_CLASSES[kind](number))

    @property
    def width(self) -> int:
        """Columns for text."""
        return max(NARROWEST, self.scrollable_content_region.width)  # also while it is hidden

    @property
    def lines_for_rows(self) -> int:
        """Rows that are in sight at a time."""
        return max(1, self.scrollable_content_region.height - len(self.heading))

    def update_rows(self, count: int) -> None:
        """There are so many rows now; paint those in sight that say something else than before."""
        self._count = count
        self.cursor = max(0, min(self.cursor, count - 1))
        size = Size(self.width, len(self.heading) + count)
        if size != self.virtual_size:
            self.virtual_size = size
        for y, before in list(self._seen.items()):
            if self._line(y) != before:
                self.refresh(Region(0, y, self.width, 1))

    def _line(self, y: int) -> Line:
        """What stands in a line of the widget."""
        if y < len(self.heading):
            return self.heading[y]
        index = self._index(y)
        if index == NIL:
            return ()
        made = self.row(index)
        return self.marked(made) if index == self.cursor and self.shows_cursor else made

    @property
    def shows_cursor(self) -> bool:
        """Whether the row under the cursor stands out."""
        return self.has_focus

    def marked(self, made: Line) -> Line:
        """The row under the cursor."""
        rest = Span(" " * max(0, self.width - length(made)))
        return tuple(span._replace(look="cursor") for span in (*made, rest))

    def _index(self, y: int) -> int:
        """The row in a line of the widget, or NIL."""
        index = self.scroll_offset.y + y - len(self.heading)
        return index if y >= len(self.heading) and index < self._count else NIL

    def render_line(self, y: int) -> Strip:
        made = self._seen[y] = self._line(y)
        base = self.style_of("plain")
        strip = Strip([Segment(span.text, self.style_of(span.look)) for span in made])
        return strip.simplify().adjust_cell_length(self.width, base)

    def style_of(self, look: str | Style) -> Style:
        """A look in the colours of the theme."""
        if isinstance(look, Style):
            return look
        return self.get_component_rich_style(f"rows--{look}")

    def span_at(self, x: int, y: int) -> tuple[Span | None, int]:
        """What stands in a place of the widget, and how far from its left end the place is."""
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
        self.refresh()  # what Textual keeps of the old size would not ask for lines again

    def action_move(self, rows: int) -> None:
        """Move the cursor."""
        if self._count:
            self.cursor = max(0, min(self.cursor + rows, self._count - 1))
            self.keep_in_sight(self.cursor)
            self.update_rows(self._count)

    def action_page(self, pages: int) -> None:
        """Move the cursor by as many rows as are in sight."""
        self.action_move(pages * self.lines_for_rows)

    def action_follow_cursor(self) -> None:
        """Choose the row under the cursor."""
        if self._count:
            self.chosen(self.cursor)

    def keep_in_sight(self, index: int) -> None:
        """Scroll no farther than needed to show a row."""
        top = self.scroll_offset.y
        nearest = max(index - self.lines_for_rows + 1, min(top, index))
        if nearest != top:
            self.scroll_to(y=nearest, animate=False, force=True)

    def in_sight(self, index: int) -> bool:
        """Whether a row is shown."""
        return 0 <= index - self.scroll_offset.y < self.lines_for_rows


# Fields of text in which keys take effect in the order in which they are typed.
#
# Textual 8.2 gives a printable character to the field at once, and a key that is bound, such as
# backspace, to what it is bound to only after it has gone through the queues of all parents:
# characters that come in the same read are entered before it, and it deletes the last of them. Here
# the field carries out what is bound, in itself or around it, before it takes the next key.


if TYPE_CHECKING:
    from textual.dom import DOMNode as _Node
else:
    _Node = object


class KeysInOrder(_Node):
    """Comes before a widget of Textual among the bases of a field."""

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
    """A line."""


class TypedText(KeysInOrder, TextArea):
    """Several lines."""


# What a terminal that is too small shows in place of everything else, and the classes of sizes.
