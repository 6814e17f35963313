"""Write an observed run: ticks that are known in advance, without decisions and digests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from automaton.engine.observed_ticks import enter_changes, show_ticks
from automaton.engine.record_codes import KEYFRAME_TICKS
from automaton.engine.state import STRATEGY_COUNT, Array
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_HEADER,
    FRAME_KIND_TICKS,
    FRAME_TICKS,
    Content,
)
from automaton.recording.frames import rules_of
from automaton.recording.recorder import Recorder
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.world.resolved import Resolved

NO_DIGEST = "0" * 16


class ObservedRecorder(Recorder):
    """Writes an observed run to a file. Raises InputError if it cannot be written."""

    def __init__(self, path: str | Path, resolved: Resolved, observed: Content) -> None:
        """`observed`: the part of the header that only observed runs have."""
        self._observed = observed
        self.shown = Simulation(
            resolved,
            on_observe=Simulation.empty_observation,
            strategies=(None,) * STRATEGY_COUNT,
        )
        super().__init__(path, resolved, resolved.scenario.seed)

    def write(self, kind: int, content: Content) -> None:
        if kind == FRAME_KIND_HEADER:
            self.header = content = {**content, "observed": self._observed}
        super().write(kind, content)

    def write_ticks(self, executed: Array, changes: Array) -> None:
        """Write all ticks and the end, and show them in `shown`.

        executed: (T + 1, n) uint16 actions, from tick 0. changes: (k, 4) int64 rows (tick, code,
        identity, value), by tick.
        """
        simulation = self.shown
        self.write(FRAME_KIND_CONDITIONS, rules_of(simulation))
        self._keyframe(simulation.world)
        enter_changes(simulation.world, np.ascontiguousarray(self._observed["first"]), 0)
        for first in range(1, len(executed), FRAME_TICKS):
            last = min(first + FRAME_TICKS, len(executed)) - 1
            begin, end = np.searchsorted(changes[:, 0], (first, last + 1))
            content = {
                "first": first,
                "executed": np.ascontiguousarray(executed[first : last + 1]),
                "decisions": np.zeros(0, np.int64),
                "changes": np.ascontiguousarray(changes[begin:end]),
                "digests": np.zeros(
                    (last + 1 - first, len(self.header["digest_names"])), np.uint64
                ),
            }
            self.write(FRAME_KIND_TICKS, content)
            self._show(content, last)
            if last % KEYFRAME_TICKS == 0 or last == len(executed) - 1:
                self._keyframe(simulation.world)
        end_of_run = {"ticks": simulation.tick, "finished": True, "digest": NO_DIGEST}
        self.write(FRAME_KIND_END, {**end_of_run, "metrics": metrics_of(simulation)})
        self.ended = True

    def _show(self, content: Content, last: int) -> None:
        simulation = self.shown
        while simulation.tick < last:
            show_ticks(
                *(simulation.world, simulation.observation),
                *(content["executed"], content["changes"], content["first"], last),
            )
            simulation.empty_observation()
