"""Section 4 of De Ryck et al., to the second: two robots, one charger, one new task at 14."""

from __future__ import annotations

import pytest

from automaton.papers.auction_trials import CHARGE_PERCENT, bids_for, steps, winner


def test_robot_1_needs_no_charging() -> None:
    one = bids_for("as printed")[0]
    assert (one.before, one.cost, one.added, one.mixed) == (70, 180, 110, 145)
    assert one.order == (7, 8, 13, 14)
    assert (one.charging, one.end) == (0, 10 * CHARGE_PERCENT)


@pytest.mark.parametrize("setting", ["as printed", "joint", "comb floor"])
def test_robot_2_charges_9_s_after_its_first_task(setting: str) -> None:
    two = bids_for(setting)[1]
    assert (two.before, two.cost, two.added, two.mixed) == (70, 189, 119, 154)
    assert two.order == (5, 2, 4, 9, 14)
    assert (two.arrival, two.charging, two.end) == (15 * CHARGE_PERCENT, 9, 0)
    assert winner(bids_for(setting)) == 1


def test_with_charging_ignored_robot_2_wins_with_5_percent_too_little() -> None:
    offers = bids_for("charging ignored")
    assert (offers[1].cost, offers[1].added, offers[1].mixed) == (100, 30, 65)
    assert offers[1].end == -5 * CHARGE_PERCENT
    assert winner(offers) == 2


def test_a_reserve_of_10_percent_costs_robot_2_two_seconds() -> None:
    one, two = bids_for("reserve 10 %")
    assert one.mixed == 145
    assert (two.cost, two.mixed) == (191, 156)


def test_with_20_percent_robot_1_charges_and_robot_2_cannot() -> None:
    one, two = bids_for("reserve 20 %")
    assert (one.cost, one.mixed) == (292, 257)
    assert (two.before, two.mixed) == (None, None)


def test_nobody_goes_where_no_charger_is_in_reach_afterwards() -> None:
    """Position 14 is 120 m from the charger; there and back is more than a full battery."""
    offers = bids_for("never strand")
    assert [one.mixed for one in offers] == [None, None]
    assert winner(offers) is None


def test_with_chargers_at_all_depots_robot_2_charges_at_once_and_wins() -> None:
    offers = bids_for("chargers 1, 2, 3")
    assert (offers[1].cost, offers[1].mixed) == (101, 66)
    assert offers[1].order == (1, 5, 4, 9, 14)
    assert winner(offers) == 2


def test_step_by_step() -> None:
    assert list(steps())[-1] == "robot 1 wins; with charging ignored it would be robot 2"
