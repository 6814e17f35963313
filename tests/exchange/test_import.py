"""Problems of other programs become scenarios: what is written, and that it is what was read."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from automaton.commands import main
from automaton.exchange.imported_floor import imported_files
from automaton.exchange.problem_files import read_problem
from automaton.floor.drawn_floors import draw_floor
from automaton.scenario.table_files import read_starts

MAP = "type octile\nheight 2\nwidth 3\nmap\n..@\nGST\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of tables for two robots, with two tasks."""
    (tmp_path / "map.txt").write_text(MAP)
    (tmp_path / "agents_0.csv").write_text("agent id,row,col\n0,0,1\n1,1,0\n")
    (tmp_path / "tasks_one.csv").write_text("targets\n0\n4\n")
    return tmp_path


def test_a_scenario_has_the_floor_the_starts_and_the_tasks_of_its_problem(folder: Path) -> None:
    texts = imported_files(read_problem(folder), "floor", ticks=500)
    assert list(texts) == ["floor-starts.csv", "floor.tasks", "floor.yaml"]
    scenario = yaml.safe_load(texts["floor.yaml"])
    assert scenario["layout"]["picture"] == "..#\n..#\n"
    starts = folder / "floor-starts.csv"
    starts.write_text(texts[starts.name])
    assert read_starts(starts).cells == ((1, 0), (0, 1))
    assert texts["floor.tasks"] == "2\n0\n4\n"
    assert scenario["fleet"] == {
        "robots": 2,
        "kinematics": "differential",
        "start": {"file": "floor-starts.csv"},
        "heading": "east",
    }
    assert scenario["orders"] == {
        "tasks": "floor.tasks",
        "repeat": True,
        "assign": "round-robin",
        "skip_reached": True,
    }
    assert scenario["strategy"]["allocation"] == "greedy"
    assert scenario["stop"] == {"when": "never", "max_duration": 500}


def test_a_map_comes_back_as_the_picture_of_a_floor(tmp_path: Path) -> None:
    (tmp_path / "a.map").write_text(MAP)
    problem = read_problem(tmp_path / "a.map", 2)
    scenario = yaml.safe_load(imported_files(problem, "floor", 1)["floor.yaml"])
    plan = draw_floor(scenario["layout"]["picture"])
    assert (plan.drivable[1:-1, 1:-1] == problem.grid.free).all()
    assert (plan.capacity[plan.drivable] == 1).all()
    assert scenario["orders"]["assign"] == "pool" and "skip_reached" not in scenario["orders"]
    assert scenario["strategy"]["allocation"] == {"name": "greedy", "reassign": 1}


def test_water_is_drawn_as_wall_and_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.map").write_text(MAP.replace("@", "W"))
    assert main(["import", str(tmp_path / "a.map"), "--out", str(tmp_path / "floor.yaml")]) == 0
    assert "4 cells of floor, 2 of wall, 1 of them water" in capsys.readouterr().out


def test_trips_are_done_once_and_robots_stay_there(tmp_path: Path) -> None:
    (tmp_path / "a.map").write_text(MAP)
    (tmp_path / "no.scen").write_text("version 1\n0 a.map 3 2 0 0 1 1 2\n")
    scenario = yaml.safe_load(imported_files(read_problem(tmp_path / "no.scen"), "a", 9)["a.yaml"])
    assert scenario["name"] == "no" and scenario["stop"]["when"] == "on-targets"
    assert scenario["orders"]["repeat"] is False


def test_the_command_writes_files_side_by_side(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "out").mkdir()
    out = folder / "out" / "mine.yaml"
    assert main(["import", str(folder), "--out", str(out), "--ticks", "7"]) == 0
    names = ["mine-starts.csv", "mine.tasks", "mine.yaml"]
    assert sorted(path.name for path in out.parent.iterdir()) == sorted(names)
    assert yaml.safe_load(out.read_text())["stop"]["max_duration"] == 7
    assert "2 robots on 3 x 2 cells, 2 tasks" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["FOLDER", "--out", "FOLDER/floor.json"], "floor.json: --out must end in .yaml"),
        (["FOLDER/x.map", "--out", "FOLDER/floor.yaml"], "x.map: no such file"),
        (["FOLDER", "--out", "FOLDER/none/floor.yaml"], "cannot write it"),
        (["FOLDER", "--out", "FOLDER/floor.yaml", "--robots", "0"], "is not a number of robots"),
        (
            ["FOLDER/a.tasks", "--out", "FOLDER/a.yaml"],
            "is not in one of the formats that are read",
        ),
    ],
)
def test_what_cannot_be_imported_is_said_in_a_sentence(
    arguments: list[str], sentence: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "a.tasks").write_text("0\n")
    assert main(["import", *(one.replace("FOLDER", str(folder)) for one in arguments)]) == 2
    assert sentence in capsys.readouterr().err
    assert not (folder / "floor.yaml").exists()


def test_the_files_of_a_problem_are_not_replaced(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "floor.yaml").mkdir()
    assert main(["import", str(folder), "--out", str(folder / "floor.yaml")]) == 2
    assert "cannot be replaced: choose another --out" in capsys.readouterr().err


def test_a_scenario_that_was_edited_is_replaced_only_by_force(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = folder / "mine.yaml"
    command = ["import", str(folder), "--out", str(out)]
    assert main(command) == 0
    written = out.read_text()
    assert main(command) == 0, "nothing is lost"
    out.write_text("# mine\n" + written)
    (folder / "mine.tasks").unlink()
    assert main(command) == 2
    assert "mine.yaml: already exists: choose another --out, or " in capsys.readouterr().err
    assert out.read_text().startswith("# mine") and not (folder / "mine.tasks").exists()
    assert main([*command, "--force"]) == 0
    assert out.read_text() == written
