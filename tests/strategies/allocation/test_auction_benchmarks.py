"""What auctions are measured against: the optimum, the genetic algorithm, local search, one-shot."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from auction_scenes import lists_of, random_auction

from automaton.engine.state import NIL, Array
from automaton.errors import InputError
from strategies.allocation.auction import bundles, metaheuristics, sequential
from strategies.allocation.auction.bundles import bundles_for
from strategies.allocation.auction.market import (
    INF_COST,
    POLICY_NO_CHARGING,
    AuctionScratch,
    BatteryRules,
    FleetLists,
    TaskCosts,
)
from strategies.allocation.auction.metaheuristics import generations, population_for
from strategies.allocation.auction.sequential import (
    BID_MIXED,
    WINNER_DIFFERENCE,
    WINNER_FEWEST_BIDDERS,
    WINNER_LOWEST_BID,
    WINNER_REGRET,
    award,
)
from strategies.linear_sum_assignment import assignment_for, linear_sum_assignment

Market = tuple[TaskCosts, BatteryRules, FleetLists, AuctionScratch]


def scene(seed: int, robots: int, tasks: int) -> tuple[Market, Array]:
    """Robots with empty lists, all of which may bid."""
    *market, items = random_auction(random.Random(seed), robots, tasks, POLICY_NO_CHARGING)
    fleet = market[2]
    fleet.may_bid[:] = 1
    fleet.length[:] = 0
    fleet.first[:] = 0
    fleet.ready[:] = 0
    fleet.cost[:] = 0
    fleet.travel[:] = 0
    return tuple(market), items  # type: ignore[return-value]


def ticks_of(task_costs: TaskCosts, place: int, order: Sequence[int]) -> int:
    now, here = 0, place
    for task in order:
        now += int(task_costs.ticks[0, here, task_costs.begin[task]] + task_costs.inside[0, task])
        here = int(task_costs.end[task])
    return now


def brute_force(market: Market, tasks: int, epsilon: int) -> int:
    """The least objective over all allotments and all sequences."""
    task_costs, _, fleet, _ = market
    robots = range(len(fleet.place))
    cost = {
        (r, bundle): min(
            ticks_of(task_costs, int(fleet.place[r]), order)
            for order in itertools.permutations(bundle)
        )
        for r in robots
        for size in range(tasks + 1)
        for bundle in itertools.combinations(range(tasks), size)
    }
    values = []
    for owners in itertools.product(robots, repeat=tasks):
        costs = [cost[r, tuple(k for k in range(tasks) if owners[k] == r)] for r in robots]
        values.append(epsilon * sum(costs) + (1000 - epsilon) * max(costs))
    return min(values)


METHODS: dict[str, Callable[[Market, Array, int, int], object]] = {
    **{
        name: lambda market, items, n, epsilon, winner=winner: sequential.sequential(
            *market, items, n, BID_MIXED, epsilon, winner, 0
        )
        for name, winner in (
            ("LB", WINNER_LOWEST_BID),
            ("BD", WINNER_DIFFERENCE),
            ("FB", WINNER_FEWEST_BIDDERS),
            ("regret", WINNER_REGRET),
        )
    },
    "local search": lambda market, items, n, epsilon: (
        sequential.sequential(*market, items, n, BID_MIXED, epsilon, WINNER_LOWEST_BID, 0),
        metaheuristics.improve(*market, epsilon),
    ),
    "arrival": lambda market, items, n, epsilon: sequential.by_arrival(
        *market, items, n, BID_MIXED, epsilon
    ),
    "parallel": lambda market, items, n, epsilon: sequential.parallel(
        *market, items, n, BID_MIXED, epsilon
    ),
    "combinatorial": lambda market, items, n, epsilon: bundles.combinatorial(
        *market, bundles_for(len(market[2].place), n), items, n, epsilon
    ),
    "genetic": lambda market, items, n, epsilon: metaheuristics.genetic(
        *market,
        population_for(len(market[2].place), n, n),
        items,
        n,
        epsilon,
        generations(len(market[2].place), n),
        0,
        np.uint64(n),
        0,
    ),
}


def optimum(market: Market, items: Array, tasks: int, epsilon: int) -> int:
    workspace = bundles_for(len(market[2].place), tasks)
    return int(bundles.exact(*market, workspace, items, tasks, epsilon))


@pytest.mark.parametrize("epsilon", [0, 500, 1000])
@pytest.mark.parametrize(("robots", "tasks"), [(1, 1), (1, 5), (2, 4), (2, 6), (3, 5)])
def test_the_optimum_is_that_of_trying_everything(robots: int, tasks: int, epsilon: int) -> None:
    for seed in range(6):
        market, items = scene(seed, robots, tasks)
        value = optimum(market, items, tasks, epsilon)
        assert value == brute_force(market, tasks, epsilon)
        assert value == metaheuristics.objective(market[2], epsilon)
        assert sorted(itertools.chain(*lists_of(market[2]))) == list(range(tasks))


@pytest.mark.parametrize("epsilon", [0, 500, 1000])
@pytest.mark.parametrize("name", METHODS)
def test_no_method_is_better_than_the_optimum(name: str, epsilon: int) -> None:
    for seed in range(25):
        robots, tasks = 1 + seed % 4, 1 + seed % 7
        market, items = scene(seed, robots, tasks)
        least = optimum(market, items, tasks, epsilon)
        market, items = scene(seed, robots, tasks)
        METHODS[name](market, items, tasks, epsilon)
        assert metaheuristics.objective(market[2], epsilon) >= least
        assert sorted(itertools.chain(*lists_of(market[2]))) == list(range(tasks))
        sold = market[3].sold[:tasks].tolist()
        if name != "local search":
            assert [lists_of(market[2])[r].count(k) for k, r in enumerate(sold)] == [1] * tasks


def allotments_by_insertion(market: Market, items: Array, epsilon: int) -> int:
    """The best of all m^n allotments when each robot inserts its items in turn."""
    robots, tasks = len(market[2].place), len(items)
    best = INF_COST
    for owners in itertools.product(range(robots), repeat=tasks):
        market[2].length[:] = 0
        market[2].travel[:] = market[2].cost[:] = 0
        for k, r in enumerate(owners):
            award(*market, r, k)
        best = min(best, int(metaheuristics.objective(market[2], epsilon)))
    return best


@pytest.mark.parametrize("epsilon", [0, 400, 1000])
def test_the_combinatorial_auction_is_the_best_of_all_allotments(epsilon: int) -> None:
    for seed in range(6):
        robots, tasks = 1 + seed % 3, 4 + seed % 2
        market, items = scene(seed, robots, tasks)
        value = METHODS["combinatorial"](market, items, tasks, epsilon)
        assert value == metaheuristics.objective(market[2], epsilon)
        market, items = scene(seed, robots, tasks)
        assert value == allotments_by_insertion(market, items, epsilon)


@pytest.mark.parametrize("epsilon", [0, 500, 1000])
def test_local_search_never_makes_lists_worse_and_keeps_all_tasks(epsilon: int) -> None:
    improved = 0
    for seed in range(60):
        *market, items = random_auction(random.Random(seed), 3, 7, seed % 6, threshold=200_000_000)
        fleet, scratch = market[2], market[3]
        sequential.sequential(*market, items, 7, BID_MIXED, epsilon, WINNER_LOWEST_BID, 0)
        before, tasks = (
            metaheuristics.objective(fleet, epsilon),
            sorted(itertools.chain(*lists_of(fleet))),
        )
        first = [row[0] for row, frozen in zip(lists_of(fleet), fleet.first, strict=True) if frozen]
        moves = metaheuristics.improve(*market, epsilon)
        after = metaheuristics.objective(fleet, epsilon)
        assert after <= before
        assert sorted(itertools.chain(*lists_of(fleet))) == tasks
        assert first == [
            row[0] for row, frozen in zip(lists_of(fleet), fleet.first, strict=True) if frozen
        ]
        for k, robot in enumerate(scratch.sold[:7]):
            if robot != NIL:
                [owner] = [r for r in range(3) if k in lists_of(fleet)[r]]
                assert fleet.may_bid[owner, k] == 1
        improved += after < before and moves > 0
    assert improved >= 10


def test_a_genetic_run_repeats_itself_and_seeds_differ() -> None:
    found = []
    for seed in (1, 1, 2):
        market, items = scene(3, 3, 7)
        population = population_for(3, 7, 7)
        metaheuristics.genetic(*market, population, items, 7, 0, 20, 0, np.uint64(seed), 0)
        found.append(population.genes.tolist())
    assert found[0] == found[1] != found[2]


def test_both_mutations_search_and_the_one_for_each_gene_searches_more() -> None:
    """With as many generations, a coin for each gene leaves less of the elite's offspring alike."""
    distinct = []
    for each_gene in (0, 1):
        market, items = scene(4, 4, 8)
        population = population_for(4, 8, 8)
        metaheuristics.genetic(*market, population, items, 8, 0, 200, each_gene, np.uint64(1), 0)
        distinct.append(len({tuple(row) for row in population.genes.tolist()}))
    assert distinct[0] < distinct[1]


