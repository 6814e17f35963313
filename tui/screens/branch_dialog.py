"""Branch: other settings from the present tick on; they are checked before the dialog closes."""

from __future__ import annotations

from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import Static

from automaton.errors import InputError
from automaton.scenario.orders import plain_data
from automaton.scenario.schema import Scenario
from automaton.world.resolve import CHANGEABLE, branched
from tui.playback.panel_view import View
from tui.screens.dialog import Dialog
from tui.widgets.rows import Rows
from tui.widgets.styled_lines import Line, Span
from tui.widgets.typed_fields import TypedText


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
