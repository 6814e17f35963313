"""Problems of other programs: what their files say, and where a mistake stands in them."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.exchange.problem import Problem, connected_parts, read_map
from automaton.exchange.problem_files import read_problem
from automaton.scenario.fleet import BellDelays
from automaton.world.resolve import resolve

# x 0123   a part of its own at x 3, y 2
MAP = """type octile
height 3
width 4
map
.G@.
SE.@
TOW.
"""
AGENTS = "# of two robots\n2\n0\n5\n"
DELAYS = {
    **{"seed": 0, "minDelay": 5, "maxDelay": 12, "eventModel": "poisson", "pDelay": 0.003},
    **{"durationModel": "gaussian", "gaussMeanRatio": 0.4, "gaussStdRatio": 0.22},
}
TASKS = "# tasks\n3\n1,4\n6\n0,1,4,5,6\n"


def league(folder: Path, agents: str = AGENTS, tasks: str = TASKS, **changed: object) -> Path:
    """Write a problem of the league of 2024; None leaves a key out."""
    (folder / "a.map").write_text(MAP)
    (folder / "a.agents").write_text(agents)
    (folder / "a.tasks").write_text(tasks)
    data: dict[str, object] = {"mapFile": "a.map", "agentFile": "a.agents", "taskFile": "a.tasks"}
    data |= {"teamSize": 2, "numTasksReveal": 1.5, "version": "2024 LoRR"} | changed
    path = folder / "problem.json"
    path.write_text(json.dumps({key: value for key, value in data.items() if value is not None}))
    return path


def tables(folder: Path, targets: str = "targets\n1\n4\n", **agents: str) -> Path:
    """Write a folder of tables, with a file of starts for each text."""
    (folder / "map.txt").write_text(MAP)
    (folder / "tasks_one.csv").write_text(targets)
    for number, text in enumerate(agents.values()):
        (folder / f"agents_{number}.csv").write_text(text)
    return folder


def scen(folder: Path, lines: str) -> Path:
    (folder / "a.map").write_text(MAP)
    path = folder / "a.scen"
    path.write_text("version 1\n" + lines.replace(" ", "\t"))
    return path


def refusal(path: Path, robots: int | None = None) -> str:
    """The sentence about a problem, its file named from the problem's folder."""
    with pytest.raises(InputError) as caught:
        read_problem(path, robots)
    folder = path if path.is_dir() else path.parent
    return str(caught.value).replace(f"{folder}{os.sep}", "")


def test_a_map_says_where_robots_may_be(tmp_path: Path) -> None:
    (tmp_path / "a.map").write_text(MAP)
    grid = read_map(tmp_path / "a.map")
    assert ["".join(".#"[not cell] for cell in row) for row in grid.free] == [
        "..#.",
        "...#",
        "###.",
    ]


def test_parts_of_a_map_hang_together_along_rows_and_columns() -> None:
    rows = [".#...", ".#.#.", "..##."]
    free = np.array([[symbol == "." for symbol in row] for row in rows])
    parts = connected_parts(free)
    assert set(parts[free].tolist()) == {1, 2} and not parts[~free].any()
    assert parts[0, 0] == parts[2, 1] != parts[0, 2] == parts[2, 4]


def test_a_problem_of_2024_is_a_pool(tmp_path: Path) -> None:
    problem = read_problem(league(tmp_path))
    assert problem.name == "problem" and problem.starts.tolist() == [0, 5]
    assert problem.tasks == ((1, 4), (6,), (0, 1, 4, 5, 6))
    assert (problem.assignment, problem.open_tasks, problem.repeat) == ("pool", 3, True)


def test_in_a_problem_of_2026_actions_take_ticks_and_robots_are_delayed(tmp_path: Path) -> None:
    league(tmp_path, version="2026 LoRR", agentCounter=3, delayConfig=DELAYS)
    assert main(["import", f"{tmp_path}/problem.json", "--out", f"{tmp_path}/x.yaml"]) == 0
    scenario = resolve(tmp_path / "x.yaml").scenario
    assert (scenario.durations.move, scenario.durations.turn) == (3, 3)
    assert scenario.orders.assign == "pool" and scenario.orders.revealed == 1.5
    delays = scenario.faults.delays
    assert delays is not None and isinstance(delays.distribution, BellDelays)
    assert (delays.probability, delays.events) == (0.003, "poisson")
    assert (delays.ticks.least, delays.ticks.most) == (5, 12)
    assert delays.distribution.gaussian.mean_ratio == 0.4
    assert main(["run", f"{tmp_path}/x.yaml", "--until", "200"]) in (0, 1)
    none = league(tmp_path, version="2026 LoRR", delayConfig=DELAYS | {"pDelay": 0})
    assert read_problem(none).delays is None and read_problem(none).action_ticks == 1


