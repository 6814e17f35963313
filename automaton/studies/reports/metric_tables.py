"""Tables and curves of a report: metrics by point, identical points, and steady throughput."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from automaton.documents.report_document import (
    Block,
    Curves,
    Heading,
    Listed,
    NumberText,
    ReportCurve,
    Table,
    Text,
)
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.scenario.orders import DRAWN_GENERATORS
from automaton.studies.inference.intervals import (
    MIN_RUNS,
    NO_SPREAD_WARNING,
    STUDENT_MIN_RUNS,
    TOO_FEW,
    Interval,
    mean_interval,
    skewness,
)
from automaton.studies.inference.steady_state import (
    ENOUGH_REPLICATIONS,
    NotSteadyError,
    batch_means,
    replication_deletion,
)
from automaton.studies.reports.comparisons import (
    direction_of,
    factor_cells,
    factor_heads,
    heads_by_factor,
    level_of,
    level_text,
    levels_beside,
    point_name,
    varied_columns,
)
from automaton.studies.reports.study_results import (
    MIN_SHARED_SEEDS,
    Cut,
    Results,
    RunCounts,
    described,
)
from automaton.studies.sweeps.study import RUN_METRICS, SCENARIO_FACTOR, Point
from automaton.units import count, number, percent, ticks_and_time
from automaton.world.bounds import bounds, least_ticks
from automaton.world.resolved import Resolved

MAX_SAME_RUNS_NAMED: Final = 6  # pairs of points
Scenarios = Mapping[int, Resolved]  # by number of the point; points without a file are missing
RUN_HEADS = ("runs", "unfinished", "failed")
ROBOTS_FACTOR: Final = "fleet.robots"
# Metrics of curves beside those of the analysis.
WANTED: Final = ("throughput", "makespan", "delay", "lead_time")
MAX_CURVES: Final = 8  # number of available symbols and colours


# A table of means for each metric, with one line for each point.


class Summary(NamedTuple):
    """A metric of a point."""

    point: Point
    counts: RunCounts
    interval: Interval | None  # None: no run has the metric
    sd: float | None
    skew: float  # of the runs
    bound: float | None  # bound for any strategy


def summary(results: Results, scenarios: Scenarios, point: Point, metric: str) -> Summary:
    """The mean of a metric over the finished runs, and the numbers of other runs."""
    values = list(results.values(point, metric).values())
    interval, sd = interval_of(results, metric, values), None
    if interval is not None and len(values) > 1:
        sd = math.sqrt(math.fsum((v - interval.value) ** 2 for v in values) / (len(values) - 1))
    skew = skewness(values) if values else 0.0
    return Summary(
        point, results.counts(point), interval, sd, skew, bound(scenarios, point, metric)
    )


def bias_of(results: Results, point: Point, metric: str) -> str:
    """The bias of a mean that leaves runs out: "is too low", "is too high", "may be biased"; else "".

    Unfinished runs would make it worse, and so would runs without anything to measure.
    """
    counts, better = results.counts(point), direction_of(metric)
    if not results.values(point, metric):
        return ""
    if better and counts.censored + unmeasured(results, point, metric):
        return "is too low" if better == "lowest" else "is too high"
    return "may be biased" if counts.censored + counts.failed else ""


def bias_text(results: Results, point: Point, metric: str) -> str:
    """The runs that a mean leaves out, and its bias: "3 of 20 runs did not finish; ..."; else ""."""
    counts = results.counts(point)
    reasons = (
        (counts.censored, "did not finish"),
        (counts.failed, "failed"),
        (unmeasured(results, point, metric), f"have no {metric}"),
        (counts.missing, "are not done yet"),
    )
    lost = [(runs, reason) for runs, reason in reasons if runs]
    parts = [
        f"{runs:,}{'' if at else f' of {counts.planned:,} runs'} {reason}"
        for at, (runs, reason) in enumerate(lost)
    ]
    bias = bias_of(results, point, metric)
    return ", ".join(parts) + (f"; the mean {bias}" if bias else "")


def unmeasured(results: Results, point: Point, metric: str) -> int:
    """Number of complete runs of a point without a metric, because nothing that it measures ended."""
    return results.counts(point).finished - len(results.values(point, metric))


def interval_of(results: Results, metric: str, values: Sequence[float]) -> Interval | None:
    """The mean of a metric over runs; None without runs. Metrics of the catalogue are never negative."""
    if not values:
        return None
    interval = mean_interval(values, 1 - results.analysis.error).unless_vague()
    return interval.not_below_zero() if is_ours(metric) else interval


def is_ours(metric: str) -> bool:
    """Whether a metric is built in; such metrics are never negative."""
    return metric in METRIC_CATALOGUE or metric in RUN_METRICS


def bound(scenarios: Scenarios, point: Point, metric: str) -> float | None:
    """The bound for any strategy in the unit of runs: least makespan or greatest throughput."""
    resolved = scenarios.get(point.number)
    if resolved is None:
        return None
    scenario = resolved.scenario
    of_time, of_rate = metric in ("makespan", "ticks"), metric == "throughput"
    # For drawn orders, the cheapest possible orders give a useless bound of the rate.
    drawn = scenario.orders.generator in DRAWN_GENERATORS
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
    limit = "upper bound" if metric == "throughput" else "lower bound"
    biases = [bias_of(results, one.point, metric) if one.interval else "" for one in points]
    heads = ["mean", f"{level} low", "high", "sd", *([limit] if is_bounded else [])]
    heads += ["bias"] if any(biases) else []
    rows = []
    for one, bias in zip(points, biases, strict=True):
        cells = ["-"] * 4
        if one.interval is not None:
            interval = scale.of(one.interval)
            sd = figure(None if one.sd is None else one.sd * scale.factor)
            cells = [figure(interval.value), *end_cells(interval), sd]
        cells += [limit_cell(one.bound, scale.factor)] if is_bounded else []
        rows.append(cells + ([bias.removeprefix("is ") or "-"] if any(biases) else []))
    yield point_table(results, heads, rows)
    if is_bounded:
        yield Text(
            f"{limit}: no strategy can do better. It is derived from the least effort for all orders, "
            "divided among the robots, and from the capacity of stations and chargers."
        )
    lacking = [
        f"{point_name(results.study, one.point)}: {bias_text(results, one.point, metric)}"
        for one, bias in zip(points, biases, strict=True)
        if bias
    ]
    if lacking:
        yield Listed(lacking)
    yield from warnings(results, points)


def figure(value: float | None) -> str:
    """A metric as a cell: four digits, more for large values; "-" for None."""
    if value is None:
        return "-"
    return NumberText(f"{value:,.1f}" if abs(value) >= 1000 else f"{value:.4g}", value)


def end_cells(interval: Interval, form: Callable[[float], str] = figure) -> list[str]:
    """The ends of an interval as two cells; a missing one says so if there are too few runs."""
    if interval.low is None and interval.n < MIN_RUNS:
        return [TOO_FEW, "-"]
    return ["-" if end is None else form(end) for end in (interval.low, interval.high)]


def limit_cell(bound: float | None, factor: float) -> str:
    """The bound for any strategy, as a cell of a table."""
    return "-" if bound is None else NumberText(number(bound * factor), bound * factor)


def warnings(results: Results, found: list[Summary]) -> Iterator[Block]:
    """The warnings of a table's intervals, with equal ones merged."""
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
        rest = f"{many} points have fewer than {STUDENT_MIN_RUNS} runs (fewest: {few})"
        same = (
            [f"warning: {', '.join(told[NO_SPREAD_WARNING])}: {NO_SPREAD_WARNING}"]
            if NO_SPREAD_WARNING in told
            else []
        )
        yield Listed([f"warning: {rest}. The most skewed is {told[worst][0]}: {worst}", *same])
    elif told:
        yield Listed([f"warning: {', '.join(names)}: {text}" for text, names in told.items()])


