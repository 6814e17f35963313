"""Where the robots of a design point lost time and drove: one of its runs, observed again."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from automaton.engine.observation import LOST_EVER, visits_of
from automaton.engine.state import NIL, Array
from automaton.floor.floor_plan import DRIVABLE
from automaton.runs.headless import attribute_strategy_errors
from automaton.runs.report_document import HeatMap
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved


def floor_maps(
    resolved: Resolved, seed: int, digest: str, name: str, after: int = 0
) -> Iterator[HeatMap]:
    """Robot ticks lost and robots that came by, for each cell, in the ticks `after` one.

    `digest`: of the run in the results; a run that comes to another one says so.
    """
    with attribute_strategy_errors(resolved):
        simulation = Simulation(resolved, seed, on_observe=Simulation.empty_observation)
        simulation.run(after)
        before = observed(simulation)
        simulation.run()
    grid = simulation.world.grid
    lost, in_zone, visits = (
        now - then for now, then in zip(observed(simulation), before, strict=True)
    )
    ticks = (
        f"{simulation.tick:,} ticks" if not after else f"ticks {after + 1:,} to {simulation.tick:,}"
    )
    note = f"one run, seed {seed}, {ticks}"
    if simulation.digest != digest:
        note += "; this code comes to another end than that of the results"
    zone = grid.traffic_zone.max(axis=1)
    slowed = np.where(zone == NIL, 0.0, by_cell(in_zone, zone))
    yield HeatMap(f"Lost time, {name}", "robot ticks", laid_out(resolved, lost), note)
    if slowed.any():
        title = f"Driving slowly, {name}"
        yield HeatMap(title, "robot ticks by cell of a zone", laid_out(resolved, slowed), note)
    yield HeatMap(f"Visits, {name}", "robots", laid_out(resolved, visits), note)


def observed(simulation: Simulation) -> tuple[Array, Array, Array]:
    """By cell the robot ticks lost so far, by zone those driven slowly, by cell the robots so far."""
    grid, observation = simulation.world.grid, simulation.observation
    return (
        observation.lost_ticks_by_cell[:, LOST_EVER].astype(np.float64),
        observation.lost_in_zone.astype(np.float64),
        visits_of(observation.flow, grid.offset).astype(np.float64),
    )


def by_cell(lost: Array, zone: Array) -> Array:
    """(C,) what each cell has of its zone's ticks, shared evenly."""
    cells = np.bincount(zone[zone != NIL], minlength=len(lost))
    shared: Array = (lost / np.maximum(cells, 1))[np.maximum(zone, 0)]
    return shared


def laid_out(resolved: Resolved, values: Array) -> Array:
    """(height, width) the values of cells; NaN where robots do not drive."""
    floor_plan = resolved.floor_plan
    field = np.where(DRIVABLE[floor_plan.kind.reshape(-1)], values, np.nan)
    whole: Array = field.reshape(floor_plan.kind.shape)[1:-1, 1:-1]
    return whole
