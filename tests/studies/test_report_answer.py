"""The answer on the first page of a report: the best point, or those that cannot be told apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import compress
from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from statistics_trials import lost_best
from synthetic_results import noise, study_of, synthetic_store

from automaton.documents.report_document import Curves, Listed, ReportDocument, Table, Text
from automaton.documents.text_output import as_text
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.studies.reports.comparison_tables import comparison_section, effects_section
from automaton.studies.reports.comparisons import (
    HIGHER_IS_BETTER,
    LOWER_IS_BETTER,
    Answer,
    answers,
    comparisons,
    direction_of,
    groups_by_condition,
)
from automaton.studies.reports.first_page import (
    alike_but_for_costs,
    answer_section,
    answer_sentence,
    answer_table,
    costs_of,
    decision,
    first_page,
    question,
    recommended,
)
from automaton.studies.reports.metric_tables import metric_section
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import RUN_METRICS, Analysis, Point, Study

pytest.importorskip("pyarrow")


def results_of(
    value: Callable[[int, int], float | None], robots: int = 3, runs: int = 60, **columns: Any
) -> Results:
    study = study_of({"fleet.robots": tuple(range(1, robots + 1))}, runs)
    return synthetic_store(study, value, **columns)


def sentence(results: Results) -> str:
    (answer,) = answers(results)
    return answer_sentence(results, answer)


def decided(results: Results) -> str:
    (answer,) = answers(results)
    return decision(results, answer)


def test_a_best_point_is_named_with_its_certainty() -> None:
    said = sentence(results_of(lambda p, r: noise(p, r) + 20 * abs(p - 1)))
    assert said.startswith("Best, with 95 % confidence: robots 2 (")
    assert said.endswith("None of the 3 points compared has a lower mean makespan.")


def test_points_that_cannot_be_told_apart_are_named_with_the_leading_one_first() -> None:
    results = results_of(lambda p, r: noise(0, r) + (50 if p == 0 else noise(p + 9, r) / 50))
    (answer,) = answers(results)
    assert answer.best is None
    assert {point.number for point in answer.candidates} == {1, 2}
    means = [
        np.mean(list(results.values(point, "makespan").values())) for point in answer.candidates
    ]
    assert means == sorted(means)
    said = answer_sentence(results, answer)
    assert said.startswith("No statistically significant difference between robots ")
    assert (
        "one of these 2 has the lowest mean makespan of the 3 points compared; the other is worse."
        in said
    )


def test_a_best_point_at_the_edge_of_what_was_tried_says_where_to_go_on() -> None:
    said = [decided(results_of(lambda p, r, b=b: noise(p, r) + 20 * abs(p - b))) for b in range(3)]
    edge = "The best is at the limit of the tested range: try more than 3 robots."
    assert [edge in one for one in said] == [False, False, True]
    assert "edge" not in said[0] + said[1]  # fewer than 1 robot there are not


def test_the_fewest_robots_that_may_be_the_best_are_enough() -> None:
    """Three robots are ahead of two by chance; one is worse. A decision never begins with doubts."""
    lead = lambda p, r: (50.0, 0.5 * (-1) ** r, -0.01)[p]  # noqa: E731
    results = results_of(lambda p, r: noise(0, r) + lead(p, r))
    (answer,) = answers(results)
    assert [point.number for point in answer.candidates] == [2, 1]
    assert recommended(answer) is answer.candidates[1]
    said = decided(results)
    assert said.startswith("2 robots are enough: mean makespan ")
    assert "more (+0.0 %) than 3 robots, which is not significant and at most 0.2 %." in said


def test_fewer_robots_are_not_enough_for_want_of_runs() -> None:
    """Two robots may be as good as three, or much worse: nobody knows yet."""
    lead = lambda p, r: (80.0, 40.0 * (-1) ** r + 5, 0.0)[p]  # noqa: E731
    results = results_of(lambda p, r: noise(0, r) + lead(p, r))
    (answer,) = answers(results)
    assert [point.number for point in answer.candidates] == [2, 1]
    assert recommended(answer) is answer.leading
    said = decided(results)
    assert said.startswith("3 robots: the lowest mean makespan, ")
    assert "Make more runs to see whether 2 robots are enough." in said


def test_a_point_that_does_not_list_a_cost_is_not_cheaper_for_that() -> None:
    """Its number of stations is unknown here, and one with more stations is not cheaper either."""
    levels = (
        {"fleet.robots": 3, "floor.open_stations": 2},
        {"fleet.robots": 2},
        {"fleet.robots": 2, "floor.open_stations": 3},
        {"fleet.robots": 2, "floor.open_stations": 2},
    )
    points = tuple(Point(n, "site", one) for n, one in enumerate(levels))
    assert [costs_of(point) for point in points] == [[3, 2], [2], [2, 3], [2, 2]]
    answer = Answer("makespan", "lowest", "", points, points, (), (), 0)
    assert [one.number for one in alike_but_for_costs(answer)] == [0, 3]


def test_points_that_differ_in_more_than_robots_are_not_called_enough() -> None:
    factors = {"fleet.robots": (1, 2), "strategy.allocation": ("a", "b")}
    results = synthetic_store(
        study_of(factors), lambda p, r: noise(p, r) - 5 * (p == 3) + 30 * (p == 1)
    )
    (answer,) = answers(results)
    assert len(answer.candidates) > 1 and recommended(answer) is not None
    assert decided(results).startswith("robots 2, allocation b: the lowest mean makespan, ")


def test_a_decision_without_enough_runs_says_what_to_do() -> None:
    assert decided(results_of(noise, runs=1)).startswith("Make more runs: no point has two runs")
    only = results_of(noise, finished=lambda p, r: p == 1)
    assert decided(only).startswith(
        "Take robots 2: no other point has usable results (mean makespan "
    )


def test_the_table_of_the_answer_says_what_its_heads_mean() -> None:
    study = study_of({"fleet.robots": (1, 2)}, comparisons="baseline", baseline={"fleet.robots": 1})
    results = synthetic_store(study, lambda p, r: noise(p, r) - 20 * p)
    page = list(answer_section(results, answers(results), comparisons(results)))
    at = next(number for number, block in enumerate(page) if isinstance(block, Table))
    baseline, adjusted = (str(block.text) for block in page[at + 1 : at + 3])
    assert baseline.startswith("baseline: ") and baseline.endswith(
        "fleet.robots 1, as the study declares."
    )
    assert adjusted.startswith("adjusted p: ") and "below 0.05" in adjusted


def test_of_throughput_the_highest_is_the_best() -> None:
    study = Study(
        name="made up",
        scenario="tabletop-mini",
        factors={"fleet.robots": (1, 2)},
        replications=60,
        analysis=Analysis(metrics=("throughput",)),
    )
    results = synthetic_store(study, noise, throughput=lambda p, r: noise(p, r) + 30 * p)
    (answer,) = answers(results)
    assert answer.best is not None and answer.best.number == 1
    assert "has a higher mean throughput" in answer_sentence(results, answer)


def test_a_metric_that_is_not_better_low_or_high_has_no_best_point() -> None:
    study = Study(
        name="made up",
        scenario="tabletop-mini",
        factors={"fleet.robots": (1, 2)},
        replications=9,
        analysis=Analysis(metrics=("redesigns",)),
    )
    results = synthetic_store(study, noise, redesigns=lambda p, r: 5.0 + p)
    (answer,) = answers(results)
    assert answer.better is None and answer.best is None
    assert answer_sentence(results, answer).startswith(
        "No best point: redesigns has no better direction"
    )


def test_a_point_whose_runs_failed_or_did_not_finish_is_never_the_best() -> None:
    """Its mean leaves out just the runs that went wrong, and says so."""
    results = results_of(
        lambda p, r: noise(p, r) - 50 * (p == 0),
        finished=lambda p, r: p > 0 or r > 2,
        error=lambda p, r: "it broke" if p == 1 and r == 5 else None,
    )
    (answer,) = answers(results)
    assert answer.best is None
    assert [point.number for point in answer.candidates] == [2, 0, 1]
    assert answer_sentence(results, answer).endswith(
        "Not called best, because runs are left out: robots 1 (3 of 60 runs did not finish; the mean is "
        "too low); robots 2 (1 of 60 runs failed; the mean may be biased)."
    )


def test_a_point_that_is_worse_even_without_its_unfinished_runs_is_worse() -> None:
    results = results_of(
        lambda p, r: noise(p, r) + 50 * (p == 0), 2, finished=lambda p, r: p > 0 or r > 2
    )
    said = sentence(results)
    assert said.startswith("Best, with 95 % confidence: robots 2 (")
    assert "robots 1 (3 of 60 runs did not finish; the mean is too low)" in said
    table = next(b for b in metric_section(results, {}, "makespan") if isinstance(b, Table))
    assert [row[table.head.index("bias")] for row in table.rows] == ["too low", "-"]


def test_a_day_that_ended_deadlocked_counts_and_lacks_only_what_needs_the_end() -> None:
    """With a limit that is an end, the row is complete: throughput counts it, makespan cannot."""
    analysis = Analysis(metrics=("throughput", "makespan"))
    study = Study(
        name="n",
        scenario="n",
        factors={"fleet.robots": (1, 2)},
        replications=20,
        analysis=analysis,
    )
    jammed = lambda p, r: p == 0 and r < 3  # noqa: E731
    results = synthetic_store(
        study,
        lambda p, r: None if jammed(p, r) else noise(p, r),
        throughput=lambda p, r: 5.0 if jammed(p, r) else noise(p, r),
    )
    (answer,) = answers(results)
    assert answer.incomplete == () and len(answer.against) == 1
    assert len(results.values(study.points[0], "throughput")) == 20
    for metric, is_named in (("throughput", False), ("makespan", True)):
        blocks = metric_section(results, {}, metric)
        items = [item for block in blocks if isinstance(block, Listed) for item in block.items]
        assert (
            f"robots 1: 3 of 20 runs have no {metric}; the mean is too low" in items
        ) == is_named


def test_a_point_that_lacks_planned_runs_is_never_the_best() -> None:
    """An interrupted sweep: the runs that robots 1 has may be the short ones."""
    whole = results_of(noise, runs=10)
    there = [key != "0-9" for key in whole.columns["key"]]
    lacking = replace(
        whole, columns={name: list(compress(own, there)) for name, own in whole.columns.items()}
    )
    (answer,) = answers(lacking)
    assert [point.number for point in answer.incomplete] == [0]
    assert "robots 1 (1 of 10 runs are not done yet)." in answer_sentence(lacking, answer)


def test_a_point_with_runs_that_were_not_measured_is_never_the_best() -> None:
    results = results_of(lambda p, r: None if (p, r) == (0, 3) else noise(p, r) - 50 * (p == 0))
    (answer,) = answers(results)
    assert [point.number for point in answer.incomplete] == [0]
    assert answer.best is None and answer.leading is not answer.incomplete[0]


@settings(max_examples=examples(150), deadline=None)
@given(data=st.data())
def test_the_first_page_and_the_table_never_contradict_each_other(data: st.DataObject) -> None:
    """Best: better in the table than all others; and better than all others: best."""
    points, runs = data.draw(st.integers(2, 4)), data.draw(st.integers(2, 7))
    declared = data.draw(st.sampled_from(("pairs", "baseline", "none")))
    kinds = st.sampled_from((0.0, 1.0, 100.0)) | st.floats(0.1, 1e3)
    far = [data.draw(st.sampled_from((0, 0, 30, 300))) for _ in range(points)]
    values = [[data.draw(kinds) + shift for _ in range(runs)] for shift in far]
    lost = [data.draw(st.sampled_from((0, 0, 0, 1, runs - 1))) for _ in range(points)]
    metric = data.draw(st.sampled_from(("makespan", "throughput")))
    analysis = Analysis(
        metrics=(metric, "delay"),
        family=data.draw(st.sampled_from(("study", "metric"))),
        comparisons=declared,
        baseline={"strategy.allocation": "0"} if declared == "baseline" else None,
    )
    study = Study(
        name="n",
        scenario="n",
        factors={"strategy.allocation": tuple(map(str, range(points)))},
        replications=runs,
        common_random_numbers=data.draw(st.booleans()),
        analysis=analysis,
    )
    of = lambda p, r: values[p][r]  # noqa: E731
    complete = lambda p, r: r >= lost[p]  # noqa: E731
    results = synthetic_store(study, of, throughput=of, delay=lambda p, r: r + p, finished=complete)
    compared = comparisons(results)
    (answer,) = answers(results, compared)
    sign = -1 if metric == "throughput" else 1
    beaten: dict[int, set[int]] = {p: set() for p in range(points)}  # as the table shows
    for one in (one for one in compared if one.metric == metric):
        low, high = one.effect.difference.low, one.effect.difference.high
        excludes_0 = low is not None and high is not None and (low > 0 or high < 0)
        has_width = low != high  # neither without spread nor with too few runs
        assert one.is_significant == excludes_0 or not has_width, "interval and p agree"
        ends = (one.a, one.b) if sign * one.effect.difference.value < 0 else (one.b, one.a)
        if one.is_significant:
            beaten[ends[0].number].add(ends[1].number)
        elif answer.best is not None:
            assert answer.best not in (one.a, one.b), "best, and no difference in the table"
    said = answer_sentence(results, answer)
    assert said.startswith("Best") == (answer.best is not None)
    assert len(answer.compared) > 2 or "one of these" not in said
    if answer.best is not None:
        assert not any(answer.best.number in worse for worse in beaten.values())
        assert not lost[answer.best.number]
    measured = {p for p in range(points) if runs - lost[p] >= 2}
    for point, worse in beaten.items():
        if declared == "pairs" and not lost[point] and worse == measured - {point} and worse:
            assert answer.best is not None and answer.best.number == point


def test_two_points_without_a_difference_are_not_one_of_two() -> None:
    said = sentence(results_of(noise, 2, runs=10))
    assert said.startswith("No statistically significant difference between robots 1 (")
    assert "one of these" not in said


def test_what_two_sided_tests_do_not_show_is_not_called_best() -> None:
    """p = 0.084, two-sided: one-sided it would be below 0.05, and the page said "Best"."""
    said = []
    for shift in np.linspace(0, 2, 81):
        results = results_of(lambda p, r, s=shift: 10 + p * (s + (3 - r % 7) / 3), 2, runs=8)
        (answer,) = answers(results)
        (against,) = answer.against
        said.append((answer.best is not None, against.effect.p < 0.05, against.effect.p < 0.1))
    assert all(is_best == is_sure for is_best, is_sure, _ in said)
    assert {(False, False, True), (True, True, True), (False, False, False)} == set(said)


def test_a_wide_interval_of_three_runs_is_printed_nowhere() -> None:
    study = study_of({"fleet.robots": (1, 2)}, 3, comparisons="pairs")
    for spread, is_vague in ((300, True), (1, False)):
        results = synthetic_store(study, lambda p, r, s=spread: 200 + s * (r - 1) * (1 - 2 * p))
        document = ReportDocument("few", list(first_page(results, answers(results), [])))
        document.add(*answer_section(results, answers(results), comparisons(results)))
        for section in (metric_section(results, {}, "makespan"), comparison_section(results)):
            document.add(*section)
        document.add(*effects_section(results))
        said = " ".join(as_text(document).split())
        assert ("200 ticks, too few runs for an interval" in said) == is_vague
        for table in (block for block in document.blocks if isinstance(block, Table)):
            for name in {"95 % low", "low"} & set(table.head):
                low = [row[table.head.index(name)] for row in table.rows]
                assert ("too few runs" in low) == is_vague


def test_without_runs_there_is_no_answer() -> None:
    assert sentence(results_of(noise, runs=1)).startswith(
        "No answer: no point has at least two complete runs"
    )


def test_equal_runs_are_one_point() -> None:
    same = lambda p, r: f"{min(p, 1)}-{r}"  # noqa: E731
    results = results_of(lambda p, r: noise(min(p, 1), r) + 40 * (p == 0), digest=same)
    (answer,) = answers(results)
    assert [point.number for point in answer.compared] == [0, 1]
    assert answer.best is not None
    assert "the same runs as robots 3" in answer_sentence(results, answer)


def test_runs_without_spread_are_judged_by_a_permutation_test() -> None:
    """Two of 2 ** 3 ways are not rare enough; of 2 ** 8 they are."""
    for runs, is_certain in ((3, False), (8, True)):
        (answer,) = answers(results_of(lambda p, r: 100.0 + p, robots=2, runs=runs))
        assert (answer.best is not None) == is_certain


def test_the_best_of_equal_points_is_left_out_as_seldom_as_is_said() -> None:
    share = lost_best(n=12, studies=1000)
    assert 0 < share <= 0.05 + 3 * (0.05 * 0.95 / 1000) ** 0.5


def test_conditions_have_answers_of_their_own_that_hold_together() -> None:
    factors = {"orders.mean_interarrival_time": (8, 11), "strategy.routing": ("a", "b")}
    results = synthetic_store(study_of(factors), lambda p, r: noise(p, r) + 30 * (p in (0, 3)))
    given = answers(results)
    assert [one.conditions for one in given] == [
        "mean_interarrival_time 8",
        "mean_interarrival_time 11",
    ]
    assert [one.best.number for one in given if one.best] == [1, 2]
    assert {one.family for answer in given for one in answer.against} == {2}
    said = answer_sentence(results, given[0])
    assert said.startswith("mean_interarrival_time 8: Best, with 95 % confidence: routing b (")
    assert "for each mean_interarrival_time (8, 11)?" in question(results)


def test_what_would_be_a_condition_is_compared_if_nothing_else_varies() -> None:
    results = synthetic_store(study_of({"durations.turn": (1, 2)}), noise)
    assert list(groups_by_condition(results)) == [""]


def test_the_first_page_compares_with_the_baseline_and_has_one_picture() -> None:
    factors = {"fleet.robots": (1, 2), "strategy.allocation": ("a", "b")}
    study = study_of(factors, comparisons="baseline", baseline={"strategy.allocation": "a"})
    results = synthetic_store(study, lambda p, r: noise(p, r) - 30 * (p == 3))
    blocks = list(first_page(results, answers(results), ["a remark"]))
    given = answer_section(results, answers(results), comparisons(results))
    (table,) = (block for block in given if isinstance(block, Table))
    declared = next(one for one in comparisons(results) if one.a.number == 3)
    assert table.head[0] == "best point"
    assert list(table.rows[0][:1]) == ["robots 2, allocation b"]
    assert table.rows[0][2] == "robots 2, allocation a"
    assert table.rows[0][4].value == declared.effect.difference.value  # type: ignore[attr-defined]
    (drawn,) = (block for block in blocks if isinstance(block, Curves))
    assert drawn.title == "makespan by fleet.robots"
    assert next(b.text for b in blocks if isinstance(b, Text) and b.strong).startswith(
        "robots 2, allocation b: the lowest mean makespan, "
    )
    assert blocks[-1] == Listed(["a remark"])


def test_a_baseline_that_leads_is_called_so() -> None:
    study = study_of(
        {"strategy.allocation": ("a", "b")},
        comparisons="baseline",
        baseline={"strategy.allocation": "a"},
    )
    results = synthetic_store(study, lambda p, r: noise(p, r) + 30 * p)
    table = answer_table(results, answers(results), comparisons(results))
    assert table is not None and table.rows[0][2] == "is the baseline"


def test_where_all_runs_failed_the_page_says_so() -> None:
    study = Study(
        name="made up", scenario="tabletop-mini", factors={"fleet.robots": (1, 2)}, replications=2
    )
    results = synthetic_store(study, lambda p, r: None, error=lambda p, r: "it broke")
    blocks = list(first_page(results, answers(results), ["2 runs failed"]))
    assert Text("Sweep again: no run has metrics yet.", strong=True) in blocks
    assert blocks[-1] == Listed(["2 runs failed"])


def test_without_numbers_the_picture_is_over_names() -> None:
    results = synthetic_store(study_of({"strategy.allocation": ("a", "b", "c")}), noise)
    blocks = first_page(results, answers(results), [])
    (drawn,) = (block for block in blocks if isinstance(block, Curves))
    assert drawn.x == [0, 1, 2] and list(drawn.x_names) == ["a", "b", "c"]


def test_directions_are_of_metrics_that_there_are() -> None:
    known = {*METRIC_CATALOGUE, *RUN_METRICS}
    assert known >= HIGHER_IS_BETTER | LOWER_IS_BETTER
    assert not HIGHER_IS_BETTER & LOWER_IS_BETTER
    assert direction_of("lost_waiting") == "lowest" and direction_of("my_counter") is None
