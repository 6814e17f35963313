"""When the map is written past the compositor, and what exactly; with a terminal made of a list."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from queue import Queue
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from textual.app import App, ComposeResult
from textual.containers import Container, VerticalScroll
from textual.drivers.headless_driver import HeadlessDriver
from textual.pilot import Pilot
from textual.screen import ModalScreen
from textual.widgets import Static
from viewer_harness import viewing

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
from tui.terminal import map_view
from tui.terminal.frame_pacing import FrameClock, FramePacer
from tui.terminal.map_view import MapView, Presenter
from tui.terminal.options import Renderer

WRITTEN: list[str] = []


class ListDriver(HeadlessDriver):
    """Not headless for Textual: what it writes lands in a list."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._writer_thread = SimpleNamespace(_queue=Queue())

    @property
    def is_headless(self) -> bool:
        return False

    def write(self, data: str) -> None:
        WRITTEN.append(data)


class OlderDriver(ListDriver):
    """One without the names that the presenter needs."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        del self._writer_thread


class Stage(App[None]):
    """A map with something above it in another layer, which can be moved or hidden."""

    CSS = """
    Screen { layers: below above; }
    #frame { layer: below; width: 20; height: 6; }
    #over { layer: above; width: 5; height: 1; offset: 0 8; }
    #list { layer: above; width: 9; height: 1; offset: 9 8; }
    """

    def __init__(self, driver: type[HeadlessDriver], renderer: Renderer = "auto") -> None:
        super().__init__(driver_class=driver)
        self.presenter = Presenter(self, renderer)
        self.map = MapView(self.presenter, Look(Depth.TRUE, "dark"), UNICODE)

    def compose(self) -> ComposeResult:
        yield Container(self.map, id="frame")
        yield Static("above", id="over")
        yield VerticalScroll(Static("line\n" * 20), id="list")

    def writes(self, codes: Codes) -> list[str]:
        """What presenting these codes writes at once; the compositor would write later."""
        del WRITTEN[:]
        self.map.present(codes)
        return WRITTEN.copy()


Story = Callable[[Stage, Pilot[None]], Awaitable[None]]


def on_stage(
    story: Story, driver: type[HeadlessDriver] = ListDriver, renderer: Renderer = "auto"
) -> None:
    async def run() -> None:
        stage = Stage(driver, renderer)
        async with stage.run_test(headless=False, size=(30, 10)) as pilot:
            await pilot.pause()
            stage.map.present(next(PICTURES))
            await pilot.pause()
            await story(stage, pilot)

    asyncio.run(run())


def pictures() -> Iterator[Codes]:
    """Pictures of 6 x 20 cells, each with one mark that the one before has not."""
    cell = 0
    while True:
        codes = np.full(
            120, code(style(COLOUR_TRACK, COLOUR_FLOOR), UNICODE.characters.index(" ")), np.uint32
        )
        codes[cell % 120] = code(style(COLOUR_ROBOT, COLOUR_FLOOR), UNICODE.characters.index("#"))
        yield codes.reshape(6, 20)
        cell += 7


PICTURES = pictures()


def test_a_free_map_is_written_at_once_and_the_cursor_put_back() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        assert stage.presenter.why_not == ""
        (written,) = stage.writes(next(PICTURES))
        assert written.startswith("\x1b7") and written.endswith("\x1b8")
        assert written.count("#") == 1 and len(written) < 100
        assert stage.writes(stage.map.shown.copy()) == []  # type: ignore[union-attr]

    on_stage(story)


def test_a_terminal_that_can_shows_the_frame_as_one() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        stage._sync_available = True
        (written,) = stage.writes(next(PICTURES))
        assert written.startswith("\x1b[?2026h\x1b7") and written.endswith("\x1b8\x1b[?2026l")

    on_stage(story)


def test_a_frame_of_two_pictures_is_one_write() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        del WRITTEN[:]
        with stage.presenter.frame() as frame:
            stage.map.present(next(PICTURES))
            stage.map.present(next(PICTURES))
            frame.acknowledged = True
        assert len(WRITTEN) == 1 and WRITTEN[0].endswith("\x1b8\x1b[6n")
        assert frame.size == len(WRITTEN[0]) and frame.asked

    on_stage(story)


def test_where_there_is_no_terminal_nobody_is_asked() -> None:
    async def story() -> None:
        async with viewing() as user:
            with user.display.presenter.frame() as frame:
                frame.acknowledged = True
            assert not frame.asked

    asyncio.run(story())


def test_whatever_overlaps_the_map_hands_it_to_the_compositor() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        over = stage.query_one("#over")
        for offset, free in [((0, 5), False), ((19, 0), False), ((20, 0), True), ((0, 6), True)]:
            over.styles.offset = offset
            await pilot.pause(0.1)
            assert bool(stage.writes(next(PICTURES))) is free, offset
            assert stage.presenter.obstructed is not free
        over.styles.offset = (0, 0)
        over.display = False
        await pilot.pause(0.1)
        assert stage.writes(next(PICTURES))

    on_stage(story)


def test_lines_scrolled_out_of_sight_do_not_cover_the_map() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        stage.query_one("#list").scroll_to(y=5, animate=False)
        await pilot.pause(0.1)
        assert stage.query_one("#list > Static").region.overlaps(stage.map.region)
        assert stage.writes(next(PICTURES))

    on_stage(story)


def test_nothing_is_written_once_the_app_has_ended() -> None:
    """Between the last message and the last task the terminal is already the shell's again."""

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        stage._running = False
        assert stage.writes(next(PICTURES)) == []
        stage._running = True

    on_stage(story)


