"""Graphs become cells: their angle, rows of cells, crossings, pockets, and what is refused."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from lif_layouts import lif, write

from automaton.errors import InputError
from automaton.exchange.graphs.fit import Fit, draw, fit_graph
from automaton.exchange.graphs.graph import staircase
from automaton.exchange.graphs.import_graph import corners, largest_part, walk
from automaton.exchange.graphs.lif import read_lif
from automaton.floor.floor_plan import ALL_EXITS, CHARGER, FLOOR, STATION, SYMBOLS, Symbol

RING = {"A": (0.0, 0.0), "B": (4.0, 0.0), "C": (4.0, 2.0), "D": (0.0, 2.0)}
AROUND = ["A-B", "B-C", "C-D", "D-A"]


def fitted(
    folder: Path, layout: dict[str, Any], cell: str | None = "1", accept: float = 0.05
) -> Fit:
    """Fit a layout to cells of a size."""
    graph = read_lif(write(folder, layout))
    return fit_graph(graph, None if cell is None else Fraction(cell), accept)


def rows(fit: Fit) -> list[str]:
    """The picture of a fit that is not refused."""
    assert fit.layout is not None, fit.refusal
    return fit.layout.drawing.rows


def refusal(folder: Path, layout: dict[str, Any], cell: str | None = "1") -> str:
    """The sentence about a layout that cannot be drawn."""
    with pytest.raises(InputError) as caught:
        fitted(folder, layout, cell, accept=9.0)
    return caught.value.message


def test_a_ring_one_way_and_a_spur_both_ways(tmp_path: Path) -> None:
    layout = lif({**RING, "S": (6.0, 0.0)}, [*AROUND, "B=S"], {"P": ["S"]})
    assert rows(fitted(tmp_path, layout)) == [
        "v<<<<##",
        "v###^##",
        ">>>>└─t",
    ]


def test_an_edge_that_runs_along_no_axis_is_a_staircase(tmp_path: Path) -> None:
    nodes = {"A": (0.0, 0.0), "B": (3.0, 2.0), "C": (7.0, 2.0)}
    fit = fitted(tmp_path, lif(nodes, ["A=B", "B=C"]), accept=1)
    assert rows(fit) == [
        "##┌────╴",
        "#┌┘#####",
        "╶┘######",
    ]
    assert fit.cells.tolist()[0] == 5


@pytest.mark.parametrize("end", [(5, 0), (0, 5), (4, 3), (-3, 4), (-2, -7), (1, -6)])
def test_a_staircase_goes_on_from_neighbour_to_neighbour(end: tuple[int, int]) -> None:
    cells = staircase((0, 0), end)
    assert cells[0] == (0, 0) and cells[-1] == end
    assert len(set(cells)) == len(cells) == abs(end[0]) + abs(end[1]) + 1
    assert all(abs(x - u) + abs(y - v) == 1 for (x, y), (u, v) in pairwise(cells))


def test_where_roads_cross_robots_may_turn(tmp_path: Path) -> None:
    nodes = {"A": (0, 1), "B": (4, 1), "C": (2, 0), "D": (2, 3)}
    fit = fitted(tmp_path, lif(nodes, ["A=B", "C=D"]))
    assert rows(fit) == [
        "##╷##",
        "##│##",
        "╶─┼─╴",
        "##╵##",
    ]
    assert fit.layout is not None and fit.layout.roads.crossings == [(2, 2)]


def test_a_spur_behind_a_one_way_edge_is_entered_against_its_only_exit(tmp_path: Path) -> None:
    """From A to B, on to C and back to B, where C alone is left to go to: a wall closes the rest."""
    nodes = {"A": (0.0, 0.0), "B": (2.0, 0.0), "C": (4.0, 0.0)}
    fit = fitted(tmp_path, lif(nodes, ["A-B", "B=C"]))
    assert rows(fit) == [">>┌─╴"]
    assert fit.layout is not None
    assert [fit.layout.roads.exits[x, 0] for x in range(5)] == [1, 1, 1, 5, 4]


def test_two_stations_beside_each_other_let_nobody_through(tmp_path: Path) -> None:
    nodes = {"A": (0.0, 0.0), "B": (2.0, 0.0), "C": (0.0, 1.0), "D": (2.0, 1.0)}
    fit = fitted(tmp_path, lif(nodes, ["A=B", "C=D", "A=C"], {"P": ["B"], "Q": ["D"]}))
    assert rows(fit) == ["┌─o", "└─o"]


def test_a_turned_layout_is_turned_back(tmp_path: Path) -> None:
    turned = {name: (0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y) for name, (x, y) in RING.items()}
    fit = fitted(tmp_path, lif(turned, AROUND))
    assert fit.placement.degrees == 36.9
    assert rows(fit) == rows(fitted(tmp_path, lif(RING, AROUND)))


def test_coordinates_within_a_quarter_of_a_cell_become_one(tmp_path: Path) -> None:
    nodes = {"A": (0.0, 0.0), "B": (4.0, 0.25), "C": (4.0, 2.0), "D": (0.0, 2.0)}
    fit = fitted(tmp_path, lif(nodes, AROUND), accept=1)
    assert rows(fit) == ["v<<<<", "v###^", ">>>>^"]
    nodes["B"] = (4.0, 0.76)
    assert rows(fitted(tmp_path, lif(nodes, AROUND), accept=1))[1] == "v#>>^"


def test_the_largest_cell_that_fits_is_chosen(tmp_path: Path) -> None:
    nodes = {"A": (0.0, 0.0), "B": (4.0, 0.0), "C": (4.0, 3.1), "D": (0.0, 3.1), "S": (5.5, 0.0)}
    layout = lif(nodes, [*AROUND, "B=S"])
    assert fitted(tmp_path, layout, None).cell == Fraction(1, 2)
    assert fitted(tmp_path, layout, None, accept=0.005).cell == Fraction(1, 10)
    coarse = fitted(tmp_path, layout, "1")
    assert coarse.layout is None
    assert "the edge B-S, 1.5 m, would be 2 m (+33.3 %) in cells of 1 m" in coarse.refusal


def test_without_a_cell_that_fits_the_nearest_is_named(tmp_path: Path) -> None:
    nodes = {"A": (0, 0), "B": (3, 0), "C": (9.13, 0), "D": (9.13, 0.23), "E": (0, 0.17)}
    fit = fitted(tmp_path, lif(nodes, ["A=B", "B=C", "C=D", "A=E"]), None, accept=0.001)
    assert fit.refusal.startswith(
        "no cell size between 0.1 and 2 m meets the tolerance; the best is 0.2 m: the"
    )


@pytest.mark.parametrize(
    ("nodes", "edges", "sentence"),
    [
        (
            {"A": (0, 0), "B": (4, 0), "C": (4, 0.3)},
            ["A=B", "A=C"],
            "the nodes B and C would be in one cell",
        ),
        (
            {"A": (0, 0), "B": (4, 0), "C": (2, 0), "D": (2, 3)},
            ["A=B", "C=D"],
            "the edge A-B would go through the cell of the node C",
        ),
        (
            {"A": (0, 0), "B": (6, 0), "C": (6, 1), "D": (9, 9)},
            ["A=B", "A=C", "C=D"],
            "the edges A-B and A-C would be in one cell, where they do not meet",
        ),
    ],
)
def test_what_would_share_a_cell_is_refused(
    nodes: dict[str, tuple[float, float]], edges: list[str], sentence: str, tmp_path: Path
) -> None:
    text = refusal(tmp_path, lif(nodes, edges))
    assert text == f"in cells of 1 m {sentence}: choose a smaller cell"


def test_a_floor_that_would_be_too_large_is_refused(tmp_path: Path) -> None:
    far = lif({"A": (0, 0), "B": (90_000, 0), "C": (90_000, 90_000)}, ["A=B", "B=C"])
    assert "the floor would have 45,001 x 45,001 cells" in refusal(tmp_path, far, None)
    assert "the floor would have 90,001 x 90,001 cells" in refusal(tmp_path, far, "1")


def test_robots_come_back_within_the_largest_part() -> None:
    exits = {(0, 0): 1, (1, 0): 1, (2, 0): 2, (2, 1): 4, (1, 1): 8, (3, 0): 1}
    assert largest_part(exits) == {(1, 0), (2, 0), (2, 1), (1, 1)}


def test_a_set_of_cells_is_walked_with_ways_back() -> None:
    #  0123
    #   │     a branch at (1, 1)
    #  ───╴
    star = {(0, 1): {(1, 1)}, (1, 1): {(0, 1), (1, 0), (2, 1)}, (1, 0): {(1, 1)}, (2, 1): {(1, 1)}}
    path = walk(star)
    assert path is not None and set(path) == set(star)
    assert all(other in star[one] for one, other in pairwise(path))
    line = [(0, 0), (1, 0), (2, 0), (2, 1)]
    ways = {one: {o for o in line if abs(o[0] - one[0]) + abs(o[1] - one[1]) == 1} for one in line}
    assert corners(walk(ways) or []) in ([[0, 0], [2, 0], [2, 1]], [[2, 1], [2, 0], [0, 0]])
    assert walk({(0, 0): set(), (5, 5): set()}) is None


def test_letters_that_every_picture_has_are_not_given_to_stations_chargers_and_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    exits = {(0, 0): 1, (1, 0): 1, (2, 0): 1, (3, 0): 0}
    kinds = {(1, 0): CHARGER, (2, 0): STATION}
    assert draw(exits, kinds, 4, 1).rows == [">zox"]
    for letter in "zox":
        monkeypatch.setitem(SYMBOLS, letter, Symbol(FLOOR, ALL_EXITS))
    drawn = draw(exits, kinds, 4, 1)
    assert drawn.rows == [">yn*"] and not set("zox") & set(drawn.legend)