def point_table(results: Results, heads: Sequence[str], cells: Sequence[Sequence[str]]) -> Table:
    """A line for each point: its factors, these cells, its runs, and the point with the same runs."""
    factors = factor_heads(results.study)
    rows = []
    for point, own in zip(results.points, cells, strict=True):
        counts = results.counts(point)
        runs = (f"{one:,}" for one in (counts.done, counts.censored, counts.failed))
        same = same_cells(results, point)
        rows.append([*factor_cells(results.study, point), *own, *runs, *same])
    head = [*factors, *heads, *RUN_HEADS, *same_heads(results)]
    return Table(head, rows, left=max(1, len(factors)))


# Points with identical runs (equal digests), and factors without effect.


def same_heads(results: Results) -> list[str]:
    """The heading of the column about identical runs; empty if all points differ."""
    return ["same runs as"] if results.repeats else []


def same_cells(results: Results, point: Point) -> list[str]:
    """The cell under `same_heads`: the name or number of the first point with the same runs."""
    first = results.points[results.first_same[point.number]]
    cell = "-" if first.number == point.number else same_name(first)
    return [cell for _ in same_heads(results)]


def same_name(point: Point) -> str:
    """The name of a point with the same runs as another one, else its number."""
    return point.name or f"point {point.number}"


