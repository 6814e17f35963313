"""Auctions: who wins what, against plain Python that asks every robot for every bid."""

from __future__ import annotations

import itertools
import random

import numpy as np
import pytest
from auction_scenes import lists_of, random_auction

from automaton.engine.state import NIL, Array
from strategies.allocation.auction import sequential
from strategies.allocation.auction.market import (
    INF_COST,
    POLICY_FILL_UP,
    POLICY_HIERARCHICAL,
    POLICY_JOINT,
    POLICY_NO_CHARGING,
    POLICY_THRESHOLD,
    POLICY_THRESHOLD_REACHABLE,
    AuctionScratch,
    BatteryRules,
    FleetLists,
    TaskCosts,
    battery_of,
    cheapest_insertion,
    fleet_of,
    scratch_for,
    visits,
)
from strategies.allocation.auction.quotes import settle_all
from strategies.allocation.auction.sequential import (
    BID_AVERAGE,
    BID_AVERAGE_ADDED,
    BID_MIXED,
    WINNER_DIFFERENCE,
    WINNER_FEWEST_BIDDERS,
    WINNER_LOWEST_BID,
)

POLICIES = (
    POLICY_NO_CHARGING,
    POLICY_HIERARCHICAL,
    POLICY_JOINT,
    POLICY_FILL_UP,
    POLICY_THRESHOLD,
    POLICY_THRESHOLD_REACHABLE,
)
Market = tuple[TaskCosts, BatteryRules, FleetLists, AuctionScratch]


def preference(offers: list[int], winner: int) -> tuple[int, int] | None:
    """(urgency, lowest bid) of an item from all robots' bids; the smaller tuple goes first."""
    finite = sorted(offer for offer in offers if offer < INF_COST)
    if not finite:
        return None
    if winner == WINNER_LOWEST_BID:
        return (finite[0], 0)
    if winner == WINNER_FEWEST_BIDDERS:
        return (len(finite), finite[0])
    if len(finite) == 1:
        return (-INF_COST if len(offers) > 1 else 0, finite[0])
    other = finite[-1] if winner == WINNER_DIFFERENCE else finite[1]
    return (finite[0] - other, finite[0])


def plain_auction(market: Market, items: Array, rule: int, epsilon: int, winner: int) -> list[int]:
    """Who wins each item when every robot bids again in every round."""
    fleet = market[2]
    robots = range(len(fleet.place))
    sold = [NIL] * len(items)
    left = list(range(len(items)))
    while left:
        table = {
            k: [int(sequential.bid(*market, r, int(items[k]), rule, epsilon)) for r in robots]
            for k in left
        }
        ranked = [(rank, k) for k in left if (rank := preference(table[k], winner)) is not None]
        if not ranked:
            break
        item = min(ranked)[1]
        robot = min(robots, key=lambda r: table[item][r])
        sequential.award(*market, robot, int(items[item]))
        sold[item] = robot
        left.remove(item)
    return sold


@pytest.mark.parametrize("policy", POLICIES)
def test_only_the_winner_bids_again_with_the_same_result(policy: int) -> None:
    rng = random.Random(policy)
    for _ in range(40):
        robots, tasks = rng.randint(1, 5), rng.randint(0, 8)
        rule, winner = rng.choice((BID_MIXED, BID_AVERAGE_ADDED, BID_AVERAGE)), rng.randrange(4)
        epsilon = rng.choice((0, 300, 500, 1000))
        options = {"threshold": 200_000_000, "end_reach": rng.random() < 0.5}
        seed = rng.random()
        found = []
        for everybody in (0, 1):
            *market, items = random_auction(random.Random(seed), robots, tasks, policy, **options)
            arguments = (items, tasks, rule, epsilon, winner, everybody)
            count = sequential.sequential(*market, *arguments)
            scratch, fleet = market[3], market[2]
            found.append((scratch.sold[:tasks].tolist(), lists_of(fleet), fleet.cost.tolist()))
            assert count == sum(robot != NIL for robot in found[-1][0])
        *market, items = random_auction(random.Random(seed), robots, tasks, policy, **options)
        by_hand = plain_auction(tuple(market), items, rule, epsilon, winner)
        assert found[0] == found[1]
        assert by_hand == found[0][0]
        assert lists_of(market[2]) == found[0][1]


