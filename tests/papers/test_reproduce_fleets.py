"""`automaton reproduce fleets`: generated floors, or the published problems of a folder."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.exchange.problem import connected_parts
from automaton.papers import fleet_study
from automaton.papers.fleet_study import (
    GENERATED_ROBOTS,
    NEVER_ASIDE,
    REPRODUCTION,
    FleetCase,
    best_known,
    from_data,
    generated_map,
    generated_problem,
    printed,
    scenario_of,
)
from automaton.papers.reproduction_study import reproduce, with_settings

MAP = "type octile\nheight 4\nwidth 6\nmap\n......\n.@@.@.\n.@@.@.\n......\n"


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A folder with a folder of tables for two and three robots, and one with a problem of the league."""
    tables, league = tmp_path / "tables", tmp_path / "league"
    tables.mkdir()
    league.mkdir()
    (tables / "map.txt").write_text(MAP)
    (tables / "agents_0.csv").write_text("agent id,row,col\n0,0,0\n1,0,5\n")
    (tables / "agents_1.csv").write_text("agent id,row,col\n0,0,0\n1,0,5\n2,3,0\n")
    (tables / "tasks_one.csv").write_text("targets\n23\n9\n21\n3\n18\n5\n")
    (league / "a.map").write_text(MAP)
    (league / "a.agents").write_text("2\n0\n5\n")
    (league / "a.tasks").write_text("3\n23,0\n9\n18\n")
    problem = {"mapFile": "a.map", "agentFile": "a.agents", "taskFile": "a.tasks", "teamSize": 2}
    (league / "a.json").write_text(
        json.dumps({**problem, "numTasksReveal": 1.5, "version": "2024"})
    )
    (league / "out.json").write_text('{"actualPaths": []}')
    return tmp_path


def test_the_problems_of_a_folder_are_run(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_study, "RUN_TICKS", 100)
    reproduction = from_data(data)
    assert [table.name for table in reproduction.tables] == ["league", "tables"]
    made = reproduce(reproduction, seeds=1, strategies=("pibt",), workers=1)
    cases = {(row.case["problem"], row.case["robots"]): row.mean for row in made.rows()}
    assert set(cases) == {("a", 2), ("tables", 2), ("tables", 3)}
    assert all(tasks > 10 for tasks in cases.values())


def test_robots_do_not_break_wait_cycles_and_further_settings_are_allowed(tmp_path: Path) -> None:
    case = FleetCase({"strategy": "epibt", "problem": "generated", "robots": 100})
    [[case]] = with_settings("fleets", [[case]], ("strategy.right_of_way.repair_tries=3",))
    chosen = scenario_of(case, generated_problem(100), tmp_path).strategies["right_of_way"]
    parameters = chosen.parameters
    assert (chosen.name, parameters.deadlock_patience) == ("epibt", NEVER_ASIDE)
    assert parameters.repair_tries == 3


def test_the_generated_floor_has_the_size_of_the_published_one() -> None:
    grid = generated_map()
    free = np.count_nonzero(grid.free)
    assert grid.free.shape == (32, 32) and 780 < free < 850
    assert connected_parts(grid.free).max() == 1
    assert max(GENERATED_ROBOTS) < free
    assert generated_problem(100).starts.tolist() == generated_problem(100).starts.tolist()


def test_printed_numbers_stand_beside_the_runs_that_they_are_of() -> None:
    assert printed(("epibt", "epibt", 100), "tasks") == 2788
    assert printed(("epibt", "epibt", 800), "tasks") == 1658
    assert printed(("pibt", "epibt", 100), "tasks") is None
    assert best_known(("pibt", "random_32_32_20_100", 100), "tasks") == 1186
    assert "GitHub" in REPRODUCTION.remarks[0]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["fleets", "--data", "none"], "none: is not a folder"),
        (["fleets", "--data", "."], "has no problem: neither map.txt nor a .json of a problem"),
        (["tabletop", "--data", "."], "tabletop needs no published problems: leave out --data"),
        (["fleets", "--strategies", "epibd"], "--strategies: right_of_way strategy 'epibd'"),
    ],
)
def test_what_cannot_be_reproduced_is_said_in_a_sentence(
    arguments: list[str],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", *arguments]) == 2
    assert sentence in capsys.readouterr().err


def test_what_is_no_file_is_passed_over(data: Path) -> None:
    """A folder named x.json, a pipe that nobody writes, and a link to nothing."""
    (data / "league" / "folder.json").mkdir()
    os.mkfifo(data / "league" / "pipe.json")
    (data / "league" / "link.json").symlink_to(data / "nothing.json")
    assert [table.name for table in from_data(data).tables] == ["league", "tables"]


def test_a_file_that_cannot_be_read_is_named(data: Path) -> None:
    with (data / "league" / "large.json").open("wb") as stream:
        stream.truncate(1 << 30)
    with pytest.raises(InputError, match=r"large\.json: has 1,073\.7 MB"):
        from_data(data)


def test_a_mistake_in_the_data_is_named_with_its_file(data: Path) -> None:
    (data / "league" / "a.agents").write_text("2\n0\n0\n")
    with pytest.raises(InputError) as caught:
        from_data(data)
    assert "a.agents:3: robot 1 starts in row 0, column 0" in str(caught.value)
