"""What is asked once the search is over: what one robot gains, which strategy is best, and how the
answer moves if durations are 10 % off.

All within what is left of the budget.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from automaton.sizing.candidates import Candidate, NotRunnable, Place, Runner
from automaton.sizing.question import MEAN_ZONE, Question
from automaton.statistics.effects import Effect, effect
from automaton.statistics.intervals import ENOUGH
from automaton.statistics.selection import BATCH, FIRST, batches, select_least

OFF: Final = (-10, 10)  # percent
MOVES_LATE: Final = "world.extra_tick_probability"  # makes moves longer that take too few ticks
TRIAL: Final = 100  # runs of each fleet under other durations
SELECTION_ROUND: Final = 100  # runs of each strategy


class Gain(NamedTuple):
    """What the last of so many robots does for the metric of the target."""

    robots: int
    effect: Effect | None  # with it against without it, over runs that finished
    refused: str = ""  # why one robot less cannot be run


class Best(NamedTuple):
    """Which of several strategies is best with so many robots."""

    robots: int
    strategies: tuple[str, ...]  # compared
    left: tuple[str, ...]  # one: it is the best; several: the budget did not tell them apart
    means: tuple[float, ...]
    runs: tuple[int, ...]  # of each; those that drop out get no more
    zone: float  # differences of means below this do not matter


@dataclass
class Purse:
    """Runs that may still be made."""

    run: Runner
    left: int
    spent: int = 0

    def grown(self, candidate: Candidate, until: int, asked: Question) -> bool:
        """Give a candidate runs until it has so many.

        False if there is too little left, or it cannot be run, which it then says.
        """
        number = until - len(candidate.runs)
        if number <= 0:
            return True
        if number > self.left:
            return False
        try:
            runs = self.run(candidate.place, len(candidate.runs), number)
        except NotRunnable as error:
            candidate.refused = error.message
            return False
        candidate.add(runs, asked)
        self.left, self.spent = self.left - number, self.spent + number
        return True


@dataclass
class Moved:
    """The fleets around the answer, under durations that are off."""

    percent: int
    around: list[Candidate] = field(default_factory=list)

    @property
    def fleets(self) -> list[Candidate]:
        """Those that can be run."""
        return [one for one in self.around if not one.refused]

    def smallest(self, asked: Question) -> int | None:
        """The smallest of these fleets that seems to meet the target: by its share or mean so far."""
        return next((one.place.robots for one in self.fleets if seems_to_meet(one, asked)), None)


def seems_to_meet(candidate: Candidate, asked: Question) -> bool:
    """By the estimate alone, which is less sure than a verdict."""
    if not candidate.runs:
        return False
    if not asked.mean:
        return candidate.met(asked) >= asked.success_share * len(candidate.runs)
    mean = candidate.mean(asked.target.metric)
    return whole(candidate, asked) and mean is not None and asked.target.met(mean.value)


def whole(candidate: Candidate, asked: Question) -> bool:
    """Whether all its runs finished and have the metric of the target."""
    return not candidate.censored and not candidate.unmeasured(asked.target.metric)


def gain_of(candidates: Sequence[Candidate], robots: int, purse: Purse, asked: Question) -> Gain:
    """What one robot gains: so many robots against one less; both get ENOUGH runs."""
    metric = asked.target.metric
    by_robots = {one.place.robots: one for one in candidates}
    with_it = by_robots.get(robots)
    if with_it is None or robots < 2:
        return Gain(robots, None)
    place = with_it.place._replace(robots=robots - 1)
    without = by_robots.get(robots - 1) or Candidate(place)
    if not all(purse.grown(one, ENOUGH, asked) for one in (with_it, without)):
        return Gain(robots, None, without.refused)
    pairs = [
        (float(a.figures[metric]), float(b.figures[metric]))
        for a, b in zip(with_it.runs, without.runs, strict=False)
        if a.finished and b.finished and metric in a.figures and metric in b.figures
    ]
    if len(pairs) < 2:
        return Gain(robots, None)
    a, b = np.array(pairs).T
    return Gain(robots, effect(a, b))


def best_of(
    candidates: Sequence[Candidate], purse: Purse, asked: Question, zone: float | None = None
) -> Best | None:
    """The strategy with the best mean, all with the same number of robots (Kim & Nelson).

    Strategies that drop out get no further runs. Those with runs that did not finish, or did not
    measure the metric, are left out. None if fewer than two are left.
    """
    zone = zone or (asked.indifference if asked.mean else MEAN_ZONE * abs(asked.target.value))
    sign = 1.0 if asked.target.at_most else -1.0
    left, until = list(candidates), BATCH * FIRST
    while True:
        grown = [purse.grown(one, until, asked) for one in left]
        rivals = [one for one in candidates if one.runs and whole(one, asked)]
        if len(rivals) < 2 or zone <= 0:
            return None
        values = [sign * np.array(one.values(asked.target.metric)) for one in rivals]
        if min(map(len, values)) < BATCH * FIRST:
            return None
        selected = select_least([batches(one) for one in values], zone, asked.alpha)
        left = [rivals[index] for index in selected.left]
        if len(left) == 1 or not all(grown):
            return Best(
                robots=rivals[0].place.robots,
                strategies=tuple(one.place.strategy for one in rivals),
                left=tuple(one.place.strategy for one in left),
                means=tuple(sign * float(one.mean()) for one in values),
                runs=tuple(map(len, values)),
                zone=zone,
            )
        until = BATCH * selected.batches + SELECTION_ROUND


def around(answer: Place, asked: Question) -> list[int]:
    """The fleets from one robot less to one more, up to the largest that was asked for."""
    return [n for n in range(answer.robots - 1, answer.robots + 2) if 1 <= n <= asked.last]


def sensitivity(
    answer: Place, purse: Purse, asked: Question, percents: Sequence[int]
) -> Iterator[Moved]:
    """The fleets from one robot less to one more, with durations so many percent longer."""
    for percent in percents:
        places = [answer._replace(robots=n, percent=percent) for n in around(answer, asked)]
        moved = Moved(percent, [Candidate(place) for place in places])
        for one in moved.around:
            if not purse.grown(one, TRIAL, asked) and not one.refused:
                return
        yield moved