def everything_heard(
    robots: int, tasks: int
) -> tuple[TaskCosts, BatteryRules, FleetLists, AuctionScratch, Array]:
    """Robots with empty lists that may all bid for everything."""
    for seed in range(100):
        *market, items = random_auction(random.Random(seed), robots, tasks)
        if market[2].length.sum() == 0:
            market[2].may_bid[:] = 1
            return (*market, items)  # type: ignore[return-value]
    raise AssertionError("no such scene")


@pytest.mark.parametrize(("robots", "tasks"), [(1, 1), (1, 7), (3, 8), (5, 4)])
def test_bids_and_messages_are_counted(robots: int, tasks: int) -> None:
    """Winner-only: n m + n (n - 1) / 2 bids; everybody again: m n (n + 1) / 2."""
    *market, items = everything_heard(robots, tasks)
    sequential.sequential(*market, items, tasks, BID_MIXED, 0, WINNER_LOWEST_BID, 0)
    count = market[3].count
    made = tasks * robots + tasks * (tasks - 1) // 2
    assert count.bids == made
    assert count.messages == robots * tasks + made + tasks
    *market, items = everything_heard(robots, tasks)
    sequential.sequential(*market, items, tasks, BID_MIXED, 0, WINNER_LOWEST_BID, 1)
    assert market[3].count.bids == robots * tasks * (tasks + 1) // 2
    *market, items = everything_heard(robots, tasks)
    sequential.by_arrival(*market, items, tasks, BID_MIXED, 0)
    assert market[3].count.bids == tasks * robots


def test_positions_tried_by_one_robot_grow_with_the_cube() -> None:
    """A list of k has k + 1 places, tried for each open task; the award tries them once more."""
    tasks = 9
    *market, items = everything_heard(1, tasks)
    sequential.sequential(*market, items, tasks, BID_MIXED, 0, WINNER_LOWEST_BID, 0)
    bids_made = sum((k + 1) * (tasks - k) for k in range(tasks))
    assert market[3].count.positions == bids_made + sum(k + 1 for k in range(tasks))


def test_arrival_order_gives_each_task_to_the_lowest_bid_of_its_turn() -> None:
    rng = random.Random(5)
    for seed in range(40):
        robots, tasks = rng.randint(1, 4), rng.randint(1, 8)
        *market, items = random_auction(random.Random(seed), robots, tasks, POLICY_HIERARCHICAL)
        sequential.by_arrival(*market, items, tasks, BID_MIXED, 0)
        sold, lists = market[3].sold[:tasks].tolist(), lists_of(market[2])
        *market, items = random_auction(random.Random(seed), robots, tasks, POLICY_HIERARCHICAL)
        for k in range(tasks):
            offers = [int(sequential.bid(*market, r, k, BID_MIXED, 0)) for r in range(robots)]
            assert sold[k] == (NIL if min(offers) >= INF_COST else offers.index(min(offers)))
            if sold[k] != NIL:
                sequential.award(*market, sold[k], k)
        assert lists_of(market[2]) == lists


def test_parallel_bids_know_nothing_of_the_other_tasks() -> None:
    for seed in range(40):
        *market, items = random_auction(random.Random(seed), 3, 6)
        offers = [
            [int(sequential.bid(*market, r, k, BID_MIXED, 0)) for r in range(3)] for k in range(6)
        ]
        sequential.parallel(*market, items, 6, BID_MIXED, 0)
        for k, row in enumerate(offers):
            expected = NIL if min(row) >= INF_COST else row.index(min(row))
            assert market[3].sold[k] == expected


