"""Recorded runs as outputs that PlanViz shows: they keep the rules of their problems."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from handmade_recordings import recorded

from automaton.commands import main
from automaton.errors import InputError
from automaton.exchange.planviz import read_output, verify_output
from automaton.exchange.planviz_paths import SeveralTickMotion, motion_of
from automaton.exchange.problem_files import read_problem
from automaton.exports.planviz_export import planviz_output
from automaton.recording.contents import DecodedFrame
from automaton.recording.frames import Recording, encoded

MAP = "type octile\nheight 4\nwidth 6\nmap\n......\n.@@.@.\n.@@.@.\n......\n"
TASKS = ["23,0", "9", "3,18,5", "0", "17,12"]
STRATEGIES: tuple[str, ...] = ()  # those that import names


def league(folder: Path) -> Path:
    """Write a problem of 2024 for three robots."""
    (folder / "a.map").write_text(MAP)
    (folder / "a.agents").write_text("3\n0\n5\n18\n")
    (folder / "a.tasks").write_text("\n".join([str(len(TASKS)), *TASKS]) + "\n")
    data = {"mapFile": "a.map", "agentFile": "a.agents", "taskFile": "a.tasks", "teamSize": 3}
    (folder / "a.json").write_text(
        json.dumps({**data, "numTasksReveal": 1.5, "version": "2024 LoRR"})
    )
    return folder / "a.json"


def tables(folder: Path) -> Path:
    """Write a folder of tables; robot 0 stands on the cell of its first task."""
    (folder / "map.txt").write_text(MAP)
    (folder / "agents_0.csv").write_text("agent id,row,col\n0,0,0\n1,0,5\n2,3,0\n")
    (folder / "tasks_one.csv").write_text("targets\n0\n23\n9\n21\n3\n18\n5\n")
    return folder


def imported(problem: Path, folder: Path, *settings: str) -> Recording:
    """The recording of 60 ticks of an imported problem."""
    out = folder / "floor.yaml"
    assert main(["import", str(problem), "--out", str(out), "--ticks", "60"]) == 0
    return recorded(str(out), *STRATEGIES, *settings)


@pytest.mark.parametrize("written", [league, tables])
def test_an_exported_run_is_verified_against_its_problem(
    written: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem, out = written(tmp_path), tmp_path / "out.json"
    recording = imported(problem, tmp_path)
    (tmp_path / "run.rec").write_bytes(encoded(recording.header, recording.frames))
    assert main(["export", str(tmp_path / "run.rec"), "--planviz", str(out)]) == 0
    assert main(["verify", str(out), "--problem", str(problem)]) == 0
    assert "verified: 3 robots, 60 ticks" in capsys.readouterr().out
    output = read_output(out)
    assert output.finished > 3 and {1, 2, 3} >= {event[3] for event in output.events}
    assert {letter for path in json.loads(out.read_text())["actualPaths"] for letter in path} == (
        set("FRCW,")
    )


def test_what_is_altered_in_an_exported_run_is_found(tmp_path: Path) -> None:
    problem = league(tmp_path)
    data = planviz_output(imported(problem, tmp_path))
    tick, robot = data["events"][-1][:2]
    actions = data["actualPaths"][robot].split(",")
    moved = max(at for at, action in enumerate(actions[:tick]) if action == "F")
    actions[moved] = "W"
    data["actualPaths"][robot] = ",".join(actions)
    (tmp_path / "out.json").write_bytes(msgspec.json.encode(data))
    violation = verify_output(read_output(tmp_path / "out.json"), read_problem(problem))
    assert violation is not None and violation.tick > moved and robot in violation.robots


def of_2026(problem: Path, map_text: str = MAP) -> Path:
    """Change a problem to one of 2026 with frequent delays."""
    problem.with_name("a.map").write_text(map_text)
    delays = {"eventModel": "bernoulli", "durationModel": "uniform", "pDelay": 0.05}
    rules = {"version": "2026 LoRR", "agentCounter": 3}
    delays |= {"minDelay": 1, "maxDelay": 4}
    problem.write_text(
        json.dumps({**json.loads(problem.read_text()), **rules, "delayConfig": delays})
    )
    return problem


def test_moves_and_turns_of_several_ticks_are_exported_with_their_delays(tmp_path: Path) -> None:
    problem, out = of_2026(league(tmp_path)), tmp_path / "out.json"
    data = planviz_output(imported(problem, tmp_path, "stop.max_duration=250"))
    out.write_bytes(msgspec.json.encode(data))
    output, read = read_output(out), read_problem(problem)
    assert str(verify_output(output, read)) == "None" and output.finished > 3
    assert (data["version"], data["agentMaxCounter"], data["makespan"]) == ("2026 LoRR", 3, 250)
    assert sum(map(len, data["delayIntervals"])) > 10
    motion = motion_of(read.grid.free, output.start, 3, 1.0)
    assert isinstance(motion, SeveralTickMotion)
    for tick, action in enumerate(output.actions[:200]):
        for robot in range(3) if tick == 100 else ():
            cell = int(motion.cell[robot])
            state = (100, cell // 8 - 1, cell % 8 - 1, motion.heading[robot], motion.counter[robot])
            assert f"[({','.join(map(str, state))}):(" in data["actualPaths"][robot]
        assert motion.carry_out(tick + 1, action) is None


def test_a_robot_that_follows_waits_with_the_one_ahead(tmp_path: Path) -> None:
    """The other robots drive west to the cells 0 to 2, and are delayed on the way."""
    problem = of_2026(league(tmp_path), "type octile\nheight 1\nwidth 24\nmap\n" + "." * 24 + "\n")
    (tmp_path / "a.agents").write_text("3\n20\n21\n22\n")
    (tmp_path / "a.tasks").write_text("4\n0\n1\n2\n3\n")
    recording = imported(problem, tmp_path, "stop.max_duration=90", "world.following=convoy")
    data = planviz_output(recording)
    (tmp_path / "out.json").write_bytes(msgspec.json.encode(data))
    output = read_output(tmp_path / "out.json")
    assert str(verify_output(output, read_problem(problem))) == "None"
    driving = (output.actions == 0).sum(axis=1)
    assert (driving == 3).any() and sum(map(len, data["delayIntervals"])) > 3


def test_a_task_is_in_the_schedule_until_the_tick_in_which_it_is_finished(tmp_path: Path) -> None:
    data = planviz_output(imported(tables(tmp_path), tmp_path))
    first = min((event for event in data["events"] if event[1] == 1), key=lambda event: event[0])
    entries = [tuple(map(int, one.split(":"))) for one in data["actualSchedule"][1].split(",")]
    assert entries[0] == (1, first[2])
    assert entries[1][0] == first[0] + 1


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (("durations.turn=2",), "durations.turn is 2, other moves or turns take 1"),
        (("fleet.kinematics=omni", "fleet.heading=null"), "fleet.kinematics is omni"),
        (
            ("world.extra_tick_probability=0.1",),
            "slow zones, speed limits or random delays lengthen moves",
        ),
        (("faults.failure_probability=0.001",), "robots may break down and be towed"),
        (("fleet.when_idle=leave",), "robots leave the floor"),
        (
            ('layout.picture="======\\n======\\n======\\n======"',),
            "the floor has cells for more than",
        ),
        (
            (
                'layout.picture="t.....\\n......\\n......\\n.....t"',
                "orders={generator: visits, count: 1}",
            ),
            "its orders have loads",
        ),
    ],
)
def test_runs_that_have_no_place_in_an_output_are_refused(
    settings: tuple[str, ...], sentence: str, tmp_path: Path
) -> None:
    out = tmp_path / "floor.yaml"
    assert main(["import", str(league(tmp_path)), "--out", str(out), "--ticks", "1"]) == 0
    wait = ("strategy={allocation: first-come, right_of_way: wait}",)
    recording = recorded(str(out), *wait, *settings)
    with pytest.raises(InputError) as caught:
        planviz_output(recording)
    assert "PlanViz requires robots whose moves and turns all take" in caught.value.message
    assert sentence in caught.value.message


def test_the_recording_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = imported(league(tmp_path), tmp_path, "stop.max_duration=1")
    path = tmp_path / "run.rec"
    path.write_bytes(
        encoded(recording.header, [DecodedFrame(*frame) for frame in recording.frames])
    )
    assert main(["export", str(path), "--planviz", str(path)]) == 2
    assert "cannot write it" in capsys.readouterr().err


def test_a_branch_with_other_ticks_of_actions_is_refused(tmp_path: Path) -> None:
    recording = imported(league(tmp_path), tmp_path, "stop.max_duration=1")
    recording.header["scenario"]["durations"]["move"] = 2
    with pytest.raises(InputError, match="a branch changed durations"):
        planviz_output(recording)
