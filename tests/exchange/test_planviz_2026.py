"""Outputs of 2026, whose actions take several ticks: which rule they break first."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from automaton.commands import main
from automaton.errors import InputError
from automaton.exchange.planviz import read_output, verify_output
from automaton.exchange.planviz_paths import STEP_OF_HEADING, SeveralTickMotion
from automaton.exchange.problem_files import read_problem

# x 012   Robot 0 begins at (0, 0), robot 1 at (1, 0); both face east. An action takes 2 ticks.
MAP = "type octile\nheight 2\nwidth 3\nmap\n...\n..@\n"
TASKS = ["1,2", "4", "0", "3"]  # three are open at once
DELAYS = {"eventModel": "poisson", "durationModel": "uniform", "pDelay": 0.1}
# Robot 0 visits (0, 1) and (0, 2) for task 0. Robot 1 is delayed on its way to (1, 1) for task 1.
VALID: dict[str, Any] = {
    "actionModel": "MAPF_T",
    "version": "2026 LoRR",
    "teamSize": 2,
    "numTaskFinished": 2,
    "makespan": 6,
    "agentMaxCounter": 2,
    "outputSegmentSize": 4,
    "delayIntervals": [[], [[1, 2]]],
    "start": [[0, 0, "E"], [1, 0, "E"]],
    "actualPaths": [
        "[(0,0,0,0,0):(F 4)][(4,0,2,0,0):(W 2)]",
        "[(0,1,0,0,0):(F 1,W 1,F 1,C 1)][(4,1,1,0,1):(C 1,W 1)]",
    ],
    "actualSchedule": ["0:0,5:-1", "0:1,5:-1"],
}


def problem_file(folder: Path, starts: str = "0\n3", **changed: object) -> Path:
    (folder / "a.map").write_text(MAP)
    (folder / "a.agents").write_text(f"2\n{starts}\n")
    (folder / "a.tasks").write_text("\n".join([str(len(TASKS)), *TASKS]) + "\n")
    data = {"mapFile": "a.map", "agentFile": "a.agents", "taskFile": "a.tasks", "teamSize": 2}
    delays = DELAYS | {"minDelay": 1, "maxDelay": 4}
    rules = {"numTasksReveal": 1.5, "version": "2026 LoRR", "agentCounter": 2}
    path = folder / "problem.json"
    path.write_text(json.dumps({**data, **rules, "delayConfig": delays, **changed}))
    return path


def output_file(folder: Path, **changed: object) -> Path:
    """Write the valid output with other values; None leaves a key out."""
    path, data = folder / "out.json", {**VALID, **changed}
    path.write_text(json.dumps({key: value for key, value in data.items() if value is not None}))
    return path


def moved(*paths: str) -> dict[str, Any]:
    """The values of an output in which robots only move."""
    segments = [f"[(0,0,0,0,0):({path})]" for path in paths]
    return {
        "actualPaths": segments,
        "delayIntervals": [[], []],
        "actualSchedule": None,
        "makespan": 4,
    }


def verdict(folder: Path, problem: dict[str, Any], **changed: object) -> str:
    output = read_output(output_file(folder, **changed))
    return str(verify_output(output, read_problem(problem_file(folder, **problem))))


def test_an_output_without_events_is_verified_by_its_schedule(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, problem = output_file(tmp_path), problem_file(tmp_path)
    assert main(["verify", str(out), "--problem", str(problem)]) == 0
    shown = capsys.readouterr().out
    assert "rules: no violations\nnot checked: the ticks of visits" in shown
    bare = output_file(tmp_path, actualSchedule=None, delayIntervals=None)
    assert main(["verify", str(bare), "--problem", str(problem), "--json"]) == 0
    missing = json.loads(capsys.readouterr().out)["unchecked"]
    assert [one.split(":")[0] for one in missing] == ["delays", "visits and tasks"]


def test_listed_visits_are_checked(tmp_path: Path) -> None:
    tasks = [[0, 0, [0, 1, 0, 2]], [1, 0, [1, 1]], [2, 0, [0, 0]], [3, 3, [1, 0]]]
    listed = {"tasks": [*tasks, [4, 4, [0, 1, 0, 2]]]}
    done = [[2, 0, 0, 1], [3, 1, 1, 1], [4, 0, 0, 2]]
    assert verdict(tmp_path, {}, events=done, **listed) == "None"
    early = [[1, 0, 0, 1], *done[1:]]  # it is half-way, and counts as in its former cell
    assert verdict(tmp_path, {}, events=early, **listed).startswith(
        "tick 1: robot 0 is in row 0, column 0, not in row 0, column 1"
    )


@pytest.mark.parametrize(
    ("starts", "paths", "sentence"),
    [
        ("0\n3", ("W 4", "F 4"), "tick 3: robot 1 goes to row 1, column 2, which is not free"),
        ("0\n3", ("F 1,R 1,W 2", "W 4"), "tick 2: robot 0 turns right before its move is done"),
        ("0\n3", ("R 1,F 1,W 2", "W 4"), "tick 2: robot 0 goes forward before its turn is done"),
        ("0\n3", ("R 2,F 2", "W 4"), "tick 3: robots 0 and 1 are both in row 1, column 0"),
        (
            "0\n3",
            ("R 2,F 2", "C 2,F 2"),
            "tick 3: robots 0 and 1 exchange row 0, column 0 and row 1, column 0",
        ),
        # Around a corner, a robot must wait until the other has left.
        (
            "0\n3",
            ("W 2,F 2", "C 2,F 2"),
            "tick 3: robots 0 and 1 overlap in row 0, column 0, which",
        ),
        ("0\n3", ("F 2,W 2", "C 2,F 2"), "None"),
        # In the same direction it may follow, but not be faster.
        ("0\n1", ("F 2,W 2", "F 2,W 2"), "None"),
        ("0\n1", ("F 1,W 1,F 1,W 1", "F 1,W 1,F 1,W 1"), "None"),
        (
            "0\n1",
            ("F 2,W 2", "F 1,W 1,F 1,W 1"),
            "tick 2: robots 0 and 1 overlap in row 0, column 1",
        ),
    ],
)
def test_robots_do_not_overlap_on_their_way(
    starts: str, paths: tuple[str, str], sentence: str, tmp_path: Path
) -> None:
    begin = [[*divmod(int(cell), 3), "E"] for cell in starts.split()]
    found = verdict(tmp_path, {"starts": starts}, start=begin, numTaskFinished=0, **moved(*paths))
    assert found.startswith(sentence)


def test_small_robots_follow_around_a_corner(tmp_path: Path) -> None:
    paths = moved("W 1,F 2,W 1", "C 2,F 2")
    assert verdict(tmp_path, {}, **paths).startswith("tick 3: robots 0 and 1 overlap")
    assert verdict(tmp_path, {"agentSize": 0.5}, **paths) == "None"


@given(st.data())
def test_an_overlap_at_any_time_is_found(data: st.DataObject) -> None:
    """As gaps are whole and speeds at most 2, quarters of a tick show each overlap."""
    numbers = st.tuples(
        *[st.integers(0, 2)] * 2, st.integers(0, 3), st.integers(0, 2), st.booleans()
    )
    robots = data.draw(st.tuples(numbers, numbers))
    cell = np.array([row * 5 + column for row, column, *_ in robots])
    heading, before = (np.array([robot[k] for robot in robots]) for k in (2, 3))
    after = before + np.array([robot[4] for robot in robots])
    motion = SeveralTickMotion(np.ones(25, np.bool_), 5, cell, heading, 3)
    found = motion._meet(np.array([0]), np.array([1]), before, after)[0]

    def place(robot: int, quarters: int) -> tuple[float, ...]:
        way = (before[robot] + quarters / 4 * (after[robot] - before[robot])) / 3
        at, steps = robots[robot][:2], STEP_OF_HEADING[heading[robot]]
        return tuple(cells + step * way for cells, step in zip(at, steps, strict=True))

    gaps = [np.subtract(place(0, k), place(1, k)) for k in range(5)]
    assert found == any(np.all(np.abs(gap) < 1 - 1e-9) for gap in gaps)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        (
            {"delayIntervals": [[[2, 4]], [[1, 2]]]},
            "tick 3: robot 0 does not wait in its delay of the ticks 3 to 4",
        ),
        (
            {"delayIntervals": [[], [[4, 9]]]},
            "tick 5: robot 1 is delayed for 5 ticks, the problem says 1 to 4",
        ),
        (
            {"delayIntervals": [[], [[1, 2], [1, 2]]]},
            "tick 2: robot 1 has a delay of the ticks 1 to 2 after one to tick 2",
        ),
        (
            {"actualSchedule": ["0:0,3:2", "0:1"]},
            "tick 3: robot 0 leaves task 0, which it has begun, for task 2",
        ),
        (
            {"actualSchedule": ["0:3", "0:1"]},
            "tick 1: robot 0 has task 3, but the pool has taken in those below 3 in the schedule",
        ),
        (
            {"actualSchedule": ["0:0,5:-1", "0:0"]},
            "tick 1: robots 1 and 0 both have task 0 in the schedule",
        ),
        (
            {"actualSchedule": ["0:0,5:1", "0:1,5:-1"]},
            "tick 5: robot 0 has task 1, which is finished in the schedule",
        ),
        ({"numTaskFinished": 3}, "tick 6: numTaskFinished is 3, the schedules finish 2"),
        ({"makespan": 7}, "tick 6: makespan is 7, the paths have 6 ticks"),
        ({"start": [[0, 0, "E"], [1, 1, "E"]]}, "tick 0: robot 1 starts in row 1, column 1"),
    ],
)
def test_the_first_violation_of_delays_and_schedules_is_named(
    changed: dict[str, object], sentence: str, tmp_path: Path
) -> None:
    assert verdict(tmp_path, {}, **changed).startswith(sentence)


def test_delays_need_a_problem_with_delays(tmp_path: Path) -> None:
    assert verdict(tmp_path, {"delayConfig": None}) == (
        "tick 2: robot 1 is delayed, but the problem has no delays"
    )


@pytest.mark.parametrize(
    ("path", "sentence"),
    [
        ("[(1,0,0,0,0):(F 6)]", "robot 0 has a segment of tick 1 where tick 0 comes next"),
        ("[(0,0,0,0,0):(F 2)][(3,0,0,0,0):(F 4)]", "segment of tick 3 where tick 2 comes next"),
        ("[(0,0,0):(F 6)]", "a segment that begins with '0,0,0', not with its tick, row, column"),
        ("[(0,0,0,0,0):(F 2,X 4)]", "has the run 'X 4' after tick 2; F, R, C or W and its ticks"),
        ("[(0,0,0,0,0):(F)]", "has the run 'F' after tick 0"),
        ("[(0,0,0,0,0):(F 6)] and", "robot 0 has ' and' after tick 6"),
        ("F,F,W,W,W,W", "robot 0 has 'F,F,W,W,W,W' after tick 0"),
        ("[(0,0,0,0,0):(F 5)]", "robot 1 has 6 ticks, robot 0 has 5"),
        ("[(0,0,0,0,0):(F 999999999999)]", "robot 1 has 6 ticks, robot 0 has 999,999,999,999"),
    ],
)
def test_strange_paths_are_refused(path: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read_output(output_file(tmp_path, actualPaths=[path, VALID["actualPaths"][1]]))
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"agentMaxCounter": 0}, "agentMaxCounter must be at least 1, found 0"),
        ({"agentMaxCounter": 3}, "an action takes 3 ticks, 2 in the problem"),
        ({"delayIntervals": [[]]}, "delayIntervals has 1 entries, teamSize is 2"),
        ({"version": None, "agentMaxCounter": None}, "the key 'version' is missing"),
    ],
)
def test_outputs_that_do_not_fit_are_refused(
    changed: dict[str, object], sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        verdict(tmp_path, {}, **changed)
    assert sentence in str(caught.value)
