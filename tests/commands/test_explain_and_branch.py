"""`automaton explain` and `automaton branch`: questions put to a recording without a screen."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from automaton.commands import main
from automaton.commands.explain import chain_blocks
from automaton.documents.report_document import Listed
from automaton.engine.observation import is_waiting
from automaton.history.explanation import explain
from automaton.history.snapshot import take_snapshot
from automaton.history.watched_run import ReplayedRun
from automaton.recording.contents import FRAME_KIND_CONDITIONS
from automaton.recording.frames import Recording
from automaton.recording.recording_reader import read_recording
from automaton.verification.verification import verify

FLEET = ("--set", "fleet.robots=4", "--seed", "7")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fork") / "run.rec"
    assert main(["run", "tabletop-1", *FLEET, "--until", "900", "--record", str(path)]) == 0
    return path


def told(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> Any:
    capsys.readouterr()
    assert main([*arguments, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def first_wait(recording: Recording) -> tuple[int, int]:
    """A tick and the robot that waits in it for another one."""
    run = ReplayedRun(recording)
    for tick in range(60, 900):
        run.show(tick, 9)
        fleet = take_snapshot(run.shown).robots
        found = np.flatnonzero(is_waiting(fleet.cause) & (fleet.blocker >= 0))
        if len(found):
            return tick, int(found[0])
    raise AssertionError("nobody waits")


def test_a_tick_may_be_a_clock_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "day.rec"
    units = "units={tick: 10 s, clock: '06:00'}"
    assert (
        main(["run", "tabletop-mini", "--set", units, "--until", "30", "--record", str(path)]) == 0
    )
    asked = ("explain", str(path), "--robot", "0", "--at")
    assert told(capsys, *asked, "06:04")["tick"] == 24
    for time, sentence in (
        ("07:00", "there is no tick 360: it has ticks 0 to 30"),
        ("05:00", "'05:00' is before tick 0, which is units.clock"),
    ):
        assert main([*asked, time]) == 2
        assert f"automaton: {path}: {sentence}" in capsys.readouterr().err


def test_the_chain_is_the_one_that_the_viewer_tells(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tick, robot = first_wait(read_recording(recorded))
    found = told(capsys, "explain", str(recorded), "--robot", str(robot), "--at", str(tick))
    run = ReplayedRun(read_recording(recorded))
    run.show(tick, 9)
    snapshot = take_snapshot(run.shown)
    assert found["lines"] == explain(snapshot, run.floor_plan, robot).lines and found["waits"]
    assert len(found["chain"]) > 1 and found["chain"][0]["rule"]
    assert sum(found["lost"].values()) == snapshot.robots.lost[robot].sum()
    assert main(["explain", str(recorded), "--robot", str(robot), "--at", str(tick)]) == 0
    text = capsys.readouterr().out
    assert f"robot {robot} has been " in text and "  rule: " in text and "time lost so far" in text


def test_who_does_not_wait_gets_a_plain_sentence(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explain", str(recorded), "--robot", "0", "--at", "0"]) == 0
    assert "robot 0 is parked: it does not wait\nno time lost so far" in capsys.readouterr().out


def test_when_the_order_is_due_and_how_late_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Robot 0 has a stop seven cells away that is due after 5 ticks; the next one is due in time."""
    (tmp_path / "late.yaml").write_text(
        "name: late\nlayout:\n  picture: |\n    ........\n"
        "fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}\n"
        'units: {tick: 0.5 s, clock: "06:00"}\n'
        "orders: {list: [{stops: [[7, 0]], due: 5}, {stops: [[0, 0]], due: {at: 80}}]}\n"
        "strategy: {allocation: first-come, right_of_way: wait}\nstop: {when: delivered}\n"
    )
    path = tmp_path / "run.rec"
    assert main(["run", str(tmp_path / "late.yaml"), "--record", str(path)]) == 0
    due = "order 0 is due in tick 5 (2.5 s, 06:00:02): "
    for tick, words in ((3, "in 2 ticks (1 s)"), (5, "now"), (6, "late by 1 tick (0.5 s)")):
        capsys.readouterr()
        assert main(["explain", str(path), "--robot", "0", "--at", str(tick)]) == 0
        assert f"{due}{words}\n" in capsys.readouterr().out
    found = told(capsys, "explain", str(path), "--robot", "0", "--at", "6")
    assert (found["order"], found["due"], found["late"]) == (0, 5, 1)
    found = told(capsys, "explain", str(path), "--robot", "0", "--at", "9")
    assert (found["order"], found["due"], found["late"]) == (1, 80, 0)
    found = told(capsys, "explain", str(path), "--robot", "0", "--at", "14")
    assert (found["order"], found["due"], found["late"]) == (None, None, None)


