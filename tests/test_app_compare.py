"""Two runs beside each other: sizes, fleets of different size; and pictures of maps that are hidden."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from viewing import compared, record, viewing

from tui.opening import recorded
from tui.options import Options
from tui.render.still import as_text


def test_two_runs_survive_every_size(tmp_path: Path) -> None:
    async def story() -> None:
        async with viewing(compared(tmp_path), size=(120, 36)) as user:
            await user.at(200)
            for size in ((80, 24), (60, 16), (1, 1), (300, 20), (200, 60)):
                await user.pilot.resize_terminal(*size)
                await user.shown()
            assert user.app.is_running and user.app.maps[1].shown is not None

    asyncio.run(story())


def test_what_is_found_in_the_larger_fleet_is_not_looked_for_in_the_smaller(tmp_path: Path) -> None:
    small = record(tmp_path / "small.rec", "fleet.robots=1")
    opening = recorded(record(tmp_path / "large.rec"), small)

    async def story() -> None:
        async with viewing(opening) as user:
            await user.at(100)
            await user.press("slash")
            for key in ("x", "space", "greater_than_sign", "space", "minus", "5", "enter"):
                await user.press(key)
            await user.until(lambda: len(user.app.choice.found) == 3)
            await user.shown()
            assert user.app.is_running

    asyncio.run(story())


def test_the_text_of_a_hidden_map_is_that_of_the_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    async def story() -> None:
        async with viewing(size=(80, 24), options=Options(paused=True, color="true")) as user:
            await user.at(10)
            await user.press("p")  # the panels, in place of the map
            await user.at(150)
            await user.press("S")
            await user.until(lambda: list(tmp_path.glob("*.txt")))
            (saved,) = tmp_path.glob("*.txt")
            await user.press("p")
            await user.shown()
            shown = user.app.maps[0].shown
            assert shown is not None and user.tick == 150
            seen = as_text(shown, user.app.glyphs)
            assert {line.strip() for line in seen.splitlines()} <= {
                line.strip() for line in saved.read_text(encoding="utf-8").splitlines()
            }

    asyncio.run(story())
