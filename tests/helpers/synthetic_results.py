"""Results of studies made up, without runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import Analysis, Study


def synthetic_store(
    study: Study, value: Callable[[int, int], float | None], **columns: Callable[[int, int], Any]
) -> Results:
    """Runs of which makespan is value(point, replication)."""
    runs = [(p.number, r) for p in study.points for r in range(study.replications)]
    usual: dict[str, Callable[[int, int], Any]] = {
        "key": lambda p, r: f"{p}-{r}",
        "point": lambda p, r: p,
        "replication": lambda p, r: r,
        "seed": lambda p, r: r,
        "finished": lambda p, r: True,
        "error": lambda p, r: None,
        "digest": lambda p, r: f"{p}-{r}",
        "makespan": value,
    }
    made = {name: [of(*run) for run in runs] for name, of in {**usual, **columns}.items()}
    return Results(study=study, columns=made, version="0" * 16)


def study_of(factors: dict[str, Any], replications: int = 60, **more: Any) -> Study:
    analysis = Analysis(metrics=("makespan",), **more)
    return Study(
        name="made up",
        scenario="tabletop-mini",
        factors=factors,
        replications=replications,
        analysis=analysis,
    )


def noise(point: int, replication: int) -> float:
    return float(np.random.default_rng((point, replication)).normal(100, 10))
