"""Many runs in parallel on all cores. The result of a run depends only on its scenario and seed.

Processes are spawned, not forked, to behave the same on all systems. Each loads the compiled kernels
from the cache, which the parent has filled before.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import connection, parent_process, resource_tracker
from types import FrameType, TracebackType
from typing import Any, Final, NamedTuple, TypeVar

from automaton.errors import WorkerDiedError
from automaton.runs.first_compilation import compiled_parts, cores
from automaton.runs.headless import attribute_strategy_errors, is_finished, run_to_end
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.world.resolved import Resolved

POOL_START_DELAY_S: Final = 2.0
END_TIMEOUT_S: Final = 5.0  # for a process to end after it was asked to
SIGNAL_GRACE_S: Final = 1.0  # for a coordinator to handle a signal before its workers end
CHUNKS_PER_WORKER = 8  # makes chunks small enough to spread evenly, large enough to send cheaply
MAX_CHUNK_RUNS = 25  # limits chunks so that progress is visible


class RunResult(NamedTuple):
    """The stored result of one of many runs."""

    seed: int
    finished: bool
    digest: str
    metrics: dict[str, float | int]


RunSpec = tuple[Resolved, int]  # a scenario and a seed
RunFunction = Callable[[Simulation], dict[str, float | int]]  # runs to the end; returns the metrics


class Chunk(NamedTuple):
    """Work for one call of a worker: some runs, and the number of the first."""

    first: int
    jobs: tuple[RunSpec, ...]
    conduct: RunFunction


T = TypeVar("T")
OnDone = Callable[[int], None]  # called with the runs just done


def run_and_measure(simulation: Simulation) -> dict[str, float | int]:
    """Run to the end; return the metrics of the run."""
    run_to_end(simulation)
    return metrics_of(simulation)


def run_all(
    scenarios: Sequence[Resolved],
    seeds: Sequence[int],
    workers: int | None = None,
    on_done: OnDone | None = None,
    run_function: RunFunction = run_and_measure,
    change: Callable[[Resolved, int], Resolved] = lambda resolved, seed: resolved,
) -> list[list[RunResult]]:
    """Run every scenario with every seed; return results by scenario, then by seed.

    `change`: changes a scenario for a seed, beyond the random numbers. See `run_jobs`.
    """
    jobs = [(change(resolved, seed), seed) for resolved in scenarios for seed in seeds]
    results = run_jobs(jobs, workers, on_done, run_function)
    return [results[k : k + len(seeds)] for k in range(0, len(results), len(seeds) or 1)]


def run_jobs(
    jobs: Sequence[RunSpec],
    workers: int | None = None,
    on_done: OnDone | None = None,
    run_function: RunFunction = run_and_measure,
) -> list[RunResult]:
    """Run each scenario with its seed; return results in the order of the jobs.

    `workers`: number of processes, default one for each core; 1 runs everything in this process.
    `run_function` must be a module-level function. Raises InputError if a strategy raises an
    exception, KeyboardInterrupt after Ctrl-C, and WorkerDiedError if a process dies; the other
    processes are ended.
    """
    workers = min(cores() if workers is None else workers, len(jobs))
    with PersistentPool(workers, run_function, patience_s=0.0) as rounds:
        return rounds.run(jobs, on_done)


def run_chunk(chunk: Chunk) -> tuple[int, list[RunResult]]:
    """Execute the runs of a chunk in a worker. Raises InputError if a strategy raises an exception."""
    batch = []
    for resolved, seed in chunk.jobs:
        with attribute_strategy_errors(resolved):
            simulation = Simulation(resolved, seed)
            figures = chunk.conduct(simulation)
        batch.append(RunResult(seed, is_finished(simulation), simulation.digest, figures))
    return chunk.first, batch


def chunks_of(jobs: Sequence[RunSpec], workers: int, run_function: RunFunction) -> Iterator[Chunk]:
    """Split the jobs into chunks that spread evenly over the workers."""
    size = max(1, min(MAX_CHUNK_RUNS, len(jobs) // (CHUNKS_PER_WORKER * workers)))
    for first in range(0, len(jobs), size):
        yield Chunk(first, tuple(jobs[first : first + size]), run_function)


class Workers:
    """Spawned processes that execute calls. They ignore Ctrl-C; their creator must end them."""

    def __init__(self, number: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(number, context, initializer=init_worker)

    def submit(self, function: Callable[..., T], *arguments: Any) -> Future[T]:
        """Let a process execute a call. Raises BrokenExecutor once a process has died."""
        with children_ignore_interrupts():
            return self._pool.submit(function, *arguments)

    def end(self, now: bool) -> None:
        """End all processes to free their memory; `now`: without waiting for their calls."""
        processes = list((self._pool._processes or {}).values())  # only those of this pool
        for process in processes if now else ():
            process.kill()  # workers handle SIGTERM with a delay, or after a long run
        self._pool.shutdown(wait=not now, cancel_futures=True)
        for process in processes:
            process.join(END_TIMEOUT_S)


class PersistentPool:
    """Processes that persist over several rounds of jobs; a context manager that ends them on exit.

    `workers`: number of processes, default one for each core; 1 runs everything in this process. A
    pool takes a second to start, so it starts when the rounds have taken `patience_s`, default
    POOL_START_DELAY_S. Neither changes a result.
    """

    def __init__(
        self,
        workers: int | None = None,
        run_function: RunFunction = run_and_measure,
        patience_s: float | None = None,
    ) -> None:
        self._workers = cores() if workers is None else workers
        self._conduct = run_function
        self._patience_s = POOL_START_DELAY_S if patience_s is None else patience_s
        self._spent_s = 0.0
        self._pool: Workers | None = None
        self._warm: set[Hashable] = set()  # keys of parts in the compilation cache

    def __enter__(self) -> PersistentPool:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._pool is not None:
            self._pool.end(now=error is not None)

    def run(self, jobs: Sequence[RunSpec], on_done: OnDone | None = None) -> list[RunResult]:
        """The results of one round, in the order of its jobs; see `run_jobs`."""
        alone = self._workers <= 1 or len(jobs) < 2 or self._spent_s < self._patience_s
        chunks = list(chunks_of(jobs, 1 if alone else self._workers, self._conduct))
        results: list[RunResult | None] = [None] * len(jobs)
        begun = time.perf_counter()
        for first, batch in map(run_chunk, chunks) if alone else self._spread(chunks):
            results[first : first + len(batch)] = batch
            if on_done is not None:
                on_done(len(batch))
        self._spent_s += time.perf_counter() - begun
        return [result for result in results if result is not None]

    def _spread(self, chunks: Sequence[Chunk]) -> Iterator[tuple[int, list[RunResult]]]:
        """The number of the first run and the results of each chunk, as they become ready."""
        self._warm_up(chunks)
        if self._pool is None:
            self._pool = Workers(self._workers)
        try:
            futures = [self._pool.submit(run_chunk, chunk) for chunk in chunks]
            for future in as_completed(futures):
                yield future.result()
        except BrokenExecutor:
            raise WorkerDiedError from None

    def _warm_up(self, chunks: Sequence[Chunk]) -> None:
        """Compile the parts that the workers will load from the cache, once for all rounds."""
        for resolved, seed in (job for chunk in chunks for job in chunk.jobs):
            parts = compiled_parts(resolved)
            if parts not in self._warm:
                self._warm.add(parts)
                with attribute_strategy_errors(resolved):
                    Simulation(resolved, seed)


def init_worker() -> None:
    """Start a worker process, which ignores Ctrl-C, delays SIGTERM and ends with its coordinator.

    At the end of a job, batch systems send SIGTERM to all its processes. Workers that ended at once
    would seem to have died.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave_later)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_leave_with, args=(parent.sentinel,), daemon=True).start()


def _leave_later(number: int, _: FrameType | None) -> None:
    time.sleep(SIGNAL_GRACE_S)
    os._exit(128 + number)


def _leave_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)


@contextmanager
def children_ignore_interrupts() -> Iterator[None]:
    """Let processes that start inside ignore Ctrl-C from the beginning; the parent ends them.

    They inherit the blocked signal. A Ctrl-C or SIGTERM that arrives meanwhile is raised in the parent
    on exit.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    resource_tracker.ensure_running()  # its start unblocks the signal, so start it first
    heard: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _: heard.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in before.items():
            signal.signal(number, handler)
        if heard:
            signal.raise_signal(heard[0])
