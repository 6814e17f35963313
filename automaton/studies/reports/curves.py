"""The curves of a report: a metric over the size of the fleet, or over another factor.

One line for each combination of the other factors, with its interval at each point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from automaton.runs.report_document import Curves, Line
from automaton.studies.reports.metric_tables import interval_of, is_ours
from automaton.studies.reports.point_names import (
    heads_by_factor,
    level_of,
    level_text,
    levels_beside,
    varied_factors,
)
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import SCENARIO, Point

ROBOTS: Final = "fleet.robots"
# Beside the metrics of the analysis.
WANTED: Final = ("throughput", "makespan", "delay", "lead_time")
MAX_CURVES: Final = 8  # signs and colours that there are


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


def picture(results: Results, metric: str) -> Curves | None:
    """A metric over a factor of numbers, else over the factor with most levels; None if none varies."""
    factor = factor_of(results)
    if factor is None:
        varied = [
            n for n in (*results.study.factor_names, SCENARIO) if len(results.study.levels(n)) > 1
        ]
        factor = max(varied, key=lambda name: len(results.study.levels(name)), default=None)
    return curve(results, metric, factor) if factor is not None and results.has(metric) else None


def factor_of(results: Results) -> str | None:
    """The factor on the x axis: the robots, else the first with several numbers as levels."""
    for name in sorted(results.study.factor_names, key=lambda name: name != ROBOTS):
        if is_numeric(results, name) and len(results.study.levels(name)) > 1:
            return name
    return None


def is_numeric(results: Results, factor: str) -> bool:
    """Whether all levels of a factor are numbers."""
    return all(
        isinstance(level, int | float) and not isinstance(level, bool)
        for level in results.study.levels(factor)
    )


def curve(results: Results, metric: str, factor: str) -> Curves:
    """A metric over a factor, in the unit of the reader."""
    groups: dict[str, list[Point]] = {}
    for point in results.points:
        if factor == SCENARIO or factor in point.levels:
            groups.setdefault(levels_beside(point, (factor,)), []).append(point)
    names = () if is_numeric(results, factor) else tuple(_level_names(results, factor))
    lines = [
        line(results, metric, points, factor, names)
        for points in list(groups.values())[:MAX_CURVES]
    ]
    hidden = len(groups) - len(lines)
    title = f"{metric} by {factor}" + (f", {hidden} more not shown" if hidden else "")
    label = "robots" if factor == ROBOTS else factor
    unit = results.scale(metric).unit
    return Curves(title, label, unit, lines, x_names=names, from_zero=is_ours(metric))


def _level_names(results: Results, factor: str) -> list[str]:
    if factor == SCENARIO:
        return list(results.study.scenarios)
    return [level_text(results.study, factor, level) for level in results.study.levels(factor)]


def _others(results: Results, point: Point, factor: str) -> str:
    """The levels of a point but for this factor's: "allocation independent, routing shortest"."""
    study = results.study
    several = [SCENARIO] if len(study.scenarios) > 1 else []
    heads = heads_by_factor(study)
    return ", ".join(
        f"{heads.get(name, name)} {level_of(study, point, name)}"
        for name in [*several, *varied_factors(study)]
        if name != factor
    )


def line(
    results: Results, metric: str, points: list[Point], factor: str, names: Sequence[str]
) -> Line:
    """One curve; `names` of levels that are not numbers."""
    at = {point.number: _x(results, point, factor, names) for point in points}
    points = sorted(points, key=lambda point: at[point.number])
    runs = [list(results.values(point, metric).values()) for point in points]
    intervals = [interval_of(results, metric, values) for values in runs]
    scaled = [None if one is None else results.scale(metric).of(one) for one in intervals]
    value = [math.nan if one is None else one.value for one in scaled]
    low = [math.nan if one is None or one.low is None else one.low for one in scaled]
    high = [math.nan if one is None or one.high is None else one.high for one in scaled]
    name = _others(results, points[0], factor)
    return Line(name, [at[point.number] for point in points], value, low, high)


def _x(results: Results, point: Point, factor: str, names: Sequence[str]) -> float:
    if not names:
        return float(point.levels[factor])
    return float(names.index(level_of(results.study, point, factor)))
