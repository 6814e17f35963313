"""Commands whose standard output or errors are closed, full, or a pipe that nobody reads."""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from doc_commands import in_this_process
from docs_pages import page

from automaton.bench.measurement import MeasuredFigure
from automaton.commands import COMMANDS as ALL_COMMANDS
from automaton.commands import main
from automaton.conformance import Verdict

COMMANDS = ("list", "check goods-mini", "schema", "run goods-mini --until 20", "--help")


def ended(command: str, streams: str) -> tuple[int, str]:
    """The exit code of a command in a shell, and what is written to standard errors."""
    line = f"{sys.executable} -m automaton {command} {streams}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_needs_no_standard_streams(command: str) -> None:
    assert ended(command, ">&- 2>&- <&-") == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no full device")
@pytest.mark.parametrize("command", COMMANDS)
def test_a_full_disk_is_said_in_a_sentence(command: str) -> None:
    said = "automaton: standard output cannot be written: no space left on device\n"
    code, errors = ended(command, ">/dev/full")
    assert code == 2
    assert errors.endswith(said)  # what is compiled for the first time is said before it


def test_a_reader_that_goes_away_ends_a_command() -> None:
    """The schema is longer than what a pipe holds."""
    assert ended("schema", "| true; exit ${PIPESTATUS[0]}") == (141, "")


def test_a_full_disk_for_errors_stops_nothing() -> None:
    assert ended("run goods-mini --until 20 --record", "2>/dev/full")[0] == 2  # no file is named
    assert ended("run goods-mini --until 20", "2>/dev/full")[0] == 0


def test_bad_input_has_its_exit_code_without_a_place_for_the_sentence() -> None:
    assert ended("check nosuch.yaml", "2>&-")[0] == 2


