"""Events in a few words, and which of them are asked for."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

import numpy as np

from automaton.engine import observation as codes
from automaton.engine.observation import EVENT_NAMES
from automaton.engine.robot_status import BATTERY_PERCENT
from automaton.engine.state import NIL, Array
from automaton.evidence.history.event_history import Event
from tui.widgets.styled_lines import Line, Span, line

EVENT_GROUPS: Final = {  # what can be picked in the list of events: name and codes
    "deliveries": (codes.EVENT_DELIVERED,),
    "deadlocks": (codes.EVENT_WAIT_CYCLE, codes.EVENT_DEADLOCK),
    "retreats": (codes.EVENT_RETREATED,),
    "picks": (codes.EVENT_PICKED, codes.EVENT_DROPPED, codes.EVENT_VISITED),
    "orders": (codes.EVENT_ORDER_TAKEN, codes.EVENT_ORDER_RETURNED),
    "parking bays": (codes.EVENT_LEFT_BAY, codes.EVENT_PARKED),
    "charging": (codes.EVENT_CHARGING,),
    "faults": (codes.EVENT_DEPLETED, codes.EVENT_FAILED, codes.EVENT_TOWED, codes.EVENT_BACK),
    "illegal": (codes.EVENT_ILLEGAL_DECISION,),
    "parts": (codes.EVENT_JOB_DONE, codes.EVENT_PART_FINISHED),
    "zones": (codes.EVENT_ZONES_REDESIGNED,),
}
TEXTS: Final = {
    codes.EVENT_ORDER_TAKEN: "takes order {subject}",
    codes.EVENT_PICKED: "picks up load {subject}",
    codes.EVENT_DROPPED: "drops load {subject}",
    codes.EVENT_DELIVERED: "delivers load {subject}",
    codes.EVENT_LEFT_BAY: "leaves its parking bay",
    codes.EVENT_PARKED: "is parked",
    codes.EVENT_RETREATED: "retreats {value} step{s}",
    codes.EVENT_ORDER_RETURNED: "returns order {subject}",
    codes.EVENT_CHARGING: "charges from {percent}",
    codes.EVENT_DEPLETED: "battery is empty",
    codes.EVENT_FAILED: "breaks down",
    codes.EVENT_TOWED: "is towed",
    codes.EVENT_BACK: "is back",
    codes.EVENT_ILLEGAL_DECISION: "illegal decision",
    codes.EVENT_WAIT_CYCLE: "wait cycle of {value} closes",
    codes.EVENT_DEADLOCK: "deadlock of {value} robots",
    codes.EVENT_JOB_DONE: "station {station} is done with part {subject}",
    codes.EVENT_PART_FINISHED: "part {subject} is finished",
    codes.EVENT_ZONES_REDESIGNED: "zones redesigned: {value} station{s}",
    codes.EVENT_VISITED: "does a stop of order {subject}",
}
TRIP_TEXTS: Final = TEXTS | {  # where orders are trips of pods
    codes.EVENT_ORDER_TAKEN: "takes trip {subject}",
    codes.EVENT_PICKED: "lifts the pod of trip {subject}",
    codes.EVENT_DELIVERED: "stores the pod of trip {subject}",
    codes.EVENT_ORDER_RETURNED: "returns trip {subject}",
    codes.EVENT_VISITED: "was served for trip {subject}",
}
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
SUBJECTS: Final = (
    codes.EVENT_ORDER_TAKEN,
    codes.EVENT_PICKED,
    codes.EVENT_DROPPED,
    codes.EVENT_DELIVERED,
    codes.EVENT_ORDER_RETURNED,
    codes.EVENT_VISITED,
)


def event_words(event: Event, trips: bool = False) -> str:
    """An event in a few words, without the robot."""
    plural = "" if event.value == 1 else "s"
    percent = f"{event.value / BATTERY_PERCENT:.0f} %"
    words = {"subject": event.subject, "value": event.value, "s": plural, "percent": percent}
    words["station"] = event.value + 1
    return (TRIP_TEXTS if trips else TEXTS)[event.code].format(**words)


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
