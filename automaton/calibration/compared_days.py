"""Simulate each day of a site many times with its real orders, and measure days and runs alike.

Robots begin where the log has them first, so that days need no warm-up. Their homes stay those of the
scenario.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.agreement import Agreement, DayResult, Measures, agreement
from automaton.calibration.fleet_trace import (
    BUSIEST,
    MeasurePlan,
    entries_of,
    measured,
    measured_run,
)
from automaton.calibration.site_day import Resolved, SiteDay
from automaton.errors import InputError
from automaton.floor.floor_plan import NIL, FloorPlan
from automaton.floor.traffic_zones import traffic_zones_of
from automaton.runs.simulation import Simulation
from automaton.runs.state_copy import hold_cells
from automaton.studies.process_pool import PersistentPool
from automaton.world.floor_parts import service_cells

Array = np.ndarray[Any, Any]

MAX_EQUAL: Final = 0.5  # share of the messages of two days
HEADINGS_OF_RAILS: Final = 2
MIN_IN_STRETCHES: Final = 0.5  # of the drivable cells; on a more open floor, crossings count too


class Compared(NamedTuple):
    """Days beside their runs, and the verdict."""

    days: list[DayResult]
    agreement: Agreement
    stretch_of: Array  # (cells,) int32 the stretch of each cell, or NIL
    busiest: tuple[int, ...]  # cells of the headways
    floor_plan: FloorPlan


class DayPlan(NamedTuple):
    """How the runs of a day begin, and how they and the day are measured."""

    cells: Array  # (n,) int32 first cell of each robot, NIL: as in the scenario
    plan: MeasurePlan


class DayRuns:
    """Measures days, and runs of them; a context manager that ends its processes."""

    def __init__(self, days: Sequence[SiteDay], workers: int | None = None) -> None:
        self.plans = plans_of(days)
        self.real: list[Measures] = [measured(day.trace, self.plans[day.mark].plan) for day in days]
        self._pool = PersistentPool(workers, partial(measured_day, plans=self.plans))

    def __enter__(self) -> DayRuns:
        self._pool.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._pool.__exit__(*error)

    def of(
        self, days: Sequence[Resolved], runs: int, on_done: Callable[[int], None] | None = None
    ) -> list[list[Measures]]:
        """The measures of each day in each run, with the seeds from that of the scenario on.

        Raises InputError.
        """
        jobs = [(day, day.scenario.seed + k) for day in days for k in range(runs)]
        done = [one.metrics for one in self._pool.run(jobs, on_done)]
        return [[*done[first : first + runs]] for first in range(0, len(done), runs)]


def compare_days(
    days: Sequence[SiteDay],
    runs: int,
    workers: int | None = None,
    on_done: Callable[[int], None] | None = None,
) -> Compared:
    """Run each day, and judge. Raises InputError."""
    with DayRuns(days, workers) as of_days:
        done = of_days.of([day.resolved for day in days], runs, on_done)
    results = [
        DayResult(day.name, day.begin, real, simulated)
        for day, real, simulated in zip(days, of_days.real, done, strict=True)
    ]
    plan = of_days.plans[days[0].mark].plan
    floor_plan = days[0].resolved.floor_plan
    return Compared(results, agreement(results), plan.stretch_of, plan.busiest, floor_plan)


def plans_of(days: Sequence[SiteDay]) -> dict[str, DayPlan]:
    """The plan of each day, by its mark."""
    floor_plan = days[0].resolved.floor_plan
    stretch_of, cells = stretches_of(floor_plan), floor_plan.kind.size
    entries = np.sum([entries_of(day.trace, cells) for day in days], axis=0)
    busiest = tuple(np.argsort(-entries, kind="stable")[:BUSIEST].tolist())
    stretches = int(stretch_of.max()) + 1
    plans = {
        day.mark: DayPlan(
            day.cells,
            MeasurePlan(
                *(day.ticks, len(day.trace.cell), day.trace.period, stretch_of, stretches),
                *(busiest, day.by_load, day.released),
            ),
        )
        for day in days
    }
    if len(plans) < len(days):
        raise InputError("two logs have one name, and days are known by it; rename one of them")
    for one, other in combinations(days, 2):
        least = min(len(one.moves), len(other.moves))
        if least and len(np.intersect1d(one.moves, other.moves, True)) > MAX_EQUAL * least:
            raise InputError(f"{other.name} repeats the messages of {one.name}; a day counts once")
    return plans


def measured_day(simulation: Simulation, plans: Mapping[str, DayPlan]) -> dict[str, float | int]:
    """Run a day to its end, and measure what a log of the run would show."""
    of_day = next(plans[one] for one in simulation.resolved.overrides if one in plans)
    place_robots(simulation, of_day.cells)
    return {**measured_run(simulation, of_day.plan)}


def place_robots(simulation: Simulation, cells: Array) -> None:
    """Let robots begin in other cells than their starts, where the floor allows.

    `cells`: (n,) by identity, NIL: at its start. A robot stays at its start if the cell is closed to it,
    a station, a charger or a place of a queue, if another robot begins there, or if it could not drive
    on without a turntable. With gates, all do.
    """
    world, resolved = simulation.world, simulation.resolved
    robots, floor_plan = world.robots, resolved.floor_plan
    if len(world.gates.kind):
        return
    wanted = cells[robots.identity]
    moves = (wanted != NIL) & floor_plan.drivable.reshape(-1)[wanted]
    moves &= ~service_cells(resolved.scenario, floor_plan)[wanted]
    moves &= ~resolved.fleet.closed[robots.type % len(resolved.fleet.closed), wanted]
    exits = floor_plan.exits.reshape(-1)[wanted].astype(np.int64)
    along = (exits >> robots.heading | exits >> (robots.heading ^ 2)) & 1 > 0
    moves &= along | (world.grid.type_headings[robots.type] != HEADINGS_OF_RAILS)
    while True:
        at = np.where(moves, wanted, robots.cell)
        order = np.lexsort((moves, at))  # a robot that stays comes first
        again = order[1:][(np.diff(at[order]) == 0) & moves[order[1:]]]
        if not len(again):
            break
        moves[again] = False
    moves &= wanted != robots.cell
    robots.cell[moves] = wanted[moves]
    robots.parked[moves] = 0
    world.clock.unparked += int(moves.sum())
    hold_cells(world)


def stretches_of(floor_plan: FloorPlan) -> Array:
    """(cells,) int32 the straight stretch between crossings of each cell, or NIL.

    On an open floor, where most cells are crossings, each crossing is a stretch, too.
    """
    of: Array = traffic_zones_of(floor_plan).of[:, 0]
    if np.count_nonzero(of != NIL) < MIN_IN_STRETCHES * np.count_nonzero(floor_plan.drivable):
        of = traffic_zones_of(floor_plan, "with-intersections").of[:, 0]
    return of