def test_the_first_robots_of_a_problem_are_a_smaller_one(tmp_path: Path) -> None:
    problem = read_problem(league(tmp_path), robots=1)
    assert problem.starts.tolist() == [0] and problem.open_tasks == 1


@pytest.mark.parametrize(
    ("strategy", "repeat"), [("roundrobin", True), ("roundrobin-fixed", False), (None, True)]
)
def test_a_problem_of_2023_deals_tasks_out_in_turn(
    strategy: str | None, repeat: bool, tmp_path: Path
) -> None:
    path = league(
        tmp_path,
        tasks="2\n1\n6\n",
        version=None,
        numTasksReveal=1,
        taskAssignmentStrategy=strategy,
    )
    problem = read_problem(path)
    assert (problem.assignment, problem.repeat) == ("round-robin", repeat)
    assert problem.tasks == ((1,), (6,)) and not problem.skip_reached


def test_a_folder_has_starts_for_several_fleets(tmp_path: Path) -> None:
    one, two = "agent id,row,col\n0,1,2\n", "agent id,row,col\n0,0,0\n1,1,1\n"
    folder = tables(tmp_path, a=one, b=two)
    assert read_problem(folder, 1).starts.tolist() == [6]
    problem = read_problem(folder, 2)
    assert problem.starts.tolist() == [0, 5] and problem.tasks == ((1,), (4,))
    assert (problem.assignment, problem.skip_reached) == ("round-robin", True)
    assert "give --robots: there are starts for 1, 2 robots" in refusal(folder)
    assert "--robots 3 is not possible: there are starts for 1, 2 robots" in refusal(folder, 3)


def test_cells_of_a_folder_may_be_counted_from_one(tmp_path: Path) -> None:
    robot = "agent id,row,col\n0,0,0\n"
    assert read_problem(tables(tmp_path, "targets\n1\n5\n7\n", a=robot)).tasks == ((0,), (4,), (6,))


def test_each_robot_of_a_scenario_has_one_goal(tmp_path: Path) -> None:
    path = scen(tmp_path, "0 a.map 4 3 0 0 1 1 2.0\n1 maps/a.map 4 3 2 1 0 1 2\n")
    assert "names the map 'maps/a.map', but the first line 'a.map'" in refusal(path)
    path = scen(tmp_path, "0 x/a.map 4 3 0 0 1 1 2.0\n1 x/a.map 4 3 2 1 0 1 2\n")
    problem = read_problem(path)
    assert problem.starts.tolist() == [0, 6] and problem.tasks == ((5,), (4,))
    assert (problem.assignment, problem.repeat) == ("round-robin", False)
    assert read_problem(path, 1).tasks == ((5,),)


def test_the_name_of_a_map_may_have_blanks_between_tabs(tmp_path: Path) -> None:
    path = scen(tmp_path, "")
    (tmp_path / "my map.map").write_text(MAP)
    path.write_text("version 1\n0\tmy map.map\t4\t3\t0\t0\t1\t1\t2.0\n")
    assert read_problem(path).starts.tolist() == [0]


def test_a_map_alone_gets_random_robots_and_tasks_in_its_largest_part(tmp_path: Path) -> None:
    (tmp_path / "a.map").write_text(MAP)
    problem, again = (read_problem(tmp_path / "a.map", 3) for _ in range(2))
    part = {0, 1, 4, 5, 6}
    assert len(set(problem.starts.tolist())) == 3 and set(problem.starts.tolist()) <= part
    assert {cell for task in problem.tasks for cell in task} <= part
    assert problem.starts.tolist() == again.starts.tolist() and problem.tasks == again.tasks
    assert "has 5 free cells" in refusal(tmp_path / "a.map", 6)


