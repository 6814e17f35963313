"""Measurements of the viewer: several of one session, which takes half a minute."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Final, Generic, TypeVar

from automaton.bench.measurement import Measurement, Sample

LONG: Final = 3  # samples of what takes half a minute each

T = TypeVar("T")


def measured(name: str, unit: str, sample: Sample, most: int = LONG) -> Measurement:
    """A measurement of at most so many samples, the first included."""
    return Measurement(name, unit, lambda: sample, warm_up=False, at_most=most)


class Together(Generic[T]):
    """Several measurements of the same sessions, each of which takes half a minute."""

    def __init__(self, take: Callable[[], T]) -> None:
        self._take = take
        self._taken: list[T] = []

    def figure(
        self, name: str, unit: str, of: Callable[[T], float], most: int = LONG
    ) -> Measurement:
        """One of them."""
        numbers = itertools.count()

        def sample() -> float:
            number = next(numbers)
            if number == len(self._taken):
                self._taken.append(self._take())
            return of(self._taken[number])

        return measured(name, unit, sample, most)