def test_a_map_that_is_cut_or_hidden_is_left_to_the_compositor() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        stage.map.styles.width, stage.map.styles.min_height = 25, 8
        await pilot.pause(0.1)
        assert stage.writes(np.tile(next(PICTURES), (2, 2))[:8, :25]) == []
        assert stage.writes(np.tile(next(PICTURES), (2, 2))[:8, :25]) == []
        stage.map.styles.width, stage.map.styles.min_height = 20, None
        stage.map.loading = True
        await pilot.pause(0.1)
        stage.writes(next(PICTURES))
        assert stage.writes(next(PICTURES)) == []

    on_stage(story)


def test_a_picture_of_another_size_than_the_map_is_left_to_the_compositor() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        for part in (np.s_[:4], np.s_[:, :9]):
            assert stage.writes(next(PICTURES)[part]) == []
            assert stage.writes(next(PICTURES)[part]) == []

    on_stage(story)


def test_nothing_is_written_behind_a_dialog_or_during_a_batch() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        with stage.batch_update():
            assert stage.writes(next(PICTURES)) == []
        assert stage.writes(next(PICTURES))
        await stage.push_screen(ModalScreen())
        assert stage.writes(next(PICTURES)) == []
        stage.pop_screen()
        await pilot.pause(0.2)
        assert stage.writes(next(PICTURES))

    on_stage(story)


def test_rows_of_the_map_are_made_only_when_they_are_painted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made: list[int] = []
    runs = map_view.runs
    monkeypatch.setattr(map_view, "runs", lambda *row: made.append(1) or runs(*row))

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        over = stage.query_one("#over", Static)
        over.styles.offset = (22, 0)  # beside the map, in its first row
        stage.map.present(next(PICTURES))
        await pilot.pause(0.1)
        del made[:]
        stage.map.present(stage.map.shown[::-1])  # type: ignore[index]
        over.update("other")
        await pilot.pause(0.1)
        assert "other" in "".join(WRITTEN)
        assert not made
        stage.map.refresh()
        await pilot.pause(0.1)
        assert made

    on_stage(story)


def test_without_its_private_names_the_compositor_draws_and_says_so() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        assert "_writer_thread" in stage.presenter.why_not
        assert stage.writes(next(PICTURES)) == []
        picture = next(PICTURES)
        stage.map.present(picture)
        await pilot.pause(0.1)
        assert "#" in "".join(WRITTEN)

    on_stage(story, OlderDriver)


def test_the_compositor_can_be_asked_for() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        assert stage.presenter.why_not == "asked for"
        assert stage.writes(next(PICTURES)) == []

    on_stage(story, renderer="textual")


def test_a_clock_with_nothing_to_draw_writes_nothing() -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        looked = asyncio.Event()
        clock = FrameClock(stage.presenter, lambda: looked.set() is not None, FramePacer(60))
        del WRITTEN[:]
        clock.start()
        for _ in range(5):
            looked.clear()
            await looked.wait()
        clock.stop()
        assert WRITTEN == []

    on_stage(story)


@pytest.mark.parametrize(("queued", "drawn"), [(2, True), (3, False)])
def test_a_clock_waits_while_the_writer_thread_is_behind(queued: int, drawn: bool) -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        for _ in range(queued):
            stage._driver._writer_thread._queue.put("")  # type: ignore[union-attr]
        frames: list[bool] = []
        clock = FrameClock(stage.presenter, lambda: bool(frames.append(True)), FramePacer(60))
        clock.start()
        await pilot.pause(0.1)
        clock.stop()
        assert bool(frames) is drawn
        assert bool(clock.pace.skipped) is not drawn

    on_stage(story)
