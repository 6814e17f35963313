"""Backends that carry out the runs of a sweep: spawned processes, or an executor of the caller.

A backend takes chunks and returns futures. When a worker dies, the futures that are under way break;
the backend is restarted, and each of their runs is tried once more, in a process of its own while no
other process works.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from typing import Any, Protocol

from automaton.errors import InputError
from automaton.runs.process_pool import children_ignore_interrupts, cores, init_worker
from automaton.studies.sweeps.sweep_runs import Chunk, Row, run_chunk

MAX_WORKERS = 1024


class FutureLike(Protocol):
    """What a backend returns for a chunk: a future of concurrent.futures, or of Dask."""

    def result(self) -> list[Row]: ...
    def add_done_callback(self, function: Callable[[Any], Any], /) -> Any: ...


class Backend(Protocol):
    """Workers, wherever they are."""

    @property
    def max_in_flight(self) -> int:
        """Return how many chunks should be under way: a few more than there are workers."""

    @property
    def repeated(self) -> int:
        """Return the number of runs that the backend itself repeated."""

    def submit(self, chunk: Chunk) -> FutureLike: ...
    def submit_alone(self, chunk: Chunk) -> FutureLike: ...
    def is_worker_lost(self, error: BaseException) -> bool:
        """Return whether an error of a future says that its worker is lost."""

    def can_start(self) -> bool:
        """Return whether an idle worker can start."""

    def restart(self) -> None:
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
        # for runs that are tried alone; its process starts with the first of them
        self._isolation_pool = self._started(1)

    @property
    def max_in_flight(self) -> int:
        return self.workers + 1 + self.workers // 4

    def submit(self, chunk: Chunk) -> FutureLike:
        with children_ignore_interrupts():
            return self._pool.submit(run_chunk, chunk)

    def submit_alone(self, chunk: Chunk) -> FutureLike:
        with children_ignore_interrupts():
            try:
                return self._isolation_pool.submit(run_chunk, chunk)
            except BrokenExecutor:  # by the run before, or since its process had nothing to do
                self._isolation_pool = self._replace_pool(self._isolation_pool, 1)
                return self._isolation_pool.submit(run_chunk, chunk)

    def is_worker_lost(self, error: BaseException) -> bool:
        return isinstance(error, BrokenExecutor)

    def can_start(self) -> bool:
        self._isolation_pool = self._replace_pool(self._isolation_pool, 1)
        with children_ignore_interrupts():
            future = self._isolation_pool.submit(int)
        return future.exception() is None

    def restart(self) -> None:
        self._pool = self._replace_pool(self._pool, self.workers)

    def _replace_pool(self, broken: ProcessPoolExecutor, workers: int) -> ProcessPoolExecutor:
        """Return a new pool for a broken one, once all its processes have ended and their memory is
        free.
        """
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
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=init_worker)
        self._all.append(pool)
        return pool


class ExternalExecutor:
    """An executor of concurrent.futures that the caller creates and shuts down."""

    def __init__(self, executor: Executor) -> None:
        self.executor = executor
        self.under_way: set[Future[list[Row]]] = set()
        self.repeated = 0
        self.max_in_flight = 2 + int(getattr(executor, "_max_workers", None) or cores())

    def submit(self, chunk: Chunk) -> FutureLike:
        future = self.executor.submit(run_chunk, chunk)
        self.under_way.add(future)
        future.add_done_callback(self.under_way.discard)
        return future

    submit_alone = submit

    def is_worker_lost(self, error: BaseException) -> bool:
        return isinstance(error, BrokenExecutor)

    def can_start(self) -> bool:
        return True

    def restart(self) -> None:
        raise InputError(
            "a worker of the executor died, and only its creator can restart it; "
            "what is done is kept"
        )

    def close(self, now: bool) -> None:
        """Leave it as it is, but for the chunks that nobody waits for any more."""
        for future in list(self.under_way):
            future.cancel()
