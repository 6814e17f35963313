"""The contents of a results folder by design point, as read by reports.

A run is complete if it met its stop condition or a limit that is an end, such as the end of a shift, even
with orders open or robots deadlocked. Means exclude unfinished runs, whose metrics do not predict their
final values, and failed runs, which have none; every table states their number and the bias of the mean.

A comparison of points with identical runs is pointless, because the factor has no effect there. For
example, with one robot, all right-of-way rules give the same digest for every seed. Tables mark such
points as the same runs, and families do not compare them in metrics in which they also agree. A warm-up
does not change a run, only its metrics.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from automaton.runs.metric_catalogue import METRIC_CATALOGUE, PER_1000_TICKS, units_of
from automaton.runs.metric_sums import QUOTIENTS, metric
from automaton.scenario.unavailable_metrics import OF_DUE_TIMES, OF_TIMES
from automaton.studies.inference.intervals import Interval
from automaton.studies.inference.steady_state import NotSteadyError, mser5, mser5_of_means
from automaton.studies.sweeps.run_keys import declared_by
from automaton.studies.sweeps.study import (
    PERIODS_COLUMN,
    RUN_METRICS,
    SERIES_COLUMN,
    SUMS_COLUMN,
    TICKS_PER_SECOND,
    USES_COLUMN,
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
LENGTHS: Final = (
    "makespan",
    "sum_of_costs",
    "ticks",
    "orders",
)  # cover the whole run despite a warm-up
# Metrics of the final state, which do not depend on the warm-up.
AT_THE_END: Final = ("min_charge", "oldest_order", "starved_robots")
# Times that grow with a queue, and the metrics that are steady only if these times are.
TIMES: Final = {
    "lead_time": (*OF_TIMES, *OF_DUE_TIMES),
    "task_time": ("task_time",),
    "delay": ("delay", "delay_p95"),
}
Lists = Sequence["npt.NDArray[np.int64] | None"]  # by row
ORDER_QUANTILES = ("lead_time_p95", "delay_p95", "tardiness_p95")  # of the orders of a run
MIN_SHARED_SEEDS = 2  # least number of common seeds of points that count as the same runs
Runs = Mapping[int, tuple[str, object]]  # seed -> digest and value
WHAT_IF_METRICS = ("throughput", "lead_time", "lead_time_p95", "late_share")
USUAL_METRICS = ("makespan", "throughput", "utilization", "blocked_share", "delay", "lead_time")


# Conversion of metrics to the units of the reader, such as minutes instead of ticks.
#
# Runs count in ticks and cells. A report multiplies all values of a metric by one factor, which changes
# no comparison. If the points of a study have different tick lengths, the unit remains the tick.


class MetricScale(NamedTuple):
    """The factor by which a metric of the runs is multiplied, and the resulting unit."""

    factor: float
    unit: str

    def of(self, interval: Interval) -> Interval:
        """An interval in this unit."""
        return interval.times(self.factor)


PERCENT: Final = MetricScale(100.0, "%")


class ReportUnits(NamedTuple):
    """The units of a tick and of a cell's side that all points of a study share."""

    tick: Unit = PLAIN_TICK
    cell: Unit | None = None

    def scale(self, metric: str, largest: float) -> MetricScale:
        """The scale of a metric; `largest`: its largest mean, in the unit of the runs."""
        unit, _ = described(metric)
        seconds = self.tick.seconds
        if unit == "share":
            return PERCENT
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
    """The units that all scenarios of a study share, else ticks; `points`: number of its points."""
    units = [units_of(resolved.unrefined) for resolved in scenarios]
    if len(units) < points:  # the scenario of a point is unknown
        return ReportUnits()
    ticks, cells = {tick for tick, _ in units}, {cell for _, cell in units}
    return ReportUnits(
        ticks.pop() if len(ticks) == 1 else PLAIN_TICK, cells.pop() if len(cells) == 1 else None
    )


def described(metric: str) -> tuple[str, str]:
    """Unit and meaning of a metric, in the units of runs."""
    known = METRIC_CATALOGUE.get(metric) or RUN_METRICS.get(metric)
    return known or ("times", "counted by a strategy")


# Warm-up of steady states: one cut for all runs of a study, and their metrics after it.
#
# The cut is the largest of the warm-ups that the scenarios declare (measure.warm_up) and that MSER-5
# finds at each point, from deliveries and from the times of orders and tasks: a queue may still grow
# when the delivery rate is already at its maximum. If all runs were measured from the cut on, their own
# metrics are used. Otherwise metrics are computed from the sums in the rows, from the start of the next
# stretch on; metrics that sums do not determine are omitted.


