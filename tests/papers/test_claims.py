"""Verdicts on claims: what a number of runs can say of "always", "never" and shares."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from automaton.documents.report_document import ReportDocument
from automaton.documents.text_output import as_text
from automaton.papers.claim_report import bounds, evidence, panel_table
from automaton.papers.claims import Claim, Figure, Judged, MeanQuantity, judge, mean_of
from automaton.papers.reproduction_study import Case, MadeTable, PublishedTable, find
from automaton.studies.inference.proportions import exact_share

NEVER = Figure("runs that fail", lambda mean: mean("fails"), at_most=0, unit="%")
ALWAYS = replace(NEVER, label="runs that end", at_most=float("inf"), at_least=1)


def judged(figure: Figure, values: Sequence[float], others: Sequence[float] = ()) -> Judged:
    samples = {("fails", ()): values, ("others", ()): others}
    found = judge(Claim("It never fails", (figure,)), samples, {})
    assert found is not None and found.verdict == found.figures[0].verdict
    return found.figures[0]


@given(st.integers(1, 400).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_exact_shares_agree_with_scipy(case: tuple[int, int]) -> None:
    from scipy import stats  # here: a second for each worker that collects this module

    for level in (0.9, 0.95, 0.999):
        found = exact_share(*case, level)
        low, high = stats.binomtest(*case).proportion_ci(level, method="exact")
        assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))


def test_exact_shares_of_many_runs_agree_with_scipy() -> None:
    from scipy import stats

    for met, runs in ((0, 100_000), (1, 100_000), (50_000, 100_000), (99_999, 100_000)):
        low, high = stats.binomtest(met, runs).proportion_ci(method="exact")
        assert exact_share(met, runs)[1:3] == (pytest.approx(low), pytest.approx(high))
    assert exact_share(0, 60).high == pytest.approx(1 - 0.025 ** (1 / 60))


@pytest.mark.parametrize(("met", "runs", "level"), [(1, 0, 0.95), (3, 2, 0.95), (1, 2, 1.0)])
def test_what_is_no_share_is_refused(met: int, runs: int, level: float) -> None:
    with pytest.raises(ValueError, match="not a share"):
        exact_share(met, runs, level)


@pytest.mark.parametrize(("figure", "value"), [(NEVER, 0.0), (ALWAYS, 1.0)])
@pytest.mark.parametrize("runs", [1, 3, 60, 10_000])
def test_no_number_of_runs_shows_that_something_always_holds(
    figure: Figure, value: float, runs: int
) -> None:
    """Three runs once gave the interval 0 to 0 and "holds"; the twentieth was a counterexample."""
    found = judged(figure, [value] * runs)
    assert found.verdict == "not contradicted"
    assert found.otherwise == pytest.approx(1 - 0.025 ** (1 / runs))
    assert found.low is not None and found.high is not None
    assert found.high - found.low == pytest.approx(found.otherwise)
    said = evidence(judge(Claim("", (figure,)), {("fails", ()): [value] * runs}, {}))  # type: ignore[arg-type]
    assert said.startswith(f"at most {100 * found.otherwise:.1f} % of runs (95 %); runs that")


@pytest.mark.parametrize(("figure", "value"), [(NEVER, 0.0), (ALWAYS, 1.0)])
def test_one_counterexample_is_enough(figure: Figure, value: float) -> None:
    found = judged(figure, [value] * 999 + [1 - value])
    assert (found.verdict, found.otherwise) == ("does not hold", None)


def test_a_share_that_may_be_small_holds_once_there_are_enough_runs() -> None:
    seldom = replace(NEVER, at_most=0.05)
    verdicts = [judged(seldom, [0.0] * runs).verdict for runs in (3, 20, 71, 72, 200)]
    assert verdicts == ["undecided"] * 3 + ["holds"] * 2
    assert judged(seldom, [0.0, 1.0] * 30).verdict == "does not hold"


def test_other_figures_that_never_vary_have_no_interval() -> None:
    same = Figure("difference", lambda mean: mean("fails") - mean("others"), 0, 0)
    runs = [7.1, 9.3, 8.2]
    found = judged(same, runs, runs)
    assert (found.verdict, found.low, found.high) == ("not contradicted", None, None)
    assert found.otherwise == pytest.approx(0.7076, abs=1e-4)
    assert judged(same, runs, [one + 1 for one in runs]).verdict == "does not hold"
    count = Figure("robots that run empty", lambda mean: mean("fails"), at_least=0, strict=True)
    assert judged(count, [0.0] * 3).verdict == "does not hold"
    assert judged(count, [0.0, 2.0, 1.0]).verdict == "undecided"
    assert judged(count, [1.0, 2.0, 1.0] * 5).verdict == "holds"


def test_what_is_outside_in_every_run_does_not_hold_and_says_how_many_runs_may_be_otherwise() -> (
    None
):
    more = Figure("more", lambda mean: mean("fails"), at_least=0, strict=True)
    claim = Claim("It is more", (more,))
    for value in (-5.0, 0.0):
        found = judge(claim, {("fails", ()): [value] * 1000}, {}, {("fails", ()): "tour"})
        assert found is not None and found.verdict == "does not hold"
        said = evidence(found)
        assert said.startswith("at most 0.4 % of tours (95 %); more: "), said
        assert said.endswith("(in all 1,000 tours), needed above 0")
    assert judged(more, [-5.0]).verdict == "undecided", "one run"
    seldom = replace(ALWAYS, at_least=0.5)
    assert judged(seldom, [0.0] * 3).verdict == "undecided", "up to 70.8 % by Clopper and Pearson"


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"at_least": 0}, "at least 0"),
        ({"at_least": 0, "strict": True}, "above 0"),
        ({"at_most": 0}, "at most 0"),
        ({"at_most": 0, "strict": True}, "below 0"),
        ({"at_most": 0.5, "strict": True, "unit": "%"}, "below 50.0 %"),
        ({"at_most": 0, "unit": "%"}, "at most 0.0 %"),
    ],
)
def test_what_is_needed_says_whether_the_end_belongs_to_it(
    limits: dict[str, Any], words: str
) -> None:
    figure = Figure("figure", lambda mean: mean("fails"), **limits)
    assert bounds(judged(figure, [1.0, 2.0])) == words


MORE_OR_LESS = (
    "more", "less", "shorten", "longer", "faster", "earlier", "before", "cut", "beat", "rise", "higher",
    "smaller", "lower", "would have obtained",
)  # fmt: skip


@pytest.mark.parametrize("name", ["tabletop", "auctions", "traffic", "zoning", "auctions-floor"])
def test_a_claim_of_more_or_less_is_not_borne_out_by_as_much(name: str) -> None:
    """Where nothing differs in any run, nothing is shorter, faster or cheaper."""
    claims = [
        claim
        for claim in find(name).claims
        if any(word in claim.text.lower() for word in MORE_OR_LESS)
    ]
    assert claims
    for claim in claims:
        for figure in claim.figures:
            if 0 in (figure.at_least, figure.at_most):
                assert figure.strict or figure.at_least == figure.at_most, claim.text


def test_what_is_not_drawn_holds_by_a_single_run() -> None:
    certain = Figure("bid", lambda mean: mean("fails"), 9, 9, certain=True)
    assert judged(certain, [9.0]).verdict == judged(certain, [9.0] * 20).verdict == "holds"
    assert judged(certain, [8.0]).verdict == "does not hold"


def test_a_table_shows_the_bounds_of_a_share_of_runs() -> None:
    class Once:
        finished = True

        def __init__(self, empty: float, line: float) -> None:
            self.metrics = {"empty": empty, "line": line}

    table = PublishedTable(
        lambda strategies: [Case({"rule": "safe"})], (("empty", "line"),), lambda *_: None,
        shares=("empty", "line"),
    )  # fmt: skip
    runs = [Once(0.0, 0.2), Once(0.0, 0.3), Once(0.0, 0.4)]
    rows = MadeTable(table, table.cases(()), [runs]).rows()
    assert [row.exact is not None for row in rows] == [True, False]
    text = as_text(ReportDocument("", [panel_table(("empty", "line"), rows, table)]))
    assert "0.0 to 70.8 %" in text and "95 %" in text and "sd" in text


@pytest.mark.parametrize(
    ("combine", "result"),
    [
        (lambda a, b: a + b, 10),
        (lambda a, b: a - b, 6),
        (lambda a, b: a * b, 16),
        (lambda a, b: a / b, 4),
    ],
)
def test_quantities_are_reckoned_with_each_other_and_with_numbers(
    combine: Callable[[Any, Any], Any], result: float
) -> None:
    eight, two = mean_of("eight"), mean_of("two")
    for one, other in ((eight, two), (eight, 2.0), (8.0, two)):
        found = combine(one, other)
        assert isinstance(found, MeanQuantity)
        assert found(lambda name: {"eight": 8.0, "two": 2.0}[name]) == result
