"""Experiments: single runs and studies of many, from Python.

    from automaton.experiments import simulate, sweep

    simulate("tabletop-1", **{"fleet.robots": 3}).metrics["T_total"]
    sweep("tabletop-fleet", out="results").to_pandas()

Importing this needs no Numba; `sweep` needs pyarrow (extra `experiments`).
"""

from __future__ import annotations

import tempfile
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from automaton.experiments.study import Analysis, Point, Study, read_study

if TYPE_CHECKING:
    import pyarrow as pa

    from automaton.headless import Outcome
    from automaton.scenario.schema import Scenario

__all__ = ["Analysis", "Point", "Study", "read_study", "simulate", "sweep"]


def simulate(scenario: str | Path | Scenario, seed: int | None = None, **overrides: Any) -> Outcome:
    """Run a scenario once, in this process: by path, by shipped name, or built in Python.

    Overrides are keys of the scenario: `**{"fleet.robots": 3}`, or `fleet__robots=3`. Raises
    InputError for bad input and for a strategy that raises.
    """
    from automaton.headless import run_once
    from automaton.scenario.document import Override
    from automaton.scenario.overrides import keys_of
    from automaton.scenario.resolve import resolve

    settings = []
    for name, value in overrides.items():
        key = name.replace("__", ".")
        settings.append(Override(f"{key}={value!r}", keys_of(key), value))
    return run_once(resolve(scenario, settings, seed))


def sweep(
    study: str | Path | Study,
    out: str | Path | None = None,
    executor: Executor | None = None,
    *,
    workers: int | None = None,
    recompute: bool = False,
    retry_failed: bool = False,
) -> pa.Table:
    """Do the runs of a study that the folder `out` lacks; all its rows as an Arrow table.

    Without `out` nothing is kept. `executor`: any of concurrent.futures, which is left open;
    default are `workers` spawned processes, one for each core (a script needs the usual
    `if __name__ == "__main__":`). Raises InputError as `automaton sweep` does; what is done when
    something is raised is kept in `out`.
    """
    from automaton.experiments.plan import plan_of
    from automaton.experiments.pools import Crew, GivenExecutor, LocalPool
    from automaton.experiments.session import sweep_into

    def crew() -> Crew:
        return LocalPool(workers) if executor is None else GivenExecutor(executor)

    plan = plan_of(study)
    if out is not None:
        swept = sweep_into(Path(out), plan, crew, recompute, retry_failed=retry_failed)
        return swept.store.rows()
    with tempfile.TemporaryDirectory(prefix="automaton-sweep-") as folder:
        return sweep_into(Path(folder), plan, crew).store.rows()
