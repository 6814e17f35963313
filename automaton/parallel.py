"""Many runs over all cores: each (scenario, seed) is one run, and nothing else decides its result.

Processes are spawned, not forked, so that it works the same everywhere; each imports the compiled
kernels from the cache, which the parent has filled before.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import closing, contextmanager
from typing import NamedTuple

from automaton.headless import run_to_end, strategies_blamed
from automaton.metrics import metrics_of
from automaton.scenario.resolve import Resolved
from automaton.simulation import Simulation

CHUNKS_PER_WORKER = 8  # small enough to spread evenly, large enough that sending costs nothing
LARGEST_CHUNK = 25  # runs, so that progress is seen


class Result(NamedTuple):
    """What is kept of one of many runs."""

    seed: int
    finished: bool
    digest: str
    metrics: dict[str, float | int]


class Chunk(NamedTuple):
    """Work for one call of a worker: a scenario, by its number, and some of its seeds."""

    number: int
    resolved: Resolved
    seeds: tuple[int, ...]


Batches = Generator[tuple[int, list[Result]], None, None]  # a scenario's number and its results
OnDone = Callable[[int], None]  # called with the runs just done


def cores() -> int:
    """The cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_all(
    scenarios: Sequence[Resolved],
    seeds: Sequence[int],
    workers: int | None = None,
    on_done: OnDone | None = None,
) -> list[list[Result]]:
    """Run every scenario with every seed; results by scenario, then by seed, as they were given.

    `workers`: processes, default one for each core; 1 runs everything in this process. A strategy
    that raises becomes an InputError; Ctrl-C ends all processes and raises KeyboardInterrupt.
    """
    workers = cores() if workers is None else workers
    chunks = list(_chunks(scenarios, seeds, workers))
    results: list[dict[int, Result]] = [{} for _ in scenarios]
    workers = min(workers, len(chunks))
    run = _run_here(chunks) if workers <= 1 else _run_spread(chunks, workers)
    with closing(run) as done:  # whatever is raised in here, no process is left behind
        for number, batch in done:
            results[number].update((result.seed, result) for result in batch)
            if on_done is not None:
                on_done(len(batch))
    return [[found[seed] for seed in seeds] for found in results]


def run_chunk(chunk: Chunk) -> tuple[int, list[Result]]:
    """The runs of a chunk; this is what a worker does. Raises InputError for a failing strategy."""
    batch = []
    for seed in chunk.seeds:
        with strategies_blamed(chunk.resolved):
            simulation = Simulation(chunk.resolved, seed)
            run_to_end(simulation)
        finished = simulation.finished or chunk.resolved.scenario.stop.when == "never"
        batch.append(Result(seed, finished, simulation.digest, metrics_of(simulation)))
    return chunk.number, batch


def _chunks(scenarios: Sequence[Resolved], seeds: Sequence[int], workers: int) -> Iterator[Chunk]:
    runs = len(scenarios) * len(seeds)
    size = max(1, min(LARGEST_CHUNK, runs // (CHUNKS_PER_WORKER * workers)))
    for number, resolved in enumerate(scenarios):
        for begin in range(0, len(seeds), size):
            yield Chunk(number, resolved, tuple(seeds[begin : begin + size]))


def _run_here(chunks: Sequence[Chunk]) -> Batches:
    yield from map(run_chunk, chunks)


def _run_spread(chunks: Sequence[Chunk], workers: int) -> Batches:
    """Results in the order in which they are ready."""
    _warm(chunks)
    context = multiprocessing.get_context("spawn")
    before = set(multiprocessing.active_children())
    executor = ProcessPoolExecutor(workers, mp_context=context)
    finished = False
    try:
        with _children_ignore_interrupts():
            futures: list[Future[tuple[int, list[Result]]]] = [
                executor.submit(run_chunk, chunk) for chunk in chunks
            ]
        for future in as_completed(futures):
            yield future.result()
        finished = True
    finally:
        executor.shutdown(wait=finished, cancel_futures=True)
        if not finished:
            for process in set(multiprocessing.active_children()) - before:
                process.terminate()


def _warm(chunks: Sequence[Chunk]) -> None:
    """Compile, or find in the cache, whatever the workers will load."""
    seen = set()
    for chunk in chunks:
        names = tuple(pick.name for pick in chunk.resolved.picks.values())
        if names not in seen:
            seen.add(names)
            with strategies_blamed(chunk.resolved):
                Simulation(chunk.resolved, chunk.seeds[0])


@contextmanager
def _children_ignore_interrupts() -> Iterator[None]:
    """Processes started in here ignore Ctrl-C from their first moment on: the parent ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
