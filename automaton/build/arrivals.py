"""Draw when orders are released: at once, one by one, in bursts, in a closed loop, or as listed.

Draws are addressed by the seed and the number of an order or a burst alone; of a closed loop only the
sequence is drawn, and its ticks follow from the deliveries.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automaton.engine import random_numbers
from automaton.engine.releases import draw_releases
from automaton.engine.state import NEVER, Array
from automaton.scenario.orders import DRAWN, Bursts, Mean, Orders
from automaton.scenario.schema import Scenario

FINEST = 2.0**-60  # no u is below 2^-54
SIZES, GAPS, PARTS = 1, 2, 3  # what is drawn of a burst; PARTS + k: gaps between parts of type k
DRAW_RELEASE_SEQUENCE = 2  # what is drawn of an order, beside where it begins and ends


def releases(scenario: Scenario, count: int, seed: int) -> tuple[Array, Array]:
    """(count,) int64 each: the ticks from which orders are known, and their sequence."""
    orders = scenario.orders
    if orders.listed is not None:
        released = np.array([line.release for line in orders.listed], np.int64)
        return released, np.argsort(released, kind="stable")
    ticks = np.minimum(ticks_by_rank(orders, count, seed, scenario.stop.max_duration + 1), NEVER)
    sequence = np.arange(count)
    if orders.generator not in DRAWN and ticks.any():  # not one row of shelves after the other
        sequence = drawn_sequence(count, seed)
    released = np.zeros(count, np.int64)
    released[sequence] = ticks
    return released, sequence if orders.in_system else np.argsort(released, kind="stable")


def ticks_by_rank(orders: Orders, count: int, seed: int, last: int) -> Array:
    """(count,) int64: the tick of the first order, of the second, ...; those after `last` at it.

    With a mean_interarrival_time, the first at once and then one in each tick with probability
    1/mean_interarrival_time.
    """
    ticks = np.zeros(count, np.int64)
    arrivals = orders.arrivals
    if orders.mean_interarrival_time:
        with np.errstate(over="ignore"):
            chance = round(2**32 / orders.mean_interarrival_time)
            draw_releases(ticks, chance, np.uint64(seed), last)
    elif arrivals is not None and arrivals.bursts is not None:
        ticks = np.minimum(burst_ticks(arrivals.bursts, count, seed), last)
    elif orders.in_system:
        ticks[orders.in_system :] = NEVER
    return ticks


def burst_ticks(bursts: Bursts, count: int, seed: int) -> Array:
    """(count,) int64: the tick of the burst to which each order belongs; the first one is at 0."""
    sizes = gaps(bursts.size, count, seed, SIZES)  # no burst is empty
    ticks = np.concatenate([[0], np.cumsum(gaps(bursts.every, count, seed, GAPS)[:-1])])
    found: Array = np.repeat(ticks, np.minimum(sizes, count))[:count]
    return found


def gaps(value: int | Mean, count: int, seed: int, what: int) -> Array:
    """(count,) int64: a number given, or drawn for each."""
    if isinstance(value, int):
        return np.full(count, value, np.int64)
    return geometric(value.mean, seed, random_numbers.STREAM_RELEASES, np.arange(count), what)


def drawn_sequence(count: int, seed: int) -> Array:
    """(count,) int64: all orders in a random sequence."""
    keys = np.zeros(count, np.uint64)
    numbers, what = np.arange(count), np.full(count, DRAW_RELEASE_SEQUENCE)
    with np.errstate(over="ignore"):
        random_numbers.random_bits_of_each(
            keys, np.uint64(seed), random_numbers.STREAM_ORDERS, what, numbers
        )
    return np.argsort(keys, kind="stable")


def geometric(
    mean: float, seed: int, stream: int, ticks: npt.ArrayLike, robots: npt.ArrayLike
) -> npt.NDArray[np.int64]:
    """(k,) int64 from 1 on, geometric with this mean, addressed by (stream, ticks[i], robots[i]).

    P(X > k) = q^k with q = 1 - 1/mean. A draw is 1 plus the greatest k with q^k > u, u uniform in
    (0, 1); it is found bit by bit from q, q^2, q^4, ... by multiplications alone, which round alike
    everywhere, as logarithms do not.
    """
    where, who = np.broadcast_arrays(np.asarray(ticks, np.int64), np.asarray(robots, np.int64))
    bits = np.zeros(len(where), np.uint64)
    with np.errstate(over="ignore"):
        random_numbers.random_bits_of_each(bits, np.uint64(seed), stream, where.copy(), who.copy())
    u = ((bits >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53
    powers = [1.0 - 1.0 / mean]  # q^(2^i)
    while powers[-1] > FINEST:
        powers.append(powers[-1] * powers[-1])
    found = np.ones(len(u), np.int64)
    left = np.ones(len(u))
    for i in range(len(powers) - 1, -1, -1):
        further = left * powers[i]
        more = further > u
        left[more] = further[more]
        found[more] += 1 << i
    return found
