"""A sweep into a folder: started, or resumed if the code and the study are unchanged.

A study with a bound of replications proceeds in rounds; all points have equally many runs after each.
A coordinator submits the missing runs, few at a time, so that memory stays bounded and little is lost
when a worker dies; the runs in progress are then retried once, alone. Pilot runs give a forecast of
the time and disk space of a sweep.
"""

from __future__ import annotations

import contextlib
import pickle
import queue
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.runs.first_compilation import compiled_parts
from automaton.runs.headless import WINDOW_TICKS, CountedStretches, attribute_strategy_errors
from automaton.runs.metrics import counted
from automaton.runs.provenance import changed_sources, first_changes
from automaton.runs.simulation import Simulation
from automaton.studies.sweeps.pools import (
    Backend,
    CodeMismatchError,
    FutureLike,
    SweepChunk,
    figures_of,
    numbers_of_periods,
)
from automaton.studies.sweeps.result_store import (
    STUDY_FILE,
    Store,
    Writer,
    arrow,
    check_free,
    declared_in,
    lock_folder,
    set_damaged_aside,
    write_manifest,
)
from automaton.studies.sweeps.run_keys import (
    Manifest,
    Row,
    SweepRun,
    blank,
    declared_by,
    read_manifest,
)
from automaton.studies.sweeps.study import Point
from automaton.studies.sweeps.sweep_plan import SweepPlan, describe_point
from automaton.units import count

CHUNK_S: Final = 0.3  # long enough to make sending cheap, short enough to show progress
MAX_SWEEP_CHUNK: Final = 100  # runs
RUNS_PER_BLOCK: Final = 50  # replications of a point before the next point's turn
CLOCK_POLL_S: Final = 0.2  # between two checks of the clock
ADVICE: Final = (
    "use another folder, or --recompute to ignore rows of other code, scenarios or seeds"
)
DIED_MESSAGE: Final = "the worker process died twice, the second time with this run alone"
UNABLE_MESSAGE: Final = (
    "the workers cannot start (see their messages); a script that sweeps needs "
    '`if __name__ == "__main__":`'
)
PILOTS: Final = 8  # pilot points of a forecast, spread over the design
BUDGET_S: Final = 10.0  # for all pilot runs
TEXT_BYTES: Final = 120  # of the texts of a row
NUMBER_BYTES: Final = 8

OnRows = Callable[[list[Row]], None]
Decide = Callable[[Store], int | None]  # replications after the next round; None: no more rounds


class SweepStart(NamedTuple):
    """The state of a results folder at the start of a sweep."""

    runs: int
    done: int  # runs done before
    aside: tuple[Path, ...]  # damaged files; their runs are repeated
    reanalysed: bool  # whether the declared analysis has changed since runs were made


class SweepResult(NamedTuple):
    """The result of a finished sweep."""

    store: Store
    begun: SweepStart
    tally: SweepTally
    failed: int  # runs without metrics, including those that failed in earlier sweeps


def sweep_into(
    folder: Path,
    plan: SweepPlan,
    backend: Callable[[], Backend],
    recompute: bool = False,
    on_begun: Callable[[SweepStart], None] | None = None,
    on_rows: OnRows | None = None,
    retry_failed: bool = False,
    patience: float | None = None,
    decide: Decide | None = None,
) -> SweepResult:
    """Do the runs that a folder lacks. Raises InputError; finished runs are saved in any case.

    `retry_failed`: repeat failed runs, too. `patience`: seconds that a Python strategy
    has for each decision. `decide`: called after each round of a study with a target precision; returns
    the replications after the next round.
    """
    arrow()
    with lock_folder(folder):
        store, reanalysed = open_results(folder, plan, recompute)
        begun, done = load_existing(store, reanalysed, retry_failed, on_begun)
        writer = Writer(store)
        try:
            with Coordinator(backend, writer, on_rows, patience) as coordinator:
                while True:
                    plan = plan._replace(manifest=store.manifest)
                    coordinator.run_missing(plan, done)
                    if lacking(store):  # files were damaged meanwhile
                        _, done = load_existing(store, False, False, on_begun)
                        coordinator.run_missing(plan, done)
                    check_complete(store)
                    replications = decide(store) if decide and plan.study.in_rounds else None
                    if replications is None:
                        break
                    store = write_manifest(folder, store.manifest.going_on(replications))
                    _, done = load_existing(store, False, False, on_begun)
        finally:
            writer.release()
        return SweepResult(store, begun, coordinator.tally, len(store.failed()))


