"""`watch --reload`: a floor that is drawn in an editor while the viewer shows it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from action_cases import said
from viewer_harness import Watched, screen_text, viewing

from automaton.commands import main
from automaton.world.resolve import resolve
from tui.playback.run_source import reloading
from tui.screens.dialogs import ReloadErrorScreen

FLOOR = """\
b>>>>>v#
b^ssssvd
b======d
#^<<<<.#
"""
WIDE = """\
b>>>>>>>v#
b^ssssssvd
b========d
#^<<<<<<.#
"""
SCENARIO = """\
name: hall
layout: {file: hall.txt}
fleet: {robots: 2, kinematics: differential}
orders: {generator: full-shelves}
strategy: {allocation: independent, routing: shortest, right_of_way: retreat}
stop: {when: parked, max_duration: 20000}
"""


@pytest.fixture
def hall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("hall.txt").write_text(FLOOR)
    own = Path("hall.yaml")
    own.write_text(SCENARIO)
    return own


def story(hall: Path, tell: Callable[[Watched], Awaitable[None]]) -> None:
    async def shown() -> None:
        opening = reloading(str(hall), lambda: resolve(hall, ("fleet.robots=3",)))
        async with viewing(opening, (80, 24)) as user:
            await tell(user)

    asyncio.run(shown())


def test_a_changed_floor_begins_anew_with_camera_layer_and_robot_as_they_were(hall: Path) -> None:
    async def tell(user: Watched) -> None:
        await user.at(5)
        await user.press("f3", "plus")
        user.session.choose(2)
        await user.shown()
        camera, player = user.session.pictures.camera.key, user.session.player
        hall.with_name("hall.txt").write_text(FLOOR.replace("s", "#", 1))
        await user.until(lambda: user.session.player is not player)
        await user.until(lambda: "loaded again: tick 0" in said(user.display.info))
        await user.shown()
        assert user.tick == 0 and user.session.pictures.camera.key == camera
        assert user.session.choice.robot == 2 and user.session.choice.layer == "visits"
        assert len(user.session.playback.snapshots[0].orders.state) == 3
        await user.at(3)
        assert not player._thread.is_alive()

    story(hall, tell)


def test_a_floor_of_another_size_is_shown_whole(hall: Path) -> None:
    async def tell(user: Watched) -> None:
        before = user.session.pictures.camera
        hall.with_name("hall.txt").write_text(WIDE)
        await user.until(lambda: user.session.pictures.camera is not before)
        assert user.session.pictures.camera.width == before.width + 2
        await user.shown()
        assert not user.session.pictures.camera.exceeds()

    story(hall, tell)


def test_what_is_wrong_is_shown_over_the_old_floor_until_it_is_mended(hall: Path) -> None:
    floor = hall.with_name("hall.txt")

    async def tell(user: Watched) -> None:
        player = user.session.player
        floor.write_text(FLOOR.replace("s", "?", 1))
        await user.until(lambda: isinstance(user.app.screen, ReloadErrorScreen))
        await user.until(lambda: "hall.txt:2: row 2, column 3" in screen_text(user.app))
        assert user.session.player is player and "Save the file again" in screen_text(user.app)
        floor.write_text(FLOOR.replace("v", "!", 1))
        await user.until(lambda: "hall.txt:1: row 1, column 7" in screen_text(user.app))
        new = hall.with_name("new")
        new.write_text(FLOOR)
        new.replace(floor)  # as many editors write
        await user.until(lambda: user.session.player is not player)
        await user.until(lambda: not isinstance(user.app.screen, ReloadErrorScreen))
        await user.at(4)

    story(hall, tell)


def test_what_does_not_go_with_it_is_one_sentence(
    hall: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for arguments, sentence in (
        (["--record", "x.rec"], "argument --record: not allowed with argument --reload"),
        (["--against", "seed=2"], "--reload shows only one run: leave out --against"),
        ([], "--reload shows a floor while it is drawn, which needs a terminal"),
        (["--describe"], "--reload shows a floor while it is drawn, which needs a terminal"),
    ):
        assert main(["watch", str(hall), "--reload", *arguments]) == 2
        error = capsys.readouterr().err
        assert sentence in error and error.count("\n") == 1


def test_what_belongs_to_the_old_run_is_left_behind(hall: Path) -> None:
    async def tell(user: Watched) -> None:
        await user.at(10)
        await user.press("v", "slash")
        assert user.session.choice.trails
        player = user.session.player
        hall.with_name("hall.txt").write_text(WIDE)
        hall.write_text(SCENARIO.replace("name: hall", "name: hall\nunits: {tick: 5 s}"))
        await user.until(lambda: user.session.player is not player)
        await user.press("escape")
        await user.shown()
        camera = user.session.pictures.camera
        assert camera.floor_plan is user.session.opening.resolved[0].floor_plan
        await user.at(10)
        await user.until(lambda: "50 s" in said(user.display.status))
        assert user.session.playback.trails

    story(hall, tell)


def test_a_step_ends_the_way_to_a_tick(hall: Path) -> None:
    async def tell(user: Watched) -> None:
        await user.press("g", *"40", "enter")
        await user.press("comma")
        assert user.session.goal is None

    story(hall, tell)
