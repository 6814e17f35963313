"""Steady states without their warm-up: one cut for all runs of a study, and their metrics after it.

The cut is the largest of what the scenarios declare (measure.warm_up) and of what MSER-5 finds at each
point, by deliveries and by the times of orders and tasks: a queue may still grow when as much is
delivered as ever will be. Where all runs were measured from there on, their own metrics hold; else
metrics follow from the sums that rows keep, after the next stretch begins, and what sums do not
tell is left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.runs.metric_sums import QUOTIENTS, metric
from automaton.scenario.unavailable_metrics import OF_DUE_TIMES, OF_TIMES
from automaton.studies.inference.steady_state import NotSteadyError, mser5, mser5_of_means
from automaton.studies.sweeps.result_columns import SERIES, SUMS_COLUMN, metric_names, sum_names

if TYPE_CHECKING:
    import pyarrow as pa

    from automaton.studies.sweeps.result_store import Store
    from automaton.studies.sweeps.study import Study

LENGTHS: Final = ("makespan", "ticks", "orders")  # of a run, whatever is left out
# A state, of which no warm-up is part.
AT_THE_END: Final = ("min_charge", "oldest_order", "starved_robots")
DELIVERED: Final = "delivered"
# Figures that grow with a queue, and the metrics that are steady only where they are.
TIMES: Final = {
    "lead_time": (*OF_TIMES, *OF_DUE_TIMES),
    "task_time": ("task_time",),
    "delay": ("delay", "delay_p95"),
}
Lists = Sequence["npt.NDArray[np.int64] | None"]  # by row


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
    table = store.rows()
    if store.study.design != "steady-state":
        return table, None
    names = [DELIVERED, *metric_names(store.manifest.counted)]
    points = np.array(table.column("point").to_pylist(), np.int64)
    planned = store.manifest.points
    declared, window = max(point.warm_up for point in planned), planned[0].windows.window
    stretch = planned[0].windows.stretch
    sums = {name: sums_column(table, name) for name in sums_of_times()}
    cut = cut_of(store.study, points, lists(table.column(SERIES)), declared, window, sums, stretch)
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
        table = table.set_column(at, field, arrow_array(kept, field.type))
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


def arrow_array(values: list[Any], type_: Any) -> Any:
    """An Arrow array."""
    import pyarrow

    return pyarrow.array(values, type_)
