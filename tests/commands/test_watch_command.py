"""`watch` and `replay` without a terminal: what they print, refuse and keep."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from viewer_harness import branch, record

from automaton.commands import main
from automaton.floor.floor_plan import DESTINATION
from automaton.history.divergence import first_difference
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.frames import FRAME, PREAMBLE
from automaton.recording.recording_reader import read_recording
from automaton.world.resolve import resolve
from tui.playback.run_source import MAX_RECORDINGS_KEPT, give_up_unused, new_recording, recorded


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "automaton" / "recordings"


def test_without_a_terminal_the_figures_come_as_text(
    state: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["watch", "tabletop-mini"]) == 0
    printed = capsys.readouterr().out
    assert "tick 1,000: " in printed and "\x1b" not in printed
    assert "tick 100: 2 of 25 orders delivered, 3 working, 0 waiting, 0 parked\n" in printed
    assert main(["run", "tabletop-mini"]) == 0
    report = capsys.readouterr().out.splitlines()
    assert "finished after 1,474 cycles" in printed
    begin = next(k for k, line in enumerate(report) if line.startswith("metric  "))
    assert report[begin:] == printed.splitlines()[-len(report[begin:]) :]
    (recording,) = state.iterdir()
    assert read_recording(recording).complete
    assert main(["verify", str(recording)]) == 0


def test_a_run_that_does_not_finish_exits_like_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["watch", "tabletop-mini", "--no-record", "--set", "stop.max_duration=100"]) == 1
    assert "NOT FINISHED after 100 cycles" in capsys.readouterr().out


def test_nothing_is_recorded_when_that_is_asked_for(state: Path) -> None:
    assert main(["watch", "tabletop-mini", "--no-record", "--plain"]) == 0
    assert not state.exists()


@pytest.mark.parametrize("command", ["watch", "run", "check"])
def test_a_recording_that_is_given_as_a_scenario_is_called_one(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = record(tmp_path / "a.rec", until=5)
    assert main([command, str(path)]) == 2
    said = f"{path}: is a recording, not a scenario; automaton replay shows it"
    assert said in "".join(capsys.readouterr())


def test_a_recording_is_told_and_two_are_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = record(tmp_path / "a.rec")
    other = record(tmp_path / "b.rec", "strategy.right_of_way=wait")
    assert main(["replay", str(one)]) == 0
    told = capsys.readouterr().out
    assert "tick 500: " in told and "computed in" not in told  # nobody computes it now
    assert main(["replay", str(one), str(other)]) == 0
    assert "the runs differ first at tick " in capsys.readouterr().out


def test_a_branch_is_named_and_reported_under_its_own_settings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    waits = "strategy.right_of_way=wait"
    one = record(tmp_path / "one.rec", waits, until=300)
    two = branch(one, tmp_path / "two.rec", 140, "strategy.right_of_way=retreat")
    assert main(["replay", str(one), str(two), "--plain"]) == 0
    first, second = capsys.readouterr().out.split("branched off from tick 140")
    assert "right of way wait" in first and "right of way retreat" not in first
    assert second.startswith(" right_of_way=retreat\n") and "right of way retreat" in second
    assert "right of way wait" not in second
    title = "tabletop-mini, 3 robots, seed 1, right_of_way=wait"
    assert recorded(one).titles == (f"one.rec: {title}",)
    changed = ", from tick 140 right_of_way=retreat"
    assert recorded(two).titles == (f"two.rec: {title}{changed}",)
    parent, child = recorded(one, two).heads
    assert parent.own == "one.rec: right_of_way=wait"
    assert child.own == f"two.rec: right_of_way=wait{changed}"


def test_what_differs_between_two_runs_comes_first(tmp_path: Path) -> None:
    one = record(tmp_path / "one.rec", until=50)
    two = record(tmp_path / "two.rec", "strategy.right_of_way=wait", "seed=3", until=50)
    heads = recorded(one, two).heads
    assert heads[0] == ("one.rec: right_of_way=retreat, seed 1", "tabletop-mini, 3 robots")
    assert heads[1] == ("two.rec: right_of_way=wait, seed 3", "tabletop-mini, 3 robots")
    assert recorded(one, one).heads[0] == ("one.rec", "tabletop-mini, 3 robots, seed 1")


def test_the_first_difference_is_the_first_tick_in_which_robots_did_something_else(
    tmp_path: Path,
) -> None:
    one = read_recording(record(tmp_path / "a.rec"))
    other = read_recording(record(tmp_path / "b.rec", "strategy.right_of_way=wait"))
    did = []
    for recording in (one, other):
        frames = [frame.content for frame in recording.frames if frame.kind == 2]
        did.append([row.tolist() for frame in frames for row in frame["executed"]])
    wanted = next(t for t, (a, b) in enumerate(zip(*did, strict=False), start=1) if a != b)
    assert first_difference(one, other).tick == wanted
    assert first_difference(one, one).tick is None
    shorter = read_recording(record(tmp_path / "c.rec", until=200))
    assert first_difference(one, shorter).tick == 201
    backend = read_recording(record(tmp_path / "d.rec", "fleet.robots=2"))
    assert first_difference(one, backend).tick == 0


def test_bad_input_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("not a recording")
    small, large = (record(tmp_path / f"{n}.rec", f"layout.tables={n}") for n in (4, 6))
    for arguments, sentence in (
        (["watch", "tabletop-mini", "--speed", "fast"], "'fast' is not a speed"),
        (["watch", "tabletop-mini", "--at", "-1"], "--at"),
        (["watch", "tabletop-mini", "--fps", "0"], "'0' is not a frame rate: allowed are 1 to 120"),
        (["watch", "tabletop-mini", "--record", str(text)], "is not a recording, so it is not"),
        (["watch", "tabletop-mini", "--record", "/nowhere/x.rec"], "there is no such folder"),
        (["replay", str(text)], "this is not a recording of automaton"),
        (["replay", str(small), str(large)], "floors of different sizes cannot be compared"),
    ):
        assert main(arguments) == 2
        error = capsys.readouterr().err
        assert sentence in error and error.count("\n") == 1


def test_a_folder_that_takes_no_recording_is_told_before_anything_is_drawn(
    state: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "touch", refused)
    assert main(["watch", "tabletop-mini"]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1
    assert "cannot keep recordings here: Permission denied; --no-record does without" in told.err
    assert str(state) in told.err


def without_a_frame(data: bytes) -> bytes:
    """A recording from whose middle a frame of ticks was cut out."""
    begins, at = [], PREAMBLE.size
    while at < len(data):
        kind, length, *_ = FRAME.unpack_from(data, at)
        begins += [(at, at + FRAME.size + length)] if kind == FRAME_KIND_TICKS else []
        at += FRAME.size + length
    begin, end = begins[len(begins) // 2]
    return data[:begin] + data[end:]


def test_a_damaged_recording_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, damaged = record(tmp_path / "a.rec"), tmp_path / "b.rec"
    damaged.write_bytes(without_a_frame(whole.read_bytes()))
    for paths in ((damaged,), (whole, damaged)):
        assert main(["replay", *map(str, paths)]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and f"{damaged}: damaged: frame " in error


def test_only_the_newest_recordings_are_kept(tmp_path: Path) -> None:
    environ = {"XDG_STATE_HOME": str(tmp_path)}
    first = new_recording("my floor/1", environ)
    give_up_unused(first)
    folder = first.parent
    for age in range(MAX_RECORDINGS_KEPT + 5):
        path = folder / f"{age}.rec{'.part' if age % 2 else ''}"
        path.touch()
        os.utime(path, (1000 - age, 1000 - age))
    path = new_recording("my floor/1", environ)
    assert not path.exists() and path.name.startswith("my-floor-1-")
    give_up_unused(path)
    kept = {int(path.name.partition(".")[0]) for path in folder.iterdir()}
    assert kept == set(range(MAX_RECORDINGS_KEPT - 1))


def test_viewers_that_begin_in_the_same_second_get_a_recording_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tui.playback.run_source.time.strftime", lambda _: "now")
    environ = {"XDG_STATE_HOME": str(tmp_path)}
    names = [new_recording("floor", environ).name for _ in range(3)]  # nothing is written yet
    assert names == ["floor-now.rec", "floor-now-2.rec", "floor-now-3.rec"]
    folder = tmp_path / "automaton" / "recordings"
    assert sorted(path.name for path in folder.iterdir()) == sorted(f"{n}.part" for n in names)


def test_a_viewer_that_does_not_begin_leaves_no_file(
    state: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    larger = ["--against", "layout.tables=4"]
    assert main(["watch", "tabletop-mini", *larger]) == 2
    assert "floors of different sizes" in capsys.readouterr().err
    assert [path for path in state.rglob("*") if path.is_file()] == []


def test_a_floor_is_known_without_numba(tmp_path: Path) -> None:
    path = record(tmp_path / "a.rec")
    program = (
        "import sys\n"
        "from pathlib import Path\n"
        "from automaton.world.resolve import resolve\n"
        "from tui.playback.run_source import live, recorded\n"
        "from tui.render.scene import floor_of\n"
        "import tui.viewer.app\n"
        f"recorded(Path({str(path)!r}))\n"
        "floor_of(live(resolve('tabletop-mini'), None).resolved[0])\n"
        "sys.exit('numba' in sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0


def test_the_opening_knows_its_floor_and_title(tmp_path: Path) -> None:
    opening = recorded(record(tmp_path / "a.rec", "fleet.robots=2"))
    assert opening.titles == ("a.rec: tabletop-mini, 2 robots, seed 1, fleet.robots=2",)
    floor_plan = resolve("tabletop-mini").floor_plan
    assert opening.resolved[0].floor_plan == floor_plan
    assert (floor_plan.kind == DESTINATION).any()
