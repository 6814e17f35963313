"""What `automaton bench --only auctions` measures. How fast is for no test."""

from __future__ import annotations

from automaton.auctions.market import (
    COUNT_BIDS,
    COUNT_PLANS,
    INF_COST,
    POLICY_HIERARCHICAL,
    POLICY_NO_CHARGING,
)
from automaton.bench import auctions


def test_everything_is_sold_and_half_of_the_bids_plan_charging() -> None:
    for policy, low, high in ((POLICY_NO_CHARGING, 0, 0), (POLICY_HIERARCHICAL, 0.3, 0.7)):
        one = auctions.market(*auctions.SMALL, policy)
        assert auctions.seconds_of(one, auctions.sell, 1) > 0
        assert one.fleet.length.sum() == auctions.SMALL[1]
        assert one.fleet.cost.max() < INF_COST
        count = one.scratch.count
        assert low <= count[COUNT_PLANS] / count[COUNT_BIDS] <= high


def test_the_parts_take_samples() -> None:
    assert auctions.timed((3, 12), POLICY_NO_CHARGING, auctions.sell_by_arrival, 1)() > 0
    assert auctions.prepare_search()() > 0
    assert auctions.prepare_optimum(2)() > 0
    assert auctions.prepare_genetic()() > 0
    assert auctions.prepare_plan(POLICY_HIERARCHICAL, 2)() > 0


def test_growth_is_a_slope_of_time() -> None:
    """Four times as many tasks take at least twice as long, on any machine."""
    assert auctions.prepare_growth(((4, 40), (4, 160)), auctions.sell)() > 0.5


def test_names_are_unique() -> None:
    names = [one.name for one in auctions.measurements()]
    assert len(set(names)) == len(names)