def load_existing(
    store: Store,
    reanalysed: bool,
    retry_failed: bool,
    on_begun: Callable[[SweepStart], None] | None,
) -> tuple[SweepStart, set[str]]:
    """The state of a folder and the keys of the runs that are done; renames damaged files."""
    aside = tuple(set_damaged_aside(store))
    done = store.keys(with_failed=not retry_failed)
    begun = SweepStart(store.study.runs, len(done), aside, reanalysed)
    if on_begun is not None:
        on_begun(begun)
    return begun, done


def lacking(store: Store) -> int:
    """Number of runs without a row in the folder."""
    return store.study.runs - len(store.keys())


def check_complete(store: Store) -> None:
    """Raise InputError if runs have no row although all were done and written."""
    lost = lacking(store)
    if lost:
        raise InputError(
            f"lacks {count(lost, 'row')} of {store.study.runs:,} because files of rows were damaged "
            "twice after they had been written; repeat the command to do these runs again",
            str(store.folder),
        )


def open_results(folder: Path, plan: SweepPlan, recompute: bool = False) -> tuple[Store, bool]:
    """The folder's results for this plan, and whether their analysis was another one.

    Earlier declarations stay in the manifest if any of their runs count. Raises InputError if the
    results belong to another plan, unless `recompute` is set.
    """
    before = read_manifest(folder)
    manifest = plan.manifest if recompute else gone_on_with(plan, before)
    if before is None:
        check_free(folder, {**plan.copies, STUDY_FILE: manifest.text.encode()})
        return write_manifest(folder, manifest, plan.copies), False
    objection = "" if recompute else difference(before, manifest)
    if objection:
        raise InputError(f"{objection}; {ADVICE}", str(folder))
    if not Store(folder, manifest).keys():
        return write_manifest(folder, plan.manifest, plan.copies), False
    earlier, now = declared_by(declared_in(folder, before)), declared_by(plan.study)
    is_same, asked = earlier == now, before.replications  # up to the present round
    earlier = msgspec.structs.replace(earlier, replications=asked)
    history = before.earlier if is_same else (*before.earlier, earlier)
    manifest = msgspec.structs.replace(manifest, earlier=history)
    return write_manifest(folder, manifest, plan.copies), not earlier.analysed_as(now)


def gone_on_with(plan: SweepPlan, before: Manifest | None) -> Manifest:
    """The manifest of a plan, continued from the present round of a folder with all earlier rounds."""
    study, now = plan.study, plan.manifest
    if before is None or not study.in_rounds or before.replications > study.max_replications:
        return now
    rounds = before.rounds if isinstance(before.rounds, tuple) else (before.replications,)
    replications = max(before.replications, study.min_replications)
    if replications > rounds[-1]:
        rounds = (*rounds, replications)
    return msgspec.structs.replace(now, replications=replications, rounds=rounds)


def difference(before: Manifest, now: Manifest) -> str:
    """A phrase that says why results do not belong to a plan; "" if they do."""
    if before.study != now.study:
        return f"holds results of the study '{before.study}', not of '{now.study}'"
    changed = first_changes(changed_sources(before.sources, now.sources))
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
            return f"holds results of other points: point {number} was {point} and is now {becomes}"
        if old.fingerprint != new.fingerprint:
            return f"holds results of other scenarios: {point} has changed (its file, its floor or `set`)"
    if now.replications < before.replications:
        return f"holds {before.replications} replications; the study asks for fewer"
    return ""


