"""Section 5.1 of De Ryck et al.: task sets, and what each method makes of them.

A task set of a seed: stations without repetition, the first n of a shuffle that is drawn for each n;
the same for every method, number of robots and floor. Makespans are in seconds; with epsilon, the
objective epsilon x sum + (1 - epsilon) x longest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import factorial
from typing import Final

import numpy as np

from automaton.engine.random_numbers import random_between
from automaton.papers.auctions.auction_floor import (
    DEPOTS,
    NO_BATTERY,
    STATIONS,
    empty,
    fleet_at,
    listed,
    scratch_of,
    seconds,
    work_of,
)
from strategies.allocation.auction import bundles, metaheuristics, sequential
from strategies.allocation.auction.bundles import bundles_for, generations, population_for
from strategies.allocation.auction.market import (
    Array,
    Battery,
    Fleet,
    Scratch,
    TaskCosts,
)
from strategies.allocation.auction.quotes import clear_counts
from strategies.allocation.auction.sequential import (
    BID_MIXED,
    WINNER_DIFFERENCE,
    WINNER_FEWEST_BIDDERS,
    WINNER_LOWEST_BID,
    WINNER_REGRET,
)

STREAM_TASK_SETS = 14  # of random draws; each stream has a number of its own

MOST_TASKS: Final = 10
OPTIMUM: Final = "optimum"
AGAIN: Final = "LB, all bid again"  # the same lists, with more work


@cache
def task_set(seed: int, n: int, number: int = 0) -> tuple[int, ...]:
    """n stations, drawn without repetition: the first n of a Fisher-Yates shuffle."""
    left = list(STATIONS)
    address = number * (MOST_TASKS + 1) + n
    with np.errstate(over="ignore"):
        for i in range(n):
            j = random_between(i, len(left) - 1, np.uint64(seed), STREAM_TASK_SETS, address, i)
            left[i], left[int(j)] = left[int(j)], left[i]
    return tuple(left[:n])


@dataclass(frozen=True)
class Instance:
    """A task set and robots with empty lists."""

    task_costs: TaskCosts
    battery: Battery
    fleet: Fleet
    scratch: Scratch
    items: Array
    epsilon: int
    seed: int

    @property
    def market(self) -> tuple[TaskCosts, Battery, Fleet, Scratch]:
        return self.task_costs, self.battery, self.fleet, self.scratch

    @property
    def robots(self) -> int:
        return len(self.fleet.place)

    @property
    def tasks(self) -> int:
        return len(self.items)


def instance(lanes: str, robots: int, n: int, seed: int, epsilon: int = 0) -> Instance:
    """The task set of a seed and so many robots, each at its depot."""
    task_costs = work_of(task_set(seed, n), seconds(lanes))
    fleet = fleet_at(DEPOTS[:robots], n)
    items = np.arange(n, dtype=np.int32)
    scratch = scratch_of(fleet, n)
    return Instance(task_costs, NO_BATTERY[lanes], fleet, scratch, items, epsilon, seed)


def auction(one: Instance, winner: int, everybody: int = 0) -> None:
    """The sequential auction with this rule for the winner; everybody = 1: all bid again."""
    rules = BID_MIXED, one.epsilon, winner, everybody
    sequential.sequential(*one.market, one.items, one.tasks, *rules)


def auction_and_search(one: Instance) -> None:
    """The sequential auction by lowest bids, then local search."""
    auction(one, WINNER_LOWEST_BID)
    metaheuristics.improve(*one.market, one.epsilon)


def optimum(one: Instance) -> None:
    """The best lists of all."""
    workspace = bundles_for(one.robots, one.tasks)
    bundles.exact(*one.market, workspace, one.items, one.tasks, one.epsilon)


def best_allotment(one: Instance) -> None:
    """The best of all m^n allotments, each robot inserting its tasks in the order of arrival."""
    workspace = bundles_for(one.robots, one.tasks)
    bundles.combinatorial(*one.market, workspace, one.items, one.tasks, one.epsilon)


def evolve(one: Instance, each_gene: int) -> None:
    """The paper's genetic algorithm."""
    population = population_for(one.robots, one.tasks, one.tasks)
    rounds = generations(one.robots, one.tasks)
    address = np.uint64(one.seed), one.tasks  # a seed has a task set for each number of tasks
    arguments = (one.items, one.tasks, one.epsilon, rounds, each_gene, *address)
    with np.errstate(over="ignore"):
        metaheuristics.genetic(*one.market, population, *arguments)


Method = Callable[[Instance], None]

METHODS: Final[dict[str, Method]] = {
    OPTIMUM: optimum,
    "m^n": best_allotment,
    "LB": lambda one: auction(one, WINNER_LOWEST_BID),
    AGAIN: lambda one: auction(one, WINNER_LOWEST_BID, 1),
    "BD": lambda one: auction(one, WINNER_DIFFERENCE),
    "FB": lambda one: auction(one, WINNER_FEWEST_BIDDERS),
    "regret": lambda one: auction(one, WINNER_REGRET),
    "LB+search": auction_and_search,
    "arrival": lambda one: (
        sequential.by_arrival(*one.market, one.items, one.tasks, BID_MIXED, one.epsilon) and None
    ),
    "parallel": lambda one: (
        sequential.parallel(*one.market, one.items, one.tasks, BID_MIXED, one.epsilon) and None
    ),
    "GA": lambda one: evolve(one, 0),
    "GA each gene": lambda one: evolve(one, 1),
}


@dataclass(frozen=True)
class Solved:
    """What a method made of an instance."""

    objective: float  # seconds
    bids: int
    positions: int  # of lists, tried for insertion
    lists: tuple[tuple[int, ...], ...]  # stations of each robot


@cache
def solve(lanes: str, robots: int, n: int, seed: int, method: str, epsilon: int) -> Solved:
    """Let a method allot the task set of a seed."""
    one = instance(lanes, robots, n, seed, epsilon)
    empty(*one.market)
    clear_counts(one.scratch)
    METHODS[method](one)
    stations = task_set(seed, n)
    return Solved(
        sequential.objective(one.fleet, epsilon) / 1000,
        int(one.scratch.count.bids[0]),
        int(one.scratch.count.positions[0]),
        tuple(tuple(stations[task] for task in listed(one.fleet, r)) for r in range(robots)),
    )


def ratio(lanes: str, robots: int, n: int, seed: int, method: str, epsilon: int = 0) -> float:
    """The objective of a method as a multiple of the optimum."""
    best = solve(lanes, robots, n, seed, OPTIMUM, epsilon).objective
    return solve(lanes, robots, n, seed, method, epsilon).objective / best


def sequences(robots: int, n: int) -> int:
    """Ways to put n tasks into the lists of so many robots: (n + m - 1)! / (m - 1)!."""
    return factorial(n + robots - 1) // factorial(robots - 1)
