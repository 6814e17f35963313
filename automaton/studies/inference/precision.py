"""How many runs a comparison needs: until the interval of a difference is as narrow as wanted.

    paired     t(n - 1) sd(a - b) / sqrt(n) <= half
    unpaired   t(v) sqrt((var a + var b) / n) <= half, n runs of each; v: Satterthwaite (1946)

By the variances of runs that were made: a plan for the next study, no reason to stop this one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from automaton.studies.inference.intervals import DEFAULT_CONFIDENCE, Values, checked
from automaton.studies.inference.t_distribution import student


def paired_runs(
    a: Sequence[float] | Values,
    b: Sequence[float] | Values,
    half: float,
    level: float = DEFAULT_CONFIDENCE,
) -> int:
    """Pairs of runs until the interval of the difference reaches `half` to each side, at least 2.

    `a` and `b`: runs with the same seeds, one below the other. Raises ValueError.
    """
    difference = checked(a, 2) - checked(b, 2)
    return fewest(float(difference.var(ddof=1)), 1.0, half, level)


def unpaired_runs(
    a: Sequence[float] | Values,
    b: Sequence[float] | Values,
    half: float,
    level: float = DEFAULT_CONFIDENCE,
) -> int:
    """Runs of each of two independent samples for the same, at least 2. Raises ValueError."""
    u, v = (float(checked(one, 2).var(ddof=1)) for one in (a, b))
    degrees = (u + v) ** 2 / (u * u + v * v) if u + v > 0 else 2.0
    return fewest(u + v, degrees, half, level)


def fewest(variance: float, degrees: float, half: float, level: float) -> int:
    """The smallest n from 2 on with t(degrees (n - 1)) sqrt(variance / n) <= half."""
    if half <= 0:
        raise ValueError(f"a precision is above 0, not {half}")

    def enough(n: int) -> bool:
        return student(degrees * (n - 1), level) * math.sqrt(variance / n) <= half

    low, high = 1, 2
    while not enough(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high
