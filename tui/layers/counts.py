"""Layers of counts by cell: visits, lost time, moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from automaton.engine.observation import LOST_EVER, congestion_of, visits_of
from automaton.engine.state import NIL, Array
from tui.render.layer import Layer, ScaleLine, tint_letter, tint_sign

if TYPE_CHECKING:  # it needs Numba
    from automaton.runs.simulation import Simulation

MORE, LESS = 4, 0  # tints of cells in which robots spent more time, or less
SMALL_PART: Final = 20  # differences below this part of the greatest one are not shown


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

    key, label, position = "f4", "Time lost", 20
    meaning = "time lost: where robots lost it"
    words = "time lost"
    unit, counted = "ticks lost", "ticks lost here"
    empty = "no ticks lost so far"
    ranked = True

    def numbers(self, simulation: Simulation, selected: int) -> Array:
        lost: Array = simulation.observation.lost_ticks_by_cell[:, LOST_EVER].copy()
        return lost


class Congestion(Layer):
    """Where time was lost recently."""

    key, label, position = "f5", "Time lost recently", 30
    meaning = "congestion: where time was lost recently"
    words = "time lost recently"
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


class TimeDifference(Layer):
    """Where robots of one recording spent more time than those of the other, beside it."""

    key, label, position = "R", "Times", 48
    meaning = "time in cells, observed minus simulated"
    words = "time difference"
    unit = counted = "more time"
    absent = "this layer compares two recordings: automaton replay REAL.rec SIMULATED.rec"
    compares = ranked = True
    pause_s = 0.5

    def is_there(self, scene: Any) -> bool:
        return bool(scene.is_compared)

    def tints(self, scene: Any) -> Array | None:
        values = scene.values
        if values is None:
            return None
        small = max(1, int(np.abs(values).max(initial=0)) // SMALL_PART)
        tints: Array = np.where(values >= small, MORE, np.where(values <= -small, LESS, NIL))
        return tints.astype(np.int8)

    def entries(self, scene: Any, glyphs: Any) -> Any:
        values = scene.values
        if values is None:
            return [((), self.absent)]
        most, least = int(values.max(initial=0)), -int(values.min(initial=0))
        return [
            ((tint_sign(MORE),), f"more time than in the simulation, up to {most:,}"),
            ((tint_sign(LESS),), f"less, down to {least:,}"),
        ]

    def scale(self, scene: Any, glyphs: Any) -> ScaleLine:
        if scene.values is None:
            return [self.absent]
        return ["more time", (tint_sign(MORE),), "less", (tint_sign(LESS),)]

    def key_words(self, scene: Any, resolved: object, glyphs: Any) -> list[str]:
        more, less = tint_letter(MORE), tint_letter(LESS)
        return [f"{more} more time than in the simulation", f"{less} less"]

    def value_words(self, value: int) -> list[str]:
        return [f"time difference {value:+,}"]