def warm(plan: SweepPlan, patience: float | None = None) -> None:
    """Compile the parts that the workers will load from the cache, so that this is done once."""
    for point in points_to_warm(plan):
        resolved = plan.scenarios[point]
        # Rows will report errors of strategies.
        with contextlib.suppress(Exception), attribute_strategy_errors(resolved):
            Simulation(resolved, patience=patience)


def points_to_warm(plan: SweepPlan) -> list[int]:
    """The first point of each combination of strategies and features."""
    first: dict[Hashable, int] = {}
    for point, resolved in enumerate(plan.scenarios):
        first.setdefault(compiled_parts(resolved), point)
    return list(first.values())


# The coordinator submits the missing runs and stores one row for each.


class SweepTally(NamedTuple):
    """The numbers of runs of a sweep."""

    done: int  # runs with a written row
    failed: int  # runs among them that failed
    unfinished: int  # runs among them that reached their limit
    repeated: int  # runs started a second time because a worker died


class Coordinator:
    """Executes the missing runs of plans, round after round, with the same workers.

    The workers start with the first missing run and end with the sweep.
    """

    def __init__(
        self,
        start: Callable[[], Backend],
        writer: Writer,
        on_rows: OnRows | None = None,
        patience: float | None = None,
    ) -> None:
        self.start, self.writer = start, writer
        self.on_rows = on_rows  # also called with [] now and then while no rows arrive
        self.patience = patience
        self.backend: Backend  # from `start`, once `has_started`
        self.has_started = False
        self.finished: queue.SimpleQueue[FutureLike] = queue.SimpleQueue()
        self.under_way: dict[FutureLike, tuple[SweepChunk, bool]] = {}  # chunk, if it runs alone
        self.retry_in_isolation: deque[SweepRun] = deque()
        self.waiting: Iterator[list[SweepRun]] = iter(())
        self.block: deque[SweepRun] = deque()
        self.has_results = False  # a result has arrived, so workers can start
        self.refused = False  # whether the pool is broken and takes no more chunks
        self.seconds_per_run: dict[int, float] = {}  # point -> seconds per run
        self.chunks = self.done = self.failed = self.unfinished = self.repeated = 0

    def __enter__(self) -> Coordinator:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        if self.has_started:
            self.backend.close(now=kind is not None)

    @property
    def tally(self) -> SweepTally:
        """The numbers of runs so far."""
        repeated = self.repeated + (self.backend.repeated if self.has_started else 0)
        return SweepTally(self.done, self.failed, self.unfinished, repeated)

    def run_missing(self, plan: SweepPlan, done: set[str]) -> None:
        """Do the missing runs, and merge all rows into one file.

        All finished rows are written even if an exception ends this.
        """
        if len(done) < plan.runs:
            if not self.has_started:
                warm(plan, self.patience)
                self.backend, self.has_started = self.start(), True
            self._conduct(plan, done)
        self.writer.close()

    def _conduct(self, plan: SweepPlan, done: set[str]) -> None:
        self.plan, self.version = plan, plan.manifest.version
        self.waiting = self._missing(done)
        try:
            while self._submit_while_room():
                self._wait_for_chunk()
            self.writer.flush()
        except BaseException:
            with contextlib.suppress(Exception):  # must not hide the first exception
                try:
                    self._take_finished()
                finally:  # the user may press Ctrl-C again
                    self.writer.flush()
            raise

    def _missing(self, done: set[str]) -> Iterator[list[SweepRun]]:
        """The missing runs, in blocks of one point each, so that all points advance together."""
        manifest = self.plan.manifest
        for first in range(0, manifest.replications, RUNS_PER_BLOCK):
            for point in range(len(manifest.points)):
                block = range(first, min(first + RUNS_PER_BLOCK, manifest.replications))
                runs = (manifest.run(self.version, point, replication) for replication in block)
                missing = [run for run in runs if run.key not in done]
                if missing:
                    yield missing

    def _submit_while_room(self) -> bool:
        """Submit as many chunks as the backend takes; return whether any work is left."""
        if self.retry_in_isolation:  # all others pause, so that the run can use the whole memory
            if not self.under_way:
                self._submit((self.retry_in_isolation.popleft(),), alone=True)
        else:
            self.refused = False
            while (
                not self.refused
                and len(self.under_way) < self.backend.max_in_flight
                and self._has_more()
            ):
                self._submit(self._next_runs(), alone=False)
        return bool(self.under_way or self.retry_in_isolation) or self._has_more()

    def _has_more(self) -> bool:
        if not self.block:
            self.block.extend(next(self.waiting, ()))
        return bool(self.block)

    def _next_runs(self) -> tuple[SweepRun, ...]:
        known = self.seconds_per_run.get(self.block[0].point)
        if known is None:
            known = max(self.seconds_per_run.values(), default=CHUNK_S)
        size = max(1, min(MAX_SWEEP_CHUNK, int(CHUNK_S / max(known, 1e-6))))
        return tuple(self.block.popleft() for _ in range(min(size, len(self.block))))

    def _submit(self, runs: tuple[SweepRun, ...], alone: bool) -> None:
        self.chunks += 1
        chunk = chunk_of(self.plan, self.version, self.chunks, runs, self.patience)
        try:
            future = self.backend.submit_alone(chunk) if alone else self.backend.submit(chunk)
        except Exception as error:
            if alone or not self.backend.is_worker_lost(error):
                raise refused(error) from error
            self._return_runs(runs)
            return
        self.under_way[future] = (chunk, alone)
        future.add_done_callback(self.finished.put)

    def _return_runs(self, runs: tuple[SweepRun, ...]) -> None:
        """Put back runs that a broken pool did not take; chunks in progress will report the failure."""
        self.block.extendleft(reversed(runs))
        self.refused = True
        if not self.under_way:
            self.backend.restart()

    def _wait_for_chunk(self) -> None:
        """Wait for a chunk or for CLOCK_POLL_S."""
        try:
            future = self.finished.get(timeout=CLOCK_POLL_S)
        except queue.Empty:
            self.writer.tick()
            if self.on_rows is not None:
                self.on_rows([])
            return
        chunk, alone = self.under_way.pop(future)
        try:
            rows = future.result()
        except Exception as error:
            if not self.backend.is_worker_lost(error):
                raise refused(error) from error
            rows = self._handle_dead_worker(chunk, alone)
        else:
            self.has_results = True
        self._keep(rows)

    def _take_finished(self) -> None:
        """Store the rows that have arrived meanwhile."""
        while not self.finished.empty():
            future = self.finished.get()
            with contextlib.suppress(Exception):
                self._keep(future.result())

    def _handle_dead_worker(self, chunk: SweepChunk, alone: bool) -> list[Row]:
        """Handle the death of a worker: a run that ran alone has failed, others are retried alone."""
        if alone:
            if not self.has_results and not self.backend.can_start():
                raise InputError(UNABLE_MESSAGE)
            return [blank(run, DIED_MESSAGE) for run in chunk.runs]
        self.repeated += len(chunk.runs)
        self.retry_in_isolation.extend(chunk.runs)
        # The pool breaks as a whole, so all other chunks in progress fail as well.
        if not any(not alone for _, alone in self.under_way.values()):
            self.backend.restart()
        return []

    def _keep(self, rows: list[Row]) -> None:
        """Store finished rows; count them before they are written, since Ctrl-C may interrupt that."""
        self.writer.hold(rows)
        for row in rows:
            self.done += 1
            if row["error"] is not None:
                self.failed += 1
            else:
                self.seconds_per_run[row["point"]] = row["wall_s"]
                self.unfinished += not row["finished"]
        if rows and self.on_rows is not None:
            self.on_rows(rows)
        self.writer.tick()


