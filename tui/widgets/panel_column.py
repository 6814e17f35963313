"""The panels: the metrics, and below or beside them one of the others; or one of all.

column              full                           one
+------------+      +-----------+-----------+      +------------+
| metrics    |      | metrics   | tabs      |      | tabs       |
+------------+      |           +-----------+      +------------+
| tabs       |      |           | the open  |      | metrics or |
| the open   |      |           | panel     |      | the open   |
| panel      |      |           |           |      | panel      |
+------------+      +-----------+-----------+      +------------+
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, ClassVar, Final, NamedTuple

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, Vertical
from textual.message import Message
from textual.strip import Strip
from textual.widgets import ContentSwitcher

from automaton.engine.state import NIL, Array
from tui.playback.panel_view import OrderChosen, View
from tui.registration import guard, left_out, load, panels
from tui.render.styles import GlyphSet
from tui.widgets.bindings import VIEWER_ACTIONS, key_text
from tui.widgets.metrics_panel import Figures
from tui.widgets.panel import Line, Link, PanelWidget, Rows, Signs, Span, signs_of

METRICS_SHARE: Final = 0.65  # maximum of the height; shows where the time went in 36 rows
MAX_TAB_GAP: Final = 3  # columns between tabs
METRICS_NAME: Final = "metrics"


class PanelColumn(Container):
    """All panels; hidden ones do no work."""

    DEFAULT_CSS = """
    PanelColumn {
        layout: vertical; width: 34; height: 1fr; background: $background;
        & > Figures { height: auto; max-height: 55%; }
        & > Vertical { height: 1fr; }
        & ContentSwitcher { height: 1fr; }
        &.full { layout: horizontal; width: 1fr; }
        &.full > Figures { width: 2fr; height: 1fr; max-height: 100%; }
        &.full > Vertical { width: 3fr; }
        &.one > Figures { display: none; }
        &.one.metrics > Figures { display: block; height: 1fr; max-height: 100%; }
        &.one.metrics > Vertical { height: auto; dock: top; }
        &.one.metrics ContentSwitcher { display: none; }
    }
    """

    def __init__(self, glyphs: GlyphSet, widgets: Widgets, *, id: str | None = None) -> None:
        super().__init__(id=id)
        signs = signs_of(glyphs)
        self.figures = Figures(signs, id="figures")
        self.panels: dict[str, Any] = {}
        problems = list(widgets.problems)
        for name, kind in widgets.by_name.items():
            try:
                self.panels[name] = _built(name, kind, signs)
            except Exception as error:  # a user's widget may raise anything
                problems.append(left_out("panel", name, error))
        self.problems = tuple(problems)  # widgets that failed
        self.tabs = TabStrip(signs, list(self.panels))
        self._view: View | None = None
        self._key: tuple[object, ...] = ()  # key of the shown view

    def compose(self) -> ComposeResult:
        yield self.figures
        with Vertical():
            yield self.tabs
            with ContentSwitcher(initial=self.tabs.open or None):
                yield from self.panels.values()

    @property
    def name_open(self) -> str:
        """The name of the panel that is open below the tabs; "metrics" if they take its place."""
        return METRICS_NAME if self.has_class("one") and self.tabs.shows_metrics else self.tabs.open

    def show_one(self, one: bool) -> None:
        """Show only the metrics or only the open panel, where there is no room for both."""
        self.set_class(one, "one")
        self.tabs.has_metrics = one
        self.tabs.set_content()

    def show(self, view: View) -> None:
        """Show a view in the metrics and in the open panel, if visible."""
        self._view = view = _within(view)
        self._fit_metrics()
        key = (*view.key, self.figures.display, self.name_open)
        if not self.is_mounted or not self.size or key == self._key:
            return
        self._key = key
        if self.figures.display:
            self.figures.show(view)
            self._fit_metrics()
        if self.tabs.open and self.name_open != METRICS_NAME:
            self.panels[self.tabs.open].show(view)

    def _fit_metrics(self) -> None:
        """Limit the height of the metrics above a panel to whole parts, such as curves."""
        if self.size:
            most = self.figures.rows_within(int(METRICS_SHARE * self.size.height))
            is_free = self.has_class("full") or self.has_class("one")
            self.figures.styles.max_height = None if is_free else most

    def on_resize(self) -> None:
        self._fit_metrics()

    def open(self, name: str, focus: bool = False) -> None:
        """Open a panel; the metrics are always open where there is room for both."""
        self.tabs.shows_metrics = name == METRICS_NAME
        self.set_class(name == METRICS_NAME, METRICS_NAME)
        if name in self.panels:
            self.query_one(ContentSwitcher).current = self.tabs.open = name
        self.tabs.set_content()
        self._key = ()
        if self._view is not None:
            self.show(self._view)
        if focus:
            self.panels.get(name, self.figures).focused_part.focus()

    def scroll_pages(self, pages: int) -> None:
        """Scroll the open panel, or the metrics if all of it is seen, whatever has the focus."""
        part = self.panels.get(self.name_open, self.figures).focused_part
        if not part.max_scroll_y and self.figures.display:
            part = self.figures
        rows = part.lines_for_rows if isinstance(part, Rows) else part.size.height
        part.scroll_relative(y=pages * rows, animate=False, force=True)

    def listed_events(self, view: View) -> Array | None:
        """(M,) int64 ascending indices of listed events; None: no panel lists events."""
        lists = (panel.listed_events(view) for panel in self.panels.values())
        return next((listed for listed in lists if listed is not None), None)

    def on_tab_strip_opened(self, message: TabStrip.Opened) -> None:
        message.stop()
        self.open(message.name)

    def on_order_chosen(self, message: OrderChosen) -> None:
        """Open the panel that shows orders, whichever panel was clicked."""
        showing = (name for name, panel in self.panels.items() if panel.show_order(message.order))
        name = next(showing, self.tabs.open)
        if self.tabs.open != name:
            self.open(name)


class _SwitchedOff(PanelWidget):
    """The behaviour of a panel after it has raised."""

    def show(self, view: View) -> None:
        """Nothing."""


def _built(name: str, kind: type[Any], signs: Signs) -> Any:
    """The widget of a panel; a foreign one is hidden after its first error."""
    widget = kind(signs, id=name)
    if name not in panels().own:
        guard(widget, "panel", name, _SwitchedOff, lambda _: setattr(widget, "visible", False))
    return widget


def _within(view: View) -> View:
    """The view without a choice that the shown run lacks, such as a robot of a larger fleet."""
    known = view.robot < len(view.snapshot.robots) and view.cell < view.floor_plan.kind.size
    return view if known else replace(view, robot=NIL, cell=NIL)


class Widgets(NamedTuple):
    """The panels' widget classes by name, and reports of those that failed to load."""

    by_name: dict[str, type[Any]]
    problems: tuple[str, ...]


