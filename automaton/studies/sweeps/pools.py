"""The workers of a sweep: pools of processes, an executor of the caller or a cluster, and what each does.

A backend takes chunks and returns futures. When a worker dies, the futures that are under way break;
the backend is restarted, and each of their runs is tried once more, in a process of its own while no
other process works. A worker is sent everything, and gives rows back; it reads and writes no files.

On a Dask cluster the scheduler spreads chunks over its workers, on any machines. Few futures are held
at a time, and each is dropped when it is done: of what a lost worker had finished nothing is computed
again, only what was under way. Workers tell the beginning of each chunk, so that a second one is
noticed.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import pickle
import signal
import threading
import time
import uuid
from collections.abc import Callable, Hashable
from concurrent.futures import BrokenExecutor, Executor, Future
from functools import cache, partial
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.runs.cores import cores
from automaton.runs.first_compilation import compiled_parts
from automaton.runs.headless import (
    CountedStretches,
    attribute_strategy_errors,
    is_finished,
    run_marked,
    sums_by_stretch,
)
from automaton.runs.metric_catalogue import in_coarse_ticks
from automaton.runs.metrics import metrics_of
from automaton.runs.progress import asked_orders
from automaton.runs.run_diagnosis import JamWatch, note_jam
from automaton.runs.simulation import Simulation
from automaton.studies.process_pool import Workers
from automaton.studies.sweeps.run_keys import (
    WHOLE_RUNS,
    Row,
    Sources,
    SweepRun,
    Windows,
    blank,
    hashed,
    package_sources,
    plugin_sources,
    reason,
)
from automaton.studies.sweeps.study import SERIES_COLUMN, SUMS_COLUMN
from automaton.world.resolved import Resolved

CHUNK_BEGUN_TOPIC: Final = "automaton: chunk begun"  # a topic of the scheduler's
SCHEDULER_TIMEOUT_S: Final = 10  # for a scheduler to answer
ADDRESS_FILE_TRIES: Final = 10  # at a file of a scheduler until it is whole,
ADDRESS_FILE_RETRY_S: Final = 0.1  # and what is between them
WORKER_POLL_S: Final = 1.0  # between two looks at how many workers there are
MAX_WORKERS: Final = 1024
MAX_SCENARIOS_KEPT: Final = 16  # by a worker


class SweepChunk(NamedTuple):
    """Work for one call of a worker: runs of one design point."""

    number: int  # of the chunk
    version: str  # of the code that the coordinator has
    plugins: tuple[str, ...]
    fingerprint: str  # of the scenario
    scenario: bytes  # the resolved scenario, pickled
    windows: Windows
    runs: tuple[SweepRun, ...]
    patience: float | None = None  # seconds of a decision of a Python strategy


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

    def submit(self, chunk: SweepChunk) -> FutureLike: ...
    def submit_alone(self, chunk: SweepChunk) -> FutureLike: ...
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
        self._pool = Workers(self.workers)
        # for runs that are tried alone; its process starts with the first of them
        self._isolation_pool = Workers(1)

    @property
    def max_in_flight(self) -> int:
        return self.workers + 1 + self.workers // 4

    def submit(self, chunk: SweepChunk) -> FutureLike:
        return self._pool.submit(run_chunk, chunk)

    def submit_alone(self, chunk: SweepChunk) -> FutureLike:
        try:
            return self._isolation_pool.submit(run_chunk, chunk)
        except BrokenExecutor:  # by the run before, or since its process had nothing to do
            self._renew_isolation()
            return self._isolation_pool.submit(run_chunk, chunk)

    def is_worker_lost(self, error: BaseException) -> bool:
        return isinstance(error, BrokenExecutor)

    def can_start(self) -> bool:
        self._renew_isolation()
        return self._isolation_pool.submit(int).exception() is None

    def restart(self) -> None:
        try:
            self._pool.end(now=True)
        finally:
            self._pool = Workers(self.workers)

    def _renew_isolation(self) -> None:
        try:
            self._isolation_pool.end(now=True)
        finally:
            self._isolation_pool = Workers(1)

    def close(self, now: bool) -> None:
        try:
            self._pool.end(now)
        finally:
            self._isolation_pool.end(now)


class ExternalExecutor:
    """An executor of concurrent.futures that the caller creates and shuts down."""

    def __init__(self, executor: Executor) -> None:
        self.executor = executor
        self.under_way: set[Future[list[Row]]] = set()
        self.repeated = 0
        self.max_in_flight = 2 + int(getattr(executor, "_max_workers", None) or cores())

    def submit(self, chunk: SweepChunk) -> FutureLike:
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


class DaskCluster:
    """The workers of a Dask scheduler, by its address or the file that it has written.

    Raises InputError if it cannot be reached.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client, KilledWorker
        except ImportError as error:
            raise InputError(
                f"--scheduler needs Dask, which cannot be imported ({error}): "
                "pip install 'fleet-automaton[cluster]'"
            ) from None
        where = address if "://" in address else address_in(address)
        try:
            self._client: Any = Client(where, timeout=SCHEDULER_TIMEOUT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            why = str(error) or type(error).__name__
            raise InputError(f"no Dask scheduler answers at {address}: {why}") from None
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # we say it ourselves
        self._killed = KilledWorker
        self._topic = f"{CHUNK_BEGUN_TOPIC} {uuid.uuid4().hex}"
        self._lock = threading.Lock()
        self._under_way: dict[int, tuple[int, int]] = {}  # chunk -> its runs, times begun
        self._looked = 0.0
        self._threads = 1
        self.repeated = 0
        self._client.subscribe_topic(self._topic, self._begun)

    @property
    def max_in_flight(self) -> int:
        threads = self._threads_now()
        return threads + 1 + threads // 4

    def _threads_now(self) -> int:
        if time.monotonic() - self._looked > WORKER_POLL_S:
            self._looked = time.monotonic()
            workers = self._client.scheduler_info(n_workers=-1)["workers"].values()
            self._threads = max(1, sum(worker["nthreads"] for worker in workers))
        return self._threads

    def submit(self, chunk: SweepChunk) -> Any:
        with self._lock:
            self._under_way[chunk.number] = (len(chunk.runs), 0)
        key = f"automaton-{chunk.number}-{uuid.uuid4().hex}"
        future = self._client.submit(run_and_tell, chunk, self._topic, key=key, pure=False)
        future.add_done_callback(lambda done: self._over(chunk.number))
        return future

    submit_alone = submit

    def is_worker_lost(self, error: BaseException) -> bool:
        return isinstance(error, self._killed)

    def can_start(self) -> bool:
        return True

    def restart(self) -> None:
        """The scheduler has gone on already."""

    def close(self, now: bool) -> None:
        with contextlib.suppress(Exception):  # a scheduler that is gone is closed
            self._client.close(timeout=5)

    def _begun(self, event: Any) -> None:
        _, number = event
        with self._lock:
            if number in self._under_way:
                runs, times = self._under_way[number]
                self._under_way[number] = (runs, times + 1)
                self.repeated += runs if times else 0

    def _over(self, number: int) -> None:
        with self._lock:
            self._under_way.pop(number, None)


def address_in(file: str) -> str:
    """The address in a file of a scheduler, which may just be writing it. Raises InputError."""
    if not Path(file).is_file():
        raise InputError(
            "is not an address, such as tcp://host:8786, and no file of a scheduler", file
        )
    for _ in range(ADDRESS_FILE_TRIES):
        try:
            found = json.loads(Path(file).read_bytes())["address"]
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}", file) from None
        except (ValueError, KeyError, TypeError):
            time.sleep(ADDRESS_FILE_RETRY_S)
        else:
            return str(found)
    raise InputError("is not a file of a Dask scheduler: it names no address", file)


