"""Intervals, effects, families: known values, properties, and coverage in small."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statistics_trials import coverage, drawn_from, false_families

from automaton.studies.inference.intervals import (
    STUDENT_MIN_RUNS,
    bonferroni,
    effect,
    incomplete_beta,
    mean_interval,
    skewness,
    student,
    tails,
)

NUMBERS = st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=80)


@pytest.mark.parametrize(
    ("degrees", "level", "factor"),
    [
        (1, 0.95, 12.7062), (4, 0.95, 2.77645), (9, 0.99, 3.24984), (59, 0.95, 2.00100),
        (1e6, 0.95, 1.95997), (2.5, 0.9, 2.55822), (59, 1 - 0.05 / 60, 3.52207),
    ],
)  # fmt: skip
def test_students_quantiles_are_those_of_tables(
    degrees: float, level: float, factor: float
) -> None:
    assert student(degrees, level) == pytest.approx(factor, rel=1e-5)


@given(st.floats(0.01, 50), st.floats(0.5, 500))
def test_students_tails_agree_with_scipy(t: float, degrees: float) -> None:
    from scipy import stats  # here: a second for each worker that collects this module

    assert tails(t, degrees) == pytest.approx(2 * stats.t.sf(t, degrees), rel=1e-8, abs=1e-280)


@given(st.floats(0, 1), st.floats(0.1, 100), st.floats(0.1, 100))
def test_the_incomplete_beta_function_mirrors(x: float, a: float, b: float) -> None:
    assert incomplete_beta(x, a, b) + incomplete_beta(1 - x, b, a) == pytest.approx(1, abs=1e-9)


def test_impossible_levels_are_refused() -> None:
    for level in (0.0, 1.0, -1.0):
        with pytest.raises(ValueError, match="level"):
            student(5, level)
    with pytest.raises(ValueError, match="degrees"):
        tails(1.0, 0)


def test_sixty_runs_have_students_interval() -> None:
    values = list(range(60))
    found = mean_interval(values)
    assert (found.value, found.method, found.warning) == (29.5, "t", "")
    assert found.half == pytest.approx(2.0010 * np.std(values, ddof=1) / math.sqrt(60), rel=1e-4)


def test_few_runs_have_students_interval_too_and_a_warning_with_skew_and_n() -> None:
    values = [1, 2, 2, 3, 3, 3, 4, 4, 5, 30]
    found = mean_interval(values)
    assert (found.method, found.value) == ("t", pytest.approx(5.7))
    assert found.half == pytest.approx(2.262157 * np.std(values, ddof=1) / math.sqrt(10))
    assert "only 10 runs, skew 2.6" in found.warning


@given(NUMBERS, st.sampled_from([0.9, 0.95, 0.999]))
def test_intervals_of_means_agree_with_scipy(values: list[float], level: float) -> None:
    from scipy import stats

    found = mean_interval(values, level)
    if np.ptp(values) > 1e-6:
        low, high = stats.ttest_1samp(values, 0).confidence_interval(level)
        assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))


def test_one_run_and_equal_runs() -> None:
    assert mean_interval([7.0]).low is None
    assert mean_interval([7.0]).warning == "one run gives no interval"
    assert mean_interval([7.0, 7.0])[:3] == (7.0, 7.0, 7.0)
    assert "all runs have the same value" in mean_interval([7.0] * 100).warning
    assert skewness([7.0, 7.0, 7.0]) == 0


def test_runs_without_spread_have_the_p_of_a_permutation_and_a_warning() -> None:
    for paired, p in ((False, 2 / 6), (True, 2 / 4)):
        found = effect([1.0, 1.0], [2.0, 2.0], paired)
        assert found.p == pytest.approx(p) and "have the same value" in found.difference.warning
    # Its reverse is not an arrangement.
    assert effect([1.0] * 3, [2.0] * 5).p == pytest.approx(1 / 56)
    assert effect([1.0] * 60, [2.0] * 60).p < 1e-12
    assert effect([1.0] * 9, [1.0] * 9).p == 1


def test_the_warning_names_the_larger_skew() -> None:
    even, skewed = [1.0, 2.0, 3.0] * 4, [1.0] * 11 + [9.0]
    for a, b in ((even, skewed), (skewed, even)):
        assert "only 12 runs, skew 3.0" in effect(a, b).difference.warning


@pytest.mark.parametrize("values", [[], [math.nan, 1.0], [math.inf, 1.0]])
def test_what_is_no_number_is_refused(values: list[float]) -> None:
    with pytest.raises(ValueError):
        mean_interval(values)


def test_tiny_and_huge_figures_have_the_interval_of_ordinary_ones() -> None:
    ordinary = mean_interval([1.0, 2.0, 4.0])
    for unit in (1e-130, 1e130):
        found = mean_interval([unit, 2 * unit, 4 * unit])
        assert found.low == pytest.approx(ordinary.low * unit)
        assert found.high == pytest.approx(ordinary.high * unit)
        assert skewness([unit, 2 * unit, 4 * unit]) == pytest.approx(skewness([1.0, 2.0, 4.0]))


@given(NUMBERS)
def test_an_interval_holds_its_mean_and_moves_with_the_runs(values: list[float]) -> None:
    found, moved = mean_interval(values), mean_interval([value + 1000 for value in values])
    assert found.low is not None and found.high is not None
    assert found.low <= found.value + 1e-6 and found.value - 1e-6 <= found.high
    assert moved.value - found.value == pytest.approx(1000, abs=1e-3)


def test_a_higher_level_gives_a_wider_interval() -> None:
    values = [math.sqrt(one) for one in range(30)]
    narrow, wide = mean_interval(values, 0.9), mean_interval(values, 0.99)
    assert narrow.half is not None and wide.half is not None and wide.half > narrow.half


@pytest.mark.parametrize("n", [10, STUDENT_MIN_RUNS])
def test_coverage_of_normal_runs_in_small(n: int) -> None:
    rng = np.random.default_rng(3)
    found = coverage(lambda studies, size: rng.normal(5, 1, (studies, size)), 5.0, n, 400)
    assert 0.925 <= found <= 0.98  # 95 % +- 2 standard errors of 400 studies, at least


def test_coverage_of_very_few_runs_in_small() -> None:
    rng = np.random.default_rng(3)
    for n in (2, 3, 5, 7):
        found = coverage(lambda studies, size: rng.normal(5, 1, (studies, size)), 5.0, n, 1000)
        assert 0.93 <= found <= 0.97


@pytest.mark.parametrize(("n", "comparisons"), [(5, 10), (10, 20), (20, 20)])
def test_the_intervals_of_a_family_hold_together_in_small(n: int, comparisons: int) -> None:
    assert false_families(n, comparisons, 200) <= 0.05 + 2 * math.sqrt(0.05 * 0.95 / 200)


def test_differences_hold_at_the_level_of_a_family_in_small() -> None:
    rng, level = np.random.default_rng(6), bonferroni(0.95, 20)
    drawn = rng.normal(10, 1, (1000, 2, 5))
    missed = sum(not effect(a, b, level=level).difference.holds(0.0) for a, b in drawn)
    assert missed <= 1000 * 0.0025 + 3 * math.sqrt(1000 * 0.0025)  # 3 standard errors


def test_coverage_of_skewed_runs_in_small() -> None:
    pool = np.random.default_rng(4).gamma(1.1, 1, 50_000)  # skew 1.9, that of table-top runs
    found = coverage(drawn_from(pool, 5), float(pool.mean()), STUDENT_MIN_RUNS, 400)
    assert 0.91 <= found <= 0.98


@given(
    st.lists(st.floats(-100, 1000).map(lambda one: round(one, 3)), min_size=2, max_size=7),
    st.lists(st.floats(1, 1000).map(lambda one: round(one, 3)), min_size=2, max_size=7),
)
def test_few_runs_give_no_interval_wider_than_the_mean(x: list[float], y: list[float]) -> None:
    own, against = mean_interval(x), effect(x, y)
    shown = own.unless_vague()
    for interval, size in (
        (shown, abs(own.value)),
        (against.difference, sum(y) / len(y)),
        (against.relative, 1.0),
    ):
        if interval is not None and interval.low is not None and interval.high is not None:
            assert interval.n >= 5 or interval.high - interval.low <= size * (1 + 1e-9)
    assert shown == own or (shown.low, shown.n < 5) == (None, True)
    assert shown.value == own.value


def test_bonferronis_level() -> None:
    assert bonferroni(0.95, 10) == pytest.approx(0.995)
    with pytest.raises(ValueError):
        bonferroni(0.95, 0)


def test_pairs_that_correlate_gain_and_others_lose() -> None:
    rng = np.random.default_rng(1)
    demand, noise = rng.normal(100, 10, 200), rng.normal(0, 1, 200)
    together = effect(demand + noise, demand + 5, paired=True)
    apart = effect(demand + noise, demand + 5)
    assert together.difference.half is not None and apart.difference.half is not None
    assert together.difference.half < apart.difference.half / 5
    assert together.correlation is not None and together.correlation > 0.98
    assert together.variance_ratio is not None and together.variance_ratio < 0.02
    opposed = effect(demand, 200 - demand)
    assert opposed.variance_ratio == pytest.approx(2)


def test_welch_by_hand() -> None:
    a, b = np.arange(60.0), np.arange(60.0) * 2 + 1
    found = effect(a, b)
    assert found.difference.method == "Welch"
    u, v = a.var(ddof=1) / 60, b.var(ddof=1) / 60
    degrees = (u + v) ** 2 / (u**2 / 59 + v**2 / 59)
    assert found.difference.half == pytest.approx(student(degrees) * math.sqrt(u + v))
    assert found.relative is not None and found.relative.value == pytest.approx(29.5 / 60 - 1)


@given(NUMBERS, NUMBERS)
def test_effects_turn_round(a: list[float], b: list[float]) -> None:
    one, other = effect(a, b), effect(b, a)
    assert one.difference.value == pytest.approx(-other.difference.value, abs=1e-6)
    assert one.p == pytest.approx(other.p, abs=1e-9)
    assert 0 <= one.p <= 1


@given(NUMBERS, st.lists(st.floats(1, 1e6), min_size=2, max_size=80))
def test_a_relative_effect_says_what_its_difference_says(a: list[float], b: list[float]) -> None:
    found = effect(a, b)
    assert found.relative is not None
    signs = [
        [0 if end is None else np.sign(end) for end in (one.low, one.value, one.high)]
        for one in (found.relative, found.difference)
    ]
    assert signs[0] == signs[1]
    assert min(a) < 0 or found.relative.low is None or found.relative.low >= -1
    assert found.relative.value == pytest.approx(np.mean(a) / np.mean(b) - 1, abs=1e-9)


def test_unequal_numbers_are_no_pairs() -> None:
    with pytest.raises(ValueError, match="not pairs"):
        effect([1, 2, 3], [1, 2], paired=True)
    assert effect([1, 2, 3], [1, 2]).correlation is None
