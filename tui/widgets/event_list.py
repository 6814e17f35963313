"""The panel of events: the log of the run, filtered by kinds, by robot and by words.

Only visible rows are written.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import ClassVar, Final, NamedTuple

import numpy as np
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.message import Message
from textual.widgets import Input

from automaton.engine.observation import EVENT_NAMES
from automaton.engine.state import NIL, Array
from automaton.history.event_history import (
    EVENT_FIELDS,
    EVENT_GROUPS,
    SUBJECTS,
    TEXTS,
    TRIP_TEXTS,
    EventHistory,
    Log,
    event_of,
)
from automaton.units import count
from tui.playback.panel_view import RobotChosen, TickChosen, View
from tui.widgets.panel import (
    UNICODE_SIGNS,
    Line,
    Link,
    PanelWidget,
    Rows,
    Signs,
    Span,
    TypedInput,
    dim,
    line,
    title,
    wrapped,
)
from tui.widgets.pod_facts import makes_trips
from tui.widgets.robot_facts import event_line
from tui.widgets.zone_facts import partition_of, parts_finished

ROOM_FOR_WORDS: Final = len("picks up the pod of trip 1,234")
NO_EVENTS: Final = np.zeros(0, np.int64)


class Events(Vertical, PanelWidget):
    """The filter's words and boxes, and the list below; tab moves from the list to the filter."""

    DEFAULT_CSS = """
    Events {
        height: 1fr;
        & > Vertical { dock: top; height: auto; }
        & Filter.-textual-compact { padding: 0 1; }
        & Filter:focus { background: $panel; text-style: underline; }
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("F", "filter", "Filter", show=False)]

    def __init__(self, signs: Signs = UNICODE_SIGNS, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.boxes = KindBoxes(signs)
        self.list = EventList(signs, self.boxes)

    def compose(self) -> ComposeResult:
        yield self.list
        with Vertical():
            yield Filter()
            yield self.boxes

    def action_filter(self) -> None:
        """Focus the words that events must match."""
        self.query_one(Filter).focus()

    def on_kind_boxes_ticked(self, event: KindBoxes.Ticked) -> None:
        event.stop()
        self.list.tick(event.box)

    def show(self, view: View) -> None:
        """List the events of the view's run."""
        self.list.show(view)

    def listed_events(self, view: View) -> Array:
        """The events that match the filter, visible or not."""
        return self.list.matching(view)

    @property
    def focused_part(self) -> EventList:
        return self.list

    def on_input_changed(self, event: Input.Changed) -> None:
        event.stop()
        self.list.ask_for(self.list.kinds, event.value)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self.list.focus()


