"""How far from the optimum auctions are on the floor of De Ryck et al.: 900 task sets a number."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import pytest

from automaton.papers import auction_trials
from automaton.papers.auction_charging import charging_costs
from automaton.papers.auction_trials import (
    MOST_TASKS,
    OPTIMUM,
    ratio,
    sequences,
    solve,
    task_set,
)

SEEDS = range(1, 101)

# By an independent program, 900 task sets for each number of robots; for 1, 2, 3, 4 robots.
REFERENCE = {
    "LB": (1.025, 1.057, 1.037, 1.012),
    "BD": (1.025, 1.019, 1.028, 1.008),
    "regret": (1.025, 1.019, 1.011, 1.009),
    "LB+search": (1.010, 1.017, 1.000, 1.001),
    "parallel": (1.062, 1.156, 1.086, 1.186),
    "arrival": (1.062, 1.128, 1.096, 1.064),
    "m^n": (1.057, 1.009, 1.001, 1.000),
    "GA": (1.057, 1.029, 1.037, 1.023),
    "GA each gene": (1.057, 1.009, 1.001, 1.006),
}
MARGIN = {
    "LB": (0.010, 0.020, 0.018, 0.010),
    "parallel": (0.030,) * 4,
    "arrival": (0.030,) * 4,
    "m^n": (0.020,) * 4,
    "GA": (0.020,) * 4,
    "GA each gene": (0.020,) * 4,
}
FEW_SEEDS = {"GA": 20, "GA each gene": 20}  # 180 task sets, as in the reference


@pytest.fixture(scope="module", autouse=True)
def instances_for_all_methods() -> Iterator[None]:
    """Each task set is prepared once; `solve` empties the lists of the robots before each method."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(auction_trials, "instance", cache(auction_trials.instance))
        yield


def pooled(method: str, robots: int) -> float:
    seeds = SEEDS[: FEW_SEEDS.get(method, len(SEEDS))]
    values = [
        ratio("full", robots, n, seed, method) for seed in seeds for n in range(2, MOST_TASKS + 1)
    ]
    assert min(values) >= 1
    return math.fsum(values) / len(values)


@pytest.mark.parametrize("robots", [1, 2, 3, 4])
@pytest.mark.parametrize("method", REFERENCE)
def test_the_ratio_to_the_optimum(method: str, robots: int) -> None:
    margin = MARGIN.get(method, (0.010,) * 4)[robots - 1]
    assert pooled(method, robots) == pytest.approx(REFERENCE[method][robots - 1], abs=margin)


def test_the_optimal_makespan_of_ten_tasks() -> None:
    """Reference: 294, 154, 112.5, 87.5 s over 20 task sets; a standard error is about 4 s."""
    for robots, reference in ((1, 294), (2, 154), (3, 112.5), (4, 87.5)):
        values = [solve("full", robots, 10, seed, OPTIMUM, 0).objective for seed in SEEDS]
        assert math.fsum(values) / len(values) == pytest.approx(reference, abs=8)


def test_more_robots_than_four_bring_nothing_on_this_floor() -> None:
    """Their depots are shared."""
    for robots, least in ((5, 0.95), (6, 0.95)):
        more, four = (
            sum(solve("full", m, 10, seed, OPTIMUM, 0).objective for seed in range(1, 31))
            for m in (robots, 4)
        )
        assert least <= more / four <= 1


def test_task_sets_are_stations_without_repetition_and_differ() -> None:
    sets = {(seed, n): task_set(seed, n) for seed in range(1, 30) for n in range(1, 11)}
    for (_, n), stations in sets.items():
        assert len(set(stations)) == n
        assert set(stations) <= set(range(4, 17))
    assert len({stations for (_, n), stations in sets.items() if n == 10}) == 29
    first = [stations[0] for stations in sets.values()]
    assert set(first) == set(range(4, 17))


def test_the_number_of_ordered_solutions() -> None:
    assert sequences(2, 10) == 39_916_800
    assert sequences(3, 10) == 239_500_800
    assert sequences(1, 4) == 24


def mean_of(name: str, n: int, chargers: tuple[int, ...] = (2,)) -> float:
    values = [
        charging_costs(seed, n, k, chargers)[name] for seed in range(1, 31) for k in range(10)
    ]
    return math.fsum(values) / len(values)


def test_savings_against_threshold_100() -> None:
    """300 tours of ten tasks: 41 % gross, 48 % net by the reference, 5 % either way."""
    gross = 1 - mean_of("gross r20", 10) / mean_of("gross look", 10)
    net = 1 - mean_of("net r20", 10) / mean_of("net look", 10)
    assert gross == pytest.approx(0.41, abs=0.05)
    assert net == pytest.approx(0.48, abs=0.05)


# n: share of tours with charging at reserve 0 and 20 %, gross costs r0, r20, look, safe.
TOURS = {
    4: (0, 0.007, 0, 1.0, 2.0, 44.6),
    6: (0, 0.143, 0, 20.2, 39.2, 127),
    8: (0.037, 0.563, 4.6, 81.4, 156, 209),
    10: (0.213, 0.897, 29.0, 143, 242, 249),
}


@pytest.mark.parametrize("n", TOURS)
def test_charging_by_the_number_of_tasks(n: int) -> None:
    """Within four standard errors of a difference of two means over 300 tours."""
    names = ("charges r0", "charges r20", "gross r0", "gross r20", "gross look", "gross safe")
    for name, reference in zip(names, TOURS[n], strict=True):
        values = [
            charging_costs(seed, n, k, (2,))[name] for seed in range(1, 31) for k in range(10)
        ]
        mean = math.fsum(values) / len(values)
        variance = math.fsum((value - mean) ** 2 for value in values) / (len(values) - 1)
        margin = max(4 * math.sqrt(2 * variance / len(values)), 0.02 if name[0] == "c" else 4)
        assert mean == pytest.approx(reference, abs=margin), name


def test_no_charging_before_the_onset() -> None:
    assert [mean_of("charges r0", n) for n in (1, 2, 3, 4, 5)] == [0, 0, 0, 0, 0]
    assert [mean_of("gross r20", n) for n in (1, 2, 3)] == [0, 0, 0]
    assert 0 < mean_of("charges r20", 5) < 0.1 < mean_of("charges r20", 7)


def test_where_the_threshold_keeps_its_floor_the_plan_is_never_longer() -> None:
    for chargers in ((2,), (1, 2, 3)):
        assert mean_of("time worse, floor kept", 10, chargers) == 0
