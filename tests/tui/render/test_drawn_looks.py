"""The viewer and the drawings read the same looks off cells and robots."""

from __future__ import annotations

import numpy as np
import pytest

from automaton.build.resolve import resolve
from automaton.drawings.moment import drawn_floor, moment_of
from automaton.drawings.robot_looks import STATE_COLOURS
from automaton.evidence.history.snapshot import take_snapshot
from automaton.runs.simulation import Simulation
from tui.playback.run_source import floor_of
from tui.render.robot_marks import DRAW_SELECTED, robots_of
from tui.render.robot_marks import STATE_COLOURS as MARK_COLOURS
from tui.render.scene import KIND_MASK, Scene

SLOWER_WITH_A_LOAD = "durations.move={empty: 1 m/s, loaded: 0.5 m/s}"


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("crossing", ()),
        ("goods-mini", ()),
        ("goods-mini", (SLOWER_WITH_A_LOAD,)),
        ("tabletop-mini", ()),
    ],
)
def test_robots_have_the_same_states_shapes_and_fronts(
    name: str, settings: tuple[str, ...]
) -> None:
    simulation = Simulation(resolve(name, settings), 1, on_observe=Simulation.empty_observation)
    floor, drawn = floor_of(simulation.resolved), drawn_floor(simulation.resolved)
    states = set()
    for tick in range(0, 200, 20):
        simulation.run(until=tick)
        marks = robots_of(Scene(floor, take_snapshot(simulation)))
        looks = moment_of(drawn, simulation.world, simulation.observation).looks
        assert looks.state.tolist() == marks.state.tolist()
        assert looks.shape.tolist() == marks.shape.tolist()
        assert looks.direction.tolist() == marks.direction.tolist()
        states |= set(looks.state.tolist())
    assert len(states) > 1
    assert (floor.looks & KIND_MASK == drawn.looks & KIND_MASK).all()
    assert len(STATE_COLOURS) == len(np.unique(MARK_COLOURS[: DRAW_SELECTED + 1]))
