"""Several comparisons at once: Holm's tests, and Bonferroni's intervals beside them.

A family is what one declared table compares. Holm (1979): the i-th smallest of m p values is
multiplied by m - i + 1, and never becomes less than one before it; the probability of any false
finding in the family then stays below the level, whatever depends on what.
"""

from __future__ import annotations

from collections.abc import Sequence


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjusted p values in the order given, at most 1. Raises ValueError beyond 0..1."""
    if any(not 0 <= p <= 1 for p in p_values):
        raise ValueError("p values lie between 0 and 1")
    adjusted, largest = [0.0] * len(p_values), 0.0
    for rank, index in enumerate(sorted(range(len(p_values)), key=lambda i: p_values[i])):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[index]))
        adjusted[index] = largest
    return adjusted


def bonferroni(level: float, comparisons: int) -> float:
    """The level of each interval so that all of a family hold together with `level`."""
    if comparisons < 1 or not 0 < level < 1:
        raise ValueError("a family has at least one comparison and a level between 0 and 1")
    return 1 - (1 - level) / comparisons
