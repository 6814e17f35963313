"""What the viewer says about a run: its name, how it ended, where it was branched off."""

from __future__ import annotations

import asyncio
import threading
import xml.etree.ElementTree as ET
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path

import pytest
from action_cases import said
from viewer_harness import Watched, compared, mini, record, screen_text, viewing

from automaton import atomic_write
from automaton.history.watched_run import WatchedRun
from automaton.recording.recording_reader import read_recording
from automaton.world.resolve import resolve
from tui.playback.frame_cache import Pictures
from tui.playback.run_source import Opening, live, recorded
from tui.render.styles import UNICODE
from tui.terminal.options import Options
from tui.viewer.app import Viewer
from tui.widgets.status import head_words

NARROW = (80, 24)
SVG = "{http://www.w3.org/2000/svg}"


def story(
    tell: Callable[[Watched], Awaitable[None]],
    opening: Opening | None = None,
    size: tuple[int, int] = NARROW,
    options: Options | None = None,
) -> None:
    async def told() -> None:
        async with viewing(opening, size, options, toasts=True) as user:
            await tell(user)

    asyncio.run(told())


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


async def branched(user: Watched, setting: str) -> None:
    user.app.branches.take((setting,))
    await user.until(lambda: any(mark.kind == "branch" for mark in user.session.marks))


def test_the_message_that_a_key_ends_takes_no_frame_from_its_effect() -> None:
    """Requested frames have a minimum interval, so one for the line alone would delay the next."""

    async def tell(user: Watched) -> None:
        user.display.notices.say("a message")
        await user.until(lambda: "a message" in said(user.display.info))
        user.display.frames._alarm.clear()
        user.display.notices.end()
        assert not user.display.frames._alarm.is_set()
        await user.until(lambda: "a message" not in said(user.display.info))

    story(tell)


def test_keys_of_layers_and_panels_wait_for_the_world() -> None:
    """In the sequence in which they were pressed; a key that takes no world does its work at once."""
    may_begin = threading.Event()
    opening = mini()

    def begin() -> list[WatchedRun]:
        may_begin.wait()
        return opening.begin()

    async def told() -> None:
        app = Viewer(replace(opening, begin=begin), Options(paused=True, color="true"))
        try:
            async with app.run_test(size=NARROW, notifications=True) as pilot:
                user = Watched(app, pilot)
                zoom = user.session.pictures.camera.zoom
                for key, label in (
                    ("f3", "Visits"),
                    ("L", "Layer"),
                    ("i", "Inspect"),
                    ("i", "Inspect"),
                ):
                    await user.press(key)
                    words = f"{label}: as soon as the world is built"
                    await user.until(lambda words=words: words in user.toasts())
                await user.press("plus")
                await user.until(lambda: user.session.pictures.camera.zoom != zoom)
                assert (user.session.choice.layer, user.display.column) == ("", None)
                may_begin.set()
                await user.until(lambda: user.session.choice.layer == "waiting")
                await user.until(lambda: user.app.panels.opened)
                assert user.display.column is not None
                assert user.display.column.name_open == "inspector"
        finally:
            may_begin.set()
            app.session.close()

    asyncio.run(told())


def test_a_hint_about_a_layer_goes_when_it_was_followed() -> None:
    async def tell(user: Watched) -> None:
        for key, hint, away in (
            ("E", "select a robot, and the search for its way is shown", "right_parenthesis"),
            ("P", "cells through which 2 or more other robots will drive", "f2"),
        ):
            await user.press(key)
            await user.until(lambda hint=hint: hint in screen_text(user.app))
            await user.press(away)
            await user.shown()
            assert hint not in screen_text(user.app)

    story(tell)


def test_a_branch_changes_the_title_and_forgets_the_marks_of_the_future_left(folder: Path) -> None:
    async def tell(user: Watched) -> None:
        from automaton.history.breakpoints import breakpoint_of

        for tick in (100, 200):
            await user.at(tick)
            user.session.player.set_breakpoints(
                [breakpoint_of("delivered"), breakpoint_of("loaded")]
            )
            stops = user.session.playback.stops
            user.session.player.play()
            user.session.player.set_speed(64)
            await user.until(lambda stops=stops: user.session.playback.stops > stops)
        early, late = (mark.tick for mark in user.session.marks)
        await user.at(late - 1)
        await branched(user, "strategy.right_of_way=retreat")
        assert [(mark.tick, mark.kind) for mark in user.session.marks] == [
            (early, "stop"),
            (late - 1, "branch"),
        ]
        await user.shown()
        wanted = f"right_of_way=wait, from tick {late - 1} right_of_way=retreat"
        assert wanted in said(user.display.title_line)
        notice = next(text for text in user.toasts() if "recorded" in text)
        command = "automaton replay run.rec run-branch.rec"
        assert notice == f"the branch is recorded in run-branch.rec; to compare: {command}"

    opening = live(resolve("tabletop-mini", ("strategy.right_of_way=wait",)), folder / "run.rec")
    story(tell, opening, (120, 36))