def test_a_circle_is_named() -> None:
    from small_runs import SmallRun

    floor = SmallRun("CAB", {"A": "E", "B": "W", "C": "E"}).tick()
    blocks = chain_blocks("title", explain(floor.snapshot(), floor.floor_plan, 2))
    assert isinstance(blocks[-1], Listed)
    last = blocks[-1].items[-1]
    assert last == "a wait cycle: robot 0 -> robot 1 -> robot 0; none moves until one makes way"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("explain", "--robot", "4", "--at", "3"), "there is no robot 4: it has robots 0 to 3"),
        (("explain", "--robot", "0", "--at", "901"), "there is no tick 901: it has ticks 0 to 900"),
        (("branch", "--at", "901"), "there is no tick 901"),
        (("branch", "--at", "10", "--until", "10"), "--until 10 is not after --at 10"),
        (
            ("branch", "--at", "10", "--set", "seed=3"),
            "seed=3: seed cannot change during a run",
        ),
        (("branch", "--at", "10", "--set", "durations.move=0"), "durations.move must be"),
    ],
)
def test_what_there_is_not_is_told_in_a_sentence(
    arguments: tuple[str, ...], sentence: str, recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command, *rest = arguments
    assert main([command, str(recorded), *rest]) == 2
    error = capsys.readouterr().err
    assert sentence in error and error.count("\n") == 1
    assert [path.name for path in recorded.parent.iterdir()] == ["run.rec"], "no file is left"


def test_a_recording_is_not_overwritten_by_its_branch(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = recorded.read_bytes()
    assert main(["branch", str(recorded), "--at", "5", "--out", str(recorded)]) == 2
    assert "--out is the recording itself" in capsys.readouterr().err
    assert recorded.read_bytes() == before


def test_without_a_change_the_future_repeats(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for at in (0, 300, 899):
        out = str(tmp_path / f"{at}.rec")
        found = told(
            capsys, "branch", str(recorded), "--at", str(at), "--out", out, "--until", "900"
        )
        assert found["difference"] is None
        assert found["branch"] | {"name": "original"} == found["original"]
        branch, original = (read_recording(path).stored() for path in (out, recorded))
        assert branch.last_tick == original.last_tick == 900


def test_a_branch_is_marked_verifies_and_is_compared(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "branch.rec"
    arguments = (
        "branch",
        str(recorded),
        "--at",
        "300",
        "--set",
        "durations.move=9",
        "--until",
        "900",
    )
    found = told(capsys, *arguments, "--out", str(out))
    assert found["difference"] > 300 and found["branch"]["ticks"] == 900
    assert (
        found["branch"]["metrics"]["operations_per_robot"]
        < found["original"]["metrics"]["operations_per_robot"]
    )
    marks = [
        frame.content for frame in read_recording(out).frames if frame.kind == FRAME_KIND_CONDITIONS
    ]
    assert [(mark["tick"], list(mark["settings"])) for mark in marks][-1] == (
        300,
        ["durations.move=9"],
    )
    assert verify(out).passed and read_recording(out).complete
    assert main([*arguments, "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "branched off after tick 300: durations.move=9" in text
    assert "the runs differ first at tick" in text and "x goes" not in text
    assert "metric" in text and "original" in text and "lost_refused" in text
    # The viewer shows both with one clock; in a pipe, metrics of both.
    assert main(["replay", str(recorded), str(out)]) == 0
    text = capsys.readouterr().out
    assert f"the runs differ first at tick {found['difference']}" in text
    assert "branched off from tick 300 durations.move=9" in text


def test_a_branch_that_cannot_be_written_is_not_compared_with_an_older_one(
    recorded: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "branch.rec"
    arguments = ["branch", str(recorded), "--at", "300", "--out", str(out)]
    assert main([*arguments, "--set", "durations.move=9"]) == 0
    older = out.read_bytes()
    capsys.readouterr()

    def full(file: Any, frame: bytes) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("automaton.recording.recorder.RecordingFile.write", full)
    assert main([*arguments, "--set", "durations.turn=9"]) == 2
    said = capsys.readouterr()
    assert (
        "the runs" not in said.out
        and "recorded in" not in said.out
        and "operations_per_robot" in said.out
    )
    assert said.err == f"automaton: {out}: recording has stopped: No space left on device\n"
    assert out.read_bytes() == older


def test_a_branch_that_does_not_finish_says_so_by_its_code(recorded: Path, tmp_path: Path) -> None:
    out = str(tmp_path / "branch.rec")
    arguments = [
        "branch",
        str(recorded),
        "--at",
        "300",
        "--set",
        "stop.max_duration=400",
        "--out",
        out,
    ]
    assert main(arguments) == 1


@pytest.mark.parametrize(
    "orders",
    [
        "{generator: stations, count: 60, arrivals: {closed_loop: {in_system: 4}}}",
        "{parts: [{route: [1, 2, 3], count: 20, interarrival_time: {mean: 20}}], "
        "processing_time: {mean: 9}}",
    ],
)
def test_streams_go_on_in_a_branch(
    orders: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, same, other = (str(tmp_path / name) for name in ("run.rec", "same.rec", "other.rec"))
    assert (
        main(["run", "depots", "--set", f"orders={orders}", "--until", "600", "--record", path])
        == 0
    )
    branch = ("branch", path, "--at", "200", "--until", "600", "--out")
    assert told(capsys, *branch, same)["difference"] is None
    assert told(capsys, *branch, other, "--set", "durations.pick=9")["difference"] > 200
    assert verify(same).passed and verify(other).passed
