"""What is wrong with a file that was changed, over the floor that was there before."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Static

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
