"""Events in a few words, and which of them are asked for."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

import numpy as np

from automaton.history.chronicle import Event
from automaton.world import waiting as codes
from automaton.world.condition import PERCENT
from automaton.world.state import NIL, Array
from automaton.world.waiting import EVENT_NAMES
from tui.widgets.lines import Line, Span, line

KINDS: Final = {  # what can be picked in the list of events: name and codes
    "deliveries": (codes.DELIVERED_AT,),
    "deadlocks": (codes.CYCLE, codes.DEADLOCK),
    "withdrawals": (codes.WITHDREW,),
    "picks": (codes.PICKED_UP, codes.SET_DOWN),
    "orders": (codes.TOOK, codes.GAVE_BACK),
    "bays": (codes.OUT_OF_BAY, codes.PARKED),
    "charging": (codes.CHARGED,),
    "faults": (codes.RAN_EMPTY, codes.BROKE_DOWN, codes.WAS_TOWED, codes.CAME_BACK),
    "illegal": (codes.REFUSED_ANSWER,),
    "parts": (codes.WORK_DONE, codes.PART_FINISHED),
    "zones": (codes.REDESIGNED,),
}
TEXTS: Final = {
    codes.TOOK: "takes order {subject}",
    codes.PICKED_UP: "picks up load {subject}",
    codes.SET_DOWN: "sets load {subject} down",
    codes.DELIVERED_AT: "delivers load {subject}",
    codes.OUT_OF_BAY: "leaves its bay",
    codes.PARKED: "is parked",
    codes.WITHDREW: "withdraws {value} step{s}",
    codes.GAVE_BACK: "gives order {subject} back",
    codes.CHARGED: "charges from {percent}",
    codes.RAN_EMPTY: "battery is empty",
    codes.BROKE_DOWN: "breaks down",
    codes.WAS_TOWED: "is towed",
    codes.CAME_BACK: "is back",
    codes.REFUSED_ANSWER: "illegal answer",
    codes.CYCLE: "circle of {value} closes",
    codes.DEADLOCK: "deadlock of {value} robots",
    codes.WORK_DONE: "station {station} is done with part {subject}",
    codes.PART_FINISHED: "part {subject} is finished",
    codes.REDESIGNED: "zones redesigned: {value} station{s}",
}
ROBOT: Final = 6  # columns for the number of a robot
LOOKS: Final = {
    codes.DELIVERED_AT: "good",
    codes.DEADLOCK: "fault",
    codes.RAN_EMPTY: "fault",
    codes.BROKE_DOWN: "fault",
    codes.REFUSED_ANSWER: "fault",
    codes.CYCLE: "warn",
    codes.WITHDREW: "warn",
    codes.PART_FINISHED: "good",
    codes.REDESIGNED: "warn",
}
SUBJECTS: Final = (codes.TOOK, codes.PICKED_UP, codes.SET_DOWN, codes.DELIVERED_AT, codes.GAVE_BACK)


def event_words(event: Event) -> str:
    """An event in a few words, without the robot."""
    plural = "" if event.value == 1 else "s"
    percent = f"{event.value / PERCENT:.0f} %"
    words = {"subject": event.subject, "value": event.value, "s": plural, "percent": percent}
    words["station"] = event.value + 1
    return TEXTS[event.code].format(**words)


def event_line(event: Event, who: bool = True, tick_width: int = 7) -> Line:
    """Tick, robot and what happened; the tick leads there."""
    tick = Span(f"{event.tick:,}", "link", ("tick", event.tick))
    gap = " " * (tick_width - len(tick.text))
    number = "" if event.robot == NIL else event.robot
    robot = f"{number:>{ROBOT}}" if who else ""
    look = LOOKS.get(event.code, "plain")
    return line(gap, tick, robot, Span(f" {event_words(event)}", look))


class Wanted(NamedTuple):
    """Which events are asked for."""

    kinds: frozenset[str] = frozenset(KINDS)
    robot: int = NIL  # NIL: any
    words: str = ""  # as typed: robot 3, load 7, and parts of what an event is called

    def mask(self, events: Array) -> Array:
        """(N,) bool: whether each of (N, 5) events is asked for."""
        holds: Array = np.isin(events[:, 1], [c for kind in self.kinds for c in KINDS[kind]])
        if self.robot != NIL:
            holds &= events[:, 2] == self.robot
        rest = self.words.lower()
        for name, number in re.findall(r"(robot|load|order|part)\s*(\d+)", rest):
            column = 2 if name == "robot" else 3
            holds &= events[:, column] == int(number)
            if column == 3:
                holds &= np.isin(events[:, 1], KINDS["parts"] if name == "part" else SUBJECTS)
        for word in re.sub(r"(robot|load|order|part)\s*\d+", " ", rest).split():
            holds &= self._called(word, events)
        return holds

    def _called(self, word: str, events: Array) -> Array:
        """Events of a robot with this number, or with the word in one of their names."""
        if word.isdigit():
            numbered: Array = events[:, 2] == int(word)
            return numbered
        kinds = {code: name for name, several in KINDS.items() for code in several}
        hits = [
            code
            for code, text in TEXTS.items()
            if word in f"{text} {EVENT_NAMES[code]} {kinds[code]}"
        ]
        called: Array = np.isin(events[:, 1], hits)
        return called
