"""A whole question answered: a search for each strategy, then what is asked of its answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from automaton.sizing.candidates import Candidate, Place, Runner
from automaton.sizing.follow_up import Best, Gain, Moved, Purse, best_of, gain_of, sensitivity
from automaton.sizing.question import Question
from automaton.sizing.search import Search

SHOWN: Final = 60  # runs of the largest fleet, for what it loses time with


@dataclass
class Session:
    """A question and what is known of it; whole at any moment, also after Ctrl-C."""

    asked: Question
    run: Runner
    excluded: Mapping[int, str] = field(default_factory=dict)
    changes: Mapping[int, Sequence[str]] = field(default_factory=dict)  # percent: settings
    searches: list[Search] = field(default_factory=list)
    gains: dict[str, Gain] = field(default_factory=dict)  # by strategy
    best: Best | None = None
    moved: list[Moved] = field(default_factory=list)
    purse: Purse | None = None  # for what follows the searches
    complete: bool = False  # nothing was cut off
    same_orders: bool = False  # in all runs: those of a list or a file

    def go(self) -> None:
        """Search, then follow up."""
        asked, left = self.asked, self.asked.budget
        for number, strategy in enumerate(asked.strategies):
            share = left // (len(asked.strategies) - number)
            search = Search(asked, strategy, self.run, share, self.excluded)
            self.searches.append(search)
            search.go()
            left -= search.spent
        self._follow_up(Purse(self.run, left))
        self.complete = True

    def _follow_up(self, purse: Purse) -> None:
        asked, self.purse = self.asked, purse
        for search in self.searches:
            last = search.answer.robots or self._largest(search)
            if search.answer.robots is None:
                self._show(search, purse)
            if last is not None:
                self.gains[search.strategy] = gain_of(search.candidates, last, purse, asked)
        place = self.place  # these runs may have decided a fleet that the search had left undecided
        if place is None:
            return
        if len(asked.strategies) > 1:
            self.best = best_of(self._rivals(place.robots), purse, asked)
        for moved in sensitivity(self.place or place, purse, asked, list(self.changes)):
            self.moved.append(moved)

    def _show(self, search: Search, purse: Purse) -> None:
        """Runs of the largest fleet, so that one sees what keeps it from the target."""
        candidate = search.candidates[-1] if search.candidates else None
        if candidate is not None:
            purse.grown(candidate, SHOWN, self.asked)

    def _largest(self, search: Search) -> int | None:
        return search.candidates[-1].place.robots if search.candidates else None

    def _rivals(self, robots: int) -> list[Candidate]:
        """The strategies with so many robots, but for those known to fail."""
        found = [search.find(robots) for search in self.searches]
        return [one for one in found if one is not None and one.verdict == "meets"]

    @property
    def after(self) -> int:
        """Runs made after the searches."""
        return 0 if self.purse is None else self.purse.spent

    @property
    def spent(self) -> int:
        """Runs made."""
        return self.after + sum(search.spent for search in self.searches)

    @property
    def place(self) -> Place | None:
        """The smallest fleet that meets the target with any strategy; of equals the best one."""
        known = [
            Place(search.answer.robots, search.strategy)
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
        if place is None or len(self.searches) < len(self.asked.strategies):
            return False
        unsure = [search.answer.least for search in self.searches]
        return all(least is None or least >= place.robots for least in unsure)
