"""A panel of lines of text; up and down go from link to link."""

from __future__ import annotations

from tui.playback.panel_view import View
from tui.widgets.panel import PanelWidget
from tui.widgets.rows import Rows
from tui.widgets.styled_lines import UNICODE, Line, Link, Signs, Span, dim, line, wrapped


class TextPanel(Rows, PanelWidget):
    """Subclasses write the lines for a width; they are made again only when something changed."""

    def __init__(self, signs: Signs = UNICODE, *, id: str | None = None) -> None:
        super().__init__(signs, id=id)
        self.view: View | None = None
        self.lines: list[Line] = []
        self.explained: Link | None = None  # a word of the panel's own that was clicked
        self._key: tuple[object, ...] = ()
        self._link = 0  # index of the link under the cursor, among all links

    def panel_lines(self, view: View, width: int) -> list[Line]:
        """What there is to be said."""
        raise NotImplementedError

    def cache_key(self, view: View) -> tuple[object, ...]:
        """What the lines depend on."""
        return view.key

    def show(self, view: View) -> None:
        """Tell of this."""
        self.view = view
        key = (*self.cache_key(view), self.width)
        if key != self._key:
            self._key = key
            self.write(self.panel_lines(view, self.width))

    def write(self, lines: list[Line]) -> None:
        """Show these lines."""
        self.lines = lines
        self._place_cursor()
        self.update_rows(len(lines))

    def explain(self, link: Link) -> None:
        """Explain a word where it stands, or no more."""
        self.explained = None if link == self.explained else link
        if self.view is not None:
            self.write(self.panel_lines(self.view, self.width))

    def explanation(self, link: Link, text: str, width: int) -> list[Line]:
        """Lines for below a word, if it is to be explained."""
        told = wrapped(line(dim(text)), width, indent=2, first=2)
        return told if link == self.explained else []

    def row(self, index: int) -> Line:
        return self.lines[index]

    def marked(self, made: Line) -> Line:
        """The link under the cursor stands out."""
        place = self._place()
        return tuple(
            span._replace(look="cursor") if at == place[1] else span for at, span in enumerate(made)
        )

    def links(self) -> list[tuple[int, int, Span]]:
        """Row, place in it and span of each part that leads somewhere; bars and curves do not count."""
        return [
            (row, at, span)
            for row, made in enumerate(self.lines)
            for at, span in enumerate(made)
            if span.link is not None and span.look in ("link", "term")
        ]

    def _place(self) -> tuple[int, int]:
        places = self.links()
        return places[self._link][:2] if places else (0, -1)

    def _place_cursor(self) -> None:
        self._link = max(0, min(self._link, len(self.links()) - 1))
        self.cursor = self._place()[0]

    def action_move(self, rows: int) -> None:
        """Go to another link; without one farther on, scroll."""
        before = self._link
        self._link += rows
        self._place_cursor()
        if self._link == before or not self.in_sight(self.cursor):
            self.scroll_relative(y=rows, animate=False, force=True)
        if self._link != before:
            self.keep_in_sight(self.cursor)
        self.update_rows(len(self.lines))

    def action_page(self, pages: int) -> None:
        """Scroll by what is in sight."""
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
