"""Steady states without their warm-up: one cut for all runs of a study, and their figures after it.

The cut is the largest of what the scenarios declare (measure.warm_up) and of what MSER-5 finds at each
point. Where all runs were measured from there on, their own figures hold; else figures follow from
the sums that rows keep, after the next stretch begins, and what sums do not tell is left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.experiments.keys import Manifest
from automaton.experiments.names import SERIES, STRETCHES, metric_names, sum_names
from automaton.statistics.steady import Refused, mser5
from automaton.sums import metric

if TYPE_CHECKING:
    import pyarrow as pa

    from automaton.experiments.store import Store
    from automaton.experiments.study import Study

LENGTHS: Final = ("T_total", "ticks", "orders")  # of a run, whatever is left out
AT_THE_END: Final = ("least_charge",)  # a state, of which no warm-up is part
DELIVERED: Final = "delivered"


class Cut(NamedTuple):
    """What is left out at the beginning of every run."""

    ticks: int
    window: int  # ticks in which deliveries were counted
    found: Mapping[int, int]  # point: ticks that MSER-5 leaves out there
    refused: Mapping[int, str]  # point: why it finds none there; such a point has no figures
    left_out: tuple[str, ...] = ()  # metrics of the runs that cannot be told after the cut


def measured_rows(store: Store) -> tuple[pa.Table, Cut | None]:
    """All rows; of a steady state with the figures of what comes after the cut alone."""
    table = store.rows()
    if store.study.design != "steady-state":
        return table, None
    names = [DELIVERED, *metric_names(store.manifest.counted)]
    points = np.array(table.column("point").to_pylist(), np.int64)
    planned = store.manifest.points
    declared, window = max(point.warm_up for point in planned), planned[0].windows.window
    cut = cut_of(store.study, points, lists(table.column(SERIES)), declared, window)
    if all(point.warm_up == cut.ticks for point in planned):
        figures = own_figures(table, names, cut.ticks)
    else:
        cut = cut._replace(ticks=next_stretch(store.manifest, cut.ticks))
        figures = figures_of_sums(store, table, names, cut.ticks)
    refused = np.isin(points, list(cut.refused)).tolist()
    lost = []
    for name, values in figures.items():
        field, at = table.schema.field(name), table.schema.get_field_index(name)
        before = table.column(name)
        if name in LENGTHS:
            continue
        if before.null_count < len(before) and all(value is None for value in values):
            lost.append(name)
        kept = [None if gone else value for gone, value in zip(refused, values, strict=True)]
        table = table.set_column(at, field, arrow_array(kept, field.type))
    return table, cut._replace(left_out=tuple(lost))


def cut_of(
    study: Study,
    points: npt.NDArray[np.int64],
    series: Sequence[Any],
    declared: int,
    window: int,
) -> Cut:
    """One cut for all points, from the deliveries by window of each row and the point that it is of.

    `declared`: the most that a scenario leaves out.
    """
    found: dict[int, int] = {}
    refused: dict[int, str] = {}
    if study.warm_up == "mser-5":
        for point in study.points:
            runs = [series[row] for row in np.flatnonzero(points == point.number).tolist()]
            runs = [run for run in runs if run is not None]
            try:
                if runs:
                    length = min(map(len, runs))
                    y = np.array([run[:length] for run in runs], np.float64)
                    found[point.number] = window * mser5(y).cut
            except Refused as why:
                refused[point.number] = str(why)
    return Cut(max([declared, *found.values()]), window, found, refused)


def next_stretch(manifest: Manifest, ticks: int) -> int:
    """The end of a stretch at a tick, or the first after it."""
    stretch = manifest.points[0].windows.stretch
    return math.ceil(ticks / stretch) * stretch


def own_figures(table: pa.Table, names: Sequence[str], cut: int) -> dict[str, list[Any]]:
    """The figures of runs that were measured from the cut on."""
    figures = {name: table.column(name).to_pylist() for name in names}
    ticks = table.column("ticks").to_pylist()
    figures[DELIVERED] = [  # the row's counts the whole run, as its ticks do
        None if rate is None else round(rate * (end - cut) / 1000)
        for rate, end in zip(figures["throughput"], ticks, strict=True)
    ]
    return figures


def figures_of_sums(
    store: Store, table: pa.Table, names: Sequence[str], cut: int
) -> dict[str, list[Any]]:
    """The figures of runs by their sums after the cut."""
    import pyarrow.compute as pc

    first = cut // store.manifest.points[0].windows.stretch
    kept = sum_names(store.manifest.counted)
    column = table.column(STRETCHES)
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
