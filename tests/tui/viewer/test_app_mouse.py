"""The viewer by mouse, by the command palette, and with other keys."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

from action_cases import said
from textual import events
from viewer_harness import Watched, compared, mini, viewing

from automaton.engine.state import NIL
from tui.playback.run_source import Opening
from tui.terminal.map_view import MapView
from tui.terminal.options import Options
from tui.widgets.bindings import COMPARING, VIEWER_ACTIONS
from tui.widgets.timeline import Timeline


def story(tell: Callable[[Watched], Awaitable[None]], opening: Opening | None = None) -> None:
    """Somebody uses the viewer at tick 320."""

    async def told() -> None:
        async with viewing(opening) as user:
            await user.at(320)
            await user.shown()
            await tell(user)

    asyncio.run(told())


def place_of(user: Watched, robot: int) -> tuple[int, int]:
    """Column and row of a robot on the map."""
    cell = int(user.session.playback.snapshots[0].robots.cell[robot])
    row, column = user.session.pictures.camera.place_of(cell)
    return column, row


def test_a_click_selects_the_robot_or_the_cell_there_and_beside_the_floor_nothing() -> None:
    async def tell(user: Watched) -> None:
        await user.pilot.click("#map-0", offset=place_of(user, 2))
        assert user.session.choice.robot == 2
        camera = user.session.pictures.camera
        cell = camera.floor_plan.cell(1, 4)
        row, column = camera.place_of(cell)
        await user.pilot.click("#map-0", offset=(column, row))
        assert (user.session.choice.robot, user.session.choice.cell) == (NIL, cell)
        await user.pilot.click("#map-0", offset=(0, 0))
        assert (user.session.choice.robot, user.session.choice.cell) == (NIL, NIL)

    story(tell)


def test_a_double_click_follows_and_a_drag_lets_go() -> None:
    async def tell(user: Watched) -> None:
        await user.pilot.double_click("#map-0", offset=place_of(user, 1))
        assert user.session.choice.robot == 1 and user.session.choice.following
        view = user.display.maps[0]
        view.post_message(MapView.Dragged(view, 0, -3, 1))
        await user.until(lambda: not user.session.choice.following)

    story(tell)


def test_the_wheel_zooms_at_the_pointer_and_pans_with_shift() -> None:
    async def tell(user: Watched) -> None:
        camera = user.session.pictures.camera
        camera.resize(5, 20)
        camera.zoom = camera.ladder[2]
        camera.centre_on(camera.floor_plan.cell(6, 3))
        before = camera.cell_at(2, 5)
        view = user.display.maps[0]
        wheel = MapView.Wheeled.__new__(MapView.Wheeled)
        MapView.Happened.__init__(wheel, view)
        wheel.row, wheel.column, wheel.direction, wheel.shift, wheel.ctrl = 2, 5, "up", False, False
        user.app.on_map_view_wheeled(wheel)
        assert camera.ladder.index(camera.zoom) == 1 and camera.cell_at(2, 5) == before
        left = camera.left
        wheel.direction, wheel.shift = "down", True
        user.app.on_map_view_wheeled(wheel)
        assert camera.left > left

    story(tell)


def test_the_timeline_goes_where_it_is_clicked() -> None:
    async def tell(user: Watched) -> None:
        line = user.app.query_one(Timeline)
        wanted = line.track.tick_at(20)
        await user.pilot.click("#timeline", offset=(20, 0))
        await user.until(lambda: user.tick == wanted)
        line.focus()
        await user.press("right")
        await user.until(lambda: user.tick == wanted + 1)

    story(tell)


def test_the_wheel_zooms_the_timeline_about_the_pointer_and_with_shift_goes_by_ticks() -> None:
    async def tell(user: Watched) -> None:
        line = user.app.query_one(Timeline)
        there, ticks = line.track.tick_at(60), line.track.part.ticks

        def turn(kind: type[events.MouseEvent], shift: bool = False) -> None:
            turned = kind(line, 60, 0, 0, 0, 0, shift, False, False)
            line.post_message(MapView.Wheeled(line, turned))

        turn(events.MouseScrollUp)
        await user.until(lambda: line.track.part.ticks == ticks // 2)
        assert abs(line.track.column_of(there) - 60) <= 1
        turn(events.MouseScrollDown)
        await user.until(lambda: line.track.part.ticks == ticks)
        before = user.tick
        turn(events.MouseScrollUp, shift=True)
        await user.until(lambda: user.tick == before - 1)
        turn(events.MouseScrollUp)
        turn(events.MouseScrollUp)
        await user.until(lambda: before not in line.track.part)
        user.display.timeline.zoom(1)  # by key: about the present
        assert user.tick in line.track.part
        await user.at(10)
        await user.until(lambda: line.past.tick == 10)
        assert 10 in line.track.part

    story(tell)


def test_words_of_the_status_line_can_be_clicked() -> None:
    async def tell(user: Watched) -> None:
        await user.pilot.click("#status", offset=(0, 0))
        await user.until(lambda: user.session.playback.playing == 1)

    story(tell)


def test_the_mouse_over_a_cell_says_what_is_there() -> None:
    async def tell(user: Watched) -> None:
        await user.pilot.hover("#map-0", offset=place_of(user, 2))
        await user.until(lambda: "robot 2" in said(user.display.info))

    story(tell)


def test_every_action_is_in_the_palette(tmp_path: Path) -> None:
    def listed(user: Watched) -> set[str]:
        commands = user.app.get_system_commands(user.app.screen)
        known = {action.label for action in VIEWER_ACTIONS}  # colours of robots have entries, too
        return {command.callback.args[0] for command in commands if command.title in known}

    async def alone(user: Watched) -> None:
        assert listed(user) == {action.id for action in VIEWER_ACTIONS} - COMPARING

    async def comparing(user: Watched) -> None:
        assert listed(user) == {action.id for action in VIEWER_ACTIONS}

    story(alone)
    story(comparing, compared(tmp_path))


def test_an_action_gets_another_key_by_its_id() -> None:
    async def tell(user: Watched) -> None:
        user.app.set_keymap({"step_forward": "ctrl+n"})
        await user.press("ctrl+n")
        await user.until(lambda: user.tick == 321)

    story(tell)


def test_every_key_of_an_action_is_bound_to_it_alone() -> None:
    keys = [key for action in VIEWER_ACTIONS for key in action.keys.split(",")]
    assert len(set(keys)) == len(keys)

    async def tell(user: Watched) -> None:
        for action in VIEWER_ACTIONS:
            for key in action.keys.split(","):
                bound = user.app._bindings.get_bindings_for_key(key)
                assert [binding.id for binding in bound] == [action.id]

    story(tell)


def test_read_only_branches_nothing_and_writes_nothing_here(tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))

    async def told() -> None:
        async with viewing(mini(), options=Options(paused=True, read_only=True)) as user:
            await user.press("B")
            assert "this viewer is read-only: runs cannot be branched" in user.toasts()
            await user.press("s")
            await user.until(lambda: list((tmp_path / "state").rglob("*.svg")))
            assert len(user.app.screen_stack) == 1

    asyncio.run(told())
    assert [path.name for path in tmp_path.iterdir()] == ["state"]
