"""The report on a results folder: its order, its caveats, and its maps of floors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from automaton.documents.report_document import (
    Folded,
    Heading,
    PageBreak,
    ReportDocument,
    Text,
)
from automaton.errors import InputError
from automaton.scenario.unavailable_metrics import warm_up_of
from automaton.studies.reports.comparison_tables import (
    comparison_section,
    design,
    effects_section,
    not_cut,
)
from automaton.studies.reports.comparisons import (
    Answer,
    Comparison,
    answers,
    comparisons,
    is_what_if,
    point_name,
    stopping_remarks,
)
from automaton.studies.reports.first_page import (
    answer_section,
    decision_points,
    first_page,
)
from automaton.studies.reports.metric_tables import (
    Scenarios,
    curves,
    metric_section,
    same_remarks,
    steady_section,
)
from automaton.studies.reports.site_pages import (
    MAX_TIME_POINTS,
    deadlock_remarks,
    delivery_remarks,
    floor_maps,
    hours_section,
    inputs_section,
    jam_remarks,
    site_picture,
    time_section,
)
from automaton.studies.reports.study_results import LENGTHS, Results, read_results, units_of_points
from automaton.studies.reports.what_if import (
    changes_section,
    what_if_page,
    what_if_points,
    what_if_section,
)
from automaton.studies.sweeps.result_store import STUDY_FILE, Store, content_of, study_document_in
from automaton.studies.sweeps.run_keys import fingerprint
from automaton.studies.sweeps.study import Study
from automaton.studies.sweeps.sweep_plan import resolved_study
from automaton.units import count

MAX_POINTS_IN_REMARK: Final = 6
NOT_DECLARED = (
    "Not declared by the study: reported for every floor with arriving orders or measured tasks. "
    "Percentiles are computed within each run and then averaged over runs, because the orders of a run "
    "depend on each other."
)
MAX_POINTS_NAMED = 24  # points


def compose(store: Store, floors: Sequence[int] = ()) -> ReportDocument:
    """The report on a folder; `floors`: points to repeat one run of, for maps. Raises InputError."""
    return document_of(read_report(store), store, floors)


def document_of(
    report: StudyReport, store: Store, floors: Sequence[int] = (), every: str | None = None
) -> ReportDocument:
    """The document of a report; `every`: a period of its results by hour, such as "30min".

    Raises InputError for floors that cannot be drawn, and for periods that runs do not have.
    """
    results, scenarios = report.results, report.scenarios
    document = opening_of(report, every)
    add_floors(document, results, scenarios, floors, report.lacking)
    add_comparisons(document, report)
    document.add(*design(results, scenarios), Text(numbered_points(results.study)))
    add_repeat(document, store)
    return document


def opening_of(report: StudyReport, every: str | None = None) -> ReportDocument:
    """The first page, what was asked in detail, and the results by hour. Raises InputError."""
    results, scenarios = report.results, report.scenarios
    study = results.study
    document = ReportDocument(study.name)
    document.add(Heading(study.name, 1), *site_picture(results, scenarios))
    dated = [f"Results of {results.date}."] if results.date else []
    summary = " ".join([*dated, *([study.summary] if study.summary else [])])
    document.add(*([Text(summary)] if summary else []))
    if is_what_if(results):
        first = what_if_page(results, report.compared, report.notes)
        points = [results.points[n] for n in what_if_points(results, report.compared)]
    else:
        first = first_page(results, report.answers, report.notes)
        points = decision_points(results, report.answers, report.compared)
    document.add(*first, PageBreak())
    document.add(*(changes_section(study) if is_what_if(results) else ()))
    document.add(*inputs_section(results, scenarios))
    document.add(*hours_section(results, scenarios, points or results.points, every))
    is_few = len(results.points) <= MAX_TIME_POINTS
    document.add(*time_section(results, results.points if is_few else points or results.points))
    return document


def add_comparisons(document: ReportDocument, report: StudyReport) -> None:
    """Add the comparisons of points, the effects of factors, and the tables and curves of metrics."""
    results, scenarios = report.results, report.scenarios
    if is_what_if(results):
        document.add(*what_if_section(results, report.compared))
    else:
        document.add(*answer_section(results, report.answers, report.compared))
        document.add(*comparison_section(results, report.compared))
    if not results.study.is_named:
        document.add(*effects_section(results))
    document.add(Heading("Metrics"))
    for metric in results.analysis.metrics:
        if results.has(metric):
            document.add(*metric_section(results, scenarios, metric))
        else:
            document.add(Heading(metric, 3), Text(without(results, metric)))
    for metric in results.quantiles:
        document.add(*metric_section(results, scenarios, metric), Text(NOT_DECLARED))
    document.add(*steady_section(results))
    # The first page may show one of the curves already.
    drawn = [one for one in curves(results) if one not in document.blocks]
    if drawn:
        document.add(Heading("Curves"), *drawn)


class StudyReport(NamedTuple):
    """The content of a report, independent of its format."""

    results: Results
    scenarios: Scenarios
    answers: list[Answer]  # none about named points, which are compared with their baseline
    compared: list[Comparison]
    notes: list[str]
    lacking: str  # why scenarios are missing, or ""


def read_report(store: Store) -> StudyReport:
    """The results of a folder and their analysis. Raises InputError."""
    results = read_results(store)
    if not results.rows:
        why = "holds no runs of its study yet"
        if results.damaged:
            names = ", ".join(results.damaged)
            why = f"holds no readable runs; damaged: {names}; sweep again to repair"
        raise InputError(why, str(store.folder))
    scenarios, lacking = scenarios_of(store)
    results = replace(results, units=units_of_points(scenarios.values(), len(results.points)))
    notes = [*deadlock_remarks(results, scenarios), *jam_remarks(results), *remarks(results)]
    notes += [*started_cold(results, scenarios), *([lacking] if lacking else [])]
    compared = comparisons(results)
    best = [] if is_what_if(results) else answers(results, compared)
    return StudyReport(results, scenarios, best, compared, notes, lacking)


def numbered_points(study: Study) -> str:
    """A list of the design points with their numbers, as --floor takes them."""
    points = study.points
    named = [f"{point.number} {point_name(study, point)}" for point in points[:MAX_POINTS_NAMED]]
    more = f"; and so on to {len(points) - 1}" if len(points) > MAX_POINTS_NAMED else ""
    return f"Points by number, for --floor: {'; '.join(named)}{more}"


def without(results: Results, metric: str) -> str:
    """Why the report has no table of a metric."""
    if results.study.design == "steady-state" and metric in LENGTHS:
        return f"{metric} measures the length of runs, not their steady state."
    if results.cut is not None and metric in results.cut.left_out:
        return not_cut([metric], results.cut)
    unsteady = results.cut is not None and any(name == metric for _, name in results.cut.unsteady)
    if unsteady or (results.cut is not None and len(results.cut.refused) == len(results.points)):
        return f"No point has {metric} after the warm-up period: see the caveats above."
    return "No run has this metric."


def scenarios_of(store: Store) -> tuple[Scenarios, str]:
    """The scenario of each point if it has not changed since the runs; why scenarios are missing."""
    planned = store.manifest.points
    try:
        _, _, scenarios = resolved_study(study_document_in(store.folder, store.manifest))
    except InputError as error:
        return {}, f"no bounds and maps, because a scenario cannot be read: {error}"
    same = {
        number: resolved
        for number, (point, resolved) in enumerate(zip(planned, scenarios, strict=True))
        if fingerprint(resolved, point.windows) == point.fingerprint
    }
    other = [point for point in store.study.points if point.number not in same]
    if not other:
        return same, ""
    names = ", ".join(dict.fromkeys(point.scenario for point in other))
    what = f"{len(other)} of {count(len(planned), 'point')}"
    return same, (
        f"no bounds and maps for {what}, because the scenario has changed since it was run: {names} "
        "(the file, its floor, or the code)"
    )


def add_floors(
    document: ReportDocument,
    results: Results,
    scenarios: Scenarios,
    floors: Sequence[int],
    lacking: str,
) -> None:
    """Add maps of the floor; `lacking`: why scenarios are missing. Raises InputError."""
    if not floors:
        return

    document.add(Heading("Maps"))
    for number in floors:
        if number >= len(results.points):
            last = len(results.points) - 1
            raise InputError(f"--floor {number}: the study has the points 0 to {last}")
        if number not in scenarios:
            raise InputError(
                f"--floor {number}: no map is possible, so no report is written; omit --floor: {lacking}"
            )
        point = results.points[number]
        first = results.first_run(point)
        if first is None:
            raise InputError(f"--floor {number}: this point has no runs with metrics yet")
        name = f"point {number}: {point_name(results.study, point)}"
        scenario = scenarios[number].scenario
        after = warm_up_of(scenario) if results.cut is None else results.cut.ticks
        document.add(*floor_maps(scenarios[number], *first, name, after))


def add_repeat(document: ReportDocument, store: Store) -> None:
    """Add the commands that repeat the study, with its files folded."""
    folder = Path(store.folder)
    document.add(
        Heading("Repeat"),
        Text(
            "In the results folder, this command makes the missing runs and prints the report again:"
        ),
        Text(f"automaton sweep {STUDY_FILE} --out . && automaton report .", code=True),
        Folded(STUDY_FILE, [Text(store.manifest.text.strip(), code=True)]),
    )
    for name in dict.fromkeys(point.scenario for point in store.manifest.points):
        if (folder / name).is_file():  # a copy; shipped scenarios come with the code
            text = content_of(folder / name).decode(errors="replace").strip()
            title = f"{name} (the files that it names are also in the results folder)"
            document.add(Folded(title, [Text(text, code=True)]))


# The caveats of a report.


def remarks(results: Results) -> Iterator[str]:
    """The caveats that follow from the results."""
    counts = [results.counts(point) for point in results.points]
    missing, censored, failed = (
        sum(getattr(one, name) for one in counts) for name in ("missing", "censored", "failed")
    )
    if missing:
        yield f"{count(missing, 'run')} of {results.study.runs:,} not done yet: metrics may change"
    if censored:
        yield (
            f"{count(censored, 'run')} did not finish within the limit; means exclude these runs, so a "
            "point that has some looks too good and is never called best"
        )
    if failed:
        reasons = {reason for reason in results.columns["error"] if reason}
        yield f"{count(failed, 'run')} failed: {'; '.join(sorted(reasons)[:3])}"
    if results.earlier:
        yield (
            f"the analysis or warm-up was changed {count(results.earlier, 'time')} after runs had been "
            "made: treat its results as exploratory"
        )
    cut = results.cut
    if cut is not None and not cut.ticks and not cut.refused:
        yield "no warm-up period is discarded: all metrics include the start of runs"
    for number, why in cut.refused.items() if cut is not None else ():
        yield f"no metrics for {point_name(results.study, results.points[number])}: {why}"
    for (number, metric), why in cut.unsteady.items() if cut is not None else ():
        yield f"no {metric} for {point_name(results.study, results.points[number])}: {why}"
    lost = [] if cut is None else [m for m in cut.left_out if m not in results.analysis.metrics]
    if cut is not None and lost:
        yield not_cut(lost, cut)
    if results.damaged:
        yield f"damaged and ignored: {', '.join(results.damaged)}; sweep again to repair"
    yield from delivery_remarks(results)
    yield from stopping_remarks(results)
    yield from same_remarks(results)


def started_cold(results: Results, scenarios: Scenarios) -> Iterator[str]:
    """The caveat about runs of fixed length without a warm-up period.

    Steady-state studies have their own caveat.
    """
    cold = [
        number
        for number, resolved in scenarios.items()
        if resolved.scenario.stop.when == "never" and not warm_up_of(resolved.scenario)
    ]
    if results.cut is None and cold:
        which = "" if len(cold) == len(results.points) else f" of {points_named(results, cold)}"
        yield (
            f"no warm-up period is discarded: runs{which} have a fixed length (stop: {{when: never}}), "
            "and all metrics include their start; set measure: {warm_up: N}"
        )


def points_named(results: Results, numbers: Sequence[int]) -> str:
    """The names of points, at most MAX_POINTS_IN_REMARK."""
    names = [
        point_name(results.study, results.points[number])
        for number in numbers[:MAX_POINTS_IN_REMARK]
    ]
    more = len(numbers) - len(names)
    return "; ".join(names) + (f"; and {more:,} more" if more else "")
