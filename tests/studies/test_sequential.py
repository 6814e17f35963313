"""Sequential tests, selection and steady states: known values, and their errors in small."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statistics_trials import (
    LEAST_COVERAGE,
    autoregressive,
    batch_coverage,
    under_noise,
    waits,
    wrong_answers,
    wrong_means,
)

from automaton.studies.inference.proportions import (
    batches,
    confidence_sequence,
    feasible,
    region,
    select_least,
    share_test,
)
from automaton.studies.inference.steady_state import (
    NotSteadyError,
    batch_means,
    correlation_time,
    mser5,
    replication_deletion,
)


def test_walds_test_by_hand() -> None:
    test = share_test(0.95, 0.02, 0.05)
    assert test.bound == pytest.approx(math.log(19))
    assert test.fewest == math.ceil(math.log(19) / math.log(0.97 / 0.93))  # 70
    assert test.verdict([True] * 69) == ("undecided", 69)
    assert test.verdict([True] * 200) == ("meets", 70)
    assert test.verdict([False] * 10) == ("fails", 4)


@given(st.lists(st.booleans(), max_size=300))
def test_what_follows_a_verdict_does_not_change_it(outcomes: list[bool]) -> None:
    test = share_test(0.9, 0.05, 0.1)
    verdict, after = test.verdict(outcomes)
    assert test.verdict(outcomes[:after]) == (verdict, after)
    if verdict != "undecided":
        assert test.verdict([*outcomes, True, False]) == (verdict, after)


@pytest.mark.parametrize(
    ("share", "zone", "error"), [(0.99, 0.02, 0.05), (0.95, 0, 0.05), (0.9, 0.1, 0.5)]
)
def test_impossible_tests_are_refused(share: float, zone: float, error: float) -> None:
    with pytest.raises(ValueError):
        share_test(share, zone, error)


def test_the_confidence_sequence_is_where_the_mixture_is_below_its_bound() -> None:
    found = confidence_sequence(190, 200)
    assert found.low is not None and found.high is not None

    def log_beta(a: float, b: float) -> float:
        return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)

    for edge in (found.low, found.high):
        mixture = log_beta(190.5, 10.5) - log_beta(0.5, 0.5)
        ratio = mixture - 190 * math.log(edge) - 10 * math.log(1 - edge)
        assert ratio == pytest.approx(math.log(20), abs=1e-6)


@given(st.integers(0, 400), st.integers(0, 400))
def test_the_confidence_sequence_holds_its_share(met: int, missed: int) -> None:
    found = confidence_sequence(met, met + missed)
    assert found.low is not None and found.high is not None
    assert 0 <= found.low <= found.high <= 1
    if met + missed:
        assert found.low <= met / (met + missed) <= found.high


def test_the_confidence_sequence_survives_stopping_at_the_worst_moment() -> None:
    rng, held = np.random.default_rng(2), 0
    looks = [5, 10, 20, 40, 80, 160, 320, 640]
    for _ in range(300):
        met = np.cumsum(rng.random(640) < 0.9)
        held += all(confidence_sequence(int(met[n - 1]), n).holds(0.9) for n in looks)
    assert held / 300 >= 0.95 - 2 * math.sqrt(0.05 * 0.95 / 300)


def test_searches_at_the_boundaries_err_as_seldom_as_they_say() -> None:
    studies = 150
    most = 0.05 + 2 * math.sqrt(0.05 * 0.95 / studies)
    for shares in ([0.93, 0.93, 0.97], [0.97]):
        assert wrong_answers(shares, studies)[0] <= most


def test_means_at_the_boundaries_err_as_seldom_as_they_say() -> None:
    studies = 200
    pool = 1500 + np.random.default_rng(7).gamma(1.1, 110, 20_000)
    most = 0.05 + 2 * math.sqrt(0.05 * 0.95 / studies)
    for side in (-1, 1):
        assert wrong_means(pool, side, studies)[0] <= most


def test_kim_and_nelsons_constants_by_hand() -> None:
    limits = region(1.0, 0.05)
    eta = ((2 * 0.05) ** (-2 / 19) - 1) / 2
    assert limits.h2 == pytest.approx(2 * eta * 19)
    assert limits.width(9.0, 20) == pytest.approx(max(0, limits.h2 * 9 / 2 - 10))
    assert limits.width(9.0, 21) < limits.width(9.0, 20) and limits.width(9.0, 1000) == 0


def test_a_mean_is_judged_after_twenty_batches_at_the_earliest() -> None:
    limits = region(1.0, 0.05)
    clear = np.linspace(0, 1, 40)
    assert feasible(clear[:19], 100.0, limits) == ("undecided", 19)
    assert feasible(clear, 100.0, limits) == ("meets", 20)
    assert feasible(clear, -100.0, limits) == ("fails", 20)


def test_a_triangle_closes_so_every_mean_is_judged() -> None:
    rng = np.random.default_rng(1)
    limits, means = region(0.5, 0.05), rng.normal(0, 1, 2000)
    verdict, after = feasible(means, 0.0, limits)
    assert verdict != "undecided"
    assert limits.width(float(means[:20].var(ddof=1)), after + 1) == 0 or after < 2000


def test_batches_wait_for_whole_ones() -> None:
    assert batches(list(range(25))).tolist() == [4.5, 14.5]
    assert len(batches([])) == 0


def test_the_best_of_several_is_found_as_often_as_promised() -> None:
    rng, right = np.random.default_rng(3), 0
    for _ in range(100):
        systems = [rng.normal(mean, 2, 3000) for mean in (11.0, 10.0, 11.0)]
        found = select_least(systems, 1.0, 0.05)
        right += found.left == (1,)
    assert right / 100 >= 0.95 - 2 * math.sqrt(0.05 * 0.95 / 100)


def test_too_few_batches_select_nobody() -> None:
    systems = [np.arange(10.0), np.arange(10.0)]
    assert select_least(systems, 1.0, 0.05).left == (0, 1)
    assert select_least([np.arange(30.0)], 1.0, 0.05).left == (0,)


def test_mser_cuts_the_warm_up_off() -> None:
    rng = np.random.default_rng(1)
    ramp = np.concatenate([np.linspace(-20, 0, 100), np.zeros(900)])
    series = ramp + rng.normal(0, 1, (8, 1000))
    found = mser5(series)
    assert 70 <= found.cut <= 150 and found.cut % 5 == 0
    assert mser5(rng.normal(0, 1, (8, 1000))).cut <= 250


def test_mser_refuses_what_is_not_stationary_and_what_is_too_little() -> None:
    rng = np.random.default_rng(1)
    growing = np.linspace(0, 50, 1000) ** 2 + rng.normal(0, 1, (5, 1000))
    with pytest.raises(NotSteadyError, match="not stationary or too short"):
        mser5(growing)
    with pytest.raises(NotSteadyError, match="needs 5 replications, not 4"):
        mser5(np.zeros((4, 1000)))
    with pytest.raises(NotSteadyError, match="observations"):
        mser5(np.zeros((5, 20)))


def test_replication_deletion_needs_twenty() -> None:
    rng = np.random.default_rng(1)
    series = rng.normal(3, 1, (60, 200))
    assert replication_deletion(series, 50).holds(3.0)
    with pytest.raises(NotSteadyError, match="20 replications, not 19"):
        replication_deletion(series[:19], 50)
    with pytest.raises(NotSteadyError, match="leaves nothing"):
        replication_deletion(series, 200)


def test_batch_means_of_several_runs_count_all_of_them() -> None:
    several = np.random.default_rng(8).normal(size=(7, 1000))
    few = batch_means(several)
    assert (few.n, few.method) == (14, "14 batch means of 7 runs")
    assert few.value == pytest.approx(several.mean())
    with pytest.raises(NotSteadyError, match="150 observations, not 100"):
        batch_means(several[0, :100])
    with pytest.raises(NotSteadyError, match="too short for an interval: a correlation time"):
        batch_means(np.linspace(0, 1, 1000))


@pytest.mark.parametrize(
    ("load", "customers"), [(0.5, 300), (0.5, 1000), (0.8, 1000), (0.8, 5000), (0.9, 5000)]
)
def test_batch_means_of_a_queue_hold_its_delay(load: float, customers: int) -> None:
    """Where the batches passed a test of independence, 73 % of the intervals of 5,000 customers held."""
    rng = np.random.default_rng(8)
    series = waits(rng, 400, customers, from_empty=False, load=load)
    held, given, _ = batch_coverage(series, load / (1 - load))
    assert given >= 340
    assert held >= LEAST_COVERAGE - 2 * math.sqrt(0.93 * 0.07 / given)


def test_batch_means_of_series_hold_their_mean_and_are_not_wider_than_they_must() -> None:
    rng = np.random.default_rng(9)
    for r, n, runs, share, widest in (
        (0.9, 3000, 1, 1.0, 1.8),
        (0.98, 3000, 1, 1.0, 5.0),
        (0.0, 1000, 1, 1.0, 1.7),
        (0.0, 150, 1, 1.0, 1.8),
        (0.99, 1000, 5, 0.1, 4.0),
        (0.995, 3000, 1, 0.05, 5.0),
        (0.98, 20_000, 1, 0.05, 1.8),
    ):
        held, given, width = batch_coverage(under_noise(rng, 200, runs, n, r, share), 0.0)
        assert given >= 190 and width <= widest
        assert held >= LEAST_COVERAGE - 2 * math.sqrt(0.93 * 0.07 / given)


def test_a_series_shorter_than_its_memory_gets_no_interval() -> None:
    series = autoregressive(np.random.default_rng(10), 200, 300, 0.999)  # correlation time 1999
    _, given, _ = batch_coverage(series, 0.0)
    assert given <= 20


def test_over_how_many_observations_a_series_depends_on_itself() -> None:
    rng = np.random.default_rng(11)
    alone = autoregressive(rng, 1, 100_000, 0.9)
    for longest in (1, 19):
        assert correlation_time(alone, longest) == pytest.approx(19, rel=0.1)  # (1 + r) / (1 - r)
    hidden = under_noise(rng, 1, 1, 100_000, 0.98, 0.05)[0]
    assert correlation_time(hidden) < 1.3 and correlation_time(hidden, 3000) > 50
    assert correlation_time(rng.normal(size=(7, 350)), 50) < 10
