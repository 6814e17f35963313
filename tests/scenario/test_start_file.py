"""Where robots begin and which way they face: as the scenario says, or a CSV file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.floor.floor_plan import DIRECTIONS
from automaton.world.building import build_world
from automaton.world.resolve import resolve

FLOOR = """name: facing
layout:
  picture: |
    t...t
    ..#..
fleet: {robots: 2, start: [[0, 1], [4, 0]]}
orders: {generator: visits, count: 2}
stop: {when: delivered}
"""
STARTS = "x,y,heading\n4,0,west\n\n0,1,north\n"


def floor(folder: Path, starts: str | None = STARTS) -> Path:
    if starts is not None:
        (folder / "starts.csv").write_text(starts)
    path = folder / "floor.yaml"
    path.write_text(FLOOR.replace("[[0, 1], [4, 0]]", "{file: starts.csv}"))
    return path


def headings(path: Path, *settings: str) -> list[str]:
    world, _ = build_world(resolve(path, settings), 1)
    return [DIRECTIONS[heading] for heading in world.robots.heading]


def test_the_starts_of_a_file_are_those_of_a_list(tmp_path: Path) -> None:
    resolved = resolve(floor(tmp_path))
    assert resolved.scenario.fleet.start == ((4, 0), (0, 1))
    assert resolved.scenario.fleet.heading == ("west", "north")
    assert [resolved.floor_plan.xy(int(cell)) for cell in resolved.start] == [(4, 0), (0, 1)]
    assert [Path(file).name for file, _ in resolved.files] == ["starts.csv"]
    assert headings(floor(tmp_path)) == ["west", "north"]


def test_all_robots_may_face_one_way(tmp_path: Path) -> None:
    path = floor(tmp_path, "y;x\n0;4\n1;0\n")
    assert headings(path) == ["south", "north"]  # along a way out of their cells
    assert headings(path, "fleet.heading=east") == ["east", "east"]
    assert headings(path, "fleet.heading=[west, east]") == ["west", "east"]


def test_headings_are_those_of_identities_however_robots_are_stored(tmp_path: Path) -> None:
    world, _ = build_world(resolve(floor(tmp_path)), 1, storage=np.array([1, 0], np.int32))
    assert [DIRECTIONS[heading] for heading in world.robots.heading] == ["north", "west"]


@pytest.mark.parametrize(
    ("starts", "sentence"),
    [
        (None, "floor.yaml:6: there is no file of starts 'starts.csv'"),
        ("", "starts.csv: is empty; its first line must name the columns"),
        ("X,y\n4,0\n5,1\n", "there is no column for x (did you mean 'X'?); the columns are X, y\n"),
        ("x,y\n", "starts.csv: has no rows below its header"),
        (
            "x,y,heading\n4,0,up\n0,1,est\n",
            "starts.csv:2: heading 'up' is not a direction; there are east, south, west, north; 1 more",
        ),
        ("x,y,heading\n4,0,east\n0,1,\n", "starts.csv:3: heading is empty"),
        (
            "x,y\n4,0\n0,1.5\n",
            "starts.csv:3: y must be a whole number from 0 to 1,000,000, found '1.5'",
        ),
        ("x,y\n4,0\n5,1\n", "starts.csv:3: robot 1 would start at [5, 1], outside the floor"),
        ("x,y\n4,0\n2,1\n", "starts.csv:3: robot 1 would start at [2, 1], a wall"),
        ("x,y\n4,0\n\n4,0\n", "starts.csv:4: robot 1 would start at [4, 0], where robot 0 starts"),
        ("x,y\n4,0\n", "floor.yaml:6: fleet.robots is 2, but starts.csv has 1 starts"),
        ("x,y,z\n4,0,0\n", "starts.csv: unknown column 'z'; the columns are x, y, heading"),
    ],
)
def test_bad_starts_are_refused_with_their_line(
    starts: str | None, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(floor(tmp_path, starts))]) == 2
    assert sentence in capsys.readouterr().err


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (("fleet.heading=east",), "starts.csv has headings; leave out fleet.heading"),
        (("fleet.kinematics=omni",), "heading belongs to differential robots, not to omni"),
        (("fleet.heading=[east]",), "heading lists 1 directions, but fleet.robots is 2"),
    ],
)
def test_headings_are_said_once_and_for_robots_that_turn(
    settings: tuple[str, ...], sentence: str, tmp_path: Path
) -> None:
    path = floor(tmp_path, STARTS if settings != ("fleet.kinematics=omni",) else "x,y\n4,0\n0,1\n")
    also = () if "heading" in settings[0] else ("fleet.heading=east",)
    with pytest.raises(InputError) as caught:
        resolve(path, (*settings, *also))
    assert sentence in str(caught.value)


def test_a_file_with_headings_is_for_robots_that_turn(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        resolve(floor(tmp_path), ["fleet.kinematics=omni"])
    assert str(caught.value) == (
        f"{tmp_path / 'floor.yaml'}:6: starts.csv has headings, which belong to differential robots; "
        "leave out that column"
    )
