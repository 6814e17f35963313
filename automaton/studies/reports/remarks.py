"""What a reader must know before the tables of a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from automaton.scenario.unavailable_metrics import warm_up_of
from automaton.studies.reports.design_section import not_cut
from automaton.studies.reports.metric_tables import Scenarios
from automaton.studies.reports.point_names import point_name
from automaton.studies.reports.precision import stopping_remarks
from automaton.studies.reports.same_runs import same_remarks
from automaton.studies.reports.study_results import Results
from automaton.units import count

MAX_POINTS_NAMED: Final = 6


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
        point_name(results.study, results.points[number]) for number in numbers[:MAX_POINTS_NAMED]
    ]
    more = len(numbers) - len(names)
    return "; ".join(names) + (f"; and {more:,} more" if more else "")
