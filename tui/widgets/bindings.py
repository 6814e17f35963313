"""Every action of the viewer: its id, keys and name; help, footer, palette and tests read this table.

An id is stable: `App.set_keymap` gives its action other keys, `action_<id>` is its method.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from textual.binding import Binding


class Action(NamedTuple):
    """One thing that a user can do."""

    id: str
    keys: str  # as Textual names them, separated by commas
    label: str  # in the footer, the palette and the help
    meaning: str = ""  # a little more, for the help
    shown: bool = False  # in the footer


class Topic(NamedTuple):
    """Actions that belong together."""

    name: str
    actions: tuple[Action, ...]


TOPICS: Final = (
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
            Action("why", "w", "Why", "why the robot waits", True),
            Action("breakpoints", "b", "Stops", "conditions that stop the run on its way on", True),
            Action("branch", "B", "Branch", "go on with other settings from here"),
            Action("inspect", "i", "Inspect", "the robot, or the cell under the mouse"),
            Action("events", "e", "Events", "events: what happened", True),
            Action("robots", "t", "Robots", "all robots in a table"),
            Action("legend", "K", "Legend", "legend: what the signs mean"),
        ),
    ),
    Topic(
        "Layers",
        (
            Action("layer_none", "f2", "No layer"),
            Action("layer_visits", "f3", "Visits", "visits: how often cells are entered"),
            Action("layer_waiting", "f4", "Waiting", "waiting: where time is lost"),
            Action(
                "layer_congestion", "f5", "Congestion", "congestion: where time was lost of late"
            ),
            Action("layer_flow", "f6", "Flow", "flow: moves out of each cell"),
            Action("layer_zones", "f7", "Zones", "zones of robots; again: of the floor"),
            Action("layer_route", "f8", "Route", "the selected robot's route, on or off"),
            Action("layer_explored", "f9,E", "Explored", "what A* looks at for the selected robot"),
            Action(
                "layer_predicted",
                "f10,P",
                "Predicted",
                "where 2 or more others will drive; again: 3, 4, 5, 1",
            ),
            Action("next_layer", "L", "Layer", "the next layer", True),
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


def bindings() -> list[Binding]:
    """The table for Textual."""
    return [
        Binding(
            action.keys,
            action.id,
            action.label,
            show=action.shown,
            tooltip=action.meaning,
            id=action.id,
        )
        for action in ACTIONS
    ]


def key_text(key: str) -> str:
    """A key as a person would write it."""
    modifiers, _, name = key.rpartition("+")
    return (f"{modifiers}+" if modifiers else "") + KEY_NAMES.get(name, name)
