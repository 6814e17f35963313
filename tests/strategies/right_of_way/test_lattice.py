"""Lattice weights: which way the streets run, and what a way against them costs."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from automaton.floor.drawn_floors import draw_floor
from automaton.runs.simulation import Simulation
from automaton.strategy.api import ORDER_DELIVERED, cost_in, weighted_table_of
from automaton.world.prepared_floor import floor_for
from automaton.world.resolve import resolve
from strategies.right_of_way.steering import AGAINST_STREET, lattice_tables, moves_against_streets

FLOOR = draw_floor("....\n....\n....\n....")
GRID = floor_for(FLOOR, "undirected").grid


def streets(directions: tuple[int, int]) -> Iterator[str]:
    """Rows of the floor, with the one of two opposite directions that leads along the street."""
    against = moves_against_streets(GRID)
    for y in range(4):
        pairs = [against[FLOOR.cell(x, y), list(directions)].tolist() for x in range(4)]
        assert all(sum(pair) == 1 for pair in pairs)
        yield "".join(">v<^"[directions[pair.index(False)]] for pair in pairs)


def test_rows_run_west_and_east_by_turns() -> None:
    assert list(streets((0, 2))) == ["<<<<", ">>>>", "<<<<", ">>>>"]


def test_columns_run_south_and_north_by_turns() -> None:
    assert list(streets((1, 3))) == ["v^v^"] * 4


@pytest.mark.parametrize("scale", [1, 2])
def test_a_way_costs_its_ticks_and_against_streets_three_times_them(scale: int) -> None:
    """Moves of 2 ticks and turns of 4: west along the upper row, then south."""
    scenario = ['layout={picture: "....\\n....\\n....\\n...."}', "fleet.start=[[3, 0]]"]
    scenario += ["durations={move: 2, turn: 4}", "fleet.robots=1", "orders={tasks: [[[0, 1]]]}"]
    view = Simulation(resolve("random-400", scenario)).view
    tables = lattice_tables(view, scale)
    row = weighted_table_of(view, tables, 0, FLOOR.cell(0, 1))
    west = cost_in(tables, row, FLOOR.cell(3, 0), 2)
    assert west == scale * (3 * 2 + 4 + 2), "three moves, a turn, and one move south"
    row = weighted_table_of(view, tables, 0, FLOOR.cell(3, 0))
    east = cost_in(tables, row, FLOOR.cell(2, 0), 0)
    assert east == scale * AGAINST_STREET * 2


def crowd(settings: list[str]) -> int:
    """Orders that 40 robots do in 200 ticks on a small floor."""
    floor = "layout={generator: random, columns: 10, rows: 10, obstacles: 0.1}"
    common = [floor, "fleet.robots=40", "durations.turn=4", "stop.max_duration=200"]
    run = Simulation(resolve("random-400", [*common, *settings]))
    run.run()
    assert run.world.tally.illegal.sum() == 0
    return int((run.world.orders.state == ORDER_DELIVERED).sum())


def test_the_lattice_guides_robots_under_pibt() -> None:
    plain = crowd([])
    assert crowd(["strategy.right_of_way={name: pibt, guidance: lattice}"]) > plain