@cache
def panel_widgets() -> Widgets:
    """Import the widgets of all panels, in the thread that opens the runs."""
    classes: dict[str, type[Any]] = {}
    problems = []
    for name, panel in panels().by_name.items():
        try:
            kind = load(panel.widget)
            if not issubclass(kind, PanelWidget):
                raise TypeError(f"{panel.widget} is not a tui.widgets.panel.PanelWidget")
            classes[name] = kind
        except Exception as error:  # an import may raise anything
            problems.append(left_out("panel", name, error))
    return Widgets(classes, tuple(problems))


class TabStrip(Rows):
    """The names of the panels with their keys, in one line or two; the open one is highlighted."""

    DEFAULT_CSS = """
    TabStrip {
        height: 1; overflow-y: hidden; scrollbar-gutter: auto; background: $panel;
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left", "neighbour(-1)", "Previous panel", show=False),
        Binding("right", "neighbour(1)", "Next panel", show=False),
    ]

    class Opened(Message):
        """The user chose a tab."""

        def __init__(self, name: str) -> None:
            self.name = name
            super().__init__()

    def __init__(self, signs: Signs, names: Sequence[str]) -> None:
        super().__init__(signs)
        kinds = [panels().by_name[name] for name in names]
        self._panels = [
            Tab(one.name, one.tab, key_text(one.key.partition(",")[0])) for one in kinds
        ]
        self.open = names[0] if names else ""
        self.has_metrics = False  # among the tabs
        self.shows_metrics = False  # then they are open

    def on_mount(self) -> None:
        self.set_content()

    def on_resize(self) -> None:
        super().on_resize()
        self.set_content()

    @property
    def _tabs(self) -> list[Tab]:
        return [FIRST_TAB, *self._panels] if self.has_metrics else self._panels

    @property
    def _name_open(self) -> str:
        return METRICS_NAME if self.has_metrics and self.shows_metrics else self.open

    def set_content(self) -> None:
        """Arrange the tabs, and mark the open one."""
        lines = self._arranged()
        opened = [self._name_open in [tab.name for tab in part] for part in lines]
        self.cursor = opened.index(True) if True in opened else 0
        self.styles.height = len(lines)
        self.update_rows(len(lines))

    def _arranged(self) -> list[list[Tab]]:
        """The tabs of each line at the present width, which may change without an event."""
        tabs = self._tabs
        half = (len(tabs) + 1) // 2
        lines = [tabs] if self._fit(tabs) else [tabs[:half], tabs[half:]]
        if all(self._fit(part) for part in lines):
            return lines
        return [[tab._replace(key="") for tab in tabs]]  # without keys, they need one line

    def render_line(self, y: int) -> Strip:
        height = self.styles.height
        if height is None or len(self._arranged()) != height.value:
            self.call_after_refresh(self.set_content)
        return super().render_line(y)

    def _fit(self, tabs: Sequence[Tab]) -> bool:
        return sum(tab.columns for tab in tabs) + len(tabs) - 1 < self.width

    def row(self, index: int) -> Line:
        lines = self._arranged()
        if index >= len(lines):  # until the height follows
            return ()
        tabs = lines[index]
        free = self.width - 1 - sum(tab.columns for tab in tabs)  # a column stays free at the edge
        gap = max(1, min(MAX_TAB_GAP, free // max(1, len(tabs) - 1)))
        spans: list[Span] = []
        before = sum(map(len, lines[:index]))
        for at, tab in enumerate(tabs, before):
            look, link = "cursor" if tab.name == self._name_open else "plain", ("tab", at)
            spans += [Span(" " * gap, "dim")] if spans else []
            spans.append(Span(tab.label, look, link))
            if tab.key:
                spans += [Span(" "), Span(tab.key, "link", link)]
        return tuple(spans)

    def marked(self, made: Line) -> Line:
        """Highlight the open tab; underline it, too, while the strip has the focus."""
        return tuple(
            span._replace(look="focus" if span.look == "cursor" else span.look) for span in made
        )

    def follow(self, link: Link, column: int = 0) -> None:
        self.post_message(self.Opened(self._tabs[link[1]].name))

    def action_move(self, step: int) -> None:
        """Leave the cursor in the line of the open tab."""

    def action_neighbour(self, step: int) -> None:
        """Open the next panel."""
        names = [tab.name for tab in self._tabs]
        if names:
            at = names.index(self._name_open) + step
            self.post_message(self.Opened(names[at % len(names)]))


class Tab(NamedTuple):
    """A panel in the strip of tabs."""

    name: str
    label: str
    key: str

    @property
    def columns(self) -> int:
        """The columns of its label and its key."""
        return len(self.label) + bool(self.key) + len(self.key)


FIRST_KEY: Final = next(action.keys for action in VIEWER_ACTIONS if action.id == "panels")
FIRST_TAB: Final = Tab(METRICS_NAME, METRICS_NAME, key_text(FIRST_KEY))
