"""The keys at the foot of the screen: as many as there is room for, help and the way out always."""

from __future__ import annotations

from typing import Any, Final

from textual.app import ComposeResult
from textual.widgets import Footer

from tui.widgets.bindings import do

STAY: Final = (do("help"), do("quit"))  # of the others the last ones go first


class Keys(Footer):
    """A footer of whole words."""

    def compose(self) -> ComposeResult:
        keys: list[Any] = list(super().compose())
        while _columns(keys) > self.app.size.width:
            others = [key for key in keys if key.action not in STAY]
            if not others:
                break
            keys.remove(others[-1])
        yield from keys

    def on_resize(self) -> None:
        self.refresh(recompose=True)


def _columns(keys: list[Any]) -> int:
    """What they take in a row, one blank between two."""
    return sum(len(f"{key.key_display} {key.description}") + 1 for key in keys) - 1
