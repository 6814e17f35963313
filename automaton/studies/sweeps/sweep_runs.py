"""What a worker does: some runs of one design point, each of which becomes a row.

A worker is told everything by the coordinator, and gives rows back; it reads and writes no files.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
from collections.abc import Hashable
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.printable import one_line
from automaton.runs.first_compilation import compiled_parts
from automaton.runs.headless import (
    Marks,
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
from automaton.studies.sweeps.result_columns import SERIES, SUMS_COLUMN
from automaton.studies.sweeps.run_keys import (
    WHOLE_RUNS,
    Run,
    Sources,
    Windows,
    hashed,
    package_sources,
    plugin_sources,
)
from automaton.world.resolve import Resolved

Row = dict[str, Any]  # columns of a run; its metrics under "metrics"
MAX_REASON_LENGTH = 500  # characters


class Chunk(NamedTuple):
    """Work for one call of a worker: runs of one design point."""

    number: int  # of the chunk
    version: str  # of the code that the coordinator has
    plugins: tuple[str, ...]
    fingerprint: str  # of the scenario
    scenario: bytes  # the resolved scenario, pickled
    windows: Windows
    runs: tuple[Run, ...]
    patience: float | None = None  # seconds of a decision of a Python strategy


class CodeMismatchError(Exception):
    """A worker has other code than its coordinator."""


def run_chunk(chunk: Chunk) -> list[Row]:
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
MAX_SCENARIOS_KEPT = 16


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
    resolved: Resolved, run: Run, windows: Windows = WHOLE_RUNS, patience: float | None = None
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


def reason(text: str) -> str:
    """Why a run failed, as a row keeps it: not too long, and text that files can hold."""
    return one_line(text.encode(errors="replace").decode(), MAX_REASON_LENGTH)


def blank(run: Run, failed: str | None = None) -> Row:
    """The row of a run that failed."""
    return {**run._asdict(), "finished": False, "error": failed, "metrics": {}}


def figures_of(simulation: Simulation, window: int, marks: Marks) -> Row:
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
        row[SERIES] = np.bincount((whole - 1) // window, minlength=windows).tolist()
        row[SUMS_COLUMN] = sums_by_stretch(simulation, marks.stretches)
    return row
