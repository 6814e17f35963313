"""The metrics of a report: for each a table of means with one line for each point, and curves.

Curves go over the size of the fleet, one for each combination of the other factors.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from automaton.build.bounds import bounds, least_ticks
from automaton.build.resolve import Resolved
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.report_document import (
    Block,
    Curves,
    Heading,
    Line,
    Listed,
    Table,
    Text,
)
from automaton.scenario.orders import DRAWN
from automaton.studies.inference.intervals import (
    NO_SPREAD_WARNING,
    STUDENT_MIN_RUNS,
    Interval,
    mean_interval,
    skewness,
)
from automaton.studies.reports.study_results import (
    Counts,
    Results,
    described,
    factor_cells,
    factor_heads,
    levels_beside,
    point_name,
    same_cells,
    same_heads,
)
from automaton.studies.sweeps.result_columns import RUN_METRICS
from automaton.studies.sweeps.study import Point
from automaton.units import count, number, percent

Scenarios = Mapping[int, Resolved]  # by number of the point; none where a file is not found
RUN_HEADS = ("runs", "unfinished", "failed")


class Summary(NamedTuple):
    """A metric of a point."""

    point: Point
    counts: Counts
    interval: Interval | None  # None: no run has a metric
    sd: float | None
    skew: float  # of the runs
    bound: str  # what no strategy can beat, or ""


def summary(results: Results, scenarios: Scenarios, point: Point, metric: str) -> Summary:
    """The mean of a metric over the runs that finished, and what became of the others."""
    values = list(results.values(point, metric).values())
    interval, sd = interval_of(results, metric, values), None
    if interval is not None and len(values) > 1:
        sd = math.sqrt(math.fsum((v - interval.value) ** 2 for v in values) / (len(values) - 1))
    skew = skewness(values) if values else 0.0
    return Summary(
        point, results.counts(point), interval, sd, skew, bound(scenarios, point, metric)
    )


def interval_of(results: Results, metric: str, values: Sequence[float]) -> Interval | None:
    """The mean of a metric over runs; None without any. No metric of ours is ever negative."""
    if not values:
        return None
    interval = mean_interval(values, 1 - results.analysis.error)
    is_ours = metric in METRIC_CATALOGUE or metric in RUN_METRICS
    return interval.not_below_zero() if is_ours else interval


def bound(scenarios: Scenarios, point: Point, metric: str) -> str:
    """What no strategy can beat: the least makespan, the most throughput; or ""."""
    resolved = scenarios.get(point.number)
    if resolved is None:
        return ""
    scenario = resolved.scenario
    of_time, of_rate = metric in ("makespan", "ticks"), metric == "throughput"
    # Of orders that are drawn the cheapest possible say next to nothing of the rate of these.
    drawn = scenario.orders.generator in DRAWN
    if scenario.stop.when == "never" or not (of_time or of_rate) or (of_rate and drawn):
        return ""
    found = bounds(resolved)
    least, _ = least_ticks(found, scenario.fleet.robots)
    if of_time:
        return number(least)
    return number(1000 * found.orders / least) if least else ""


def metric_section(results: Results, scenarios: Scenarios, metric: str) -> Iterator[Block]:
    """A table of a metric, one line for each point."""
    unit, meaning = described(metric)
    yield Heading(metric, 3)
    yield Text(f"{meaning} ({unit})")
    found = [summary(results, scenarios, point, metric) for point in results.points]
    bounded = any(one.bound for one in found)
    level = percent(1 - results.analysis.error, 0)
    heads = ["mean", f"{level} low", "high", "sd", "by"]
    limit = "most" if metric == "throughput" else "least"
    heads += [limit] if bounded else []
    rows = []
    for one in found:
        interval = one.interval
        cells = ["-"] * 5
        if interval is not None:
            ends = ["-" if end is None else figure(end) for end in (interval.low, interval.high)]
            sd = "-" if one.sd is None else figure(one.sd)
            cells = [figure(interval.value), *ends, sd, interval.method]
        rows.append([*cells, *([one.bound or "-"] if bounded else [])])
    yield point_table(results, heads, rows)
    if bounded:
        yield Text(
            f"{limit}: no strategy can do better; by the work of the orders over the robots, each "
            "the cheapest way, and by what stations and chargers can do"
        )
    lacking = [
        f"{point_name(results.study, one.point)}: {without} of "
        f"{count(one.counts.finished, 'run')} without {metric}, since nothing ended that it is "
        "measured by; the mean is of the others"
        for one in found
        if one.interval is not None and (without := one.counts.finished - one.interval.n)
    ]
    if lacking:
        yield Listed(lacking)
    yield from warnings(results, found)


def warnings(results: Results, found: list[Summary]) -> Iterator[Block]:
    """The warnings of a table's intervals: equal ones once."""
    told: dict[str, list[str]] = {}
    skews: dict[str, float] = {}
    for one in found:
        if one.interval is not None and (text := one.interval.warning):
            told.setdefault(text, []).append(point_name(results.study, one.point))
            skews.setdefault(text, abs(one.skew))
    if len(told.keys() - {NO_SPREAD_WARNING}) > 3:
        few = min(one.interval.n for one in found if one.interval is not None)
        worst = max(told, key=skews.__getitem__)
        many = sum(one.interval is not None and one.interval.n < STUDENT_MIN_RUNS for one in found)
        rest = f"{many} points have fewer than {STUDENT_MIN_RUNS} runs (least {few}); the most skewed: "
        same = (
            [f"warning: {', '.join(told[NO_SPREAD_WARNING])}: {NO_SPREAD_WARNING}"]
            if NO_SPREAD_WARNING in told
            else []
        )
        yield Listed([f"warning: {rest}{told[worst][0]}: {worst}", *same])
    elif told:
        yield Listed([f"warning: {', '.join(names)}: {text}" for text, names in told.items()])


def point_table(results: Results, heads: Sequence[str], cells: Sequence[Sequence[str]]) -> Table:
    """A line for each point: its factors, these cells, its runs, and of which point they are."""
    factors = factor_heads(results.study)
    rows = []
    for point, own in zip(results.points, cells, strict=True):
        counts = results.counts(point)
        runs = (f"{one:,}" for one in (counts.done, counts.censored, counts.failed))
        same = same_cells(results, point)
        rows.append([*factor_cells(results.study, point), *own, *runs, *same])
    head = [*factors, *heads, *RUN_HEADS, *same_heads(results)]
    return Table(head, rows, left=max(1, len(factors)))


def figure(value: float) -> str:
    """A metric of a table: four digits, more for large ones."""
    return f"{value:,.1f}" if abs(value) >= 1000 else f"{value:.4g}"


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
    found = [interval_of(results, metric, values) for values in runs]
    value = [math.nan if one is None else one.value for one in found]
    low = [math.nan if one is None or one.low is None else one.low for one in found]
    high = [math.nan if one is None or one.high is None else one.high for one in found]
    name = _others(results, points[0], factor)
    return Line(name, [float(point.levels[factor]) for point in points], value, low, high)
