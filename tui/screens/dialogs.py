"""Dialogs: branch, go to, help, and the error of a file that was changed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Button, Footer, Input, Static

from automaton.errors import InputError
from automaton.scenario.order_lines import plain_data
from automaton.scenario.quantities import Scale, clock_text, is_clock_time
from automaton.scenario.schema import Scenario
from automaton.units import Unit
from automaton.world.resolve import CHANGEABLE, branched
from tui.widgets.bindings import TOPICS, Action, Topic, key_text
from tui.widgets.rows import Rows, TypedInput, TypedText
from tui.widgets.styled_lines import Line, Span
from tui.widgets.too_small import ACROSS, DOWN

if TYPE_CHECKING:
    from tui.playback.panel_view import View

T = TypeVar("T")


class Dialog(ModalScreen[T]):
    """Subclasses say what is inside, and what happens when it is accepted."""

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
        """Close with a result, or say what is wrong."""
        raise NotImplementedError

    def complain(self, sentence: str) -> None:
        """Show what is wrong, and let it be mended; "" when nothing is."""
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


# Branch: other settings from the present tick on; they are checked before the dialog closes.


def settings_of(scenario: Scenario) -> list[str]:
    """KEY=VALUE of everything that may change while a run goes on, as it is."""
    data = plain_data(scenario)
    return [text for name in CHANGEABLE for text in _flat(name, data[name])]


def _flat(key: str, value: Any) -> list[str]:
    if isinstance(value, dict):
        return [text for name, inner in value.items() for text in _flat(f"{key}.{name}", inner)]
    if isinstance(value, bool):
        value = str(value).lower()
    return [f"{key}={value}"]


class SettingList(Rows):
    """What holds now; a click or enter copies a line into the field."""

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
    """Lines KEY=VALUE."""

    DEFAULT_CSS = "SettingField { height: 5; }"

    def add(self, setting: str) -> None:
        """A line to be changed; the caret is at its end."""
        text = self.text.rstrip("\n")
        self.text = f"{text}\n{setting}" if text else setting
        self.move_cursor(self.document.end)
        self.focus()


class BranchScreen(Dialog[tuple[str, ...]]):
    """The result are the settings, which fit the run."""

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


# Go to a tick: by number, relative to the present, as a share of the run, or by its time.


AMOUNT = re.compile(r"([+-]?)\s*(\d[\d,]{0,17}(?:\.\d+)?)\s*(%|[^\W\d]\w*)?")


def tick_of(text: str, now: int, head: int, end: int | None, scale: Scale) -> int:
    """The tick that a text means, be it after the end; `head` is the last so far. Raises InputError."""
    if is_clock_time(text.strip()):
        return scale.tick_at(text.strip())
    of = scale.unit
    found = AMOUNT.fullmatch(text.strip())
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
    """What can be written."""
    of = scale.unit
    time = "" if scale.clock is None else f", {clock_text(scale.clock, Fraction(3600))}"
    timed = "" if of.name == "tick" else f", {30 * of.size:g} {of.plural}"
    return f"1200, +100, -50, 50 %{timed}{time}"


class GoToScreen(Dialog[int]):
    """The result is a tick of the run."""

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


# All keys by topic, made from the table of actions and the keys that are bound to them now.


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


# What is wrong with a file that was changed, over the floor that was there before.


HINT = "Below is the floor as it was. Save the file again to load it; escape hides this, q quits."


class ReloadErrorScreen(ModalScreen[None]):
    """Shows the sentence until the file is mended."""

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
            yield Static(HINT, classes="hint", markup=False)

    def complain(self, sentence: str) -> None:
        """Show another sentence."""
        self._sentence = sentence
        self.query_one(".error", Static).update(sentence)
