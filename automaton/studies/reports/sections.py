"""The sections of a report around its figures: the design, remarks, the declared comparisons.

And the throughput of a steady state by the deliveries after the warm-up: intervals from few runs, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from automaton.runs.metric_catalogue import PER_1000_TICKS
from automaton.runs.report_document import Block, Heading, Listed, Table, Text
from automaton.scenario.unavailable_metrics import warm_up_of
from automaton.studies.inference.intervals import NO_SPREAD_WARNING, STUDENT_MIN_RUNS, Interval
from automaton.studies.inference.steady_state import (
    ENOUGH_REPLICATIONS,
    NotSteadyError,
    batch_means,
    replication_deletion,
)
from automaton.studies.reports.comparisons import (
    Comparison,
    comparisons,
    declared_pairs,
    left_out,
    pairing_remark,
    precision_remark,
)
from automaton.studies.reports.metric_tables import RUN_HEADS, Scenarios, figure, point_table
from automaton.studies.reports.precision import stopping_remarks, stopping_text
from automaton.studies.reports.study_results import (
    Results,
    factor_cells,
    factor_heads,
    level_text,
    levels_apart,
    point_name,
    same_remarks,
)
from automaton.studies.reports.warm_up_cut import Cut
from automaton.studies.sweeps.study import Point
from automaton.units import count, percent

INTERVALS: Final = f"Student's, with a warning on skew below {STUDENT_MIN_RUNS} runs"

MAX_WARNINGS_NAMED: Final = 6  # points
NO_WARM_UP: Final = "none: whole runs count"


def design(results: Results, scenarios: Scenarios) -> Iterator[Block]:
    """What was asked, and how it was made: all that another one needs to judge it."""
    study, analysis = results.study, results.analysis
    endings = "steady-state" if study.design == "steady-state" else "terminating"
    seeds = "replication r has the seed hash(study seed, r)"
    common = "the same for every point" if study.common_random_numbers else "one for each point"
    varied = [name for name in study.factor_names if name.startswith("durations.")]
    rows = [
        ["estimand", "mean of each metric over runs with seeds of their own, those that finish"],
        ["design", f"{endings}; {count(len(study.points), 'point')}, {runs_planned(results)}"],
        ["runs", fixed(results)],
        ["seeds", f"study seed {study.seed}; {seeds}, {common}"],
        ["warm-up", warm_up(results)],
        ["intervals", f"{percent(1 - analysis.error, 0)}; {INTERVALS}"],
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
        levels = ", ".join(level_text(study, name, level) for level in study.levels(name))
        yield Text(f"Factor {name}: {levels}")


def warm_up(results: Results) -> str:
    """What is left out of all metrics, and who says so."""
    cut, declared = results.cut, max(results.warm_ups)
    if cut is None:
        ticks = " or ".join(f"{one:,}" for one in results.warm_ups)
        return f"the first {ticks} ticks, as the scenarios say" if declared else NO_WARM_UP
    if not cut.ticks:
        return NO_WARM_UP
    of = f"the first {cut.ticks:,} ticks of every run, which count in no metric"
    if not cut.found:
        return f"{of}; declared"
    least = f", not less than the {declared:,} that scenarios declare" if declared else ""
    return (
        f"{of}: the largest that MSER-5 finds at a point, by the deliveries in windows of "
        f"{count(cut.window, 'tick')} and by the times of orders and tasks{least}"
    )


def not_cut(metrics: Sequence[str], cut: Cut) -> str:
    """Why metrics of the runs are not those of a steady state."""
    return (
        f"{', '.join(metrics)}: left out, since rows keep no sums from which the warm-up could be "
        f"taken; a study with warm_up: {cut.ticks} has runs that measure after it"
    )


def runs_planned(results: Results) -> str:
    """Runs by point and in all."""
    study = results.study
    return f"{count(study.max_replications, 'run')} each, {count(study.runs, 'run')} in all"


def fixed(results: Results) -> str:
    """Whether the number of runs was declared before any was made."""
    if results.rounds and not results.raised:
        return stopping_text(results)
    if not results.raised:
        return "n fixed beforehand"
    before = ", then ".join(map(str, results.raised))
    return (
        f"n not fixed beforehand: raised from {before} after runs had been made; if their metrics "
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
    pairs = "paired by replication" if results.study.paired else "not paired"
    scope = "each metric" if analysis.family == "metric" else "the whole study"
    wanted = (
        "" if analysis.precision is None else f"; wanted to within {percent(analysis.precision)}"
    )
    return f"{what}, {pairs}; family: {scope}, p by Holm, intervals by Bonferroni{wanted}"


def remarks(results: Results) -> Iterator[str]:
    """What a reader must know before the tables."""
    counts = [results.counts(point) for point in results.points]
    missing, censored, failed = (
        sum(getattr(one, name) for one in counts) for name in ("missing", "censored", "failed")
    )
    if missing:
        yield f"{count(missing, 'run')} of {results.study.runs:,} not done yet: metrics may change"
    if censored:
        yield (
            f"{count(censored, 'run')} did not finish within the limit; means leave them out, and so "
            "favour points that have some"
        )
    if failed:
        reasons = {reason for reason in results.columns["error"] if reason}
        yield f"{count(failed, 'run')} failed: {'; '.join(sorted(reasons)[:3])}"
    if results.earlier:
        yield (
            f"the analysis or warm-up was changed {count(results.earlier, 'time')} after runs had been "
            "made: what it finds is a lead, not a test"
        )
    cut = results.cut
    if cut is not None and not cut.ticks and not cut.refused:
        yield "no warm-up is left out: the start of runs is part of all metrics"
    for number, why in cut.refused.items() if cut is not None else ():
        yield f"no metrics of {point_name(results.study, results.points[number])}: {why}"
    for (number, metric), why in cut.unsteady.items() if cut is not None else ():
        yield f"no {metric} of {point_name(results.study, results.points[number])}: {why}"
    lost = [] if cut is None else [m for m in cut.left_out if m not in results.analysis.metrics]
    if cut is not None and lost:
        yield not_cut(lost, cut)
    if results.damaged:
        yield f"damaged and left out: {', '.join(results.damaged)}; sweep again to repair"
    yield from stopping_remarks(results)
    yield from same_remarks(results)


def started_cold(results: Results, scenarios: Scenarios) -> Iterator[str]:
    """The remark on runs of a given length that count from their first tick.

    A study of steady states has its own.
    """
    cold = [
        number
        for number, resolved in scenarios.items()
        if resolved.scenario.stop.when == "never" and not warm_up_of(resolved.scenario)
    ]
    if results.cut is None and cold:
        which = "" if len(cold) == len(results.points) else f" of {points_named(results, cold)}"
        yield (
            f"no warm-up is left out: runs{which} go on for a given time (stop: {{when: never}}), and "
            "their start is part of all metrics; set measure: {warm_up: N}"
        )


def points_named(results: Results, numbers: Sequence[int]) -> str:
    """Some points in words."""
    names = [
        point_name(results.study, results.points[number]) for number in numbers[:MAX_WARNINGS_NAMED]
    ]
    more = len(numbers) - len(names)
    return "; ".join(names) + (f"; and {more:,} more" if more else "")


def comparison_section(results: Results) -> Iterator[Block]:
    """The declared comparisons."""
    if results.analysis.comparisons == "none":
        return
    compared = comparisons(results)
    yield Heading("Comparisons")
    same = left_out(results)
    if same:
        yield Text(
            f"{count(same, 'comparison')} left out of the family: the same runs, or the same as in "
            "another one."
        )
    if not compared:
        yield Text("None is left." if same else f"None can be made: {why_none(results)}.")
        return
    yield Text(comparison_text(results, compared))
    yield comparison_table(results, compared)
    remark = pairing_remark(compared, results.study.paired)
    if remark:
        yield Text(remark)
    takes = precision_remark(compared, results.analysis.precision)
    if takes:
        yield Text(takes)
    still = sum(one.effect.difference.warning == NO_SPREAD_WARNING for one in compared)
    small = sum(bool(one.effect.difference.warning) for one in compared) - still
    if small:
        yield Text(
            f"Warning: {small} of these intervals rest on fewer than {STUDENT_MIN_RUNS} runs and may "
            "hold the "
            "truth less often than they say."
        )
    if still:
        yield Text(
            f"Warning: in {still} of these comparisons all runs of a point gave the same: without "
            "spread the interval has no width, and p is that of a permutation test."
        )


def why_none(results: Results) -> str:
    """Why no comparison can be made."""
    if not list(declared_pairs(results)):
        return "the study has no two points that it compares"
    metrics, reasons = results.analysis.metrics, []
    if results.cut is not None:
        refused, unsteady = results.cut.refused, results.cut.unsteady
        reasons = [f"{point_name(results.study, results.points[n])}: {refused[n]}" for n in refused]
        reasons += [
            f"{metric} of {point_name(results.study, results.points[n])}: {why}"
            for (n, metric), why in unsteady.items()
            if metric in metrics
        ]
    if reasons:
        more = len(reasons) - MAX_WARNINGS_NAMED
        return "; ".join(reasons[:MAX_WARNINGS_NAMED]) + (
            f"; and {more:,} more" if more > 0 else ""
        )
    if not any(results.has(metric) for metric in metrics):
        return f"the runs have no metrics of {', '.join(metrics)}"
    return "two finished runs of each point are needed"


def comparison_text(results: Results, compared: list[Comparison]) -> str:
    """How to read the table."""
    sizes = sorted({one.family for one in compared})
    families = " and ".join(f"{size}" for size in sizes)
    return (
        f"Differences of means, {family(results)}; comparisons in the family: {families}. Holm's p "
        f"decides: below {results.analysis.error:g} it is an effect. Intervals say how large it is; "
        f"those of a family hold together with {percent(1 - results.analysis.error, 0)}. They come by "
        "another method and may hold 0 where p is below, or leave it out where p is above."
    )


def comparison_table(results: Results, compared: list[Comparison]) -> Table:
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


def needed_cells(one: Comparison, planned: bool) -> list[str]:
    """Runs that the declared precision takes, paired and not; nothing if none is declared."""
    if not planned:
        return []
    needed = (None, None) if one.needed is None else one.needed
    return ["-" if runs is None else f"{runs:,}" for runs in needed]


def relative_text(relative: Interval | None) -> str:
    """A relative effect with its interval, in percent."""
    if relative is None:
        return "-"
    ends = ("-" if end is None else f"{100 * end:+.1f}" for end in (relative.low, relative.high))
    return f"{100 * relative.value:+.1f} % ({' to '.join(ends)})"


def steady_throughput(results: Results, point: Point, cut: Cut) -> Interval | str | None:
    """Orders by 1000 ticks, or why that is not told; None where runs keep no deliveries.

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
        f"From the deliveries after the first {cut.ticks:,} ticks, which are left out at all points; "
        "beside it what MSER-5 would leave out at each."
    )
    rows, refused = [], []
    for point in results.points:
        found = steady_throughput(results, point, cut)
        cells = ["-"] * 3
        if isinstance(found, Interval):
            ends = (found.value, found.low, found.high)
            cells = ["-" if end is None else figure(end) for end in ends]
        elif found is not None:
            refused.append(f"{point_name(results.study, point)}: {found}")
        own = cut.found.get(point.number)
        cells += ["-" if own is None else f"{own:,}"]
        cells += [found.method if isinstance(found, Interval) else "-"]
        rows.append(cells)
    yield point_table(results, (PER_1000_TICKS, "low", "high", "MSER-5", "by"), rows)
    if refused:
        yield Listed(refused)