def test_what_is_not_a_problem_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("")
    assert "is not in one of the formats that are read: VDMA LIF, openTCS" in refusal(
        tmp_path / "a.txt"
    )
    assert "no such file" in refusal(tmp_path / "b.map")
    assert "a folder of a problem must hold map.txt" in refusal(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "type octile",
            "type hex",
            "a.map:1: line 1 of a map must be 'type octile', found 'type h",
        ),
        ("height 3", "height three", "a.map:2: line 2 of a map must be 'height N', found 'height"),
        ("width 4\nmap", "map\nwidth 4", "a.map:3: line 3 of a map must be 'width N', found 'map'"),
        ("width 4", "width 0", "a.map:3: a side must have 1 to 4,096 cells, found 0"),
        ("SE.@", "SE.", "a.map:6: column 4: the row has 3 cells, the width is 4"),
        ("SE.@", "SE.@.", "a.map:6: column 5: the row has 5 cells, the width is 4"),
        ("SE.@", "SEx@", "a.map:6: column 3: unknown symbol 'x'; free are . G S E, blocked are"),
        ("TOW.\n", "", "a.map:6: the map has 2 rows, its height is 3"),
        ("TOW.\n", "TOW.\n....\n", "a.map:8: the map has 4 rows, its height is 3"),
        (MAP, "", "a.map:1: line 1 of a map must be 'type octile', found nothing"),
    ],
)
def test_a_bad_map_is_refused_with_line_and_column(
    old: str, new: str, sentence: str, tmp_path: Path
) -> None:
    (tmp_path / "a.map").write_text(MAP.replace(old, new))
    assert sentence in refusal(tmp_path / "a.map")


@pytest.mark.parametrize(
    ("agents", "sentence"),
    [
        ("2\n0\n2\n", "a.agents:3: robot 1 starts in row 0, column 2, which is blocked"),
        ("2\n0\n12\n", "a.agents:3: robot 1 starts in cell 12, outside the map (cells 0 to 11)"),
        ("2\n\n5\n5\n", "a.agents:4: robot 1 starts in row 1, column 1, where robot 0 starts"),
        ("3\n0\n5\n", "a.agents:1: line 1 says 3 agents, the file has 2"),
        ("1\n0\n5\n", "a.agents:3: line 1 says 1 agent, the file has 2"),
        ("2\n0\n5;\n", "a.agents:3: a start must be a whole number, found '5;'"),
        ("# nothing\n", "a.agents: is empty; its first line must be the number of agents"),
        ("1\n0\n", "problem.json: teamSize is 2, but a.agents has 1 robot"),
    ],
)
def test_bad_starts_are_refused_with_their_line(agents: str, sentence: str, tmp_path: Path) -> None:
    assert sentence in refusal(league(tmp_path, agents=agents))


@pytest.mark.parametrize(
    ("tasks", "sentence"),
    [
        ("1\n1,8\n", "a.tasks:2: task 0 visits row 2, column 0, which is blocked"),
        ("2\n1\n4,-1\n", "a.tasks:3: task 1 visits cell -1, outside the map"),
        ("2\n1\n3\n", "a.tasks:3: task 1 visits row 0, column 3, which no robot can reach"),
        ("3\n1\n4\n", "a.tasks:1: line 1 says 3 tasks, the file has 2"),
        ("1\n1,x\n", "a.tasks:2: column 3: a cell of a task must be a whole number, found 'x'"),
        ("1\n1,,4\n", "a.tasks:2: column 3: a cell of a task must be a whole number, found not"),
        ("1\n0,1,0,1,0,1\n", "a.tasks:2: the task has 6 cells, at most 5 are possible"),
        ("two\n1\n4\n", "a.tasks:1: the number of tasks must be a whole number, found 'two'"),
    ],
)
def test_bad_tasks_are_refused_with_their_line(tasks: str, sentence: str, tmp_path: Path) -> None:
    assert sentence in refusal(league(tmp_path, tasks=tasks))


