"""The cells that robots came through last, from routes and from what was shown before."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from automaton.engine.state import NIL
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from tui.playback.playback_state import TRAIL_CELLS, Trails


def positions(simulation: Simulation) -> np.ndarray:
    """(n,) by identity the cell of each robot, or the one that it enters."""
    robots = simulation.world.robots
    cells = np.where(robots.claim == NIL, robots.cell, robots.claim)
    return cells[robots.at_index]


@pytest.mark.parametrize("every", [1, 3])
def test_a_trail_is_the_way_that_a_robot_came(every: int) -> None:
    simulation, trails = Simulation(resolve("tabletop-mini")), Trails()
    ways = [deque([int(cell)], maxlen=300) for cell in positions(simulation)]
    agreed = 0
    for tick in range(1, 200):
        simulation.run(until=tick)
        for way, cell in zip(ways, positions(simulation).tolist(), strict=True):
            if cell != way[-1]:
                way.append(cell)
        if tick % every:
            continue
        shown = trails.at(simulation)
        assert shown.shape == (len(ways), TRAIL_CELLS)
        for way, trail in zip(ways, shown.tolist(), strict=True):
            came = [cell for cell in trail if cell != NIL]
            true = list(way)[-2::-1][: len(came)]
            agreed += came == true and len(came) == TRAIL_CELLS
            if every == 1:
                assert came[: len(true)] == true, (tick, came, true)
            else:  # between two states a robot may have got a new route: no cell is invented
                assert set(came) <= set(way)
    assert agreed > 60


def test_after_a_jump_a_trail_begins_with_the_route_that_is_driven() -> None:
    simulation, trails = Simulation(resolve("tabletop-mini")), Trails()
    simulation.run(until=20)
    trails.at(simulation)
    simulation.run(until=150)
    shown, alone = trails.at(simulation), Trails().at(simulation)
    assert np.array_equal(shown, alone) and (alone != NIL).any()
    assert trails.at(simulation) is shown  # of one tick they are made once
