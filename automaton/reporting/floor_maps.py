"""Where the robots of a design point lost time and drove: one of its runs, observed again."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from automaton.headless import strategies_blamed
from automaton.reporting.document import HeatMap
from automaton.scenario.resolve import Resolved
from automaton.simulation import Simulation
from automaton.world.plan import DRIVABLE
from automaton.world.state import Array
from automaton.world.waiting import LOST_EVER, visits_of


def floor_maps(resolved: Resolved, seed: int, digest: str, name: str) -> Iterator[HeatMap]:
    """Robot ticks lost and robots that came by, for each cell, over the whole run.

    `digest`: of the run in the results; a run that comes to another one says so.
    """
    with strategies_blamed(resolved):
        simulation = Simulation(resolved, seed, on_observe=Simulation.empty_observation)
        simulation.run()
    grid, watch = simulation.world.grid, simulation.watch
    note = f"one run, seed {seed}, {simulation.tick:,} ticks"
    if simulation.digest != digest:
        note += "; this code comes to another end than that of the results"
    lost = watch.delay[:, LOST_EVER].astype(np.float64)
    visits = visits_of(watch.flow, grid.offset).astype(np.float64)
    yield HeatMap(f"Lost time, {name}", "robot ticks", laid_out(resolved, lost), note)
    yield HeatMap(f"Visits, {name}", "robots", laid_out(resolved, visits), note)


def laid_out(resolved: Resolved, values: Array) -> Array:
    """(height, width) the values of cells; NaN where robots do not drive."""
    plan = resolved.plan
    field = np.where(DRIVABLE[plan.kind.reshape(-1)], values, np.nan)
    whole: Array = field.reshape(plan.kind.shape)[1:-1, 1:-1]
    return whole
