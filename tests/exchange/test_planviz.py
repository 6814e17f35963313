"""Outputs of other programs: which rule they break first, and what makes them unreadable."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.exchange.planviz import PlanViolation, read_output, verify_output
from automaton.exchange.problem_files import read_problem

# x 012   Robot 0 begins at (0, 0), robot 1 at (0, 1); both face east.
MAP = "type octile\nheight 2\nwidth 3\nmap\n...\n..@\n"
TASKS = ["1,2", "4", "0", "3"]  # three are open at once
# Robot 0 goes east twice: visits 1 and 2 of task 0. Robot 1 goes to (1, 1), and on to (1, 0).
VALID: dict[str, Any] = {
    "actionModel": "MAPF_T",
    "version": "2024 LoRR",
    "teamSize": 2,
    "start": [[0, 0, "E"], [1, 0, "E"]],
    "numTaskFinished": 2,
    "sumOfCost": 6,
    "makespan": 3,
    "actualPaths": ["F,F,W", "F,C,F"],
    "plannerPaths": ["F,F,W", "F,C,F"],
    "errors": [],
    "actualSchedule": ["0:0,2:-1", "0:1,1:-1"],
    "events": [[1, 0, 0, 1], [1, 1, 1, 1], [2, 0, 0, 2]],
    "tasks": [
        [0, 0, [0, 1, 0, 2]],
        [1, 0, [1, 1]],
        [2, 0, [0, 0]],
        [3, 1, [1, 0]],
        [4, 2, [0, 1, 0, 2]],
    ],
}


def problem_file(folder: Path, season: str = "2024 LoRR", tasks: list[str] = TASKS) -> Path:
    (folder / "a.map").write_text(MAP)
    (folder / "a.agents").write_text("2\n0\n3\n")
    (folder / "a.tasks").write_text("\n".join([str(len(tasks)), *tasks]) + "\n")
    data = {"mapFile": "a.map", "agentFile": "a.agents", "taskFile": "a.tasks", "teamSize": 2}
    path = folder / "problem.json"
    path.write_text(json.dumps({**data, "numTasksReveal": 1.5, "version": season}))
    return path


def output_file(folder: Path, **changed: object) -> Path:
    """Write the valid output with other values; None leaves a key out."""
    data = {**VALID, **changed}
    path = folder / "out.json"
    path.write_text(json.dumps({key: value for key, value in data.items() if value is not None}))
    return path


def verdict(
    folder: Path, season: str = "2024 LoRR", tasks_of: list[str] = TASKS, **changed: object
) -> PlanViolation | None:
    output = read_output(output_file(folder, **changed))
    return verify_output(output, read_problem(problem_file(folder, season, tasks_of)))


def events(*changed: list[int]) -> list[list[int]]:
    return sorted([*VALID["events"], *changed])


def test_a_task_far_down_a_list_that_repeats_is_looked_for_once(tmp_path: Path) -> None:
    """The robot passes over the tasks in its cell, (0, 1), and over no others."""
    far = 2 * 10**18
    (tmp_path / "map.txt").write_text(MAP)
    (tmp_path / "agents_1.csv").write_text("agent id,row,col\n0,0,0\n")
    output = output_file(
        tmp_path,
        teamSize=1,
        start=[[0, 0, "E"]],
        sumOfCost=2,
        makespan=2,
        actualPaths=["F,W"],
        plannerPaths=["F,W"],
        actualSchedule=[f"0:0,2:{far}"],
        events=[[1, 0, 0, 1], [2, 0, far, 1]],
        tasks=[[0, 0, [0, 1]], [far, 0, [0, 1]]],
    )
    for tasks, expected in (("1\n1\n", None), ("1\n3\n", "which is not its next one")):
        (tmp_path / "tasks_one.csv").write_text("targets\n" + tasks)
        found = verify_output(read_output(output), read_problem(tmp_path))
        assert found is expected is None or expected in str(found)


def test_an_output_that_keeps_the_rules_is_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, problem = output_file(tmp_path), problem_file(tmp_path)
    assert main(["verify", str(out), "--problem", str(problem)]) == 0
    assert "verified: 2 robots, 3 ticks, 2 tasks finished\nrules: no violations" in (
        capsys.readouterr().out
    )


def test_a_violation_is_named_with_exit_code_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, problem = output_file(tmp_path, actualPaths=["F,F,F", "F,C,F"]), problem_file(tmp_path)
    assert main(["verify", str(out), "--problem", str(problem)]) == 1
    assert "not verified: 2 robots, 3 ticks" in capsys.readouterr().out
    assert main(["verify", str(out), "--problem", str(problem), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["verified"], found["violation"]["tick"]) == (False, 3)
    assert found["violation"]["robots"] == [0] and found["violation"]["rule"] == "wall"


def test_an_output_without_its_problem_is_not_a_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", str(output_file(tmp_path))]) == 2
    assert "to check an output file, name its problem with --problem" in capsys.readouterr().err


def test_actions_may_be_written_without_commas(tmp_path: Path) -> None:
    assert verdict(tmp_path, actualPaths=["FFW", "FCF"]) is None


@pytest.mark.parametrize(
    ("paths", "sentence"),
    [
        # A wall, and the edge of the map.
        (["F,F,W", "F,F,W"], "tick 2: robot 1 goes to row 1, column 2, which is not free"),
        (["C,F,W", "F,W,W"], "tick 2: robot 0 goes to row -1, column 0, which is not free"),
        (["F,F,F", "F,W,W"], "tick 3: robot 0 goes to row 0, column 3, which is not free"),
        # Two robots into one cell, and one into that of another which stays.
        (["F,R,F", "F,W,W"], "tick 3: robots 0 and 1 are both in row 1, column 1"),
        (["R,F,W", "W,W,W"], "tick 2: robots 0 and 1 are both in row 1, column 0"),
        # An exchange of two cells.
        (["R,F,W", "C,F,W"], "tick 2: robots 0 and 1 exchange row 0, column 0 and row 1, column 0"),
    ],
)
def test_the_first_violation_of_motion_is_named(
    paths: list[str], sentence: str, tmp_path: Path
) -> None:
    out = {"events": [], "tasks": VALID["tasks"][:3], "numTaskFinished": 0}
    assert str(verdict(tmp_path, actualPaths=paths, **out)) == sentence


def test_robots_may_follow_each_other_in_one_tick(tmp_path: Path) -> None:
    # Robot 1 turns north, robot 0 leaves its cell to the east, and robot 1 enters it.
    out = {"events": [], "tasks": VALID["tasks"][:3], "numTaskFinished": 0}
    out["actualSchedule"] = ["", ""]
    assert verdict(tmp_path, actualPaths=["W,F,W", "C,F,W"], **out) is None


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        (
            {"start": [[0, 0, "E"], [1, 1, "E"]]},
            "tick 0: robot 1 starts in row 1, column 1, heading E; the problem says row 1, column 0",
        ),
        (
            {"start": [[0, 0, "S"], [1, 0, "E"]]},
            "tick 0: robot 0 starts in row 0, column 0, headin",
        ),
        ({"start": [[0, 9, "E"], [1, 0, "E"]]}, "tick 0: robot 0 starts in row 0, column 9"),
        (
            {"events": [[2, 0, 0, 1], [1, 1, 1, 1], [3, 0, 0, 2]]},
            "tick 2: robot 0 is in row 0, column 2, not in row 0, column 1 for task 0",
        ),
        (
            {"events": [[1, 0, 0, 2], [1, 1, 1, 1]]},
            "tick 1: robot 0 does visit 2 of task 0, after 0 of 2 visits",
        ),
        (
            {"events": events([3, 0, 0, 3])},
            "tick 3: robot 0 visits for task 0, which is finished",
        ),
        (
            {"events": events([3, 1, 2, 1]), "tasks": [*VALID["tasks"], [5, 3, [1, 1]]]},
            "tick 3: robot 1 is in row 0, column 1, not in row 0, column 0 for task 2",
        ),
        (
            {"actualSchedule": ["0:0,2:-1", "0:3,1:-1"]},
            "tick 1: robot 1 visits for task 1, which is not scheduled for it then",
        ),
        (
            {"tasks": [[0, 1, [0, 1, 0, 2]], *VALID["tasks"][1:]]},
            "tick 1: robot 0 visits for task 0, which is released at the end of tick 1",
        ),
        (
            {"tasks": [*VALID["tasks"][:3], [3, 1, [0, 0]], VALID["tasks"][4]]},
            "tick 1: task 3 has other cells than those of the problem: row 1, column 0",
        ),
        (
            {"tasks": [*VALID["tasks"][:3], [3, 2, [1, 0]], VALID["tasks"][4]]},
            "tick 1: task 3 is released in tick 2; the pool takes it in at the end of tick 1",
        ),
        ({"tasks": VALID["tasks"][:4]}, "tick 2: task 4 is missing; the pool takes it in at the"),
        (
            {"tasks": [*VALID["tasks"], [5, 2, [1, 1]]]},
            "tick 3: there are 6 tasks, 5 were released",
        ),
        ({"numTaskFinished": 3}, "tick 3: numTaskFinished is 3, the events finish 2"),
        ({"makespan": 4}, "tick 3: makespan is 4, the paths have 3 ticks"),
        ({"sumOfCost": 7}, "tick 3: sumOfCost is 7, robots times ticks are 6"),
        (
            {"events": [*VALID["events"], VALID["events"][-1]]},
            "tick 2: robot 0 visits for task 0, which is finished",
        ),
    ],
)
def test_the_first_violation_of_tasks_is_named(
    changed: dict[str, object], sentence: str, tmp_path: Path
) -> None:
    assert str(verdict(tmp_path, "2024 LoRR", TASKS, **changed)).startswith(sentence)


def test_a_begun_task_stays_with_its_robot(tmp_path: Path) -> None:
    # Robot 1 follows robot 0, to the cell of the second visit of its task.
    paths = ["F,R,F", "C,F,R,F,F"]
    changed = {
        "actualPaths": [f"{paths[0]},R,F", paths[1]],
        "events": [[1, 0, 0, 1], [5, 1, 0, 2]],
        "actualSchedule": ["0:0", "0:0"],
        "tasks": VALID["tasks"][:3],
    }
    found = verdict(tmp_path, "2024 LoRR", TASKS, **changed)
    assert found is not None and (found.tick, found.robots) == (5, (1, 0))


def test_a_robot_finishes_what_it_has_begun_first(tmp_path: Path) -> None:
    # Robot 0 goes east (visit 1 of task 0), then turns and goes to the cell of task 1.
    changed = {
        "actualPaths": ["F,R,F", "W,W,W"],
        "events": [[1, 0, 0, 1], [3, 0, 1, 1]],
        "actualSchedule": ["0:0,2:1", ""],
        "tasks": VALID["tasks"][:3],
    }
    assert str(verdict(tmp_path, "2024 LoRR", TASKS, **changed)).startswith(
        "tick 3: robot 0 visits for task 1 before task 0, which it has begun"
    )


def test_one_visit_a_tick(tmp_path: Path) -> None:
    changed = {"events": events([1, 1, 4, 1]), "actualSchedule": ["0:0", "0:1,1:4"]}
    changed["tasks"] = [*VALID["tasks"][:4], [4, 0, [0, 1, 0, 2]]]
    assert str(verdict(tmp_path, "2024 LoRR", TASKS, **changed)) == (
        "tick 1: robot 1 does a second visit in the tick, for task 4"
    )


def test_tasks_of_2023_are_dealt_out_in_turn(tmp_path: Path) -> None:
    # Robot 0 has the tasks 0, 2, 0, ... and robot 1 has 1, 3, 1, ...
    tasks = VALID["tasks"][:3]
    assert verdict(tmp_path, "", tasks=tasks) is None
    found = verdict(
        tmp_path,
        "",
        tasks=VALID["tasks"][:4],
        events=[[1, 1, 1, 1]],
        actualPaths=["F,W,W", "F,W,W"],
        actualSchedule=["", "0:1"],
        numTaskFinished=1,
    )
    assert found is None
    swapped = verdict(tmp_path, "", tasks=tasks, events=[[1, 1, 0, 1]], actualSchedule=["", "0:0"])
    assert str(swapped).startswith("tick 1: robot 1 is in row 1, column 1, not in row 0, column 1")


OF_2023: dict[str, Any] = {
    "version": None,
    "actualSchedule": None,
    "actualPaths": ["F,F,W", "F,R,W"],
    "numTaskFinished": 1,
    # Tasks are numbered as they are given; robot 1 does line 1, and line 3 comes next.
    "events": [[[0, 0, "assigned"]], [[1, 0, "assigned"], [1, 1, "finished"], [2, 1, "assigned"]]],
    "tasks": [[0, 0, 1], [1, 1, 1], [2, 1, 0]],
}


def test_outputs_of_2023_are_read(tmp_path: Path) -> None:
    output = read_output(output_file(tmp_path, **OF_2023))
    assert output.events == [(1, 1, 1, 1)] and output.schedule is None
    assert {task: released for task, (released, _) in output.tasks.items()} == {0: 0, 1: 0, 3: 1}
    assert verdict(tmp_path, "2023 LoRR", ["1", "4", "0", "3"], **OF_2023) is None
    late = {**OF_2023, "actualPaths": ["F,F,W", "W,R,W"]}
    assert str(verdict(tmp_path, "2023 LoRR", ["1", "4", "0", "3"], **late)).startswith(
        "tick 1: robot 1 is in row 1, column 0, not in row 1, column 1 for task 1"
    )


@pytest.mark.parametrize(
    ("events", "sentence"),
    [
        ([[[0, 1, "finished"]], []], "events[0] has [0, 1, 'finished']: tasks are assigned once"),
        ([[[0, 0, "done"]], []], "events[0] has [0, 0, 'done']"),
        ([[[7, 0, "assigned"]], []], "events[0] has [7, 0, 'assigned']"),
        ([[[0, 0, "assigned"]]], "events has 1 entries, teamSize is 2"),
        ([[[0, 0]], []], "events[0][0]"),
    ],
)
def test_strange_outputs_of_2023_are_refused(
    events: list[Any], sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        read_output(output_file(tmp_path, **{**OF_2023, "events": events}))
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        *(({key: None}, f"the key '{key}' is missing") for key in VALID),
        ({"actionModel": "MAPF"}, "actionModel must be MAPF_T, found 'MAPF'"),
        ({"teamSize": 3}, "start has 2 entries, teamSize is 3"),
        ({"teamSize": 0, "start": []}, "actualPaths has 2 entries, teamSize is 0"),
        ({"actualPaths": ["F,F,W"]}, "actualPaths has 1 entries, teamSize is 2"),
        ({"actualPaths": ["F,F,W", "F,C"]}, "actualPaths: robot 1 has 2 actions, robot 0 has 3"),
        ({"actualPaths": ["F,F,W", "F,X,F"]}, "robot 1 has the action 'X' in tick 2; F, R, C and"),
        ({"actualPaths": ["F,F,é", "F,C,F"]}, "robot 0 has the action 'é' in tick 3"),
        ({"actualPaths": ["F,F,W", ",FCF,"]}, "actualPaths: robot 1 has misplaced commas"),
        ({"plannerPaths": []}, "plannerPaths has 0 entries, teamSize is 2"),
        ({"start": [[0, 0], [1, 0, "E"]]}, "start[0]"),
        ({"start": [[0, 0, "X"], [1, 0, "E"]]}, "start[0] has the heading 'X'; E, S, W and N"),
        ({"events": [[4, 0, 0, 1]]}, "events[0] is of tick 4; the ticks are 1 to 3"),
        ({"events": [[1, 2, 0, 1]]}, "events[0] is of robot 2; there are robots 0 to 1"),
        ({"events": [[1, 0, 9, 1]]}, "events[0] is of task 9, which is not among the tasks"),
        ({"events": [[1, 0, "0", 1]]}, "events[0][2] must be a whole number, found '0'"),
        ({"tasks": [[0, 0, [1]]]}, "tasks[0] has 1 number for its cells, not a row and a column"),
        ({"tasks": [[0, 0, [0, 1]], [0, 0, [0, 1]]]}, "tasks[1] repeats task 0"),
        ({"actualSchedule": ["0", ""]}, "actualSchedule: robot 0 has '0', not 'tick:task'"),
        ({"numTaskFinished": "2"}, "numTaskFinished must be a whole number, found '2'"),
    ],
)
def test_strange_outputs_are_refused(
    changed: dict[str, object], sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        read_output(output_file(tmp_path, **changed))
    assert "out.json: " in str(caught.value) and sentence in str(caught.value)


def test_an_output_for_another_fleet_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = {
        key: VALID[key][:1] for key in ("start", "actualPaths", "plannerPaths", "actualSchedule")
    }
    out = output_file(tmp_path, teamSize=1, events=[], **one)
    assert main(["verify", str(out), "--problem", str(problem_file(tmp_path))]) == 2
    assert "teamSize is 1, the problem has 2 robots" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "[]", '{"teamSize": 2', "\x93AUTOMATON"])
def test_what_is_not_an_output_is_refused(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.json"
    out.write_bytes(text.encode("latin-1"))
    assert main(["verify", str(out), "--problem", str(problem_file(tmp_path))]) == 2
    assert "out.json: " in capsys.readouterr().err