def test_a_task_in_two_parts_of_the_map_is_refused(tmp_path: Path) -> None:
    path = league(tmp_path, agents="2\n0\n3\n", tasks="1\n1,3\n")
    assert "a.tasks:2: task 0 leads from row 0, column 1 to row 0, column 3" in refusal(path)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"mapFile": None}, "problem.json: the key 'mapFile' (the file of a map) is missing"),
        ({"teamSize": None, "teamsize": 2}, "is missing (did you mean 'teamsize'?)"),
        ({"teamSize": 2.5}, "teamSize must be a whole number from 1 to 1,000,000, found 2.5"),
        ({"numTasksReveal": "all"}, "numTasksReveal must be a number from 1 to 1,000, found 'all'"),
        (
            {"version": "2031 LoRR"},
            "version must be '2026 LoRR', '2024 LoRR', '2023 LoRR' or left out, found",
        ),
        ({"taskFile": 3}, "taskFile must be the file of the tasks, found '3'"),
        ({"taskFile": "b.tasks"}, "b.tasks: no such file"),
        (
            {"version": None, "taskAssignmentStrategy": "greedy"},
            "taskAssignmentStrategy must be roundrobin or roundrobin-fixed (a problem of 2023)",
        ),
        (
            {"agentCounter": 0},
            "problem.json: agentCounter must be a whole number from 1 to 1,000, found 0",
        ),
        ({"delayConfig": 3}, "delayConfig must be a mapping, found 3"),
        ({"delayConfig": {}}, "the key 'pDelay' (a number) is missing"),
        ({"delayConfig": DELAYS | {"pDelay": 2}}, "pDelay must be a number from 0 to 1, found 2"),
        (
            {"delayConfig": DELAYS | {"maxDelay": 4}},
            "maxDelay must be a whole number from 5 to 1,000,000, found 4",
        ),
        (
            {"delayConfig": DELAYS | {"eventModel": "often"}},
            "eventModel must be bernoulli or poisson, found 'often'",
        ),
    ],
)
def test_bad_keys_of_a_problem_are_named(
    changed: dict[str, object], sentence: str, tmp_path: Path
) -> None:
    assert sentence in refusal(league(tmp_path, AGENTS, TASKS, **changed))


def test_more_robots_than_free_cells_are_refused(tmp_path: Path) -> None:
    path = league(tmp_path, agents="8\n0\n1\n3\n4\n5\n6\n11\n0\n", teamSize=8)
    assert "a.agents: 8 robots, but the map has 7 free cells" in refusal(path)
    assert "--robots 3 but the problem has 2 robots" in refusal(league(tmp_path), 3)


@pytest.mark.parametrize("text", ["", "[1]", '{"mapFile": '])
def test_what_is_not_a_json_object_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "problem.json"
    path.write_text(text)
    assert refusal(path).startswith(("problem.json: is not valid JSON", "problem.json: a problem"))


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        ("", "a.scen:1: holds no start and goal below 'version 1'"),
        ("0 a.map 4 3 0 0 1 1\n", "a.scen:2: the line has 8 columns, a scenario has 9: bucket"),
        ("0 b.map 4 3 0 0 1 1 2\n", "a.scen:2: there is no map 'b.map' next to the file"),
        ("0 a.map 5 3 0 0 1 1 2\n", "a.scen:2: the line says 5 x 3 cells, the map has 4 x 3"),
        ("0 a.map 4 3 0 0 4 1 2\n", "a.scen:2: the goal x 4, y 1 lies outside the map (x 0..3"),
        ("0 a.map 4 3 0 0 0 2 2\n", "a.scen:2: task 0 visits row 2, column 0, which is bl"),
        ("0 a.map 4 3 0 a 1 1 2\n", "a.scen:2: start y must be a whole number, found 'a'"),
    ],
)
def test_bad_scenarios_are_refused_with_their_line(
    lines: str, sentence: str, tmp_path: Path
) -> None:
    assert sentence in refusal(scen(tmp_path, lines))


@pytest.mark.parametrize(
    ("agents", "targets", "sentence"),
    [
        (
            "id,row,col\n0,0,0\n",
            "targets\n1\n",
            "agents_0.csv:1: its header must be 'agent id,row,",
        ),
        ("agent id,row,col\n0,0\n", "targets\n1\n", "agents_0.csv:2: the line has 2 values"),
        ("agent id,row,col\n0,0,4\n", "targets\n1\n", "agents_0.csv:2: the start in row 0, column"),
        ("agent id,row,col\n", "targets\n1\n", "agents_0.csv:1: has no rows below its header"),
        ("agent id,row,col\n0,0,0\n", "targets\n1\n8\n", "tasks_one.csv:3: task 1 visits"),
        ("agent id,row,col\n0,0,0\n", "1\n4\n", "tasks_one.csv:1: its header must be 'targets'"),
    ],
)
def test_bad_tables_are_refused_with_their_line(
    agents: str, targets: str, sentence: str, tmp_path: Path
) -> None:
    assert sentence in refusal(tables(tmp_path, targets, a=agents))


def test_a_problem_counts_its_open_tasks_downwards(tmp_path: Path) -> None:
    problem = read_problem(league(tmp_path))
    odd = Problem("odd", problem.grid, problem.starts[:1], problem.tasks, "pool", revealed=1.9)
    assert odd.open_tasks == 1
