"""The examples of the README run as they stand there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from automaton.build.resolve import resolve
from automaton.commands import main
from automaton.strategy.lookup import names, parameters_type
from automaton.studies.sweeps.sweep_plan import check_study

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    """The text below a heading, up to the next one of its level or a higher one."""
    level, _, _ = title.partition(" ")
    text = README[README.index(f"\n{title}\n") + len(title) + 2 :]
    following = re.search(rf"^#{{1,{len(level)}}} [A-Z]", text, re.MULTILINE)
    return text[: following.start()] if following else text


def examples(title: str) -> list[str]:
    """The YAML in a section."""
    return re.findall(r"```yaml\n(.*?)```", section(title), re.DOTALL)


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the README's files under the names that it gives them."""
    plant, zones = examples("#### Zones of your own floor")
    (tmp_path / "my-floor.yaml").write_text(examples("## A scenario")[0])
    (tmp_path / "my-fleet.yaml").write_text(examples("## Experiments: sweeps")[0])
    (tmp_path / "my-plant.yaml").write_text(plant)
    (tmp_path / "my-zones.yaml").write_text(zones)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_study_runs_with_the_scenario(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study, scenarios = check_study("my-fleet.yaml")
    assert len(scenarios) == 4 * 2 * 2 and study.scenario == "my-floor.yaml"
    assert main(["check", "my-floor.yaml", "my-fleet.yaml"]) == 0
    assert main(["run", "my-floor.yaml"]) == 0
    assert "finished after" in capsys.readouterr().out


def test_zones_of_ones_own_floor_from_start_to_end(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", "my-plant.yaml"]) == 0
    assert capsys.readouterr().err == ""
    assert main(["run", "my-plant.yaml", "--picture"]) == 0
    told = capsys.readouterr().out
    assert "zone 1 (d): 1 2* 4; robot 0, " in told and "60 of 60 orders delivered" in told
    assert main(["run", "my-plant.yaml", "--set", "strategy.zoning=annealing"]) == 0
    assert resolve("my-plant.yaml").strategies["zoning"].parameters.design is not None


def test_every_parameter_of_zoning_has_its_row() -> None:
    table = section("#### Zones of your own floor")
    for name in names("zoning"):
        for field in parameters_type("zoning", name).__struct_fields__:
            assert f"`{field}`" in table, (name, field)


def test_exit_codes_stand_in_one_table() -> None:
    for code in (0, 1, 2, 130, 141):
        assert f"\n| {code} | " in section("## What you can ask")
    assert README.count("Exit codes:") == 0