def test_a_branch_of_a_recording_is_live_and_recorded_beside_it(folder: Path) -> None:
    async def tell(user: Watched) -> None:
        await user.at(150)
        await branched(user, "durations.pick=30")
        await user.until(lambda: "recording" in said(user.display.status))
        assert user.session.recordings == [folder / "one-branch.rec"]

    story(tell, recorded(record(folder / "one.rec", until=300)), (120, 36))
    assert "durations.pick=30" in recorded(folder / "one-branch.rec").titles[0]


@pytest.mark.parametrize(
    ("settings", "word"), [((), "finished"), (("stop.max_duration=200",), "limit reached")]
)
def test_a_run_that_has_ended_says_how(settings: tuple[str, ...], word: str) -> None:
    async def tell(user: Watched) -> None:
        user.app.clock.go_to(999_999)
        await user.until(lambda: said(user.display.status).rstrip().endswith(word))
        end = user.tick
        await user.until(lambda: f"the run ends at tick {end:,};" in said(user.display.info))
        await user.press("space")
        await user.until(lambda: f"{word} at tick {end:,}; r plays" in said(user.display.info))
        assert not user.app._notifications and user.session.playback.playing == 0

    story(tell, mini(*settings))


def test_a_tick_after_the_end_that_was_asked_for_at_the_start() -> None:
    async def tell(user: Watched) -> None:
        await user.until(lambda: "the run ends at tick 200;" in said(user.display.info))

    story(tell, mini("stop.max_duration=200"), options=Options(at=999_999, color="true"))


def test_a_recording_says_whether_it_ended_or_was_cut_short(folder: Path) -> None:
    whole, cut = record(folder / "whole.rec", until=200), folder / "cut.rec"
    cut.write_bytes(whole.read_bytes()[:-20])
    assert not read_recording(cut).complete

    async def ended(user: Watched) -> None:
        await user.until(lambda: said(user.display.status).rstrip().endswith("replay"))
        await user.press("end")
        await user.until(lambda: said(user.display.status).rstrip().endswith("ended"))

    async def cut_short(user: Watched) -> None:
        await user.until(lambda: said(user.display.status).rstrip().endswith("cut short"))
        user.session.choose(1)
        await user.press("f3")
        await user.shown()
        assert said(user.display.status).rstrip().endswith("cut short")

    story(ended, recorded(whole))
    story(cut_short, recorded(cut))


def test_on_the_way_to_a_tick_the_line_says_how_far_it_is_and_escape_stops_there() -> None:
    async def tell(user: Watched) -> None:
        user.app.clock.go_to(40_000_000)
        await user.until(lambda: "going to 40,000,000: " in said(user.display.info))
        await user.press("escape")
        await user.until(lambda: "going" not in said(user.display.info))
        assert user.session.goal is None and user.tick < 40_000_000

    story(tell, mini("stop={when: never, max_duration: 50000000}"))


def test_a_message_goes_with_the_next_key() -> None:
    async def tell(user: Watched) -> None:
        await user.press("d")
        await user.until(lambda: "no deadlock so far" in said(user.display.info))
        await user.press("plus")
        await user.until(lambda: "no deadlock" not in said(user.display.info))

    story(tell)


def test_a_run_that_can_only_repeat_a_deadlock_says_so_and_leads_to_its_beginning() -> None:
    async def tell(user: Watched) -> None:
        user.app.clock.go_to(9000)
        await user.until(
            lambda: "deadlock since tick 158 can only repeat" in said(user.display.info)
        )
        assert said(user.display.status).rstrip().endswith("deadlocked")
        await user.press("d")
        await user.until(lambda: user.tick == 158)

    stuck = resolve("tabletop-1", ("fleet.robots=5", "strategy.right_of_way=wait"))
    story(tell, live(stuck, None))


def test_short_notices_are_in_the_line_and_long_ones_over_the_map() -> None:
    async def tell(user: Watched) -> None:
        await user.at(120)
        await user.press("f8")
        await user.until(lambda: "routes are hidden" in said(user.display.info))
        assert not user.app._notifications
        await user.until(lambda: "routes" not in said(user.display.info))
        user.app.notify("[something] long " * 8)
        await user.until(lambda: "[something]" in screen_text(user.app))
        await user.shown()
        rows = screen_text(user.app).splitlines()
        assert "[something]" in "".join(rows[:10])
        assert rows[-3].startswith("||  x1 10/s  tick 120") and "[something]" not in rows[-3]

    story(tell)


