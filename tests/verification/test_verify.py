"""`automaton verify`: names the first tick and the array that differ when a run is made again."""

from __future__ import annotations

import copy
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from automaton.commands import main, version
from automaton.engine.digest import DIGEST_NAMES
from automaton.engine.record_codes import ENTERED_PARKING_BAY, EXECUTED_BLOCKED, EXECUTED_ILLEGAL
from automaton.errors import InputError
from automaton.recording import frames as stored
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_TICKS,
    DecodedFrame,
)
from automaton.recording.frames import Recording
from automaton.recording.recorder import MemoryRecorder, Recorder
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.verification.verification import action_text, verify_recording
from automaton.world import building
from automaton.world.resolve import branched, resolve


@pytest.fixture(autouse=True)
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing wraps, however long the paths of files are."""
    monkeypatch.setenv("COLUMNS", "1000")


@pytest.fixture(scope="module")
def good() -> Recording:
    resolved = resolve("tabletop-1", ["fleet.robots=3", "stop.max_duration=1000"])
    memory = MemoryRecorder(resolved, 4)
    Simulation(resolved, 4, on_record=memory).run()
    return memory.recording()


def altered(recording: Recording) -> tuple[Recording, list[DecodedFrame]]:
    frames = copy.deepcopy(list(recording.frames))
    header = copy.deepcopy(recording.header)
    return Recording(header, frames, complete=True), [
        f for f in frames if f.kind == FRAME_KIND_TICKS
    ]


def save(path: Path, recording: Recording) -> Path:
    path.write_bytes(stored.encoded(recording.header, recording.frames))
    return path


def test_a_good_recording_is_verified(good: Recording) -> None:
    found = verify_recording(good)
    assert found.passed and found.difference is None and not found.changed_sources
    assert found.report.ticks == 1000


def test_large_worlds_have_digests_every_few_ticks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(building, "VALUES_DIGESTED", 200)
    resolved = resolve("tabletop-1", ["fleet.robots=3", "stop.max_duration=300"])
    memory = MemoryRecorder(resolved, 4)
    Simulation(resolved, 4, on_record=memory).run()
    recording = memory.recording()
    every = recording.header["digest_every"]
    rows = np.concatenate(
        [one.content["digests"] for one in recording.frames if one.kind == FRAME_KIND_TICKS]
    )
    due = np.flatnonzero(rows.any(axis=1)) + 1
    assert 1 < every < 64 and due.tolist() == list(range(every, 301, every))
    monkeypatch.undo()
    assert verify_recording(recording).passed, "whatever the world is made with now"
    recording, ticks = altered(recording)
    ticks[0].content["digests"][2 * every - 1, 0] ^= np.uint64(1)
    difference = verify_recording(recording).difference
    assert difference is not None and difference.tick == 2 * every


@pytest.mark.parametrize(
    ("name", "fewest", "most"),
    [("tabletop-1", 1, 1), ("goods-mini", 1, 1), ("goods-60x40", 8, 12), ("sorting", 20, 30)],
)
def test_digests_are_as_far_apart_as_they_cost(name: str, fewest: int, most: int) -> None:
    header = MemoryRecorder(resolve(name)).header
    assert fewest <= header["digest_every"] <= most
    assert header["digest_every"] == MemoryRecorder(resolve(name), 2).header["digest_every"]


def test_digests_of_a_branch_come_as_often_as_before_it() -> None:
    resolved = resolve("tabletop-1")
    recorder = MemoryRecorder(resolved, 4)
    simulation = Simulation(resolved, 4, on_record=recorder)
    simulation.run(until=20)
    branch = simulation.continue_with(branched(resolved, ("durations.pick=3",)))
    branch.world.clock.digest_every = 7
    recorder.change(branch, ("durations.pick=3",))
    branch.run(until=60)
    assert verify_recording(recorder.recording()).passed


def test_a_changed_digest_names_tick_and_array(good: Recording) -> None:
    recording, ticks = altered(good)
    ticks[2].content["digests"][10, DIGEST_NAMES.index("robots.cell")] ^= np.uint64(1)
    difference = verify_recording(recording).difference
    assert difference is not None
    assert str(difference) == f"tick {ticks[2].content['first'] + 10}: robots.cell differs"


def test_the_first_of_several_differences_is_named(good: Recording) -> None:
    recording, ticks = altered(good)
    for row in (40, 30):
        ticks[1].content["digests"][row, DIGEST_NAMES.index("orders.reserved_by")] += np.uint64(row)
    ticks[1].content["digests"][30, DIGEST_NAMES.index("slots.reserved_by")] += np.uint64(1)
    difference = verify_recording(recording).difference
    assert str(difference) == (
        f"tick {ticks[1].content['first'] + 30}: orders.reserved_by differs: also slots.reserved_by"
    )


def test_a_changed_action_names_tick_and_robot(good: Recording) -> None:
    recording, ticks = altered(good)
    did = ticks[1].content["executed"]
    row, robot = np.argwhere(did == EXECUTED_BLOCKED)[0]
    did[row, robot] = EXECUTED_ILLEGAL  # the rules cannot tell
    found = verify_recording(recording)
    assert found.report.valid and not found.passed
    assert str(found.difference) == (
        f"tick {ticks[1].content['first'] + row}: actions differs: "
        f"robot {robot}: recorded illegal, repeated blocked"
    )


def test_a_changed_reservation_names_its_tick(good: Recording) -> None:
    recording, ticks = altered(good)
    changes = ticks[0].content["changes"]
    changes[5, 3] += 1
    difference = verify_recording(recording).difference
    assert difference is not None and difference.array == "changes"
    assert difference.tick == changes[5, 0]


def test_a_changed_end_is_named(good: Recording) -> None:
    recording, _ = altered(good)
    end = next(frame for frame in recording.frames if frame.kind == FRAME_KIND_END)
    end.content["digest"] = "0" * 16
    difference = verify_recording(recording).difference
    assert difference is not None and difference.array == "end" and difference.tick == 1000


def test_another_seed_is_another_run(good: Recording) -> None:
    recording, _ = altered(good)
    recording.header["seed"] = 5
    difference = verify_recording(recording).difference
    assert difference is not None and difference.tick == 0 and "orders.target" in difference.text


def test_a_run_that_ends_sooner_when_made_again(good: Recording) -> None:
    recording, _ = altered(good)
    conditions = next(
        frame.content for frame in recording.frames if frame.kind == FRAME_KIND_CONDITIONS
    )
    for part in (recording.header, conditions):
        part["scenario"]["stop"]["max_duration"] = 700
    difference = verify_recording(recording).difference
    assert difference is not None
    assert str(difference) == "tick 700: end differs: the repeated run ends here"


def test_actions_in_words() -> None:
    assert action_text(1) == "move east"
    assert action_text(3 | ENTERED_PARKING_BAY) == "move west, parked"


def test_verify_says_so_and_ends_with_0(
    good: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save(tmp_path / "run.rec", good)
    assert main(["verify", str(path)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{path}: verified: tabletop-1, seed 4, 3 robots, 1,000 ticks",
        "rules: no violations",
        "run again: every tick is identical",
    ]


def test_verify_as_json(
    good: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, ticks = altered(good)
    ticks[0].content["digests"][11, DIGEST_NAMES.index("robots.busy")] ^= np.uint64(1)
    assert main(["verify", "--json", str(save(tmp_path / "run.rec", recording))]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["verified"] is False and found["valid"] is True and found["equal"] is False
    assert found["difference"]["tick"] == 12 and found["difference"]["array"] == "robots.busy"
    assert found["scenario"] == "tabletop-1" and found["seed"] == 4 and found["ticks"] == 1000


@pytest.mark.parametrize("on_terminal", [True, False])
def test_a_terminal_shows_how_far_it_is(
    on_terminal: bool,
    good: Recording,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: on_terminal)
    monkeypatch.setenv("TERM", "xterm-256color")
    assert main(["verify", str(save(tmp_path / "run.rec", good))]) == 0
    told = capsys.readouterr()
    assert told.out.startswith(f"{tmp_path / 'run.rec'}: verified: tabletop-1")
    assert ("rules, tick 1,000 of 1,000" in told.err) == on_terminal
    assert on_terminal or not told.err


def test_each_part_of_verification_shows_its_ticks_up_to_the_last(good: Recording) -> None:
    told: list[tuple[str, int]] = []
    verify_recording(good, lambda what, tick: told.append((what, tick)))
    ends = [
        frame.content["first"] + len(frame.content["executed"]) - 1
        for frame in good.frames
        if frame.kind == FRAME_KIND_TICKS
    ]
    assert told == [(what, end) for what in ("run again", "rules") for end in ends]


def test_a_broken_rule_is_told(
    good: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, ticks = altered(good)
    row, robot = np.argwhere(ticks[0].content["executed"] == 1)[0]
    ticks[0].content["executed"][row, robot] = 4
    assert main(["verify", str(save(tmp_path / "run.rec", recording))]) == 1
    out = capsys.readouterr().out
    assert "not verified" in out and " violations\n  tick " in out
    assert f"run again: tick {row + 1}: actions differs: robot {robot}: recorded move north" in out


def test_a_cut_file_is_verified_up_to_its_last_whole_frame(
    good: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = save(tmp_path / "run.rec", good).read_bytes()
    path = tmp_path / "cut.rec"
    path.write_bytes(data[: 2 * len(data) // 3])
    assert main(["verify", str(path)]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"{path}: verified up to its last tick: ")
    assert "incomplete (cut short or interrupted): intact up to tick " in out
    assert "every tick is identical" in out


def test_a_damaged_file_fails(
    good: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save(tmp_path / "run.rec", good)
    data = bytearray(path.read_bytes())
    data[2 * len(data) // 3] ^= 1
    path.write_bytes(data)
    assert main(["verify", str(path)]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1
    assert told.err.startswith(f"automaton: {path}: damaged: frame ")


def test_other_sources_are_told(
    good: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, _ = altered(good)
    file = "strategies/allocation/independent.py"
    recording.header["sources"] = {**recording.header["sources"], file: "0" * 16}
    assert main(["verify", str(save(tmp_path / "run.rec", recording))]) == 0
    said = capsys.readouterr().out
    assert f"recorded by other code (version {version()}): {file} changed\n" in said


def test_what_is_no_recording_ends_with_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("name: x\n")
    assert main(["verify", str(path)]) == 2
    assert main(["verify", str(tmp_path / "none")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 2


def test_a_recording_of_an_unfinished_run_is_complete(tmp_path: Path) -> None:
    resolved = resolve("tabletop-mini", ["stop.max_duration=50"])
    with Recorder(tmp_path / "run.rec", resolved, 1) as recorder:
        Simulation(resolved, on_record=recorder).run()
    found = verify_recording(read_recording(tmp_path / "run.rec"))
    assert found.passed and found.recording.complete


def test_a_header_that_names_cells_off_its_floor_is_refused(
    good: Recording, tmp_path: Path
) -> None:
    recording, _ = altered(good)
    recording.header["floor"]["bays"] += 900_000_000
    with pytest.raises(
        InputError, match=r"frame 0 at byte 14 \(the header\): floor\.bays has the value"
    ):
        read_recording(save(tmp_path / "run.rec", recording))
