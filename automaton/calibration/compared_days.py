"""Simulate each day of a site many times with its real orders, and measure days and runs alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.agreement import Agreement, DayResult, agreement
from automaton.calibration.fleet_trace import (
    BUSIEST,
    MeasurePlan,
    entries_of,
    measured,
    measured_run,
)
from automaton.calibration.site_day import SiteDay
from automaton.floor.floor_plan import NIL, FloorPlan
from automaton.floor.traffic_zones import traffic_zones_of
from automaton.studies.process_pool import run_jobs

Array = np.ndarray[Any, Any]

MIN_IN_STRETCHES: Final = 0.5  # of the drivable cells; on a more open floor, crossings count too


class Compared(NamedTuple):
    """Days beside their runs, and the verdict."""

    days: list[DayResult]
    agreement: Agreement
    stretch_of: Array  # (cells,) int32 the stretch of each cell, or NIL
    busiest: tuple[int, ...]  # cells of the headways
    floor_plan: FloorPlan


def compare_days(
    days: Sequence[SiteDay],
    runs: int,
    workers: int | None = None,
    on_done: Callable[[int], None] | None = None,
) -> Compared:
    """Run each day with the seeds from that of the scenario on, and judge. Raises InputError."""
    floor_plan = days[0].resolved.floor_plan
    stretch_of, cells = stretches_of(floor_plan), floor_plan.kind.size
    entries = np.sum([entries_of(day.trace, cells) for day in days], axis=0)
    busiest = tuple(np.argsort(-entries, kind="stable")[:BUSIEST].tolist())
    results = []
    for day in days:
        plan = MeasurePlan(
            day.ticks,
            len(day.trace.cell),
            day.trace.period,
            stretch_of,
            int(stretch_of.max()) + 1,
            busiest,
            day.by_load,
            day.released,
        )
        seed = day.resolved.scenario.seed
        jobs = [(day.resolved, seed + k) for k in range(runs)]
        done = run_jobs(jobs, workers, on_done, partial(measured_run, plan=plan))
        simulated = [one.metrics for one in done]
        results.append(DayResult(day.name, day.begin, measured(day.trace, plan), simulated))
    return Compared(results, agreement(results), stretch_of, busiest, floor_plan)


def stretches_of(floor_plan: FloorPlan) -> Array:
    """(cells,) int32 the straight stretch between crossings of each cell, or NIL.

    On an open floor, where most cells are crossings, each crossing is a stretch, too.
    """
    of: Array = traffic_zones_of(floor_plan).of[:, 0]
    if np.count_nonzero(of != NIL) < MIN_IN_STRETCHES * np.count_nonzero(floor_plan.drivable):
        of = traffic_zones_of(floor_plan, "with-intersections").of[:, 0]
    return of
