"""Events as rows of a list, and which of them are asked for."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

import numpy as np

from automaton.engine import observation as codes
from automaton.engine.observation import EVENT_NAMES
from automaton.engine.state import NIL, Array
from automaton.history.event_history import (
    EVENT_GROUPS,
    SUBJECTS,
    TEXTS,
    TRIP_TEXTS,
    Event,
    event_words,
)
from tui.widgets.styled_lines import Line, Span, line

ROBOT_COLUMN_WIDTH: Final = 6  # columns for the number of a robot
EVENT_LOOKS: Final = {
    codes.EVENT_DELIVERED: "good",
    codes.EVENT_DEADLOCK: "fault",
    codes.EVENT_DEPLETED: "fault",
    codes.EVENT_FAILED: "fault",
    codes.EVENT_ILLEGAL_DECISION: "fault",
    codes.EVENT_WAIT_CYCLE: "warn",
    codes.EVENT_RETREATED: "warn",
    codes.EVENT_PART_FINISHED: "good",
    codes.EVENT_ZONES_REDESIGNED: "warn",
}


def event_line(event: Event, who: bool = True, tick_width: int = 7, trips: bool = False) -> Line:
    """Tick, robot and what happened, to orders or to trips of pods; the tick leads there."""
    tick = Span(f"{event.tick:,}", "link", ("tick", event.tick))
    gap = " " * (tick_width - len(tick.text))
    number = "" if event.robot == NIL else event.robot
    robot = f"{number:>{ROBOT_COLUMN_WIDTH}}" if who else ""
    look = EVENT_LOOKS.get(event.code, "plain")
    return line(gap, tick, robot, Span(f" {event_words(event, trips)}", look))


class Wanted(NamedTuple):
    """Which events are asked for."""

    kinds: frozenset[str] = frozenset(EVENT_GROUPS)
    robot: int = NIL  # NIL: any
    words: str = ""  # as typed: robot 3, load 7, and parts of what an event is called

    def mask(self, events: Array) -> Array:
        """(N,) bool: whether each of (N, 5) events is asked for."""
        holds: Array = np.isin(events[:, 1], [c for kind in self.kinds for c in EVENT_GROUPS[kind]])
        if self.robot != NIL:
            holds &= events[:, 2] == self.robot
        rest = self.words.lower()
        for name, number in re.findall(r"(robot|load|order|trip|part)\s*(\d+)", rest):
            column = 2 if name == "robot" else 3
            holds &= events[:, column] == int(number)
            if column == 3:
                holds &= np.isin(
                    events[:, 1], EVENT_GROUPS["parts"] if name == "part" else SUBJECTS
                )
        for word in re.sub(r"(robot|load|order|trip|part)\s*\d+", " ", rest).split():
            holds &= self._called(word, events)
        return holds

    def _called(self, word: str, events: Array) -> Array:
        """Events of a robot with this number, or with the word in one of their names."""
        if word.isdigit():
            numbered: Array = events[:, 2] == int(word)
            return numbered
        kinds = {code: name for name, several in EVENT_GROUPS.items() for code in several}
        hits = [
            code
            for code, text in TEXTS.items()
            if word in f"{text} {TRIP_TEXTS[code]} {EVENT_NAMES[code]} {kinds[code]}"
        ]
        called: Array = np.isin(events[:, 1], hits)
        return called
