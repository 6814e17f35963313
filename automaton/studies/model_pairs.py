"""Pairs of runs of two models with the same seeds: by how much does a result depend on the model?"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from automaton.studies.inference.intervals import effect
from automaton.studies.process_pool import run_all
from automaton.studies.sweeps.run_keys import replication_seeds
from automaton.studies.tuning import measure
from automaton.world.resolved import Resolved

COMPARED: Final = {"throughput": 1, "lead_time": -1}  # power of time, in ticks
SAME_MODEL: Final = 0.01  # relative difference below which two models count as one


class Change(NamedTuple):
    """A relative difference, with the ends of its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def matters(self) -> bool:
        """Whether the difference is large enough, and not by chance."""
        return abs(self.value) >= SAME_MODEL and not self.low <= 0 <= self.high

    def __str__(self) -> str:
        return f"{self.value:+.1%} ({self.low:+.1%} to {self.high:+.1%})"


def compare_pairs(
    first: Resolved,
    second: Resolved,
    pairs: int,
    workers: int | None,
    on_done: Callable[[int], None] = lambda done: None,
) -> dict[str, Change]:
    """By how much `second` differs from `first` in each metric that both measure; at least 2 pairs."""
    seeds = replication_seeds(first.scenario.seed, 0, pairs)
    results = run_all([first, second], seeds, workers, on_done, measure)
    finer = second.scenario.refine / first.scenario.refine
    out = {}
    for metric, power in COMPARED.items():
        values = [[run.metrics.get(metric) for run in runs] for runs in results]
        if any(value is None for some in values for value in some):
            continue
        a, b = ([float(value or 0) for value in some] for some in values)
        relative = effect([one * finer**power for one in b], a, paired=True).relative
        if relative is not None and relative.low is not None and relative.high is not None:
            out[metric] = Change(relative.value, relative.low, relative.high)
    return out