def test_a_list_takes_no_more_than_its_room() -> None:
    for seed in range(30):
        *market, items = random_auction(random.Random(seed), 3, 8)
        market[2].capacity[:] = 2
        sequential.sequential(*market, items, 8, BID_MIXED, 0, WINNER_LOWEST_BID, 0)
        assert market[2].length.max() <= 2
        assert sum(market[3].sold[:8] != NIL) <= 6


def test_insertion_is_the_cheapest_and_the_latest_of_the_cheapest() -> None:
    rng = random.Random(6)
    for _ in range(300):
        points = [(rng.randrange(6), rng.randrange(6)) for _ in range(9)]
        ticks = [[abs(x - a) + abs(y - b) for a, b in points] for x, y in points]
        task_costs = visits(ticks, ticks, range(9))
        length = rng.randrange(8)
        order = np.array(rng.sample(range(1, 8), length) + [0] * (8 - length), np.int32)
        first = rng.randint(0, min(1, length))
        position, added = cheapest_insertion(task_costs, 0, order, length, 8, first)
        costs = []
        for at in range(first, length + 1):
            path = [0, *order[:at].tolist(), 8, *order[at:length].tolist()]
            total = sum(ticks[a][b] for a, b in itertools.pairwise(path))
            costs.append((total, -at))
        before = [0, *order[:length].tolist()]
        direct = sum(ticks[a][b] for a, b in itertools.pairwise(before))
        assert (added + direct, -position) == min(costs)


def test_pairs_stay_together_and_their_way_counts() -> None:
    """A robot of one load: pick-up and delivery follow each other, in every list."""
    for seed in range(20):
        *market, items = random_auction(random.Random(seed), 2, 6)
        task_costs, _, fleet, _ = market
        sequential.sequential(*market, items, 6, BID_MIXED, 1000, WINNER_LOWEST_BID, 0)
        for r in range(2):
            here, now = int(fleet.place[r]), int(fleet.ready[r])
            for task in lists_of(fleet)[r]:
                now += (
                    task_costs.ticks[0, here, task_costs.begin[task]] + task_costs.inside[0, task]
                )
                here = int(task_costs.end[task])
            assert now == fleet.cost[r]


def test_a_task_that_the_robot_drives_to_stays_first() -> None:
    checked = 0
    for seed in range(60):
        *market, items = random_auction(random.Random(seed), 3, 6)
        fleet = market[2]
        first = {r: int(fleet.order[r, 0]) for r in range(3) if fleet.first[r]}
        sequential.sequential(*market, items, 6, BID_MIXED, 0, WINNER_LOWEST_BID, 0)
        for r, task in first.items():
            assert fleet.order[r, 0] == task
            checked += fleet.length[r] > 1
    assert checked > 10


def test_average_bids_are_about_arrival_times() -> None:
    """One robot at 0 on a line with tasks at 4 and 2: arrivals 4 alone; 2 and 4 together."""
    ticks = [[abs(a - b) for b in (0, 4, 2)] for a in (0, 4, 2)]
    task_costs, battery = visits(ticks, ticks, (1, 2)), battery_of(ticks)
    fleet, scratch = fleet_of([0], 2), scratch_for(1, 2, 2, 0)
    settle_all(task_costs, battery, fleet, scratch)
    assert sequential.bid(task_costs, battery, fleet, scratch, 0, 0, BID_AVERAGE_ADDED, 0) == 4000
    sequential.award(task_costs, battery, fleet, scratch, 0, 0)
    assert sequential.bid(task_costs, battery, fleet, scratch, 0, 1, BID_AVERAGE_ADDED, 0) == 2000
    assert sequential.bid(task_costs, battery, fleet, scratch, 0, 1, BID_AVERAGE, 0) == 3000


def test_an_infeasible_robot_bids_nothing_whatever_epsilon_is() -> None:
    for epsilon in (0, 500, 1000):
        *market, _ = random_auction(
            random.Random(1), 2, 3, POLICY_HIERARCHICAL, reserve=990_000_000
        )
        market[2].charge[:] = 300_000_000
        assert sequential.bid(*market, 0, 0, BID_MIXED, epsilon) == INF_COST
