"""What is taken from a run while it goes on: at the end of every so many ticks, and observed ticks."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from automaton.runs.simulation import Simulation

Take = Callable[[Simulation], None]


class Sampling(NamedTuple):
    """A run stops for it between ticks, which changes nothing in the run."""

    period: int  # ticks; 0: it takes no samples
    on_sample: Take  # after tick 0 and after each period
    on_observe: Take | None  # as of a Simulation; None: it observes nothing

    def advance(self, simulation: Simulation, until: int) -> None:
        """Carry a run on to a tick, or to its end, with the samples on the way."""
        if not self.period:
            simulation.run(until)
            return
        while simulation.tick < until and not simulation.finished:
            due = (simulation.tick // self.period + 1) * self.period
            simulation.run(min(due, until))
            if simulation.tick == due:
                self.on_sample(simulation)
