"""The panels together: the figures, and below or beside them one of the others.

column              full
+------------+      +-----------+-----------+
| figures    |      | figures   | tabs      |
+------------+      |           +-----------+
| tabs       |      |           | the open  |
| the open   |      |           | panel     |
| panel      |      |           |           |
+------------+      +-----------+-----------+
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Final

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, Vertical
from textual.message import Message
from textual.widgets import ContentSwitcher

from automaton.engine.state import NIL
from tui.playback.panel_view import View
from tui.render.camera import Zoom
from tui.render.glyphs import GlyphSet
from tui.render.scene import Scene
from tui.render.styles import Look
from tui.widgets.event_list import Events
from tui.widgets.inspector import Inspector, OrderChosen
from tui.widgets.legend_panel import Legend
from tui.widgets.metrics_panel import Figures
from tui.widgets.robot_table import Robots
from tui.widgets.rows import Rows
from tui.widgets.signs import signs_of
from tui.widgets.styled_lines import Line, Link, Span
from tui.widgets.why_panel import Why

TABS: Final = {  # name of a panel: its tab and the app's key that opens it
    "inspector": ("info", "i"),
    "why": ("why", "w"),
    "events": ("events", "e"),
    "robots": ("robots", "t"),
    "legend": ("legend", "K"),
}
WITH_KEYS: Final = 40  # columns from which the tabs name their keys


class TabStrip(Rows):
    """One line with the names of the panels; the open one stands out."""

    DEFAULT_CSS = """
    TabStrip {
        height: 1; overflow-y: hidden; scrollbar-gutter: auto; background: $panel;
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left", "neighbour(-1)", "Previous panel", show=False),
        Binding("right", "neighbour(1)", "Next panel", show=False),
    ]
    open = "inspector"

    class Opened(Message):
        """A tab was chosen."""

        def __init__(self, name: str) -> None:
            self.name = name
            super().__init__()

    def on_mount(self) -> None:
        self.update_rows(1)

    def set_content(self, name: str) -> None:
        """Mark the open panel."""
        self.open = name
        self.update_rows(1)

    def row(self, index: int) -> Line:
        spans: list[Span] = []
        for at, (name, (label, key)) in enumerate(TABS.items()):
            text = f"{label} {key}" if self.width >= WITH_KEYS else label
            look = "cursor" if name == self.open else "plain"
            spans += [Span(text, look, ("tab", at)), Span(" ", "dim")]
        return tuple(spans[:-1])

    def marked(self, made: Line) -> Line:
        """The open tab is marked anyway; with the focus it is underlined, too."""
        return tuple(
            span._replace(look="focus" if span.look == "cursor" else span.look) for span in made
        )

    def follow(self, link: Link, column: int = 0) -> None:
        self.post_message(self.Opened(list(TABS)[link[1]]))

    def action_neighbour(self, step: int) -> None:
        """Open the next panel."""
        names = list(TABS)
        self.post_message(self.Opened(names[(names.index(self.open) + step) % len(names)]))


class PanelColumn(Container):
    """All panels; those that are not in sight do no work."""

    DEFAULT_CSS = """
    PanelColumn {
        layout: vertical; width: 34; height: 1fr; background: $background;
        & > Figures { height: auto; max-height: 50%; }
        & > Vertical { height: 1fr; }
        & ContentSwitcher { height: 1fr; }
        &.full { layout: horizontal; width: 1fr; }
        &.full > Figures { width: 2fr; height: 1fr; max-height: 100%; }
        &.full > Vertical { width: 3fr; }
    }
    """

    def __init__(self, look: Look, glyphs: GlyphSet, *, id: str | None = None) -> None:
        super().__init__(id=id)
        signs = signs_of(glyphs)
        self.figures = Figures(signs, id="figures")
        self.inspector = Inspector(signs, id="inspector")
        self.why = Why(signs, id="why")
        self.events = Events(signs, id="events")
        self.robots = Robots(signs, id="robots")
        self.legend = Legend(look, glyphs, signs, id="legend")
        self.tabs = TabStrip(signs)
        self._view: View | None = None
        self._key: tuple[object, ...] = ()  # of what is shown

    def compose(self) -> ComposeResult:
        yield self.figures
        with Vertical():
            yield self.tabs
            with ContentSwitcher(initial="inspector"):
                yield self.inspector
                yield self.why
                yield self.events
                yield self.robots
                yield self.legend

    @property
    def name_open(self) -> str:
        """Which panel is open below the tabs."""
        return self.tabs.open

    def show(self, view: View) -> None:
        """Show this in the figures and in the open panel, as far as they are in sight."""
        self._view = view = _within(view)
        chosen = (view.robot, view.cell, view.zone)
        key = (id(view.run), view.playback.seq, *chosen, view.side, view.layer)
        self._fit_figures()
        if not self.is_mounted or not self.size or key == self._key:
            return
        self._key = key
        self.figures.show(view)
        self._fit_figures()
        self._opened().show(view)

    def _fit_figures(self) -> None:
        """Above another panel the figures end where a part of them ends, not within a curve."""
        if self.size:
            most = self.figures.rows_within(self.size.height // 2)
            self.figures.styles.max_height = None if self.has_class("full") else most

    def on_resize(self) -> None:
        self._fit_figures()

    def _opened(self) -> Inspector | Why | Events | Robots | Legend:
        panels = (self.inspector, self.why, self.events, self.robots, self.legend)
        return panels[list(TABS).index(self.tabs.open)]

    def open(self, name: str, focus: bool = False) -> None:
        """Open a panel of TABS; "figures" are always open."""
        if name in TABS:
            self.query_one(ContentSwitcher).current = name
            self.tabs.set_content(name)
        self._key = ()
        if self._view is not None:
            self.show(self._view)
        if focus:
            panel = self.figures if name == "figures" else self._opened()
            (panel.list if isinstance(panel, Events) else panel).focus()

    def show_floor(self, scene: Scene, zoom: Zoom) -> None:
        """Explain this picture in the legend."""
        self.legend.show_floor(scene, zoom)

    def set_appearance(self, look: Look, glyphs: GlyphSet) -> None:
        """Other colours or characters on the map."""
        self.legend.set_appearance(look, glyphs)

    def on_tab_strip_opened(self, message: TabStrip.Opened) -> None:
        message.stop()
        self.open(message.name)

    def on_order_chosen(self, message: OrderChosen) -> None:
        """An order is shown by the inspector, whoever was clicked."""
        self.inspector.tell_order(message.order)
        if self.tabs.open != "inspector":
            self.open("inspector")


def _within(view: View) -> View:
    """Without a choice that one of two compared runs does not know: fewer robots, a smaller floor."""
    known = view.robot < len(view.snapshot.robots) and view.cell < view.floor_plan.kind.size
    return view if known else replace(view, robot=NIL, cell=NIL)
