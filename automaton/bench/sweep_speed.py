"""The overhead of a sweep, and the gain of a second worker.

Runs take about 50 ms; the workers have loaded the compiled loop before measurement starts.
Wall-clock seconds, since the work is in other processes: only an idle machine gives correct
figures.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from automaton.bench.measurement import Measurement, Sample, cpu_seconds, wall_seconds
from automaton.studies.sweeps.pools import FutureLike, LocalPool, run_one
from automaton.studies.sweeps.result_store import arrow
from automaton.studies.sweeps.study import Study
from automaton.studies.sweeps.sweep_plan import SweepPlan, make_sweep_plan
from automaton.studies.sweeps.sweep_session import chunk_of, sweep_into

SWEPT_RUNS = 80
SWEEP_SAMPLES = 3
SWEPT_TICKS = 2_800  # about 50 ms with 20 robots
SHARE, TIMES = "% of the bare runs", "times"


def measurements() -> list[Measurement]:
    """Overhead with one worker, the coordinator's CPU, and two workers against one."""
    arrow()
    wanted = (
        ("sweep, overhead with one worker", SHARE, overhead),
        ("sweep, CPU of its coordinator", SHARE, coordination),
        ("sweep, two workers against one", TIMES, speed_up),
        ("sweep, CPU of the runs, two workers against one", TIMES, dearer),
    )
    return [
        Measurement(name, unit, partial(prepare, figure), at_most=SWEEP_SAMPLES)
        for name, unit, figure in wanted
    ]


class LastingPool(LocalPool):
    """A pool of ready workers that outlives a sweep."""

    def close(self, now: bool) -> None:
        """Stay."""

    def ready(self, plan: SweepPlan) -> None:
        """Start every worker and load the compiled loop."""
        crew: list[FutureLike] = []
        for number, run in zip(range(2 * self.workers), plan.manifest.runs(), strict=False):
            crew.append(self.submit(chunk_of(plan, plan.manifest.version, number, (run,))))
        for promise in crew:
            promise.result()

    def __del__(self) -> None:
        super().close(now=True)


def study(runs: int = SWEPT_RUNS, ticks: int = SWEPT_TICKS) -> Study:
    """Runs of one point: fork trucks in the 100 x 100 warehouse."""
    levels: dict[str, Any] = {"stop.max_duration": ticks, "orders.count": ticks}
    return Study(name="bench", scenario="warehouse-100", listed=(levels,), replications=runs)


def prepare(figure: Callable[[SweepPlan, dict[int, LastingPool]], float]) -> Sample:
    """A sampler of a figure, with pools of one and two workers."""
    plan = make_sweep_plan(study())
    pools = {workers: LastingPool(workers) for workers in (1, 2)}
    for pool in pools.values():
        pool.ready(plan)
    return lambda: figure(plan, pools)


def overhead(plan: SweepPlan, pools: dict[int, LastingPool]) -> float:
    """Extra time of a sweep over that of the same runs, in percent."""
    bare = wall_seconds(lambda: run_bare(plan))
    return 100 * (swept(plan, pools[1])[0] / bare - 1)


def coordination(plan: SweepPlan, pools: dict[int, LastingPool]) -> float:
    """CPU time of the coordinating process, in percent of that of the runs."""
    found: list[tuple[float, float]] = []
    seconds = cpu_seconds(lambda: found.append(swept(plan, pools[1])))
    return 100 * seconds / found[0][1]


def speed_up(plan: SweepPlan, pools: dict[int, LastingPool]) -> float:
    """Seconds with one worker over seconds with two."""
    return swept(plan, pools[1])[0] / swept(plan, pools[2])[0]


def dearer(plan: SweepPlan, pools: dict[int, LastingPool]) -> float:
    """CPU seconds of parallel runs over those of sequential runs."""
    return swept(plan, pools[2])[1] / swept(plan, pools[1])[1]


def swept(plan: SweepPlan, pool: LastingPool) -> tuple[float, float]:
    """(wall-clock seconds, CPU seconds of the runs) of a whole sweep into a new folder."""
    with tempfile.TemporaryDirectory(prefix="automaton-bench-") as folder:
        begun = time.perf_counter()
        store = sweep_into(Path(folder), plan, lambda: pool).store
        seconds = time.perf_counter() - begun
        return seconds, sum(store.rows().column("cpu_s").to_pylist())


def run_bare(plan: SweepPlan) -> None:
    """The same runs in this process, without the sweep."""
    for run in plan.manifest.runs():
        run_one(plan.scenarios[run.point], run)
