"""A user's own folders called `strategies`, `layouts` and `tui` beside the scenario."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

CONSOLE = [str(Path(sys.executable).with_name("automaton"))]
MODULE = [sys.executable, "-m", "automaton"]

RULE = """
from automaton.strategy.per_robot import drop_at, park, per_robot, take


@per_robot("allocation")
def eager(me, view):
    if me.load is not None:
        return drop_at(view.target_of(me.load))
    orders = view.open_orders()
    return take(orders[0]) if orders else park()
"""
FLOOR = """
import msgspec

from automaton.floor.drawn_floors import draw_floor


class MyFloor(msgspec.Struct, frozen=True):
    length: int = 4

    def build(self):
        return draw_floor("A" + "." * self.length + "\\n$" + "#" * (self.length - 1) + "d")
"""
SCENARIO = """
name: own folders
layout: {generator: "layouts.my_floor:MyFloor"}
fleet: {robots: 1, kinematics: omni}
orders: {generator: picture-loads}
strategy:
  allocation: "strategies.my_rule:eager"
"""
HIDES = 'raise RuntimeError("a package beside the scenario hides ours")\n'


@pytest.fixture(params=[False, True], ids=["plain folders", "packages"])
def folder(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A folder with a scenario and all three folders, perhaps packages that hide ours."""
    for name in ("strategies", "strategies/allocation", "layouts", "tui"):
        (tmp_path / name).mkdir()
        if request.param:
            (tmp_path / name / "__init__.py").write_text(HIDES)
    (tmp_path / "strategies/my_rule.py").write_text(RULE)
    (tmp_path / "strategies/allocation/my_rule.py").write_text(RULE)
    (tmp_path / "strategies/catalogue.py").write_text(HIDES)
    (tmp_path / "layouts/my_floor.py").write_text(FLOOR)
    (tmp_path / "layouts/tabletop.py").write_text(HIDES)
    (tmp_path / "tui/viewer.py").write_text(HIDES)
    (tmp_path / "mine.yaml").write_text(SCENARIO)
    return tmp_path


def automaton(command: list[str], folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [*command, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("command", [CONSOLE, MODULE], ids=["console script", "python -m"])
def test_own_folders_neither_hide_ours_nor_are_hidden(command: list[str], folder: Path) -> None:
    checked = automaton(command, folder, "check", "mine.yaml", "tabletop-1")
    mine, shipped = checked.replace("\n  ", " ").splitlines()
    assert "own folders: 1 shelf, 1 destination, 1 robot, right of way retreat" in mine
    assert "tabletop-1" in shipped
    ran = json.loads(automaton(command, folder, "run", "mine.yaml", "--json"))
    assert ran["finished"] and ran["delivered"] == 1
    deeper = "strategy.allocation=strategies.allocation.my_rule:eager"
    again = json.loads(automaton(command, folder, "run", "mine.yaml", "--json", "--set", deeper))
    assert again["digest"] == ran["digest"]
    automaton(command, folder, "watch", "--help")
