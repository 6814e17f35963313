"""With --ascii not one byte beyond ASCII gets to the terminal, whatever is shown."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_in_terminal import automaton
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.segment import ControlType, Segment
from textual.color import Color

from tui.render.styles import to_ascii
from tui.viewer.app import AsciiOnly

NAMED = """\
name: Förderhöhe
layout:
  picture: |
    b......d
    b.ssss.d
    b......d
fleet: {robots: 2}
durations: {move: 4}
"""


@given(st.text())
def test_every_text_is_spelled_in_ascii_as_many_columns_wide(text: str) -> None:
    assert to_ascii(text).isascii() and cell_len(to_ascii(text)) == cell_len(text)


@pytest.mark.parametrize(
    ("text", "ascii"),
    [
        ("╭─┬─╮", "+-+-+"),
        ("│┃▏▌", "||||"),
        ("Förderhöhe", "Forderhohe"),
        ("cut short…", "cut short~"),
        ("🔎 Search", "/  Search"),
        ("\u65e5\u672c", "????"),  # letters of two columns
        ("> plain ASCII + stays.", "> plain ASCII + stays."),
    ],
)
def test_what_looks_like_what(text: str, ascii: str) -> None:
    assert to_ascii(text) == ascii
    assert AsciiOnly().apply([Segment(text)], Color(0, 0, 0)) == [Segment(ascii)]


def test_control_codes_pass() -> None:
    control = Segment("\u2500", None, [(ControlType.CURSOR_MOVE_TO, 0, 0)])
    assert AsciiOnly().apply([control], Color(0, 0, 0)) == [control]


@pytest.fixture
def short_path() -> Iterator[Path]:
    """A folder whose path fits into a toast as a whole."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def test_no_byte_beyond_ascii_leaves_the_viewer(short_path: Path) -> None:
    scenario, state = short_path / "floor.yaml", short_path / "Zustände"
    scenario.write_text(NAMED, encoding="utf-8")
    arguments = ("watch", str(scenario), "--ascii", "--at", "40", "--read-only")
    size = {"rows": 36, "columns": 120}
    with automaton(state, *arguments, **size) as session:  # type: ignore[arg-type]
        for keys, text in (
            ("", "Forderhohe"),
            ("", "throughput"),
            ("e", "F filters"),
            ("t", "doing"),
            ("K", "robot with a load"),
            (")w", "robot 0"),
            ("i", "heading"),
            ("p", "all metrics"),
            ("pp", "tick 40"),
            ("\x10", "Search for commands"),
            ("\x1b", "-Search for commands"),
            ("?", "Play backwards"),
            ("\x1b", "-Play backwards"),
            ("b", "the run stops where"),
            ("stalled > 50\r", "+ stalled > 50"),
            ("\x1b", "-+ stalled > 50"),
            ("/", "Go there"),
            ("\x1b", "-Go there"),
            ("s", "Zustande"),  # a toast with the path of the picture
            ("q", ""),
        ):
            session.press(keys)
            session.wait_for_text(text.removeprefix("-"), not text.startswith("-"))
            assert session.host.output().isascii(), (keys, text)
        assert session.host.wait_for_end() == 0
        output = session.host.output()
        assert output[: output.rindex(b"\x1b[?1049l")].isascii()
