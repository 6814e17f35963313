"""`world.access_cell`: from which cell a slot is served, by one rule for all that asks or predicts."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from automaton.commands import main
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.strategy import paths
from automaton.strategy.placing import dropoff_cell, pickup_cell
from automaton.world.resolve import resolve

ROOT = Path(__file__).parents[2]
FLOOR = """
......
A.$...
......
..d...
"""


def file_with(folder: Path, access_cell: str) -> str:
    path = folder / "sides.yaml"
    picture = "".join(f"    {row}\n" for row in FLOOR.strip().split("\n"))
    path.write_text(
        f"name: sides\nlayout:\n  picture: |\n{picture}"
        "fleet: {robots: 1, kinematics: omni}\norders: {generator: picture-loads}\n"
        "strategy: {allocation: independent, routing: shortest, right_of_way: wait}\n"
        f"world: {{access_cell: {access_cell}}}\n"
        "stop: {when: delivered, max_duration: 200}\n"
    )
    return str(path)


def run_with(folder: Path, access_cell: str, *settings: str) -> Simulation:
    simulation = Simulation(resolve(file_with(folder, access_cell), list(settings)))
    simulation.run()
    assert simulation.finished
    return simulation


def test_from_the_nearest_cell_a_run_is_shorter(tmp_path: Path) -> None:
    """Fixed, A drives round the shelf to its east side and back to the west side of d."""
    fixed, nearest = run_with(tmp_path, "fixed"), run_with(tmp_path, "nearest")
    assert nearest.tick + 4 <= fixed.tick


def test_all_access_cells_of_a_slot_are_listed(tmp_path: Path) -> None:
    view = Simulation(resolve(file_with(tmp_path, "fixed"))).view
    width = int(view.grid.offset.max())
    found = [
        [cell - int(view.slots.cell[slot]) for cell in paths.access_cells(view, 0, slot)]
        for slot in range(2)
    ]
    assert found == [[1, width, -1, -width], [1, -1, -width]]  # "d" is in the last row


@pytest.mark.parametrize("access_cell", ["fixed", "nearest"])
@pytest.mark.parametrize("allocation", ["independent", "first-come", "shortest-job", "auction"])
def test_all_allocations_have_the_rule(tmp_path: Path, access_cell: str, allocation: str) -> None:
    one = run_with(tmp_path, access_cell)
    assert run_with(tmp_path, access_cell, f"strategy.allocation={allocation}").tick == one.tick


@pytest.mark.parametrize("access_cell", ["fixed", "nearest"])
def test_the_tutorial_has_the_rule(tmp_path: Path, access_cell: str) -> None:
    one = run_with(tmp_path, access_cell)
    setting = "strategy.allocation=independent-python"
    assert run_with(tmp_path, access_cell, setting).digest == one.digest


@pytest.mark.parametrize("access_cell", ["fixed", "nearest"])
def test_strategies_that_decide_robot_by_robot_have_the_rule(
    tmp_path: Path, access_cell: str
) -> None:
    one = run_with(tmp_path, access_cell)
    setting = "strategy.allocation=example_strategies:eager"
    assert run_with(tmp_path, access_cell, setting).tick == one.tick


def test_of_several_nearest_cells_the_first_one_by_the_fixed_rule_counts(tmp_path: Path) -> None:
    floor_plan = resolve(file_with(tmp_path, "nearest")).floor_plan
    for access_cell in ("fixed", "nearest"):
        view = Simulation(resolve(file_with(tmp_path, access_cell))).view
        slot = int(np.flatnonzero(view.slots.cell == floor_plan.cell(2, 1))[0])
        east, south, west, north = view.slots.access[slot].tolist()
        corner = floor_plan.cell(1, 2)  # one cell from the south and the west side
        is_fixed = access_cell == "fixed"
        assert pickup_cell(view, 0, slot, corner) == (east if is_fixed else west)
        assert dropoff_cell(view, 0, slot, corner) == west
        below, above = floor_plan.cell(2, 3), floor_plan.cell(2, 0)
        assert pickup_cell(view, 0, slot, above) == (east if is_fixed else north)
        assert dropoff_cell(view, 0, slot, below) == (west if is_fixed else south)
        # Where nothing is known of the robot, the fixed rule holds.
        assert (pickup_cell(view, 0, slot, NIL), dropoff_cell(view, 0, slot, NIL)) == (east, west)


def test_other_rules_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", file_with(tmp_path, "farthest")]) == 2
    assert "access_cell" in capsys.readouterr().err
    with pytest.raises(InputError, match=r"it needs world\.access_cell: fixed"):
        resolve(file_with(tmp_path, "nearest"), ["strategy.allocation=cooperative"])


def test_no_other_file_chooses_a_side() -> None:
    """Whatever picks or drops asks `slot_access`; alleys, checks of answers, jams and windows do not."""
    found = {
        path.relative_to(ROOT).as_posix()
        for top in ("automaton", "strategies")
        for path in (ROOT / top).rglob("*.py")
        if re.search(r"slots\.access\[|\(0, 2, 1, 3\)|\(2, 0, 3, 1\)", path.read_text())
    }
    assert found == {
        "automaton/strategy/placing.py",
        "automaton/engine/commit.py",
        "automaton/engine/faults.py",
        "automaton/engine/fulfilment.py",
        "automaton/runs/progress.py",
        "automaton/strategy/paths.py",
        "automaton/environments/windows.py",
        "strategies/allocation/cooperative.py",
    }
