"""What a report says as records for other programs: of each point and metric, of each comparison.

In the units of the runs, as rows have them: ticks and cells. Names of factors as columns have no dots,
which pandas, DuckDB and spreadsheets take for something else.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from automaton.studies.reports.best_points import Answer, mean_of
from automaton.studies.reports.comparisons import Comparison
from automaton.studies.reports.metric_tables import Scenarios, summary
from automaton.studies.reports.point_names import point_name
from automaton.studies.reports.reader_units import described
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import SCENARIO, Point

Record = dict[str, Any]


def column_names(names: Sequence[str]) -> list[str]:
    """Names of columns without dots: `fleet_robots`; of two that become equal the later has another _."""
    out: list[str] = []
    for name in names:
        plain = name.replace(".", "_")
        while plain in out:
            plain += "_"
        out.append(plain)
    return out


def summary_records(results: Results, scenarios: Scenarios) -> Iterator[Record]:
    """One for each metric of the report and each point."""
    for metric in results.reported:
        unit, _ = described(metric)
        for point in results.points:
            one = summary(results, scenarios, point, metric)
            yield {
                "point": point.number,
                **level_columns(results, point),
                "metric": metric,
                "unit": unit,
                "mean": one.interval.value if one.interval else None,
                "low": one.interval.low if one.interval else None,
                "high": one.interval.high if one.interval else None,
                "sd": one.sd,
                "skew": one.skew if one.interval else None,
                "bound": one.bound,
                "measured": one.interval.n if one.interval else 0,
                "runs": one.counts.done,
                "unfinished": one.counts.censored,
                "failed": one.counts.failed,
                "same_runs_as": _first_same(results, point),
            }


def _first_same(results: Results, point: Point) -> int | None:
    first = results.first_same[point.number]
    return None if first == point.number else first


def level_columns(results: Results, point: Point) -> Record:
    """The scenario and the levels of a point, by column."""
    names = results.study.factor_names
    plain = column_names(names)
    levels = {column: point.levels.get(name) for name, column in zip(names, plain, strict=True)}
    return {SCENARIO: point.scenario, **levels}


def comparison_records(results: Results, compared: Sequence[Comparison]) -> Iterator[Record]:
    """One for each declared comparison."""
    for one in compared:
        found = one.effect
        needed = one.needed
        yield {
            "metric": one.metric,
            "unit": described(one.metric)[0],
            "point": one.a.number,
            "against": one.b.number,
            "point_name": point_name(results.study, one.a),
            "against_name": point_name(results.study, one.b),
            "difference": found.difference.value,
            "low": found.difference.low,
            "high": found.difference.high,
            "relative": found.relative.value if found.relative else None,
            "relative_low": found.relative.low if found.relative else None,
            "relative_high": found.relative.high if found.relative else None,
            "p": found.p,
            "p_holm": one.adjusted,
            "family": one.family,
            "paired": found.paired,
            "correlation": found.correlation,
            "variance_ratio": found.variance_ratio,
            "needs_paired": needed.paired if needed else None,
            "needs_unpaired": needed.unpaired if needed else None,
            "runs": one.runs[0],
            "runs_against": one.runs[1],
        }


def answer_records(
    results: Results, answers: Sequence[Answer], sentences: Sequence[str]
) -> Iterator[Record]:
    """One for each answer; points by their numbers."""
    for answer, sentence in zip(answers, sentences, strict=True):
        leading, best = answer.leading, answer.best
        yield {
            "conditions": answer.conditions,
            "metric": answer.metric,
            "better": answer.better,
            "sentence": sentence,
            "certainty": 1 - results.analysis.error,  # of all answers together
            "best": None if best is None else best.number,
            "leading": None if leading is None else leading.number,
            "mean": None if leading is None else mean_of(results, leading, answer.metric),
            "candidates": [point.number for point in answer.candidates],
            "compared": [point.number for point in answer.compared],
            "incomplete": [point.number for point in answer.incomplete],
        }


def without_empty(records: Sequence[Mapping[str, Any]]) -> list[Record]:
    """The records without columns that none of them has."""
    used = {name for record in records for name, value in record.items() if not is_empty(value)}
    return [{name: v for name, v in record.items() if name in used} for record in records]


def is_empty(value: Any) -> bool:
    """Whether a cell has nothing to say."""
    return value is None or (isinstance(value, float) and math.isnan(value))
