"""The workers of a sweep: a process pool, an executor of the caller, or a Dask cluster.

A backend takes chunks of runs and returns futures. When a worker dies, the futures in progress fail;
the backend is restarted, and each of their runs is retried once, in a separate process while no other
process works. Workers receive all data with the chunk and return rows; they read and write no files.

On a Dask cluster the scheduler distributes chunks to workers on any machines. Few futures exist at a
time, and each is dropped when it is done. After the loss of a worker, only chunks in progress are
computed again. Workers report the start of each chunk, so repeated chunks are counted.
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
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from automaton.errors import InputError
from automaton.runs.first_compilation import compiled_parts, cores
from automaton.runs.headless import (
    CountedStretches,
    attribute_strategy_errors,
    is_finished,
    longest_deadlock,
    run_marked,
    sums_by_stretch,
)
from automaton.runs.metric_catalogue import in_coarse_ticks
from automaton.runs.metrics import metrics_of, uses_of_run
from automaton.runs.periods import PeriodMarks, kept_period, period_columns
from automaton.runs.progress import asked_orders
from automaton.runs.provenance import Sources, package_sources, plugin_sources
from automaton.runs.run_diagnosis import JamWatch, note_jam
from automaton.runs.simulation import Simulation
from automaton.studies.process_pool import Workers
from automaton.studies.sweeps.run_keys import (
    WHOLE_RUNS,
    Row,
    SweepRun,
    Windows,
    blank,
    hashed,
    reason,
)
from automaton.studies.sweeps.study import (
    PERIOD_COLUMNS,
    PERIODS_COLUMN,
    SERIES_COLUMN,
    SUMS_COLUMN,
    USES_COLUMN,
)
from automaton.world.resolved import Resolved

CHUNK_BEGUN_TOPIC: Final = "automaton: chunk begun"  # Dask event topic
SCHEDULER_TIMEOUT_S: Final = 10  # for a scheduler to answer
ADDRESS_FILE_TRIES: Final = 10  # attempts to read a scheduler file that may be incomplete
ADDRESS_FILE_RETRY_S: Final = 0.1  # between two attempts
WORKER_POLL_S: Final = 1.0  # between two queries of the number of workers
MAX_WORKERS: Final = 1024
MAX_SCENARIOS_KEPT: Final = 16  # in the memory of a worker


class SweepChunk(NamedTuple):
    """Work for one call of a worker: runs of one design point."""

    number: int  # of the chunk
    version: str  # of the coordinator's code
    plugins: tuple[str, ...]
    fingerprint: str  # of the scenario
    scenario: bytes  # the resolved scenario, pickled
    windows: Windows
    runs: tuple[SweepRun, ...]
    patience: float | None = None  # seconds that a Python strategy has for each decision
    name: str = ""  # of the design point, in words


class FutureLike(Protocol):
    """The future that a backend returns for a chunk: from concurrent.futures or Dask."""

    def result(self) -> list[Row]: ...
    def add_done_callback(self, function: Callable[[Any], Any], /) -> Any: ...


class Backend(Protocol):
    """The interface of a group of workers."""

    @property
    def max_in_flight(self) -> int:
        """Return the number of chunks to submit at a time: slightly more than the workers."""

    @property
    def repeated(self) -> int:
        """Return the number of runs that the backend itself repeated."""

    def submit(self, chunk: SweepChunk) -> FutureLike: ...
    def submit_alone(self, chunk: SweepChunk) -> FutureLike: ...
    def is_worker_lost(self, error: BaseException) -> bool:
        """Return whether the error of a future means that its worker was lost."""

    def can_start(self) -> bool:
        """Return whether an idle worker can start."""

    def restart(self) -> None:
        """Restart after the death of a worker."""

    def close(self, now: bool) -> None:
        """End all workers; `now`: without waiting for their chunks."""


class LocalPool:
    """Spawned processes on this machine, by default one for each core."""

    def __init__(self, workers: int | None = None) -> None:
        self.workers = cores() if workers is None else workers
        self.repeated = 0
        self._pool = Workers(self.workers)
        # For runs that are retried alone; its process starts with the first of them.
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
            "a worker of the executor died, and only the creator of the executor can restart it; "
            "finished runs are saved"
        )

    def close(self, now: bool) -> None:
        """Cancel the chunks in progress; the executor itself stays open."""
        for future in list(self.under_way):
            future.cancel()


class DaskCluster:
    """The workers of a Dask scheduler, given by its address or its scheduler file.

    Raises InputError if the scheduler cannot be reached.
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
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # we report errors
        self._killed = KilledWorker
        self._topic = f"{CHUNK_BEGUN_TOPIC} {uuid.uuid4().hex}"
        self._lock = threading.Lock()
        self._under_way: dict[int, tuple[int, int]] = {}  # chunk -> number of runs, times begun
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
        """Do nothing: the scheduler replaces lost workers itself."""

    def close(self, now: bool) -> None:
        with contextlib.suppress(Exception):  # the scheduler may have ended already
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
    """The address in a scheduler file, which may still be incomplete. Raises InputError."""
    if not Path(file).is_file():
        raise InputError("is not an address, such as tcp://host:8786, nor a scheduler file", file)
    for _ in range(ADDRESS_FILE_TRIES):
        try:
            found = json.loads(Path(file).read_bytes())["address"]
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}", file) from None
        except (ValueError, KeyError, TypeError):
            time.sleep(ADDRESS_FILE_RETRY_S)
        else:
            return str(found)
    raise InputError("is not a Dask scheduler file: it has no address", file)


