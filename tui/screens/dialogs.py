"""Dialogs: their base class, branch, go to, and the error of a changed file.

A dialog is a box in the middle with buttons and a line for errors; escape closes it.
"""

from __future__ import annotations

import re
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.screen import ModalScreen
from textual.widgets import Button, Input, Static

from automaton.errors import InputError
from automaton.scenario.order_lines import plain_data
from automaton.scenario.quantities import Scale, clock_text, is_clock_time
from automaton.scenario.schema import Scenario
from automaton.units import Unit
from automaton.world.resolve import CHANGEABLE, branched
from tui.widgets.panel import Line, Rows, Span, TypedInput, TypedText

if TYPE_CHECKING:
    from tui.playback.panel_view import View


T = TypeVar("T")

MIN_TERMINAL_COLUMNS: Final = 60
MIN_TERMINAL_ROWS: Final = 16
# Classes of a screen by its columns and rows, from these numbers on: one of each list.
ACROSS: Final = [(0, "-tight"), (MIN_TERMINAL_COLUMNS, "-narrow"), (100, "-normal"), (160, "-wide")]
DOWN: Final = [(0, "-flat"), (MIN_TERMINAL_ROWS, "-short"), (24, "-low"), (30, "-high")]

TICK_AMOUNT = re.compile(r"([+-]?)\s*(\d[\d,]{0,17}(?:\.\d+)?)\s*(%|[^\W\d]\w*)?")

RELOAD_HINT = (
    "Below is the floor as it was. Save the file again to load it; escape hides this, q quits."
)


def size_classes(columns: int, rows: int) -> dict[str, bool]:
    """For each class, whether a screen of this size has it."""
    bears: dict[str, bool] = {}
    for cells, table in ((columns, ACROSS), (rows, DOWN)):
        own = max(step for step in table if step[0] <= cells)
        bears |= {step[1]: step == own for step in table}
    return bears


class Dialog(ModalScreen[T]):
    """Base of dialogs; subclasses define the content and the result."""

    DEFAULT_CSS = """
    Dialog { align: center middle; }
    Dialog > Vertical {
        width: 76; max-width: 100%; height: auto; max-height: 100%; padding: 0 1;
        overflow-y: auto; background: $surface; border: round $border;
    }
    Dialog .heading { text-style: bold; }
    Dialog .hint { color: $foreground 75%; }
    Dialog .error { color: $text-error; text-style: bold; height: auto; }
    Dialog .error.none { display: none; }
    Dialog Horizontal { height: 1; align-horizontal: right; margin-top: 1; }
    Dialog Horizontal > Button { margin-left: 2; }
    Dialog Input { background: $background; }
    Dialog Rows { background: $surface; scrollbar-background: $surface; }
    Dialog.-short Rows, Dialog.-short TextArea { height: 3; }
    Dialog.-short Horizontal { margin-top: 0; }
    Dialog.-short .spare { display: none; }
    """
    HORIZONTAL_BREAKPOINTS: ClassVar = ACROSS  # type: ignore[misc]
    VERTICAL_BREAKPOINTS: ClassVar = DOWN  # type: ignore[misc]
    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "leave", "Close")]
    HEADING: ClassVar = ""
    ACCEPT: ClassVar = "OK"
    CANCEL: ClassVar = "Cancel"

    def compose(self) -> ComposeResult:
        with Vertical():
            yield Static(self.heading(), classes="heading", markup=False)
            yield from self.inside()
            yield Static("", classes="error none", markup=False)
            with Horizontal():
                yield Button(self.ACCEPT, id="accept", variant="primary", compact=True)
                if self.CANCEL:
                    yield Button(self.CANCEL, id="cancel", compact=True)

    def heading(self) -> str:
        """The first line."""
        return self.HEADING

    def inside(self) -> ComposeResult:
        """The widgets between the heading and the buttons."""
        raise NotImplementedError

    def accept(self) -> None:
        """Close with a result, or show an error."""
        raise NotImplementedError

    def complain(self, sentence: str) -> None:
        """Show an error and focus the field; "" clears the error."""
        shown = self.query_one(".error", Static)
        shown.update(sentence)
        shown.set_class(not sentence, "none")
        if sentence:
            self.query("Input, TextArea").first().focus()

    def action_leave(self) -> None:
        """Close without a result."""
        self.dismiss(None)

    def on_button_pressed(self, event: Button.Pressed) -> None:
        event.stop()
        if event.button.id == "accept":
            self.accept()
        else:
            self.action_leave()


# Branch: other settings from the present tick on, checked before the dialog closes.


class BranchScreen(Dialog[tuple[str, ...]]):
    """The result is the checked settings."""

    ACCEPT = "Branch here (ctrl+s)"
    BINDINGS: ClassVar[list[BindingType]] = [Binding("ctrl+s", "accept", "Branch", priority=True)]

    def __init__(self, view: View) -> None:
        super().__init__()
        self._view = view

    def heading(self) -> str:
        return f"Branch at tick {self._view.playback.tick:,}: the same past, another future"

    def inside(self) -> ComposeResult:
        yield Static("New settings, one KEY=VALUE in each line:", classes="hint")
        yield SettingField(compact=True, tab_behavior="focus", show_line_numbers=False)
        yield Static("What may change, as it is now (click or enter to edit it):", classes="hint")
        yield SettingList(settings_of(self._view.run.resolved.scenario))

    def on_text_area_changed(self) -> None:
        self.complain("")

    def action_accept(self) -> None:
        """Check the settings and close."""
        self.accept()

    def accept(self) -> None:
        lines = self.query_one(SettingField).text.splitlines()
        settings = tuple(one.strip() for one in lines if one.strip())
        if not settings:
            self.complain("write at least one setting, such as strategy.right_of_way=wait")
            return
        try:
            branched(self._view.run.resolved, settings)
        except InputError as error:
            self.complain(str(error).removeprefix("--set "))
            return
        self.dismiss(settings)


