"""A whole question answered: a search for each strategy, then what is asked of its answer.

What one robot gains, which strategy is best, and how the answer moves if durations are 10 % off: all
within what is left of the budget.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from automaton.studies.inference.effects import Effect, effect
from automaton.studies.inference.intervals import STUDENT_MIN_RUNS
from automaton.studies.inference.selection import (
    FIRST_STAGE_RUNS,
    RUNS_PER_BATCH,
    batches,
    select_least,
)
from automaton.studies.sizing.fleet_search import (
    Candidate,
    FleetConfig,
    InfeasibleFleetError,
    Runner,
    Search,
)
from automaton.studies.sizing.question import DEFAULT_MEAN_INDIFFERENCE, Question

PERCENTS_OFF: Final = (-10, 10)  # percent
MOVES_LATE: Final = "world.extra_tick_probability"  # makes moves longer that take too few ticks
TRIAL_RUNS: Final = 100  # runs of each fleet under other durations
SELECTION_ROUND_RUNS: Final = 100  # runs of each strategy


class MarginalGain(NamedTuple):
    """What the last of so many robots does for the metric of the target."""

    robots: int
    effect: Effect | None  # with it against without it, over runs that finished
    refused: str = ""  # why one robot less cannot be run


class StrategySelection(NamedTuple):
    """Which of several strategies is best with so many robots."""

    robots: int
    strategies: tuple[str, ...]  # compared
    left: tuple[str, ...]  # one: it is the best; several: the budget did not tell them apart
    means: tuple[float, ...]
    runs: tuple[int, ...]  # of each; those that drop out get no more
    zone: float  # differences of means below this do not matter


@dataclass
class RunBudget:
    """The number of runs that may still be made."""

    run: Runner
    left: int
    spent: int = 0

    def extend_runs(self, candidate: Candidate, until: int, question: Question) -> bool:
        """Extend the runs of a candidate to this number.

        False if there is too little left, or it cannot be run, which it then says.
        """
        number = until - len(candidate.runs)
        if number <= 0:
            return True
        if number > self.left:
            return False
        try:
            runs = self.run(candidate.place, len(candidate.runs), number)
        except InfeasibleFleetError as error:
            candidate.refused = error.message
            return False
        candidate.add(runs, question)
        self.left, self.spent = self.left - number, self.spent + number
        return True


@dataclass
class SensitivityResult:
    """The fleets around the answer, under durations that are off."""

    percent: int
    around: list[Candidate] = field(default_factory=list)

    @property
    def fleets(self) -> list[Candidate]:
        """Those that can be run."""
        return [one for one in self.around if not one.refused]

    def smallest(self, question: Question) -> int | None:
        """The smallest of these fleets that seems to meet the target: by its share or mean so far."""
        return next((one.place.robots for one in self.fleets if seems_to_meet(one, question)), None)


def seems_to_meet(candidate: Candidate, question: Question) -> bool:
    """By the estimate alone, which is less sure than a verdict."""
    if not candidate.runs:
        return False
    if not question.mean:
        return candidate.met(question) >= question.success_share * len(candidate.runs)
    mean = candidate.mean(question.target.metric)
    return whole(candidate, question) and mean is not None and question.target.met(mean.value)


def whole(candidate: Candidate, question: Question) -> bool:
    """Whether all its runs finished and have the metric of the target."""
    return not candidate.censored and not candidate.unmeasured(question.target.metric)


def gain_of(
    candidates: Sequence[Candidate], robots: int, run_budget: RunBudget, question: Question
) -> MarginalGain:
    """What one robot gains: so many robots against one less; both get STUDENT_MIN_RUNS runs."""
    metric = question.target.metric
    by_robots = {one.place.robots: one for one in candidates}
    with_it = by_robots.get(robots)
    if with_it is None or robots < 2:
        return MarginalGain(robots, None)
    place = with_it.place._replace(robots=robots - 1)
    without = by_robots.get(robots - 1) or Candidate(place)
    if not all(
        run_budget.extend_runs(one, STUDENT_MIN_RUNS, question) for one in (with_it, without)
    ):
        return MarginalGain(robots, None, without.refused)
    pairs = [
        (float(a.figures[metric]), float(b.figures[metric]))
        for a, b in zip(with_it.runs, without.runs, strict=False)
        if a.finished and b.finished and metric in a.figures and metric in b.figures
    ]
    if len(pairs) < 2:
        return MarginalGain(robots, None)
    a, b = np.array(pairs).T
    return MarginalGain(robots, effect(a, b))


def best_of(
    candidates: Sequence[Candidate],
    run_budget: RunBudget,
    question: Question,
    zone: float | None = None,
) -> StrategySelection | None:
    """The strategy with the best mean, all with the same number of robots (Kim & Nelson).

    Strategies that drop out get no further runs. Those with runs that did not finish, or did not
    measure the metric, are left out. None if fewer than two are left.
    """
    zone = zone or (
        question.indifference
        if question.mean
        else DEFAULT_MEAN_INDIFFERENCE * abs(question.target.value)
    )
    sign = 1.0 if question.target.at_most else -1.0
    left, until = list(candidates), RUNS_PER_BATCH * FIRST_STAGE_RUNS
    while True:
        grown = [run_budget.extend_runs(one, until, question) for one in left]
        rivals = [one for one in candidates if one.runs and whole(one, question)]
        if len(rivals) < 2 or zone <= 0:
            return None
        values = [sign * np.array(one.values(question.target.metric)) for one in rivals]
        if min(map(len, values)) < RUNS_PER_BATCH * FIRST_STAGE_RUNS:
            return None
        selected = select_least([batches(one) for one in values], zone, question.alpha)
        left = [rivals[index] for index in selected.left]
        if len(left) == 1 or not all(grown):
            return StrategySelection(
                robots=rivals[0].place.robots,
                strategies=tuple(one.place.strategy for one in rivals),
                left=tuple(one.place.strategy for one in left),
                means=tuple(sign * float(one.mean()) for one in values),
                runs=tuple(map(len, values)),
                zone=zone,
            )
        until = RUNS_PER_BATCH * selected.batches + SELECTION_ROUND_RUNS


def around(answer: FleetConfig, question: Question) -> list[int]:
    """The fleets from one robot less to one more, up to the largest that was asked for."""
    return [n for n in range(answer.robots - 1, answer.robots + 2) if 1 <= n <= question.last]


def sensitivity(
    answer: FleetConfig, run_budget: RunBudget, question: Question, percents: Sequence[int]
) -> Iterator[SensitivityResult]:
    """The fleets from one robot less to one more, with durations so many percent longer."""
    for percent in percents:
        places = [answer._replace(robots=n, percent=percent) for n in around(answer, question)]
        moved = SensitivityResult(percent, [Candidate(place) for place in places])
        for one in moved.around:
            if not run_budget.extend_runs(one, TRIAL_RUNS, question) and not one.refused:
                return
        yield moved


LARGEST_FLEET_RUNS: Final = 60  # runs of the largest fleet, for what it loses time with


@dataclass
class SizingSession:
    """A question and what is known of it; whole at any moment, also after Ctrl-C."""

    question: Question
    run: Runner
    excluded: Mapping[int, str] = field(default_factory=dict)
    changes: Mapping[int, Sequence[str]] = field(default_factory=dict)  # percent: settings
    searches: list[Search] = field(default_factory=list)
    gains: dict[str, MarginalGain] = field(default_factory=dict)  # by strategy
    best: StrategySelection | None = None
    moved: list[SensitivityResult] = field(default_factory=list)
    budget_left: RunBudget | None = None  # for what follows the searches
    complete: bool = False  # nothing was cut off
    same_orders: bool = False  # in all runs: those of a list or a file

    def go(self) -> None:
        """Search, then follow up."""
        question, left = self.question, self.question.budget
        for number, strategy in enumerate(question.strategies):
            share = left // (len(question.strategies) - number)
            search = Search(question, strategy, self.run, share, self.excluded)
            self.searches.append(search)
            search.go()
            left -= search.spent
        self._follow_up(RunBudget(self.run, left))
        self.complete = True

    def _follow_up(self, run_budget: RunBudget) -> None:
        question, self.budget_left = self.question, run_budget
        for search in self.searches:
            last = search.answer.robots or self._largest(search)
            if search.answer.robots is None:
                self._show(search, run_budget)
            if last is not None:
                self.gains[search.strategy] = gain_of(search.candidates, last, run_budget, question)
        place = self.place  # these runs may have decided a fleet that the search had left undecided
        if place is None:
            return
        if len(question.strategies) > 1:
            self.best = best_of(self._rivals(place.robots), run_budget, question)
        for moved in sensitivity(self.place or place, run_budget, question, list(self.changes)):
            self.moved.append(moved)

    def _show(self, search: Search, run_budget: RunBudget) -> None:
        """Runs of the largest fleet, so that one sees what keeps it from the target."""
        candidate = search.candidates[-1] if search.candidates else None
        if candidate is not None:
            run_budget.extend_runs(candidate, LARGEST_FLEET_RUNS, self.question)

    def _largest(self, search: Search) -> int | None:
        return search.candidates[-1].place.robots if search.candidates else None

    def _rivals(self, robots: int) -> list[Candidate]:
        """The strategies with so many robots, but for those known to fail."""
        found = [search.find(robots) for search in self.searches]
        return [one for one in found if one is not None and one.verdict == "meets"]

    @property
    def after(self) -> int:
        """Runs made after the searches."""
        return 0 if self.budget_left is None else self.budget_left.spent

    @property
    def spent(self) -> int:
        """Runs made."""
        return self.after + sum(search.spent for search in self.searches)

    @property
    def place(self) -> FleetConfig | None:
        """The smallest fleet that meets the target with any strategy; of equals the best one."""
        known = [
            FleetConfig(search.answer.robots, search.strategy)
            for search in self.searches
            if search.answer.kind == "answered" and search.answer.robots is not None
        ]
        least = min((place.robots for place in known), default=None)
        smallest = [place for place in known if place.robots == least]
        if self.best is not None and len(self.best.left) == 1:
            smallest = [one for one in smallest if one.strategy == self.best.left[0]] or smallest
        return smallest[0] if smallest else None

    @property
    def settled(self) -> bool:
        """Whether `place` is the smallest fleet for sure: no strategy may yet do with less."""
        place = self.place
        if place is None or len(self.searches) < len(self.question.strategies):
            return False
        unsure = [search.answer.least for search in self.searches]
        return all(least is None or least >= place.robots for least in unsure)
