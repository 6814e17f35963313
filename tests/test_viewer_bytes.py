"""What the viewer itself sends: bytes per frame of a walking fleet, and silence when nothing moves."""

from __future__ import annotations

import re
import time
from typing import Any

import pytest

from tui.bench.session import Session
from tui.bench.viewer import fleet

FRAMES = 60
LINES = 4  # below the map: what the mouse is over, figures, time, keys

LIMITS = [  # robots, size of the floor, bytes per frame at most
    ({**fleet(100), "width": 198}, 2_500),
    ({**fleet(1000), "width": 198}, 15_000),
    ({**fleet(1000), "width": 1000, "height": 1000}, 3_000),
]


@pytest.mark.parametrize(("walk", "limit"), LIMITS, ids=["100", "1000", "1000 far away"])
def test_a_frame_in_which_all_robots_move_is_small(walk: dict[str, Any], limit: int) -> None:
    with Session({**walk, "panels": False}) as session:
        size = frames = 0
        while frames < FRAMES:
            more, counted, _ = session.watch(1.0)
            size, frames = size + more, frames + counted
        assert 100 < size / frames < limit  # and something was sent


def test_a_paused_viewer_sends_nothing() -> None:
    with Session(fleet(100)) as session:
        session.host.send(" ")
        session.host.wait_for_quiet(1.5)
        before = len(session.host.output())
        time.sleep(5.0)
        assert len(session.host.output()) == before


def test_a_run_in_which_nobody_moves_sends_no_map() -> None:
    """Only the lines below the map go on: the tick is another one."""
    with Session({**fleet(1), "width": 1, "height": 1, "panels": False}) as session:
        before = len(session.host.output())
        session.watch(3.0)
        data = session.host.output()[before:]
    rows = {int(row) for row in re.findall(rb"\x1b\[(\d+);\d+H", data)}
    assert rows and min(rows) > session.host.rows - LINES
