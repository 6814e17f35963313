"""Vehicles larger than a cell, diagonal edges, rounded speeds: what an import picks and says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from lif_layouts import lif, write

from automaton.commands import main
from automaton.exchange.imported_floor import EdgeRow

RING = {"A": (0.0, 0.0), "B": (8.0, 0.0), "C": (8.0, 4.0), "D": (0.0, 4.0)}
AROUND = ["A-B", "B-C", "C-D", "D-A"]
SPURRED = [*AROUND, "B=S"]
MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<model version="6.0.0" name="works">
{points}
{paths}
<vehicle name="V1" maxVelocity="1000"><boundingBox length="{length}" width="{width}"/></vehicle>
</model>
"""


def spurred(metres: float) -> dict[str, tuple[float, float]]:
    """A ring of 10 m with a spur."""
    ring = {"A": (0.0, 0.0), "B": (10.0, 0.0), "C": (10.0, 10.0), "D": (0.0, 10.0)}
    return {**ring, "S": (10.0, -metres)}


def imported(path: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, Any, Any]:
    """Exit code, report and scenario of an import."""
    out = path.parent / "floor.yaml"
    code = main(["import", str(path), "--out", str(out), "--force", "--json", *options])
    report = json.loads(capsys.readouterr().out)
    return code, report, yaml.safe_load(out.read_text()) if out.exists() else None


def model(folder: Path, length: int, width: int) -> Path:
    """A plant model of a ring of 8 m by 4 m."""
    points = "\n".join(
        f'<point name="{name}" positionX="{x * 1000:.0f}" positionY="{y * 1000:.0f}"/>'
        for name, (x, y) in RING.items()
    )
    paths = "\n".join(
        f'<path name="{way}" sourcePoint="{way[0]}" destinationPoint="{way[2]}" '
        f'length="{8000 if way in ("A-B", "C-D") else 4000}" maxVelocity="1000"/>'
        for way in AROUND
    )
    path = folder / "works.xml"
    path.write_text(MODEL.format(points=points, paths=paths, length=length, width=width))
    return path


def test_a_file_without_sizes_says_which_cell_a_robot_takes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, report, scenario = imported(write(tmp_path, lif(spurred(0.7), SPURRED)), capsys)
    cell = report["cell_m"]
    assert cell < 1
    assert (
        f"the file does not give the size of vehicles: a robot takes one cell of {cell:g} m; set "
        "--robot to the length of a vehicle, such as --robot 1.6m"
    ) in report["notes"]
    assert "length" not in scenario["fleet"]


def test_vehicles_longer_than_every_accepted_cell_are_named_with_a_way_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, lif(spurred(4.2), SPURRED))
    _, report, scenario = imported(path, capsys, "--robot", "2.4m")
    (note,) = (one for one in report["notes"] if one.startswith("vehicles are 2.4 m long"))
    assert "but a cell is" in note and "closer together than these vehicles can" in note
    suggested = note.partition("; ")[2].split()
    assert suggested[0] == "--cell" and suggested[2] == "--accept"
    code, again, _ = imported(path, capsys, "--robot", "2.4m", *suggested[:4])
    assert code == 0 and again["cell_m"] >= 2.4
    assert not any(one.startswith("vehicles are") for one in again["notes"])
    assert scenario["fleet"]["length"] == "2.4 m"


def test_cells_hold_the_vehicle_of_the_file_where_the_distances_allow(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, report, scenario = imported(model(tmp_path, 2400, 1100), capsys)
    assert report["cell_m"] == 4.0, "8 m and 4 m are whole cells, and a vehicle of 2.4 m fits"
    assert scenario["fleet"] | {"start": 0} == {
        "robots": 1, "kinematics": "omni", "start": 0, "length": "2.4 m", "width": "1.1 m",
        "types": [{"name": "V1", "robots": 1}],
    }  # fmt: skip
    assert not any("vehicle" in note for note in report["notes"])


def test_a_wide_vehicle_is_called_wide(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, report, _ = imported(model(tmp_path, 900, 1500), capsys, "--cell", "1m")
    assert any(
        note.startswith("vehicles are 1.5 m wide, but a cell is 1 m") for note in report["notes"]
    )


@pytest.mark.parametrize("cell", [(), ("--cell", "1m")])
def test_a_diagonal_edge_is_the_reason(
    cell: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, report, _ = imported(write(tmp_path, lif(RING, [*AROUND, "A-C"])), capsys, *cell)
    assert code == 1
    assert (
        "the edge A-C runs diagonally: robots drive along rows and columns, where its 8.944 m"
        in (report["refused"])
    )
    assert "become 12 m (+34.2 %)" in report["refused"]


def test_an_edge_along_a_row_is_not_called_diagonal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, report, _ = imported(write(tmp_path, lif(spurred(3.3), SPURRED)), capsys, "--cell", "2m")
    assert code == 1 and "diagonal" not in report["refused"]


def test_a_speed_that_whole_ticks_change_is_named_with_its_edge(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    layout = lif(RING, AROUND, A_B={"maxSpeed": 0.7})
    path = write(tmp_path, layout)
    _, report, _ = imported(path, capsys, "--cell", "1m")
    (note,) = (one for one in report["notes"] if "rounded to whole cells and ticks" in one)
    assert "the speed of the edge A-B is 1 m/s instead of 0.7 m/s (+43 %)" in note
    finer = note.partition("--tick ")[2].split()[0]
    _, again, _ = imported(path, capsys, "--cell", "1m", "--tick", finer)
    assert not any("rounded to whole cells" in one for one in again["notes"])
    edge = next(one for one in again["edges"] if one["edge"] == "A-B")
    assert abs(edge["speed_error_percent"]) <= 10 and abs(edge["time_error_percent"]) <= 10


@given(
    metres=st.floats(0.1, 100),
    cells=st.integers(1, 100),
    cell=st.floats(0.1, 2),
    wanted=st.floats(0.5, 1000),
    ticks=st.integers(1, 1000),
)
def test_errors_of_length_time_and_speed_agree(
    metres: float, cells: int, cell: float, wanted: float, ticks: int
) -> None:
    row = EdgeRow("e", metres, cells, cells * cell, wanted, ticks)
    speed, nominal = row.drawn / row.ticks, row.metres / row.ticks_wanted
    assert row.speed_error == pytest.approx(speed / nominal - 1)
    assert row.time_error == pytest.approx(ticks / wanted - 1)
