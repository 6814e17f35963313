"""Points whose runs are the same, digest by digest: named, and no comparisons."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_up_results import made_up, noise, study_of
from msgspec.structs import replace

from automaton.__main__ import main
from automaton.experiments.study import Study
from automaton.reporting.comparing import comparisons, left_out
from automaton.reporting.document import Table, Text
from automaton.reporting.figures import metric_section
from automaton.reporting.results import Results
from automaton.reporting.same_runs import same_remarks
from automaton.reporting.sections import comparison_section

FLEETS = {"fleet.robots": (1, 2), "strategy.right_of_way": ("wait", "withdraw")}


def one_robot_has_nobody_to_give_way_to(study: Study) -> Results:
    """Points 0 and 1: one robot under both rules; 2 and 3: two robots, where the rule counts."""

    def real(point: int) -> int:
        return 0 if point == 1 else point

    return made_up(study, lambda p, r: noise(real(p), r), digest=lambda p, r: f"{real(p)}-{r}")


def against(baseline: str = "wait", **more: object) -> Study:
    return study_of(
        FLEETS, comparisons="baseline", baseline={"strategy.right_of_way": baseline}, **more
    )


@pytest.mark.parametrize("family", ["study", "metric"])
def test_the_same_runs_leave_the_family(family: str) -> None:
    """Two comparisons were declared; one is left, and pays for itself alone."""
    results = one_robot_has_nobody_to_give_way_to(against(family=family))
    (found,) = comparisons(results)
    assert (found.a.number, found.b.number, found.family) == (3, 2, 1)
    assert found.adjusted == found.effect.p and found.effect.difference.level == 0.95
    assert left_out(results) == 1
    texts = [block.text for block in comparison_section(results) if isinstance(block, Text)]
    assert texts[0].startswith("1 comparison left out of the family: the same runs")


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
    (table,) = (b for b in metric_section(results, {}, "T_total") if isinstance(b, Table))
    at = table.head.index("the same runs as")
    assert [row[at] for row in table.rows] == ["-", "point 0", "-", "-"]


def test_a_factor_without_any_effect_is_named_without_a_place() -> None:
    results = made_up(against(), lambda p, r: noise(p // 2, r), digest=lambda p, r: f"{p // 2}-{r}")
    (remark,) = same_remarks(results)
    assert remark.startswith("strategy.right_of_way has no effect: ")
    assert comparisons(results) == []
    texts = [block.text for block in comparison_section(results) if isinstance(block, Text)]
    assert texts[1:] == ["None is left."]


def test_two_levels_of_three_with_the_same_runs_are_named_by_their_points() -> None:
    study = study_of({"strategy.right_of_way": ("wait", "queue", "withdraw")}, comparisons="pairs")
    results = made_up(study, lambda p, r: noise(p and 1, r), digest=lambda p, r: f"{p and 1}-{r}")
    assert list(same_remarks(results)) == ["the same runs, digest by digest: point 2 and point 1"]


def test_runs_that_failed_do_not_hide_that_the_others_are_the_same() -> None:
    results = made_up(
        against(),
        lambda p, r: noise(p // 2, r),
        digest=lambda p, r: f"{p // 2}-{r}",
        failed=lambda p, r: "killed" if (p, r) == (1, 7) else None,
    )
    assert comparisons(results) == []


def test_one_run_that_differs_is_enough_to_compare() -> None:
    def differs(point: int, replication: int) -> bool:
        return point % 2 == 1 and replication == 59

    results = made_up(
        against(),
        lambda p, r: noise(p // 2, r) + differs(p, r),
        digest=lambda p, r: f"{p // 2}-{r}{differs(p, r)}",
    )
    assert len(comparisons(results)) == 2 and list(same_remarks(results)) == []


def test_equal_digests_of_other_seeds_are_not_the_same_runs() -> None:
    own_seeds = replace(against(), common_random_numbers=False)
    results = made_up(own_seeds, noise, seed=lambda p, r: 1000 * p + r, digest=lambda p, r: f"{r}")
    assert len(comparisons(results)) == 2


def test_the_same_runs_measured_otherwise_are_compared() -> None:
    """A warm-up changes what is counted of a run, not the run."""
    results = made_up(against(), noise, digest=lambda p, r: f"{p // 2}-{r}")
    assert len(comparisons(results)) == 2 and left_out(results) == 0


def test_one_robot_gives_the_same_runs_under_every_right_of_way(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = tmp_path / "rules.yaml"
    study.write_text(
        "name: rules\nscenario: tabletop-mini\nfactors:\n  fleet.robots: [1, 2]\n"
        "  strategy.right_of_way: [wait, withdraw]\nreplications: 3\nanalysis:\n"
        "  metrics: [blocked]\n  baseline: {strategy.right_of_way: wait}\n"
        "  comparisons: baseline\n"
    )
    out = str(tmp_path / "results")
    assert main(["sweep", str(study), "--out", out, "--workers", "1"]) in (0, 1)
    assert main(["report", out]) == 0
    text = capsys.readouterr().out
    assert "strategy.right_of_way has no effect with robots 1" in text
    assert "the same runs as" in text
