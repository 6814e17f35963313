"""The search for the smallest fleet: every candidate is tested, none is inferred from another.

More robots do not always do better (finishing times rise and fall with their number), so there is
no bisection: candidates are tested from the smallest on, until one passes. One that takes too long
is put off, and gets what is left of the budget when a larger one has passed, or none is left.

With K candidates and the error e / K of each, all verdicts are right together with probability
1 - e, wherever the search stops.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

from automaton.studies.sizing.candidates import Candidate, FleetConfig, Runner
from automaton.studies.sizing.question import Question

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
    excluded: Mapping[int, str] = field(
        default_factory=dict
    )  # robots: the bound that excludes them
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
