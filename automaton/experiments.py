"""Experiments: single runs, studies of many, and sizes of fleets, from Python.

    from automaton.experiments import simulate, size, sweep

    simulate("tabletop-1", **{"fleet.robots": 3}).metrics["makespan"]
    simulate("goods-mini", tables=True, states="10 s").tables.lines.to_pandas()
    sweep("tabletop-fleet", out="results").to_pandas()
    size("tabletop-1", "makespan<=2400", robots=(1, 6)).robots

Importing this needs no Numba; `sweep` and all tables need pyarrow (extra `experiments`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from automaton.errors import InputError
from automaton.studies.sweeps.study import Analysis, Point, Replications, Study, read_study

if TYPE_CHECKING:
    import pyarrow as pa

    from automaton.drawings.floor_svg import FloorPicture
    from automaton.runs.headless import Outcome
    from automaton.runs.simulation import Simulation
    from automaton.scenario.document import Override
    from automaton.scenario.schema import Scenario
    from automaton.studies.sizing.sizing_report import SizingResult
    from automaton.studies.sweeps.result_store import Store
    from automaton.tables.table_run import TableRun
    from automaton.world.resolve import Resolved

__all__ = ["Analysis", "Point", "Replications", "Study", "read_study", "simulate", "size", "sweep"]


def simulate(
    scenario: str | Path | Scenario,
    seed: int | None = None,
    *,
    tables: bool = False,
    states: str | int | None = None,
    events: bool = False,
    folder: str | Path | None = None,
    record: str | Path | None = None,
    **overrides: Any,
) -> Outcome:
    """Run a scenario once, in this process: by path, by shipped name, or built in Python.

    Overrides are keys of the scenario: `**{"fleet.robots": 3}`, or `fleet__robots=3`. With `tables`
    the outcome has `tables.orders`, `lines`, `trips`, `robots` and `stations`, each a pyarrow Table;
    `states`, a period such as "10 s" or ticks, adds `states`, `events` those, both `cells`. `folder`:
    a new folder where they are written as Parquet while the run goes on, instead of being kept in
    memory. A notebook shows the floor at the end; with `record`, a file, `film()` shows the run.
    Raises InputError for bad input and for a strategy that raises.
    """
    from automaton.world.resolve import resolve

    resolved = resolve(scenario, settings_of(overrides), seed)
    if not tables:
        if states is not None or events or folder is not None:
            raise InputError("states, events and folder are of tables; set tables=True")
        return _run_shown(resolved, record)
    from automaton.tables.table_run import TableOptions, table_run

    where = None if folder is None else Path(folder)
    with table_run(resolved, TableOptions(states, events, folder=where)) as run:
        outcome = _run_shown(resolved, record, run)
    return outcome._replace(tables=run.tables())


def _run_shown(
    resolved: Resolved, record: str | Path | None, tables: TableRun | None = None
) -> Outcome:
    """Run it once, with the picture of its end and, if it is asked for, its recording."""
    from automaton.recording.recorder import Recorder
    from automaton.recordings import read
    from automaton.runs.headless import run_once

    pictures: list[FloorPicture] = []

    def on_end(simulation: Simulation) -> None:
        pictures.append(simulation.picture())
        if tables is not None:
            tables.finish(simulation)

    sampling = None if tables is None else tables.sampling
    if record is None:
        outcome = run_once(resolved, on_end=on_end, sampling=sampling)
        return outcome._replace(picture=pictures[0])
    try:
        with Recorder(record, resolved, resolved.scenario.seed) as recorder:
            outcome = run_once(resolved, recorder, on_end=on_end, sampling=sampling)
    except OSError as error:
        raise InputError(f"cannot write the recording: {error.strerror}", str(record)) from error
    return outcome._replace(picture=pictures[0], recording=read(record))


def settings_of(overrides: dict[str, Any]) -> list[Override]:
    """Keyword arguments as settings of a scenario: `fleet__robots` is fleet.robots."""
    from automaton.scenario.document import Override, keys_of

    keys = ((name.replace("__", "."), value) for name, value in overrides.items())
    return [Override(f"{key}={value!r}", keys_of(key), value) for key, value in keys]


def sweep(
    study: str | Path | Study,
    out: str | Path | None = None,
    executor: Executor | None = None,
    *,
    workers: int | None = None,
    scheduler: str | Path | None = None,
    recompute: bool = False,
    retry_failed: bool = False,
) -> pa.Table:
    """Do the runs of a study that the folder `out` lacks; all its rows as an Arrow table.

    Without `out` nothing is kept. `executor`: any of concurrent.futures, which is left open;
    `scheduler`: a Dask cluster, by its address or the file that its scheduler wrote; default are
    `workers` spawned processes, one for each core (a script needs the usual
    `if __name__ == "__main__":`). Raises InputError as `automaton sweep` does; what is done when
    something is raised is kept in `out`.
    """
    from automaton.studies.reports.comparisons import next_replications
    from automaton.studies.sweeps.pools import MAX_WORKERS, Backend, ExternalExecutor, LocalPool
    from automaton.studies.sweeps.sweep_plan import copies_of, make_sweep_plan
    from automaton.studies.sweeps.sweep_session import sweep_into

    if sum(given is not None for given in (executor, workers, scheduler)) > 1:
        raise InputError("sweep() takes one of executor, workers and scheduler")
    if workers is not None and not 1 <= workers <= MAX_WORKERS:
        raise InputError(f"workers must be from 1 to {MAX_WORKERS:,}, found {workers}")

    def backend() -> Backend:
        if scheduler is not None:
            from automaton.studies.sweeps.pools import DaskCluster

            return DaskCluster(str(scheduler))
        return LocalPool(workers) if executor is None else ExternalExecutor(executor)

    def decide(store: Store) -> int | None:
        following = next_replications(store)
        return None if following is None else following.replications

    plan = make_sweep_plan(study)
    if out is not None:
        copies = copies_of(study, plan)
        swept = sweep_into(
            Path(out),
            plan,
            backend,
            recompute,
            retry_failed=retry_failed,
            copies=copies,
            decide=decide,
        )
        return swept.store.rows()
    with tempfile.TemporaryDirectory(prefix="automaton-sweep-") as folder:
        return sweep_into(Path(folder), plan, backend, decide=decide).store.rows()


def size(
    scenario: str | Path | Scenario,
    target: str,
    robots: str | int | tuple[int, int] | list[int],
    *,
    strategies: str | Sequence[str] | None = None,
    success_share: float | None = None,
    mean: bool | None = None,
    indifference: float | None = None,
    alpha: float = 0.05,
    budget: int = 20_000,
    seed: int | None = None,
    workers: int | None = None,
    **overrides: Any,
) -> SizingResult:
    """The smallest fleet that meets a target such as "makespan<=2400", as `automaton size` finds
    it.

    `robots`: the smallest and the largest fleet that may be an answer, as (1, 6) or "1..6", or one
    alone; `strategies`: as "a,b" or ["a", "b"]; the others are the options of the command.
    `workers`: spawned processes, default one for each core; 1: none. Overrides as of `simulate`.
    Raises InputError, and WorkerDied where a process dies.
    """
    from automaton.studies.process_pool import PersistentPool
    from automaton.studies.sizing.fleet_search import (
        make_question,
        read_target,
        robots_of,
        strategies_of,
    )
    from automaton.studies.sizing.sizing_report import sized
    from automaton.studies.sizing.sizing_session import (
        Checked,
        Fleets,
        run_and_measure_use,
        session_of,
    )

    fleet, compared = robots_of(robots), strategies_of(strategies)
    with PersistentPool(workers, run_and_measure_use) as rounds:
        fleets = Fleets(scenario, settings_of(overrides), seed, rounds)
        wanted = read_target(target, fleets.tick)
        asked = make_question(
            wanted,
            fleet,
            compared,
            success_share,
            indifference,
            alpha,
            budget,
            mean,
            fleets.warm_up,
        )
        session = session_of(fleets, Checked(fleets, asked))
        session.go()
    return sized(session, fleets.base.scenario.name, fleets.seed)