def settings_of(scenario: Scenario) -> list[str]:
    """KEY=VALUE lines of all settings that may change during a run, with present values.

    Not those of streets, which may be one for each cell.
    """
    data = plain_data(scenario)
    names = (name for name in CHANGEABLE if name != "streets")
    return [text for name in names for text in _flat(name, data[name])]


def _flat(key: str, value: Any) -> list[str]:
    if isinstance(value, dict):
        return [text for name, inner in value.items() for text in _flat(f"{key}.{name}", inner)]
    if isinstance(value, bool):
        value = str(value).lower()
    return [f"{key}={value}"]


class SettingList(Rows):
    """The present settings; a click or enter copies a line into the field."""

    DEFAULT_CSS = "SettingList { height: 7; }"

    def __init__(self, settings: list[str]) -> None:
        super().__init__()
        self.settings = settings

    def on_mount(self) -> None:
        self.update_rows(len(self.settings))

    def row(self, index: int) -> Line:
        return (Span(self.settings[index], "link"),)

    def chosen(self, index: int) -> None:
        self.screen.query_one(SettingField).add(self.settings[index])


class SettingField(TypedText):
    """The field for lines KEY=VALUE."""

    DEFAULT_CSS = "SettingField { height: 5; }"

    def add(self, setting: str) -> None:
        """Add a line to edit, with the caret at its end."""
        text = self.text.rstrip("\n")
        self.text = f"{text}\n{setting}" if text else setting
        self.move_cursor(self.document.end)
        self.focus()


# Go to a tick: by number, relative to the present, as a share of the run, or by time.


class GoToScreen(Dialog[int]):
    """The result is a tick."""

    HEADING = "Go to tick"
    ACCEPT = "Go there"

    def __init__(self, view: View) -> None:
        super().__init__()
        self._view = view
        self._scale = view.run.resolved.scenario.units.scale

    def inside(self) -> ComposeResult:
        playback = self._view.playback
        last = (
            f"ends at {playback.end:,}"
            if playback.end is not None
            else f"has come to {playback.head:,}"
        )
        yield TypedInput(placeholder=examples(self._scale), compact=True)
        yield Static(
            f"now {playback.tick:,}; the run {last}; write {examples(self._scale)}",
            classes="hint",
            markup=False,
        )

    def on_input_changed(self) -> None:
        self.complain("")

    def on_input_submitted(self) -> None:
        self.accept()

    def accept(self) -> None:
        """Close with the tick."""
        playback = self._view.playback
        text = self.query_one(Input).value
        try:
            tick = tick_of(text, playback.tick, playback.head, playback.end, self._scale)
        except InputError as error:
            self.complain(str(error))
            return
        self.dismiss(tick)


def tick_of(text: str, now: int, head: int, end: int | None, scale: Scale) -> int:
    """The tick of a text, maybe after the end; `head`: last tick so far. Raises InputError."""
    if is_clock_time(text.strip()):
        return scale.tick_at(text.strip())
    of = scale.unit
    found = TICK_AMOUNT.fullmatch(text.strip())
    if found is None:
        raise InputError(f"'{text.strip()}' is not a tick; expected {examples(scale)}")
    sign, amount, name = found[1], float(found[2].replace(",", "")), found[3] or "ticks"
    ticks = round(_ticks(amount, name, head if end is None else end, of))
    if sign:
        return max(0, now + (ticks if sign == "+" else -ticks))
    return ticks


def _ticks(amount: float, name: str, last: int, of: Unit) -> float:
    if name == "%":
        if amount > 100:
            raise InputError(f"{amount:g} % lies after the end; a run goes from 0 % to 100 %")
        return last * amount / 100
    if name in ("tick", "ticks"):
        return amount
    if name in (of.name, of.plural):
        return amount / of.size
    known = "ticks" if of.name == "tick" else f"ticks or {of.plural}"
    raise InputError(f"there is no unit '{name}' here; time is counted in {known}")


def examples(scale: Scale) -> str:
    """Examples of valid input."""
    of = scale.unit
    time = "" if scale.clock is None else f", {clock_text(scale.clock, Fraction(3600))}"
    timed = "" if of.name == "tick" else f", {30 * of.size:g} {of.plural}"
    return f"1200, +100, -50, 50 %{timed}{time}"


# The error of a changed file, over the previous floor.


class ReloadErrorScreen(ModalScreen[None]):
    """Shows an error until the file is corrected."""

    DEFAULT_CSS = """
    ReloadErrorScreen { align: center bottom; }
    ReloadErrorScreen > Vertical {
        width: 100%; height: auto; max-height: 100%; padding: 0 1; overflow-y: auto;
        background: $surface; border: round $error;
    }
    ReloadErrorScreen .error { color: $text-error; text-style: bold; height: auto; }
    ReloadErrorScreen .hint { color: $foreground 75%; height: auto; }
    """
    BINDINGS: ClassVar = [
        Binding("escape", "dismiss", "Hide"),
        Binding("q", "app.quit", "Quit"),
    ]

    def __init__(self, sentence: str) -> None:
        super().__init__()
        self._sentence = sentence

    def compose(self) -> ComposeResult:
        with Vertical():
            yield Static(self._sentence, classes="error", markup=False)
            yield Static(RELOAD_HINT, classes="hint", markup=False)

    def complain(self, sentence: str) -> None:
        """Show another error."""
        self._sentence = sentence
        self.query_one(".error", Static).update(sentence)
