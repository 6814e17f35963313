"""Every action without its key: by name from the command palette, which the mouse opens, too."""

from __future__ import annotations

import asyncio

import pytest
from textual.screen import Screen
from viewer_harness import Watched, mini, screen_text, viewing

from tui.terminal.options import Options
from tui.viewer.app import Viewer
from tui.widgets.bindings import COMPARING, VIEWER_ACTIONS


def test_the_palette_carries_out_every_action_of_the_table(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two runs have all of them. Each is replaced by a note that it was called."""
    called: list[str] = []
    viewer = Viewer(mini(), Options())
    monkeypatch.setattr(
        viewer,
        "_commands",
        {action.id: lambda id=action.id: called.append(id) for action in VIEWER_ACTIONS},
    )

    async def walk(comparing: bool) -> list[str]:
        monkeypatch.setattr(type(viewer.session.opening), "comparing", comparing)
        called.clear()
        for command in viewer.get_system_commands(Screen()):
            if command.title in {action.label for action in VIEWER_ACTIONS}:
                await command.callback()
        return called

    ids = [action.id for action in VIEWER_ACTIONS if action.shown]  # those of the footer first
    ids += [action.id for action in VIEWER_ACTIONS if not action.shown]
    assert asyncio.run(walk(True)) == ids
    assert asyncio.run(walk(False)) == [id for id in ids if id not in COMPARING]


def test_a_click_leads_to_the_palette_and_there_a_name_to_its_action() -> None:
    async def story() -> None:
        async with viewing(size=(160, 30)) as user:
            await user.at(20)
            await click(user, "ctrl+p all commands")
            await user.until(lambda: "play or pause" in screen_text(user.app))
            await user.press(*"100 ticks on")
            await user.until(lambda: "play or pause" not in screen_text(user.app))
            await user.press("enter", "enter")
            await user.until(lambda: user.tick == 120)

    asyncio.run(story())


async def click(user: Watched, words: str) -> None:
    """Click on what stands there once; it may be about to be drawn."""
    await user.until(lambda: screen_text(user.app).count(words) == 1, f"{words!r} on the screen")
    rows = screen_text(user.app).splitlines()
    (row,) = (at for at, text in enumerate(rows) if words in text)
    await user.pilot.click(offset=(rows[row].index(words) + 1, row))
