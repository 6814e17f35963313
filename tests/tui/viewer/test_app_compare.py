"""Two runs beside each other: sizes, fleets of different size; and pictures of maps that are hidden."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from action_cases import said
from viewer_harness import compared, mini, record, viewing

from automaton.engine.state import NIL
from tui.playback.frame_cache import differing, ghosts_of
from tui.playback.run_source import Opening, recorded
from tui.render.encode import as_text
from tui.terminal.options import Options
from tui.widgets.robot_table import Robots


def test_two_runs_survive_every_size(tmp_path: Path) -> None:
    async def story() -> None:
        async with viewing(compared(tmp_path), size=(120, 36)) as user:
            await user.at(200)
            for size in ((80, 24), (60, 16), (1, 1), (300, 20), (200, 60)):
                await user.pilot.resize_terminal(*size)
                await user.shown()
            assert user.app.is_running and user.display.maps[1].shown is not None

    asyncio.run(story())


def large_and_small(folder: Path) -> Opening:
    """Two recordings, of three robots and of one."""
    small = record(folder / "small.rec", "fleet.robots=1")
    return recorded(record(folder / "large.rec"), small)


def test_what_is_found_in_the_larger_fleet_is_not_looked_for_in_the_smaller(tmp_path: Path) -> None:
    async def story() -> None:
        async with viewing(large_and_small(tmp_path)) as user:
            await user.at(100)
            await user.press("slash")
            for key in ("x", "space", "greater_than_sign", "space", "minus", "5", "enter"):
                await user.press(key)
            await user.until(lambda: len(user.session.choice.matches) == 3)
            await user.shown()
            assert user.app.is_running

    asyncio.run(story())


def test_numbered_places_are_those_of_the_run_that_the_panels_show(tmp_path: Path) -> None:
    async def story() -> None:
        async with viewing(compared(tmp_path)) as user:
            await user.at(300)
            await user.press("y")
            for side in (0, 1):
                await user.until(lambda side=side: user.session.choice.side == side)
                scenes = [user.session.scene(each) for each in (0, 1)]
                figures = user.session.playback.figures[side]
                assert scenes[side].slow_places == tuple(one.cell for one in figures.slow_places)
                assert scenes[side].slow_places and not scenes[1 - side].slow_places
                await user.press("o")
            first, second = user.session.choice.slow_places
            assert first != second

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
            shown = user.display.maps[0].shown
            assert shown is not None and user.tick == 150
            seen = as_text(shown, user.session.glyphs)
            assert {line.strip() for line in seen.splitlines()} <= {
                line.strip() for line in saved.read_text(encoding="utf-8").splitlines()
            }

    asyncio.run(story())


@pytest.mark.parametrize("size", [(80, 24), (120, 36)])
def test_a_run_that_has_ended_tells_of_its_own_end(tmp_path: Path, size: tuple[int, int]) -> None:
    short, long = record(tmp_path / "a.rec", until=200), record(tmp_path / "b.rec", until=300)

    async def story() -> None:
        async with viewing(recorded(short, long), size) as user:
            await user.at(150)
            await user.shown()
            assert not any("ended" in said(head) for head in user.display.heads)
            await user.at(300)
            await user.until(lambda: "tick 200" in said(user.display.status))
            assert "of 200" not in said(user.display.status)
            assert said(user.display.status).rstrip().endswith("ended")
            for head, end in zip(user.display.heads, (200, 300), strict=True):
                assert said(head).rstrip().endswith(f"  ended at tick {end}")
            await user.press("space")
            await user.until(lambda: "both runs have ended at tick 300" in said(user.display.info))
            await user.at(250)
            await user.press("o")
            await user.until(lambda: "tick 250  of 300" in said(user.display.status))
            assert said(user.display.status).rstrip().endswith("compare")
            assert "ended" not in said(user.display.heads[1])

    asyncio.run(story())


def test_the_text_of_two_runs_names_the_tick_of_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    short, long = record(tmp_path / "a.rec", until=20), record(tmp_path / "b.rec", until=30)

    async def story() -> None:
        async with viewing(recorded(short, long)) as user:
            await user.at(30)
            await user.press("S")
            await user.until(lambda: list(tmp_path.glob("*.txt")))

    asyncio.run(story())
    text = next(tmp_path.glob("*.txt")).read_text(encoding="utf-8")
    named = [line for line in text.splitlines() if line.endswith(("tick 20", "tick 30"))]
    assert [line[:5] for line in named] == ["a.rec", "b.rec"]
    assert [line[-2:] for line in named] == ["20", "30"]


def test_a_breakpoint_shows_the_run_that_met_it(tmp_path: Path) -> None:
    async def story() -> None:
        async with viewing(compared(tmp_path)) as user:
            await user.press("b")
            await user.until(lambda: len(user.app.screen_stack) == 2)
            await user.press(*"stalled > 20", "enter", "escape")
            await user.until(lambda: user.app.branches.stops)
            await user.press("9", "space")
            await user.until(lambda: user.session.playback.stops)
            side, robot = (
                user.session.playback.side,
                user.session.playback.breakpoint_robots[0],
            )
            await user.until(lambda: user.session.choice.side == side)
            assert user.session.choice.robot == robot
            told = f"stopped: stalled > 20: run {'AB'[side]}, robot {robot}"
            await user.until(lambda: told in said(user.display.info))
            assert side == 1  # the one in which robots only wait

    asyncio.run(story())


def test_a_recording_that_cannot_be_compared_says_so(tmp_path: Path) -> None:
    opening = recorded(record(tmp_path / "a.rec"), record(tmp_path / "b.rec"))
    broken = opening.recordings[1].stored().payloads
    del broken[len(broken) // 2]

    async def story() -> None:
        async with viewing(opening) as user:
            told = "recording B has fewer ticks than it declares: the file was altered"
            await user.until(lambda: told in said(user.display.info))
            assert user.session.divergence is None and user.session.broken == told

    asyncio.run(story())


def test_in_fleets_of_different_size_the_other_robots_are_marked_and_ghosts(tmp_path: Path) -> None:
    async def story() -> None:
        async with viewing(large_and_small(tmp_path)) as user:
            await user.at(100)
            playback = user.session.playback
            there = playback.snapshots[0].robots.cell
            assert {*range(1, len(there))} <= {*differing(playback).tolist()}
            assert {*there[1:].tolist()} - {NIL} <= {*ghosts_of(playback, 1).tolist()}

    asyncio.run(story())


def test_the_robot_under_the_cursor_may_be_missing_in_the_other_run(tmp_path: Path) -> None:
    async def story() -> None:
        async with viewing(large_and_small(tmp_path), size=(120, 36)) as user:
            await user.at(100)
            await user.press("t", "end", "o")
            await user.shown()
            assert user.app.is_running and user.session.choice.side == 1
            user.display.refresh_panels()
            assert user.app.query_one(Robots).cursor == 0

    asyncio.run(story())


def test_times_are_compared_also_while_another_layer_is_shown_and_only_beside_a_recording(
    tmp_path: Path,
) -> None:
    async def story(opening: Opening, there: bool) -> None:
        async with viewing(opening) as user:
            await user.at(100)
            for key in ("f3", "R"):
                await user.press(key)
            assert (user.session.choice.layer == "difference") == there

    asyncio.run(story(compared(tmp_path), True))
    asyncio.run(story(mini(), False))
