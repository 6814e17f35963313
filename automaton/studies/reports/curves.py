"""Curves over the size of the fleet, one for each combination of the other factors."""

from __future__ import annotations

import math
from collections.abc import Iterator

from automaton.studies.reports.metric_tables import interval_of
from automaton.studies.reports.report_document import Curves, Line
from automaton.studies.reports.study_results import (
    Results,
    described,
    factor_cells,
    factor_heads,
    levels_beside,
)
from automaton.studies.sweeps.study import Point

ROBOTS = "fleet.robots"
WANTED = ("throughput", "makespan", "delay", "lead_time")  # beside the metrics of the analysis
MAX_CURVES = 8  # signs and colours that there are


def curves(results: Results) -> Iterator[Curves]:
    """For each metric its curve over a factor of numbers: the robots if they vary."""
    factor = factor_of(results)
    if factor is None:
        return
    wanted: tuple[str, ...] = WANTED
    if results.study.design == "steady-state":  # all runs are as long
        wanted = tuple(metric for metric in WANTED if metric != "makespan")
    for metric in dict.fromkeys([*results.analysis.metrics, *wanted]):
        if results.has(metric):
            yield curve(results, metric, factor)


def factor_of(results: Results) -> str | None:
    """The factor on the x axis: the robots, else the first with several numbers as levels."""
    names = results.study.factor_names
    for name in sorted(names, key=lambda name: name != ROBOTS):
        levels = results.study.levels(name)
        numbers = all(isinstance(x, int | float) and not isinstance(x, bool) for x in levels)
        if numbers and len(levels) > 1:
            return name
    return None


def curve(results: Results, metric: str, factor: str) -> Curves:
    """A metric over a factor."""
    groups: dict[str, list[Point]] = {}
    for point in results.points:
        if factor in point.levels:
            groups.setdefault(levels_beside(point, (factor,)), []).append(point)
    lines = [
        line(results, metric, sorted(points, key=lambda p: p.levels[factor]), factor)
        for points in list(groups.values())[:MAX_CURVES]
    ]
    left_out = len(groups) - len(lines)
    title = f"{metric} by {factor}" + (f", {left_out} more not shown" if left_out else "")
    unit = described(metric)[0]
    label = "robots" if factor == ROBOTS else factor
    return Curves(title, label, unit, lines)


def _others(results: Results, point: Point, factor: str) -> str:
    heads, cells = factor_heads(results.study), factor_cells(results.study, point)
    several = len(heads) - len(results.study.factor_names)  # 1: the scenario comes first
    at = several + results.study.factor_names.index(factor)
    return ", ".join(cell for index, cell in enumerate(cells) if index != at)


def line(results: Results, metric: str, points: list[Point], factor: str) -> Line:
    """One curve."""
    runs = [list(results.values(point, metric).values()) for point in points]
    found = [interval_of(results, values) for values in runs]
    value = [math.nan if one is None else one.value for one in found]
    low = [math.nan if one is None or one.low is None else one.low for one in found]
    high = [math.nan if one is None or one.high is None else one.high for one in found]
    name = _others(results, points[0], factor)
    return Line(name, [float(point.levels[factor]) for point in points], value, low, high)
