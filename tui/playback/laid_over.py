"""The numbers of a layer in the snapshots of a run."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Final

from automaton.engine.state import Array
from automaton.history.snapshot import Snapshot
from automaton.runs.simulation import Simulation
from tui.registration import layer_named

OVERLAY_TIME_RATIO: Final = 4  # at most a fourth of the time goes into a layer that takes long


class Overlays:
    """The numbers that were computed last for one run."""

    def __init__(self) -> None:
        self._of: tuple[Simulation, int, int, str] | None = None  # run, tick, robot and layer
        self._field: Array | None = None
        self._next = -math.inf  # when it may be computed again while ticks go by

    def laid_over(
        self, snapshot: Snapshot, simulation: Simulation, name: str, playing: bool
    ) -> Snapshot:
        """The snapshot of this moment with the numbers of a layer.

        While ticks go by they may be as old as the layer's `pause_s`; otherwise they are of this tick.
        """
        layer = layer_named(name)
        now = (simulation, snapshot.tick, snapshot.selected, name)
        began = time.monotonic()
        old = self._of is not None and self._of[2:] == now[2:] and began < self._next
        if self._of != now and not (playing and old):
            self._of, self._field = now, layer.numbers(simulation, snapshot.selected)
            ended = time.monotonic()
            pause = max(layer.pause_s, OVERLAY_TIME_RATIO * (ended - began))
            self._next = ended + (pause if layer.pause_s else 0.0)
        if layer.arrows:
            return replace(snapshot, flow=self._field)
        return replace(snapshot, heat=self._field)
