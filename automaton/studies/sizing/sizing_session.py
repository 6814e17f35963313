"""A sizing session: a search for each strategy, then follow-up analyses of the answer.

The follow-ups use the rest of the budget: the gain of the last robot, the best strategy, the
sensitivity of the answer to durations that are 10 % off, and what it reaches on a share of days.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from automaton.errors import InputError, alternatives
from automaton.strategy import lookup
from automaton.studies.inference.intervals import STUDENT_MIN_RUNS, Effect, effect
from automaton.studies.inference.proportions import (
    FIRST_STAGE_RUNS,
    RUNS_PER_BATCH,
    batches,
    bound_rank,
    fixed_runs,
    select_least,
)
from automaton.studies.sizing.fleet_runs import Checked, Fleets
from automaton.studies.sizing.fleet_search import (
    DEFAULT_MEAN_INDIFFERENCE,
    PARKING,
    Candidate,
    FleetConfig,
    FleetRun,
    FleetSearch,
    InfeasibleFleetError,
    Question,
    Runner,
    mean_of,
)

TRIAL_RUNS: Final = 100  # runs of each fleet under changed durations
SELECTION_ROUND_RUNS: Final = 100  # runs of each strategy
LARGEST_FLEET_RUNS: Final = 60  # runs of the largest fleet, to show its lost time
PARKING_ZONE: Final = 0.01  # of the mean: a smaller gain by parking does not matter
BOUND_DAYS: Final = 300  # runs of the answer's fleet, for the bound that most days reach
BOUND_ERROR: Final = 0.01  # of this bound


class MarginalGain(NamedTuple):
    """The effect of the last robot on the metric of the target."""

    size: int
    effect: Effect | None  # fleet with the last robot against fleet without it, over finished runs
    refused: str = ""  # why the smaller fleet cannot be run


class DayBound(NamedTuple):
    """What a fleet reaches on a share of days: the k-th worst of a fixed number of them.

    The days follow those that decided about the fleet, so choosing it does not bias the bound.
    """

    days: int
    rank: int  # k
    value: float | None  # the metric on the k-th worst day; None: not finished or measured
    worst: int  # the replication that was worst
    worst_value: float | None
    error: float = BOUND_ERROR


class StrategySelection(NamedTuple):
    """The best of several strategies for a fleet size."""

    size: int
    strategies: tuple[str, ...]  # the compared strategies
    left: tuple[str, ...]  # the best one, or several if the budget was too small to separate them
    means: tuple[float, ...]
    runs: tuple[int, ...]  # of each strategy; eliminated ones get no more
    zone: float  # indifference zone: smaller differences of means do not matter


@dataclass
class RunBudget:
    """The rest of a budget of runs."""

    run: Runner
    left: int
    spent: int = 0

    def extend_runs(self, candidate: Candidate, until: int, question: Question) -> bool:
        """Extend the runs of a candidate to the number `until`.

        Returns False if the rest of the budget is too small, or if the candidate cannot be run; the
        reason is then in `candidate.refused`.
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
    """The fleets around the answer, under changed durations."""

    percent: int
    around: list[Candidate] = field(default_factory=list)

    @property
    def fleets(self) -> list[Candidate]:
        """The fleets that can be run."""
        return [one for one in self.around if not one.refused]

    def smallest(self, question: Question) -> int | None:
        """The smallest of these fleets whose estimate meets the target; None without any."""
        return next((one.place.size for one in self.fleets if seems_to_meet(one, question)), None)


def seems_to_meet(candidate: Candidate, question: Question) -> bool:
    """Whether the estimate of a candidate meets the target, which is less certain than a verdict."""
    if not candidate.runs:
        return False
    if not question.mean:
        return candidate.met(question) >= question.success_share * len(candidate.runs)
    mean = candidate.mean(question.target.metric)
    return whole(candidate, question) and mean is not None and question.target.met(mean.value)


def whole(candidate: Candidate, question: Question) -> bool:
    """Whether all runs of a candidate finished and have the metric of the target."""
    return not candidate.censored and not candidate.unmeasured(question.target.metric)


