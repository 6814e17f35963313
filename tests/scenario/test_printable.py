"""Text of others reaches no terminal as it is: control characters are shown, not obeyed."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from rich.progress import MofNCompleteColumn

from automaton.commands import main
from automaton.commands.arguments import progress_bar
from automaton.errors import InputError
from automaton.printable import LONGEST_NAME, PrintedText, cleaned, escaped, one_line
from automaton.scenario.document import parse

CONTROLS = "".join(map(chr, (*range(32), *range(127, 160)))).replace("\n", "")
OBEYED = re.compile(f"[{re.escape(CONTROLS)}]")
ATTACKS = (
    "\x1b]0;PWNED\a",
    "\x1b[2J",
    "\x1b[31m",
    "\r",
    "\x9b31m",
    "\b\b",
    "[red]x[/red]",
    "\u202e",
)

hostile = (
    st.text(st.sampled_from(CONTROLS + "\nab[]/: '\"\u2028")) | st.text() | st.sampled_from(ATTACKS)
)

ESC = """
name: "x\\e]0;PWNED\\a\\e[31mred\\e[0m"
layout:
  picture: |
    b...s
    b...d
fleet: {robots: 1, kinematics: omni}
orders: {generator: full-shelves}
strategy: {allocation: independent, routing: shortest, right_of_way: wait}
"""


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@given(hostile)
def test_a_sentence_is_one_line_of_harmless_characters(text: str) -> None:
    told = str(InputError(f"'{text}' is unknown", "file\x1b.yaml", 3))
    assert not OBEYED.search(told) and len(told.splitlines()) == 1
    assert one_line(told) == told


@given(hostile, hostile)
def test_names_and_keys_of_documents_are_harmless(name: str, key: str) -> None:
    text = yaml.safe_dump({"name": name, f"_{key}": {"summary": key}})
    data: Any = None
    try:
        data, _ = parse(text, "file.yaml")
    except InputError as error:
        assert not OBEYED.search(str(error))
    assert not OBEYED.search(re.sub(r"\\\\[nrtx]", "", str(data)).replace("\t", ""))
    if data is not None:
        assert len(data["name"].splitlines()) <= 1


@given(hostile)
def test_what_is_printed_is_harmless(text: str) -> None:
    pipe, terminal = io.StringIO(), Terminal()
    print(text, file=PrintedText(pipe))
    print(f"\r\x1b[K\x1b[1;31m{text}\x1b[0m", file=PrintedText(terminal))
    assert not OBEYED.search(pipe.getvalue().replace("\t", ""))
    sequences = "\x1b\\[[0-9;]*[mKA]|\r(?=\x1b\\[[0-9]*[KA])|\x1b\\[\\?25[lh]|\t"
    ours = re.sub(sequences, "", terminal.getvalue())
    assert not OBEYED.search(ours)
    if text.isascii() and text.isprintable():
        assert pipe.getvalue() == f"{text}\n"


def test_a_progress_bar_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stderr", PrintedText(terminal))
    with progress_bar("runs", MofNCompleteColumn()) as bar:
        bar.advance(bar.add_task("runs", total=3))
        bar.refresh()
    assert "1/3" in terminal.getvalue() and "\r" in terminal.getvalue()
    assert "\\r" not in terminal.getvalue()


def test_tabs_reach_a_pipe_as_they_are() -> None:
    pipe = io.StringIO()
    print("cell\tticks", file=PrintedText(pipe))
    assert pipe.getvalue() == "cell\tticks\n"


def test_a_long_name_is_cut_and_keeps_its_ends() -> None:
    name = "a" + "x" * 10_000 + "z"
    assert len(one_line(name, LONGEST_NAME)) < LONGEST_NAME + 6
    data, _ = parse(f"name: {name}\n", None)
    assert data["name"].startswith("axx") and data["name"].endswith("xxz")
    assert len(str(InputError(f"'{name}' is unknown; known are a, b"))) < 2100
    assert str(InputError(f"'{name}' is unknown; known are a, b")).endswith("known are a, b")


def test_lines_of_pictures_stay_lines() -> None:
    assert escaped("ab\ncd\te") == "ab\ncd\te"


@pytest.mark.parametrize("command", ["run", "check"])
def test_no_command_prints_what_a_name_orders(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "esc.yaml"
    path.write_text(ESC)
    for changed in (
        "",
        "--set=fleet.robots=\x1b[31m0",
        "--set=\x9b2J=3",
        "--set=strategy.routing=\x1bc",
    ):
        main([command, str(path), *([changed] if changed else [])])
        printed = capsys.readouterr()
        assert not OBEYED.search(printed.out + printed.err)
        assert changed or "\\u001b[31mred" in printed.out + printed.err
        assert not changed or printed.err.count("\n") == 1


def test_data_is_cleaned_at_any_depth() -> None:
    """Recordings pass here when they are read."""
    found = cleaned({"a\x1b": ["\x9b", ("ok\n", 3)], "b": None})
    assert found == {"a\\u001b": ["\\u009b", ("ok\n", 3)], "b": None}
