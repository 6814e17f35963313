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
from automaton.experiments.keys import Run
from automaton.experiments.plan import Plan
from automaton.experiments.pools import Crew, Promise
from automaton.experiments.runs import Chunk, OtherCode, Row, blank
from automaton.experiments.writing import Writer

CHUNK_S = 0.3  # long enough that sending costs nothing, short enough that progress is seen
LARGEST_CHUNK = 100  # runs
BLOCK = 50  # replications of a point that are done before the next point's
LOOK_S = 0.2  # between two looks at the clock
DIED = "the worker process died twice, the second time with this run alone"
UNABLE = (
    "the workers cannot start: they have said why; a script that sweeps needs "
    'its `if __name__ == "__main__":`'
)

OnRows = Callable[[list[Row]], None]


class Tally(NamedTuple):
    """What a sweep did."""

    done: int  # runs of which rows were written
    failed: int  # of these gave no metrics
    unfinished: int  # of these reached their limit
    repeated: int  # runs begun a second time, since a worker died

    def and_then(self, other: Tally) -> Tally:
        """What both did."""
        return Tally(*map(sum, zip(self, other, strict=True)))


class Coordinator:
    """Carries out the runs of a plan that are not done yet."""

    def __init__(
        self,
        plan: Plan,
        crew: Crew,
        writer: Writer,
        done: set[str],
        on_rows: OnRows | None = None,
        patience: float | None = None,
    ) -> None:
        self.plan, self.crew, self.writer = plan, crew, writer
        self.version = plan.manifest.version
        self.on_rows = on_rows
        self.patience = patience
        self.finished: queue.SimpleQueue[Promise] = queue.SimpleQueue()
        self.under_way: dict[Promise, tuple[Chunk, bool]] = {}  # chunk, whether it runs alone
        self.suspects: deque[Run] = deque()
        self.waiting = self._missing(done)
        self.block: deque[Run] = deque()
        self.heard = False  # a chunk has come back: workers do start
        self.refused = False  # the pool takes nothing more: it has broken
        self.pace: dict[int, float] = {}  # point -> seconds of a run
        self.chunks = self.done = self.failed = self.unfinished = self.repeated = 0

    def conduct(self) -> Tally:
        """Run what is missing. What is raised on the way leaves all finished rows written."""
        try:
            while self._fed():
                self._take()
            self.writer.flush()
            self.crew.close(now=False)
        except BaseException:
            with contextlib.suppress(Exception):  # what has gone wrong already is what is told
                self._take_finished()
                self.writer.flush()
            self.crew.close(now=True)
            raise
        return self.tally

    @property
    def tally(self) -> Tally:
        """What was done so far."""
        repeated = self.repeated + self.crew.repeated
        return Tally(self.done, self.failed, self.unfinished, repeated)

    def _missing(self, done: set[str]) -> Iterator[list[Run]]:
        """The runs to do, in blocks of one point each: all points advance together."""
        manifest = self.plan.manifest
        for first in range(0, manifest.replications, BLOCK):
            for point in range(len(manifest.points)):
                block = range(first, min(first + BLOCK, manifest.replications))
                runs = (manifest.run(self.version, point, replication) for replication in block)
                missing = [run for run in runs if run.key not in done]
                if missing:
                    yield missing

    def _fed(self) -> bool:
        """Hand out what there is room for; whether anything is under way."""
        if self.suspects:  # all others pause: alone, a run has all memory to itself
            if not self.under_way:
                self._submit((self.suspects.popleft(),), alone=True)
        else:
            self.refused = False
            while not self.refused and len(self.under_way) < self.crew.slots and self._has_more():
                self._submit(self._next_runs(), alone=False)
        return bool(self.under_way or self.suspects) or self._has_more()

    def _has_more(self) -> bool:
        if not self.block:
            self.block.extend(next(self.waiting, ()))
        return bool(self.block)

    def _next_runs(self) -> tuple[Run, ...]:
        known = self.pace.get(self.block[0].point)
        if known is None:
            known = max(self.pace.values(), default=CHUNK_S)
        size = max(1, min(LARGEST_CHUNK, int(CHUNK_S / max(known, 1e-6))))
        return tuple(self.block.popleft() for _ in range(min(size, len(self.block))))

    def _submit(self, runs: tuple[Run, ...], alone: bool) -> None:
        self.chunks += 1
        chunk = chunk_of(self.plan, self.version, self.chunks, runs, self.patience)
        try:
            future = self.crew.submit_alone(chunk) if alone else self.crew.submit(chunk)
        except Exception as error:
            if alone or not self.crew.died(error):
                raise refused(error) from error
            self._give_back(runs)
            return
        self.under_way[future] = (chunk, alone)
        future.add_done_callback(self.finished.put)

    def _give_back(self, runs: tuple[Run, ...]) -> None:
        """Runs that a pool did not take, since it had broken; what is under way will say so."""
        self.block.extendleft(reversed(runs))
        self.refused = True
        if not self.under_way:
            self.crew.renew()

    def _take(self) -> None:
        """Wait for a chunk, or for the time to write."""
        try:
            future = self.finished.get(timeout=LOOK_S)
        except queue.Empty:
            self.writer.tick()
            return
        chunk, alone = self.under_way.pop(future)
        try:
            rows = future.result()
        except Exception as error:
            if not self.crew.died(error):
                raise refused(error) from error
            rows = self._bury(chunk, alone)
        else:
            self.heard = True
        self._keep(rows)

    def _take_finished(self) -> None:
        """Keep the rows that have come meanwhile."""
        while not self.finished.empty():
            future = self.finished.get()
            with contextlib.suppress(Exception):
                self._keep(future.result())

    def _bury(self, chunk: Chunk, alone: bool) -> list[Row]:
        """After a worker died: runs that were alone have failed, others are tried again."""
        if alone:
            if not self.heard and not self.crew.starts():
                raise InputError(UNABLE)
            return [blank(run, DIED) for run in chunk.runs]
        self.repeated += len(chunk.runs)
        self.suspects.extend(chunk.runs)
        # The pool breaks as a whole: what else was under way comes back broken, too.
        if not any(not alone for _, alone in self.under_way.values()):
            self.crew.renew()
        return []

    def _keep(self, rows: list[Row]) -> None:
        """Rows that are done; they are counted before they are written, as Ctrl-C may come then."""
        self.writer.hold(rows)
        for row in rows:
            self.done += 1
            if row["failed"] is not None:
                self.failed += 1
            else:
                self.pace[row["point"]] = row["wall_s"]
                self.unfinished += not row["finished"]
        if rows and self.on_rows is not None:
            self.on_rows(rows)
        self.writer.tick()


def chunk_of(
    plan: Plan, version: str, number: int, runs: tuple[Run, ...], patience: float | None = None
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
    if isinstance(error, OtherCode):
        return InputError(f"a worker has other code than this process: {error}")
    what = " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return InputError(f"the workers cannot go on ({what}); what is done is kept")
