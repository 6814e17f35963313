"""The throughput of a steady state: where the warm-up ends, and what comes after it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from automaton.experiments.study import Point
from automaton.reporting.results import Results
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
    rule: str
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
    rule = "MSER-5" if declared == "mser-5" else "as declared"
    try:
        cut = mser5(y).cut if declared == "mser-5" else math.ceil((declared or 0) / window)
        if len(y) >= ENOUGH_REPLICATIONS:
            interval = replication_deletion(y, cut, 1 - results.analysis.error)
        else:
            interval = batch_means(y[:, cut:], 1 - results.analysis.error)
    except Refused as why:
        return Steady(None, rule, None, str(why))
    except ValueError as why:
        return Steady(None, rule, None, f"too short: {why}")
    return Steady(cut * window, rule, interval)