def gain_of(
    candidates: Sequence[Candidate], size: int, run_budget: RunBudget, question: Question
) -> MarginalGain:
    """The gain of the last step of size: compare both fleets with STUDENT_MIN_RUNS runs each."""
    metric, smaller = question.target.metric, size - question.step
    by_size = {one.place.size: one for one in candidates}
    with_it = by_size.get(size)
    if with_it is None or smaller < 1:
        return MarginalGain(size, None)
    without = by_size.get(smaller) or Candidate(with_it.place._replace(size=smaller))
    if not all(
        run_budget.extend_runs(one, STUDENT_MIN_RUNS, question) for one in (with_it, without)
    ):
        return MarginalGain(size, None, without.refused)
    return MarginalGain(size, paired_effect(with_it.runs, without.runs, metric))


def paired_effect(runs: Sequence[FleetRun], base: Sequence[FleetRun], metric: str) -> Effect | None:
    """The effect on a metric over pairs of finished runs with the same seed; None without two pairs."""
    pairs = [
        (float(a.figures[metric]), float(b.figures[metric]))
        for a, b in zip(runs, base, strict=False)
        if a.finished and b.finished and metric in a.figures and metric in b.figures
    ]
    if len(pairs) < 2:
        return None
    return effect([a for a, _ in pairs], [b for _, b in pairs], paired=True)


