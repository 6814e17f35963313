"""Who carries out the runs on this machine: spawned processes, or an executor that is given.

A crew takes chunks and gives futures. When a worker dies, the futures that were under way break; the
crew is renewed, and each of their runs is tried once more in a process of its own.
"""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from typing import Any, Protocol

from automaton.errors import InputError
from automaton.experiments.runs import Chunk, Row, attend, run_chunk
from automaton.parallel import children_ignore_interrupts, cores


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
    def lanes(self) -> int:
        """How many runs may be tried alone at a time."""

    @property
    def repeated(self) -> int:
        """Runs that the crew itself began again."""

    def submit(self, chunk: Chunk) -> Promise: ...
    def submit_alone(self, chunk: Chunk) -> Promise: ...
    def died(self, error: BaseException) -> bool:
        """Whether an error of a future says that its worker is gone."""

    def renew(self) -> None:
        """Go on after a worker died."""

    def close(self, now: bool) -> None:
        """End all workers; `now`: without waiting for what they do."""


class LocalPool:
    """Spawned processes on this machine, one for each core unless told otherwise."""

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or cores()
        self.repeated = 0
        self._all: list[ProcessPoolExecutor] = []
        self._pool = self._started(self.workers)
        self._free: list[ProcessPoolExecutor] = []  # of one process each, for runs tried alone
        self._lock = threading.Lock()

    @property
    def slots(self) -> int:
        return self.workers + 1 + self.workers // 4

    @property
    def lanes(self) -> int:
        return self.workers

    def submit(self, chunk: Chunk) -> Promise:
        with children_ignore_interrupts():
            return self._pool.submit(run_chunk, chunk)

    def submit_alone(self, chunk: Chunk) -> Promise:
        with self._lock:
            lane = self._free.pop() if self._free else self._started(1)
        with children_ignore_interrupts():
            try:
                future = lane.submit(run_chunk, chunk)
            except BrokenExecutor:  # its process died while it had nothing to do
                self._all.remove(lane)
                lane = self._started(1)
                future = lane.submit(run_chunk, chunk)
        future.add_done_callback(lambda done: self._given_back(lane, done))
        return future

    def _given_back(self, lane: ProcessPoolExecutor, done: Any) -> None:
        broken = done.cancelled() or isinstance(done.exception(), BrokenExecutor)
        with self._lock:
            if not broken:
                self._free.append(lane)
            elif lane in self._all:
                self._all.remove(lane)  # it has ended by itself

    def died(self, error: BaseException) -> bool:
        return isinstance(error, BrokenExecutor)

    def renew(self) -> None:
        self._all.remove(self._pool)
        self._pool.shutdown(wait=False)
        self._pool = self._started(self.workers)

    def close(self, now: bool) -> None:
        with self._lock:
            pools = list(self._all)  # they stay, as Ctrl-C may come while we wait for them
        processes = [process for pool in pools for process in (pool._processes or {}).values()]
        for process in processes if now else ():
            process.terminate()
        for pool in pools:
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

    lanes = 1

    def __init__(self, executor: Executor) -> None:
        self.executor = executor
        self.repeated = 0
        self.slots = 2 + int(getattr(executor, "_max_workers", None) or cores())

    def submit(self, chunk: Chunk) -> Promise:
        return self.executor.submit(run_chunk, chunk)

    def submit_alone(self, chunk: Chunk) -> Promise:
        return self.executor.submit(run_chunk, chunk)

    def died(self, error: BaseException) -> bool:
        return isinstance(error, BrokenExecutor)

    def renew(self) -> None:
        raise InputError(
            "a worker of the executor died, and only who made it can begin it anew; "
            "what is done is kept"
        )

    def close(self, now: bool) -> None:
        """Leave it as it is."""
