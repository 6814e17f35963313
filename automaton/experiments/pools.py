"""Who carries out the runs on this machine: spawned processes, or an executor that is given.

A crew takes chunks and gives futures. When a worker dies, the futures that were under way break; the
crew is renewed, and each of their runs is tried once more, in a process of its own while no other
one works.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from typing import Any, Protocol

from automaton.errors import InputError
from automaton.experiments.runs import Chunk, Row, run_chunk
from automaton.parallel import attend, children_ignore_interrupts, cores

MAX_WORKERS = 1024


class Promise(Protocol):
    """What crews give for a chunk: a future of concurrent.futures, or of Dask."""

    def result(self) -> list[Row]: ...
    def add_done_callback(self, function: Callable[[Any], Any], /) -> Any: ...


class Crew(Protocol):
    """Workers, wherever they are."""

    @property
    def slots(self) -> int:
        """How many chunks should be under way: a few more than there are workers."""

    @property
    def repeated(self) -> int:
        """Runs that the crew itself began again."""

    def submit(self, chunk: Chunk) -> Promise: ...
    def submit_alone(self, chunk: Chunk) -> Promise: ...
    def died(self, error: BaseException) -> bool:
        """Whether an error of a future says that its worker is gone."""

    def starts(self) -> bool:
        """Whether a worker starts that has nothing to do."""

    def renew(self) -> None:
        """Go on after a worker died."""

    def close(self, now: bool) -> None:
        """End all workers; `now`: without waiting for what they do."""


class LocalPool:
    """Spawned processes on this machine, one for each core unless told otherwise."""

    def __init__(self, workers: int | None = None) -> None:
        self.workers = cores() if workers is None else workers
        self.repeated = 0
        self._all: list[ProcessPoolExecutor] = []
        self._pool = self._started(self.workers)
        self._lane = self._started(1)  # for runs tried alone; its process starts with the first

    @property
    def slots(self) -> int:
        return self.workers + 1 + self.workers // 4

    def submit(self, chunk: Chunk) -> Promise:
        with children_ignore_interrupts():
            return self._pool.submit(run_chunk, chunk)

    def submit_alone(self, chunk: Chunk) -> Promise:
        with children_ignore_interrupts():
            try:
                return self._lane.submit(run_chunk, chunk)
            except BrokenExecutor:  # by the run before, or since its process had nothing to do
                self._lane = self._instead_of(self._lane, 1)
                return self._lane.submit(run_chunk, chunk)

    def died(self, error: BaseException) -> bool:
        return isinstance(error, BrokenExecutor)

    def starts(self) -> bool:
        self._lane = self._instead_of(self._lane, 1)
        with children_ignore_interrupts():
            future = self._lane.submit(int)
        return future.exception() is None

    def renew(self) -> None:
        self._pool = self._instead_of(self._pool, self.workers)

    def _instead_of(self, broken: ProcessPoolExecutor, workers: int) -> ProcessPoolExecutor:
        """A new pool, when all processes of one that broke have ended, and their memory is free."""
        self._all.remove(broken)
        processes = list((broken._processes or {}).values())
        broken.shutdown(wait=False)
        for process in processes:
            process.kill()  # at once: it heeds a SIGTERM late, or after a long run
            process.join(5)
        return self._started(workers)

    def close(self, now: bool) -> None:
        processes = [process for pool in self._all for process in (pool._processes or {}).values()]
        for process in processes if now else ():
            process.kill()
        for pool in self._all:  # they stay there, as Ctrl-C may come while we wait for them
            pool.shutdown(wait=not now, cancel_futures=True)
        for process in processes:
            process.join(5)

    def _started(self, workers: int) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=attend)
        self._all.append(pool)
        return pool


class GivenExecutor:
    """An executor of concurrent.futures that somebody else made, and ends."""

    def __init__(self, executor: Executor) -> None:
        self.executor = executor
        self.under_way: set[Future[list[Row]]] = set()
        self.repeated = 0
        self.slots = 2 + int(getattr(executor, "_max_workers", None) or cores())

    def submit(self, chunk: Chunk) -> Promise:
        future = self.executor.submit(run_chunk, chunk)
        self.under_way.add(future)
        future.add_done_callback(self.under_way.discard)
        return future

    submit_alone = submit

    def died(self, error: BaseException) -> bool:
        return isinstance(error, BrokenExecutor)

    def starts(self) -> bool:
        return True

    def renew(self) -> None:
        raise InputError(
            "a worker of the executor died, and only its creator can restart it; "
            "what is done is kept"
        )

    def close(self, now: bool) -> None:
        """Leave it as it is, but for the chunks that nobody waits for any more."""
        for future in list(self.under_way):
            future.cancel()
