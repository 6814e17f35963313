"""All actions of the viewer: ids, keys, names. Help, footer, palette and tests read this table.

Ids are stable: `App.set_keymap` assigns other keys to an action by its id. Groups of actions
implement them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final, NamedTuple

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Footer, Static

from tui.registration import layers, panels
from tui.widgets.panel import Panel

COMPARING: Final = frozenset({"compare_side", "next_difference"})  # with two runs only

# Displayed names of keys; others are as in Textual.
KEY_NAMES: Final = {
    "full_stop": ".",
    "comma": ",",
    "right_square_bracket": "]",
    "left_square_bracket": "[",
    "right_curly_bracket": "}",
    "left_curly_bracket": "{",
    "greater_than_sign": ">",
    "less_than_sign": "<",
    "right_parenthesis": ")",
    "left_parenthesis": "(",
    "slash": "/",
    "plus": "+",
    "equals_sign": "=",
    "minus": "-",
    "question_mark": "?",
    "escape": "esc",
    "pagedown": "pgdn",
    "pageup": "pgup",
}

MOUSE = (
    ("click", "select a robot or a cell"),
    ("double click", "follow the robot"),
    ("drag", "move the map, or the timeline's tick"),
    ("wheel", "zoom the map, or the timeline"),
    ("shift+wheel", "pan the map, or go by single ticks"),
)


def do(id: str) -> str:
    """The action string for Textual."""
    return f"do({id!r})"


class Action(NamedTuple):
    """An action of the user."""

    id: str
    keys: str  # as Textual names them, separated by commas
    label: str  # in the footer, the palette and the help
    meaning: str = ""  # explanation in the help
    shown: bool = False  # in the footer
    place: int = 0  # position in its topic, among those of layers and panels


class Topic(NamedTuple):
    """Actions that belong together."""

    name: str
    actions: tuple[Action, ...]


_FIXED: Final = (
    Topic(
        "Time",
        (
            Action("play_pause", "space", "Play", "play or pause", True),
            Action("step_forward", "full_stop", "Tick on", "one tick on"),
            Action("step_back", "comma", "Tick back", "one tick back"),
            Action("forward_10", "right_square_bracket", "10 ticks on"),
            Action("back_10", "left_square_bracket", "10 ticks back"),
            Action("forward_100", "right_curly_bracket", "100 ticks on"),
            Action("back_100", "left_curly_bracket", "100 ticks back"),
            Action("faster", "greater_than_sign", "Faster", "twice as fast"),
            Action("slower", "less_than_sign", "Slower", "half as fast"),
            Action("normal_speed", "1", "Speed x1", "speed x1: 10 ticks a second"),
            Action("full_speed", "9", "Full speed", "full speed"),
            Action("reverse", "r", "Backwards", "play backwards"),
            Action("go_start", "home", "Start", "to the start"),
            Action("go_end", "end", "End", "to the last known tick"),
            Action("go_to", "g", "Go to", "to a tick"),
            Action("next_event", "n", "Next", "to the next event or match"),
            Action("previous_event", "N", "Previous", "to the previous event or match"),
            Action("timeline_in", "Z", "Timeline nearer", "a shorter part in the timeline"),
            Action("timeline_out", "X", "Timeline farther", "a longer part in the timeline"),
            Action("timeline_whole", "A", "Timeline whole", "the whole run in the timeline"),
        ),
    ),
    Topic(
        "Map",
        (
            Action("pan_left", "left,h", "Pan left"),
            Action("pan_right", "right,l", "Pan right"),
            Action("pan_up", "up,k", "Pan up"),
            Action("pan_down", "down,j", "Pan down"),
            Action("page_left", "shift+left", "Page left", "half a screen left"),
            Action("page_right", "shift+right", "Page right", "half a screen right"),
            Action("page_up", "shift+up", "Page up", "half a screen up"),
            Action("page_down", "shift+down", "Page down", "half a screen down"),
            Action("zoom_in", "plus,equals_sign", "Zoom in"),
            Action("zoom_out", "minus", "Zoom out"),
            Action("zoom_fit", "0", "Whole floor", "the whole floor, as large as it fits"),
            Action("zoom_cell", "z", "1:1", "one character for a cell"),
            Action("follow", "f", "Follow", "keep the selected robot on the screen"),
            Action("maximise", "m", "Map alone", "only the map, or everything again"),
            Action("minimap", "M", "Minimap", "minimap, if the floor exceeds the map"),
            Action("next_colouring", "c", "Colours", "robots by state, order, type, zone, ..."),
            Action("trails", "v", "Trails", "trails of cells that robots came through"),
            Action("goal_lines", "G", "Goals", "lines to goals: of the selected robot, all, none"),
        ),
    ),
    Topic(
        "Looking closer",
        (
            Action("find", "slash", "Find", "find a robot, an order, a cell, a zone", True),
            Action("next_robot", "right_parenthesis", "Next robot"),
            Action("previous_robot", "left_parenthesis", "Previous robot"),
            Action(
                "jam", "J", "Jam", "the largest jam: robots without progress, n goes through them"
            ),
            Action("deadlock", "d", "Deadlock", "to the latest deadlock"),
            Action(
                "bottleneck",
                "y",
                "Lost time",
                "a saturated station, and where most time was lost, in turn",
                True,
            ),
            Action(
                "clear",
                "escape",
                "Clear",
                "clear selection, matches, following; stop going to a tick",
            ),
            Action("breakpoints", "b", "Stops", "conditions that stop the run", place=20),
            Action("branch", "B", "Branch", "go on with other settings from here", place=20),
        ),
    ),
    Topic(
        "Layers",
        (
            Action("layer_none", "f2", "No layer"),
            Action("layer_route", "f8", "Route", "the selected robot's route, on or off", place=65),
            Action("next_layer", "L", "Layer", "the next layer", True, 10_000),
        ),
    ),
    Topic(
        "Panels",
        (
            Action(
                "panels", "p", "Metrics", "metrics and panels off, beside or instead of map", True
            ),
            Action("scroll_down", "pagedown", "Scroll", "scroll the open panel a page down", True),
            Action("scroll_up", "pageup", "Scroll back", "scroll the open panel a page up"),
            Action("compare_side", "o", "Other run", "panels show the other run"),
            Action(
                "next_difference", "x", "Difference", "to the first tick at which two runs differ"
            ),
        ),
    ),
    Topic(
        "Capture",
        (
            Action("screenshot", "s", "Picture", "save the screen as SVG"),
            Action("copy_text", "S", "Text", "save and copy the map as text"),
        ),
    ),
    Topic(
        "Viewer",
        (
            Action("help", "question_mark,f1", "Help", "this page", True),
            Action("theme", "T", "Dark or light"),
            Action("link_figures", "D", "Link", "measurements of the connection"),
            Action("quit", "q", "Quit", "", True),
        ),
    ),
)


def _brought() -> tuple[dict[str, Action], dict[str, Action]]:
    """The actions of panels and layers by id; a key that is taken keeps its action.

    Ours come first. If several layers share an action, the first determines its keys and name.
    """
    taken = {key for topic in _FIXED for action in topic.actions for key in action.keys.split(",")}
    of_panels: dict[str, Action] = {}
    of_layers: dict[str, Action] = {}
    brought: list[tuple[bool, Any, dict[str, Action]]] = [
        (name not in registered.own, one, actions)
        for registered, actions in ((panels(), of_panels), (layers(), of_layers))
        for name, one in registered.by_name.items()
    ]
    for _, one, actions in sorted(brought, key=lambda row: row[0]):
        if one.action not in actions:
            keys = [key for key in map(str.strip, one.key.split(",")) if key and key not in taken]
            taken.update(keys)
            place = one.listed if isinstance(one, Panel) else one.position
            shown = isinstance(one, Panel) and one.shown
            label = one.label or one.name
            row = Action(one.action, ",".join(keys), label, one.meaning, shown, place)
            actions[one.action] = row
    return of_panels, of_layers


def _topics() -> tuple[Topic, ...]:
    """All topics, with the actions of registered layers and panels."""
    of_panels, of_layers = _brought()
    brought = {"Looking closer": of_panels, "Layers": of_layers}
    topics = []
    for topic in _FIXED:
        rows = (*topic.actions, *brought.get(topic.name, {}).values())
        topics.append(Topic(topic.name, tuple(sorted(rows, key=lambda one: one.place))))
    return tuple(topics)


TOPICS: Final = _topics()
VIEWER_ACTIONS: Final = tuple(action for topic in TOPICS for action in topic.actions)


def bindings() -> list[Binding]:
    """The bindings for Textual."""
    return [
        Binding(
            action.keys,
            do(action.id),
            action.label,
            show=action.shown,
            tooltip=action.meaning,
            id=action.id,
        )
        for action in VIEWER_ACTIONS
        if action.keys
    ]


def key_text(key: str) -> str:
    """The displayed name of a key."""
    modifiers, _, name = key.rpartition("+")
    return (f"{modifiers}+" if modifiers else "") + KEY_NAMES.get(name, name)


# The help.


class HelpScreen(ModalScreen[None]):
    """All actions by topic with their present keys. Escape, q, ? or F1 closes it."""

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
        self._keys = keys  # by action id

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
