"""The modelled terminal: what it counts on the way."""

from __future__ import annotations

import sys

from hypothesis import given
from hypothesis import strategies as st

from tui.terminal.terminal_host import FRAME_END, MarkerCount, TerminalHost, TerminalLink

WRITES = r"print(('x' * 300 + '\x1b[6n') * 5)"


@given(st.lists(st.sampled_from([b"", b"\x1b", b"\x1b[", b"[6n", b"6n", b"n", FRAME_END, b"map"])))
def test_a_marker_is_counted_once_however_it_is_cut(pieces: list[bytes]) -> None:
    marks = MarkerCount(FRAME_END)
    assert sum(marks.count(piece) for piece in pieces) == b"".join(pieces).count(FRAME_END)


def test_frames_in_front_of_a_slow_link_are_counted() -> None:
    link = TerminalLink(bytes_per_second=20_000)
    with TerminalHost([sys.executable, "-c", WRITES], link=link) as host:
        host.wait_for_end()
    assert host.max_frames == 5 and host.max_backlog > 1000
    assert host._frames == 0 and host.output().count(FRAME_END) == 5
