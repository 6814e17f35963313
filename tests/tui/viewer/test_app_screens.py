"""The main screens as text, at fixed ticks in three sizes; `pytest --update-grids` writes them again."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from viewer_harness import Watched, compared, laid_out, mini, screen_text, viewing

from automaton.pytest_plugin import GridSnapshot
from tui.playback.run_source import Opening

SIZES = ((80, 24), (120, 36), (200, 60))
TICK = 320
Visit = Callable[[Watched], Awaitable[None]]


async def the_map(user: Watched) -> None:
    user.session.choose(1)


async def inspector(user: Watched) -> None:
    user.session.choose(1)
    await user.press("i")


async def why(user: Watched) -> None:
    user.session.choose(0)
    await user.press("w")


async def events(user: Watched) -> None:
    await user.press("e")


async def robots(user: Watched) -> None:
    await user.press("t")


async def legend(user: Watched) -> None:
    await user.press("f3", "K")


async def help_(user: Watched) -> None:
    await user.shown()  # what lies under a dialog stays as it was
    await user.press("question_mark")


async def find(user: Watched) -> None:
    await user.shown()
    await user.press("slash", *"robot", "space", "2")


async def comparison(user: Watched) -> None:
    await user.until(lambda: user.session.divergence is not None)
    await user.press("x")
    await user.until(lambda: user.tick == user.session.divergence.tick)


VISITS: dict[str, Visit] = {
    "map": the_map,
    "inspector": inspector,
    "why": why,
    "events": events,
    "robots": robots,
    "legend": legend,
    "help": help_,
    "find": find,
    "compare": comparison,
}


async def seen(opening: Opening, visit: Visit) -> dict[str, str]:
    """The screen in each size, in a terminal that is made larger and larger."""
    screens = {}
    async with viewing(opening, SIZES[0]) as user:
        await user.at(TICK)
        await visit(user)
        for width, height in SIZES:
            await user.pilot.resize_terminal(width, height)
            await user.until(lambda: laid_out(user.app))
            await user.shown()
            screens[f"{width}x{height}"] = screen_text(user.app)
    return screens


@pytest.mark.parametrize("name", list(VISITS))
def test_screen(name: str, tmp_path: Path, grid_snapshot: GridSnapshot) -> None:
    opening = compared(tmp_path) if name == "compare" else mini()
    for size, screen in asyncio.run(seen(opening, VISITS[name])).items():
        grid_snapshot(screen, name=size)


def test_a_terminal_that_is_too_small_says_so_and_recovers(grid_snapshot: GridSnapshot) -> None:
    async def story() -> str:
        async with viewing(size=(80, 24)) as user:
            await user.at(TICK)
            await user.pilot.resize_terminal(50, 12)
            await user.shown()
            small = screen_text(user.app)
            await user.pilot.resize_terminal(80, 24)
            await user.shown()
            assert user.app.query_one("#main").display and "tick 320" in screen_text(user.app)
            return small

    grid_snapshot(asyncio.run(story()))


def test_words_and_rows_fit_the_smallest_terminal() -> None:
    async def story() -> list[str]:
        async with viewing(size=(60, 16)) as user:
            await user.at(TICK)
            user.session.choose(1)
            await user.shown()
            return screen_text(user.app).splitlines()

    rows = asyncio.run(story())
    assert len(rows) == 16
    assert any("tick 320" in row for row in rows[-4:]) and any("Play" in row for row in rows[-2:])
