"""`watch --describe` and `replay --describe`: a run as sentences, for logs and screen readers."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from signal_process import signal_process
from viewer_harness import branch, record

from automaton.commands import main
from automaton.pytest_plugin import GridSnapshot

ALL = ["watch", "tabletop-mini", "--no-record", "--describe"]


def test_one_run_has_one_text(
    capsys: pytest.CaptureFixture[str], grid_snapshot: GridSnapshot
) -> None:
    assert main([*ALL, "--sentences", "6"]) == 0
    grid_snapshot(capsys.readouterr().out)


def test_a_recording_is_told_as_the_run_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "kept.rec"
    assert main(["watch", "tabletop-mini", "--record", str(kept), "--describe"]) == 0
    title, *live = capsys.readouterr().out.splitlines()
    assert main(["replay", str(kept), "--describe"]) == 0
    named, *recorded = capsys.readouterr().out.splitlines()
    assert recorded == live and named == f"kept.rec: {title}"
    assert main(["verify", str(kept)]) == 0


def test_only_what_is_asked_for_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*ALL, "--only", "deliveries", "--only", "waits", "--at", "800"]) == 0
    printed = capsys.readouterr().out
    events = re.findall(r"^tick ([\d,]+), robot \d+: (\w+)", printed, re.MULTILINE)
    assert {words for _, words in events} == {"delivers", "has"}
    assert min(int(tick.replace(",", "")) for tick, _ in events) > 800
    assert main([*ALL, "--only", "wait"]) == 2
    assert "'wait' is not a kind of sentence (did you mean 'waits'?)" in capsys.readouterr().err


def test_a_run_that_does_not_finish_says_why(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*ALL, "--set", "stop.max_duration=100"]) == 1
    printed = capsys.readouterr().out
    assert "NOT FINISHED after 100 cycles" in printed
    assert "\nnot finished: 23 of 25 orders undelivered, last delivery at tick 97\n" in printed


def test_a_branch_and_the_run_beside_it_are_told_after_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = record(tmp_path / "one.rec", until=200)
    settings = ("strategy.right_of_way=wait", "stop.max_duration=400")
    two = branch(one, tmp_path / "two.rec", 140, *settings)
    assert main(["replay", str(one), str(two), "--describe", "--sentences", "1"]) == 0
    printed = capsys.readouterr().out
    assert printed.index("one.rec: ") < printed.index("two.rec: ")
    assert "branched off from tick 140 right_of_way=wait" in printed
    assert "the runs differ first at tick " in printed.splitlines()[-1]


@pytest.mark.parametrize("ends", ["pipe", "interrupt"])
def test_it_ends_when_nobody_reads_on_and_when_it_is_interrupted(ends: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "automaton", *ALL[:3], "--describe"]
    if ends == "interrupt":
        command = signal_process(signal.SIGINT, [*command, "--set", "stop.when=never"])
        command += ["--set", "stop.max_duration=10000000"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        assert process.stdout.readline().startswith("tabletop-mini, 3 robots, seed 1")
        if ends == "pipe":
            process.stdout.close()
            assert process.wait(60) == 141 and process.stderr.read() == ""
            return
        while not process.stdout.readline().startswith("tick 1,000: "):
            pass
        process.send_signal(signal.SIGINT)
        begun = time.monotonic()
        process.stdout.read()
        assert process.wait(60) == 130 and time.monotonic() - begun < 60
        assert process.stderr.read() == "automaton: interrupted\n"
