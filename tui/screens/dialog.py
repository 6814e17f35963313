"""What all dialogs have in common: a box in the middle, a sentence for errors, buttons, escape."""

from __future__ import annotations

from typing import ClassVar, TypeVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.screen import ModalScreen
from textual.widgets import Button, Static

from tui.widgets.too_small import ACROSS, DOWN

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
