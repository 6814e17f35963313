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
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.traffic_zones import traffic_zones_of
from automaton.studies.process_pool import run_jobs

Array = np.ndarray[Any, Any]

CROSSINGS_TOO: Final = "with-intersections"


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
    zones = traffic_zones_of(floor_plan, CROSSINGS_TOO)
    stretch_of, cells = zones.of[:, 0], floor_plan.kind.size
    entries = np.sum([entries_of(day.trace, cells) for day in days], axis=0)
    busiest = tuple(np.argsort(-entries, kind="stable")[:BUSIEST].tolist())
    results = []
    for day in days:
        plan = MeasurePlan(
            day.ticks,
            len(day.trace.cell),
            day.trace.period,
            stretch_of,
            zones.count,
            busiest,
            day.released,
        )
        seed = day.resolved.scenario.seed
        jobs = [(day.resolved, seed + k) for k in range(runs)]
        done = run_jobs(jobs, workers, on_done, partial(measured_run, plan=plan))
        simulated = [one.metrics for one in done]
        results.append(DayResult(day.name, day.begin, measured(day.trace, plan), simulated))
    return Compared(results, agreement(results), stretch_of, busiest, floor_plan)
