"""A report as one JSON object, in the units of the runs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from automaton.studies.reports.build_report import StudyReport
from automaton.studies.reports.factor_effects import factor_effects
from automaton.studies.reports.first_page import answer_sentence, question
from automaton.studies.reports.records import (
    answer_records,
    comparison_records,
    summary_records,
)
from automaton.studies.reports.study_results import Results


def as_json(report: StudyReport) -> dict[str, Any]:
    """The report as `automaton report --json` prints it; what has no value is null."""
    results = report.results
    study, analysis = results.study, results.analysis
    sentences = [answer_sentence(results, answer) for answer in report.answers]
    return {
        "study": study.name,
        "summary": study.summary,
        "question": question(results) if analysis.metrics else None,
        "answers": list(answer_records(results, report.answers, sentences)),
        "remarks": list(report.notes),
        "design": {
            "design": study.design,
            "replications": study.max_replications,
            "seed": study.seed,
            "common_random_numbers": study.common_random_numbers,
            "paired": study.paired,
            "error": analysis.error,
            "warm_up": max(results.warm_ups) if results.cut is None else results.cut.ticks,
            "code": results.version,
        },
        "points": [
            {"point": point.number, "scenario": point.scenario, "levels": point.levels}
            for point in results.points
        ],
        "metrics": list(summary_records(results, report.scenarios)),
        "effects": list(effect_records(results)),
        "comparisons": list(comparison_records(results, report.compared)),
    }


def effect_records(results: Results) -> Iterator[dict[str, Any]]:
    """What each factor changes of each metric; nothing where factors are not crossed."""
    for metric in results.analysis.metrics:
        effects = factor_effects(results, metric) if results.has(metric) else None
        if effects is None:
            continue
        yield {
            "metric": metric,
            "family": effects.family,
            "shares": [
                {"factors": list(factors), "share": share}
                for factors, share in effects.shares.items()
            ],
            "main": [
                {
                    "factor": one.factor,
                    "level": one.level,
                    "mean": one.mean,
                    "against": one.against or None,
                    "difference": one.difference.value if one.difference else None,
                    "low": one.difference.low if one.difference else None,
                    "high": one.difference.high if one.difference else None,
                }
                for one in effects.main
            ],
            "interactions": [
                {
                    "factors": list(one.factors),
                    "levels": list(one.levels),
                    "against": list(one.against),
                    "difference": one.difference.value if one.difference else None,
                    "low": one.difference.low if one.difference else None,
                    "high": one.difference.high if one.difference else None,
                }
                for one in effects.interactions
            ],
        }