def run_and_tell(chunk: SweepChunk, topic: str) -> list[Row]:
    """What a worker of a cluster does with a chunk."""
    from distributed import get_worker

    get_worker().log_event(topic, chunk.number)
    return run_chunk(chunk)


# What a worker does with a chunk: a row for each run.


class CodeMismatchError(Exception):
    """A worker has other code than its coordinator."""


def run_chunk(chunk: SweepChunk) -> list[Row]:
    """The rows of a chunk. Raises CodeMismatchError; a run that fails is a row."""
    here = _version(chunk.plugins)
    if here != chunk.version:
        raise CodeMismatchError(f"{os.uname().nodename} has version {here}, not {chunk.version}")
    resolved = _scenario(chunk.fingerprint, chunk.scenario, chunk.patience)
    return [run_one(resolved, run, chunk.windows, chunk.patience) for run in chunk.runs]


def _version(plugins: tuple[str, ...]) -> str:
    """The version of the code that this process has, and not of what the disk may have by now."""
    found = _packages()
    for plugin in plugins:
        found = found | _plugin(plugin)
    return hashed(found)


@cache
def _packages() -> Sources:
    return package_sources()


@cache
def _plugin(module: str) -> Sources:
    return plugin_sources(module)


_SCENARIOS: dict[str, Resolved] = {}  # of the last points, by fingerprint
_LOADED: set[Hashable] = set()  # what runs needed that this process has begun


