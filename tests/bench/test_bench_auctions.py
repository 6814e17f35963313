"""What `automaton bench --only auctions` measures. How fast is for no test."""

from __future__ import annotations

from automaton.bench import auction_speed
from automaton.papers.auction_trials import METHODS
from strategies.allocation.auction.market import (
    INF_COST,
    POLICY_HIERARCHICAL,
    POLICY_NO_CHARGING,
)


def test_everything_is_sold_and_half_of_the_bids_plan_charging() -> None:
    for policy, low, high in ((POLICY_NO_CHARGING, 0, 0), (POLICY_HIERARCHICAL, 0.3, 0.7)):
        one = auction_speed.market(*auction_speed.SMALL_AUCTION, policy)
        assert auction_speed.seconds_of(one, auction_speed.SELL, 1) > 0
        assert one.fleet.length.sum() == auction_speed.SMALL_AUCTION[1]
        assert one.fleet.cost.max() < INF_COST
        count = one.scratch.count
        assert low <= count.plans / count.bids <= high


def test_the_parts_take_samples() -> None:
    assert auction_speed.timed((3, 12), POLICY_NO_CHARGING, METHODS["arrival"], 1)() > 0
    assert auction_speed.timed((3, 12), POLICY_NO_CHARGING, METHODS["LB+search"], 1)() > 0
    assert auction_speed.prepare_optimum(2)() > 0
    assert auction_speed.prepare_genetic()() > 0
    assert auction_speed.prepare_plan(POLICY_HIERARCHICAL, 2)() > 0


def test_growth_is_a_slope_of_time() -> None:
    """Four times as many tasks take at least twice as long, on any machine."""
    assert auction_speed.prepare_growth(((4, 40), (4, 160)), auction_speed.SELL)() > 0.5


def test_names_are_unique() -> None:
    names = [one.name for one in auction_speed.measurements()]
    assert len(set(names)) == len(names)
