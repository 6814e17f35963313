"""What a report says of pairs: whether they help, and how many runs a precision takes."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from synthetic_results import noise, study_of, synthetic_store

from automaton.documents.report_document import Table, Text
from automaton.studies.inference.intervals import effect, fewest, paired_runs, unpaired_runs
from automaton.studies.reports.comparison_tables import comparison_section
from automaton.studies.reports.comparisons import comparisons, pairing_remark
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import Study


def test_pairs_are_those_of_a_replication_that_both_finished() -> None:
    study = study_of({"fleet.robots": (1, 2)}, comparisons="pairs", paired=True)
    results = synthetic_store(
        study,
        lambda p, r: 100.0 + r + p,
        finished=lambda p, r: (p, r) != (0, 5),
    )
    one = comparisons(results)[0]
    assert one.runs == (59, 59)
    assert one.effect.difference.value == pytest.approx(1)
    assert one.effect.correlation == pytest.approx(1)
    assert "pairing helps" in pairing_remark([one], True)


@pytest.mark.parametrize(("common", "paired"), [(True, True), (False, False)])
def test_runs_with_the_same_seed_are_compared_in_pairs_unless_declared_otherwise(
    common: bool, paired: bool
) -> None:
    """Demand moves both fleets by 10, what is their own by 1; three runs failed, each of one fleet."""

    def ticks(point: int, replication: int) -> float:
        return 100.0 + (replication % 2 * 20 - 10) + noise(point, replication) / 10

    study = study_of({"fleet.robots": (1, 2)}, comparisons="pairs")
    study = replace(study, common_random_numbers=common)
    failed = {(0, 3), (0, 4), (1, 9)}
    results = synthetic_store(
        study, ticks, error=lambda p, r: "killed" if (p, r) in failed else None
    )
    (one,) = comparisons(results)
    assert one.effect.paired is study.paired is paired
    assert one.runs == ((57, 57) if paired else (59, 58))
    assert one.effect.difference.half is not None
    assert (one.effect.difference.half < 0.5) is paired
    declared = replace(study, analysis=replace(study.analysis, paired=False))
    (one,) = comparisons(synthetic_store(declared, ticks))
    assert not one.effect.paired


def test_the_report_says_if_pairing_does_not_help() -> None:
    study = study_of({"fleet.robots": (1, 2)}, comparisons="pairs", paired=True)
    results = synthetic_store(study, lambda p, r: 100.0 + (r if p else -r))
    texts = [block.text for block in comparison_section(results) if isinstance(block, Text)]
    assert any("variance ratio of pairs 2.00: pairing does not help" in text for text in texts)


def told(results: Results) -> tuple[list[str], Table]:
    """The sentences of the comparisons, and their table."""
    blocks = list(comparison_section(results))
    (table,) = (block for block in blocks if isinstance(block, Table))
    return [block.text for block in blocks if isinstance(block, Text)], table


def precise(**more: object) -> Study:
    return study_of({"fleet.robots": (1, 2)}, comparisons="pairs", precision=0.02, **more)


def test_correlated_runs_need_fewer_pairs_for_the_declared_precision() -> None:
    # Demand moves both fleets by +- 10, what is their own by +- 1: means 100 and 110.
    def ticks(point: int, replication: int) -> float:
        demand, own = replication % 2 * 20 - 10, (replication // 2 + point) % 2 * 2 - 1
        return 100.0 + 10 * point + demand + own

    texts, table = told(synthetic_store(precise(paired=True), ticks))
    cells = dict(zip(table.head, table.rows[0], strict=True))
    assert cells["correlation"] == "+0.98" and cells["var. ratio"] == "0.02"
    # sd of differences 2.02, of single runs 10.1, half an mean_interarrival_time: 2 % of 100
    assert (cells["needs paired"], cells["unpaired"]) == ("7", "199")
    said = "needs 7 runs per point paired and 199 unpaired"
    assert any(said in text and "pairing saves 96 %" in text for text in texts)


def test_where_pairs_do_not_help_the_report_says_so_for_the_precision_too() -> None:
    def against(point: int, replication: int) -> float:
        return 100.0 + (1 if point else -1) * (replication % 2 * 2 - 1)

    texts, table = told(synthetic_store(precise(), against))
    cells = dict(zip(table.head, table.rows[0], strict=True))
    assert int(cells["needs paired"]) > int(cells["unpaired"])
    assert any("runs per point paired" in text and "does not help" in text for text in texts)
    none = study_of({"fleet.robots": (1, 2)}, comparisons="pairs")
    texts, table = told(synthetic_store(none, against))
    assert "needs paired" not in table.head and not any("unpaired" in text for text in texts)


def test_runs_with_seeds_of_their_own_are_no_pairs() -> None:
    def together(point: int, replication: int) -> float:
        return 100.0 + 10 * point + (replication % 2 * 20 - 10) + noise(point, replication) / 100

    own_seeds = replace(precise(), common_random_numbers=False)
    texts, table = told(synthetic_store(own_seeds, together))
    cells = dict(zip(table.head, table.rows[0], strict=True))
    assert [cells[name] for name in ("correlation", "var. ratio", "needs paired")] == ["-"] * 3
    assert int(cells["unpaired"]) > 100
    assert not any("pairing" in text for text in texts)
    assert any(f"needs {cells['unpaired']} runs per point unpaired" in text for text in texts)


def test_runs_for_a_precision_by_hand_and_by_the_interval_they_give() -> None:
    # t(17) 2 / sqrt(18) = 0.995, t(16) 2 / sqrt(17) = 1.028
    assert fewest(variance=4.0, degrees=1.0, half=1.0, level=0.95) == 18
    assert fewest(0.0, 1.0, 1.0, 0.95) == 2
    with pytest.raises(ValueError, match="above 0"):
        fewest(1.0, 1.0, 0.0, 0.95)
    rng = np.random.default_rng(1)
    common = rng.normal(0, 3, 400)
    a, b = (common + rng.normal(0, 1, 400) for _ in range(2))
    for paired, needed in ((True, paired_runs), (False, unpaired_runs)):
        half = effect(a, b, paired).difference.half
        assert half is not None and needed(a, b, half) == pytest.approx(400, abs=1)
    saved = paired_runs(a, b, 0.1) / unpaired_runs(a, b, 0.1)
    assert saved == pytest.approx(effect(a, b).variance_ratio, rel=0.01)
