"""Layers of counts by cell: visits, lost time, moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from automaton.engine.observation import LOST_EVER, congestion_of, visits_of
from automaton.engine.state import NIL, Array
from tui.render.cell_looks import TINT_CODES, TINTS
from tui.render.layer import Layer, ScaleLine
from tui.render.styles import Entries, GlyphSet, code, style

if TYPE_CHECKING:  # it needs Numba
    from automaton.runs.simulation import Simulation
    from tui.render.scene import Scene

MORE, LESS = 4, 0  # tints of cells in which robots spent more time, or less
SMALL: Final = 20  # differences below this part of the greatest one are not shown


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


class TimeDifference(Layer):
    """Where robots of one recording spent more time than those of the other, beside it."""

    key, label, position = "E", "Difference", 48
    meaning = "time in cells, observed minus simulated"
    words = "time difference"
    unit = counted = "more time"
    absent = "this layer compares two recordings: automaton replay REAL.rec SIMULATED.rec"
    compares = ranked = True
    pause_s = 0.5

    def is_there(self, scene: Scene) -> bool:
        return scene.values is not None

    def tints(self, scene: Scene) -> Array | None:
        values = scene.values
        if values is None:
            return None
        small = max(1, int(np.abs(values).max(initial=0)) // SMALL)
        tints: Array = np.where(values >= small, MORE, np.where(values <= -small, LESS, NIL))
        return tints.astype(np.int8)

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries:
        values = scene.values
        if values is None:
            return [((), self.absent)]
        most, least = int(values.max(initial=0)), -int(values.min(initial=0))
        return [
            ((tint_sign(MORE),), f"more time than in the simulation, up to {most:,}"),
            ((tint_sign(LESS),), f"less, down to {least:,}"),
        ]

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        if scene.values is None:
            return [self.absent]
        return ["more time", (tint_sign(MORE),), "less", (tint_sign(LESS),)]

    def key_words(self, scene: Scene, resolved: object, glyphs: GlyphSet) -> list[str]:
        more, less = (chr(TINT_CODES[tint]) for tint in (MORE, LESS))
        return [f"{more} more time than in the simulation", f"{less} less"]

    def value_words(self, value: int) -> list[str]:
        return [f"time difference {value:+,}"]


def tint_sign(tint: int) -> int:
    """A tint as the code of a sign."""
    return int(code(style(TINTS[tint], TINTS[tint]), TINT_CODES[tint]))
