"""Every command at several widths: no line is too long, no word is cut, and none is lost."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from doc_commands import in_this_process
from sweep_studies import small_study

from automaton.commands import COMMANDS as ALL_COMMANDS
from automaton.commands import main
from automaton.printable import INDENT

WIDTHS = (60, 80, 120)
SECONDS = "--set units.tick=1s --set units.cell=1m"
NO_LIMIT = 1000
COMMANDS = {
    "list": "list",
    "check": "check tabletop-1 goods-60x40 factory-types tabletop-fleet",
    "trial": "check tabletop-mini --trial",
    "run": "run tabletop-mini",
    "types": "run factory-types --until 600",
    "stations": "run goods-60x40 --until 300",
    "size": "size tabletop-mini --target makespan<=3000 --robots 1..3 --workers 1 --budget 200",
    "first screen": "reproduce tabletop --seeds 1 --strategies independent --workers 1",
    "reproduce": "reproduce tabletop --seeds 1 --strategies independent --workers 1 --tables",
    "explain": "explain {folder}/a.rec --robot 1 --at 400",
    "branch": "branch {folder}/a.rec --at 400 --until 500 --out {folder}/b.rec",
    "verify": "verify {folder}/a.rec",
    "sweep": "sweep {folder}/small.yaml --out {folder}/out --workers 1",
    "report": "report {folder}/out",
    "bottlenecks": "bottlenecks goods-mini --pairs 2,9 --workers 1",
    "streets": "streets crossing --out {folder}/found --runs 96 --dry-run --workers 1",
    "tune": "tune tabletop-mini --budget 60 --workers 1",
    "bench": "bench --only tables --repeat 1",
    "what-if": "what-if tabletop-mini {folder}/changes.yaml --pairs 2 --workers 1",
    "import": "import {folder}/pods.lif --out {folder}/site.yaml --cell 1m --tick 1s --force",
    "log": "log {folder}/pods.jsonl --floor goods-mini --out {folder}/real.rec",
    "calibrate": "calibrate {folder}/pods.jsonl --floor goods-mini --out {folder}/fit.yaml --pairs 0",
    "export": "export {folder}/pods.rec --vda5050 {folder}/again.jsonl --every 1s",
    "export a floor": "export goods-mini --lif {folder}/again.lif",
    "cast": "cast {folder}/pods.rec --html {folder}/film.html --to 50",
    "picture": "cast {folder}/pods.rec --picture {folder}/still.txt --at 40",
    "compile": "compile tabletop-mini",
    "compare": f"compare tabletop-mini {SECONDS} {{folder}}/a.jsonl --runs 20 --workers 1",
    "check a strategy": "check-strategy allocation:shortest-job --floors 1 --only legality",
}
ELSEWHERE = {  # screens, a long one, and what programs read
    *("watch", "replay", "serve", "train"),
    *("schema", "new-strategy"),
}
SENTENCES = ("export", "export a floor", "cast", "picture", "compile")  # wrapped on terminals alone
CHANGES = """- {name: one robot fewer, set: {fleet.robots: 2}}
- {name: slower turns, set: {durations.turn: 40, durations.pick: 15}}
"""
TIMES = re.compile(r"computed in \S+ ms|\(?[\d,.]+ (s|ms|minutes)\b\S*")
DRAWN = re.compile(r"^[^A-Za-z]*$|[|+].*[|:o-]{3}|^ {8}")  # scales and curves, which do not wrap


@pytest.fixture(scope="module", autouse=True)
def quickly(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with in_this_process(tmp_path_factory.mktemp("work")):
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("widths")
    study = small_study(folder)
    assert main(["run", "tabletop-mini", "--record", str(folder / "a.rec")]) == 0
    assert main(f"sweep {study} --out {folder}/out --workers 1".split()) == 0
    (folder / "changes.yaml").write_text(CHANGES)
    assert main(["run", "goods-mini", "--record", str(folder / "pods.rec")]) == 0
    assert main(f"export {folder}/pods.rec --vda5050 {folder}/pods.jsonl --every 1s".split()) == 0
    assert main(f"export goods-mini --lif {folder}/pods.lif".split()) == 0
    assert main(f"run tabletop-mini {SECONDS} --record {folder}/day.rec".split()) == 0
    assert main(f"export {folder}/day.rec --vda5050 {folder}/a.jsonl --every 1s".split()) == 0
    return folder


def printed(
    command: str, width: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> list[str]:
    monkeypatch.setenv("COLUMNS", str(width))
    capsys.readouterr()
    assert main(command.split()) in (0, 1)
    return capsys.readouterr().out.splitlines()


def words(lines: list[str]) -> set[str]:
    text = " ".join(" ".join(lines).split())
    return {word for word in TIMES.sub("", text).split() if re.search("[A-Za-z]", word)}


@pytest.mark.parametrize("name", COMMANDS)
def test_lines_fit_and_words_are_whole(
    name: str,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    command = COMMANDS[name].format(folder=folder)
    if name in SENTENCES:
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
        monkeypatch.setenv("NO_COLOR", "1")
    whole = words(printed(command, NO_LIMIT, capsys, monkeypatch))
    for width in WIDTHS:
        lines = printed(command, width, capsys, monkeypatch)
        long = [line for line in lines if len(line) > width and not DRAWN.search(line)]
        fits = width - len(INDENT)
        paths = [any("/" in word and len(word) > fits for word in line.split()) for line in long]
        broken = [line for line, left_whole in zip(long, paths, strict=True) if not left_whole]
        assert [line for line in broken if len(line.split()) > 1] == []
        if name != "bench":
            assert words(lines) - whole == set(), "a word is cut"
            assert not {one for one in whole - words(lines) if len(one) > 12}, "a word is lost"


def test_no_command_is_left_out() -> None:
    assert {command.split()[0] for command in COMMANDS.values()} | ELSEWHERE == set(ALL_COMMANDS)


@pytest.mark.parametrize("name", ["", *ALL_COMMANDS])
def test_help_fits_and_its_words_are_complete(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = f"{name} --help".strip()
    complete = words(printed(command, NO_LIMIT, capsys, monkeypatch))
    for width in WIDTHS:
        lines = printed(command, width, capsys, monkeypatch)
        assert [line for line in lines if len(line) > width] == []
        assert words(lines) == complete
