"""Breakpoints: a list of conditions that can be switched on and off, and a line to add one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Final, NamedTuple

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import Input, Static

from automaton.errors import InputError
from automaton.history.breakpoints import FIELDS, breakpoint_of
from tui.screens.dialogs import Dialog
from tui.widgets.panel import UNICODE_SIGNS, Line, Link, Rows, Signs, Span, TypedInput, dim, line

GRAMMAR: Final = (
    "deadlock, wait cycle, zones redesigned, delivered 7, stalled > 50, or a condition on "
    "a robot, such as waiting > 20 and loaded, cause == 'head-on'"
)

WAYS: Final = (
    "Play, ticks on, go to, end and the timeline stop at it; "
    "going back and jumps from lists do not."
)


class StopCondition(NamedTuple):
    """A breakpoint in the user's list."""

    text: str
    on: bool = True


class StopList(Rows):
    """The breakpoints; a click or enter switches one on or off, delete removes one."""

    DEFAULT_CSS = "StopList { height: 6; }"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "follow_cursor", "On or off", show=False),
        Binding("delete,backspace", "remove", "Remove", show=False),
    ]

    def __init__(self, stops: Sequence[StopCondition], signs: Signs) -> None:
        super().__init__(signs)
        self.stops = list(stops)

    def on_mount(self) -> None:
        self.set_content()

    def set_content(self) -> None:
        """Update the list."""
        self.update_rows(max(1, len(self.stops)))
        self.refresh()

    def row(self, index: int) -> Line:
        if not self.stops:
            return line(dim("no stops yet"))
        stop = self.stops[index]
        sign = self.signs.on if stop.on else self.signs.off
        room = " " * max(1, self.width - len(stop.text) - 2 - len("delete"))
        look = "plain" if stop.on else "dim"
        return line(
            Span(f"{sign} {stop.text}", look), room, Span("delete", "link", ("delete", index))
        )

    def chosen(self, index: int) -> None:
        """Switch a breakpoint on or off."""
        if self.stops:
            stop = self.stops[index]
            self.stops[index] = stop._replace(on=not stop.on)
            self.set_content()

    def follow(self, link: Link, column: int = 0) -> None:
        self.remove_at(link[1])

    def action_remove(self) -> None:
        """Remove the breakpoint under the cursor."""
        self.remove_at(self.cursor)

    def remove_at(self, index: int) -> None:
        if index < len(self.stops):
            del self.stops[index]
            self.set_content()


class BreakpointsScreen(Dialog[tuple[StopCondition, ...]]):
    """The result is the edited list, even after escape."""

    HEADING = "Stops: the run stops where a condition begins to hold"
    ACCEPT = "Done"
    CANCEL = ""

    def __init__(self, stops: Sequence[StopCondition], signs: Signs = UNICODE_SIGNS) -> None:
        super().__init__()
        self._list = StopList(stops, signs)

    def inside(self) -> ComposeResult:
        yield TypedInput(placeholder="add one: stalled > 50", compact=True)
        yield Static(f"Write {GRAMMAR}.", classes="hint", markup=False)
        yield Static(f"A robot has {', '.join(FIELDS)}.", classes="hint", markup=False)
        yield Static(WAYS, classes="hint spare", markup=False)
        yield self._list

    def on_input_changed(self) -> None:
        self.complain("")

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Add the text as a breakpoint; close if it is empty."""
        if not event.value.strip():
            self.accept()
        elif self._added(event.value):
            event.input.clear()

    def _added(self, text: str) -> bool:
        try:
            read = breakpoint_of(text)
        except InputError as error:
            self.complain(str(error))
            return False
        if read.text not in [stop.text for stop in self._list.stops]:
            self._list.stops.append(StopCondition(read.text))
            self._list.set_content()
        return True

    def accept(self) -> None:
        """Close with the list, including the text in the field."""
        text = self.query_one(Input).value
        if not text.strip() or self._added(text):
            self.dismiss(tuple(self._list.stops))

    def action_leave(self) -> None:
        self.dismiss(tuple(self._list.stops))
