"""The rows of a study by design point: which runs there are, and the metrics of those that count.

A run that failed has no metrics. One that did not finish has some, but they do not say what it
would have come to: means leave it out, and every table counts it.

Points whose runs are the same compare nothing: a factor has no effect there. With one robot, right of
way changes nothing: every seed ends with the same digest under each rule. Such points are called the
same runs, tables say of which point, and no family compares them in a metric in which they agree, too.
A warm-up changes no run, but what is measured of it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from automaton.studies.reports.reader_units import Scale, Units
from automaton.studies.reports.warm_up_cut import LENGTHS, Cut, lists, measured_rows
from automaton.studies.sweeps.result_columns import SERIES, SUMS_COLUMN, TICKS_PER_SECOND
from automaton.studies.sweeps.run_keys import declared_by
from automaton.studies.sweeps.study import Analysis, Point, Study

if TYPE_CHECKING:
    import pyarrow as pa

    from automaton.studies.sweeps.result_store import Store

QUANTILES = ("lead_time_p95", "delay_p95", "tardiness_p95")  # of the orders of a run
MIN_SHARED_SEEDS = 2  # seeds of points that are called the same runs
Runs = Mapping[int, tuple[str, object]]  # seed -> digest and value
USUAL_METRICS = ("makespan", "throughput", "utilization", "blocked_share", "delay", "lead_time")


@dataclass(frozen=True)
class Counts:
    """What became of the runs of a point."""

    planned: int
    done: int  # rows, failed ones included
    finished: int
    censored: int  # did not finish within the limit
    failed: int  # have no metrics

    @property
    def missing(self) -> int:
        """Runs without a row."""
        return self.planned - self.done


@dataclass(frozen=True)
class Results:
    """What a folder holds, as columns of equal length."""

    study: Study
    columns: Mapping[str, Sequence[Any]]
    version: str  # hash of the code
    versions: Mapping[str, str] = field(default_factory=dict)  # of libraries
    folder: str = ""
    damaged: Sequence[str] = ()
    earlier: int = 0  # how often the analysis or warm-up was changed after runs had been made
    raised: Sequence[int] = ()  # replications asked for before, if fewer, when runs had been made
    rounds: Sequence[int] = ()  # replications after each, where a precision says when to stop
    at_most: int = 0  # replications in such rounds
    cut: Cut | None = None  # of a steady state: metrics are of what comes after it
    warm_ups: Sequence[int] = (0,)  # ticks that the scenarios leave out of their runs' metrics
    units: Units = field(default_factory=Units)  # in which reports print metrics

    @cached_property
    def _rows(self) -> dict[int, npt.NDArray[np.int64]]:
        """The rows of each point, by replication."""
        points = np.asarray(self.columns["point"], np.int64)
        order = np.lexsort((np.asarray(self.columns["replication"], np.int64), points))
        ends = np.searchsorted(points[order], np.arange(len(self.study.points) + 1))
        return {number: order[ends[number] : ends[number + 1]] for number in range(len(ends) - 1)}

    @property
    def points(self) -> tuple[Point, ...]:
        """The design points."""
        return self.study.points

    @property
    def rows(self) -> int:
        """Runs that have a row."""
        return len(self.columns["key"])

    @property
    def analysis(self) -> Analysis:
        """What was declared; without a declaration: the usual metrics, no comparisons."""
        declared = self.study.analysis
        if declared is not None:
            return declared
        return Analysis(metrics=tuple(name for name in USUAL_METRICS if self.has(name)))

    @property
    def quantiles(self) -> tuple[str, ...]:
        """The quantiles of delay that runs have and the analysis does not name."""
        return tuple(
            name for name in QUANTILES if self.has(name) and name not in self.analysis.metrics
        )

    def has(self, metric: str) -> bool:
        """Whether any run has this metric; of a steady state, whether it is one of that."""
        if self.study.design == "steady-state" and metric in LENGTHS:
            return False
        column = self.columns.get(metric)
        return column is not None and any(value is not None for value in column)

    def counts(self, point: Point) -> Counts:
        """What became of the runs of a point."""
        rows = self._rows[point.number]
        failed = sum(self.columns["error"][row] is not None for row in rows)
        finished = sum(self._finished(row) for row in rows)
        done = len(rows)
        return Counts(self.study.max_replications, done, finished, done - failed - finished, failed)

    def values(self, point: Point, metric: str) -> dict[int, float]:
        """A metric by replication, of the runs that finished and have it."""
        column = self.columns.get(metric)
        if column is None:
            return {}
        replication = self.columns["replication"]
        return {
            int(replication[row]): float(column[row])
            for row in self._rows[point.number]
            if self._finished(row) and column[row] is not None
        }

    def scale(self, metric: str) -> Scale:
        """The unit in which a metric is printed, by its largest mean over the runs of a point."""
        if metric not in self._scales:
            runs = (self.values(point, metric).values() for point in self.points)
            largest = max((math.fsum(own) / len(own) for own in runs if own), default=0.0)
            self._scales[metric] = self.units.scale(metric, largest)
        return self._scales[metric]

    @cached_property
    def _scales(self) -> dict[str, Scale]:
        return {}

    @property
    def reported(self) -> tuple[str, ...]:
        """The metrics that reports print."""
        return (*(name for name in self.analysis.metrics if self.has(name)), *self.quantiles)

    def runs(self, point: Point, metric: str | None = None) -> Runs:
        """What distinguishes the runs that did not fail: digests and, of a metric, its values."""
        return self._runs_of(metric)[point.number]

    def _runs_of(self, metric: str | None) -> Sequence[Runs]:
        """The runs of each point, read once for each metric."""
        if metric not in self._known_runs:
            seed, digest, failed = (self.columns[name] for name in ("seed", "digest", "error"))
            column = self.columns.get(metric or "")

            def measured(row: int) -> object:
                return column[row] if column is not None and self._finished(row) else None

            self._known_runs[metric] = [
                {
                    int(seed[row]): (digest[row], measured(row))
                    for row in rows
                    if failed[row] is None
                }
                for rows in self._rows.values()
            ]
        return self._known_runs[metric]

    @cached_property
    def _known_runs(self) -> dict[str | None, Sequence[Runs]]:
        return {}

    def same(self, one: Point, other: Point, metric: str | None = None) -> bool:
        """Whether two points have the same runs: equal digests on all seeds that both have.

        With a metric: the same runs, measured alike. It ends at the first seed that differs.
        """
        own, theirs = self.runs(one, metric), self.runs(other, metric)
        both = 0
        for seed, run in own.items():
            if seed in theirs:
                if theirs[seed] != run:
                    return False
                both += 1
        return both >= MIN_SHARED_SEEDS

    def identical(self, metric: str | None = None) -> Sequence[int]:
        """Of each point, the first one that has all its runs and no others, if only itself.

        These are classes; `same` makes none, because points that share no seed agree on none.
        """
        if metric not in self._classes:
            first: dict[object, int] = {}
            runs = self._runs_of(metric)
            self._classes[metric] = [
                first.setdefault(tuple(sorted(own.items())), number)
                for number, own in enumerate(runs)
            ]
        return self._classes[metric]

    @cached_property
    def _classes(self) -> dict[str | None, Sequence[int]]:
        return {}

    @cached_property
    def first_same(self) -> Sequence[int]:
        """Of each point, the first one with the same runs, if only itself."""
        first: dict[object, int] = {}  # seed and digest -> the first point with such a run
        found: list[int] = []
        for point, twin in zip(self.points, self.identical(), strict=True):
            own = self.runs(point)
            earlier = {twin, *(first.setdefault(run, point.number) for run in own.items())}
            same = (n for n in sorted(earlier) if self.same(point, self.points[n]))
            found.append(next(same, point.number))
        return found

    @cached_property
    def repeats(self) -> tuple[Point, ...]:
        """The points whose runs are those of an earlier one."""
        return tuple(p for p in self.points if self.first_same[p.number] != p.number)

    def series(self, point: Point) -> list[Sequence[int]]:
        """The deliveries by window of each run that has them, in the order of replications."""
        column = self.columns.get(SERIES)
        if column is None:
            return []
        return [column[row] for row in self._rows[point.number] if column[row] is not None]

    def first_run(self, point: Point) -> tuple[int, str] | None:
        """Seed and digest of a point's first run that has metrics."""
        for row in self._rows[point.number]:
            if self.columns["error"][row] is None:
                return int(self.columns["seed"][row]), str(self.columns["digest"][row])
        return None

    def _finished(self, row: int) -> bool:
        return self.columns["error"][row] is None and bool(self.columns["finished"][row])


