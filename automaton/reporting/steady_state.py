"""The throughput of a steady state: where the warm-up ends, what comes after it, and their table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from automaton.experiments.study import Point
from automaton.reporting.document import Block, Heading, Listed, Table, Text
from automaton.reporting.figures import RUN_HEADS, figure, run_cells
from automaton.reporting.results import Results, factor_cells, factor_heads, point_name
from automaton.reporting.same_runs import same_cells, same_heads
from automaton.statistics.intervals import Interval
from automaton.statistics.steady import (
    ENOUGH_REPLICATIONS,
    Refused,
    batch_means,
    mser5,
    replication_deletion,
)


class Steady(NamedTuple):
    """The steady throughput of a point, or why there is none."""

    cut: int | None  # ticks left out
    interval: Interval | None  # orders by 1000 ticks
    refused: str = ""


def steady_throughput(results: Results, point: Point, window: int) -> Steady | None:
    """From the deliveries in windows of so many ticks; None where runs keep none."""
    series = results.series(point)
    if not series:
        return None
    length = min(map(len, series))
    y = np.array([one[:length] for one in series], np.float64) * (1000 / window)
    declared = results.study.warm_up
    try:
        cut = mser5(y).cut if declared == "mser-5" else math.ceil((declared or 0) / window)
        if len(y) >= ENOUGH_REPLICATIONS:
            interval = replication_deletion(y, cut, 1 - results.analysis.error)
        else:
            interval = batch_means(y[:, cut:], 1 - results.analysis.error)
    except Refused as why:
        return Steady(None, None, str(why))
    except ValueError as why:
        return Steady(None, None, f"too short: {why}")
    return Steady(cut * window, interval)


def steady_section(results: Results, windows: Mapping[int, int]) -> Iterator[Block]:
    """The throughput after the warm-up, for studies of steady states."""
    if results.study.design != "steady-state" or not results.has("series"):
        return
    yield Heading("Steady throughput")
    yield Text(
        "From the deliveries in each window, without those of the warm-up; tables of throughput "
        "count whole runs."
    )
    rows, refused = [], []
    for point in results.points:
        found = steady_throughput(results, point, windows[point.number])
        cells = ["-"] * 5
        if found is not None and found.interval is not None:
            interval = found.interval
            ends = [
                "-" if end is None else figure(end)
                for end in (interval.value, interval.low, interval.high)
            ]
            cells = [*ends, f"{found.cut:,}", interval.method]
        elif found is not None:
            refused.append(f"{point_name(results.study, point)}: {found.refused}")
        cells += run_cells(results.counts(point)) + same_cells(results, point)
        rows.append([*factor_cells(results.study, point), *cells])
    heads = [*factor_heads(results.study), "orders/1000 ticks", "low", "high", "warm-up", "by"]
    heads += [*RUN_HEADS, *same_heads(results)]
    yield Table(heads, rows, left=max(1, len(factor_heads(results.study))))
    if refused:
        yield Listed(refused)
