"""Named points of a study against the baseline: one table, one picture, and a verdict for each metric.

    better, worse    the interval of the difference excludes 0
    unclear          the same, but the mean of the point that seems better leaves runs out
    higher, lower    as better and worse, for a metric of which neither is better
    identical runs   all runs of the two points have equal digests: the change has no effect

All verdicts hold simultaneously. If all pairs differ by the same amount, the adjusted p decides.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

from automaton.documents.report_document import (
    Block,
    Curves,
    Heading,
    Listed,
    NumberText,
    Panels,
    ReportCurve,
    StyledText,
    Table,
    Text,
)
from automaton.studies.inference.intervals import STUDENT_MIN_RUNS
from automaton.studies.reports.comparison_tables import difference_cells
from automaton.studies.reports.comparisons import (
    Comparison,
    compared_runs,
    declared_pairs,
    direction_of,
    mean_of,
    pairing_remark,
    point_name,
    precision_remark,
    setting_text,
)
from automaton.studies.reports.first_page import caveats
from automaton.studies.reports.metric_tables import MAX_CURVES, bias_of, figure
from automaton.studies.reports.study_results import PERCENT, Results, described
from automaton.studies.sweeps.study import SCENARIO_FACTOR, Point, Study
from automaton.units import count, percent

BASELINE: Final = "baseline"
BETTER: Final = "better"
WORSE: Final = "worse"
UNCLEAR: Final = "unclear"
HIGHER: Final = "higher"
LOWER: Final = "lower"
NO_DIFFERENCE: Final = "No statistically significant difference"
IDENTICAL: Final = "identical runs"
TOO_FEW_PAIRS: Final = "not compared: fewer than two pairs of complete runs"
ALL_POINTS: Final = "all points"
AS_IT_IS: Final = "the scenario as it is"
STANDING: Final = ("deadlocks", "jam")  # columns of runs in which robots stand for long


class WhatIf(NamedTuple):
    """A metric of a named point against the baseline."""

    metric: str
    point: Point
    base: Point
    comparison: Comparison | None  # None: identical runs, or too few of them
    verdict: str


def what_ifs(results: Results, compared: Sequence[Comparison]) -> list[WhatIf]:
    """Each named point against its baseline, for each metric of the analysis that runs have."""
    outcomes = []
    for metric in filter(results.has, results.analysis.metrics):
        first = results.identical(metric)
        by_runs = {
            (first[one.a.number], first[one.b.number]): one
            for one in compared
            if one.metric == metric
        }
        for point, base in declared_pairs(results):
            one = by_runs.get((first[point.number], first[base.number]))
            if one is not None:
                verdict = sure_verdict(results, one, point, base)
            else:
                verdict = IDENTICAL if results.same(point, base, metric) else TOO_FEW_PAIRS
            outcomes.append(WhatIf(metric, point, base, one, verdict))
    return outcomes


def sure_verdict(results: Results, one: Comparison, point: Point, base: Point) -> str:
    """The verdict on a comparison; unclear if the point that seems better has lost runs."""
    verdict = verdict_of(one)
    seems_better = {BETTER: point, WORSE: base}.get(verdict)
    if seems_better is not None and has_lost_runs(results, seems_better, one.metric):
        return UNCLEAR
    return verdict


def verdict_of(one: Comparison) -> str:
    """Whether a change makes a metric better or worse."""
    if not one.is_significant:
        return NO_DIFFERENCE
    is_higher = one.effect.difference.value > 0
    better = direction_of(one.metric)
    if better is None:
        return HIGHER if is_higher else LOWER
    return BETTER if is_higher == (better == "highest") else WORSE


def has_lost_runs(results: Results, point: Point, metric: str) -> bool:
    """Whether runs of a point are not in its mean of a metric, which therefore looks too good."""
    return len(results.values(point, metric)) < results.counts(point).done


# The first page.


def what_if_page(
    results: Results, compared: Sequence[Comparison], notes: Sequence[str]
) -> Iterator[Block]:
    """Question, decision, a picture, and caveats."""
    outcomes = what_ifs(results, compared)
    yield Heading("Question")
    yield Text(what_if_question(results))
    yield Heading("Decision")
    if not outcomes:
        yield Text(no_answer(results), strong=True)
    else:
        standing = [text for pair in pairs_of(outcomes) if (text := standing_text(results, *pair))]
        yield Text(" ".join((what_if_decision(results, outcomes), *standing)), strong=True)
        yield Listed([sentence(results, outcomes, pair) for pair in pairs_of(outcomes)])
        drawn = what_if_picture(results, outcomes)
        yield from [] if drawn is None else [drawn]
    yield from caveats(notes)


def what_if_section(results: Results, compared: Sequence[Comparison]) -> Iterator[Block]:
    """The table of all comparisons, and how to read it."""
    outcomes = what_ifs(results, compared)
    if outcomes:
        yield Heading("Comparisons")
        yield what_if_table(results, outcomes)
        yield Listed(list(reading_lines(results, outcomes)), mark="")


def what_if_points(results: Results, compared: Sequence[Comparison]) -> list[int]:
    """The numbers of the baselines and of the points compared with them."""
    pairs = pairs_of(what_ifs(results, compared))
    return list(dict.fromkeys(one.number for pair in pairs for one in reversed(pair)))


def what_if_decision(results: Results, outcomes: Sequence[WhatIf]) -> str:
    """Which changes improve the first metric."""
    metric, base = outcomes[0].metric, results.analysis.baseline
    every = [one for one in outcomes if one.metric == metric]
    own = [one for one in every if one.verdict != TOO_FEW_PAIRS]
    if not own:
        return f"See why runs did not finish: no change can be compared in {metric}."
    changes = count(len(own), "comparison" if several(results.study) else "change")
    better = [one for one in own if one.verdict == BETTER]
    if not better:
        if direction_of(metric) is None:
            return f"Choose by other metrics: a low {metric} is neither better nor worse than a high one."
        none = "the change does not improve" if len(own) == 1 else f"none of {changes} improves"
        return f"Keep {base}: {none} {metric} significantly."
    sign = -1 if direction_of(metric) == "highest" else 1
    better.sort(key=lambda one: sign * mean_of(results, one.point, metric))
    texts = []
    for one in better:
        change = change_text(results, one).removeprefix(metric).strip()
        texts.append(f"{point_name(results.study, one.point)} ({change})")
    sure = f"with {percent(1 - results.analysis.error, 0)} confidence"
    if len(own) == 1:
        return f"Do it: {texts[0]} improves {metric} {sure}."
    verb = "improves" if len(better) == 1 else "improve"
    return f"{len(better):,} of {changes} {verb} {metric} {sure}: {'; '.join(texts)}."


def standing_text(results: Results, point: Point, base: Point) -> str:
    """A sentence if robots of a change deadlock or jam in more runs than without it; else ""."""
    each = [sum(any(run[1:]) for run in results.stored(one, *STANDING)) for one in (point, base)]
    if each[0] <= each[1]:
        return ""
    runs = count(results.counts(point).done, "run")
    name = point_name(results.study, point)
    return (
        f"With {name} robots deadlock or jam in {each[0]:,} of {runs} ({base.name}: {each[1]:,})."
    )


def no_answer(results: Results) -> str:
    """Why no point can be compared with the baseline."""
    if not results.analysis.metrics:
        return "Sweep again, or choose other metrics: no run has any of these."
    return "Add points to the study: it has none beside the baseline."


def pairs_of(outcomes: Sequence[WhatIf]) -> list[tuple[Point, Point]]:
    """The compared points with their baselines, each once."""
    pairs = {one.point.number: (one.point, one.base) for one in outcomes}
    return list(pairs.values())


def what_if_question(results: Results) -> str:
    """The question of a study with named points, in a sentence."""
    study, analysis = results.study, results.analysis
    metrics, base = ", ".join(analysis.metrics), analysis.baseline
    many = len(study.points) // len(study.scenarios) - 1
    changes = "does 1 change" if many == 1 else f"do {many:,} changes"
    each = f", in each of {count(len(study.scenarios), 'scenario')}" if several(study) else ""
    paired = "pairs of runs with the same seed" if study.paired else "runs of each point"
    return (
        f"What {changes} do to {metrics}, compared with {base}{each}? "
        f"{study.max_replications:,} {paired}."
    )


def several(study: Study) -> bool:
    """Whether a study has several scenarios."""
    return len(study.scenarios) > 1


def sentence(results: Results, outcomes: Sequence[WhatIf], pair: tuple[Point, Point]) -> str:
    """What a change does to all metrics: "one more robot: better: makespan -14.1 %."."""
    point, base = pair
    own = [one for one in outcomes if one.point.number == point.number]
    verdicts = dict.fromkeys(one.verdict for one in sorted(own, key=lambda one: order(one.verdict)))
    parts: list[str] = []
    for verdict in verdicts:
        same = [one for one in own if one.verdict == verdict]
        is_apart = verdict in (BETTER, WORSE, UNCLEAR, HIGHER, LOWER)
        names = [change_text(results, one) if is_apart else one.metric for one in same]
        word = f"same runs as {base.name}" if verdict == IDENTICAL else verdict
        if verdict == NO_DIFFERENCE and parts:
            word = NO_DIFFERENCE[0].lower() + NO_DIFFERENCE[1:]
        parts.append(f"{word}{':' if is_apart else ' in'} {', '.join(names)}")
    return f"{point_name(results.study, point)}: {'; '.join(parts)}."


def order(verdict: str) -> int:
    """The rank of a verdict in a sentence: differences come first."""
    ranks = (BETTER, WORSE, UNCLEAR, HIGHER, LOWER, NO_DIFFERENCE, IDENTICAL, TOO_FEW_PAIRS)
    return ranks.index(verdict)


def change_text(results: Results, one: WhatIf) -> str:
    """A significant difference: "lead_time -12.3 %", or in the unit of the metric."""
    assert one.comparison is not None
    share, scale = relative_ends(results, one)[0], results.scale(one.metric)
    if not math.isnan(share) and scale is not PERCENT:
        return f"{one.metric} {share:+.1f} %"
    value = one.comparison.effect.difference.value * scale.factor
    unit = "percentage points" if scale is PERCENT else scale.unit
    return f"{one.metric} {value:+,.4g} {unit}"


def what_if_table(results: Results, outcomes: Sequence[WhatIf]) -> Table:
    """Each metric of each named point: mean, difference from the baseline, interval and verdict."""
    level = percent(1 - results.analysis.error, 0)
    heads = ["point", "mean", "difference", f"{level} low", "high", "relative", "verdict"]
    rows: list[list[str]] = []
    for metric, number in dict.fromkeys((one.metric, one.base.number) for one in outcomes):
        base, unit = results.points[number], results.scale(metric).unit
        where = f" in {base.scenario}" if several(results.study) else ""
        title = StyledText(f"{metric}{where}, {unit}", "bold")
        mean = mean_cell(results, base, metric)
        rows += [[]] if rows else []
        rows += [[title, *[""] * (len(heads) - 1)], [base.name, mean, *"----", BASELINE]]
        rows += [
            what_if_row(results, one)
            for one in outcomes
            if (one.metric, one.base.number) == (metric, number)
        ]
    return Table(heads, rows, left=1, also_left=(len(heads) - 1,))


def what_if_row(results: Results, one: WhatIf) -> list[str]:
    """The line of a comparison."""
    cells, relative = ["-"] * 3, "-"
    if one.comparison is not None:
        cells = difference_cells(one.comparison.effect.difference, results.scale(one.metric))
        share, *_ = relative_ends(results, one)
        is_relative = not math.isnan(share) and results.scale(one.metric) is not PERCENT
        relative = "-" if not is_relative else NumberText(f"{share:+.1f} %", share / 100)
    mean = mean_cell(results, one.point, one.metric)
    return [one.point.name, mean, *cells, relative, one.verdict + left_out_text(results, one)]


def mean_cell(results: Results, point: Point, metric: str) -> str:
    """The mean of a metric over the runs of a point."""
    if not results.values(point, metric):
        return "-"
    return figure(mean_of(results, point, metric) * results.scale(metric).factor)


def left_out_text(results: Results, one: WhatIf) -> str:
    """The number of planned runs that a comparison cannot use, and the bias; "" if it uses all."""
    if one.comparison is None:
        return ""
    planned = results.study.max_replications
    lacking = planned - min(one.comparison.runs)
    what = "pair" if results.study.paired else "run"
    biases = [
        f"; {whose} mean {bias}"
        for whose, point in (("its", one.point), ("the baseline's", one.base))
        if (bias := bias_of(results, point, one.metric))
    ]
    return f" ({lacking:,} of {count(planned, what)} left out{''.join(biases)})" if lacking else ""


def reading_lines(results: Results, outcomes: Sequence[WhatIf]) -> Iterator[str]:
    """How to read the table, and the limits of its intervals."""
    compared = list(
        {id(one.comparison): one.comparison for one in outcomes if one.comparison}.values()
    )
    level = percent(1 - results.analysis.error, 0)
    base = results.analysis.baseline
    if compared:
        paired = " of runs with the same seed" if results.study.paired else ""
        family = max(one.family for one in compared)
        each = " of a metric" if results.analysis.family == "metric" else ""
        intervals = f"{count(family, 'interval')}{each}"
        yield (
            f"difference: mean difference{paired} from {base}. better, worse: the interval of the "
            f"difference excludes 0. The {intervals} hold simultaneously with {level} confidence "
            "(Bonferroni)."
        )
    if any(one.verdict == UNCLEAR for one in outcomes):
        yield (
            f"{UNCLEAR}: the mean of the point that seems better leaves out runs that failed, did not "
            "finish or have no such metric; they may be its worst."
        )
    few = min((min(one.runs) for one in compared), default=STUDENT_MIN_RUNS)
    if few < STUDENT_MIN_RUNS:
        what = count(few, "pair" if results.study.paired else "run")
        yield (
            f"With {what}, fewer than {STUDENT_MIN_RUNS}, the confidence of a skewed metric may be lower."
        )
    remarks = pairing_remark(compared, results.study.paired)
    remarks = f"{remarks} {precision_remark(compared, results.analysis.precision)}".strip()
    yield from [remarks] if remarks else []
    yield from (
        f"{name}: {described(name)[1]}." for name in dict.fromkeys(o.metric for o in outcomes)
    )


# The picture: differences with their intervals, a chart for each metric.


def what_if_picture(results: Results, outcomes: Sequence[WhatIf]) -> Panels | None:
    """The differences of all points; None if no mean can be related to the baseline."""
    pairs = pairs_of(outcomes)
    shown = {point.number for point, _ in pairs[:MAX_CURVES]}
    charts = []
    for metric in dict.fromkeys(one.metric for one in outcomes):
        own = [one for one in outcomes if one.metric == metric and one.point.number in shown]
        lines = [
            ReportCurve(point_name(results.study, one.point), [0.0], *drawn_ends(results, one))
            for one in own
        ]
        unit = "percentage points" if results.scale(metric) is PERCENT else "%"
        chart = Curves(metric, "", unit, lines, x_names=[""], from_zero=True)
        charts += [chart] if chart.values else []
    hidden = len(pairs) - len(shown)
    title = f"Difference from {results.analysis.baseline}"
    title += f", {hidden} more not shown" if hidden else ""
    return Panels(title, charts, has_intervals=True) if charts else None


def drawn_ends(results: Results, one: WhatIf) -> tuple[list[float], list[float], list[float]]:
    """A difference and the ends of its interval as drawn: relative, but of shares in points."""
    value, low, high = relative_ends(results, one)
    if one.comparison is not None and results.scale(one.metric) is PERCENT:
        shown = PERCENT.of(one.comparison.effect.difference)
        low, high = (math.nan if end is None else end for end in (shown.low, shown.high))
        value = shown.value
    return [value], [low], [high]


def relative_ends(results: Results, one: WhatIf) -> tuple[float, float, float]:
    """A difference and the ends of its interval in percent of the baseline's mean; NaN if unknown."""
    if one.verdict == IDENTICAL:
        return 0.0, 0.0, 0.0
    relative = None if one.comparison is None else one.comparison.effect.relative
    if relative is None:
        return math.nan, math.nan, math.nan
    ends = (relative.value, relative.low, relative.high)
    value, low, high = (math.nan if end is None else 100 * end for end in ends)
    return value, low, high


