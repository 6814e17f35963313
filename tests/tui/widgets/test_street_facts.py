"""What the inspector and `explain` say of streets: weights of a cell, and the detour of a robot."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from panel_harness import WIDE, moment, of_cell, of_robot, shown

from automaton.commands import main
from tui.widgets.inspector import Inspector

STREETS = """
name: around
layout:
  picture: |
    ........
    ........
    ........
fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}
orders: {list: [{stops: [[7, 0]]}]}
strategy: {allocation: first-come, right_of_way: pibt}
stop: {when: delivered}
streets:
  - {row: 0, east: 9, west: 9}
  - {row: 1, east: 9, west: closed}
  - {at: [1, 1], wait: 2.5}
"""
# In tick 1 it drives to [0, 1]: from there 1 + 7 + 2 moves over row 2, or 7 + 1.
SENTENCE = "its way is 2 ticks longer than the shortest, because of the streets"


@pytest.fixture
def scenario(tmp_path: Path) -> str:
    path = tmp_path / "around.yaml"
    path.write_text(STREETS)
    return str(path)


def test_a_cell_tells_its_weights_and_its_moves_so_far(scenario: str) -> None:
    view = moment(2, scenario, layer="streets")
    assert "weights east 9, south 1, waiting 1" in shown(Inspector(), of_cell(view, 0, 0), WIDE)
    assert "moves east 0, south 1, west 0, north 0" in shown(Inspector(), of_cell(view, 0, 1), WIDE)
    weights = "weights east 9, south 1, west closed, north 1, waiting 2.5"
    assert weights in shown(Inspector(), of_cell(view, 1, 1), WIDE)
    plain = moment(2, scenario, "streets=null")
    assert "weights" not in shown(Inspector(), of_cell(plain, 1, 1), WIDE)


def test_inspector_and_explain_say_how_much_longer_streets_make_a_way(
    scenario: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    view = of_robot(moment(1, scenario, selected=0), 0)
    assert f"streets {SENTENCE}" in shown(Inspector(), view, WIDE)
    recording = str(tmp_path / "run.rec")
    assert main(["run", scenario, "--record", recording]) == 0
    capsys.readouterr()
    for tick, words, detour in (("1", f"{SENTENCE}\n", 2), ("3", "not wait\nno time lost", 0)):
        assert main(["explain", recording, "--robot", "0", "--at", tick]) == 0
        assert words in capsys.readouterr().out
        assert main(["explain", recording, "--robot", "0", "--at", tick, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["detour"] == detour
