"""The theme that fits the terminal's background."""

from __future__ import annotations

import sys

import pytest

from tui.terminal.terminal_host import TerminalHost
from tui.terminal.themes import theme_of

ASKS = (
    "import os; from tui.terminal.themes import *;"
    "print('it is', theme_of(os.environ, asked_background()))"
)


@pytest.mark.parametrize(
    ("answer", "environ", "theme"),
    [
        (b"\x1b]11;rgb:ffff/ffff/ffff\x1b\\\x1b[?62c", {}, "light"),
        (b"\x1b]11;rgb:fd/f6/e3\x07\x1b[?1;2c", {"COLORFGBG": "15;0"}, "light"),
        (b"\x1b]11;rgb:0000/2b2b/3636\x1b\\\x1b[?62c", {"COLORFGBG": "0;15"}, "dark"),
        (b"\x1b]11;rgba:ffff/ffff/0000/ffff\x1b\\", {}, "light"),
        (b"\x1b[?62c", {"COLORFGBG": "0;default;15"}, "light"),
        (b"\x1b[?62c", {"COLORFGBG": "15;0"}, "dark"),
        (b"", {}, "dark"),
    ],
)
def test_the_answer_of_the_terminal_decides_then_the_environment(
    answer: bytes, environ: dict[str, str], theme: str
) -> None:
    assert theme_of(environ, answer) == theme


@pytest.mark.parametrize("answers", [True, False])
def test_a_terminal_that_does_not_know_its_background_is_dark(answers: bool) -> None:
    with TerminalHost([sys.executable, "-c", ASKS], rows=9, columns=40, answers=answers) as host:
        host.wait_for(lambda: b"it is dark" in host.output(), "the theme")
