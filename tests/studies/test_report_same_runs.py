"""Points whose runs are the same, digest by digest: named, and no comparisons."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace
from synthetic_results import noise, study_of, synthetic_store

from automaton.commands import main
from automaton.documents.report_document import Table, Text
from automaton.studies.reports.comparison_tables import comparison_section
from automaton.studies.reports.comparisons import comparisons, left_out
from automaton.studies.reports.metric_tables import metric_section, same_remarks
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import Study

FLEETS = {"fleet.robots": (1, 2), "strategy.right_of_way": ("wait", "retreat")}


def one_robot_has_nobody_to_give_way_to(study: Study) -> Results:
    """Points 0 and 1: one robot under both rules; 2 and 3: two robots, where the rule counts."""

    def real(point: int) -> int:
        return 0 if point == 1 else point

    return synthetic_store(
        study, lambda p, r: noise(real(p), r), digest=lambda p, r: f"{real(p)}-{r}"
    )


def against(baseline: str = "wait", **more: object) -> Study:
    return study_of(
        FLEETS, comparisons="baseline", baseline={"strategy.right_of_way": baseline}, **more
    )


@pytest.mark.parametrize("family", ["study", "metric"])
def test_the_same_runs_leave_the_family(family: str) -> None:
    """Two comparisons were declared; one is left, beside the two that the best point may need."""
    results = one_robot_has_nobody_to_give_way_to(against(family=family))
    (found,) = comparisons(results)
    assert (found.a.number, found.b.number, found.family) == (3, 2, 3)
    assert found.adjusted == min(1.0, 3 * found.effect.p)
    assert found.effect.difference.level == pytest.approx(1 - 0.05 / 3)
    assert left_out(results) == 1
    texts = [block.text for block in comparison_section(results) if isinstance(block, Text)]
    assert texts[0].startswith("1 comparison excluded from the family: between identical runs")


def test_what_is_compared_with_both_counts_once() -> None:
    """Of six pairs one is of the same runs, and two are repeated by their twins."""
    results = one_robot_has_nobody_to_give_way_to(study_of(FLEETS, comparisons="pairs"))
    pairs = [(one.a.number, one.b.number) for one in comparisons(results)]
    assert pairs == [(2, 0), (3, 0), (3, 2)] and left_out(results) == 3
    assert all(one.family == 3 for one in comparisons(results))


def test_the_inert_factor_is_named_and_every_table_says_where() -> None:
    results = one_robot_has_nobody_to_give_way_to(against())
    (remark,) = same_remarks(results)
    assert remark.startswith("strategy.right_of_way has no effect with robots 1: its levels give")
    (table,) = (b for b in metric_section(results, {}, "makespan") if isinstance(b, Table))
    at = table.head.index("same runs as")
    assert [row[at] for row in table.rows] == ["-", "point 0", "-", "-"]


def test_a_factor_without_any_effect_is_named_without_a_place() -> None:
    results = synthetic_store(
        against(), lambda p, r: noise(p // 2, r), digest=lambda p, r: f"{p // 2}-{r}"
    )
    (remark,) = same_remarks(results)
    assert remark.startswith("strategy.right_of_way has no effect: ")
    assert comparisons(results) == []
    texts = [block.text for block in comparison_section(results) if isinstance(block, Text)]
    assert texts[1:] == ["No comparison is left."]


def test_two_levels_of_three_with_the_same_runs_are_named_by_their_points() -> None:
    study = study_of({"strategy.right_of_way": ("wait", "queue", "retreat")}, comparisons="pairs")
    results = synthetic_store(
        study, lambda p, r: noise(p and 1, r), digest=lambda p, r: f"{p and 1}-{r}"
    )
    assert list(same_remarks(results)) == ["identical runs (equal digests): point 2 and point 1"]


def test_runs_that_failed_do_not_hide_that_the_others_are_the_same() -> None:
    results = synthetic_store(
        against(),
        lambda p, r: noise(p // 2, r),
        digest=lambda p, r: f"{p // 2}-{r}",
        error=lambda p, r: "killed" if (p, r) == (1, 7) else None,
    )
    assert comparisons(results) == []


def test_one_run_that_differs_is_enough_to_compare() -> None:
    def differs(point: int, replication: int) -> bool:
        return point % 2 == 1 and replication == 59

    results = synthetic_store(
        against(),
        lambda p, r: noise(p // 2, r) + differs(p, r),
        digest=lambda p, r: f"{p // 2}-{r}{differs(p, r)}",
    )
    assert len(comparisons(results)) == 2 and list(same_remarks(results)) == []


def test_equal_digests_of_other_seeds_are_not_the_same_runs() -> None:
    own_seeds = replace(against(), common_random_numbers=False)
    results = synthetic_store(
        own_seeds, noise, seed=lambda p, r: 1000 * p + r, digest=lambda p, r: f"{r}"
    )
    assert len(comparisons(results)) == 2


def test_the_same_runs_measured_otherwise_are_compared() -> None:
    """A warm-up changes what is counted of a run, not the run."""
    results = synthetic_store(against(), noise, digest=lambda p, r: f"{p // 2}-{r}")
    assert len(comparisons(results)) == 2 and left_out(results) == 0


def test_a_warm_up_changes_no_run_but_what_is_measured() -> None:
    """Points 1 and 2 count alike; 0 does not. One comparison is left, and no remark denies it."""
    study = study_of({"measure.warm_up": (0, 100, 200)}, comparisons="pairs")
    results = synthetic_store(study, lambda p, r: noise(p and 1, r), digest=lambda p, r: f"{r}")
    assert [(one.a.number, one.b.number) for one in comparisons(results)] == [(1, 0)]
    assert left_out(results) == 2
    assert list(same_remarks(results)) == [
        "measure.warm_up does not change the runs: its levels give identical runs (equal digests), "
        "measured differently (makespan)"
    ]


def test_a_figure_that_only_one_of_two_points_has_is_measured_otherwise() -> None:
    results = synthetic_store(
        against(),
        lambda p, r: noise(0, r) if p % 2 == 0 or r < 30 else None,
        digest=lambda p, r: f"{p // 2}-{r}",
    )
    (remark,) = same_remarks(results)
    assert "measured differently" in remark and left_out(results) == 0


def test_one_seed_in_common_is_too_little() -> None:
    """59 of the 60 runs of point 1 failed; the last one is that of point 0."""
    results = synthetic_store(
        study_of({"fleet.robots": (1, 2)}, comparisons="pairs"),
        noise,
        digest=lambda p, r: "x" if r == 0 else f"{p}-{r}",
        error=lambda p, r: "killed" if p == 1 and r > 0 else None,
    )
    assert left_out(results) == 0 and list(same_remarks(results)) == []


def test_points_that_differ_where_a_third_failed_are_compared() -> None:
    """Point 0 is the same as 1 and as 2 on its 30 seeds; those two differ on the other 30."""
    results = synthetic_store(
        study_of({"fleet.robots": (1, 2, 3)}, comparisons="pairs"),
        lambda p, r: noise(p == 2 and r >= 30, r),
        digest=lambda p, r: f"{p if p == 2 and r >= 30 else 1}-{r}",
        error=lambda p, r: "killed" if p == 0 and r >= 30 else None,
    )
    assert [(one.a.number, one.b.number) for one in comparisons(results)] == [(2, 1)]
    (remark,) = same_remarks(results)
    assert remark.startswith("identical runs (equal digests): "), "the factor has an effect"


def test_comparisons_with_twins_of_fewer_runs_are_comparisons_of_their_own() -> None:
    """Point 1 is point 0 without seed 7: what is compared with both rests on other runs."""
    results = synthetic_store(
        study_of({"fleet.robots": (1, 2, 3)}, comparisons="pairs"),
        lambda p, r: noise(p // 2, r),
        digest=lambda p, r: f"{p // 2}-{r}",
        error=lambda p, r: "killed" if (p, r) == (1, 7) else None,
    )
    assert [(a.number, b.number) for _, a, b, *_ in comparisons(results)] == [(2, 0), (2, 1)]


def test_the_search_for_the_same_runs_reads_each_run_once() -> None:
    """Thirty points of the same runs need no look at each of their 435 pairs, run by run."""

    class Counting(str):
        looks = 0

        def __eq__(self, other: object) -> bool:
            Counting.looks += 1
            return super().__eq__(other)

        __hash__ = str.__hash__

    study = study_of({"fleet.robots": tuple(range(1, 31))}, comparisons="none")
    results = synthetic_store(study, lambda p, r: noise(0, r), digest=lambda p, r: Counting(r))
    assert len(results.repeats) == 29
    assert len(list(same_remarks(results))) == 1
    assert Counting.looks < 10 * 30 * 60, "against 435 * 60 for all pairs"


def test_one_robot_gives_the_same_runs_under_every_right_of_way(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    study = tmp_path / "rules.yaml"
    study.write_text(
        "name: rules\nscenario: tabletop-mini\nfactors:\n  fleet.robots: [1, 2]\n"
        "  strategy.right_of_way: [wait, retreat]\nreplications: 3\nanalysis:\n"
        "  metrics: [blocked_share]\n  baseline: {strategy.right_of_way: wait}\n"
        "  comparisons: baseline\n"
    )
    out = str(tmp_path / "results")
    assert main(["sweep", str(study), "--out", out, "--workers", "1"]) in (0, 1)
    assert main(["report", out]) == 0
    text = capsys.readouterr().out
    assert "strategy.right_of_way has no effect with robots 1" in text
    assert "same runs as" in text
