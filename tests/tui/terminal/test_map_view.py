"""The map's widget without a terminal: what it shows, and what it says about the mouse."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
from textual import events
from textual.app import App, ComposeResult
from textual.geometry import Region
from textual.pilot import Pilot
from textual.widgets import Static

from tui.render.styles import (
    COLOUR_FLOOR,
    COLOUR_ROBOT,
    COLOUR_TRACK,
    UNICODE,
    Codes,
    Depth,
    Look,
    code,
    style,
)
from tui.terminal.frame_pacing import FrameClock, FramePacer
from tui.terminal.map_view import MapView, Presenter

BLANK = np.uint32(code(style(COLOUR_TRACK, COLOUR_FLOOR), UNICODE.characters.index(" ")))
CROSS = np.uint32(code(style(COLOUR_ROBOT, COLOUR_FLOOR), UNICODE.characters.index("#")))


class MapHarness(App[None]):
    """A map of 20 x 6 cells beside a panel, and a list of all that the map said."""

    CSS = "#side { dock: right; width: 5; }"

    def __init__(self) -> None:
        super().__init__()
        self.presenter = Presenter(self)
        self.map = MapView(self.presenter, Look(Depth.TRUE, "dark"), UNICODE)
        self.said: list[Any] = []

    def compose(self) -> ComposeResult:
        yield self.map
        yield Static("side", id="side")

    def on_map_view_resized(self, message: MapView.Resized) -> None:
        self.said.append(message)

    on_map_view_clicked = on_map_view_dragged = on_map_view_resized
    on_map_view_wheeled = on_map_view_hovered = on_map_view_resized

    def heard(self, kind: type) -> list[Any]:
        return [message for message in self.said if isinstance(message, kind)]


def run_in_harness(story: Callable[[MapHarness, Pilot[None]], Awaitable[None]]) -> None:
    async def run() -> None:
        stage = MapHarness()
        async with stage.run_test(size=(25, 6)) as pilot:
            await pilot.pause()
            await story(stage, pilot)

    asyncio.run(run())


def picture(*crosses: tuple[int, int], rows: int = 6, columns: int = 20) -> Codes:
    codes = np.full((rows, columns), BLANK)
    for row, column in crosses:
        codes[row, column] = CROSS
    return codes


def text_of(view: MapView) -> list[str]:
    return [strip.text for strip in view.render_lines(Region(0, 0, *view.size))]


def test_it_shows_the_last_picture_and_keeps_no_reference_to_it() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        codes = picture((1, 2))
        stage.map.present(codes)
        codes[:] = CROSS
        assert text_of(stage.map)[1] == "  #" + " " * 17
        codes = picture((1, 3), (5, 19))
        stage.map.present(codes)
        codes[:] = CROSS
        assert text_of(stage.map)[1] == "   #" + " " * 16
        assert text_of(stage.map)[5] == " " * 19 + "#"

    run_in_harness(story)


def test_a_screenshot_shows_the_picture() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        stage.map.present(picture((1, 2), (3, 4)))
        await pilot.pause()
        assert stage.export_screenshot().count(">#<") == 2
        assert "terminal" in stage.presenter.why_not

    run_in_harness(story)


def test_rows_that_did_not_change_are_not_made_again() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        stage.map.present(picture((1, 2)))
        before = [stage.map.render_line(row) for row in range(6)]
        stage.map.present(picture((4, 2), (1, 2)))
        after = [stage.map.render_line(row) for row in range(6)]
        kept = [old is new for old, new in zip(before, after, strict=True)]
        assert kept == [True, True, True, True, False, True]

    run_in_harness(story)


def test_a_picture_of_another_size_is_cut_or_filled_up() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        assert text_of(stage.map) == [" " * 20] * 6  # before the first picture
        stage.map.present(picture((0, 24), (0, 1), rows=9, columns=25))
        assert text_of(stage.map)[0] == " #" + " " * 18
        stage.map.present(picture((1, 4), rows=2, columns=5))
        assert text_of(stage.map) == [" " * 20, "    #" + " " * 15] + [" " * 20] * 4
        part = stage.map.render_lines(Region(3, 1, 4, 2))
        assert [strip.text for strip in part] == [" #  ", "    "]

    run_in_harness(story)


def test_other_colours_repaint_the_same_codes() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        stage.map.present(picture((1, 2)))
        before = stage.map.render_line(1)
        stage.map.set_appearance(Look(Depth.NONE, "dark"), UNICODE)
        after = stage.map.render_line(1)
        assert after.text == before.text
        assert all(segment.style is not None and segment.style.color is None for segment in after)

    run_in_harness(story)


def test_every_cell_has_a_style_of_its_own() -> None:
    """Textual 8.2 fails under NO_COLOR on a segment without style."""

    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        blank = stage.map.render_lines(Region(0, 0, 20, 6))
        stage.map.present(picture((1, 2), rows=3, columns=5))
        for strip in (*blank, *stage.map.render_lines(Region(0, 0, 20, 6))):
            assert all(segment.style is not None for segment in strip)

    run_in_harness(story)


def test_it_tells_its_size() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        await pilot.resize_terminal(35, 9)
        await pilot.pause()
        sizes = [(message.rows, message.columns) for message in stage.heard(MapView.Resized)]
        assert sizes[0] == (6, 20) and sizes[-1] == (9, 30)

    run_in_harness(story)


def test_clicks_say_where_with_what_and_how_often() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        await pilot.click(offset=(7, 2), shift=True)
        await pilot.click(offset=(9, 3), button=3)
        await pilot.click(offset=(5, 5), times=2)
        said = [
            (m.row, m.column, m.button, m.shift, m.double) for m in stage.heard(MapView.Clicked)
        ]
        assert said == [
            (2, 7, 1, True, False),
            (3, 9, 3, False, False),
            (5, 5, 1, False, False),
            (5, 5, 1, False, True),
        ]

    run_in_harness(story)


def test_a_drag_says_how_far_even_outside_and_is_no_click() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        async def mouse(kind: type[events.MouseEvent], column: int, row: int, button: int) -> None:
            # Through the app, which makes clicks of presses and releases.
            stage.post_message(kind(None, column, row, 0, 0, button, False, False, False))
            await pilot.pause()

        await mouse(events.MouseDown, 5, 2, 1)
        await mouse(events.MouseMove, 7, 2, 1)
        await mouse(events.MouseMove, 23, 1, 1)
        await mouse(events.MouseMove, 10, 1, 1)
        await mouse(events.MouseUp, 10, 1, 1)
        said = [(m.rows, m.columns, m.button) for m in stage.heard(MapView.Dragged)]
        assert said == [(0, 2, 1), (-1, 16, 1), (0, -13, 1)]
        assert not stage.heard(MapView.Clicked)
        await mouse(events.MouseMove, 12, 4, 0)
        assert (stage.said[-1].row, stage.said[-1].column) == (4, 12)  # hovering again
        await mouse(events.MouseDown, 3, 3, 1)
        await mouse(events.MouseUp, 3, 3, 1)
        assert len(stage.heard(MapView.Clicked)) == 1

    run_in_harness(story)


def test_hovering_is_told_once_for_each_cell() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        stage.said.clear()
        for column in (3, 3, 4):
            await pilot.hover(offset=(column, 1))
        said = [(m.row, m.column) for m in stage.heard(MapView.Hovered)]
        assert said == [(1, 3), (1, 4)]
        stage.map.post_message(events.Leave(stage.map))
        await pilot.pause()
        assert (stage.said[-1].row, stage.said[-1].column) == (-1, -1)

    run_in_harness(story)


def test_the_wheel_says_where_and_which_way() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        for kind in (events.MouseScrollUp, events.MouseScrollDown, events.MouseScrollRight):
            stage.map.post_message(kind(None, 4, 2, 0, 0, 0, False, False, True))
        await pilot.pause()
        said = [(m.row, m.column, m.direction, m.ctrl) for m in stage.heard(MapView.Wheeled)]
        assert said == [(2, 4, "up", True), (2, 4, "down", True), (2, 4, "right", True)]

    run_in_harness(story)


def test_an_error_while_drawing_ends_the_app() -> None:
    class Broken(MapHarness):
        def on_mount(self) -> None:
            FrameClock(self.presenter, lambda: bool(1 / 0), FramePacer()).start()

    async def run() -> None:
        async with Broken().run_test() as pilot:
            while pilot.app.is_running:
                await asyncio.sleep(0.01)

    try:
        asyncio.run(run())
    except ZeroDivisionError:
        return
    raise AssertionError("the error was lost")


def test_a_woken_clock_draws_at_once_and_a_stopped_one_never() -> None:
    async def story(stage: MapHarness, pilot: Pilot[None]) -> None:
        drawn = asyncio.Event()
        clock = FrameClock(stage.presenter, lambda: drawn.set() is None, FramePacer(fps=1))
        clock.start()
        await drawn.wait()
        drawn.clear()
        clock.pace.blurred = True
        clock.wake()
        await drawn.wait()
        assert clock.figures().allowed == 1
        clock.stop()
        drawn.clear()
        clock.wake()
        await pilot.pause(0.1)
        assert not drawn.is_set()

    run_in_harness(story)
