"""Measurements of the viewer: several of one session, which takes half a minute."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache
from typing import Final, Generic, TypeVar

from automaton.bench.measurement import Measurement, NotMeasuredError, Sample

LONG: Final = 1  # samples of what takes half a minute each

T = TypeVar("T")


def measured(name: str, unit: str, sample: Sample, most: int = LONG) -> Measurement:
    """A measurement of at most so many samples, the first included."""

    def prepare() -> Sample:
        compile_walkers()
        return sample

    return Measurement(name, unit, prepare, warm_up=False, at_most=most)


@cache
def compile_walkers() -> None:
    """Compile what viewers need, without a limit of time: it may be the first run on this machine."""
    from tui.bench.walking_fleet import Walk, walkers

    Walk(walkers(20, 10, 5)).show(2, 1.0)


class Together(Generic[T]):
    """Several measurements of the same sessions, each of which takes half a minute.

    Of a session that cannot be measured nothing is, and no other one is tried for the next figure.
    """

    def __init__(self, take: Callable[[], T]) -> None:
        self._take = take
        self._taken: list[T] = []
        self._failed: NotMeasuredError | None = None

    def figure(
        self, name: str, unit: str, of: Callable[[T], float], most: int = LONG
    ) -> Measurement:
        """One of them."""
        numbers = itertools.count()

        def sample() -> float:
            number = next(numbers)
            if self._failed is not None:
                raise self._failed
            if number == len(self._taken):
                self._taken.append(self._once())
            return of(self._taken[number])

        return measured(name, unit, sample, most)

    def _once(self) -> T:
        try:
            return self._take()
        except NotMeasuredError as error:
            self._failed = error
            raise
