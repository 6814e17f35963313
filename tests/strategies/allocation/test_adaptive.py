"""Adaptive planning is at least as good as the better of the two published strategies."""

from __future__ import annotations

import numpy as np
import pytest

from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

SEEDS = range(1, 21)


def ticks(configuration: int, robots: int, allocation: str) -> np.ndarray:
    settings = [f"fleet.robots={robots}", f"strategy.allocation={allocation}"]
    resolved = resolve(f"tabletop-{configuration}", settings)
    totals = []
    for seed in SEEDS:
        simulation = Simulation(resolved, seed=seed)
        simulation.run()
        assert simulation.finished
        totals.append(simulation.tick)
    return np.array(totals)


@pytest.mark.parametrize("configuration", [1, 2])
@pytest.mark.parametrize("robots", [1, 2, 3, 4, 5])
def test_no_worse_than_the_better_of_the_two(configuration: int, robots: int) -> None:
    published = [ticks(configuration, robots, name) for name in ("independent", "cooperative")]
    better = min(published, key=lambda totals: totals.mean())
    difference = ticks(configuration, robots, "adaptive") - better
    allowed = 2 * difference.std(ddof=1) / len(SEEDS) ** 0.5 + 0.01 * better.mean()
    assert difference.mean() <= allowed


def test_it_uses_both_ways_where_the_tables_are_many() -> None:
    simulation = Simulation(resolve("tabletop-2", ["strategy.allocation=adaptive"]))
    simulation.run()
    legs = simulation.world.orders.legs
    assert (legs == 1).any()  # carried all the way
    assert (legs > 1).any()  # passed on
