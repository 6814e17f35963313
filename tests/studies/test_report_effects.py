"""Main effects and interactions of factors, beside what they were made of."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from report_helpers import tables
from synthetic_results import noise, study_of, synthetic_store

from automaton.documents.report_document import Text
from automaton.studies.reports.comparison_tables import crossed, effects_section, factor_effects
from automaton.studies.sweeps.study import Analysis, Study

FACTORS = {"fleet.robots": (1, 2, 3), "strategy.allocation": ("a", "b")}
LEVELS = list(itertools.product(range(3), range(2)))


def test_effects_are_those_that_were_put_in() -> None:
    """100, 10 more for each robot, 5 more with b, and 4 more for 3 robots with b."""

    def value(point: int, replication: int) -> float:
        robots, allocation = LEVELS[point]
        both = 4 * (robots == 2 and allocation == 1)
        return 100.0 + 10 * robots + 5 * allocation + both + replication % 2

    results = synthetic_store(study_of(FACTORS), value)
    effects = factor_effects(results, "makespan")
    assert effects is not None
    differences = {
        (one.factor, one.level): one.difference.value for one in effects.main if one.difference
    }
    assert differences == pytest.approx(
        {
            ("fleet.robots", "2"): 10,
            ("fleet.robots", "3"): 22,
            ("strategy.allocation", "b"): 5 + 4 / 3,
        }
    )
    (interaction,) = effects.interactions
    assert interaction.levels == ("3", "b") and interaction.against == ("1", "a")
    assert interaction.difference is not None
    assert interaction.difference.value == pytest.approx(4)
    assert effects.family == 5  # two and one main effects, two of the pair
    assert sum(effects.shares.values()) == pytest.approx(1)


@pytest.mark.parametrize("common", [True, False])
def test_an_effect_that_is_nothing_but_round_off_is_0(common: bool) -> None:
    """0.1 + 0.7 and 0.3 + 0.5 are equal in the mean, and not as sums of floating-point numbers."""
    values = (0.1, 0.3, 0.7, 0.5)
    study = Study(
        name="made up",
        scenario="tabletop-mini",
        factors={"fleet.robots": (1, 2), "strategy.allocation": ("a", "b")},
        replications=10,
        common_random_numbers=common,
        analysis=Analysis(metrics=("makespan",)),
    )
    results = synthetic_store(study, lambda p, r: 1000 * values[p] + (r % 3) / 10)
    effects = factor_effects(results, "makespan")
    assert effects is not None
    by_level = {one.level: one.difference for one in effects.main}
    allocation = by_level["b"]
    assert allocation is not None and allocation.value == 0.0
    assert by_level["2"] is not None and by_level["2"].value == pytest.approx(400)


def test_shares_are_sums_of_squares() -> None:
    results = synthetic_store(study_of(FACTORS), noise)
    effects = factor_effects(results, "makespan")
    assert effects is not None
    means = np.array(
        [np.mean([noise(p, r) for r in range(60)]) for p in range(len(LEVELS))]
    ).reshape(3, 2)
    squares = ((means - means.mean()) ** 2).sum()
    rows = 2 * ((means.mean(axis=1) - means.mean()) ** 2).sum() / squares
    columns = 3 * ((means.mean(axis=0) - means.mean()) ** 2).sum() / squares
    assert effects.shares["fleet.robots",] == pytest.approx(rows)
    assert effects.shares["strategy.allocation",] == pytest.approx(columns)
    pair = effects.shares["fleet.robots", "strategy.allocation"]
    assert pair == pytest.approx(1 - rows - columns) and effects.shares[()] < 1e-9


@pytest.mark.parametrize("common", [True, False])
def test_intervals_hold_no_effect_as_often_as_is_said(common: bool) -> None:
    """400 studies without any effect, where seeds are common also with runs that correlate."""
    missed = 0
    for trial in range(400):
        rng = np.random.default_rng(trial)
        runs = rng.normal(100, 10, (6, 10)) + (rng.normal(0, 20, 10) if common else 0)
        study = Study(
            name="made up",
            scenario="tabletop-mini",
            factors=FACTORS,
            replications=10,
            common_random_numbers=common,
            analysis=Analysis(metrics=("makespan",)),
        )
        results = synthetic_store(study, lambda p, r, runs=runs: float(runs[p, r]))
        effects = factor_effects(results, "makespan")
        assert effects is not None
        intervals = [one.difference for one in effects.main if one.difference]
        missed += any(not one.holds(0) for one in intervals)
    assert 0 < missed / 400 <= 0.05 + 3 * (0.05 * 0.95 / 400) ** 0.5


def test_the_baseline_is_what_levels_are_compared_with() -> None:
    study = study_of(FACTORS, comparisons="baseline", baseline={"strategy.allocation": "b"})
    effects = factor_effects(synthetic_store(study, noise), "makespan")
    assert effects is not None
    against = {one.level: one.against for one in effects.main if one.factor != "fleet.robots"}
    assert against == {"b": "", "a": "b"}


def test_points_that_are_listed_one_by_one_are_not_crossed() -> None:
    study = Study(
        name="made up",
        scenario="tabletop-mini",
        listed=({"fleet.robots": 1}, {"fleet.robots": 2, "strategy.allocation": "b"}),
        replications=9,
        analysis=Analysis(metrics=("makespan",)),
    )
    results = synthetic_store(study, noise)
    assert crossed(results) is None
    texts = [block.text for block in effects_section(results) if isinstance(block, Text)]
    assert texts == ["Main effects cannot be estimated: the study does not cross its factors."]


def test_a_point_without_runs_leaves_no_effects() -> None:
    results = synthetic_store(study_of(FACTORS), lambda p, r: None if p == 4 else noise(p, r))
    assert factor_effects(results, "makespan") is None
    texts = [block.text for block in effects_section(results) if isinstance(block, Text)]
    assert texts == ["Main effects cannot be estimated: a point has no complete run with makespan."]


def test_tables_have_a_line_for_each_level_and_for_each_pair() -> None:
    main, pairs = tables(effects_section(synthetic_store(study_of(FACTORS), noise)))
    assert [list(row[:2]) for row in main.rows] == [
        ["robots", "1"],
        ["robots", "2"],
        ["robots", "3"],
        ["allocation", "a"],
        ["allocation", "b"],
    ]
    assert len(pairs.rows) == 1
