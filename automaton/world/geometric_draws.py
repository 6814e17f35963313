"""Durations in whole ticks that are memoryless: the geometric distribution."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.engine import random_numbers

FINEST: Final = 2.0**-60  # no u is below 2^-54


def geometric(
    mean: float, seed: int, stream: int, ticks: npt.ArrayLike, robots: npt.ArrayLike
) -> npt.NDArray[np.int64]:
    """(k,) int64 from 1 on, geometric with this mean, addressed by (stream, ticks[i], robots[i]).

    P(X > k) = q^k with q = 1 - 1/mean. A draw is 1 plus the greatest k with q^k > u, u uniform in
    (0, 1).
    """
    where, who = np.broadcast_arrays(np.asarray(ticks, np.int64), np.asarray(robots, np.int64))
    bits = np.zeros(len(where), np.uint64)
    with np.errstate(over="ignore"):
        random_numbers.random_bits_of_each(bits, np.uint64(seed), stream, where.copy(), who.copy())
    return geometric_quantile(mean, ((bits >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53)


def geometric_quantile(mean: float, u: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """(k,) int64: for u between 0 and 1, 1 plus the greatest k with q^k > u, where q = 1 - 1/mean.

    It is found bit by bit from q, q^2, q^4, ... by multiplications alone, which round alike everywhere,
    as logarithms do not.
    """
    powers = [1.0 - 1.0 / mean]  # q^(2^i)
    while powers[-1] > FINEST:
        powers.append(powers[-1] * powers[-1])
    numbers = np.ones(len(u), np.int64)
    left = np.ones(len(u))
    for i in range(len(powers) - 1, -1, -1):
        further = left * powers[i]
        more = further > u
        left[more] = further[more]
        numbers[more] += 1 << i
    return numbers
