"""All keys by topic, made from the table of actions and the keys that are bound to them now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Footer, Static

from tui.widgets.bindings import TOPICS, Action, Topic, key_text

MOUSE = (
    ("click", "select a robot or a cell"),
    ("double click", "follow the robot"),
    ("drag", "move the map, or the timeline's tick"),
    ("wheel", "zoom the map, or the timeline"),
    ("shift+wheel", "pan the map, or go by single ticks"),
)


class HelpScreen(ModalScreen[None]):
    """Closed by escape, q, ? or F1."""

    DEFAULT_CSS = """
    HelpScreen { align: center middle; }
    HelpScreen > VerticalScroll {
        width: 100%; max-width: 118; height: 100%; padding: 0 1; background: $surface;
        border: round $border;
    }
    HelpScreen Static { height: auto; }
    """
    BINDINGS: ClassVar = [Binding("escape,q,question_mark,f1", "dismiss", "Close")]

    def __init__(self, keys: Mapping[str, Sequence[str]]) -> None:
        super().__init__()
        self._keys = keys  # by id of the action

    def compose(self) -> ComposeResult:
        with VerticalScroll():
            yield Static(id="keys")
        yield Footer(show_command_palette=False)

    def on_resize(self) -> None:
        self.query_one("#keys", Static).update(self._page(self.size.width))

    def _page(self, width: int) -> Table:
        columns = 2 if width >= 76 else 1
        page = Table.grid(expand=True, padding=(0, 2))
        parts = [self._table(topic) for topic in TOPICS] + [_mouse()]
        heights = [part.row_count for part in parts]
        left: list[Table] = []
        right: list[Table] = []
        for part, height in zip(parts, heights, strict=True):
            tall = sum(p.row_count for p in left) + height > (sum(heights) + 1) // columns
            (right if tall and columns == 2 else left).append(part)
        for _ in range(columns):
            page.add_column(ratio=1)
        page.add_row(*(_stacked(part) for part in (left, right)[:columns]))
        return page

    def _table(self, topic: Topic) -> Table:
        table = _topic(topic.name)
        for action in topic.actions:
            table.add_row(self._keys_of(action), _meaning(action))
        return table

    def _keys_of(self, action: Action) -> Text:
        keys = self._keys.get(action.id, action.keys.split(","))
        return Text(" ".join(key_text(key) for key in keys), style="bold")


def _meaning(action: Action) -> str:
    text = action.meaning or action.label
    return text[0].upper() + text[1:]


def _topic(name: str) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 1), title=name)
    table.title_justify, table.title_style = "left", "bold underline"
    table.add_column(width=len("double click"), no_wrap=True)
    table.add_column(overflow="fold")
    return table


def _mouse() -> Table:
    table = _topic("Mouse")
    for what, does in (*MOUSE, ("ctrl+p", "every action by name"), ("tab", "to the next panel")):
        table.add_row(Text(what, style="bold"), does)
    return table


def _stacked(parts: Sequence[Table]) -> Table:
    stack = Table.grid(padding=(0, 0, 1, 0), collapse_padding=False)
    stack.add_column()
    for part in parts:
        stack.add_row(part)
    return stack
