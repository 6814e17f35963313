"""Improvement of the lists of an auction: local search, and the genetic algorithm.

The objective is epsilon x the sum of the robots' costs + (1 - epsilon) x the largest of them.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.strategy.api import SCRATCH, Array, Struct, field, kernel, random_between
from strategies.allocation.auction.market import (
    BID_SCALE,
    INF_COST,
    cheapest_insertion,
    insert,
    remove,
)
from strategies.allocation.auction.quotes import clear_counts, quote_list, settle

STREAM_GENES = 15  # of random draws; each stream has a number of its own
CHILD_ADDRESSES = 8  # draws of a child besides those of its genes
# draw addresses of an auction: one per generation, of which there are fewer
AUCTION_ADDRESSES = 1 << 20
MAX_GENERATIONS: Final = 1000


@kernel
def objective(fleet, epsilon):
    """epsilon x the sum of the costs + (1 - epsilon) x the largest, in thousandths; or INF_COST."""
    total, most = np.int64(0), np.int64(0)
    for r in range(fleet.cost.shape[0]):
        if fleet.cost[r] >= INF_COST:
            return np.int64(INF_COST)
        total += fleet.cost[r]
        most = max(most, fleet.cost[r])
    return epsilon * total + (1000 - epsilon) * most


# Local search: relocate a task, swap two tasks, reverse a stretch (2-opt). The search takes the first
# move that lowers the objective, or keeps it and lowers the sum of all costs.


@kernel
def improve(costs, battery, fleet, scratch, epsilon):
    """Improve settled, feasible lists until no move helps; return the number of moves."""
    robots = fleet.place.shape[0]
    moves = np.int64(0)
    found = True
    while found:
        found = False
        for r in range(robots):
            while two_opt(costs, battery, fleet, scratch, epsilon, r):
                found = True
                moves += 1
            for s in range(robots):
                while relocate(costs, battery, fleet, scratch, epsilon, r, s):
                    found = True
                    moves += 1
                while s > r and swap(costs, battery, fleet, scratch, epsilon, r, s):
                    found = True
                    moves += 1
    return moves


@kernel
def better(fleet, epsilon, r, cost_r, s, cost_s):
    """Whether costs cost_r, cost_s of robots r and s are an improvement; r == s: cost_r alone."""
    if cost_r >= INF_COST or cost_s >= INF_COST:
        return False
    rest, most = np.int64(0), np.int64(0)
    for other in range(fleet.cost.shape[0]):
        if other != r and other != s:
            rest += fleet.cost[other]
            most = max(most, fleet.cost[other])
    now_sum, now_most = rest + fleet.cost[r], max(most, fleet.cost[r])
    new_sum, new_most = rest + cost_r, max(most, cost_r)
    if s != r:
        now_sum, now_most = now_sum + fleet.cost[s], max(now_most, fleet.cost[s])
        new_sum, new_most = new_sum + cost_s, max(new_most, cost_s)
    now = epsilon * now_sum + (BID_SCALE - epsilon) * now_most
    new = epsilon * new_sum + (BID_SCALE - epsilon) * new_most
    return new < now or (new == now and new_sum < now_sum)


@kernel
def two_opt(costs, battery, fleet, scratch, epsilon, r):
    """Reverse one stretch of robot r's list if this is an improvement."""
    length = np.int64(fleet.length[r])
    order = fleet.order[r]
    for i in range(min(np.int64(fleet.first[r]), length), length):
        for j in range(i + 1, length):
            for k in range(length):
                scratch.order[k] = order[i + j - k] if i <= k <= j else order[k]
            cost = quote_list(costs, battery, fleet, scratch, r, scratch.order, length)
            if better(fleet, epsilon, r, cost, r, cost):
                for k in range(length):
                    order[k] = scratch.order[k]
                settle(costs, battery, fleet, scratch, r)
                return True
    return False


@kernel
def cost_without(costs, battery, fleet, scratch, r, position):
    """The quote of robot r's list without the task at this position; leaves the list in scratch.order."""
    length = np.int64(fleet.length[r])
    for k in range(length):
        scratch.order[k] = fleet.order[r, k]
    remove(scratch.order, length, position)
    return quote_list(costs, battery, fleet, scratch, r, scratch.order, length - 1)


@kernel
def cost_inserted(costs, battery, fleet, scratch, r, length, task):
    """(position, quote) of scratch.order[:length] with the task inserted; leaves the list there."""
    first = min(np.int64(fleet.first[r]), length)
    place = np.int64(fleet.place[r])
    costs.robot_type = fleet.robot_type[r]
    position, _ = cheapest_insertion(costs, place, scratch.order, length, task, first)
    insert(scratch.order, length, task, position)
    return position, quote_list(costs, battery, fleet, scratch, r, scratch.order, length + 1)


