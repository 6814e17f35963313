"""Runs of the factory for `zoning`: what is run for a case, and what is read off it.

Travel is what robots drive between the stations to which they are sent; the first leg of each, from
where it starts to the station of its first order, does not count (it does not in the publication).
The time to complete ends with the last work at a station.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.engine.state import ACTION_MOVE, ACTION_PICK, NIL, Array
from automaton.runs.headless import run_to_end
from automaton.runs.simulation import Simulation
from automaton.units import SECONDS_PER_UNIT, unit

CURVE_EVERY: Final = 0.25  # hours between two points of a throughput curve
CURVE_UNTIL: Final = 12.0
CURVE: Final = "parts at "  # and the hour: how a point is called

Figures = dict[str, float | int]


def hours_of(simulation: Simulation, ticks: float) -> float:
    """Ticks in hours; a scenario's ticks are in seconds."""
    return unit(simulation.resolved.scenario.units.tick).of(ticks) / SECONDS_PER_UNIT["h"]


def first_legs(simulation: Simulation) -> Array:
    """(n,) cells that each stored robot drives until it picks up its first load.

    Runs the simulation up to the last of these. A robot that never picks anything up has none.
    """
    limit = simulation.resolved.scenario.stop.max_duration
    operations = simulation.world.tally.operations
    legs = np.full(len(operations), NIL, np.int64)
    while not simulation.finished and simulation.tick < limit and (legs == NIL).any():
        simulation.run(until=simulation.tick + 1)
        begun = (legs == NIL) & (operations[:, ACTION_PICK].sum(1) > 0)
        legs[begun] = operations[begun, ACTION_MOVE].sum(1)
    legs[legs == NIL] = 0
    return legs


def feet_by_robot(simulation: Simulation, legs: Array) -> Array:
    """(n,) feet that each robot drove, by identity, without its first leg."""
    cell = simulation.resolved.scenario.units.cell
    assert cell is not None, "the scenario says what a cell is"
    moves = simulation.world.tally.operations[:, ACTION_MOVE].sum(1) - legs
    feet: Array = unit(cell).size * moves[simulation.world.robots.at_index]
    return feet


def finished_parts(simulation: Simulation) -> Array:
    """(p,) ticks in which parts were finished, in order."""
    stations = simulation.world.stations
    return np.sort(
        stations.completion_tick[
            (stations.releases_order == NIL) & (stations.completion_tick != NIL)
        ]
    )


def completed(simulation: Simulation) -> Figures:
    """A run to its end: the columns of Table 5, the curve of Figure 5, and what zoning did."""
    legs = first_legs(simulation)
    run_to_end(simulation)
    feet = feet_by_robot(simulation, legs)
    done, counted = finished_parts(simulation), simulation.counted
    figures: Figures = {
        "hours": hours_of(simulation, float(simulation.world.stations.completion_tick.max())),
        "mean_ft": float(feet.mean()),
        "sigma_ft": float(feet.std()),
        "parts": len(done),
        "illegal": int(simulation.world.tally.illegal.sum()),
        **{
            published: counted[name]
            for published, name in (("redesigns", "redesigns"), ("load_shares", "shared_orders"))
            if name in counted
        },
    }
    if counted.get("ticks_watched"):
        figures["in_balance"] = counted["ticks_in_balance"] / counted["ticks_watched"]
    return figures | curve_of(simulation, done)


def curve_of(simulation: Simulation, done: Array) -> Figures:
    """Finished parts at each point of time of a throughput curve."""
    seconds = unit(simulation.resolved.scenario.units.tick).size
    at = np.array(curve_hours()) * SECONDS_PER_UNIT["h"] / seconds
    counts = np.searchsorted(done, at, side="right").tolist()
    return {point(hour): count for hour, count in zip(curve_hours(), counts, strict=True)}


def curve_hours() -> list[float]:
    """The points of time of a throughput curve."""
    return np.arange(0.0, CURVE_UNTIL + 1e-9, CURVE_EVERY).tolist()


def point(hour: float) -> str:
    """The name of a point of a throughput curve."""
    return f"{CURVE}{hour:g} h"


def travelled(simulation: Simulation) -> Figures:
    """A run to its end: only how evenly its robots drove."""
    figures = completed(simulation)
    return {"sigma_ft": figures["sigma_ft"]}