def read_results(store: Store) -> Results:
    """The results of a folder. Raises InputError."""
    table, cut = measured_rows(store)
    declared = [*store.manifest.earlier, declared_by(store.declared)]
    rounds = store.manifest.rounds
    counts = [one.replications for one in declared]
    return Results(
        study=store.study,
        columns=columns_of(table),
        version=store.manifest.version,
        versions=store.manifest.versions,
        folder=str(store.folder),
        damaged=[path.name for path in store.damaged],
        earlier=sum(not one.analysed_as(other) for one, other in itertools.pairwise(declared)),
        raised=list(dict.fromkeys(n for n in counts if n < store.study.max_replications)),
        rounds=rounds if isinstance(rounds, tuple) else (),
        at_most=store.declared.max_replications,
        cut=cut,
        warm_ups=sorted({point.warm_up for point in store.manifest.points}),
    )


def columns_of(table: pa.Table) -> dict[str, Sequence[Any]]:
    """Columns as lists; deliveries by window as arrays, and no sums by stretch."""
    names = [name for name in table.column_names if name not in (SERIES, SUMS_COLUMN)]
    columns: dict[str, Sequence[Any]] = {name: table.column(name).to_pylist() for name in names}
    if SERIES in table.column_names:
        columns[SERIES] = lists(table.column(SERIES))
    columns[TICKS_PER_SECOND] = [
        ticks / seconds if ticks is not None and seconds else None
        for ticks, seconds in zip(columns["ticks"], columns["cpu_s"], strict=True)
    ]
    return columns
