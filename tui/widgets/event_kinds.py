"""Which events are listed, as boxes to be ticked: by mouse, or by keys when they have the focus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.message import Message

from tui.widgets.rows import Rows
from tui.widgets.signs import Signs
from tui.widgets.styled_lines import Line, Link, Span, line, wrapped


class KindBoxes(Rows):
    """Words behind boxes, in as many lines as they need."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left,up", "move(-1)", "Previous box", show=False),
        Binding("right,down", "move(1)", "Next box", show=False),
        Binding("space,enter", "follow_cursor", "Tick it or not", show=False),
    ]

    class Ticked(Message):
        """A box was ticked, or its tick taken away."""

        def __init__(self, box: int) -> None:
            super().__init__()
            self.box = box

    def __init__(self, signs: Signs) -> None:
        super().__init__(signs)
        self.box = 0  # under the cursor
        self._boxes: list[tuple[str, bool]] = []
        self._lines: list[Line] = []

    def set_content(self, boxes: Sequence[tuple[str, bool]]) -> None:
        """These words, each ticked or not."""
        self._boxes = list(boxes)
        spans: list[Span | str] = []
        for at, (name, ticked) in enumerate(self._boxes):
            sign, look = (self.signs.on, "plain") if ticked else (self.signs.off, "dim")
            spans += [Span(f"{sign}{name}", look, ("box", at)), " "]
        self._lines = wrapped(line(*spans), self.width)
        self.styles.height = len(self._lines)
        self._place()

    def _place(self) -> None:
        places = (at for at, made in enumerate(self._lines) if self._under_cursor(made))
        self.cursor = next(places, 0)
        self.update_rows(len(self._lines))

    def _under_cursor(self, made: Line) -> bool:
        return any(span.link == ("box", self.box) for span in made)

    def row(self, index: int) -> Line:
        return self._lines[index]

    def marked(self, made: Line) -> Line:
        return tuple(
            span._replace(look="cursor") if span.link == ("box", self.box) else span
            for span in made
        )

    def follow(self, link: Link, column: int = 0) -> None:
        self.box = link[1]
        self.post_message(self.Ticked(self.box))

    def action_move(self, rows: int) -> None:
        """Go to another box."""
        self.box = max(0, min(self.box + rows, len(self._boxes) - 1))
        self._place()

    def action_follow_cursor(self) -> None:
        """Tick the box under the cursor, or take its tick away."""
        self.follow(("box", self.box))

    def on_resize(self) -> None:
        super().on_resize()
        self.set_content(self._boxes)
