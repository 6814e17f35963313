"""The viewer, which shows snapshots, and drawings, which read the state, show the same robots."""

from __future__ import annotations

from automaton.drawings import looks as drawings
from automaton.drawings.looks import PALETTE
from automaton.drawings.moment import drawn_floor, moment_of
from automaton.floor.floor_plan import CELL_KINDS
from automaton.history.snapshot import take_snapshot
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from tui.render import cell_looks as viewer
from tui.render.drawn_robots import robots_of
from tui.render.scene import Scene, floor_of


def test_a_snapshot_and_the_state_have_the_same_robots_in_the_same_order() -> None:
    resolved = resolve("crossing")
    simulation = Simulation(resolved, 1, on_observe=Simulation.empty_observation)
    simulation.run(until=90)
    marks = robots_of(Scene(floor_of(resolved), take_snapshot(simulation)))
    looks = moment_of(drawn_floor(resolved), simulation.world, simulation.observation).looks
    seen = (marks.state, marks.shape, marks.direction)
    assert [one.tolist() for one in seen] == [one.tolist() for one in looks]
    assert all(len(set(one.tolist())) > 1 for one in seen)


def test_each_kind_of_cell_has_a_colour() -> None:
    assert set(viewer.CELL_COLOURS) == {kind.code for kind in CELL_KINDS}
    assert set(drawings.KIND_COLOURS.values()) <= set(PALETTE)
