"""What the viewer itself sends: bytes per frame of a walking fleet, and silence when nothing moves."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tui.bench import viewer_speed
from tui.bench.viewer_speed import MeasuredViewer, cursor_colour, fleet
from tui.terminal.terminal_host import FRAME_END

FRAMES = 40
FRAMES_OF_NOBODY = 20
ANSWER = "\x1b[?2026;2$y"  # of a terminal: it goes through the viewer's loop, and means nothing
ANSWERS = 200
LINES = 6  # below the map: what the mouse is over, metrics, time with its strip, keys

WIDE = {"width": 198, "panels": False}
LIMITS = [  # robots, size of the floor, bytes per frame at most
    ({**fleet(1000), **WIDE}, 15_000),
    ({**fleet(1000), **WIDE, "width": 1000, "height": 1000}, 3_000),
]


@pytest.fixture(autouse=True)
def settled_sooner(monkeypatch: pytest.MonkeyPatch) -> None:
    """No time is measured here: what a viewer still has to import does not matter."""
    monkeypatch.setattr(viewer_speed, "SETTLE_S", 1.5)


def bytes_of_a_frame(session: MeasuredViewer) -> float:
    """Mean of the frames of a while."""
    size = frames = 0
    while frames < FRAMES:
        more, counted, _ = session.watch(0.5)
        size, frames = size + more, frames + counted
    return size / frames


@pytest.mark.parametrize(("walk", "limit"), LIMITS, ids=["1000", "1000 far away"])
def test_a_frame_in_which_all_robots_move_is_small(walk: dict[str, Any], limit: int) -> None:
    with MeasuredViewer(walk) as session:
        assert 100 < bytes_of_a_frame(session) < limit  # and something was sent


def test_a_frame_of_100_robots_is_small_and_paused_nothing_is_sent_until_something_changes() -> (
    None
):
    """The first frame after the pause is that of the next key, whatever else the viewer hears."""
    with MeasuredViewer({**fleet(100), **WIDE}) as session:
        assert 100 < bytes_of_a_frame(session) < 2_500
        session.host.send(" ")
        session.host.wait_for_quiet(1.5)
        before = len(session.host.output())
        for _ in range(ANSWERS):
            session.host.send(ANSWER)
        session.host.send("i")
        session.host.wait_for(lambda: FRAME_END in session.host.output()[before:], "a frame")
        frame, _, _ = session.host.output()[before:].partition(FRAME_END)
        assert cursor_colour() in frame


def test_a_run_in_which_nobody_moves_sends_no_map() -> None:
    """Only the lines below the map go on: the tick is another one."""
    with MeasuredViewer({**fleet(1), "width": 1, "height": 1, "panels": False}) as session:
        before = len(session.host.output())

        def sent() -> bytes:
            return session.host.output()[before:]

        session.host.wait_for(lambda: sent().count(FRAME_END) >= FRAMES_OF_NOBODY, "frames")
        data = sent()
    rows = {int(row) for row in re.findall(rb"\x1b\[(\d+);\d+H", data)}
    assert rows and min(rows) > session.host.rows - LINES
