"""The sections of a report: design, runs, figures, comparisons, steady states."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from automaton.experiments.study import Point
from automaton.reporting.comparing import (
    Compared,
    comparisons,
    pairing_remark,
    precision_remark,
)
from automaton.reporting.document import Block, Heading, Listed, Table, Text
from automaton.reporting.results import (
    Counts,
    Results,
    described,
    factor_cells,
    factor_heads,
    level_text,
    levels_apart,
    point_name,
)
from automaton.reporting.steady_state import steady_throughput
from automaton.scenario.bounds import bounds, least_ticks, most_throughput
from automaton.scenario.resolve import Resolved
from automaton.statistics.intervals import ENOUGH, SAME, Interval, mean_interval
from automaton.units import count, number, percent

Scenarios = Mapping[int, Resolved]  # by number of the point; none where a file is not found
RUN_HEADS = ("runs", "unfinished", "failed")


class Summary(NamedTuple):
    """A metric of a point."""

    point: Point
    counts: Counts
    interval: Interval | None  # None: no run has a figure
    sd: float | None
    bound: str  # what no strategy can beat, or ""


def summary(results: Results, scenarios: Scenarios, point: Point, metric: str) -> Summary:
    """The mean of a metric over the runs that finished, and what became of the others."""
    values = list(results.values(point, metric).values())
    interval = mean_interval(values, 1 - results.analysis.error) if values else None
    sd = None
    if interval is not None and len(values) > 1:
        sd = math.sqrt(math.fsum((v - interval.value) ** 2 for v in values) / (len(values) - 1))
    return Summary(point, results.counts(point), interval, sd, bound(scenarios, point, metric))


def bound(scenarios: Scenarios, point: Point, metric: str) -> str:
    """What no strategy can beat: the least T_total, the most throughput; or ""."""
    resolved = scenarios.get(point.number)
    if resolved is None:
        return ""
    robots = resolved.scenario.fleet.robots
    if metric in ("T_total", "ticks") and resolved.scenario.stop.when != "never":
        return number(least_ticks(bounds(resolved), robots)[0])
    if metric == "throughput":
        most, _ = most_throughput(bounds(resolved), robots)
        return number(most) if math.isfinite(most) else ""
    return ""


def design(results: Results, scenarios: Scenarios) -> Iterator[Block]:
    """What was asked, and how it was made: all that another one needs to judge it."""
    study, analysis = results.study, results.analysis
    endings = "steady-state" if study.design == "steady-state" else "terminating"
    warm_up = "none: whole runs count"
    if study.warm_up == "mser-5":
        warm_up = "found by MSER-5 over at least 5 replications"
    elif study.warm_up is not None:
        warm_up = f"the first {study.warm_up:,} ticks are left out, as declared"
    seeds = "replication r has the seed hash(study seed, r)"
    common = "the same for every point" if study.common_random_numbers else "one for each point"
    varied = [name for name in study.factor_names if name.startswith("durations.")]
    rows = [
        ["estimand", "mean of each metric over runs with seeds of their own, those that finish"],
        ["design", f"{endings}; {count(len(study.points), 'point')}, {runs_planned(results)}"],
        ["runs", fixed(results)],
        ["seeds", f"study seed {study.seed}; {seeds}, {common}"],
        ["warm-up", warm_up],
        ["intervals", f"{percent(1 - analysis.error, 0)}; Student's from 60 runs on, below BCa"],
        ["comparisons", family(results)],
        ["durations", f"varied: {', '.join(varied)}" if varied else "not varied by this study"],
        [
            "ticks",
            ", ".join(sorted({f"1 tick = {s.scenario.units.tick}" for s in scenarios.values()}))
            or "-",
        ],
        [
            "code",
            f"{results.version}; {', '.join(f'{k} {v}' for k, v in results.versions.items())}",
        ],
    ]
    yield Heading("Design")
    yield Table(("what", "how"), rows, left=2)
    for name in study.factor_names:
        levels = ", ".join(level_text(level) for level in study.levels(name))
        yield Text(f"Factor {name}: {levels}")


def runs_planned(results: Results) -> str:
    """Runs by point and in all."""
    study = results.study
    return f"{count(study.replications, 'run')} each, {count(study.runs, 'run')} in all"


def fixed(results: Results) -> str:
    """Whether the number of runs was declared before any was made."""
    if not results.raised:
        return "n fixed beforehand"
    before = ", then ".join(map(str, results.raised))
    return (
        f"n not fixed beforehand: raised from {before} after runs had been made; if their figures "
        "were the reason, intervals and p values say too much"
    )


def family(results: Results) -> str:
    """What is compared with what, corrected how."""
    analysis = results.analysis
    if analysis.comparisons == "none":
        return "none declared"
    what = "all pairs of points"
    if analysis.comparisons == "baseline" and analysis.baseline:
        what = "against " + ", ".join(f"{k} {v}" for k, v in analysis.baseline.items())
    pairs = "paired by replication" if analysis.paired else "not paired"
    scope = "each metric" if analysis.family == "metric" else "the whole study"
    return f"{what}, {pairs}; family: {scope}, p by Holm, intervals by Bonferroni"


def remarks(results: Results) -> Iterator[str]:
    """What a reader must know before the tables."""
    counts = [results.counts(point) for point in results.points]
    missing, censored, failed = (
        sum(getattr(one, name) for one in counts) for name in ("missing", "censored", "failed")
    )
    if missing:
        yield f"{count(missing, 'run')} of {results.study.runs:,} not done yet: figures may change"
    if censored:
        yield (
            f"{count(censored, 'run')} did not finish within the limit; means leave them out, and so "
            "favour points that have some"
        )
    if failed:
        reasons = {reason for reason in results.columns["failed"] if reason}
        yield f"{count(failed, 'run')} failed and have no figures: {'; '.join(sorted(reasons)[:3])}"
    if results.earlier:
        yield (
            f"the analysis or warm-up was changed {count(results.earlier, 'time')} after runs had been "
            "made: what it finds is a lead, not a test"
        )
    if results.damaged:
        yield f"damaged and left out: {', '.join(results.damaged)}; sweep again to repair"


def metric_section(results: Results, scenarios: Scenarios, metric: str) -> Iterator[Block]:
    """A table of a metric, one line for each point."""
    unit, meaning = described(metric)
    yield Heading(metric, 3)
    yield Text(f"{meaning} ({unit})")
    found = [summary(results, scenarios, point, metric) for point in results.points]
    bounded = any(one.bound for one in found)
    level = percent(1 - results.analysis.error, 0)
    heads = [*factor_heads(results.study), "mean", f"{level} low", "high", "sd", "by"]
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
        cells += [one.bound or "-"] if bounded else []
        rows.append([*factor_cells(results.study, one.point), *cells, *run_cells(one.counts)])
    left = len(factor_heads(results.study))
    yield Table([*heads, *RUN_HEADS], rows, left=max(1, left))
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
    for one in found:
        if one.interval is not None and one.interval.warning:
            told.setdefault(one.interval.warning, []).append(point_name(results.study, one.point))
    if len(told.keys() - {SAME}) > 3:
        few = min(one.interval.n for one in found if one.interval is not None)
        worst = max(told, key=lambda text: abs(skew_in(text)))
        many = sum(one.interval is not None and one.interval.n < ENOUGH for one in found)
        rest = f"{many} points have fewer than {ENOUGH} runs (least {few}); the most skewed: "
        same = [f"warning: {', '.join(told[SAME])}: {SAME}"] if SAME in told else []
        yield Listed([f"warning: {rest}{told[worst][0]}: {worst}", *same])
    elif told:
        yield Listed([f"warning: {', '.join(names)}: {text}" for text, names in told.items()])


def skew_in(warning: str) -> float:
    """The skew that a warning names."""
    after = warning.partition("skew ")[2].partition(":")[0]
    try:
        return float(after)
    except ValueError:
        return 0.0


def run_cells(counts: Counts) -> list[str]:
    """Under RUN_HEADS."""
    return [f"{one:,}" for one in (counts.done, counts.censored, counts.failed)]


def figure(value: float) -> str:
    """A figure of a table: four digits, more for large ones."""
    return f"{value:,.1f}" if abs(value) >= 1000 else f"{value:.4g}"


def comparison_section(results: Results) -> Iterator[Block]:
    """The declared comparisons."""
    if results.analysis.comparisons == "none":
        return
    compared = comparisons(results)
    yield Heading("Comparisons")
    if not compared:
        yield Text("None can be made: two finished runs of each point are needed.")
        return
    yield Text(comparison_text(results, compared))
    yield comparison_table(results, compared)
    remark = pairing_remark(compared, results.analysis.paired)
    if remark:
        yield Text(remark)
    takes = precision_remark(compared, results.analysis.precision)
    if takes:
        yield Text(takes)
    same = sum(one.effect.difference.warning == SAME for one in compared)
    small = sum(bool(one.effect.difference.warning) for one in compared) - same
    if small:
        yield Text(
            f"Warning: {small} of these intervals rest on fewer than {ENOUGH} runs and may hold the "
            "truth less often than they say."
        )
    if same:
        yield Text(
            f"Warning: in {same} of these comparisons all runs of a point gave the same: without "
            "spread the interval has no width, and p is that of a permutation test."
        )


def comparison_text(results: Results, compared: list[Compared]) -> str:
    """How to read the table."""
    sizes = sorted({one.family for one in compared})
    families = " and ".join(f"{size}" for size in sizes)
    return (
        f"Differences of means, {family(results)}; comparisons in the family: {families}. Holm's p "
        f"decides: below {results.analysis.error:g} it is an effect. Intervals say how large it is; "
        f"those of a family hold together with {percent(1 - results.analysis.error, 0)}. They come by "
        "another method and may hold 0 where p is below, or leave it out where p is above."
    )


def comparison_table(results: Results, compared: list[Compared]) -> Table:
    """One line for each comparison."""
    study = results.study
    heads = ["metric", *factor_heads(study), "against", "difference", "low", "high"]
    heads += ["relative", "p Holm", "correlation", "var. ratio"]
    planned = results.analysis.precision is not None
    heads += ["needs paired", "unpaired"] if planned else []
    heads += RUN_HEADS
    rows = []
    for one in compared:
        found = one.effect
        ends = (found.difference.value, found.difference.low, found.difference.high)
        both = [results.counts(point) for point in (one.a, one.b)]
        rows.append(
            [
                one.metric,
                *factor_cells(study, one.a),
                levels_apart(study, one.a, one.b),
                *("-" if end is None else f"{end:+,.4g}" for end in ends),
                relative_text(found.relative),
                "<0.0001" if one.adjusted < 1e-4 else f"{one.adjusted:.4f}",
                "-" if found.correlation is None else f"{found.correlation:+.2f}",
                "-" if found.variance_ratio is None else f"{found.variance_ratio:.2f}",
                *needed_cells(one, planned),
                f"{one.runs[0]}, {one.runs[1]}",
                f"{both[0].censored}, {both[1].censored}",
                f"{both[0].failed}, {both[1].failed}",
            ]
        )
    return Table(heads, rows, left=2 + len(factor_heads(study)))


def needed_cells(one: Compared, planned: bool) -> list[str]:
    """Runs that the declared precision takes, paired and not; nothing if none is declared."""
    if not planned:
        return []
    return ["-"] * 2 if one.needed is None else [f"{runs:,}" for runs in one.needed]


def relative_text(relative: Interval | None) -> str:
    """A relative effect with its interval, in percent."""
    if relative is None or relative.low is None or relative.high is None:
        return "-"
    low, high = 100 * relative.low, 100 * relative.high
    return f"{100 * relative.value:+.1f} % ({low:+.1f} to {high:+.1f})"


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
        rows.append(
            [*factor_cells(results.study, point), *cells, *run_cells(results.counts(point))]
        )
    heads = [*factor_heads(results.study), "orders/1000 ticks", "low", "high", "warm-up", "by"]
    yield Table([*heads, *RUN_HEADS], rows, left=max(1, len(factor_heads(results.study))))
    if refused:
        yield Listed(refused)
