"""The choice of a design by successive halving, and the verdict on it by fresh seeds.

Three kinds of seeds: the search, the choice and the verdict each have their own, so that neither search
nor choice biases the gain that the verdict reports.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from automaton.studies.inference.intervals import Effect, effect
from automaton.studies.street_search.designs import Row, StreetDesign, StreetRuns
from automaton.studies.street_search.evolution import NamedDesign, SearchQuestion

SELECT_RUNS: Final = 8  # of each finalist in the first round; twice as many in each further one
HELD_OUT_PAIRS: Final = 100
FLEET_SHARES: Final = (0.5, 0.75, 1.0, 1.25)  # of the robots, for the verdict
SIDE_METRICS: Final = ("lead_time_p95", "oldest_order", "detour_share")  # the lowest is best
MUCH_WORSE: Final = 0.10  # by more than this share a side metric gives a warning


class ChosenDesign(NamedTuple):
    """The best finalist."""

    place: int  # among the finalists
    runs: int  # of the choice
    rounds: int


def choose(
    question: SearchQuestion, finalists: Sequence[NamedDesign], runs: StreetRuns
) -> ChosenDesign:
    """The finalist with the best mean: the better half of each round gets twice as many runs."""
    left, runs_done, rounds = list(range(len(finalists))), 0, 0
    number = question.scaled(SELECT_RUNS)
    while len(left) > 1:
        seeds = question.seeds("select", number)
        designs = [finalists[one].design for one in left]
        scores = [0.0] * len(left)
        for robots in question.robots:
            means = [mean_value(question, rows) for rows in runs(designs, seeds, robots)]
            usual = max((abs(one) for one in means if math.isfinite(one)), default=0.0) or 1.0
            scores = [score + mean / usual for score, mean in zip(scores, means, strict=True)]
        runs_done += len(question.robots) * len(left) * (number if not rounds else number // 2)
        ranked = sorted(range(len(left)), key=lambda one: -scores[one])
        left = [left[one] for one in ranked[: math.ceil(len(left) / 2)]]
        number, rounds = 2 * number, rounds + 1
    return ChosenDesign(left[0], runs_done, rounds)


def choice_runs(question: SearchQuestion, finalists: int) -> int:
    """The runs of a choice with one fleet."""
    left, number, runs_done = finalists, question.scaled(SELECT_RUNS), 0
    while left > 1:
        runs_done += left * (number if not runs_done else number // 2)
        left, number = math.ceil(left / 2), 2 * number
    return runs_done


def mean_value(question: SearchQuestion, rows: Sequence[Row]) -> float:
    """The mean value of some runs; -inf if one of them did not finish."""
    return sum(question.value(row) for row in rows) / len(rows)


class FleetVerdict(NamedTuple):
    """A design against the scenario as it is, with one number of robots."""

    robots: int
    is_asked: bool  # whether the design was searched for this fleet
    pairs: int  # with two runs that finished
    gain: Effect | None  # of the metric; None: too few pairs
    means: tuple[float, float]  # of the metric: as it is, with the design
    beside: dict[str, Effect]  # SIDE_METRICS
    unfinished: tuple[int, int]  # runs without the metric: as it is, with the design

    def is_gain(self, is_higher_better: bool) -> bool:
        """Whether the interval shows that the design is better."""
        if self.gain is None or self.unfinished[1] > self.unfinished[0]:
            return False
        low, high = self.gain.difference.low, self.gain.difference.high
        if is_higher_better:
            return low is not None and low > 0
        return high is not None and high < 0

    @property
    def warnings(self) -> list[str]:
        """A phrase for each side metric that is worse by more than MUCH_WORSE."""
        phrases = []
        for name, one in self.beside.items():
            change = one.difference if name == "detour_share" else one.relative
            if change is not None and change.value > MUCH_WORSE:
                unit = "percentage points" if name == "detour_share" else "%"
                phrases.append(f"{name} {100 * change.value:+.0f} {unit}")
        return phrases


def fleets_of(asked: Sequence[int]) -> list[int]:
    """The fleets of the verdict: those asked for, and shares of the largest."""
    return sorted({*asked, *(max(2, round(share * max(asked))) for share in FLEET_SHARES)})


def judge(
    question: SearchQuestion,
    as_it_is: StreetDesign,
    design: StreetDesign,
    runs: StreetRuns,
    robots: int,
    is_own: bool,
) -> FleetVerdict:
    """The verdict for a fleet. `is_own`: it is that of the scenario, whose size is not set."""
    seeds = question.seeds("held out", question.scaled(HELD_OUT_PAIRS))
    before, after = runs([as_it_is, design], seeds, None if is_own else robots)
    ended = [[math.isfinite(question.value(row)) for row in rows] for rows in (before, after)]
    pairs = [pair for pair, *both in zip(zip(before, after, strict=True), *ended, strict=True)
             if all(both)]  # fmt: skip
    gain = compared(pairs, question.metric)
    beside = {name: compared(pairs, name) for name in SIDE_METRICS}
    values = [[row[question.metric] for row in rows] for rows in zip(*pairs, strict=True)]
    means = tuple(sum(one) / len(one) for one in values) if pairs else (math.nan, math.nan)
    return FleetVerdict(
        robots=robots,
        is_asked=robots in question.robots or (is_own and None in question.robots),
        pairs=len(pairs),
        gain=gain,
        means=(means[0], means[1]),
        beside={name: one for name, one in beside.items() if one is not None},
        unfinished=(ended[0].count(False), ended[1].count(False)),
    )


def compared(pairs: Sequence[tuple[Row, Row]], metric: str) -> Effect | None:
    """The paired effect of the second of two runs; None if fewer than two pairs have the metric."""
    both = [
        (after[metric], before[metric])
        for before, after in pairs
        if before.get(metric) is not None and after.get(metric) is not None
    ]
    if len(both) < 2:
        return None
    return effect([one for one, _ in both], [other for _, other in both], paired=True)
