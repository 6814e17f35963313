"""A whole question answered: a search for each strategy, then what is asked of its answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from automaton.studies.sizing.candidates import Candidate, FleetConfig, Runner
from automaton.studies.sizing.fleet_search import Search
from automaton.studies.sizing.follow_up import (
    MarginalGain,
    RunBudget,
    SensitivityResult,
    StrategySelection,
    best_of,
    gain_of,
    sensitivity,
)
from automaton.studies.sizing.question import Question

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