@kernel
def relocate(costs, battery, fleet, scratch, epsilon, r, s):
    """Move one task of robot r to its cheapest position in robot s's list if this is an improvement."""
    if s != r and fleet.length[s] >= fleet.capacity[s]:
        return False
    length = np.int64(fleet.length[r])
    for i in range(min(np.int64(fleet.first[r]), length), length):
        task = np.int64(fleet.order[r, i])
        if fleet.may_bid[s, task] == 0:
            continue
        cost_r = cost_without(costs, battery, fleet, scratch, r, i)
        target = length - 1
        if s != r:
            target = np.int64(fleet.length[s])
            for k in range(target):
                scratch.order[k] = fleet.order[s, k]
        position, cost_s = cost_inserted(costs, battery, fleet, scratch, s, target, task)
        if s == r:
            cost_r = cost_s
        if better(fleet, epsilon, r, cost_r, s, cost_s):
            move(fleet, r, i, s, position)
            settle(costs, battery, fleet, scratch, r)
            settle(costs, battery, fleet, scratch, s)
            return True
    return False


@kernel
def move(fleet, r, i, s, position):
    """Move the task at i of robot r to `position` of robot s's list."""
    task = np.int64(fleet.order[r, i])
    remove(fleet.order[r], fleet.length[r], i)
    fleet.length[r] -= 1
    insert(fleet.order[s], fleet.length[s], task, position)
    fleet.length[s] += 1


@kernel
def swap(costs, battery, fleet, scratch, epsilon, r, s):
    """Exchange a task of robot r for one of robot s, each inserted where it is cheapest."""
    for i in range(min(fleet.first[r], fleet.length[r]), fleet.length[r]):
        given = np.int64(fleet.order[r, i])
        if fleet.may_bid[s, given] == 0:
            continue
        for j in range(min(fleet.first[s], fleet.length[s]), fleet.length[s]):
            taken = np.int64(fleet.order[s, j])
            if fleet.may_bid[r, taken] == 0:
                continue
            at_r, cost_r = exchanged(costs, battery, fleet, scratch, r, i, taken)
            at_s, cost_s = exchanged(costs, battery, fleet, scratch, s, j, given)
            if better(fleet, epsilon, r, cost_r, s, cost_s):
                replace(fleet, r, i, taken, at_r)
                replace(fleet, s, j, given, at_s)
                settle(costs, battery, fleet, scratch, r)
                settle(costs, battery, fleet, scratch, s)
                return True
    return False


@kernel
def exchanged(costs, battery, fleet, scratch, r, i, task):
    """(position, quote) of robot r's list with the task at i replaced by another one."""
    length = np.int64(fleet.length[r])
    for k in range(length):
        scratch.order[k] = fleet.order[r, k]
    remove(scratch.order, length, i)
    return cost_inserted(costs, battery, fleet, scratch, r, length - 1, task)


@kernel
def replace(fleet, r, i, task, position):
    """Remove the task at i from robot r's list and insert another one at `position`."""
    remove(fleet.order[r], fleet.length[r], i)
    insert(fleet.order[r], fleet.length[r] - 1, task, position)


# The genetic algorithm in the comparison of De Ryck et al.: the gene of an item is its robot.
#
# Ten individuals per robot, one elite individual per robot, roulette by rank, one-point crossover, and
# mutation with probability 1/2: of one gene of a child, or (`each_gene`) of each gene. A robot's list is
# made by inserting its items in the order of arrival. Draws are addressed by the seed, the number of the
# auction with the generation, and the child.


class AllotmentPopulation(Struct, role=SCRATCH):
    """N individuals, which assign n items to R robots; and the initial lists."""

    genes: Array = field("(N, n) int32")
    children: Array = field("(N, n) int32")
    fitness: Array = field("(N,) int64", "the objective; smaller is better")
    rank: Array = field("(N,) int32", "individuals from the best to the worst")
    order: Array = field("(R, L) int32", "the robots' lists before the auction")
    length: Array = field("(R,) int32")


def population_for(robots: int, tasks: int, longest: int) -> AllotmentPopulation:
    """Ten individuals per robot."""
    return AllotmentPopulation.sized({"N": 10 * robots, "n": tasks, "R": robots, "L": longest})


def generations(robots: int, tasks: int) -> int:
    """Ten times the number of allotments, at most 1,000 (De Ryck et al.)."""
    allotments: int = robots**tasks
    return min(MAX_GENERATIONS, 10 * allotments)