class Cut(NamedTuple):
    """The ticks that are discarded at the beginning of every run."""

    ticks: int
    window: int  # length in ticks of the windows in which deliveries were counted
    found: Mapping[int, int]  # point: ticks that MSER-5 discards there
    refused: Mapping[int, str]  # point: why it has no metrics
    unsteady: Mapping[tuple[int, str], str]  # (point, metric): why the point lacks the metric
    left_out: tuple[str, ...] = ()  # metrics of the runs that cannot be computed after the cut


def measured_rows(store: Store) -> tuple[pa.Table, Cut | None]:
    """All rows; of a steady-state study with metrics after the cut only."""
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
    """One cut for all points, from the series of deliveries of each row.

    `points`: the point of each row; `declared`: the largest declared warm-up in ticks; `sums`: sums of
    times by stretch; `stretch`: its length in ticks.
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
    """The names of the sums from which TIMES are computed."""
    return list(dict.fromkeys(name for time in TIMES for name in parts_of(time)))


def parts_of(time: str) -> tuple[str, str]:
    """The two sums whose quotient is a metric of TIMES."""
    part, whole = QUOTIENTS[time].part, QUOTIENTS[time].whole
    assert isinstance(part, str)
    assert isinstance(whole, str)
    return part, whole


def means_by_stretch(
    time: str, sums: Mapping[str, Lists], rows: Sequence[int], whole: int, stretch: int
) -> npt.NDArray[np.float64]:
    """A metric of TIMES over these rows in each of the first `whole` stretches; NaN if nothing ended.

    Tasks count in the stretch in which they begin. The last stretches are NaN, because their longer
    tasks are not done yet.
    """
    kept = [
        [one[:whole] for row in rows if (one := sums[name][row]) is not None]
        for name in parts_of(time)
        if name in sums
    ]
    if sum(map(len, kept)) < 2 * len(rows):
        return np.full(whole, np.nan)  # the metric is not measured
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
    """The points without metrics, including points whose runs all end before the cut."""
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
    """A sum by stretch, for each row."""
    import pyarrow.compute as pc

    return lists(pc.struct_field(table.column(SUMS_COLUMN), [name]))


def figures_of_sums(
    store: Store, table: pa.Table, names: Sequence[str], cut: int
) -> dict[str, list[Any]]:
    """The metrics of runs, computed from their sums after the cut."""
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
    """The sums of a run, completed with sums that can be derived from others."""
    if run.get("ticks"):
        run["robots"] = run["robot_ticks"] // run["ticks"]
    if "taken" in run:
        run |= {"completed": run["delivered"], "watched_robot_ticks": run["robot_ticks"]}
    return run


def sums_after(column: Any, first: int) -> list[int | None]:
    """The sum of each row's list from index `first` on; None for rows without a list."""
    offsets, values, known = flat(column)
    total = np.concatenate([[0], np.cumsum(values, dtype=np.int64)])
    begin = np.minimum(offsets[:-1] + first, offsets[1:])
    found = (total[offsets[1:]] - total[begin]).tolist()
    return [one if is_known else None for one, is_known in zip(found, known, strict=True)]


def lists(column: Any) -> list[npt.NDArray[np.int64] | None]:
    """The list of each row as an array, or None."""
    offsets, values, known = flat(column)
    return [
        values[begin:end] if is_known else None
        for begin, end, is_known in zip(offsets[:-1], offsets[1:], known, strict=True)
    ]


def flat(column: Any) -> tuple[Any, Any, list[bool]]:
    """The offsets, the values and the validity of a column of lists."""
    column = column.combine_chunks()
    known = column.is_valid().to_pylist()
    offsets = np.concatenate([[0], np.cumsum(column.value_lengths().fill_null(0).to_numpy())])
    return offsets.astype(np.int64), column.flatten().to_numpy(), known


# The rows of a study by design point.


@dataclass(frozen=True)
class RunCounts:
    """The numbers of runs of a point by outcome."""

    planned: int
    done: int  # runs with a row, including failed runs
    finished: int
    censored: int  # runs that did not finish within the limit
    failed: int  # runs without metrics

    @property
    def missing(self) -> int:
        """Number of runs without a row."""
        return self.planned - self.done


