"""Lattice weights: which way the streets run, and what a way against them costs."""

from __future__ import annotations

from collections.abc import Iterator

from automaton.build.prepared_floor import floor_for
from automaton.floor.drawn_floors import draw_floor
from strategies.right_of_way.epibt.lattice import AGAINST_STREET, ALONG_STREET, lattice_weights

FLOOR = draw_floor("....\n....\n....\n....")
GRID = floor_for(FLOOR, "undirected").grid


def streets(directions: tuple[int, int]) -> Iterator[str]:
    """Rows of the floor, with the cheaper of two opposite directions in each cell."""
    weights = lattice_weights(GRID)
    for y in range(4):
        costs = [weights[FLOOR.cell(x, y), list(directions)].tolist() for x in range(4)]
        assert all(sorted(cost) == [ALONG_STREET, AGAINST_STREET] for cost in costs)
        yield "".join(">v<^"[directions[cost.index(ALONG_STREET)]] for cost in costs)


def test_rows_run_west_and_east_by_turns() -> None:
    assert list(streets((0, 2))) == ["<<<<", ">>>>", "<<<<", ">>>>"]


def test_columns_run_south_and_north_by_turns() -> None:
    assert list(streets((1, 3))) == ["v^v^"] * 4