@kernel
def genetic(
    costs, battery, fleet, scratch, population, items, count, epsilon, generations, each_gene, seed,
    auction,
):  # fmt: skip
    """Leave the best individual's lists in the fleet; return its objective or INF_COST.

    population: for this fleet and `count` items; each_gene: 1 = a coin for each gene; auction: the
    number of the auction, so that each auction of a seed has its own draws.
    """
    clear_counts(scratch)
    turn = np.int64(auction) * AUCTION_ADDRESSES
    robots = fleet.place.shape[0]
    size = population.fitness.shape[0]
    keep_lists(fleet, population)
    for i in range(size):
        for k in range(count):
            population.genes[i, k] = random_between(
                0, robots - 1, seed, STREAM_GENES, turn, i * count + k
            )
    for generation in range(1, generations + 1):
        judge(costs, battery, fleet, scratch, population, items, count, epsilon)
        breed(population, robots, count, each_gene, seed, turn + generation)
    judge(costs, battery, fleet, scratch, population, items, count, epsilon)
    best = np.int64(population.rank[0])
    decode(costs, battery, fleet, scratch, population, items, count, best)
    for k in range(count):
        scratch.sold[k] = population.genes[best, k]
    return population.fitness[best]


@kernel
def keep_lists(fleet, population):
    """Store the initial lists of all individuals."""
    for r in range(fleet.place.shape[0]):
        population.length[r] = fleet.length[r]
        for i in range(fleet.length[r]):
            population.order[r, i] = fleet.order[r, i]


@kernel
def decode(costs, battery, fleet, scratch, population, items, count, individual):
    """Make the lists of an individual; a list that cannot take an item costs INF_COST."""
    for r in range(fleet.place.shape[0]):
        fleet.length[r] = population.length[r]
        for i in range(population.length[r]):
            fleet.order[r, i] = population.order[r, i]
    refused = np.int64(-1)
    for k in range(count):
        r = np.int64(population.genes[individual, k])
        task = np.int64(items[k])
        length = np.int64(fleet.length[r])
        if length >= fleet.capacity[r] or fleet.may_bid[r, task] == 0:
            refused = r
            continue
        first = min(np.int64(fleet.first[r]), length)
        place = np.int64(fleet.place[r])
        costs.robot_type = fleet.robot_type[r]
        position, _ = cheapest_insertion(costs, place, fleet.order[r], length, task, first)
        scratch.count.positions += length + 1 - first
        insert(fleet.order[r], length, task, position)
        fleet.length[r] += 1
    for r in range(fleet.place.shape[0]):
        settle(costs, battery, fleet, scratch, r)
    if refused >= 0:
        fleet.cost[refused] = INF_COST


@kernel
def judge(costs, battery, fleet, scratch, population, items, count, epsilon):
    """Set fitness and rank of all individuals; ties: the lower number."""
    size = population.fitness.shape[0]
    for i in range(size):
        decode(costs, battery, fleet, scratch, population, items, count, i)
        population.fitness[i] = objective(fleet, epsilon)
        at = i
        while at > 0 and population.fitness[population.rank[at - 1]] > population.fitness[i]:
            population.rank[at] = population.rank[at - 1]
            at -= 1
        population.rank[at] = i


@kernel
def breed(population, robots, count, each_gene, seed, turn):
    """Breed the next generation: the elite, and children of two parents each."""
    size = population.fitness.shape[0]
    stride = count + CHILD_ADDRESSES
    for i in range(size):
        child = population.children[i]
        if i < robots:
            elite = np.int64(population.rank[i])
            for k in range(count):
                child[k] = population.genes[elite, k]
            continue
        address = i * stride
        mother = spin(population, size, seed, turn, address)
        father = spin(population, size, seed, turn, address + 1)
        cut = np.int64(0)
        if count > 1:
            cut = random_between(1, count - 1, seed, STREAM_GENES, turn, address + 2)
        for k in range(count):
            child[k] = population.genes[mother if k < cut else father, k]
        mutate(child, robots, count, each_gene, seed, turn, address + 3)
    for i in range(size):
        for k in range(count):
            population.genes[i, k] = population.children[i, k]


@kernel
def spin(population, size, seed, turn, address):
    """An individual by roulette: the best of N has N shares, the worst one."""
    shares = size * (size + 1) // 2
    left = random_between(0, shares - 1, seed, STREAM_GENES, turn, address)
    place = np.int64(0)
    while left >= size - place:
        left -= size - place
        place += 1
    return np.int64(population.rank[place])


@kernel
def mutate(child, robots, count, each_gene, seed, turn, address):
    """Reset one gene with probability 1/2; or each gene with probability 1/2."""
    if each_gene == 1:
        for k in range(count):
            coin = random_between(0, 2 * robots - 1, seed, STREAM_GENES, turn, address + k)
            if coin < robots:
                child[k] = coin
        return
    if random_between(0, 1, seed, STREAM_GENES, turn, address) == 1:
        gene = random_between(0, count - 1, seed, STREAM_GENES, turn, address + 1)
        child[gene] = random_between(0, robots - 1, seed, STREAM_GENES, turn, address + 2)
