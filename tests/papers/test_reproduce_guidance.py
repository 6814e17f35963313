"""`automaton reproduce guidance`: setups on generated floors and on the authors' floors."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from automaton.commands import main
from automaton.floor.reachability import slot_access
from automaton.papers.guidance_study import REPRODUCTION, SETUPS, from_data, layout_of, scenario_of
from automaton.papers.reproduction_study import reproduce
from automaton.world.resolve import resolve


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A floor of the authors' size for setup 1, empty but for one dead end."""
    rows = ["." * 32] * 30 + ["." + "@" * 31] * 2
    (tmp_path / "human").mkdir()
    path = tmp_path / "human" / "pibt_random_unweight_32x32.json"
    path.write_text(json.dumps({"layout": rows, "n_row": 32, "n_col": 32, "weight": False}))
    return tmp_path


def test_the_generated_floor_has_the_published_numbers(tmp_path: Path) -> None:
    layout = SETUPS["2"].generated
    assert layout is not None
    (tmp_path / "a.yaml").write_text(json.dumps(scenario_of(SETUPS["2"], layout)))
    floor_plan = resolve(tmp_path / "a.yaml").floor_plan
    stands = slot_access(floor_plan)[: len(floor_plan.slots)]
    assert np.count_nonzero(floor_plan.drivable) == 948
    assert len(floor_plan.stations) == 22
    assert len(set(stands[stands >= 0].tolist()) - set(floor_plan.stations.tolist())) == 480


def test_setup_10_agrees_with_the_prototype() -> None:
    """Two runs have a standard error below 1 %."""
    made = reproduce(REPRODUCTION, seeds=2, workers=1, tables=["setup-10"])
    (row,) = (row for row in made.rows() if row.case["weights"] == "unweighted")
    assert row.paper == 3.75 and row.prototype == (3.749, 0.005)
    assert row.mean == pytest.approx(3.749, rel=0.04)
    assert row.se is not None and row.standard_errors == pytest.approx(
        (row.mean - 3.749) / math.hypot(row.se, 0.005)
    )


def test_the_authors_floor_is_run(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Once with goals outside the dead end, once with goals everywhere."""
    arguments = ["--data", str(data), "--tables", "setup-1", "--seeds", "1", "--workers", "1"]
    assert main(["reproduce", "guidance", *arguments, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {row["paper"] for row in rows} == {None}, "in print, robots retire"
    assert rows[0]["prototype"] == 5.616 and rows[0]["mean"] != rows[1]["mean"] > 5
    assert from_data(data).tables[0].name == "setup-1"
    assert "setup-1" not in [table.name for table in REPRODUCTION.tables]
    assert "lunjohnzhang/ggo_public" in REPRODUCTION.remarks[0]


def test_shelves_are_racks_where_cells_beside_them_are_marked(tmp_path: Path) -> None:
    path = tmp_path / "floor.json"
    path.write_text(json.dumps({"layout": ["w.ee.", "..@@.", "w.ee."], "n_row": 3, "n_col": 5}))
    assert layout_of(path) == {"picture": "t....\n..rr.\nt...."}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (None, "is not a folder"),
        ("", "has no floor of the authors, such as pibt_random_unweight_32x32.json"),
        ("[1", "is not a guidance graph: "),
        ('{"layout": ["..x"], "n_row": 1, "n_col": 3}', "cell [2, 0] is 'x'; known are"),
    ],
)
def test_wrong_data_is_a_sentence(
    text: str | None, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "none" if text is None else tmp_path
    if text:
        (tmp_path / "pibt_random_unweight_32x32.json").write_text(text)
    assert main(["reproduce", "guidance", "--data", str(folder), "--seeds", "1"]) == 2
    assert sentence in capsys.readouterr().err
