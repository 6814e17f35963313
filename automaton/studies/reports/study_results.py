"""What a folder of results holds, by design point, as reports read it.

A run that failed has no metrics. One that did not finish has some, but they do not say what it would
have come to: means leave it out, and every table counts it.

Points whose runs are the same compare nothing: a factor has no effect there. With one robot, right of
way changes nothing: every seed ends with the same digest under each rule. Such points are called the
same runs, tables say of which point, and no family compares them in a metric in which they agree, too.
A warm-up changes no run, but what is measured of it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.runs.metric_catalogue import METRIC_CATALOGUE, PER_1000_TICKS, units_of
from automaton.runs.metric_sums import QUOTIENTS, metric
from automaton.scenario.unavailable_metrics import OF_DUE_TIMES, OF_TIMES
from automaton.studies.inference.intervals import Interval
from automaton.studies.inference.steady_state import NotSteadyError, mser5, mser5_of_means
from automaton.studies.sweeps.run_keys import declared_by
from automaton.studies.sweeps.study import (
    RUN_METRICS,
    SERIES_COLUMN,
    SUMS_COLUMN,
    TICKS_PER_SECOND,
    Analysis,
    Point,
    Study,
    metric_names,
    sum_names,
)
from automaton.units import SECONDS_PER_UNIT, Unit, duration
from automaton.world.resolved import Resolved

if TYPE_CHECKING:
    import pyarrow as pa

    from automaton.studies.sweeps.result_store import Store


PLAIN_TICK: Final = Unit(1.0, "tick")
PER_HOUR: Final = "orders/h"
LENGTHS: Final = ("makespan", "ticks", "orders")  # of a run, whatever is left out
# A state, of which no warm-up is part.
AT_THE_END: Final = ("min_charge", "oldest_order", "starved_robots")
# Figures that grow with a queue, and the metrics that are steady only where they are.
TIMES: Final = {
    "lead_time": (*OF_TIMES, *OF_DUE_TIMES),
    "task_time": ("task_time",),
    "delay": ("delay", "delay_p95"),
}
Lists = Sequence["npt.NDArray[np.int64] | None"]  # by row
ORDER_QUANTILES = ("lead_time_p95", "delay_p95", "tardiness_p95")  # of the orders of a run
MIN_SHARED_SEEDS = 2  # seeds of points that are called the same runs
Runs = Mapping[int, tuple[str, object]]  # seed -> digest and value
USUAL_METRICS = ("makespan", "throughput", "utilization", "blocked_share", "delay", "lead_time")


# Metrics in the units of the reader: minutes instead of ticks, where a tick is a time.
#
# Runs count in ticks and cells. A report multiplies what it prints of a metric by one number, which
# changes no comparison. Where the points of a study disagree about what a tick is, it stays a tick.


class MetricScale(NamedTuple):
    """What a metric of the runs is multiplied by, and its unit then."""

    factor: float
    unit: str

    def of(self, interval: Interval) -> Interval:
        """An interval in this unit."""
        low, high = interval.low, interval.high
        return interval._replace(
            value=interval.value * self.factor,
            low=None if low is None else low * self.factor,
            high=None if high is None else high * self.factor,
        )


class ReportUnits(NamedTuple):
    """What a tick and a cell's side are at all points of a study."""

    tick: Unit = PLAIN_TICK
    cell: Unit | None = None

    def scale(self, metric: str, largest: float) -> MetricScale:
        """The scale of a metric of which `largest` is the largest mean, in the unit of the runs."""
        unit, _ = described(metric)
        seconds = self.tick.seconds
        if unit == "ticks":
            amount, name = duration(largest or 1.0, self.tick)
            return MetricScale(amount / (largest or 1.0), name)
        if unit.startswith(PER_1000_TICKS) and seconds:
            factor = SECONDS_PER_UNIT["h"] / (1000 * seconds)
            return MetricScale(factor, unit.replace(PER_1000_TICKS, PER_HOUR))
        if unit == "cells" and self.cell is not None:
            return MetricScale(self.cell.size, self.cell.name)
        return MetricScale(1.0, unit)


