"""What a reproduction consists of: cases to run, figures to compare with, claims to judge."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from automaton.parallel import OnDone, Result, run_all
from automaton.reproductions.claims import Claim
from automaton.scenario.resolve import resolve

Label = str | int
Key = tuple[Label, ...]  # the labels of a case, in order


@dataclass(frozen=True)
class Case:
    """One column or cell of a published table: what it is called and what is run for it."""

    labels: Mapping[str, Label]
    scenario: str
    overrides: tuple[str, ...]

    @property
    def key(self) -> Key:
        return tuple(self.labels.values())


@dataclass(frozen=True)
class Reproduction:
    """A published table, and how it is made again."""

    name: str
    title: str
    source: str
    strategies: tuple[str, ...]  # those of the publication
    cases: Callable[[Sequence[str]], list[Case]]  # for these strategies
    panels: tuple[tuple[str, ...], ...]  # metrics, grouped as they are printed
    published: Callable[[Key, str], float | None]  # the printed figure of a case and metric
    averaged: tuple[str, ...]  # metrics whose mean |error| is reported
    claims: tuple[Claim, ...]
    remarks: tuple[str, ...]  # where the publication contradicts itself or leaves things open

    @property
    def metrics(self) -> tuple[str, ...]:
        return tuple(metric for panel in self.panels for metric in panel)


@dataclass(frozen=True)
class Row:
    """A metric of a case: the printed figure (None if there is none) and ours over the seeds."""

    case: Mapping[str, Label]
    metric: str
    paper: float | None
    mean: float
    sd: float | None  # of single runs, n - 1 in the denominator; None for a single seed

    @property
    def error(self) -> float | None:
        """mean / paper - 1."""
        return self.mean / self.paper - 1 if self.paper else None


@dataclass(frozen=True)
class Reproduced:
    """All runs of a reproduction. Runs that did not finish count with the ticks they were given."""

    reproduction: Reproduction
    cases: Sequence[Case]
    results: Sequence[Sequence[Result]]  # by case, then by seed

    @property
    def seeds(self) -> int:
        return len(self.results[0])

    @property
    def unfinished(self) -> int:
        return sum(not result.finished for batch in self.results for result in batch)

    def rows(self) -> list[Row]:
        """One for each case and metric, in the order of the cases."""
        return [
            self._row(case, batch, metric)
            for case, batch in zip(self.cases, self.results, strict=True)
            for metric in self.reproduction.metrics
        ]

    def _row(self, case: Case, batch: Sequence[Result], metric: str) -> Row:
        values = [result.metrics[metric] for result in batch]
        paper = self.reproduction.published(case.key, metric)
        # fsum is exact: the figures do not depend on how a processor orders a sum.
        mean = math.fsum(values) / len(values)
        spread = math.fsum((value - mean) ** 2 for value in values)
        sd = math.sqrt(spread / (len(values) - 1)) if len(values) > 1 else None
        return Row(case.labels, metric, paper, mean, sd)

    def mean_errors(self) -> dict[str, float | None]:
        """Mean |error| over the cases with a printed figure, by metric."""
        rows = self.rows()
        found: dict[str, float | None] = {}
        for metric in self.reproduction.averaged:
            errors = [row.error for row in rows if row.metric == metric]
            known = [abs(error) for error in errors if error is not None]
            found[metric] = math.fsum(known) / len(known) if known else None
        return found

    def samples(self) -> dict[tuple[str, Key], list[float]]:
        """(metric, key of a case) -> its values by seed."""
        return {
            (metric, case.key): [result.metrics[metric] for result in batch]
            for case, batch in zip(self.cases, self.results, strict=True)
            for metric in self.reproduction.metrics
        }

    def published(self) -> dict[tuple[str, Key], float]:
        """(metric, key of a case) -> the printed figure, where there is one."""
        figures = {}
        for case in self.cases:
            for metric in self.reproduction.metrics:
                value = self.reproduction.published(case.key, metric)
                if value is not None:
                    figures[metric, case.key] = value
        return figures


def reproduce(
    reproduction: Reproduction,
    seeds: int,
    strategies: Sequence[str] = (),
    workers: int | None = None,
    on_start: Callable[[int], Any] | None = None,
    on_done: OnDone | None = None,
) -> Reproduced:
    """Run all cases with seeds 1..`seeds`.

    `strategies` instead of the published ones; `on_start` is told the number of runs. Raises
    InputError for an unknown strategy before anything runs.
    """
    cases = reproduction.cases(tuple(strategies) or reproduction.strategies)
    scenarios = [resolve(case.scenario, case.overrides) for case in cases]
    if on_start is not None:
        on_start(len(cases) * seeds)
    results = run_all(scenarios, range(1, seeds + 1), workers, on_done)
    return Reproduced(reproduction, cases, results)
