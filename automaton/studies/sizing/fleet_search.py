"""The search for the smallest fleet: every candidate is tested, none is inferred from another.

More robots do not always do better (finishing times rise and fall with their number), so there is
no bisection: candidates are tested from the smallest on, until one passes. One that takes too long
is put off, and gets what is left of the budget when a larger one has passed, or none is left.

With K candidates and the error e / K of each, all verdicts are right together with probability
1 - e, wherever the search stops.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Final, Literal, NamedTuple

import numpy as np

from automaton.errors import InputError
from automaton.studies.inference.intervals import Interval, mean_interval
from automaton.studies.inference.proportions import Verdict, confidence_sequence
from automaton.studies.inference.selection import RUNS_PER_BATCH, batches, feasible
from automaton.studies.sizing.question import Question


class FleetConfig(NamedTuple):
    """What is run."""

    robots: int
    strategy: str = ""  # a setting; "": the scenario's own
    percent: int = 0  # by how much durations are longer


class Run(NamedTuple):
    """What is kept of a run."""

    finished: bool
    figures: dict[str, float | int]


# place, first replication, number of runs
Runner = Callable[[FleetConfig, int, int], Sequence[Run]]


class InfeasibleFleetError(InputError):
    """The scenario does not allow a place, such as another number of robots than starts."""


@dataclass
class Candidate:
    """One fleet with one strategy."""

    place: FleetConfig
    runs: list[Run] = field(default_factory=list)
    verdict: Verdict = "undecided"
    after: int = 0  # runs when the verdict fell
    excluded: str = ""  # the bound that it cannot meet; no run was needed
    refused: str = ""  # why it cannot be run

    def add(self, runs: Sequence[Run], question: Question) -> None:
        """Take further runs, and judge unless that is done."""
        self.runs += runs
        if self.verdict == "undecided":
            self.verdict, self.after = judged(self.runs, question)

    def values(self, metric: str) -> list[float]:
        """A metric of the runs that finished and have it."""
        return [
            float(run.figures[metric])
            for run in self.runs
            if run.finished and metric in run.figures
        ]

    def unmeasured(self, metric: str) -> int:
        """Runs that finished without anything to measure it by, such as a delivered order."""
        return sum(run.finished and metric not in run.figures for run in self.runs)

    @property
    def censored(self) -> int:
        """Runs that did not finish."""
        return sum(not run.finished for run in self.runs)

    def met(self, question: Question) -> int:
        """Runs that meet the target."""
        return sum(meets(run, question) for run in self.runs)

    def share(self, question: Question) -> Interval:
        """The share of runs that meet the target; holds although the search decided when to stop."""
        return confidence_sequence(self.met(question), len(self.runs), 1 - question.alpha)

    def mean(self, metric: str) -> Interval | None:
        """The mean of a metric over the runs that finished, or None."""
        values = self.values(metric)
        return mean_interval(values).not_below_zero() if values else None


def meets(run: Run, question: Question) -> bool:
    """Whether a run meets the target; one that did not finish, or did not measure it, does not."""
    metric = question.target.metric
    return (
        run.finished and metric in run.figures and question.target.met(float(run.figures[metric]))
    )


def judged(runs: Sequence[Run], question: Question) -> tuple[Verdict, int]:
    """The verdict on a candidate from its runs in their order, and after how many it fell."""
    if not question.mean:
        return question.share_test.verdict(meets(run, question) for run in runs)
    metric = question.target.metric
    known = list(takewhile(lambda run: run.finished and metric in run.figures, runs))
    sign = 1.0 if question.target.at_most else -1.0
    values = np.array([float(run.figures[metric]) for run in known]) * sign
    verdict, after = feasible(batches(values), sign * question.target.value, question.region)
    if verdict != "undecided":
        return verdict, RUNS_PER_BATCH * after
    if len(known) < len(runs):
        return "fails", len(known) + 1  # the mean of all runs is not known
    return verdict, len(runs)


def lost_by_cause(candidate: Candidate) -> dict[str, float]:
    """Mean ticks of a run that robots lose, by cause, without those of nothing; runs censored too."""
    names = [
        name for name in _names(candidate) if name.startswith("lost_") or name == "slowdown_ticks"
    ]
    means = {name: mean_of(candidate, name) for name in names}
    return {name: value for name, value in means.items() if value > 0}


def mean_of(candidate: Candidate, name: str) -> float:
    """The mean of a metric over all runs, those that did not finish included; NaN without any."""
    values = [float(run.figures[name]) for run in candidate.runs if name in run.figures]
    return math.fsum(values) / len(values) if values else math.nan


def _names(candidate: Candidate) -> list[str]:
    return list(dict.fromkeys(name for run in candidate.runs for name in run.figures))


Kind = Literal["answered", "undecided", "not reachable"]

RUNS_PER_ROUND: Final = ((100, 100), (10, 25), (0, 10))  # from so many runs on, so many in a round
MAX_POSTPONED: Final = 2  # a candidate is put off when it has had this part of the budget: a half


class Answer(NamedTuple):
    """What is known of one strategy."""

    kind: Kind
    robots: int | None  # the smallest fleet that passes, as far as known
    least: int | None  # the smallest fleet that is not decided; None: all below `robots` fail


@dataclass
class Search:
    """The search with one strategy; `spent` and `candidates` are of any moment, also after Ctrl-C."""

    question: Question
    strategy: str
    run: Runner
    budget: int
    # Robots: the bound that excludes them.
    excluded: Mapping[int, str] = field(default_factory=dict)
    spent: int = 0
    candidates: list[Candidate] = field(default_factory=list)

    def go(self) -> None:
        """Test candidates until the answer is known or the budget is spent."""
        question = self.question
        for robots in range(question.first, question.last + 1):
            if self.spent >= self.budget:
                break
            candidate = Candidate(FleetConfig(robots, self.strategy))
            self.candidates.append(candidate)
            if robots in self.excluded:
                candidate.excluded, candidate.verdict = self.excluded[robots], "fails"
                continue
            left = self.budget - self.spent
            self.test(candidate, max(question.fewest, left // MAX_POSTPONED))
            if candidate.verdict == "meets":
                break
        for candidate in self.candidates:
            if candidate.verdict == "undecided":
                self.test(candidate, self.budget)

    def test(self, candidate: Candidate, most: int) -> None:
        """Run a candidate until it is decided, has so many more runs, or the budget is spent."""
        until = self.spent + most
        while candidate.verdict == "undecided":
            room = min(until, self.budget) - self.spent
            if room <= 0:
                return
            self.grow(candidate, min(room, round_of(candidate, self.question)))

    def grow(self, candidate: Candidate, number: int) -> None:
        """So many further runs of a candidate."""
        runs = self.run(candidate.place, len(candidate.runs), number)
        self.spent += number
        candidate.add(runs, self.question)

    @property
    def answer(self) -> Answer:
        """What follows from the verdicts so far."""
        verdicts = {one.place.robots: one.verdict for one in self.candidates}
        passing = next((n for n, verdict in verdicts.items() if verdict == "meets"), None)
        beyond = self.question.last + 1 if passing is None else passing
        unsure = [
            robots
            for robots in range(self.question.first, beyond)
            if verdicts.get(robots, "undecided") == "undecided"
        ]
        if unsure:
            return Answer("undecided", passing, unsure[0])
        return Answer("not reachable" if passing is None else "answered", passing, None)

    def find(self, robots: int) -> Candidate | None:
        """The candidate with so many robots, if it was looked at."""
        return next((one for one in self.candidates if one.place.robots == robots), None)


def round_of(candidate: Candidate, question: Question) -> int:
    """Runs of the next round: it depends on the candidate alone, never on time or cores."""
    have = len(candidate.runs)
    if question.mean and have < question.fewest:
        return question.fewest - have
    return next(size for since, size in RUNS_PER_ROUND if have >= since)
