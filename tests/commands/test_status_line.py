"""The last line of a terminal while a command works, and the command that it names at its end."""

from __future__ import annotations

import io
import re
import sys
from argparse import Namespace
from pathlib import Path

import pytest

from automaton.commands import COMMANDS, arguments_of, main
from automaton.commands.arguments import say
from automaton.commands.status_line import (
    CLEARED,
    NEXT_COMMANDS,
    SILENCE_S,
    StatusLine,
    next_command,
)
from automaton.printable import PrintedText

# For each command of NEXT_COMMANDS: its words, and what to run next.
ENDS = {
    "check own.yaml": "run own.yaml",
    "import a.map --out own.yaml": "check own.yaml",
    "run goods-mini --set fleet.robots=2": "watch goods-mini --set fleet.robots=2",
    "run goods-mini --record 'my run.rec'": "replay 'my run.rec'",
    "log a.csv --floor own.yaml --out a.rec": "replay a.rec",
    "branch a.rec --at 5 --out b.rec": "replay a.rec b.rec",
    "size own.yaml --target 'throughput>=1' --robots 1..5": "bottlenecks own.yaml",
    "what-if own.yaml changes.yaml --out answers": "report answers",
    "compare own.yaml a.csv": "what-if own.yaml CHANGES.yaml",
    "bottlenecks own.yaml": "size own.yaml --target T --robots A..B",
    "tune own.yaml --out best.yaml": "run own.yaml --set @best.yaml",
    "sweep study.yaml --out results": "report results",
    "train traffic": "run warehouse-100",
    "compile": "run goods-mini",
}


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def arguments(words: str) -> tuple[str, Namespace]:
    import shlex

    name, *rest = shlex.split(words)
    read = arguments_of(name, rest)
    assert read is not None
    return name, read


@pytest.mark.parametrize("words", ENDS)
def test_a_command_names_the_one_to_run_next(words: str) -> None:
    name, read = arguments(words)
    assert next_command(name, vars(read)) == f"automaton {ENDS[words]}"
    following, *_ = ENDS[words].split()
    assert following in COMMANDS


def test_each_command_with_a_successor_is_tried_here() -> None:
    assert {words.split()[0] for words in ENDS} == NEXT_COMMANDS.keys()


def test_the_line_appears_in_silence_and_any_output_clears_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "24")
    now, terminal = [0.0], Terminal()
    line = StatusLine(lambda: now[0])
    out = PrintedText(terminal, True, line.clear)
    with line.shown(terminal, "compile"):
        line.draw()
        assert terminal.getvalue() == ""  # a quick command shows nothing
        now[0] = SILENCE_S
        line.draw()
        assert terminal.getvalue() == f"{CLEARED}compile, 1 s"
        print("done", file=out)
        line.draw()
        assert terminal.getvalue().endswith(f"1 s{CLEARED}done\n")
        line.show(lambda: "a text that is too long for it")
        now[0] = 4.0
        line.draw()
        assert terminal.getvalue().endswith(f"{CLEARED}a text that is too ...")
    assert terminal.getvalue().endswith(f"...{CLEARED}")


def test_sentences_on_stderr_wrap_at_blanks_of_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    terminal, pipe = Terminal(), io.StringIO()
    for stream in (terminal, pipe):
        print("automaton: no such file as my-file.yaml here", file=PrintedText(stream, False))
    assert terminal.getvalue() == "automaton: no such file as\n  my-file.yaml here\n"
    assert pipe.getvalue() == "automaton: no such file as my-file.yaml here\n"


def test_a_word_that_fits_in_no_line_is_left_in_its_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    monkeypatch.setattr(sys, "stdout", terminal := Terminal())
    path = "/a/long/path/of/a/film/of/robots.gif"
    say(f"{path}: 61 frames")
    say("a.gif: 61 frames, 96,535 bytes, 5.0 s")
    assert terminal.getvalue().splitlines() == [
        f"{path}: 61 frames",
        "a.gif: 61 frames, 96,535",
        "  bytes, 5.0 s",
    ]


@pytest.mark.parametrize(
    ("options", "is_named"), [((), True), (("--json",), False), (("--bad",), False)]
)
def test_only_an_answer_that_is_read_names_the_next_command(
    options: tuple[str, ...], is_named: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdout", Terminal())
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    main(["check", "goods-mini", *options])
    assert (
        re.search("^next: automaton run goods-mini$", terminal.getvalue(), re.M) is not None
    ) is (is_named)