def units_of_points(scenarios: Iterable[Resolved], points: int) -> ReportUnits:
    """The units of a study of so many points: those that all of its scenarios share, else ticks."""
    units = [units_of(resolved.unrefined) for resolved in scenarios]
    if len(units) < points:  # the scenario of a point is not known
        return ReportUnits()
    ticks, cells = {tick for tick, _ in units}, {cell for _, cell in units}
    return ReportUnits(
        ticks.pop() if len(ticks) == 1 else PLAIN_TICK, cells.pop() if len(cells) == 1 else None
    )


def described(metric: str) -> tuple[str, str]:
    """Unit and meaning of a metric, as runs count it."""
    known = METRIC_CATALOGUE.get(metric) or RUN_METRICS.get(metric)
    return known or ("times", "counted by a strategy")


# Steady states without their warm-up: one cut for all runs of a study, and their metrics after it.
#
# The cut is the largest of what the scenarios declare (measure.warm_up) and of what MSER-5 finds at
# each point, by deliveries and by the times of orders and tasks: a queue may still grow when as much
# is delivered as ever will be. Where all runs were measured from there on, their own metrics hold;
# else metrics follow from the sums that rows keep, after the next stretch begins, and what sums do
# not tell is left out.


class Cut(NamedTuple):
    """What is left out at the beginning of every run."""

    ticks: int
    window: int  # ticks in which deliveries were counted
    found: Mapping[int, int]  # point: ticks that MSER-5 leaves out there
    refused: Mapping[int, str]  # point: why it has no metrics
    unsteady: Mapping[tuple[int, str], str]  # point and metric: why that one has no metric there
    left_out: tuple[str, ...] = ()  # metrics of the runs that cannot be told after the cut


def measured_rows(store: Store) -> tuple[pa.Table, Cut | None]:
    """All rows; of a steady state with the metrics of what comes after the cut alone."""
    import pyarrow

    table = store.rows()
    if store.study.design != "steady-state":
        return table, None
    names = ["delivered", *metric_names(store.manifest.counted)]
    points = np.array(table.column("point").to_pylist(), np.int64)
    planned = store.manifest.points
    declared, window = max(point.warm_up for point in planned), planned[0].windows.window
    stretch = planned[0].windows.stretch
    sums = {name: sums_column(table, name) for name in sums_of_times()}
    cut = cut_of(
        store.study, points, lists(table.column(SERIES_COLUMN)), declared, window, sums, stretch
    )
    if all(point.warm_up == cut.ticks for point in planned):
        figures = {name: table.column(name).to_pylist() for name in names}
    else:
        cut = cut._replace(ticks=math.ceil(cut.ticks / stretch) * stretch)
        figures = figures_of_sums(store, table, names, cut.ticks)
    cut = cut._replace(refused=ending_before(cut, points, table.column("ticks").to_pylist()))
    lost = []
    for name, values in figures.items():
        field, at = table.schema.field(name), table.schema.get_field_index(name)
        before = table.column(name)
        if name in LENGTHS:
            continue
        if before.null_count < len(before) and all(value is None for value in values):
            lost.append(name)
        without = {*cut.refused, *(point for point, metric in cut.unsteady if metric == name)}
        gone = np.isin(points, list(without)).tolist()
        kept = [None if is_gone else value for is_gone, value in zip(gone, values, strict=True)]
        table = table.set_column(at, field, pyarrow.array(kept, field.type))
    return table, cut._replace(left_out=tuple(lost))