# What was changed.


def changes_section(study: Study) -> Iterator[Block]:
    """The settings of each named point, once, after those of all points."""
    rows = [
        [ALL_POINTS if place == 0 else "", key, setting_text(value)]
        for place, (key, value) in enumerate((study.settings or {}).items())
    ]
    for point in study.points[: len(study.points) // len(study.scenarios)]:
        settings = [[key, setting_text(value)] for key, value in point.settings.items()]
        for place, cells in enumerate(settings or [[AS_IT_IS, ""]]):
            rows.append([point.name if place == 0 else "", *cells])
    yield Heading("What was changed")
    yield Table(("point", "setting", "value"), rows, left=3)


def what_if_records(results: Results, compared: Sequence[Comparison]) -> Iterator[dict[str, Any]]:
    """One record for each metric and named point, in the units of the runs."""
    for one in what_ifs(results, compared):
        difference = None if one.comparison is None else one.comparison.effect.difference
        value = 0.0 if one.verdict == IDENTICAL else None
        share, *_ = relative_ends(results, one)
        used = compared_runs(results, one.point, one.base, one.metric)
        yield {
            "metric": one.metric,
            "unit": described(one.metric)[0],
            SCENARIO_FACTOR: one.point.scenario,
            "point": one.point.name,
            "against": one.base.name,
            "mean": mean_or_none(results, one.point, one.metric),
            "mean_against": mean_or_none(results, one.base, one.metric),
            "difference": difference.value if difference else value,
            "low": difference.low if difference else None,
            "high": difference.high if difference else None,
            "relative": None if math.isnan(share) else share / 100,
            "verdict": one.verdict,
            "runs": min(map(len, used)),
        }


def mean_or_none(results: Results, point: Point, metric: str) -> float | None:
    """The mean of a metric in the unit of the runs; None without runs."""
    return mean_of(results, point, metric) if results.values(point, metric) else None