def _scenario(fingerprint: str, pickled: bytes, patience: float | None = None) -> Resolved:
    """The scenario of a chunk: the same object again for chunks of the same point.

    Threads do this at the same time, and one may let go of what another one has just put there.
    """
    resolved = _SCENARIOS.get(fingerprint)
    if resolved is None:
        for oldest in list(_SCENARIOS)[: 1 - MAX_SCENARIOS_KEPT]:
            _SCENARIOS.pop(oldest, None)
        resolved = _SCENARIOS[fingerprint] = pickle.loads(pickled)
        parts = compiled_parts(resolved)
        if parts not in _LOADED:  # loads what is compiled, so that no run's time counts it
            _LOADED.add(parts)
            try:
                with attribute_strategy_errors(resolved):
                    Simulation(resolved, patience=patience)
            except BaseException as error:
                if is_ctrl_c(error):
                    raise
    return resolved


def run_one(
    resolved: Resolved, run: SweepRun, windows: Windows = WHOLE_RUNS, patience: float | None = None
) -> Row:
    """Run a scenario with the seed of a run, to its end or its limit."""
    wall, cpu = time.perf_counter(), time.process_time()
    row = blank(run)
    try:
        with attribute_strategy_errors(resolved):
            simulation = Simulation(resolved, run.seed, patience=patience)
            where = f"{resolved.scenario.name}, point {run.point}, seed {run.seed}"
            watch = JamWatch(partial(note_jam, where))
            marks = run_marked(simulation, windows.stretch, watch)
            row |= figures_of(simulation, windows.window, marks)
    except InputError as error:
        row["error"] = reason(str(error))
    except BaseException as error:  # whatever goes wrong is told beside the other runs
        if is_ctrl_c(error):
            raise
        row["error"] = reason(f"{type(error).__name__}: {error}")
    row["wall_s"] = time.perf_counter() - wall
    row["cpu_s"] = time.process_time() - cpu
    return row


def is_ctrl_c(error: BaseException) -> bool:
    """Whether an error is the user's Ctrl-C: workers are deaf to it, and only main threads hear it."""
    heard = threading.current_thread() is threading.main_thread()
    deaf = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    return isinstance(error, KeyboardInterrupt) and heard and not deaf


def figures_of(simulation: Simulation, window: int, marks: CountedStretches) -> Row:
    """What a row tells of a run that is over; `window`: ticks of one, 0 for none."""
    orders = asked_orders(simulation.world)
    delivered = orders.done[orders.done != NIL]
    refinement = simulation.resolved.scenario.refine
    metrics = in_coarse_ticks(metrics_of(simulation, marks.warm_up), refinement)
    row: Row = {
        "finished": is_finished(simulation),
        "ticks": -(-simulation.tick // refinement),
        "orders": len(orders.done),
        "delivered": metrics["delivered"],
        "digest": simulation.digest,
        "metrics": metrics,
    }
    if window:
        windows = simulation.tick // window
        done = np.maximum(delivered, 1)  # ticks count from 1
        whole = done[done <= windows * window]
        row[SERIES_COLUMN] = np.bincount((whole - 1) // window, minlength=windows).tolist()
        row[SUMS_COLUMN] = sums_by_stretch(simulation, marks.stretches)
    return row
