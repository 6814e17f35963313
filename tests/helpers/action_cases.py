"""What the tests of actions share: the table of checks, and what a line of the viewer says."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from viewer_harness import Watched

from tui.render.encode import as_text
from tui.widgets.bindings import VIEWER_ACTIONS

Check = Callable[[Watched], Awaitable[None]]
CHECKS: dict[str, Check] = {}
KEYS = {action.id: action.keys.split(",")[0] for action in VIEWER_ACTIONS}


def check(action: Check) -> Check:
    """What its key must bring about: `action` is named after it."""
    CHECKS[action.__name__] = action
    return action


async def press(user: Watched, action: str) -> None:
    await user.press(KEYS[action])


def said(line: object) -> str:
    shown = line.shown  # type: ignore[attr-defined]
    return "" if shown is None else as_text(shown, line.glyphs)  # type: ignore[attr-defined]
