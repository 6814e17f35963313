"""Guidance graphs (GGO) become floors with streets: the order of their weights, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from automaton.commands import main
from automaton.exchange.guidance_graph import GuidanceGraph, streets_of
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import EAST, NORTH, SOUTH, WEST
from automaton.scenario.street_files import streets_of_text
from automaton.scenario.streets import streets_on
from automaton.world.resolve import resolve

GRAPH = {
    "layout": ["we@", "T.."],
    "n_row": 2,
    "n_col": 3,
    # Waiting on [0, 0], [1, 0], [1, 1], [2, 1]; edges of [0, 0]: east; of [1, 0]: west, south; of
    # [1, 1]: east, north; of [2, 1]: west.
    "weights": [1, 2, 1, 0, 0.1, 3, 4.567, 1, 0.015, 7],
}
STREETS = """\
x,y,east,south,west,north,wait
0,0,0.1,,,,
1,0,,4.57,3,,2
1,1,,,,0.02,
2,1,,,7,,0
"""


def imported(folder: Path, **changes: object) -> Path:
    """The scenario of the graph above with changes."""
    (folder / "graph.json").write_text(json.dumps({**GRAPH, **changes}))
    out = folder / "floor.yaml"
    command = ["import", str(folder / "graph.json"), "--out", str(out), "--robots", "2", "--force"]
    assert main(command) == 0
    return out


def test_weights_come_east_north_west_south_after_those_of_waiting(tmp_path: Path) -> None:
    out = imported(tmp_path)
    assert (tmp_path / "floor-streets.csv").read_text() == STREETS
    scenario = yaml.safe_load(out.read_text())
    assert scenario["layout"]["picture"] == "t.#\n#..\n"
    assert scenario["streets"] == {"file": "floor-streets.csv"}
    assert scenario["orders"] == {"tasks": "floor.tasks", "repeat": True, "assign": "round-robin"}
    floor = resolve(str(out)).floor_plan
    cell = floor.cell(1, 0)
    assert floor.move_weights[cell].tolist() == [100, 457, 300, 100]
    assert floor.wait_weights[cell] == 200


def test_a_graph_without_weights_of_waiting_or_without_any(tmp_path: Path) -> None:
    imported(tmp_path, weights=[1, 1, 1, 2, 1, 1])
    assert (tmp_path / "floor-streets.csv").read_text().splitlines()[1:] == ["1,1,2,,,,"]
    for none in ([], [1.0] * 6, [1.0] * 10):
        assert "streets" not in yaml.safe_load(imported(tmp_path, weights=none).read_text())


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"weights": [1.0] * 7}, "weights has 7 values; this layout needs 6 for its edges, or 10"),
        ({"weights": [1.0] * 9 + [0]}, "cell [2, 1] has west 0; a weight is 0.01 to 10,000"),
        ({"weights": [-1.0] + [1] * 9}, "cell [0, 0] has wait -1; a weight is 0 to 10,000"),
        ({"weights": [1, "x"]}, "is not a guidance graph: Expected `float`, got `str`"),
        ({"layout": ["we@", "Tx."]}, "cell [1, 1] is 'x'; known are . e w @ T"),
        ({"layout": ["we@"]}, "n_row is 2, but layout has 1 rows"),
        ({"layout": ["we@", "T."]}, "n_col is 3, but row 1 has 2 cells"),
        ({"layout": ["@@@", "@@@"]}, "the layout has no free cell"),
        ({"layout": ["@@@", "@.."], "n_row": None}, "is not a guidance graph: Expected `int`"),
    ],
)
def test_a_graph_that_is_wrong_is_refused_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, object], sentence: str
) -> None:
    file = tmp_path / "graph.json"
    file.write_text(json.dumps({**GRAPH, **changes}))
    assert main(["import", str(file), "--out", str(tmp_path / "a.yaml")]) == 2
    said = capsys.readouterr().err.strip()
    assert f"{file}: {sentence}" in said and "\n" not in said
    assert not (tmp_path / "a.yaml").exists()


def test_more_robots_than_cells_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "g.json").write_text(json.dumps(GRAPH))
    command = ["import", str(tmp_path / "g.json"), "--out", str(tmp_path / "a.yaml")]
    assert main([*command, "--robots", "5"]) == 2
    assert "--robots 5, but the largest part of the map has 4 free cells" in capsys.readouterr().err


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 6), st.integers(2, 6), st.integers(0, 2**32 - 1))
def test_each_weight_reaches_its_edge(height: int, width: int, seed: int) -> None:
    draw = np.random.default_rng(seed)
    free = draw.random((height, width)) < 0.7
    free[0, :2] = True
    floor = draw_floor("".join("".join(".#"[not cell] for cell in row) + "\n" for row in free))
    cells = [floor.cell(x, y) for y, x in np.argwhere(free).tolist()]
    moves = draw.integers(1, 900, (floor.kind.size, 4)).astype(np.int32)
    waits = draw.integers(0, 900, floor.kind.size).astype(np.int32)
    edges = [
        (cell, way)
        for cell in cells
        for way in (EAST, NORTH, WEST, SOUTH)
        if floor.exits.flat[cell] >> way & 1
    ]
    listed = [waits[cell] / 100 for cell in cells] + [moves[edge] / 100 for edge in edges]
    text, _ = streets_of(GuidanceGraph([], height, width, listed), free, "graph.json")
    if not text:
        assert all(value == 1 for value in listed)
        return
    weighted = streets_on(floor, streets_of_text(text, floor)[0]).floor()
    assert all(weighted.move_weights[edge] == moves[edge] for edge in edges)
    assert all(weighted.wait_weights[cell] == waits[cell] for cell in cells)