class EventList(Rows):
    """The events that match the filter; those after the present tick are dim.

    The cursor starts at the present and follows it until the user moves it.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("c", "kind(1)", "Next kind of event", show=False),
        Binding("C", "kind(-1)", "Previous kind of event", show=False),
        Binding("v", "only_selected", "The selected robot only", show=False),
    ]

    def __init__(self, signs: Signs, boxes: KindBoxes) -> None:
        super().__init__(signs)
        self.boxes = boxes
        self.view: View | None = None
        self.kept = Log(np.zeros((0, EVENT_FIELDS), np.int32), 0)
        self.kinds = frozenset(EVENT_GROUPS)
        self.words = ""
        self.only_selected = False
        self._matches = Matches()
        self._found: Array = NO_EVENTS
        self._present = 0  # number of matches up to the present tick
        self._followed = True  # the present was visible at the last update

    def wanted(self, view: View) -> EventFilter:
        """The present filter."""
        return EventFilter(self.kinds, view.robot if self.only_selected else NIL, self.words)

    def matching(self, view: View) -> Array:
        """(M,) int64: indices of the events that match the filter."""
        return self._matches.of(
            view.run.event_history, view.run.event_history.log, self.wanted(view)
        )

    def show(self, view: View) -> None:
        """List the events; the present stays visible unless the user scrolled away from it."""
        before = self._present
        self._followed = self.view is None or self.in_sight(max(0, before - 1))
        here = self.view is None or self.cursor == max(0, before - 1)
        event_history = view.run.event_history
        self.view, self.kept = view, event_history.log  # the log may grow meanwhile
        self._found = self._matches.of(event_history, self.kept, self.wanted(view))
        known = self.kept.index_at(view.snapshot.tick)
        self._present = int(np.searchsorted(self._found, known))
        if here:
            self.cursor = max(0, self._present - 1)
        self.boxes.set_content(self._boxes(view))
        self.heading = [self._heading(view)]
        if self.kept.dropped:
            self.heading.append(line(dim(f"{self.kept.dropped:,} older events dropped")))
        self.update_rows(len(self._found))
        if self._followed and self._present != before:
            self.keep_in_sight(max(0, self._present - 1))

    def _boxes(self, view: View) -> list[tuple[str, bool]]:
        """The boxes: kinds of events, and the selected robot only."""
        whose = f"robot {view.robot}" if view.robot != NIL else "the selected robot"
        kinds = [(name, name in self.kinds) for name in kinds_of(view)]
        return [*kinds, (f"only {whose}", self.only_selected)]

    def _heading(self, view: View) -> Line:
        """The names of the columns, and the number of events."""
        found, all_of = len(self._found), len(self.kept.rows)
        told = count(found, "event") + (f" of {all_of:,}" if found != all_of else "")
        name, wide = self._robot_column(view)
        return line(title(f"{'tick':>{self._tick_width() + 1}}{name:>{wide}} "), dim(told))

    def row(self, index: int) -> Line:
        assert self.view is not None
        event = event_of(self.kept.rows[self._found[index]])
        mark = self.signs.here if index == self._present - 1 else " "
        wide = self._robot_column(self.view)[1]
        made = event_line(event, wide, self._tick_width(), makes_trips(self.view))
        gap, tick, *rest = made
        made = (gap, tick._replace(look="dim"), *rest)  # the whole row links there
        if index >= self._present:
            made = tuple(span._replace(look="dim") for span in made)
        return (Span(mark, "title"), *made)

    def _robot_column(self, view: View) -> tuple[str, int]:
        """Name and width of the column of robots, which gives way to the words of events."""
        wide = 1 + max(len("robot"), len(str(len(view.snapshot.robots) - 1)))
        if self.width >= 2 + self._tick_width() + wide + ROOM_FOR_WORDS:
            return "robot", wide
        return "#", 1 + len(str(len(view.snapshot.robots) - 1))

    def _tick_width(self) -> int:
        assert self.view is not None
        events = self.kept.rows
        if not len(events):
            return 5
        return max(5, len(f"{events[-1, 0]:,}") + 1)

    def chosen(self, index: int) -> None:
        """Go to the tick of the event, and to its robot."""
        assert self.view is not None
        event = event_of(self.kept.rows[self._found[index]])
        self.post_message(TickChosen(event.tick))
        if event.robot != NIL:
            self.post_message(RobotChosen(event.robot))

    def follow(self, link: Link, column: int = 0) -> None:
        self.chosen(self.cursor)  # a click anywhere in a row goes to its event

    def tick(self, box: int) -> None:
        """React to a click on a box of `_boxes`."""
        kinds = list(EVENT_GROUPS) if self.view is None else kinds_of(self.view)
        if box < len(kinds):
            self.ask_for(self.kinds ^ {kinds[box]})
        else:
            self.action_only_selected()

    def ask_for(self, kinds: frozenset[str], words: str | None = None) -> None:
        """Set the filter."""
        self.kinds = kinds
        self.words = self.words if words is None else words
        if self.view is not None:
            self.show(self.view)

    def action_kind(self, step: int) -> None:
        """Show all kinds, then each kind alone."""
        kinds = list(EVENT_GROUPS) if self.view is None else kinds_of(self.view)
        each = [frozenset(EVENT_GROUPS), *(frozenset({name}) for name in kinds)]
        at = each.index(self.kinds) if self.kinds in each else 0
        self.ask_for(each[(at + step) % len(each)])

    def action_only_selected(self) -> None:
        """Show events of the selected robot, or of all robots."""
        self.only_selected = not self.only_selected
        if self.view is not None:
            self.show(self.view)

    def on_resize(self) -> None:
        super().on_resize()
        if self.view is not None:
            followed = self._followed
            self.show(self.view)
            if followed:
                self.keep_in_sight(max(0, self._present - 1))


def kinds_of(view: View) -> list[str]:
    """The kinds of events to choose from: parts and zones only if the run has any."""
    absent = {"parts"} if parts_finished(view) is None else set()
    absent |= {"zones"} if partition_of(view) is None else set()
    return [name for name in EVENT_GROUPS if name not in absent]


class EventFilter(NamedTuple):
    """A filter of events."""

    kinds: frozenset[str] = frozenset(EVENT_GROUPS)
    robot: int = NIL  # NIL: any
    words: str = ""  # as typed: robot 3, load 7, parts of event names

    def mask(self, events: Array) -> Array:
        """(N,) bool: whether each of (N, 5) events matches."""
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
        """Events of the robot with this number, or with this word in one of their names."""
        if word.isdecimal():
            numbered: Array = events[:, 2] == int(word)
            return numbered
        kinds = {code: name for name, several in EVENT_GROUPS.items() for code in several}
        hits = [
            code
            for code, name in enumerate(EVENT_NAMES)
            if word
            in f"{TEXTS.get(code, '')} {TRIP_TEXTS.get(code, '')} {name} {kinds.get(code, '')}"
        ]
        called: Array = np.isin(events[:, 1], hits)
        return called


class Matches:
    """The events of a run that match a filter; each event is tested once."""

    def __init__(self) -> None:
        self._of: tuple[EventHistory | None, EventFilter, int] = (None, EventFilter(), 0)
        self._seen = 0
        self._found: Array = NO_EVENTS

    def of(self, event_history: EventHistory, log: Log, wanted: EventFilter) -> Array:
        """(M,) int64 ascending indices into the event history's log."""
        of = (event_history, wanted, log.dropped)
        if event_history is not self._of[0] or of[1:] != self._of[1:]:
            self._of, self._seen, self._found = of, 0, NO_EVENTS
        events = log.rows
        if len(events) > self._seen:
            fresh = self._seen + np.flatnonzero(wanted.mask(events[self._seen :]))
            self._found = np.concatenate((self._found, fresh))
            self._seen = len(events)
        return self._found


