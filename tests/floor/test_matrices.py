"""Floors as matrices of codes: read, written, and refused with the place of what is wrong."""

import numpy as np
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.floor.drawn_floors import draw_floor, read_matrix, write_matrix
from automaton.runs.pictures import floor_picture
from automaton.world.resolve import resolve
from layouts.racks import Racks

SCENARIO = """
name: by matrix
layout: {matrix: floor.csv, capacity: 2}
fleet: {robots: 1, start: [[1, 1]]}
orders: {list: [{from: [2, 2], to: [4, 2]}]}
"""
FLOOR = """-1,-1,-1,-1,-1,-1
-1,50,0,50,0,0
-1,0,200,0,100,-1
-1,50,0,50,0,0
"""


def written(folder, text=SCENARIO, floor=FLOOR):
    (folder / "floor.csv").write_text(floor)
    path = folder / "scenario.yaml"
    path.write_text(text)
    return path


def test_a_matrix_is_a_floor(tmp_path):
    floor_plan = resolve(written(tmp_path)).floor_plan
    assert floor_picture(floor_plan).split("\n") == ["######", "#=====", "#=i=r#", "#====="]


def test_the_default_warehouse_survives_the_round_trip():
    floor_plan = Racks(preset="E1").build()
    text = write_matrix(floor_plan)
    assert read_matrix(text) == floor_plan
    assert write_matrix(read_matrix(text)) == text
    codes, numbers = np.unique(text.replace("\n", ",").split(",")[:-1], return_counts=True)
    found = dict(zip(codes.tolist(), numbers.tolist(), strict=True))
    assert (found["50"], found["100"], found["200"]) == (264, 5769, 64)
    assert found["0"] == 3748 - 264


def test_check_writes_the_matrix_of_a_scenario(tmp_path, capsys):
    out = tmp_path / "out.csv"
    assert main(["check", str(written(tmp_path)), "--matrix", str(out)]) == 0
    assert out.read_text() == FLOOR
    assert (
        capsys.readouterr().out
        == "by matrix: 1 dock, 1 rack, 1 robot, right of way pibt by default, ok\n"
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("floor.csv", "out.csv", "scenario.yaml")
    ]


@pytest.mark.parametrize(
    ("floor", "line", "message"),
    [
        (FLOOR.replace("200", "7"), 3, "column 3 must be one of the codes -1, 0, 50, 100 or 200"),
        (FLOOR.replace("200", "7"), 3, "found 7"),
        (FLOOR.replace("200", "dock"), 3, "found dock"),
        (FLOOR.replace("200", "99"), 3, "found 99; did you mean 100?"),
        (FLOOR.replace("200", "100.5"), 3, "found 100.5; did you mean 100?"),
        (FLOOR.replace("200", "nan"), 3, "found nan"),
        (FLOOR.replace("200", "²"), 3, "found ²"),
        (FLOOR.replace("200", ""), 3, "found nothing"),
        (FLOOR.replace("200,", ""), 3, "the row has 5 codes, the first row 6"),
        ("\n", 1, "the matrix is empty"),
        ("-1,100\n200,-1\n", 1, "no free cell (0 or 50)"),
    ],
)
def test_what_is_wrong_in_a_matrix_is_named_with_its_place(tmp_path, floor, line, message):
    with pytest.raises(InputError) as raised:
        resolve(written(tmp_path, floor=floor))
    assert raised.value.file == str(tmp_path / "floor.csv")
    assert raised.value.line == line
    assert message in raised.value.message


@pytest.mark.parametrize(
    "floor",
    [
        FLOOR.replace(",", ";"),
        FLOOR.replace(",", "\t"),
        FLOOR.replace("200", "200.0").replace("50", "50.").replace("-1", " -1.00 "),
        FLOOR.replace(",", ";").replace("200", "200,0"),
    ],
    ids=["semicolons", "tabs", "points", "decimal commas"],
)
def test_matrices_are_read_as_spreadsheets_write_them(floor):
    assert read_matrix(floor) == read_matrix(FLOOR)


@pytest.mark.parametrize(
    ("layout", "message"),
    [
        ("{matrix: none.csv}", "there is no floor file 'none.csv'"),
        ("{matrix: floor.csv, capacity: 9}", "layout.capacity must be 0, 1 or 2, found 9"),
        ("{matrix: floor.csv, picture: x}", "exactly one of generator, picture, file or matrix"),
        ("{matrx: floor.csv}", "(did you mean 'matrix'?)"),
    ],
)
def test_a_bad_layout_is_refused(tmp_path, layout, message):
    text = SCENARIO.replace("{matrix: floor.csv, capacity: 2}", layout)
    with pytest.raises(InputError) as raised:
        resolve(written(tmp_path, text))
    assert raised.value.line == 3 and message in raised.value.message


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        ("..s", "a matrix has no code for the shelf at (2, 0), only for wall, floor, rack or dock"),
        ("b..", "a matrix has no code for the parking bay at (-1, 0)"),
        (".~", "different capacities of free cells"),
        (".>.", "store one-way cells"),
    ],
)
def test_floors_that_no_matrix_expresses_are_refused(picture, message):
    with pytest.raises(InputError) as raised:
        write_matrix(draw_floor(picture))
    assert message in str(raised.value)


def test_a_matrix_of_several_scenarios_or_at_a_bad_place_is_refused(tmp_path, capsys):
    file = str(written(tmp_path))
    assert main(["check", file, file, "--matrix", "x.csv"]) == 2
    assert "--matrix writes the floor of one scenario, found 2" in capsys.readouterr().err
    assert main(["check", file, "--matrix", str(tmp_path / "none" / "x.csv")]) == 2
    assert "cannot write it: No such file or directory" in capsys.readouterr().err
    assert main(["check", file, "--matrix", str(tmp_path)]) == 2
    assert "this is not a regular file" in capsys.readouterr().err
    assert main(["check", "tabletop-1", "--matrix", str(tmp_path / "x.csv")]) == 2
    assert "no code for the turntable" in capsys.readouterr().err
    assert not (tmp_path / "x.csv").exists()
