"""The user's file of settings: what the viewer keeps, and what is said about a wrong one."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from automaton.errors import InputError
from tui.terminal.options import Options, read_settings, with_settings, write_settings


@pytest.mark.parametrize("speed", [4.0, 0.5, math.inf])
def test_what_is_written_is_read_again(tmp_path: Path, speed: float) -> None:
    path = tmp_path / "automaton" / "viewer.toml"
    assert read_settings(path) == {}
    chosen = {"theme": "light", "speed": speed, "panels": "off", "panel": "events"}
    write_settings(path, chosen)
    options = with_settings(Options(theme="auto"), read_settings(path))
    assert options == Options(theme="light", speed=speed, panels="off", panel="events")
    assert options.first_speed == speed and Options().first_speed == 1
    again = read_settings(path)
    write_settings(path, again | {"panel": "why"})
    assert read_settings(path) == again | {"panel": "why"}


def test_the_command_line_comes_first(tmp_path: Path) -> None:
    settings = {"theme": "light", "speed": "max"}
    asked = with_settings(Options(theme="dark", speed=2.0), settings)
    assert (asked.theme, asked.speed) == ("dark", 2.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("theme = ", "cannot be read: .*; correct it or delete it"),
        ("them = 'dark'", r"unknown key 'them' \(did you mean 'theme'\?\)"),
        ("theme = 'pink'", "theme must be dark or light, not 'pink'"),
        ("speed = 3", "speed must be a speed such as 2, or .max., not 3"),
        ("speed = []", r"speed must be a speed such as 2, or .max., not \[\]"),
    ],
)
def test_a_wrong_file_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "viewer.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(InputError, match=f"viewer.toml: {said}"):
        read_settings(path)
