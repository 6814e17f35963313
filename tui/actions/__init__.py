"""What each action does: groups of actions, each an object that is handed what it works on.

Textual calls one action of the app, `do('ID')`, for every key of the table tui.widgets.bindings; the
app finds the ID in what `commands` of the groups return.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Protocol

Command = Callable[[], Awaitable[None] | None]


class Actions(Protocol):
    """A group of actions."""

    def commands(self) -> dict[str, Command]:
        """What each action does, by its id in the table of bindings."""


def do(id: str) -> str:
    """What Textual runs for an action of the table."""
    return f"do({id!r})"