def cut_of(
    study: Study,
    points: npt.NDArray[np.int64],
    series: Lists,
    declared: int,
    window: int,
    sums: Mapping[str, Lists] = MappingProxyType({}),
    stretch: int = 1,
) -> Cut:
    """One cut for all points, from the deliveries by window of each row and the point that it is of.

    `declared`: the most that a scenario leaves out; `sums`: those of times, by ticks of a stretch.
    """
    found: dict[int, int] = {}
    refused: dict[int, str] = {}
    unsteady: dict[tuple[int, str], str] = {}
    for point in study.points if study.warm_up == "mser-5" else ():
        own = np.flatnonzero(points == point.number).tolist()
        rows = [row for row in own if series[row] is not None]
        runs = [run for run in (series[row] for row in rows) if run is not None]
        if not runs:
            continue
        length = min(map(len, runs))
        try:
            y = np.array([run[:length] for run in runs], np.float64)
            found[point.number] = window * mser5(y).cut
        except NotSteadyError as why:
            refused[point.number] = str(why)
            continue
        whole = length * window // stretch
        for name, metrics in TIMES.items():
            try:
                means = means_by_stretch(name, sums, rows, whole, stretch)
                if not np.isnan(means).all():
                    cut = stretch * mser5_of_means(means)
                    found[point.number] = max(found[point.number], cut)
            except NotSteadyError as why:
                unsteady |= {(point.number, metric): str(why) for metric in metrics}
    return Cut(max([declared, *found.values()]), window, found, refused, unsteady)


def sums_of_times() -> list[str]:
    """The names of the sums that TIMES are quotients of."""
    return list(dict.fromkeys(name for time in TIMES for name in parts_of(time)))


def parts_of(time: str) -> tuple[str, str]:
    """The sums of which a metric of TIMES is the quotient."""
    part, whole = QUOTIENTS[time].part, QUOTIENTS[time].whole
    assert isinstance(part, str)
    assert isinstance(whole, str)
    return part, whole


def means_by_stretch(
    time: str, sums: Mapping[str, Lists], rows: Sequence[int], whole: int, stretch: int
) -> npt.NDArray[np.float64]:
    """A metric of TIMES over these runs, in each of the first so many stretches; NaN: nothing
    ended.

    Tasks count where they begin: the last stretches, whose longer tasks are not done yet, are left out.
    """
    kept = [
        [one[:whole] for row in rows if (one := sums[name][row]) is not None]
        for name in parts_of(time)
        if name in sums
    ]
    if sum(map(len, kept)) < 2 * len(rows):
        return np.full(whole, np.nan)  # it is not measured
    part, ended = (np.sum(runs, axis=0) for runs in kept)
    means: npt.NDArray[np.float64] = np.where(ended > 0, part / np.maximum(ended, 1), np.nan)
    if parts_of(time)[1] == "taken" and ended.any():
        lasting = sum(
            one[:whole].sum() for row in rows if (one := sums["task_times"][row]) is not None
        )
        means[max(0, whole - math.ceil(lasting / ended.sum() / stretch)) :] = np.nan
    return means


def ending_before(
    cut: Cut, points: npt.NDArray[np.int64], ticks: Sequence[int | None]
) -> dict[int, str]:
    """The points without metrics, with those of which no run goes on after the cut."""
    longest: dict[int, int] = {}
    for point, end in zip(points.tolist(), ticks, strict=True):
        longest[point] = max(longest.get(point, 0), end or 0)
    short = {
        point: f"its runs of {end:,} ticks end before the cut at {cut.ticks:,}"
        for point, end in longest.items()
        if 0 < end <= cut.ticks
    }
    return {**short, **cut.refused}


def sums_column(table: pa.Table, name: str) -> Lists:
    """By row a sum by stretch."""
    import pyarrow.compute as pc

    return lists(pc.struct_field(table.column(SUMS_COLUMN), [name]))


def figures_of_sums(
    store: Store, table: pa.Table, names: Sequence[str], cut: int
) -> dict[str, list[Any]]:
    """The metrics of runs by their sums after the cut."""
    import pyarrow.compute as pc

    first = cut // store.manifest.points[0].windows.stretch
    kept = sum_names(store.manifest.counted)
    column = table.column(SUMS_COLUMN)
    columns = [sums_after(pc.struct_field(column, [name]), first) for name in kept]
    runs = [
        completed({name: one for name, one in zip(kept, row, strict=True) if one is not None})
        for row in zip(*columns, strict=True)
    ]
    figures = {}
    for name in names:
        had = table.column(name).to_pylist()
        if name in AT_THE_END:
            figures[name] = had
        else:
            figures[name] = [
                None if value is None or not run.get("ticks") else metric(name, run)
                for value, run in zip(had, runs, strict=True)
            ]
    return figures