def run_and_tell(chunk: SweepChunk, topic: str) -> list[Row]:
    """Run a chunk in a worker of a cluster, and report its start."""
    from distributed import get_worker

    get_worker().log_event(topic, chunk.number)
    return run_chunk(chunk)


# The work of a worker: a row for each run of a chunk.


class CodeMismatchError(Exception):
    """The code of a worker differs from the code of its coordinator."""


def run_chunk(chunk: SweepChunk) -> list[Row]:
    """Return the rows of a chunk; a failed run has a row, too. Raises CodeMismatchError."""
    here = _version(chunk.plugins)
    if here != chunk.version:
        raise CodeMismatchError(f"{os.uname().nodename} has version {here}, not {chunk.version}")
    resolved = _scenario(chunk.fingerprint, chunk.scenario, chunk.patience)
    return [run_one(resolved, run, chunk.windows, chunk.patience, chunk.name) for run in chunk.runs]


def _version(plugins: tuple[str, ...]) -> str:
    """The version of the code that this process has loaded; files may have changed since."""
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


_SCENARIOS: dict[str, Resolved] = {}  # scenarios of recent points, by fingerprint
_LOADED: set[Hashable] = set()  # keys of compiled parts that this process has loaded


def _scenario(fingerprint: str, pickled: bytes, patience: float | None = None) -> Resolved:
    """The scenario of a chunk; chunks of a point share the object.

    Threads call this concurrently: an entry may be dropped by one thread just after another added it.
    """
    resolved = _SCENARIOS.get(fingerprint)
    if resolved is None:
        for oldest in list(_SCENARIOS)[: 1 - MAX_SCENARIOS_KEPT]:
            _SCENARIOS.pop(oldest, None)
        resolved = _SCENARIOS[fingerprint] = pickle.loads(pickled)
        parts = compiled_parts(resolved)
        if parts not in _LOADED:  # loads compiled parts outside the measured time of runs
            _LOADED.add(parts)
            try:
                with attribute_strategy_errors(resolved):
                    Simulation(resolved, patience=patience)
            except BaseException as error:
                if is_ctrl_c(error):
                    raise
    return resolved


def run_one(
    resolved: Resolved,
    run: SweepRun,
    windows: Windows = WHOLE_RUNS,
    patience: float | None = None,
    name: str = "",
) -> Row:
    """Run a scenario with the seed of a run to its end or its limit; return its row.

    `name`: its design point, for messages.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    row = blank(run)
    try:
        with attribute_strategy_errors(resolved):
            simulation = Simulation(resolved, run.seed, patience=patience)
            where = f"{name or f'{resolved.scenario.name}, point {run.point}'}, seed {run.seed}"
            jams: list[str] = []
            watch = JamWatch(lambda tick, jam: jams.append(note_jam(where, tick, jam)))
            ticks = kept_period(resolved)
            periods = PeriodMarks(ticks) if ticks else None
            marks = run_marked(simulation, windows.stretch, watch, periods)
            row |= figures_of(simulation, windows.window, marks)
            row["jam"] = jams[0] if jams else None
            row[USES_COLUMN] = uses_of_run(simulation)
            if periods is not None:
                row[PERIODS_COLUMN] = period_columns(periods.periods(simulation))
    except InputError as error:
        row["error"] = reason(str(error))
    except BaseException as error:  # any error goes into the row; other runs continue
        if is_ctrl_c(error):
            raise
        row["error"] = reason(f"{type(error).__name__}: {error}")
    row["wall_s"] = time.perf_counter() - wall
    row["cpu_s"] = time.process_time() - cpu
    return row


def is_ctrl_c(error: BaseException) -> bool:
    """Whether an error is the user's Ctrl-C, which only main threads get and workers ignore."""
    heard = threading.current_thread() is threading.main_thread()
    deaf = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    return isinstance(error, KeyboardInterrupt) and heard and not deaf


def numbers_of_periods(resolved: Resolved) -> int:
    """How many numbers a row stores about the periods of the longest run."""
    ticks = kept_period(resolved)
    return len(PERIOD_COLUMNS) * -(-resolved.scenario.stop.max_duration // ticks) if ticks else 0


def figures_of(simulation: Simulation, window: int, marks: CountedStretches) -> Row:
    """The columns of a row with the results of a run; `window`: its length in ticks, 0 for none."""
    orders = asked_orders(simulation.world)
    delivered = orders.done[orders.done >= 0]
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
    deadlock = longest_deadlock(simulation)
    if deadlock is not None:
        row["standstill_at"] = str(deadlock.cell)
        row["standstill_from"] = deadlock.first_tick // refinement
    if window:
        windows = simulation.tick // window
        done = np.maximum(delivered, 1)  # ticks count from 1
        whole = done[done <= windows * window]
        row[SERIES_COLUMN] = np.bincount((whole - 1) // window, minlength=windows).tolist()
        row[SUMS_COLUMN] = sums_by_stretch(simulation, marks.stretches)
    return row