# Every command, with arguments for which it has little to do; what it reads lies in the folder.
LINES = {
    "run": "run crossing",
    "sweep": "sweep small.yaml --out results --workers 1",
    "watch": "watch crossing --no-record",
    "replay": "replay a.rec",
    "explain": "explain a.rec --robot 0 --at 5",
    "branch": "branch a.rec --at 3 --out b.rec",
    "cast": "cast a.rec --out a.gif --to 4",
    "serve": "serve crossing --port 0 --no-token",
    "report": "report results",
    "what-if": "what-if crossing changes.yaml --pairs 2 --workers 1",
    "calibrate": "calibrate day.jsonl --floor site.yaml --out fitted.yaml --pairs 0",
    "log": "log day.jsonl --floor site.yaml --out real.rec",
    "compare": "compare site.yaml day.jsonl --runs 20 --workers 1 --seed 9",
    "bottlenecks": "bottlenecks crossing --only fleet --most 1 --pairs 2,2 --workers 1",
    "streets": "streets crossing --out found --runs 96 --dry-run --workers 1",
    "size": "size crossing --target makespan<=5000 --robots 2 --budget 70 --workers 1",
    "tune": "tune crossing --budget 63 --workers 1 --set stop.max_duration=5",
    "reproduce": "reproduce tabletop --seeds 1 --strategies cooperative --workers 1",
    "train": "train traffic --scenario crossing --legs 40 --epochs 1 --out a.npz",
    "verify": "verify a.rec",
    "import": "import a.map --out a.yaml --force",
    "export": "export a.rec --vda5050 a.jsonl",
    "check": "check crossing",
    "schema": "schema",
    "list": "list",
    "compile": "compile crossing",
    "bench": "bench --only step --repeat 1",
    "check-strategy": "check-strategy allocation:first-come",
    "new-strategy": "new-strategy mine-first --to new-STREAM",
}
LACKS_EXTRA = {"train": "torch"}
STUDY = "name: small\nscenario: crossing\npoints: [{}]\nreplications: 2\n"
CHANGES = "- {name: one robot fewer, set: {fleet.robots: 2}}\n"
MAP = "type octile\nheight 2\nwidth 3\nmap\n..@\n...\n"
SITE = """\
name: site
layout: {picture: "t...t"}
fleet: {robots: 1, kinematics: omni, start: [[1, 0]]}
units: {tick: 1 s, cell: 1 m}
durations: {pick: 4, drop: 4, handling_jitter: 4}
orders: {generator: stations, count: 6, mean_interarrival_time: 20}
strategy: {allocation: first-come, right_of_way: retreat}
stop: {when: never, max_duration: 200}
"""
RECORDED = "run crossing --record a.rec --set units.cell=1m"
# In the order of the columns of the table on the page.
STREAMS = ("closed", "full", "gone")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a recording, results, and what else the commands read."""
    path = tmp_path_factory.mktemp("streams")
    with in_this_process(path):
        (path / "small.yaml").write_text(STUDY)
        (path / "changes.yaml").write_text(CHANGES)
        (path / "a.map").write_text(MAP)
        (path / "site.yaml").write_text(SITE)
        with contextlib.redirect_stdout(io.StringIO()):
            assert main(RECORDED.split()) == 0
            assert main(LINES["sweep"].split()) == 0
            assert main(["run", "site.yaml", "--record", "day.rec"]) == 0
            assert main(["export", "day.rec", "--vda5050", "day.jsonl"]) == 0
        yield path


@contextlib.contextmanager
def standard_output(stream: str) -> Iterator[Any]:
    """None, a disk that is full, or a pipe whose reader has gone."""
    if stream == "closed":
        yield None
        return
    if stream == "full":
        file = open("/dev/full", "w")  # noqa: SIM115
    else:
        reader, writer = os.pipe()
        os.close(reader)
        file = os.fdopen(writer, "w")
    with contextlib.suppress(OSError), file:
        yield file


def rows_of_the_page() -> dict[str, tuple[str, ...]]:
    """The codes of each command on the page, in the order of STREAMS."""
    text = page("docs/reference/json.md").text
    rows = re.findall(
        r"^\| ((?:`[\w-]+`(?:, )?)+) \| (\d+) \| (\d+) \| (\d+) \|$", text, re.MULTILINE
    )
    return {name: codes for names, *codes in rows for name in re.findall(r"[\w-]+", names)}


def test_every_command_has_its_row() -> None:
    assert sorted(rows_of_the_page()) == sorted(ALL_COMMANDS) == sorted(LINES)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no full device")
@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize("command", LINES)
def test_a_command_ends_as_its_row_says(
    command: str, stream: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if command in LACKS_EXTRA and not find_spec(LACKS_EXTRA[command]):
        pytest.skip(f"needs {LACKS_EXTRA[command]}")
    if command == "serve":
        end_at_once(monkeypatch)
    if command == "bench":  # nothing is measured: that takes seconds
        monkeypatch.setattr("automaton.commands.bench_command.measure", measure_nothing)
    if command == "check-strategy":  # no process is started: that takes seconds
        verdict = Verdict("first-come", "allocation", True, 0, 0, 0, (), {})
        monkeypatch.setattr("automaton.commands.check_strategy_command.checked", lambda *_: verdict)
    errors = io.StringIO()
    with standard_output(stream) as output, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", output)
        patch.setattr(sys, "stderr", errors)
        code = main(LINES[command].replace("STREAM", stream).split())
    assert code == int(rows_of_the_page()[command][STREAMS.index(stream)]), errors.getvalue()
    said = "automaton: standard output cannot be written: no space left on device\n"
    assert (said in errors.getvalue()) == (code == 2)
    assert "internal error" not in errors.getvalue()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no full device")
def test_bytes_that_do_not_fit_are_said_as_text_is(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    errors = io.StringIO()
    with standard_output("full") as output, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", output)
        patch.setattr(sys, "stderr", errors)
        code = main(["cast", "a.rec", "--out", "-", "--to", "20"])
    said = "automaton: standard output cannot be written: no space left on device\n"
    assert (code, errors.getvalue()) == (2, said)


def measure_nothing(wanted: Any, repeat: int, figures: list[MeasuredFigure]) -> int:
    figures.append(MeasuredFigure("nothing", "ns", 1.0, 1.0, 1.0))
    return 0


def end_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have `serve` end when it has begun."""
    pytest.importorskip("textual_serve")

    async def ended() -> None:
        return None

    monkeypatch.setattr("tui.serve.server.asked_to_end", ended)