def best_of(
    candidates: Sequence[Candidate],
    run_budget: RunBudget,
    question: Question,
    zone: float | None = None,
) -> StrategySelection | None:
    """Select the strategy with the best mean for one fleet size (Kim & Nelson).

    Eliminated strategies get no further runs. Strategies with runs that did not finish or did not
    measure the metric are excluded. None if fewer than two are left.
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
                size=rivals[0].place.size,
                strategies=tuple(one.place.strategy for one in rivals),
                left=tuple(one.place.strategy for one in left),
                means=tuple(sign * float(one.mean()) for one in values),
                runs=tuple(map(len, values)),
                zone=zone,
            )
        until = RUNS_PER_BATCH * selected.batches + SELECTION_ROUND_RUNS


def day_bound(candidate: Candidate, run_budget: RunBudget, question: Question) -> DayBound | None:
    """What a candidate reaches on a share of days; None if too little of the budget is left."""
    since = candidate.after
    days = min(max(BOUND_DAYS, bound_days(question)), len(candidate.runs) - since + run_budget.left)
    if days < bound_days(question) or not run_budget.extend_runs(candidate, since + days, question):
        return None
    target = question.target
    lacking = math.inf if target.at_most else -math.inf  # as bad as can be
    values = [
        float(run.figures[target.metric])
        if run.finished and target.metric in run.figures
        else lacking
        for run in candidate.runs[since : since + days]
    ]
    order = sorted(range(days), key=lambda day: -values[day] if target.at_most else values[day])
    rank = bound_rank(days, question.success_share, BOUND_ERROR)
    value, worst = values[order[rank - 1]], values[order[0]]
    return DayBound(
        days,
        rank,
        value if math.isfinite(value) else None,
        since + order[0],
        worst if math.isfinite(worst) else None,
    )


def bound_days(question: Question) -> int:
    """The least number of days that have a bound."""
    return fixed_runs(question.success_share, BOUND_ERROR)


def around(answer: FleetConfig, question: Question) -> list[int]:
    """Sizes from one step less to one more, up to the largest size of the question."""
    near = (answer.size + by * question.step for by in (-1, 0, 1))
    return [size for size in near if 1 <= size <= question.last]


def sensitivity(
    answer: FleetConfig, run_budget: RunBudget, question: Question, percents: Sequence[int]
) -> Iterator[SensitivityResult]:
    """Run the fleets from one step less to one more with durations changed by some percents."""
    for percent in percents:
        places = [answer._replace(size=n, percent=percent) for n in around(answer, question)]
        moved = SensitivityResult(percent, [Candidate(place) for place in places])
        for one in moved.around:
            if not run_budget.extend_runs(one, TRIAL_RUNS, question) and not one.refused:
                return
        yield moved


@dataclass
class ParkingSession:
    """Would the fleet do better if only some of its robots had orders and the others were parked?

    Kim & Nelson's procedure selects among the fleet as it is and each limit. Fresh pairs of runs then
    compare the selected limit with the fleet as it is, and with a fleet that has no other robots.
    """

    question: Question  # its target gives metric and direction, its sizes the limits
    robots: int
    run: Runner
    best: StrategySelection | None = None
    gain: Effect | None = None  # of the best limit against the fleet as it is
    alone: Effect | None = None  # of a fleet with so few robots against the fleet as it is
    refused: str = ""  # why that fleet cannot be run
    spent: int = 0

    def go(self) -> None:
        """Select a limit, then compare it on fresh runs."""
        question, run_budget = self.question, RunBudget(self.run, self.question.budget)
        limits = (f"{PARKING}={size}" for size in question.sizes if size < self.robots)
        fleets = [Candidate(FleetConfig(self.robots, setting)) for setting in ("", *limits)]
        run_budget.extend_runs(fleets[0], RUNS_PER_BATCH * FIRST_STAGE_RUNS, question)
        metric = question.target.metric
        zone = PARKING_ZONE * abs(mean_of(fleets[0], metric))
        if zone > 0:
            self.best = best_of(fleets, run_budget, question, zone)
        self.spent = run_budget.spent
        if self.limit is None or self.best is None:
            return
        first = max(self.best.runs)
        as_it_is = self._fresh(fleets[0].place, first)
        limited = FleetConfig(self.robots, self.best.left[0])
        self.gain = paired_effect(self._fresh(limited, first), as_it_is, metric)
        try:
            few = self._fresh(FleetConfig(self.limit), first)
            self.alone = paired_effect(few, as_it_is, metric)
        except InfeasibleFleetError as error:
            self.refused = error.message

    def _fresh(self, place: FleetConfig, first: int) -> Sequence[FleetRun]:
        runs = self.run(place, first, STUDENT_MIN_RUNS)
        self.spent += len(runs)
        return runs

    @property
    def limit(self) -> int | None:
        """The selected number of robots with orders; None if it is the fleet as it is, or unclear."""
        if self.best is None or len(self.best.left) != 1 or not self.best.left[0]:
            return None
        return int(self.best.left[0].partition("=")[2])

    @property
    def is_better(self) -> bool:
        """Whether fresh runs confirm that parking gains at least PARKING_ZONE."""
        change = None if self.gain is None else self.gain.relative
        if change is None or change.low is None or change.high is None:
            return False
        if self.question.target.at_most:
            return change.high < 0 and change.value <= -PARKING_ZONE
        return change.low > 0 and change.value >= PARKING_ZONE


@dataclass
class SizingSession:
    """A question and its results so far; consistent at any time, even after Ctrl-C."""

    question: Question
    run: Runner
    excluded: Mapping[int, str] = field(default_factory=dict)
    changes: Mapping[int, Sequence[str]] = field(default_factory=dict)  # percent -> settings
    searches: list[FleetSearch] = field(default_factory=list)
    gains: dict[str, MarginalGain] = field(default_factory=dict)  # by strategy
    best: StrategySelection | None = None
    moved: list[SensitivityResult] = field(default_factory=list)
    left: int = 0  # of the budget, before the bound takes its runs
    bound: DayBound | None = None  # what the answer reaches on a share of days
    budget_left: RunBudget | None = None  # for the follow-ups of the searches
    complete: bool = False  # whether the session ended without interruption
    watch: Callable[[FleetConfig, int], str] = lambda place, replication: ""  # command to see a run
    same_orders: bool = False  # whether all runs have the same orders, from a list or a file

    def go(self) -> None:
        """Search, then do the follow-ups."""
        question, left = self.question, self.question.budget
        for number, strategy in enumerate(question.strategies):
            share = left // (len(question.strategies) - number)
            search = FleetSearch(question, strategy, self.run, share, self.excluded)
            self.searches.append(search)
            search.go()
            left -= search.spent
        self._follow_up(RunBudget(self.run, left))
        self.complete = True

    def _follow_up(self, run_budget: RunBudget) -> None:
        question, self.budget_left = self.question, run_budget
        for search in self.searches:
            last = search.answer.size or self._largest(search)
            if search.answer.size is None:
                self._show(search, run_budget)
            if last is not None:
                self.gains[search.strategy] = gain_of(search.candidates, last, run_budget, question)
        place = self.place  # the runs above may have decided a fleet that was undecided
        if place is None:
            return
        if len(question.strategies) > 1:
            self.best = best_of(self._rivals(place.size), run_budget, question)
        for moved in sensitivity(self.place or place, run_budget, question, list(self.changes)):
            self.moved.append(moved)
        self.left, found = run_budget.left, self.answered
        if found is not None:
            self.bound = day_bound(found, run_budget, question)

    def _show(self, search: FleetSearch, run_budget: RunBudget) -> None:
        """Run the largest fleet, to show why it misses the target."""
        candidate = search.candidates[-1] if search.candidates else None
        if candidate is not None:
            run_budget.extend_runs(candidate, LARGEST_FLEET_RUNS, self.question)

    def _largest(self, search: FleetSearch) -> int | None:
        return search.candidates[-1].place.size if search.candidates else None

    def _rivals(self, robots: int) -> list[Candidate]:
        """The candidates of all strategies with this number of robots that meet the target."""
        found = [search.find(robots) for search in self.searches]
        return [one for one in found if one is not None and one.verdict == "meets"]

    @property
    def answered(self) -> Candidate | None:
        """The candidate of `place`."""
        place = self.place
        searches = (one for one in self.searches if place and one.strategy == place.strategy)
        return next((one.find(place.size) for one in searches if place), None)

    @property
    def after(self) -> int:
        """Number of runs made after the searches."""
        return 0 if self.budget_left is None else self.budget_left.spent

    @property
    def spent(self) -> int:
        """Number of runs made."""
        return self.after + sum(search.spent for search in self.searches)

    @property
    def place(self) -> FleetConfig | None:
        """The smallest fleet that meets the target with any strategy; the best of equal ones."""
        known = [
            FleetConfig(search.answer.size, search.strategy)
            for search in self.searches
            if search.answer.kind == "answered" and search.answer.size is not None
        ]
        least = min((place.size for place in known), default=None)
        smallest = [place for place in known if place.size == least]
        if self.best is not None and len(self.best.left) == 1:
            smallest = [one for one in smallest if one.strategy == self.best.left[0]] or smallest
        return smallest[0] if smallest else None

    @property
    def settled(self) -> bool:
        """Whether `place` is final: no strategy has an undecided smaller fleet."""
        place = self.place
        if place is None or len(self.searches) < len(self.question.strategies):
            return False
        unsure = [search.answer.least for search in self.searches]
        return all(least is None or least >= place.size for least in unsure)


def parking_of(fleets: Fleets, runner: Checked) -> ParkingSession:
    """The comparison for the runner's question. Raises InputError if the scenario cannot limit it."""
    question, allocation = runner.question, fleets.base.strategies["allocation"].name
    if "active" not in lookup.parameters_type("allocation", allocation).__struct_fields__:
        able = [
            name
            for name in lookup.names("allocation")
            if "active" in lookup.parameters_type("allocation", name).__struct_fields__
        ]
        raise InputError(
            f"{question.quantity.option}: allocation {allocation} cannot limit the number of robots with "
            f"an order; use {alternatives(able)}"
        )
    robots = fleets.base.scenario.fleet.robots
    if question.last > robots:
        text = f"the fleet has {robots:,} robots, so no more can have orders"
        raise InputError(f"{question.quantity.option} {question.last}: {text}")
    fewest = RUNS_PER_BATCH * FIRST_STAGE_RUNS * (1 + len(question.sizes))
    if question.budget < fewest:
        text = (
            f"the first stage takes {fewest:,} runs; a larger --step has fewer numbers to compare"
        )
        raise InputError(f"--budget {question.budget:,}: {text}")
    fleets.check_stop(question)
    return ParkingSession(question, robots, runner)


def session_of(fleets: Fleets, runner: Checked) -> SizingSession:
    """The session for the runner's question. Raises InputError if the scenario cannot answer it."""
    fleets.check(runner.question)
    return SizingSession(
        runner.question,
        runner,
        fleets.excluded(runner.question),
        fleets.changes,
        watch=fleets.watch,
        same_orders=fleets.base.has_same_orders,
    )