def chunk_of(
    plan: SweepPlan,
    version: str,
    number: int,
    runs: tuple[SweepRun, ...],
    patience: float | None = None,
) -> SweepChunk:
    """The chunk with runs of one point, as sent to a worker."""
    point = runs[0].point
    return SweepChunk(
        number=number,
        version=version,
        plugins=plan.plugins,
        fingerprint=plan.manifest.points[point].fingerprint,
        scenario=pickle.dumps(plan.scenarios[point], pickle.HIGHEST_PROTOCOL),
        windows=plan.manifest.points[point].windows,
        runs=runs,
        patience=patience,
        name=describe_point(plan.points[point]),
    )


def refused(error: BaseException) -> InputError:
    """The error if workers cannot continue."""
    if isinstance(error, CodeMismatchError):
        return InputError(f"the code of a worker differs from the code of this process: {error}")
    what = " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return InputError(f"the workers cannot continue ({what}); finished runs are saved")


# The forecast of a sweep: runs, time (from pilot runs and the start of a worker), and disk space.


class Forecast(NamedTuple):
    """The runs to do, and their time and disk space."""

    runs: int  # a minimum, if a precision determines the number
    most_runs: int
    done: int
    pilots: int
    start_s: float  # until the workers have loaded the compiled parts
    run_s: float  # mean seconds of a run on one core
    least_s: float
    most_s: float
    cut: bool  # whether pilot runs were cut off, so that times are lower bounds
    workers: int
    row_bytes: int  # maximum bytes of a row on the disk

    @property
    def wall_s(self) -> float:
        """Seconds until the sweep is done; a minimum, if a precision determines the number of runs."""
        return self._seconds(self.runs)

    @property
    def most_wall_s(self) -> float:
        """Seconds until the sweep is done if it needs the maximum number of runs."""
        return self._seconds(self.most_runs)

    @property
    def bytes(self) -> int:
        """Maximum number of bytes on the disk."""
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
    """Run a few points once in this process, and estimate the cost of the sweep. Writes no results.

    `trial`: a backend with one worker, which loads the compiled parts as all workers will; it is closed
    at the end. Kernels are compiled here and cached for the sweep. `retry_failed`: count failed runs as
    missing. `recompute`: count only the rows of this study in a folder of another one. Raises InputError
    if a strategy raises an exception.
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
    """Seconds from the command to the first run: twice the time that a worker takes to start and load.

    The main process takes the same time before its workers start.
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
    """Number of a plan's runs that a folder holds, without failed runs that are to be retried."""
    before = read_manifest(folder)
    manifest = plan.manifest if recompute else gone_on_with(plan, before)
    if before is None or (not recompute and difference(before, manifest)):
        return 0
    return len(Store(folder, manifest).keys(with_failed=not retry_failed))


def pilot(plan: SweepPlan, point: int, budget: float) -> tuple[float, bool, int]:
    """Seconds of a run, whether it was cut off without an estimate of its length, bytes of its row."""
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
    # As many stretches as a whole run has.
    stretches = [counted(simulation)] * ((limit - 1) // stretch) if stretch else []
    row = figures_of(simulation, window, CountedStretches(None, stretches))
    cut = not simulation.finished and simulation.tick < limit
    if cut and resolved.scenario.ends_at_limit:
        return (
            seconds * limit / simulation.tick,
            False,
            row_bytes(plan, row, numbers_of_periods(resolved)),
        )
    return seconds, cut, row_bytes(plan, row, numbers_of_periods(resolved))


def row_bytes(plan: SweepPlan, row: Row, in_periods: int) -> int:
    """Bytes of an uncompressed row; `in_periods`: numbers that its periods have."""
    numbers = len(row["metrics"]) + len(plan.study.factor_names) + len(row.get("series") or ())
    numbers += sum(map(len, row.get("sums", {}).values())) + in_periods
    return TEXT_BYTES + NUMBER_BYTES * (numbers + 8)
