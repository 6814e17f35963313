"""Processes that stay for round after round of runs, where what comes next depends on the last.

Short work is done in this process: a pool takes a second to start. When the rounds have taken
PATIENCE_S, the pool is started. Neither changes a result.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from types import TracebackType
from typing import Final

from automaton.parallel import (
    Chunk,
    Conduct,
    Job,
    Result,
    children_ignore_interrupts,
    chunks_of,
    conducted,
    cores,
    run_chunk,
    warm,
)

PATIENCE_S: Final = 2.0


class Rounds:
    """Runs rounds of jobs; a context manager that leaves no process behind.

    `workers`: processes, default one for each core; 1 runs everything in this process.
    """

    def __init__(self, workers: int | None = None, conduct: Conduct = conducted) -> None:
        self._workers = cores() if workers is None else workers
        self._conduct = conduct
        self._spent_s = 0.0
        self._pool: ProcessPoolExecutor | None = None
        self._warm: set[tuple[str, ...]] = set()  # strategies that workers find in the cache

    def __enter__(self) -> Rounds:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._pool is None:
            return
        processes = list((self._pool._processes or {}).values())  # its own, and no others
        self._pool.shutdown(wait=error is None, cancel_futures=True)
        for process in processes if error is not None else ():
            process.terminate()

    def run(self, jobs: Sequence[Job]) -> list[Result]:
        """The results of one round, in the order of its jobs. Raises InputError."""
        alone = self._workers <= 1 or len(jobs) < 2 or self._spent_s < PATIENCE_S
        chunks = list(chunks_of(jobs, 1 if alone else self._workers, self._conduct))
        begun = time.perf_counter()
        if alone:
            batches = [run_chunk(chunk)[1] for chunk in chunks]
        else:
            self._warm_up(chunks)
            with children_ignore_interrupts():
                futures = [self._started().submit(run_chunk, chunk) for chunk in chunks]
            batches = [future.result()[1] for future in futures]
        self._spent_s += time.perf_counter() - begun
        return [result for batch in batches for result in batch]

    def _warm_up(self, chunks: Sequence[Chunk]) -> None:
        """Compile what the workers will load, once for all rounds."""
        names = {
            tuple(pick.name for pick in job[0].picks.values()) for c in chunks for job in c.jobs
        }
        if not names <= self._warm:
            warm(chunks)
            self._warm |= names

    def _started(self) -> ProcessPoolExecutor:
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(self._workers, mp_context=context)
        return self._pool