def same_remarks(results: Results) -> Iterator[str]:
    """Sentences about factors without effect, or without any, about points with identical runs."""
    inert = list(inert_factors(results)) if results.repeats and not results.study.is_named else []
    yield from inert
    if results.repeats and not inert:
        named = [
            f"{same_name(p)} and {same_name(results.points[results.first_same[p.number]])}"
            for p in results.repeats[:MAX_SAME_RUNS_NAMED]
        ]
        more = len(results.repeats) - len(named)
        rest = f"; and {more:,} more" if more else ""
        yield f"identical runs (equal digests): {'; '.join(named)}{rest}"


def inert_factors(results: Results) -> Iterator[str]:
    """Sentences about each factor whose levels give the same runs at all or at some points."""
    study = results.study
    several = [SCENARIO_FACTOR] if len(study.scenarios) > 1 else []
    for factor in [*several, *study.factor_names]:
        groups: dict[str, list[Point]] = {}
        for point in results.points:
            if factor == SCENARIO_FACTOR or factor in point.levels:
                groups.setdefault(levels_beside(point, (factor,)), []).append(point)
        compared = [group for group in groups.values() if len(group) > 1]
        same = [group for group in compared if _agree(results, group)]
        apart = [[m for m in results.reported if not _agree(results, g, m)] for g in same]
        inert = [group for group, metrics in zip(same, apart, strict=True) if not metrics]
        otherwise = [group for group, metrics in zip(same, apart, strict=True) if metrics]
        if inert:
            yield (
                f"{factor} has no effect{_where(results, inert, compared, factor)}: its levels give "
                "identical runs (equal digests) and are not compared"
            )
        if otherwise:
            differ = dict.fromkeys(metric for metrics in apart for metric in metrics)
            yield (
                f"{factor} does not change the runs{_where(results, otherwise, compared, factor)}: its "
                f"levels give identical runs (equal digests), measured differently ({', '.join(differ)})"
            )


def _agree(results: Results, group: list[Point], metric: str | None = None) -> bool:
    """Whether all of these points have the same runs and share enough seeds."""
    known: dict[int, object] = {}
    for point in group:
        for seed, run in results.runs(point, metric).items():
            if known.setdefault(seed, run) != run:
                return False
    shared = set(known).intersection(*(results.runs(point) for point in group))
    return len(shared) >= MIN_SHARED_SEEDS


def _where(
    results: Results, groups: list[list[Point]], compared: list[list[Point]], factor: str
) -> str:
    """The other levels at which a factor has no effect; "" if this holds everywhere."""
    everywhere = len(groups) == len(compared)
    return "" if everywhere else f" with {_beside(results, groups, factor)}"


def _beside(results: Results, groups: list[list[Point]], factor: str) -> str:
    """The levels of other factors that all of these groups share, or the number of groups."""
    study = results.study
    shared = [
        f"{head} {level_text(study, name, levels[0])}"
        for name, head in heads_by_factor(study).items()
        if name != factor
        and (levels := [group[0].levels.get(name) for group in groups])
        and all(level == levels[0] for level in levels)
    ]
    return ", ".join(shared) or f"{count(len(groups), 'combination')} of the other factors"


# Steady-state throughput from the deliveries after the warm-up, with intervals even from few runs.