class Filter(TypedInput):
    """Words that events must match."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,down", "leave", "To the list", show=False)
    ]

    def __init__(self) -> None:
        super().__init__(
            placeholder="F filters, e.g. robot 3, parked", compact=True, select_on_focus=False
        )

    def action_leave(self) -> None:
        self.screen.focus_next(EventList)


class KindBoxes(Rows):
    """Check boxes, each before its words, in as many lines as needed; for mouse and keys."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left,up", "move(-1)", "Previous box", show=False),
        Binding("right,down", "move(1)", "Next box", show=False),
        Binding("space,enter", "follow_cursor", "Toggle box", show=False),
    ]

    class Ticked(Message):
        """A box was toggled."""

        def __init__(self, box: int) -> None:
            super().__init__()
            self.box = box

    def __init__(self, signs: Signs) -> None:
        super().__init__(signs)
        self.box = 0  # index under the cursor
        self._boxes: list[tuple[str, bool]] = []
        self._lines: list[Line] = []

    def set_content(self, boxes: Sequence[tuple[str, bool]]) -> None:
        """Set the words, each with the state of its box."""
        self._boxes = list(boxes)
        spans: list[Span | str] = []
        for at, (name, ticked) in enumerate(self._boxes):
            sign, look = (self.signs.on, "plain") if ticked else (self.signs.off, "dim")
            spans += [Span(f"{sign}{name}", look, ("box", at)), " "]
        self._lines = wrapped(line(*spans), self.width)
        self.styles.height = len(self._lines)
        self._place()

    def _place(self) -> None:
        places = (at for at, made in enumerate(self._lines) if self._under_cursor(made))
        self.cursor = next(places, 0)
        self.update_rows(len(self._lines))

    def _under_cursor(self, made: Line) -> bool:
        return any(span.link == ("box", self.box) for span in made)

    def row(self, index: int) -> Line:
        return self._lines[index]

    def marked(self, made: Line) -> Line:
        return tuple(
            span._replace(look="cursor") if span.link == ("box", self.box) else span
            for span in made
        )

    def follow(self, link: Link, column: int = 0) -> None:
        self.box = link[1]
        self.post_message(self.Ticked(self.box))

    def action_move(self, rows: int) -> None:
        """Move to another box."""
        self.box = max(0, min(self.box + rows, len(self._boxes) - 1))
        self._place()

    def action_follow_cursor(self) -> None:
        """Toggle the box under the cursor."""
        self.follow(("box", self.box))

    def on_resize(self) -> None:
        super().on_resize()
        self.set_content(self._boxes)
