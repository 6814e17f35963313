"""Fleets that may be an answer: their runs so far, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from typing import NamedTuple

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
        return mean_interval(values) if values else None


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