def steady_throughput(results: Results, point: Point, cut: Cut) -> Interval | str | None:
    """Orders per 1000 ticks, or why they are unknown; None if rows have no series of deliveries.

    Computed from the throughput of each of many runs, or from the windows of a few runs.
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
    """The section on throughput after the warm-up, for steady-state studies."""
    cut = results.cut
    if cut is None or not results.has("series"):
        return
    yield Heading("Steady throughput")
    yield Text(
        f"From deliveries after the warm-up period, {ticks_and_time(cut.ticks, results.units.tick)} at "
        "all points. MSER-5: the warm-up period that MSER-5 finds at each point."
    )
    scale = results.scale("throughput")
    rows, refused = [], []
    for point in results.points:
        found = steady_throughput(results, point, cut)
        cells = ["-"] * 3
        if isinstance(found, Interval):
            interval = scale.of(found)
            cells = [figure(interval.value), *end_cells(interval)]
        elif found is not None:
            refused.append(f"{point_name(results.study, point)}: {found}")
        own = cut.found.get(point.number)
        cells += ["-" if own is None else f"{own:,}"]
        cells += [found.method if isinstance(found, Interval) else "-"]
        rows.append(cells)
    yield point_table(results, (scale.unit, "low", "high", "MSER-5, ticks", "by"), rows)
    if refused:
        yield Listed(refused)


# Curves of a metric over fleet size or another factor: one line for each combination of the other
# factors, with an interval at each point.


def curves(results: Results) -> Iterator[Curves]:
    """The curve of each metric over a numeric factor, preferably the number of robots."""
    factor = factor_of(results)
    if factor is None:
        return
    wanted: tuple[str, ...] = WANTED
    if results.study.design == "steady-state":  # all runs are equally long
        wanted = tuple(metric for metric in WANTED if metric != "makespan")
    for metric in dict.fromkeys([*results.analysis.metrics, *wanted]):
        if results.has(metric):
            yield curve(results, metric, factor)


def picture(results: Results, metric: str) -> Curves | None:
    """A metric over a numeric factor, else over the factor with most levels; None if none varies."""
    factor = factor_of(results)
    if factor is None:
        varied = [
            n
            for n in (*results.study.factor_names, SCENARIO_FACTOR)
            if len(results.study.levels(n)) > 1
        ]
        factor = max(varied, key=lambda name: len(results.study.levels(name)), default=None)
    return curve(results, metric, factor) if factor is not None and results.has(metric) else None


def factor_of(results: Results) -> str | None:
    """The factor on the x axis: the robots, else the first with several numbers as levels."""
    for name in sorted(results.study.factor_names, key=lambda name: name != ROBOTS_FACTOR):
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
        if factor == SCENARIO_FACTOR or factor in point.levels:
            groups.setdefault(levels_beside(point, (factor,)), []).append(point)
    names = () if is_numeric(results, factor) else tuple(_level_names(results, factor))
    lines = [
        line(results, metric, points, factor, names)
        for points in list(groups.values())[:MAX_CURVES]
    ]
    hidden = len(groups) - len(lines)
    title = f"{metric} by {factor}" + (f", {hidden} more not shown" if hidden else "")
    label = "robots" if factor == ROBOTS_FACTOR else factor
    unit = results.scale(metric).unit
    return Curves(title, label, unit, lines, x_names=names, from_zero=is_ours(metric))


def _level_names(results: Results, factor: str) -> list[str]:
    if factor == SCENARIO_FACTOR:
        return list(results.study.scenarios)
    return [level_text(results.study, factor, level) for level in results.study.levels(factor)]


def _others(results: Results, point: Point, factor: str) -> str:
    """The levels of a point in all other factors: "allocation independent, routing shortest"."""
    study = results.study
    heads = heads_by_factor(study)
    return ", ".join(
        f"{heads.get(name, name)} {level_of(study, point, name)}"
        for name in varied_columns(study)
        if name != factor
    )


def line(
    results: Results, metric: str, points: list[Point], factor: str, names: Sequence[str]
) -> ReportCurve:
    """One curve; `names`: names of levels that are not numbers."""
    at = {point.number: _x(results, point, factor, names) for point in points}
    points = sorted(points, key=lambda point: at[point.number])
    runs = [list(results.values(point, metric).values()) for point in points]
    intervals = [interval_of(results, metric, values) for values in runs]
    scaled = [None if one is None else results.scale(metric).of(one) for one in intervals]
    value = [math.nan if one is None else one.value for one in scaled]
    low = [math.nan if one is None or one.low is None else one.low for one in scaled]
    high = [math.nan if one is None or one.high is None else one.high for one in scaled]
    name = _others(results, points[0], factor)
    return ReportCurve(name, [at[point.number] for point in points], value, low, high)


def _x(results: Results, point: Point, factor: str, names: Sequence[str]) -> float:
    if not names:
        return float(point.levels[factor])
    return float(names.index(level_of(results.study, point, factor)))
