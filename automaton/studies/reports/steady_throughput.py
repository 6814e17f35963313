"""The throughput of a steady state by the deliveries after the warm-up: intervals from few runs, too."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from automaton.runs.report_document import Block, Heading, Listed, Text
from automaton.studies.inference.intervals import Interval
from automaton.studies.inference.steady_state import (
    ENOUGH_REPLICATIONS,
    NotSteadyError,
    batch_means,
    replication_deletion,
)
from automaton.studies.reports.metric_tables import figure, point_table
from automaton.studies.reports.point_names import point_name
from automaton.studies.reports.study_results import Results
from automaton.studies.reports.warm_up_cut import Cut
from automaton.studies.sweeps.study import Point
from automaton.units import ticks_and_time


def steady_throughput(results: Results, point: Point, cut: Cut) -> Interval | str | None:
    """Orders by 1000 ticks, or why that is not known; None where runs keep no deliveries.

    By the throughput of each of many runs, or by the windows of a few.
    """
    if point.number in cut.refused:
        return cut.refused[point.number]
    series = results.series(point)
    if not series:
        return None
    level = 1 - results.analysis.error
    try:
        if len(series) >= ENOUGH_REPLICATIONS:
            runs = [[value] for value in results.values(point, "throughput").values()]
            return replication_deletion(runs, 0, level).not_below_zero()
        length, first = min(map(len, series)), math.ceil(cut.ticks / cut.window)
        y = np.array([one[first:length] for one in series], np.float64) * (1000 / cut.window)
        return batch_means(y, level).not_below_zero()
    except NotSteadyError as why:
        return str(why)
    except ValueError as why:
        return f"too short: {why}"


def steady_section(results: Results) -> Iterator[Block]:
    """The throughput after the warm-up, for studies of steady states."""
    cut = results.cut
    if cut is None or not results.has("series"):
        return
    yield Heading("Steady throughput")
    yield Text(
        f"From the deliveries after the first {ticks_and_time(cut.ticks, results.units.tick)}, which are "
        "left out at all points; "
        "beside it what MSER-5 would leave out at each."
    )
    scale = results.scale("throughput")
    rows, refused = [], []
    for point in results.points:
        found = steady_throughput(results, point, cut)
        cells = ["-"] * 3
        if isinstance(found, Interval):
            interval = scale.of(found)
            cells = [figure(end) for end in (interval.value, interval.low, interval.high)]
        elif found is not None:
            refused.append(f"{point_name(results.study, point)}: {found}")
        own = cut.found.get(point.number)
        cells += ["-" if own is None else f"{own:,}"]
        cells += [found.method if isinstance(found, Interval) else "-"]
        rows.append(cells)
    yield point_table(results, (scale.unit, "low", "high", "MSER-5, ticks", "by"), rows)
    if refused:
        yield Listed(refused)
