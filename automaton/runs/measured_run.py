"""A run to its end that is measured after its warm-up, and in stretches of time where that is asked.

What a run adds up is read off whenever a stretch ends; orders and parts know their ticks themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from automaton.runs.headless import run_to_end
from automaton.runs.metrics import Counted, counted, sums_of_orders
from automaton.runs.simulation import Simulation
from automaton.runs.station_metrics import sums_of_parts
from automaton.runs.task_metrics import summed, tasks_after
from automaton.scenario.unavailable_metrics import warm_up_of


class Marks(NamedTuple):
    """What a run had counted when its warm-up ended, and at the end of each stretch but the last."""

    warm_up: Counted | None  # None: metrics are of the whole run
    stretches: list[Counted]


def run_marked(simulation: Simulation, every: int = 0) -> Marks:
    """Run to the end; `every`: ticks of a stretch, 0 for none."""
    scenario = simulation.resolved.scenario
    warm_up, limit = warm_up_of(scenario), scenario.stop.max_duration
    borders = range(every, limit, every) if every else range(0)
    at = {}
    for tick in sorted({*borders, *((warm_up,) if warm_up else ())}):
        run_to_end(simulation, until=tick)
        if simulation.tick == tick:
            at[tick] = counted(simulation)
    run_to_end(simulation)
    return Marks(at.get(warm_up), [at[tick] for tick in borders if tick in at])


def sums_by_stretch(simulation: Simulation, stretches: list[Counted]) -> dict[str, list[int]]:
    """Return the sums of metric_sums in each stretch of a run that is over; the last ends with it."""
    ends = [*stretches, counted(simulation)]
    borders = np.array([0, *(one.tick for one in ends)])
    so_far = {name: [one.sums.get(name, 0) for one in ends] for name in ends[-1].sums}
    found = {name: np.diff(values, prepend=0) for name, values in so_far.items()}
    found["ticks"] = np.diff(borders)
    found["robot_ticks"] = found["ticks"] * len(simulation.world.robots.cell)
    found |= sums_of_orders(simulation.world, borders)
    found |= sums_of_parts(simulation.world, borders)
    if simulation.resolved.scenario.measure is not None:
        tasks = tasks_after(simulation, 0)
        found |= {name: summed(tasks.begun, v, borders) for name, v in tasks.sums.items()}
    return {name: values.tolist() for name, values in found.items()}