@dataclass(frozen=True)
class Results:
    """The contents of a folder, as columns of equal length."""

    study: Study
    columns: Mapping[str, Sequence[Any]]
    version: str  # hash of the code
    versions: Mapping[str, str] = field(default_factory=dict)  # of libraries
    folder: str = ""
    damaged: Sequence[str] = ()
    earlier: int = 0  # number of changes of analysis or warm-up after runs had been made
    raised: Sequence[int] = ()  # smaller numbers of replications requested when runs had been made
    rounds: Sequence[int] = ()  # replications after each round, in a study with a target precision
    at_most: int = 0  # maximum of replications in these rounds
    cut: Cut | None = None  # of a steady state, whose metrics start after the cut
    warm_ups: Sequence[int] = (0,)  # ticks that the scenarios exclude from metrics of their runs
    units: ReportUnits = field(default_factory=ReportUnits)  # units of metrics in reports
    date: str = ""  # of the latest row

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
        """Number of rows."""
        return len(self.columns["key"])

    @cached_property
    def analysis(self) -> Analysis:
        """The declared analysis; by default the usual metrics that runs have, without comparisons."""
        declared = self.study.analysis or Analysis()
        if declared.metrics:
            return declared
        usual = WHAT_IF_METRICS if self.study.is_named else USUAL_METRICS
        measured = tuple(name for name in usual if self.has(name))
        return msgspec.structs.replace(declared, metrics=measured)

    @property
    def quantiles(self) -> tuple[str, ...]:
        """The percentiles of order times that runs have and the analysis does not name."""
        return tuple(
            name for name in ORDER_QUANTILES if self.has(name) and name not in self.analysis.metrics
        )

    def has(self, metric: str) -> bool:
        """Whether any run has this metric, and in a steady state, whether it applies there."""
        if self.study.design == "steady-state" and metric in LENGTHS:
            return False
        column = self.columns.get(metric)
        return column is not None and any(value is not None for value in column)

    def counts(self, point: Point) -> RunCounts:
        """The numbers of runs of a point by outcome."""
        rows = self._rows[point.number]
        failed = sum(self.columns["error"][row] is not None for row in rows)
        finished = sum(self._finished(row) for row in rows)
        done = len(rows)
        return RunCounts(
            self.study.max_replications, done, finished, done - failed - finished, failed
        )

    def values(self, point: Point, metric: str) -> dict[int, float]:
        """A metric by replication, of the finished runs that have it."""
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
        """The metrics in reports."""
        return (*(name for name in self.analysis.metrics if self.has(name)), *self.quantiles)

    def runs(self, point: Point, metric: str | None = None) -> Runs:
        """The digests of successful runs by seed, and with a metric also its values."""
        return self._runs_of(metric)[point.number]

    def _runs_of(self, metric: str | None) -> Sequence[Runs]:
        """The runs of each point, computed once for each metric."""
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
        """Whether two points have the same runs: equal digests for all common seeds.

        With a metric, its values must be equal, too. The comparison ends at the first difference.
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
        """For each point, the first point with exactly the same runs, possibly itself.

        This is an equivalence relation; `same` is not, since points without common seeds never agree.
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
        """For each point, the first point with the same runs, possibly itself."""
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
        """The points with the same runs as an earlier point."""
        return tuple(p for p in self.points if self.first_same[p.number] != p.number)

    def series(self, point: Point) -> list[Sequence[int]]:
        """The deliveries by window of each run that has them, by replication."""
        column = self.columns.get(SERIES_COLUMN)
        if column is None:
            return []
        return [column[row] for row in self._rows[point.number] if column[row] is not None]

    def stored(self, point: Point, *names: str) -> list[tuple[Any, ...]]:
        """Whether each run of a point is complete, and its values in these columns, if any."""
        columns = [self.columns.get(name) for name in names]
        return [
            (self._finished(row), *(None if one is None else one[row] for one in columns))
            for row in self._rows[point.number]
        ]

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
        date=latest_date(store.files()),
        warm_ups=sorted({point.warm_up for point in store.manifest.points}),
    )


def latest_date(files: Sequence[Path]) -> str:
    """The date on which the latest of some files was written; "" without files."""
    latest = max((path.stat().st_mtime for path in files), default=None)
    return "" if latest is None else datetime.fromtimestamp(latest, UTC).date().isoformat()


def columns_of(table: pa.Table) -> dict[str, Sequence[Any]]:
    """Columns as lists, with deliveries by window as arrays and without sums by stretch.

    Uses of time and periods remain Arrow columns.
    """
    from automaton.studies.sweeps.result_store import LISTS_OF_ROWS

    names = [name for name in table.column_names if name not in LISTS_OF_ROWS]
    columns: dict[str, Sequence[Any]] = {name: table.column(name).to_pylist() for name in names}
    for name in (USES_COLUMN, PERIODS_COLUMN):  # many numbers, of which few are read
        if name in table.column_names:
            columns[name] = table.column(name)
    if SERIES_COLUMN in table.column_names:
        columns[SERIES_COLUMN] = lists(table.column(SERIES_COLUMN))
    columns[TICKS_PER_SECOND] = [
        ticks / seconds if ticks is not None and seconds else None
        for ticks, seconds in zip(columns["ticks"], columns["cpu_s"], strict=True)
    ]
    return columns
