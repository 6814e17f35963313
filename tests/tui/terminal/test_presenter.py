"""What is on a terminal's screen after everything that can lie over the map, and what it costs.

Each story has `map_app.py` on a pty and compares the screen, cell by cell, with the picture
that the app intends. Stories that need no terminal of their own follow each other in one, in any
order: each begins and ends with robots that stand and nothing over the map.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from pseudo_terminal import MovingMapSession, moving_map

from tui.terminal.terminal_host import Arrived, TerminalLink

ESCAPE = "\x1b[27u"  # unlike the lone byte it cannot be taken for the start of a sequence
PALETTE = "\x10"
SIZE = (30, 100)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the app of most stories writes."""
    return tmp_path_factory.mktemp("map")


@pytest.fixture(scope="module")
def shared(folder: Path) -> Iterator[MovingMapSession]:
    rows, columns = SIZE
    with moving_map(folder, rows=rows, columns=columns) as session:
        yield session


@pytest.fixture
def session(shared: MovingMapSession) -> MovingMapSession:
    """A map at rest."""
    shared.host.wait_for(lambda: not shared.figures()["covered"], "the end of the story before")
    shared.wait_until_right()
    return shared


def test_nothing_is_written_while_nothing_happens(session: MovingMapSession) -> None:
    session.walk()
    session.press(" ")
    session.wait_until_right()
    session.host.wait_for_quiet(0.5)
    before = len(session.host.output())
    session.host.wait_for_quiet(2.5)
    assert len(session.host.output()) == before
    assert session.figures()["why_not"] == ""


def test_the_palette_lies_over_the_map_and_leaves_no_trace(session: MovingMapSession) -> None:
    session.walk()
    session.press(PALETTE)
    session.wait_for_text("Search for commands")
    session.wait_for_frames(8)
    session.press(ESCAPE)
    session.wait_for_text("Search for commands", present=False)
    session.press(" ")
    session.wait_until_right()


def test_a_toast_lies_over_the_map_and_leaves_no_trace(session: MovingMapSession) -> None:
    session.press("t")
    session.wait_for_text("a toast over the map")
    session.walk(8)
    session.press(" ")
    session.wait_until_right()
    assert session.figures()["covered"] and session.figures()["obstructed"]
    session.walk()
    session.press("t")
    session.wait_for_text("a toast over the map", present=False)
    session.press(" ")
    session.wait_until_right()
    assert not session.figures()["covered"]


def test_without_the_rule_of_occlusion_the_toast_is_spoiled(tmp_path: Path) -> None:
    """The other stories would notice: the map is written over what lies over it."""
    with moving_map(tmp_path, NAIVE="1") as session:
        session.press("t")
        session.wait_for_text("a toast over the map")
        session.walk()
        session.press(" ")
        session.host.wait_for_quiet(1.0)
        assert session.wrong()


def test_a_tooltip_lies_over_the_map_and_leaves_no_trace(session: MovingMapSession) -> None:
    session.point_at(5, 10)
    session.wait_for_text("tooltip of the map")
    session.turn_wheel(5, 10)  # walks; a key would take the tooltip away
    session.wait_for_frames(8)
    session.turn_wheel(5, 10)
    session.wait_until_right()
    assert session.figures()["covered"]
    session.point_at(5, 75)
    session.wait_for_text("tooltip of the map", present=False)
    session.walk()
    session.press(" ")
    session.wait_until_right()
    session.point_at(0, 75)  # where there is no tooltip


def test_a_dialog_lies_over_the_map_and_leaves_no_trace(session: MovingMapSession) -> None:
    session.walk()
    session.press("o")
    session.wait_for_text("question")
    session.wait_for_frames(8)
    session.press(ESCAPE)
    session.wait_for_text("question", present=False)
    session.press(" ")
    session.wait_until_right()


def test_a_storm_of_sizes_ends_in_the_right_picture(session: MovingMapSession) -> None:
    session.walk()
    for rows, columns in [(20, 90), (40, 120), (25, 60), (40, 120), (20, 40), (40, 120)]:
        session.host.resize(rows, columns)
        session.host.wait_for_quiet(0.005)
    session.press(" ")
    session.wait_until_right()
    session.host.resize(*SIZE)
    session.wait_until_right()


def test_the_same_size_again_repaints_what_the_terminal_cut_off(session: MovingMapSession) -> None:
    session.host.resize(20, 60)
    session.host.resize(*SIZE)
    session.wait_until_right()


def test_a_panel_beside_the_map_comes_and_goes(session: MovingMapSession) -> None:
    session.walk()
    for _ in range(4):
        session.press("b")
        session.figures()
    session.press(" ")
    session.wait_until_right()


def test_whole_pictures_change(session: MovingMapSession) -> None:
    session.walk()
    session.press("zzzzz ")
    session.wait_until_right()


def test_a_screenshot_while_playing_changes_nothing(
    session: MovingMapSession, folder: Path
) -> None:
    session.walk()
    session.press("sss")
    session.figures()
    session.press(" ")
    session.wait_until_right()
    assert "</svg>" in (folder / "dump.svg").read_text()


@pytest.mark.parametrize(
    "environ",
    [
        {"NO_COLOR": "1"},
        {"COLORTERM": "", "TERM": "xterm"},
        {"COLORTERM": "", "TERM": "xterm-256color"},
        {"LANG": "C", "PYTHONIOENCODING": "utf-8"},
        {"RENDERER": "textual"},
    ],
    ids=["no colour", "16 colours", "256 colours", "ASCII", "compositor"],
)
def test_every_terminal_shows_the_picture(tmp_path: Path, environ: dict[str, str]) -> None:
    with moving_map(tmp_path, rows=24, columns=80, synchronized=False, **environ) as session:
        session.walk()
        session.press("t")
        session.wait_for_text("a toast over the map")
        session.press("t")
        session.wait_for_text("a toast over the map", present=False)
        session.press(" ")
        session.wait_until_right()


def test_the_hidden_cursor_stays_where_textual_put_it(session: MovingMapSession) -> None:
    session.walk()
    session.press(" ")
    session.wait_until_right()
    cursor = session.replay.screen.cursor
    assert [cursor.x, cursor.y] == session.figures()["cursor"]


@pytest.mark.parametrize(("robots", "budget"), [(100, 2500), (1000, 15000)])
def test_bytes_of_a_frame(tmp_path: Path, robots: int, budget: int) -> None:
    with moving_map(tmp_path, rows=60, columns=230, robots=robots) as session:
        before = session.figures()
        session.walk(50)
        after = session.figures()
        spent = after["bytes"] - before["bytes"]
        assert spent / (after["frames"] - before["frames"]) <= budget


def test_a_slow_link_never_holds_more_than_two_frames(tmp_path: Path) -> None:
    line = TerminalLink(bytes_per_second=125_000, round_trip=0.05)
    with moving_map(tmp_path, rows=60, columns=200, robots=1000, link=line) as session:
        session.host.max_backlog = session.host.max_frames = 0
        session.walk(12)
        session.press(" ")
        figures = session.figures()
        assert session.host.max_backlog <= 2 * 15_000
        assert session.host.max_frames <= 2
        assert figures["skipped"] > 0
        session.wait_until_right()


def test_a_terminal_that_never_answers_gets_frames_all_the_same(tmp_path: Path) -> None:
    with moving_map(tmp_path, answers=False) as session:
        session.walk(10)
        session.press(" ")
        session.wait_until_right()
        assert all(
            b"2026h" not in event.data
            for event in session.host.history
            if isinstance(event, Arrived)
        )
