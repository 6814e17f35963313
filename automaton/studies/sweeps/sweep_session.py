"""One sweep into a folder: begun, or gone on with if the code and the study are the same.

A forecast says what it would take: its runs, the time by a few pilot runs, and room on the disk.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.runs.headless import WINDOW_TICKS, Marks, attribute_strategy_errors
from automaton.runs.metrics import counted
from automaton.runs.simulation import Simulation
from automaton.studies.sweeps.coordinator import Coordinator, OnRows, SweepTally
from automaton.studies.sweeps.pools import Backend
from automaton.studies.sweeps.result_store import Store, arrow, declared_in
from automaton.studies.sweeps.result_writing import (
    Writer,
    check_free,
    lock_folder,
    set_damaged_aside,
    write_manifest,
)
from automaton.studies.sweeps.run_keys import Manifest, changed_sources, declared_by, read_manifest
from automaton.studies.sweeps.study import Point
from automaton.studies.sweeps.sweep_plan import Copies, SweepPlan, describe_point
from automaton.studies.sweeps.sweep_runs import Row, figures_of
from automaton.units import count

ADVICE = (
    "use another folder, or --recompute: then rows of other code, scenarios or seeds are ignored"
)


class SweepStart(NamedTuple):
    """What a sweep found when it began."""

    runs: int
    done: int  # of these, before
    aside: tuple[Path, ...]  # files that were damaged; their runs are done again
    reanalysed: bool  # the declared analysis is not that with which runs were made


class SweepResult(NamedTuple):
    """A sweep that came to its end."""

    store: Store
    begun: SweepStart
    tally: SweepTally
    failed: int  # runs without metrics, those that failed in earlier sweeps included


def sweep_into(
    folder: Path,
    plan: SweepPlan,
    backend: Callable[[], Backend],
    recompute: bool = False,
    on_begun: Callable[[SweepStart], None] | None = None,
    on_rows: OnRows | None = None,
    retry_failed: bool = False,
    copies: Copies | None = None,
    patience: float | None = None,
) -> SweepResult:
    """Do the runs that a folder lacks. Raises InputError; what is done is kept in any case.

    `retry_failed`: runs that failed are lacking, too. `copies`: of the study's own files, to keep.
    `patience`: seconds that a Python strategy has for each decision.
    """
    arrow()
    with lock_folder(folder):
        store, reanalysed = open_results(folder, plan, recompute, copies)
        begun, done = load_existing(store, reanalysed, retry_failed, on_begun)
        writer = Writer(store)
        try:
            tally = run_missing(plan, backend, writer, done, on_rows, patience)
            if lacking(store):  # files were damaged meanwhile
                _, done = load_existing(store, False, False, on_begun)
                tally = tally.and_then(run_missing(plan, backend, writer, done, on_rows, patience))
            check_complete(store)
        finally:
            writer.release()
        return SweepResult(store, begun, tally, len(store.failed()))


def load_existing(
    store: Store,
    reanalysed: bool,
    retry_failed: bool,
    on_begun: Callable[[SweepStart], None] | None,
) -> tuple[SweepStart, set[str]]:
    """What a folder holds, and the keys of the runs that are done; damaged files are set aside."""
    aside = tuple(set_damaged_aside(store))
    done = store.keys(with_failed=not retry_failed)
    begun = SweepStart(store.study.runs, len(done), aside, reanalysed)
    if on_begun is not None:
        on_begun(begun)
    return begun, done


def run_missing(
    plan: SweepPlan,
    backend: Callable[[], Backend],
    writer: Writer,
    done: set[str],
    on_rows: OnRows | None,
    patience: float | None,
) -> SweepTally:
    """Do the runs that are not done, and put all rows into one file."""
    tally = SweepTally(0, 0, 0, 0)
    if len(done) < plan.study.runs:
        warm(plan, patience)
        tally = Coordinator(plan, backend(), writer, done, on_rows, patience).conduct()
    writer.close()
    return tally


def lacking(store: Store) -> int:
    """Runs of which a folder has no row."""
    return store.study.runs - len(store.keys())


def check_complete(store: Store) -> None:
    """Raises InputError if runs have no row, though all were done and written."""
    lost = lacking(store)
    if lost:
        raise InputError(
            f"lacks {count(lost, 'row')} of {store.study.runs:,}, since files of rows were damaged "
            "twice after they had been written; the same command does their runs again",
            str(store.folder),
        )


def open_results(
    folder: Path, plan: SweepPlan, recompute: bool = False, copies: Copies | None = None
) -> tuple[Store, bool]:
    """The folder's results, if they are of this plan; whether its analysis was another one.

    What was declared before stays in the manifest where any of its runs count. Raises InputError if
    the results follow from anything else, unless they are to be computed again.
    """
    manifest = plan.manifest
    before = read_manifest(folder)
    if before is None:
        check_free(folder, copies or {})
        return write_manifest(folder, manifest, copies), False
    objection = "" if recompute else difference(before, manifest)
    if objection:
        raise InputError(f"{objection}; {ADVICE}", str(folder))
    if not Store(folder, manifest).keys():
        return write_manifest(folder, manifest, copies), False
    earlier, now = declared_by(declared_in(folder, before)), declared_by(plan.study)
    history = before.earlier if earlier == now else (*before.earlier, earlier)
    manifest = msgspec.structs.replace(manifest, earlier=history)
    return write_manifest(folder, manifest, copies), not earlier.analysed_as(now)


def difference(before: Manifest, now: Manifest) -> str:
    """Why results do not belong to a plan, in a phrase; "" if they do."""
    if before.study != now.study:
        return f"holds the results of the study '{before.study}', not of '{now.study}'"
    changed = changed_sources(before.sources, now.sources)
    if changed:
        return f"holds results of other code: {changed}"
    for name in ("seed", "common_random_numbers"):
        if getattr(before, name) != getattr(now, name):
            was, becomes = getattr(before, name), getattr(now, name)
            return f"holds results of a study with {name} {was}, not {becomes}".lower()
    if len(before.points) != len(now.points):
        return f"holds results of {len(before.points)} points, not {len(now.points)}"
    for number, (old, new) in enumerate(zip(before.points, now.points, strict=True)):
        point = describe_point(Point(number, old.scenario, old.levels))
        if (old.scenario, old.levels) != (new.scenario, new.levels):
            becomes = describe_point(Point(number, new.scenario, new.levels))
            return f"holds results of other points: point {number} was {point}, is {becomes}"
        if old.fingerprint != new.fingerprint:
            return f"holds results of other scenarios: {point} changed (the file, or its floor)"
    if now.replications < before.replications:
        return f"holds {before.replications} replications; the study asks for fewer"
    return ""


def warm(plan: SweepPlan, patience: float | None = None) -> None:
    """Compile, or find in the cache, what the workers will load, so that it is done once."""
    seen = set()
    for resolved in plan.scenarios:
        names = tuple(choice.name for choice in resolved.strategies.values())
        if names not in seen:
            seen.add(names)
            # Rows will say what a strategy raises.
            with contextlib.suppress(Exception), attribute_strategy_errors(resolved):
                Simulation(resolved, patience=patience)


PILOTS = 8  # points that are tried, spread over the design
BUDGET_S = 10.0  # for all pilot runs
TEXT_BYTES = 120  # of a row's words
NUMBER_BYTES = 8


class Forecast(NamedTuple):
    """What is to be done, and what it will take."""

    runs: int
    done: int
    pilots: int
    run_s: float  # seconds of a run on one core, on average
    least_s: float
    most_s: float
    cut: bool  # pilot runs were cut off: the time is at least that
    workers: int
    bytes: int  # on the disk, at most

    @property
    def wall_s(self) -> float:
        """Seconds until the sweep is done."""
        return (self.runs - self.done) * self.run_s / self.workers


def forecast(
    plan: SweepPlan,
    folder: Path | None,
    workers: int,
    retry_failed: bool = False,
    recompute: bool = False,
) -> Forecast:
    """Run a few points once, in this process, and reckon. Nothing is written.

    `retry_failed`: runs that failed are done again, too; `recompute`: of another study's results
    those count that are of this one. Raises InputError for a strategy that raises.
    """
    done = done_in(folder, plan, retry_failed, recompute) if folder is not None else 0
    warm(plan)
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
        runs=plan.study.runs,
        done=done,
        pilots=len(pilots),
        run_s=sum(times) / len(times),
        least_s=min(times),
        most_s=max(times),
        cut=any(cut for _, cut, _ in pilots),
        workers=workers,
        bytes=(plan.study.runs - done) * max(size for *_, size in pilots),
    )


def done_in(folder: Path, plan: SweepPlan, retry_failed: bool, recompute: bool = False) -> int:
    """Runs of a plan that a folder holds, without those that are tried again."""
    before = read_manifest(folder)
    if before is None or (not recompute and difference(before, plan.manifest)):
        return 0
    return len(Store(folder, plan.manifest).keys(with_failed=not retry_failed))


def pilot(plan: SweepPlan, point: int, budget: float) -> tuple[float, bool, int]:
    """Seconds of a run, whether it was cut off and reckoned from its beginning, bytes of its row."""
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
    stretches = (
        [counted(simulation)] * ((limit - 1) // stretch) if stretch else []
    )  # of a whole run
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
