"""The coordinator of a sweep: hands out the runs that are missing, and keeps each row once.

Few chunks are under way at a time, so that memory stays bounded and little is lost when a worker
dies. A run that was under way then is tried once more, alone; if its worker dies again, the row
says so.
"""

from __future__ import annotations

import contextlib
import pickle
import queue
from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from automaton.errors import InputError
from automaton.studies.sweeps.pools import Backend, FutureLike
from automaton.studies.sweeps.result_writing import Writer
from automaton.studies.sweeps.run_keys import Run
from automaton.studies.sweeps.sweep_plan import SweepPlan
from automaton.studies.sweeps.sweep_runs import Chunk, CodeMismatchError, Row, blank

CHUNK_S = 0.3  # long enough that sending costs nothing, short enough that progress is seen
MAX_SWEEP_CHUNK = 100  # runs
RUNS_PER_BLOCK = 50  # replications of a point that are done before the next point's
CLOCK_POLL_S = 0.2  # between two looks at the clock
DIED_MESSAGE = "the worker process died twice, the second time with this run alone"
UNABLE_MESSAGE = (
    "the workers cannot start: they have said why; a script that sweeps needs "
    'its `if __name__ == "__main__":`'
)

OnRows = Callable[[list[Row]], None]


class SweepTally(NamedTuple):
    """What a sweep did."""

    done: int  # runs of which rows were written
    failed: int  # of these failed
    unfinished: int  # of these reached their limit
    repeated: int  # runs begun a second time, since a worker died


class Coordinator:
    """Carries out the runs of plans that are not done yet, round after round, by the same workers."""

    def __init__(
        self,
        backend: Backend,
        writer: Writer,
        on_rows: OnRows | None = None,
        patience: float | None = None,
    ) -> None:
        self.backend, self.writer = backend, writer
        self.on_rows = on_rows  # also called without rows now and then, while none arrive
        self.patience = patience
        self.finished: queue.SimpleQueue[FutureLike] = queue.SimpleQueue()
        self.under_way: dict[FutureLike, tuple[Chunk, bool]] = {}  # chunk, whether it runs alone
        self.retry_in_isolation: deque[Run] = deque()
        self.waiting: Iterator[list[Run]] = iter(())
        self.block: deque[Run] = deque()
        self.has_results = False  # a result has arrived, so workers can start
        self.refused = False  # the pool takes nothing more: it has broken
        self.seconds_per_run: dict[int, float] = {}  # point -> seconds of a run
        self.chunks = self.done = self.failed = self.unfinished = self.repeated = 0

    def conduct(self, plan: SweepPlan, done: set[str]) -> None:
        """Run what is missing. What is raised on the way leaves all finished rows written."""
        self.plan, self.version = plan, plan.manifest.version
        self.waiting = self._missing(done)
        try:
            while self._submit_while_room():
                self._wait_for_chunk()
            self.writer.flush()
        except BaseException:
            with contextlib.suppress(Exception):  # what has gone wrong already is what is told
                try:
                    self._take_finished()
                finally:  # Ctrl-C may come again
                    self.writer.flush()
            raise

    def close(self, now: bool) -> None:
        """End the workers; `now`: without waiting for what they do."""
        self.backend.close(now)

    @property
    def tally(self) -> SweepTally:
        """What was done so far."""
        repeated = self.repeated + self.backend.repeated
        return SweepTally(self.done, self.failed, self.unfinished, repeated)

    def _missing(self, done: set[str]) -> Iterator[list[Run]]:
        """The runs to do, in blocks of one point each: all points advance together."""
        manifest = self.plan.manifest
        for first in range(0, manifest.replications, RUNS_PER_BLOCK):
            for point in range(len(manifest.points)):
                block = range(first, min(first + RUNS_PER_BLOCK, manifest.replications))
                runs = (manifest.run(self.version, point, replication) for replication in block)
                missing = [run for run in runs if run.key not in done]
                if missing:
                    yield missing

    def _submit_while_room(self) -> bool:
        """Submit what there is room for; return whether anything is under way."""
        if self.retry_in_isolation:  # all others pause: alone, a run has all memory to itself
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

    def _next_runs(self) -> tuple[Run, ...]:
        known = self.seconds_per_run.get(self.block[0].point)
        if known is None:
            known = max(self.seconds_per_run.values(), default=CHUNK_S)
        size = max(1, min(MAX_SWEEP_CHUNK, int(CHUNK_S / max(known, 1e-6))))
        return tuple(self.block.popleft() for _ in range(min(size, len(self.block))))

    def _submit(self, runs: tuple[Run, ...], alone: bool) -> None:
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

    def _return_runs(self, runs: tuple[Run, ...]) -> None:
        """Runs that a pool did not take, since it had broken; what is under way will say so."""
        self.block.extendleft(reversed(runs))
        self.refused = True
        if not self.under_way:
            self.backend.restart()

    def _wait_for_chunk(self) -> None:
        """Wait for a chunk, or until it is time to write."""
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
        """Keep the rows that have arrived meanwhile."""
        while not self.finished.empty():
            future = self.finished.get()
            with contextlib.suppress(Exception):
                self._keep(future.result())

    def _handle_dead_worker(self, chunk: Chunk, alone: bool) -> list[Row]:
        """Handle a worker that died: a run that was alone has failed, others are retried in isolation."""
        if alone:
            if not self.has_results and not self.backend.can_start():
                raise InputError(UNABLE_MESSAGE)
            return [blank(run, DIED_MESSAGE) for run in chunk.runs]
        self.repeated += len(chunk.runs)
        self.retry_in_isolation.extend(chunk.runs)
        # The pool breaks as a whole: what else was under way comes back broken, too.
        if not any(not alone for _, alone in self.under_way.values()):
            self.backend.restart()
        return []

    def _keep(self, rows: list[Row]) -> None:
        """Rows that are done; they are counted before they are written, as Ctrl-C may come then."""
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
    plan: SweepPlan, version: str, number: int, runs: tuple[Run, ...], patience: float | None = None
) -> Chunk:
    """What a worker is told about runs of one point."""
    point = runs[0].point
    return Chunk(
        number=number,
        version=version,
        plugins=plan.plugins,
        fingerprint=plan.manifest.points[point].fingerprint,
        scenario=pickle.dumps(plan.scenarios[point], pickle.HIGHEST_PROTOCOL),
        windows=plan.manifest.points[point].windows,
        runs=runs,
        patience=patience,
    )


def refused(error: BaseException) -> InputError:
    """What to say when workers cannot work."""
    if isinstance(error, CodeMismatchError):
        return InputError(f"a worker has other code than this process: {error}")
    what = " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return InputError(f"the workers cannot go on ({what}); what is done is kept")
