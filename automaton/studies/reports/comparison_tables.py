"""The section of a report about the comparisons that its study declares."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from automaton.runs.report_document import Block, Heading, NumberText, Table, Text
from automaton.studies.inference.intervals import NO_SPREAD_WARNING, STUDENT_MIN_RUNS, Interval
from automaton.studies.reports.comparisons import (
    Comparison,
    comparisons,
    declared_pairs,
    left_out,
    pairing_remark,
    precision_remark,
)
from automaton.studies.reports.design_section import family
from automaton.studies.reports.metric_tables import RUN_HEADS
from automaton.studies.reports.point_names import (
    factor_cells,
    factor_heads,
    levels_apart,
    point_name,
)
from automaton.studies.reports.study_results import Results
from automaton.units import count, percent

MAX_REASONS: Final = 6  # why there is no comparison


def comparison_section(
    results: Results, compared: list[Comparison] | None = None
) -> Iterator[Block]:
    """The declared comparisons, unless they are known already."""
    if results.analysis.comparisons == "none":
        return
    compared = comparisons(results) if compared is None else compared
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
    for metric in dict.fromkeys(one.metric for one in compared):
        of_metric = [one for one in compared if one.metric == metric]
        yield Heading(f"{metric}, compared", 3)
        yield comparison_table(results, metric, of_metric)
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
        more = len(reasons) - MAX_REASONS
        return "; ".join(reasons[:MAX_REASONS]) + (f"; and {more:,} more" if more > 0 else "")
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


def comparison_table(results: Results, metric: str, compared: list[Comparison]) -> Table:
    """One line for each comparison of a metric."""
    study, scale = results.study, results.scale(metric)
    heads = [*factor_heads(study), "against", f"difference, {scale.unit}", "low", "high"]
    heads += ["relative", "p Holm", "correlation", "var. ratio"]
    planned = results.analysis.precision is not None
    heads += ["needs paired", "unpaired"] if planned else []
    heads += RUN_HEADS
    rows = []
    for one in compared:
        found = one.effect
        difference = scale.of(found.difference)
        both = [results.counts(point) for point in (one.a, one.b)]
        rows.append(
            [
                *factor_cells(study, one.a),
                levels_apart(study, one.a, one.b),
                *map(signed, (difference.value, difference.low, difference.high)),
                relative_text(found.relative),
                p_text(one.adjusted),
                "-" if found.correlation is None else f"{found.correlation:+.2f}",
                "-" if found.variance_ratio is None else f"{found.variance_ratio:.2f}",
                *needed_cells(one, planned),
                f"{one.runs[0]}, {one.runs[1]}",
                f"{both[0].censored}, {both[1].censored}",
                f"{both[0].failed}, {both[1].failed}",
            ]
        )
    return Table(heads, rows, left=1 + len(factor_heads(study)))


def needed_cells(one: Comparison, planned: bool) -> list[str]:
    """Runs that the declared precision takes, paired and not; nothing if none is declared."""
    if not planned:
        return []
    needed = (None, None) if one.needed is None else one.needed
    return ["-" if runs is None else f"{runs:,}" for runs in needed]


def signed(value: float | None) -> str:
    """A difference as a cell: four digits and its sign."""
    return "-" if value is None else NumberText(f"{value:+,.4g}", value)


def p_text(p: float) -> str:
    """A p value as a cell."""
    return NumberText("<0.0001" if p < 1e-4 else f"{p:.4f}", p)


def relative_text(relative: Interval | None) -> str:
    """A relative effect with its interval, in percent."""
    if relative is None:
        return "-"
    ends = ("-" if end is None else f"{100 * end:+.1f}" for end in (relative.low, relative.high))
    return f"{100 * relative.value:+.1f} % ({' to '.join(ends)})"
