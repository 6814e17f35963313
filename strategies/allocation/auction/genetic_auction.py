"""The genetic algorithm that De Ryck et al. compare with: a gene for each item names its robot.

Population of ten for each robot, as many elite as robots, roulette by rank, one-point crossover, and
mutation with probability 1/2: of one gene of a child, or (`each_gene`) of each gene. A robot's list
is made by inserting its items in the order of arrival. Draws are addressed by the seed, the number of
the auction with the generation, and the child.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.strategy.kernels import random_between
from strategies.allocation.auction.insertion import cheapest_insertion, insert
from strategies.allocation.auction.market import INF_COST
from strategies.allocation.auction.quotes import clear_counts, settle
from strategies.allocation.auction.sequential import objective

STREAM_GENES = 15  # of random draws; each stream has a number of its own

CHILD_ADDRESSES = 8  # addresses of a child besides those of its genes
# addresses of an auction: one for each generation, of which there are fewer
AUCTION_ADDRESSES = 1 << 20


@kernel
def genetic(
    costs, battery, fleet, scratch, population, items, count, epsilon, generations, each_gene, seed,
    auction,
):  # fmt: skip
    """Leave the best individual's lists in the fleet; returns its objective, or INF_COST.

    population: for this fleet and `count` items; each_gene: 1 = a coin for each gene; auction: the
    number by which the draws of this seed are told from those of its other auctions.
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
    """Remember the lists that every individual begins with."""
    for r in range(fleet.place.shape[0]):
        population.length[r] = fleet.length[r]
        for i in range(fleet.length[r]):
            population.order[r, i] = fleet.order[r, i]


@kernel
def decode(costs, battery, fleet, scratch, population, items, count, individual):
    """Make the lists of an individual; where a list cannot take an item, the cost is INF_COST."""
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
        costs.robot_type[0] = fleet.robot_type[r]
        position, _ = cheapest_insertion(costs, place, fleet.order[r], length, task, first)
        scratch.count.positions[0] += length + 1 - first
        insert(fleet.order[r], length, task, position)
        fleet.length[r] += 1
    for r in range(fleet.place.shape[0]):
        settle(costs, battery, fleet, scratch, r)
    if refused >= 0:
        fleet.cost[refused] = INF_COST


@kernel
def judge(costs, battery, fleet, scratch, population, items, count, epsilon):
    """fitness of all individuals, and their rank; ties: the lower number."""
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
    """The next generation: the elite, and children of two parents each."""
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
