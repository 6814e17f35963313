"""A rectangle of coded cells: shows pictures, reports what the mouse does, knows nothing of robots.

`batch_view` is what the terminal shows here, or what the compositor's next repaint will put here.
The compositor paints from `batch_view` only, so that overlays, resizes, screenshots and tests
without a terminal all see the same picture, whichever way it came.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.segment import Segment
from textual import events
from textual.geometry import Region
from textual.message import Message
from textual.strip import Strip
from textual.widget import Widget

from tui.render.encode import runs
from tui.terminal.presenter import Presenter, row_strip

if TYPE_CHECKING:
    from tui.render.glyphs import Codes, GlyphSet
    from tui.render.styles import Look

WHEEL = {
    events.MouseScrollUp: "up",
    events.MouseScrollDown: "down",
    events.MouseScrollLeft: "left",
    events.MouseScrollRight: "right",
}


class MapView(Widget, can_focus=True):
    """Shows codes; border and title belong on its parent, since it fills its whole region."""

    ALLOW_SELECT = False
    DEFAULT_CSS = "MapView { width: 1fr; height: 1fr; }"

    class Happened(Message):
        """What all messages of a map have in common: `control` is the map."""

        def __init__(self, view: MapView) -> None:
            super().__init__()
            self.view = view

        @property
        def control(self) -> MapView:
            return self.view

    class Resized(Happened):
        """The map has another size now."""

        def __init__(self, view: MapView, rows: int, columns: int) -> None:
            super().__init__(view)
            self.rows, self.columns = rows, columns

    class Clicked(Happened):
        """A button was pressed and released without a drag between."""

        def __init__(self, view: MapView, event: events.Click) -> None:
            super().__init__(view)
            self.row, self.column = event.y, event.x
            self.button = event.button  # 1 left, 2 middle, 3 right
            self.shift, self.ctrl = event.shift, event.ctrl
            self.double = event.chain == 2

    class Dragged(Happened):
        """The mouse moved so many rows and columns with a button down."""

        def __init__(self, view: MapView, rows: int, columns: int, button: int) -> None:
            super().__init__(view)
            self.rows, self.columns, self.button = rows, columns, button

    class Wheeled(Happened):
        """The wheel was turned by a notch: up, down, left or right."""

        def __init__(self, view: MapView, event: events.MouseEvent) -> None:
            super().__init__(view)
            self.row, self.column = event.y, event.x
            self.direction = WHEEL[type(event)]
            self.shift, self.ctrl = event.shift, event.ctrl

    class Hovered(Happened):
        """The mouse has come to another cell; row and column are -1 when it has left."""

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
        self._strips: list[Strip | None] = []  # by row; None: to be made when asked for
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
        """Other colours or characters, for the same codes."""
        self._look, self._glyphs = look, glyphs
        self._presenter.match(look)
        self._strips = [None] * len(self._strips)
        self.refresh()

    def present(self, codes: Codes) -> None:
        """Show these codes, of shape (rows, columns); they are copied."""
        if self.shown is None or self.shown.shape != codes.shape:
            self.shown = codes.copy()
            self._strips = [None] * len(codes)
            self.refresh()
            return
        changed = np.flatnonzero((codes != self.shown).any(axis=1))
        if not changed.size:
            return
        if not self._presenter.show(self, codes, self.shown):
            # Whole rows: a region is sent from the left edge of the map anyway.
            self.refresh(*(Region(0, int(row), codes.shape[1], 1) for row in changed))
        self.shown[changed] = codes[changed]
        for row in changed:
            self._strips[row] = None

    def render_lines(self, crop: Region) -> list[Strip]:
        """The rows of `batch_view`; called for repaints, screenshots and to find what the mouse is on."""
        strips = [self.render_line(row) for row in range(crop.y, crop.bottom)]
        if crop.x == 0 and all(strip.cell_length == crop.width for strip in strips):
            return strips
        blank = self._look.rich(0)
        return [strip.crop_extend(crop.x, crop.right, blank) for strip in strips]

    def render_line(self, y: int) -> Strip:
        """One row, made once and kept until it changes."""
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
