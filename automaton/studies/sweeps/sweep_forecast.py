"""What a sweep would take: its runs, the time by pilot runs and a worker's start, room on the disk."""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

from automaton.runs.headless import WINDOW_TICKS, Marks, attribute_strategy_errors
from automaton.runs.metrics import counted
from automaton.runs.simulation import Simulation
from automaton.studies.sweeps.coordinator import chunk_of
from automaton.studies.sweeps.pools import Backend
from automaton.studies.sweeps.result_store import Store
from automaton.studies.sweeps.run_keys import read_manifest
from automaton.studies.sweeps.sweep_plan import SweepPlan
from automaton.studies.sweeps.sweep_runs import Row, figures_of
from automaton.studies.sweeps.sweep_session import difference, gone_on_with, points_to_warm, warm

PILOTS = 8  # points that are tried, spread over the design
BUDGET_S = 10.0  # for all pilot runs
TEXT_BYTES = 120  # of a row's words
NUMBER_BYTES = 8


class Forecast(NamedTuple):
    """What is to be done, and what it will take."""

    runs: int  # at least, if a precision says how many
    most_runs: int
    done: int
    pilots: int
    start_s: float  # until the workers have loaded what is compiled
    run_s: float  # seconds of a run on one core, on average
    least_s: float
    most_s: float
    cut: bool  # pilot runs were cut off: the time is at least that
    workers: int
    row_bytes: int  # of one row on the disk, at most

    @property
    def wall_s(self) -> float:
        """Seconds until the sweep is done, at least, if a precision says how many runs there are."""
        return self._seconds(self.runs)

    @property
    def most_wall_s(self) -> float:
        """Seconds until it is done if it takes all runs that there may be."""
        return self._seconds(self.most_runs)

    @property
    def bytes(self) -> int:
        """Bytes on the disk, at most."""
        return max(0, self.most_runs - self.done) * self.row_bytes

    def _seconds(self, runs: int) -> float:
        left = max(0, runs - self.done)
        return self.start_s + left * self.run_s / self.workers if left else 0.0


def forecast(
    plan: SweepPlan,
    folder: Path | None,
    workers: int,
    trial: Backend,
    retry_failed: bool = False,
    recompute: bool = False,
) -> Forecast:
    """Run a few points once, in this process, and estimate. Nothing is written.

    `trial`: of one worker, which starts and loads what all of them will; it is closed. What must be
    compiled is compiled here, and the sweep finds it. `retry_failed`: runs that failed are done again,
    too; `recompute`: of another study's results those count that are of this one. Raises InputError for
    a strategy that raises.
    """
    done = done_in(folder, plan, retry_failed, recompute) if folder is not None else 0
    warm(plan)
    start = start_seconds(plan, trial)
    number = len(plan.scenarios)
    chosen = sorted({index * (number - 1) // max(1, PILOTS - 1) for index in range(PILOTS)})
    pilots: list[tuple[float, bool, int]] = []
    for point in chosen[: max(1, number)]:
        left = BUDGET_S - sum(seconds for seconds, *_ in pilots)
        if left <= 0:
            break
        pilots.append(pilot(plan, point, max(left / 2, BUDGET_S / PILOTS)))
    times = [seconds for seconds, *_ in pilots]
    return Forecast(
        runs=max(plan.runs, done),
        most_runs=plan.study.runs,
        done=done,
        pilots=len(pilots),
        start_s=start,
        run_s=sum(times) / len(times),
        least_s=min(times),
        most_s=max(times),
        cut=any(cut for _, cut, _ in pilots),
        workers=workers,
        row_bytes=max(size for *_, size in pilots),
    )


def start_seconds(plan: SweepPlan, trial: Backend) -> float:
    """Seconds from the command to the first run: twice what a worker takes to start and to load.

    The process of the sweep starts and loads the same before its workers do.
    """
    begun = time.perf_counter()
    try:
        for number, point in enumerate(points_to_warm(plan)):
            first = plan.manifest.run(plan.manifest.version, point, 0)
            chunk = chunk_of(plan, plan.manifest.version, number, (first,))
            trial.submit(chunk._replace(runs=())).result()
    finally:
        trial.close(now=True)
    return 2 * (time.perf_counter() - begun)


def done_in(folder: Path, plan: SweepPlan, retry_failed: bool, recompute: bool = False) -> int:
    """Runs of a plan that a folder holds, without those that are tried again."""
    before = read_manifest(folder)
    manifest = plan.manifest if recompute else gone_on_with(plan, before)
    if before is None or (not recompute and difference(before, manifest)):
        return 0
    return len(Store(folder, manifest).keys(with_failed=not retry_failed))


def pilot(plan: SweepPlan, point: int, budget: float) -> tuple[float, bool, int]:
    """Seconds of a run, whether it was cut off and estimated from its beginning, bytes of its row."""
    resolved = plan.scenarios[point]
    limit = resolved.scenario.stop.max_duration
    begun = time.perf_counter()
    with attribute_strategy_errors(resolved):
        simulation = Simulation(resolved)
        while not simulation.finished and simulation.tick < limit:
            simulation.run(min(simulation.tick + WINDOW_TICKS, limit))
            if time.perf_counter() - begun > budget:
                break
    seconds = time.perf_counter() - begun
    window, stretch = plan.manifest.points[point].windows
    # Of a whole run.
    stretches = [counted(simulation)] * ((limit - 1) // stretch) if stretch else []
    row = figures_of(simulation, window, Marks(None, stretches))
    cut = not simulation.finished and simulation.tick < limit
    if cut and resolved.scenario.stop.when == "never":
        return seconds * limit / simulation.tick, False, row_bytes(plan, row)
    return seconds, cut, row_bytes(plan, row)


def row_bytes(plan: SweepPlan, row: Row) -> int:
    """Bytes of a row that is not compressed at all."""
    numbers = len(row["metrics"]) + len(plan.study.factor_names) + len(row.get("series") or ())
    numbers += sum(map(len, row.get("sums", {}).values()))
    return TEXT_BYTES + NUMBER_BYTES * (numbers + 8)