def completed(run: dict[str, int]) -> dict[str, int]:
    """The sums of a run, with those that follow from others."""
    if run.get("ticks"):
        run["robots"] = run["robot_ticks"] // run["ticks"]
    if "taken" in run:
        run |= {"completed": run["delivered"], "watched_robot_ticks": run["robot_ticks"]}
    return run


def sums_after(column: Any, first: int) -> list[int | None]:
    """By row the sum of a list from this place on; None where there is no list."""
    offsets, values, known = flat(column)
    total = np.concatenate([[0], np.cumsum(values, dtype=np.int64)])
    begin = np.minimum(offsets[:-1] + first, offsets[1:])
    found = (total[offsets[1:]] - total[begin]).tolist()
    return [one if is_known else None for one, is_known in zip(found, known, strict=True)]


def lists(column: Any) -> list[npt.NDArray[np.int64] | None]:
    """By row its list as an array, or None."""
    offsets, values, known = flat(column)
    return [
        values[begin:end] if is_known else None
        for begin, end, is_known in zip(offsets[:-1], offsets[1:], known, strict=True)
    ]


def flat(column: Any) -> tuple[Any, Any, list[bool]]:
    """A column of lists: where each begins, all values, and which are not null."""
    column = column.combine_chunks()
    known = column.is_valid().to_pylist()
    offsets = np.concatenate([[0], np.cumsum(column.value_lengths().fill_null(0).to_numpy())])
    return offsets.astype(np.int64), column.flatten().to_numpy(), known


# The rows of a study by design point.


@dataclass(frozen=True)
class RunCounts:
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
    units: ReportUnits = field(default_factory=ReportUnits)  # in which reports print metrics

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
            name for name in ORDER_QUANTILES if self.has(name) and name not in self.analysis.metrics
        )

    def has(self, metric: str) -> bool:
        """Whether any run has this metric; of a steady state, whether it is one of that."""
        if self.study.design == "steady-state" and metric in LENGTHS:
            return False
        column = self.columns.get(metric)
        return column is not None and any(value is not None for value in column)

    def counts(self, point: Point) -> RunCounts:
        """What became of the runs of a point."""
        rows = self._rows[point.number]
        failed = sum(self.columns["error"][row] is not None for row in rows)
        finished = sum(self._finished(row) for row in rows)
        done = len(rows)
        return RunCounts(
            self.study.max_replications, done, finished, done - failed - finished, failed
        )

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

    def scale(self, metric: str) -> MetricScale:
        """The unit in which a metric is printed, by its largest mean over the runs of a point."""
        if metric not in self._scales:
            runs = (self.values(point, metric).values() for point in self.points)
            largest = max((math.fsum(own) / len(own) for own in runs if own), default=0.0)
            self._scales[metric] = self.units.scale(metric, largest)
        return self._scales[metric]

    @cached_property
    def _scales(self) -> dict[str, MetricScale]:
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
        column = self.columns.get(SERIES_COLUMN)
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
    names = [name for name in table.column_names if name not in (SERIES_COLUMN, SUMS_COLUMN)]
    columns: dict[str, Sequence[Any]] = {name: table.column(name).to_pylist() for name in names}
    if SERIES_COLUMN in table.column_names:
        columns[SERIES_COLUMN] = lists(table.column(SERIES_COLUMN))
    columns[TICKS_PER_SECOND] = [
        ticks / seconds if ticks is not None and seconds else None
        for ticks, seconds in zip(columns["ticks"], columns["cpu_s"], strict=True)
    ]
    return columns
