"""Verdicts of named points against their baseline, on runs made up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from statistics_trials import false_verdicts
from synthetic_results import synthetic_store

from automaton.documents.html_output import as_html
from automaton.documents.report_document import Panels, ReportDocument
from automaton.documents.text_output import as_markdown, as_text
from automaton.studies.reports.comparisons import comparisons, is_what_if
from automaton.studies.reports.study_results import Results
from automaton.studies.reports.what_if import (
    WhatIf,
    sentence,
    what_if_page,
    what_if_picture,
    what_if_records,
    what_if_section,
    what_if_table,
    what_ifs,
)
from automaton.studies.sweeps.study import Analysis, Study

WAVE = (0.0, 3.0, -2.0, 1.0, -3.0, 2.0, -1.0, 0.5)  # of runs with the same seed
CHANCE = (0.4, -0.3, 0.2, -0.5, 0.1, 0.3, -0.2, 0.0)


def made_up(*points: str, metrics: tuple[str, ...] = ("makespan",), **more: Any) -> Study:
    """A study with named points, the first of them the baseline."""
    return Study(
        name="made up",
        scenario="tabletop-mini",
        listed=tuple(
            {"name": name, "set": {"fleet.robots": n}} for n, name in enumerate(points, 1)
        ),
        replications=len(WAVE),
        analysis=Analysis(metrics=metrics, **more),
    )


def runs(*effects: float) -> Callable[[int, int], float]:
    """Runs of which each point adds its effect to common noise, and a little noise of its own."""
    return lambda p, r: 100 + WAVE[r] + effects[p] + (CHANCE[(r + p) % len(CHANCE)] if p else 0.0)


def verdicts(results: Results) -> list[str]:
    return [one.verdict for one in what_ifs(results, comparisons(results))]


def test_pairs_tell_a_small_change_from_noise_that_both_share() -> None:
    study = made_up("today", "faster", "slower", "same")
    results = synthetic_store(study, runs(0, -2, 2, 0))
    assert is_what_if(results)
    assert verdicts(results) == ["better", "worse", "No statistically significant difference"]


def test_more_is_better_for_some_metrics_and_neither_for_others() -> None:
    metrics = ("throughput", "utilization")
    study = made_up("today", "more", "less", metrics=metrics)
    columns = {name: runs(0, 5, -5) for name in metrics}
    results = synthetic_store(study, runs(0, 5, -5), **columns)
    assert verdicts(results) == ["better", "worse", "higher", "lower"]
    assert not results.has("lead_time")


def test_identical_runs_and_runs_that_lack_are_said_to_be_so() -> None:
    study = made_up("today", "idle", "lost", "twin of slower", "slower")
    value = runs(0, 0, 0, 5, 5)
    same = {1: 0, 3: 4}
    results = synthetic_store(
        study,
        lambda p, r: 100 + WAVE[r] if p == 1 else value(same.get(p, p), r),
        digest=lambda p, r: f"{same.get(p, p)}-{r}",
        finished=lambda p, r: p != 2 or r == 0,
    )
    found = verdicts(results)
    assert found[0] == "identical runs" and found[2:] == ["worse", "worse"]
    assert found[1].startswith("not compared: fewer than two pairs")


def test_pairs_that_are_left_out_are_counted_in_the_verdict() -> None:
    study = made_up("today", "slower")
    results = synthetic_store(study, runs(0, 5), finished=lambda p, r: (p, r) != (1, 3))
    table = what_if_table(results, what_ifs(results, comparisons(results)))
    assert table.rows[-1][-1] == "worse (1 of 8 pairs left out; its mean is too low)"


def test_a_point_that_lost_runs_is_never_called_better() -> None:
    study = made_up("today", "jams")
    lost = {"finished": lambda p, r: (p, r) != (1, 3)}
    results = synthetic_store(study, runs(0, -5), **lost)
    assert verdicts(results) == ["unclear"]
    assert "unclear: makespan -5" in sentence(
        results, what_ifs(results, comparisons(results)), (results.points[1], results.points[0])
    )
    unmeasured = synthetic_store(study, lambda p, r: None if p and r == 3 else runs(0, -5)(p, r))
    assert verdicts(unmeasured) == ["unclear"]
    lost = {"finished": lambda p, r: (p, r) != (0, 3)}
    assert verdicts(synthetic_store(study, runs(0, -5), **lost)) == ["better"]
    assert verdicts(synthetic_store(study, runs(0, 5), **lost)) == ["unclear"]


def test_runs_that_all_differ_alike_are_judged_by_their_p_value() -> None:
    study = made_up("today", "slower")
    results = synthetic_store(study, lambda p, r: 100 + WAVE[r] + 5 * p)
    assert verdicts(results) == ["worse"]
    few = Study(**{**made_up_keys(study), "replications": 2})
    results = synthetic_store(few, lambda p, r: 100 + WAVE[r] + 5 * p)
    assert verdicts(results) == ["No statistically significant difference"]


def made_up_keys(study: Study) -> dict[str, Any]:
    return {
        "name": study.name,
        "scenario": study.scenario,
        "listed": study.listed,
        "analysis": study.analysis,
    }


def test_a_change_is_one_sentence_with_differences_first() -> None:
    metrics = ("makespan", "throughput")
    study = made_up("today", "slower", metrics=metrics)
    results = synthetic_store(study, runs(0, 5), throughput=runs(0, 0))
    found = what_ifs(results, comparisons(results))
    assert sentence(results, found, (results.points[1], results.points[0])) == (
        "slower: worse: makespan +5.0 %; no statistically significant difference in throughput."
    )


def test_the_page_calls_points_by_their_names_in_one_table_and_one_picture() -> None:
    study = made_up("today", "a much faster hall", "slower")
    results = synthetic_store(study, runs(0, -5, 5))
    compared = comparisons(results)
    blocks = list(what_if_page(results, compared, ["a caveat"]))
    blocks += what_if_section(results, compared)
    assert sum(isinstance(block, Panels) for block in blocks) == 1
    text = as_text(ReportDocument("made up", blocks))
    assert text.count("verdict") == 1 and "a caveat" in text
    drawn = text.partition("Difference from today\n")[2].splitlines()
    assert drawn[0] == "makespan (%)" and drawn[1].split()[:4] == ["a", "much", "faster", "hall"]
    assert drawn[2].split()[0] == "slower" and "-o-" in drawn[2]
    assert "condition" not in text and "factor" not in text


def test_a_change_after_which_robots_stand_is_named_in_the_decision() -> None:
    results = synthetic_store(
        made_up("today", "one-way", "fast"),
        runs(0, -2, -2),
        deadlocks=lambda p, r: int(p < 2 and r == 0),
        jam=lambda p, r: "a jam" if p == 1 and r < 3 else None,
    )
    blocks = list(what_if_page(results, comparisons(results), []))
    text = " ".join(as_text(ReportDocument("made up", blocks)).split())
    assert "With one-way robots deadlock or jam in 3 of 8 runs (today: 1)." in text
    assert text.count("deadlock or jam") == 1


def test_each_metric_of_the_picture_has_a_scale_of_its_own() -> None:
    metrics = ("makespan", "late_share", "deadlocks")
    study = made_up("today", "slower", metrics=metrics)
    results = synthetic_store(
        study,
        runs(0, 50),
        late_share=lambda p, r: 0.01 + WAVE[r] / 1e5 + p * 0.002,
        deadlocks=lambda p, r: 1.0,
    )
    picture = what_if_picture(results, what_ifs(results, comparisons(results)))
    assert picture is not None
    assert [(one.title, one.y_label) for one in picture.charts] == [
        ("makespan", "%"),
        ("late_share", "percentage points"),
        ("deadlocks", "%"),
    ]
    time, share, none = (one.span for one in picture.charts)
    assert time[1] > 40 and 0.1 < share[1] < 0.4 and none == (0, 1)
    page = as_html(ReportDocument("made up", [picture]))
    assert page.count('<div class="panel">') == 3 and "<h4>Difference from today</h4>" in page
    drawn = as_text(ReportDocument("made up", [picture])).splitlines()
    assert [line for line in drawn if "(" in line] == [
        "makespan (%)", "late_share (percentage points)", "deadlocks (%)",
    ]  # fmt: skip
    assert as_markdown(ReportDocument("made up", [picture])).count("slower") == 3


def test_the_baseline_may_be_any_point_and_is_named_in_every_record() -> None:
    study = made_up("faster", "today", baseline="today")
    results = synthetic_store(study, runs(-5, 0))
    (record,) = what_if_records(results, comparisons(results))
    assert (record["point"], record["against"], record["verdict"]) == ("faster", "today", "better")
    assert record["low"] <= record["difference"] == record["mean"] - record["mean_against"] < 0


def test_each_scenario_has_its_own_baseline() -> None:
    study = Study(
        name="made up",
        scenario=("tabletop-1", "tabletop-2"),
        listed=({"name": "today"}, {"name": "slower", "set": {"fleet.robots": 2}}),
        replications=len(WAVE),
        analysis=Analysis(metrics=("makespan",)),
    )
    results = synthetic_store(study, runs(0, 5, 100, 95))
    found = what_ifs(results, comparisons(results))
    assert [(one.point.scenario, one.verdict) for one in found] == [
        ("tabletop-1", "worse"),
        ("tabletop-2", "better"),
    ]
    table = what_if_table(results, found)
    assert [row[0] for row in table.rows if row] == [
        "makespan in tabletop-1, ticks",
        "today",
        "slower",
        "makespan in tabletop-2, ticks",
        "today",
        "slower",
    ]


def test_changes_without_effect_seldom_get_a_verdict() -> None:
    assert false_verdicts(20, 100) <= 0.05 + 0.044  # 2 standard errors


@settings(max_examples=examples(60), deadline=None)
@given(
    differences=st.lists(st.floats(-20, 20).map(lambda one: round(one, 3)), min_size=8, max_size=8)
)
def test_a_verdict_is_what_its_interval_says_and_turns_with_the_baseline(
    differences: list[float],
) -> None:
    turned = {"better": "worse", "worse": "better"}
    found: list[WhatIf] = []
    for sign in (1, -1):
        study = made_up("today", "changed")
        results = synthetic_store(
            study, lambda p, r, sign=sign: 100 + WAVE[r] + (sign * differences[r] if p else 0)
        )
        found += what_ifs(results, comparisons(results))
        assert what_if_picture(results, found[-1:]) is not None
    one, other = found
    assert other.verdict == turned.get(one.verdict, one.verdict)
    assert one.comparison is not None
    interval = one.comparison.effect.difference
    assert interval.low is not None and interval.high is not None
    if not interval.warning.startswith("all runs"):
        assert (one.verdict in turned) == (interval.low > 0 or interval.high < 0)
