"""The metrics of a report: for each a table of means with one line for each point."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.report_document import (
    Block,
    Heading,
    Listed,
    NumberText,
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
from automaton.studies.reports.point_names import (
    factor_cells,
    factor_heads,
    point_name,
)
from automaton.studies.reports.reader_units import described
from automaton.studies.reports.same_runs import same_cells, same_heads
from automaton.studies.reports.study_results import Counts, Results
from automaton.studies.sweeps.result_columns import RUN_METRICS
from automaton.studies.sweeps.study import Point
from automaton.units import count, number, percent
from automaton.world.bounds import bounds, least_ticks
from automaton.world.resolve import Resolved

Scenarios = Mapping[int, Resolved]  # by number of the point; none where a file is not found
RUN_HEADS = ("runs", "unfinished", "failed")


class Summary(NamedTuple):
    """A metric of a point."""

    point: Point
    counts: Counts
    interval: Interval | None  # None: no run has a metric
    sd: float | None
    skew: float  # of the runs
    bound: float | None  # what no strategy can beat


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
    return interval.not_below_zero() if is_ours(metric) else interval


def is_ours(metric: str) -> bool:
    """Whether a metric is one of the catalogue: a quantity, which is never negative."""
    return metric in METRIC_CATALOGUE or metric in RUN_METRICS


def bound(scenarios: Scenarios, point: Point, metric: str) -> float | None:
    """What no strategy can beat, in the unit of runs: the least makespan, the most throughput."""
    resolved = scenarios.get(point.number)
    if resolved is None:
        return None
    scenario = resolved.scenario
    of_time, of_rate = metric in ("makespan", "ticks"), metric == "throughput"
    # Of orders that are drawn the cheapest possible say next to nothing of the rate of these.
    drawn = scenario.orders.generator in DRAWN
    if scenario.stop.when == "never" or not (of_time or of_rate) or (of_rate and drawn):
        return None
    found = bounds(resolved)
    least, _ = least_ticks(found, scenario.fleet.robots)
    if of_time:
        return least
    return 1000 * found.orders / least if least else None


def metric_section(results: Results, scenarios: Scenarios, metric: str) -> Iterator[Block]:
    """A table of a metric, one line for each point."""
    _, meaning = described(metric)
    scale = results.scale(metric)
    yield Heading(metric, 3)
    yield Text(f"{meaning} ({scale.unit})")
    points = [summary(results, scenarios, point, metric) for point in results.points]
    is_bounded = any(one.bound is not None for one in points)
    level = percent(1 - results.analysis.error, 0)
    limit = "most" if metric == "throughput" else "least"
    heads = ["mean", f"{level} low", "high", "sd", *([limit] if is_bounded else [])]
    rows = []
    for one in points:
        cells = ["-"] * 4
        if one.interval is not None:
            interval = scale.of(one.interval)
            ends = [figure(end) for end in (interval.value, interval.low, interval.high)]
            cells = [*ends, figure(None if one.sd is None else one.sd * scale.factor)]
        rows.append([*cells, *([limit_cell(one.bound, scale.factor)] if is_bounded else [])])
    yield point_table(results, heads, rows)
    if is_bounded:
        yield Text(
            f"{limit}: no strategy can do better; by the work of the orders over the robots, each "
            "the cheapest way, and by what stations and chargers can do"
        )
    lacking = [
        f"{point_name(results.study, one.point)}: {without} of "
        f"{count(one.counts.finished, 'run')} without {metric}, since nothing ended that it is "
        "measured by; the mean is of the others"
        for one in points
        if one.interval is not None and (without := one.counts.finished - one.interval.n)
    ]
    if lacking:
        yield Listed(lacking)
    yield from warnings(results, points)


def limit_cell(bound: float | None, factor: float) -> str:
    """What no strategy can beat, as a cell of a table."""
    return "-" if bound is None else NumberText(number(bound * factor), bound * factor)


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


def figure(value: float | None) -> str:
    """A metric of a table: four digits, more for large ones; "-" where there is none."""
    if value is None:
        return "-"
    return NumberText(f"{value:,.1f}" if abs(value) >= 1000 else f"{value:.4g}", value)
