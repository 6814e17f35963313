"""One-shot problems: robots stay on their targets, make room meanwhile, and return."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mapf_trials import attempt, command, draw_problem

from automaton.world.resolve import resolve

OPEN_FLOOR = "......\n.@..@.\n......\n.@..@.\n......"
LANE = ".....\n@@.@@"
DEAD_END = "...\n@@@"


def drawn(folder: Path, rows: str, *trips: tuple[int, int, int, int]) -> Path:
    """Write a map and a problem; `trips`: start x, start y, goal x, goal y."""
    lines = rows.splitlines()
    size = f"{len(lines[0])}\t{len(lines)}"
    head = f"type octile\nheight {len(lines)}\nwidth {len(lines[0])}\nmap\n"
    (folder / "a.map").write_text(f"{head}{rows}\n")
    ends = ["\t".join(map(str, ("0", "a.map", size, *trip, "0"))) for trip in trips]
    (folder / "problem.scen").write_text("\n".join(["version 1", *ends, ""]))
    return folder / "problem.scen"


def test_drawn_problems_are_solved_and_their_costs_are_those_of_the_paths(tmp_path: Path) -> None:
    drawn(tmp_path, OPEN_FLOOR, (0, 0, 0, 0))
    (tmp_path / "problem").mkdir()
    for seed in range(3):
        problem = draw_problem(tmp_path / "a.map", 8, seed, tmp_path / "problem")
        result = attempt(problem, "pibt", ticks=300)
        assert (result.solved, result.wrong) == (True, "")


def test_a_robot_on_its_target_makes_room_and_returns_and_all_of_it_counts(tmp_path: Path) -> None:
    alone = attempt(drawn(tmp_path, OPEN_FLOOR, (1, 0, 2, 0)), "pibt", ticks=100)
    assert (alone.makespan, alone.sum_of_costs) == (1, 1)
    result = attempt(drawn(tmp_path, OPEN_FLOOR, (1, 0, 2, 0), (0, 0, 5, 0)), "pibt", ticks=100)
    assert (result.solved, result.wrong) == (True, "")
    assert result.sum_of_costs > 5 + alone.sum_of_costs


def test_a_robot_that_starts_on_its_target_costs_nothing(tmp_path: Path) -> None:
    result = attempt(drawn(tmp_path, LANE, (2, 1, 2, 1), (0, 0, 1, 0)), "pibt", ticks=100)
    assert (result.solved, result.makespan, result.sum_of_costs, result.wrong) == (True, 1, 1, "")


def test_an_unsolvable_problem_says_so_in_one_sentence(tmp_path: Path) -> None:
    problem = drawn(tmp_path, DEAD_END, (0, 0, 2, 0), (2, 0, 0, 0))
    result = attempt(problem, "pibt", ticks=50)
    assert (result.solved, result.wrong) == (False, "")
    code, _, complaint = command("run", tmp_path / "problem.yaml")
    assert code == 1 and "unsolved: 2 of 2 robots not on their targets" in complaint
    _, verdict, _ = command("verify", tmp_path / "problem.json", "--problem", problem)
    assert "its target is row 0, column" in " ".join(verdict.split())


def test_a_wrong_sum_of_costs_is_a_violation(tmp_path: Path) -> None:
    problem = drawn(tmp_path, LANE, (0, 0, 2, 0))
    assert attempt(problem, "pibt", ticks=50).solved
    out = tmp_path / "problem.json"
    out.write_text(json.dumps(json.loads(out.read_text()) | {"sumOfCost": 3}))
    code, verdict, _ = command("verify", out, "--problem", problem)
    sentence = "sumOfCost is 3, the last arrivals on targets add up to 2"
    assert code == 1 and sentence in " ".join(verdict.split())


def test_moves_of_several_ticks_cost_their_ticks(tmp_path: Path) -> None:
    problem = drawn(tmp_path, LANE, (0, 0, 2, 0), (3, 0, 4, 0))
    attempt(problem, "pibt", ticks=50)
    recording = tmp_path / "slow"
    slow = ("--set", "durations.move=3", "--set", "durations.turn=3")
    code, text, _ = command(
        "run", tmp_path / "problem.yaml", *slow, "--record", recording, "--json"
    )
    metrics = json.loads(text)["metrics"]
    assert (code, metrics["makespan"], metrics["sum_of_costs"]) == (0, 6, 9)
    assert command("export", recording, "--planviz", tmp_path / "slow.json")[0] == 0
    assert json.loads((tmp_path / "slow.json").read_text())["sumOfCost"] == 9


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (("orders.repeat=true",), "on-targets needs orders.tasks with assign: round-robin"),
        (("orders.tasks=[[[0, 0]], [[1, 0]]]",), "but there are 2 tasks for 1 robot"),
        (("fleet.when_idle=leave",), "on-targets needs robots that stay on the floor"),
        (
            ("fleet.robots=2", "fleet.start=[[0, 0], [1, 0]]", "orders.tasks=[[[3, 0]], [[3, 0]]]"),
            "the task of robot 1 ends in [3, 0], where that of robot 0 ends",
        ),
    ],
)
def test_other_orders_have_no_targets(
    settings: tuple[str, ...], sentence: str, tmp_path: Path
) -> None:
    problem = drawn(tmp_path, LANE, (0, 0, 2, 0))
    command("import", problem, "--out", tmp_path / "a.yaml")
    changes = [word for setting in settings for word in ("--set", setting)]
    code, _, complaint = command("check", tmp_path / "a.yaml", *changes)
    assert code == 2 and sentence in complaint


def test_a_problem_of_trips_becomes_a_scenario_that_stops_on_targets(tmp_path: Path) -> None:
    command("import", drawn(tmp_path, LANE, (0, 0, 2, 0)), "--out", tmp_path / "a.yaml")
    scenario = resolve(tmp_path / "a.yaml").scenario
    assert scenario.stop.when == "on-targets" and scenario.strategy.right_of_way == "pibt"
