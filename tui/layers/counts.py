"""Layers of counts by cell: visits, lost time, moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from automaton.engine.observation import LOST_EVER, congestion_of, visits_of
from automaton.engine.state import Array
from tui.render.layer import Layer

if TYPE_CHECKING:  # it needs Numba
    from automaton.runs.simulation import Simulation


class Visits(Layer):
    """How often each cell was entered."""

    key, label, position = "f3", "Visits", 10
    meaning = "visits: how often cells are entered"
    unit = counted = "visits"
    ranked = True

    def numbers(self, simulation: Simulation, selected: int) -> Array:
        return visits_of(simulation.observation.flow, simulation.world.grid.offset)


class Waiting(Layer):
    """Where time was lost."""

    key, label, position = "f4", "Waiting", 20
    meaning = "waiting: where time is lost"
    unit, counted = "ticks lost", "ticks lost here"
    empty = "no ticks lost so far"
    ranked = True

    def numbers(self, simulation: Simulation, selected: int) -> Array:
        lost: Array = simulation.observation.lost_ticks_by_cell[:, LOST_EVER].copy()
        return lost


class Congestion(Layer):
    """Where time was lost recently."""

    key, label, position = "f5", "Congestion", 30
    meaning = "congestion: where time was lost recently"
    unit, counted = "ticks lost recently", "ticks lost here recently"
    empty = "no ticks lost recently"
    ranked = True

    def numbers(self, simulation: Simulation, selected: int) -> Array:
        return congestion_of(simulation.observation.lost_ticks_by_cell, simulation.tick)


class Flow(Layer):
    """Moves out of each cell, by direction."""

    key, label, position = "f6", "Flow", 40
    meaning = "flow: moves out of each cell"
    unit = "moves"
    arrows = True

    def numbers(self, simulation: Simulation, selected: int) -> Array:
        return simulation.observation.flow.copy()
