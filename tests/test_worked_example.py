"""Section 4 of De Ryck et al., to the second: two robots, one charger, one new task at 14."""

from __future__ import annotations

from typing import Any

import pytest

from automaton.auctions import bids
from automaton.auctions.bids import MIX
from automaton.auctions.market import END, FULL, HIERARCHICAL, INF, JOINT, NO_CHARGING
from automaton.auctions.quotes import settle_all
from automaton.reproductions.auction_floor import (
    PERCENT,
    fleet_at,
    give,
    rules,
    scratch_of,
    seconds,
    work_of,
)
from tests.auction_scenes import stops_of

LISTS = ((7, 8, 13), (5, 4, 9))  # of robots 1 and 2
NEW = 14
DRAIN, RATE = 5_000, 50_000  # 0.5 and 5 % a second


def example(**settings: Any) -> list[dict[str, Any]]:
    """c1, c2, MiniSum, MiniMax and mixed bid, plan and list of each robot; rules as given."""
    settings = {"policy": HIERARCHICAL, "chargers": (2,), "lanes": "full"} | settings
    between = seconds(settings.pop("lanes"))
    tasks = [*LISTS[0], *LISTS[1], NEW]
    work = work_of(tasks, between, DRAIN)
    battery = rules(between, DRAIN, RATE, **settings)
    fleet = fleet_at((3, 1), len(tasks), [FULL, 45 * PERCENT])
    scratch = scratch_of(fleet, len(tasks), len(battery.charger))
    give(fleet, 0, (0, 1, 2))
    give(fleet, 1, (3, 4, 5))
    settle_all(work, battery, fleet, scratch)
    found = []
    for r in range(2):
        offers = [
            int(bids.bid(work, battery, fleet, scratch, r, 6, MIX, epsilon))
            for epsilon in (0, 1000, 500)
        ]
        c2, added, mixed = (INF if offer >= INF else offer / 1000 for offer in offers)
        line = {"c1": int(fleet.cost[r]), "c2": c2, "added": added, "bid": mixed}
        if c2 < INF:
            bids.award(work, battery, fleet, scratch, r, 6)
            order = [tasks[task] for task in fleet.order[r, : fleet.length[r]]]
            for position, charger in reversed(stops_of(scratch)):
                order.insert(position, settings["chargers"][charger])
            line |= {"order": order, "end": int(scratch.plan.figures[END])}
            line["charging"] = int(sum(scratch.plan.duration[: scratch.plan.stops[0]]))
        found.append(line)
    return found


def test_robot_1_needs_no_charging() -> None:
    one = example()[0]
    assert (one["c1"], one["c2"], one["added"], one["bid"]) == (70, 180, 110, 145)
    assert one["order"] == [7, 8, 13, 14]
    assert one["end"] == 10 * PERCENT


@pytest.mark.parametrize("lanes", ["full", "comb"])
@pytest.mark.parametrize("policy", [HIERARCHICAL, JOINT])
def test_robot_2_charges_9_s_after_its_first_task(policy: int, lanes: str) -> None:
    two = example(policy=policy, lanes=lanes)[1]
    assert (two["c1"], two["c2"], two["added"], two["bid"]) == (70, 189, 119, 154)
    assert two["order"] == [5, 2, 4, 9, 14]
    assert (two["charging"], two["end"]) == (9, 0)


def test_without_the_rule_robot_2_would_win_with_5_percent_too_little() -> None:
    one, two = example(policy=NO_CHARGING)
    assert (two["c2"], two["added"], two["bid"]) == (100, 30, 65)
    assert two["end"] == -5 * PERCENT
    assert two["bid"] < one["bid"] == 145


def test_a_reserve_of_10_percent_costs_robot_2_two_seconds() -> None:
    one, two = example(reserve=10 * PERCENT)
    assert one["bid"] == 145
    assert (two["c2"], two["bid"]) == (191, 156)


def test_with_20_percent_robot_1_charges_and_robot_2_cannot() -> None:
    one, two = example(reserve=20 * PERCENT)
    assert (one["c2"], one["bid"]) == (292, 257)
    assert two["bid"] == INF


def test_nobody_goes_where_no_charger_is_in_reach_afterwards() -> None:
    """Position 14 is 120 m from the charger; there and back is more than a full battery."""
    for epsilon_free in example(end_reach=True):
        assert epsilon_free["bid"] == INF
        assert epsilon_free["c2"] == INF


def test_with_chargers_at_all_depots_robot_2_charges_at_once_and_wins() -> None:
    one, two = example(chargers=(1, 2, 3))
    assert (two["c2"], two["bid"]) == (101, 66)
    assert two["order"] == [1, 5, 4, 9, 14]
    assert two["bid"] < one["bid"]