def test_what_failed_stays_in_the_line_whatever_is_selected() -> None:
    async def tell(user: Watched) -> None:
        user.app.clock.go_to(400)
        await user.until(lambda: "own mistake" in said(user.display.info))
        user.session.choose(cell=user.session.pictures.camera.floor_plan.cell(1, 4))
        await user.shown()
        assert "own mistake" in said(user.display.info)
        for _ in range(3):
            await user.press("space")
            await user.shown()
        assert len(user.app._notifications) == 1
        status = screen_text(user.app).splitlines()[-3]
        assert status.startswith("||  x1 10/s  tick 49") and status.rstrip().endswith("failed")

    failing = resolve("tabletop-1", ("strategy.right_of_way=example_strategies:FailsLater",))
    story(tell, live(failing, None), (140, 24))


def test_a_capture_that_cannot_be_finished_leaves_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(part: Path, path: Path, durable: bool) -> None:
        assert part.exists()
        raise OSError(28, "No space left on device")

    async def tell(user: Watched) -> None:
        monkeypatch.setattr(atomic_write, "put_in_place", full)
        told = "cannot save the picture: No space left on device"
        for key in "sS":
            await user.press(key)
            await user.until(lambda: told in said(user.display.info))
            user.display.notices.notice = None

    story(tell)
    assert not list(folder.iterdir())


def test_alone_a_run_says_how_two_are_compared() -> None:
    async def tell(user: Watched) -> None:
        for key in "xo":
            user.display.notices.notice = None
            await user.press(key)
            assert user.toasts() == ["two recordings are compared by: automaton replay A B"]

    story(tell)


def test_heads_of_compared_runs_never_touch(folder: Path) -> None:
    async def tell(user: Watched) -> None:
        await user.shown()
        heads = [said(head) for head in user.display.heads]
        assert heads[0].startswith("A a.rec: right_of_way=retreat  tabletop")
        assert heads[1].startswith("B b.rec: right_of_way=wait")
        await user.pilot.resize_terminal(170, 40)
        await user.shown()
        left, right = user.display.heads
        assert left.region.right == right.region.x
        assert said(left).rstrip() == "A a.rec: right_of_way=retreat"
        assert head_words("A a.rec: right_of_way=wait", "", 20)[0].text == "A a.rec: right_of..."

    story(tell, compared(folder), (200, 60))


@pytest.mark.parametrize(
    ("rows", "columns", "split"),
    [(20, 80, "horizontal"), (20, 200, "horizontal"), (40, 90, "vertical"), (19, 60, "vertical")],
)
def test_two_maps_are_split_so_that_they_are_larger(
    folder: Path, rows: int, columns: int, split: str
) -> None:
    pictures = Pictures(compared(folder), UNICODE)
    assert pictures.split(rows, columns) == split


def test_maps_of_a_tall_floor_stand_side_by_side_on_a_narrow_screen(folder: Path) -> None:
    tall = ("layout.tables=2", "layout.positions=14")

    async def tell(user: Watched) -> None:
        await user.shown()
        left, right = user.display.maps
        assert left.region.y == right.region.y and left.region.x < right.region.x

    story(tell, recorded(*(record(folder / f"{n}.rec", *tall, until=20) for n in "ab")))


def test_the_play_sign_in_ascii_is_an_arrow() -> None:
    async def tell(user: Watched) -> None:
        await user.press("space")
        await user.until(lambda: said(user.display.status).startswith(">  x1 10/s  tick"))

    story(tell, options=Options(paused=True, ascii=True, color="true"))


def test_captures_name_the_run_and_need_no_internet(folder: Path) -> None:
    async def tell(user: Watched) -> None:
        await user.at(120)
        await user.press("S", "s")
        await user.until(lambda: list(folder.glob("*.svg")))

    story(tell)
    text = next(folder.glob("*.txt")).read_text(encoding="utf-8")
    assert text.splitlines()[0] == "tabletop-mini, 3 robots, seed 1, tick 120"
    svg = next(folder.glob("*.svg")).read_text(encoding="utf-8")
    assert "url(http" not in svg and "@font-face" not in svg and "<script" not in svg
    words = [word.text or "" for word in ET.fromstring(svg).iter(f"{SVG}text")]
    assert words[0] == "automaton: tabletop-mini"
    assert any(word.startswith("tick ") for word in words[1:])  # in the line of the clock