def test_generations_are_ten_times_the_allotments_up_to_a_thousand() -> None:
    assert [generations(1, 9), generations(2, 3), generations(3, 4), generations(4, 9)] == [
        10,
        80,
        810,
        1000,
    ]


def test_too_many_tasks_for_the_optimum_are_refused() -> None:
    with pytest.raises(InputError, match=r"13 tasks .* at most 12 tasks"):
        bundles_for(3, 13)


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (3, 3), (3, 5), (5, 6)])
def test_linear_sum_assignment_is_the_best_of_all(rows: int, columns: int) -> None:
    rng = random.Random(rows + 10 * columns)
    for _ in range(60):
        table = [
            [INF_COST if rng.random() < 0.2 else rng.randrange(40) for _ in range(columns)]
            for _ in range(rows)
        ]
        workspace = assignment_for(columns)
        workspace.cost[:rows, :columns] = table
        linear_sum_assignment(workspace.cost, rows, columns, workspace)
        ways = [
            [table[i][j] for i, j in enumerate(way)]
            for way in itertools.permutations(range(columns), rows)
        ]
        most = max(sum(cost < INF_COST for cost in way) for way in ways)
        least = min(
            sum(cost for cost in way if cost < INF_COST)
            for way in ways
            if sum(cost < INF_COST for cost in way) == most
        )
        chosen = {int(i): j for j, i in enumerate(workspace.row_of[:columns]) if i != NIL}
        assert len(chosen) == most
        assert sum(table[i][j] for i, j in chosen.items()) == least


@pytest.mark.parametrize(("robots", "tasks"), [(3, 5), (5, 3), (4, 4)])
def test_one_shot_gives_each_robot_one_task_at_most(robots: int, tasks: int) -> None:
    for seed in range(20):
        *market, items = random_auction(random.Random(seed), robots, tasks)
        market[2].may_bid[:] = 1
        before = market[2].length.copy()
        workspace = assignment_for(max(robots, tasks))
        given = sequential.assign_once(*market, workspace, items, tasks, BID_MIXED, 0)
        assert given == min(robots, tasks)
        added = market[2].length - before
        assert added.max() == 1
        assert added.sum() == given
        for k, robot in enumerate(market[3].sold[:tasks]):
            assert robot == NIL or k in lists_of(market[2])[robot]
