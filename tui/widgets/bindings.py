"""Every action of the viewer: its id, keys and name; help, footer, palette and tests read this table.

An id is stable: `App.set_keymap` gives its action other keys; a group of tui.actions carries it out.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from textual.binding import Binding

from tui.registration import layers, panels
from tui.render.layer import Layer
from tui.widgets.panel import Panel


class Action(NamedTuple):
    """One thing that a user can do."""

    id: str
    keys: str  # as Textual names them, separated by commas
    label: str  # in the footer, the palette and the help
    meaning: str = ""  # a little more, for the help
    shown: bool = False  # in the footer
    place: int = 0  # in its topic, among those that layers and panels bring


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
            Action("go_end", "end", "End", "to the last tick that is known"),
            Action("go_to", "g", "Go to", "to a tick"),
            Action("next_event", "n", "Next", "to the next event, or of what was found"),
            Action("previous_event", "N", "Previous", "to the one before"),
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
            Action("follow", "f", "Follow", "keep the selected robot on the screen", True),
            Action("maximise", "m", "Map alone", "nothing but the map, or all again"),
            Action("minimap", "M", "Minimap", "minimap, while the floor exceeds the map"),
        ),
    ),
    Topic(
        "Looking closer",
        (
            Action("find", "slash", "Find", "find a robot, an order, a cell, a zone", True),
            Action("next_robot", "right_parenthesis", "Next robot"),
            Action("previous_robot", "left_parenthesis", "Previous robot"),
            Action("clear", "escape", "Clear", "nothing selected, found or followed"),
            Action(
                "breakpoints", "b", "Stops", "conditions that stop the run on its way on", True, 20
            ),
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
            Action("panels", "p", "Panels", "panels off, beside the map, in its place", True),
            Action("compare_side", "o", "Other run", "panels tell of the other run"),
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
            Action("link_figures", "D", "Link", "what the connection carries"),
            Action("quit", "q", "Quit", "", True),
        ),
    ),
)


def _brought(one: Layer | Panel, action: str, place: int, taken: set[str]) -> Action:
    """The action of a layer or a panel; a key that is taken stays where it is."""
    keys = [key for key in one.key.split(",") if key and key not in taken]
    label, shown = one.label or one.name, isinstance(one, Panel) and one.shown
    return Action(one.action or action, ",".join(keys), label, one.meaning, shown, place)


def _topics() -> tuple[Topic, ...]:
    """All topics, with the actions that registered layers and panels bring."""
    taken = {key for topic in _FIXED for action in topic.actions for key in action.keys.split(",")}
    brought = {
        "Looking closer": [
            _brought(panel, name, panel.listed, taken) for name, panel in panels().by_name.items()
        ],
        "Layers": [
            _brought(layer, f"layer_{name}", layer.position, taken)
            for name, layer in layers().by_name.items()
        ],
    }
    topics = []
    for topic in _FIXED:
        rows = sorted((*topic.actions, *brought.get(topic.name, ())), key=lambda one: one.place)
        topics.append(Topic(topic.name, tuple({row.id: row for row in rows}.values())))
    return tuple(topics)


TOPICS: Final = _topics()
ACTIONS: Final = tuple(action for topic in TOPICS for action in topic.actions)
COMPARING: Final = frozenset({"compare_side", "next_difference"})  # with two runs only

# How keys are written; others as Textual does.
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
}


def do(id: str) -> str:
    """What Textual is told to do for an action of the table."""
    return f"do({id!r})"


def bindings() -> list[Binding]:
    """The table for Textual."""
    return [
        Binding(
            action.keys,
            do(action.id),
            action.label,
            show=action.shown,
            tooltip=action.meaning,
            id=action.id,
        )
        for action in ACTIONS
        if action.keys
    ]


def key_text(key: str) -> str:
    """A key as a person would write it."""
    modifiers, _, name = key.rpartition("+")
    return (f"{modifiers}+" if modifiers else "") + KEY_NAMES.get(name, name)
