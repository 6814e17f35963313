"""A sizing session: a search for each strategy, then follow-up analyses of the answer.

The follow-ups use the rest of the budget: the gain of the last robot, the best strategy, and the
sensitivity of the answer to durations that are 10 % off. Runs of the fleets of one scenario are spread
over the cores. Replication r has the same seed, hash(seed, r), and so the same demand, for every fleet
and strategy.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from automaton.engine.state import ACTION_CHARGE, ACTION_DROP, ACTION_PICK, ACTION_TRY_DROP
from automaton.errors import InputError
from automaton.floor.cells import STATION
from automaton.runs.headless import run_marked
from automaton.runs.metric_catalogue import in_coarse_ticks
from automaton.runs.metrics import counted, metrics_of
from automaton.runs.run_diagnosis import JamWatch, note_jam
from automaton.runs.simulation import Simulation
from automaton.scenario.document import Override, keys_of, parse_setting
from automaton.scenario.schema import Scenario
from automaton.scenario.unavailable_metrics import (
    OF_DUE_TIMES,
    OF_TIMES,
    TASK_METRICS,
    not_measured,
    warm_up_of,
)
from automaton.studies.inference.intervals import STUDENT_MIN_RUNS, Effect, effect
from automaton.studies.inference.proportions import (
    FIRST_STAGE_RUNS,
    RUNS_PER_BATCH,
    batches,
    select_least,
)
from automaton.studies.process_pool import PersistentPool
from automaton.studies.sizing.fleet_search import (
    DEFAULT_MEAN_INDIFFERENCE,
    Candidate,
    FleetConfig,
    FleetRun,
    FleetSearch,
    InfeasibleFleetError,
    Question,
    Runner,
    Target,
)
from automaton.studies.sweeps.run_keys import replication_seeds
from automaton.units import Unit, count, ticks_and_time, unit
from automaton.world.bounds import bounds, least_ticks, most_throughput
from automaton.world.floor_parts import places_of_chargers
from automaton.world.resolve import Resolved, resolve

PERCENTS_OFF: Final = (-10, 10)  # changes of durations in percent
MOVES_LATE: Final = "world.extra_tick_probability"  # lengthens moves that take only a few ticks
TRIAL_RUNS: Final = 100  # runs of each fleet under changed durations
SELECTION_ROUND_RUNS: Final = 100  # runs of each strategy
LARGEST_FLEET_RUNS: Final = 60  # runs of the largest fleet, to show its lost time
ORDER_METRICS = (*OF_TIMES, "legs_per_order")  # metrics that exist once an order is delivered
STATION_USE = "station_use"  # share of the time of all stations in which they serve a robot
MEASURED_TICKS = "measured"  # number of ticks that the metrics cover
MOVE_KEY = re.compile(r"durations\.move[.=]")
PLAIN_KEY = re.compile(r"[\w-]+")  # a name that can be part of a dotted key
CHARGER_USE = "charger_use"  # share of the time of all charging places in which a robot charges


class MarginalGain(NamedTuple):
    """The effect of the last robot on the metric of the target."""

    robots: int
    effect: Effect | None  # fleet with the last robot against fleet without it, over finished runs
    refused: str = ""  # why the smaller fleet cannot be run


class StrategySelection(NamedTuple):
    """The best of several strategies for a fleet size."""

    robots: int
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
        return next((one.place.robots for one in self.fleets if seems_to_meet(one, question)), None)


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
    candidates: Sequence[Candidate], robots: int, run_budget: RunBudget, question: Question
) -> MarginalGain:
    """The gain of the last robot: compare both fleet sizes with STUDENT_MIN_RUNS runs each."""
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
                robots=rivals[0].place.robots,
                strategies=tuple(one.place.strategy for one in rivals),
                left=tuple(one.place.strategy for one in left),
                means=tuple(sign * float(one.mean()) for one in values),
                runs=tuple(map(len, values)),
                zone=zone,
            )
        until = RUNS_PER_BATCH * selected.batches + SELECTION_ROUND_RUNS


def around(answer: FleetConfig, question: Question) -> list[int]:
    """Fleet sizes from one robot less to one more, up to the largest size of the question."""
    return [n for n in range(answer.robots - 1, answer.robots + 2) if 1 <= n <= question.last]


def sensitivity(
    answer: FleetConfig, run_budget: RunBudget, question: Question, percents: Sequence[int]
) -> Iterator[SensitivityResult]:
    """Run the fleets from one robot less to one more with durations changed by some percents."""
    for percent in percents:
        places = [answer._replace(robots=n, percent=percent) for n in around(answer, question)]
        moved = SensitivityResult(percent, [Candidate(place) for place in places])
        for one in moved.around:
            if not run_budget.extend_runs(one, TRIAL_RUNS, question) and not one.refused:
                return
        yield moved


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
    budget_left: RunBudget | None = None  # for the follow-ups of the searches
    complete: bool = False  # whether the session ended without interruption
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
            last = search.answer.robots or self._largest(search)
            if search.answer.robots is None:
                self._show(search, run_budget)
            if last is not None:
                self.gains[search.strategy] = gain_of(search.candidates, last, run_budget, question)
        place = self.place  # the runs above may have decided a fleet that was undecided
        if place is None:
            return
        if len(question.strategies) > 1:
            self.best = best_of(self._rivals(place.robots), run_budget, question)
        for moved in sensitivity(self.place or place, run_budget, question, list(self.changes)):
            self.moved.append(moved)

    def _show(self, search: FleetSearch, run_budget: RunBudget) -> None:
        """Run the largest fleet, to show why it misses the target."""
        candidate = search.candidates[-1] if search.candidates else None
        if candidate is not None:
            run_budget.extend_runs(candidate, LARGEST_FLEET_RUNS, self.question)

    def _largest(self, search: FleetSearch) -> int | None:
        return search.candidates[-1].place.robots if search.candidates else None

    def _rivals(self, robots: int) -> list[Candidate]:
        """The candidates of all strategies with this number of robots that meet the target."""
        found = [search.find(robots) for search in self.searches]
        return [one for one in found if one is not None and one.verdict == "meets"]

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
        """Whether `place` is final: no strategy has an undecided smaller fleet."""
        place = self.place
        if place is None or len(self.searches) < len(self.question.strategies):
            return False
        unsure = [search.answer.least for search in self.searches]
        return all(least is None or least >= place.robots for least in unsure)


# The runs of fleets.


def run_and_measure_use(simulation: Simulation) -> dict[str, float | int]:
    """Run to the end; return metrics after the warm-up, with the use of stations and chargers."""
    resolved = simulation.resolved
    fleet = count(resolved.scenario.fleet.robots, "robot")
    allocation = resolved.strategies["allocation"].name
    where = f"{resolved.scenario.name}, {fleet}, {allocation}, seed {simulation.seed}"
    since = run_marked(simulation, watch=JamWatch(partial(note_jam, where))).warm_up
    figures, now = metrics_of(simulation, since), counted(simulation)
    since = now.none() if since is None else since
    ticks, elapsed = now.actions - since.actions, max(1, now.tick - since.tick)
    figures[MEASURED_TICKS] = elapsed // simulation.resolved.scenario.refine
    world, floor_plan = simulation.world, simulation.resolved.floor_plan
    stations = int(np.count_nonzero(floor_plan.kind == STATION))
    places = sum(places_of_chargers(resolved.scenario, floor_plan).values())
    if stations:
        handling = int(ticks[[ACTION_PICK, ACTION_DROP, ACTION_TRY_DROP]].sum())
        # Pods are picked and dropped in storage.
        served = int((now.station_busy - since.station_busy).sum())
        used = served if len(world.trips.pod) else handling
        figures[STATION_USE] = used / (stations * elapsed)
    if places and world.rules.battery:
        figures[CHARGER_USE] = float(ticks[ACTION_CHARGE].sum()) / (places * elapsed)
    return in_coarse_ticks(figures, simulation.resolved.scenario.refine)


class Fleets:
    """A `Runner` of one scenario. Raises InfeasibleFleetError for a fleet that cannot be run."""

    def __init__(
        self,
        scenario: str | Path | Mapping[str, Any] | Scenario,
        settings: Sequence[str | Override],
        seed: int | None,
        rounds: PersistentPool,
    ) -> None:
        self._scenario, self._settings, self._rounds = scenario, tuple(settings), rounds
        self.base = resolve(scenario, settings).unrefined
        self.seed = self.base.scenario.seed if seed is None else seed
        self.resolved = cache(self._resolved)  # by fleet

    def __call__(self, place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        """Run replications first .. first + number - 1."""
        resolved = self.resolved(place)
        seeds = replication_seeds(self.seed, first, number)
        results = self._rounds.run([(resolved, seed) for seed in seeds])
        return [FleetRun(result.finished, result.metrics) for result in results]

    def _resolved(self, place: FleetConfig) -> Resolved:
        changes = longer(self.base, place.percent) if place.percent else []
        try:
            return resolve(self._scenario, (*self._settings, *typed(place), *changes))
        except InputError as error:
            raise InfeasibleFleetError(error.message, error.file, error.line) from None

    def check(self, question: Question) -> None:
        """Check that the question suits the scenario, and that smallest and largest fleets can be run.

        Raises InputError.
        """
        if not self.ends_with_orders and not question.warm_up:
            raise InputError(
                "--target: runs end at a given tick (stop: {when: never}), so their metrics would "
                "include the start-up; set a warm-up period in ticks: --set measure.warm_up=N"
            )
        if not self.ends_with_orders and question.target.metric == "makespan":
            raise InputError(
                "--target: runs end at a given tick (stop: {when: never}), so makespan "
                "is the same for every fleet; use throughput or a time of orders"
            )
        for strategy in question.strategies:
            for robots in sorted({question.first, question.last}):
                try:
                    self.resolved(FleetConfig(robots, strategy))
                except InputError as error:
                    unsaid = (one for one in for_any_fleet(self.base) if one not in error.message)
                    settings = " ".join(f"--set {setting}" for setting in unsaid)
                    hint = f"; for other fleet sizes use {settings}" if settings else ""
                    raise InputError(error.message + hint, error.file, error.line) from None

    def excluded(self, question: Question) -> dict[int, str]:
        """The fleet sizes that fail with any strategy, each with the bound that excludes it."""
        found = bounds(self.base)
        reasons = {}
        for robots in range(question.first, question.last + 1):
            target, why = question.target, ""
            if target.metric == "makespan" and target.at_most and self.ends_with_orders:
                least, reason = least_ticks(found, robots)
                if least > target.value:
                    many = "infinite"
                    if math.isfinite(least):
                        many = f"at least {ticks_and_time(math.ceil(least), self.tick)}"
                    why = f"makespan is {many}: {reason}"
            if target.metric == "throughput" and not target.at_most:
                most, reason = most_throughput(found, robots, self.measured or math.inf)
                if most < target.value:
                    why = f"throughput is at most {most:,.3g}: {reason}"
            if why:
                reasons[robots] = why
        return reasons

    @property
    def changes(self) -> dict[int, list[str]]:
        """The settings that change durations by each of PERCENTS_OFF, where this is possible."""
        found = {percent: longer(self.base, percent) for percent in PERCENTS_OFF}
        return {percent: settings for percent, settings in found.items() if settings}

    @property
    def tick(self) -> Unit:
        """The unit of a tick."""
        return unit(self.base.scenario.units.tick)

    @property
    def warm_up(self) -> int | None:
        """Ticks that metrics exclude; None for runs that end with their orders, which count whole."""
        return None if self.ends_with_orders else warm_up_of(self.base.scenario)

    @property
    def measured(self) -> int:
        """Ticks that metrics of a steady state cover; 0 if runs end with their orders."""
        return 0 if self.warm_up is None else self.base.scenario.stop.max_duration - self.warm_up

    @property
    def ends_with_orders(self) -> bool:
        """Whether runs end when all orders are delivered, not at a given tick."""
        return self.base.scenario.stop.when != "never"


class Checked:
    """A runner that checks that the first run has the metric of the target.

    `tell` is called before each round with the fleet and the number of runs made so far.
    """

    def __init__(
        self,
        fleets: Fleets,
        question: Question,
        tell: Callable[[FleetConfig, int, Question], None] | None = None,
    ) -> None:
        self.fleets, self.question, self.tell, self.runs = fleets, question, tell, 0

    def __call__(self, place: FleetConfig, first: int, number: int) -> Sequence[FleetRun]:
        """Run replications like Fleets. Raises InputError if the target's metric is not measured."""
        if self.tell is not None:
            self.tell(place, self.runs, self.question)
        if self.runs == 0:
            run = self.fleets(place, 0, 1)[0]
            check_measured(self.question.target, run, self.fleets.base.scenario)
        self.runs += number
        return self.fleets(place, first, number)


def session_of(fleets: Fleets, runner: Checked) -> SizingSession:
    """The session for the runner's question. Raises InputError if the scenario cannot answer it."""
    fleets.check(runner.question)
    return SizingSession(
        runner.question,
        runner,
        fleets.excluded(runner.question),
        fleets.changes,
        same_orders=fleets.base.has_same_orders,
    )


def for_any_fleet(resolved: Resolved) -> list[str]:
    """Settings that remove what ties a scenario to its number of robots."""
    settings = []
    if isinstance(resolved.scenario.fleet.start, tuple):
        settings.append("fleet.start=random")
    if isinstance(resolved.scenario.fleet.heading, tuple):
        settings.append("fleet.heading=null")
    if resolved.zoning.design is not None:
        settings.append("strategy.zoning.design=null")
    return settings


def typed(place: FleetConfig) -> Iterator[Override]:
    """The settings of a fleet, with the options that errors name as their source."""
    yield Override(f"--robots {place.robots}", keys_of("fleet.robots"), place.robots)
    if place.strategy:
        option = f"--strategies {place.strategy.removeprefix('strategy.')}"
        yield replace(parse_setting(place.strategy), argument=option)


def check_measured(target: Target, run: FleetRun, scenario: Scenario) -> None:
    """Raise InputError if runs of a scenario cannot have the metric of the target.

    A run without finished orders or tasks has no times, but other runs may have them.
    """
    nothing_yet = {
        **dict.fromkeys(TASK_METRICS, scenario.measure is not None),
        **dict.fromkeys(ORDER_METRICS, not run.figures["delivered"]),
        **dict.fromkeys(OF_DUE_TIMES, "not_yet_due" in run.figures),
        "part_flow_time": "parts_finished" in run.figures,
    }
    if target.metric not in run.figures and not nothing_yet.get(target.metric):
        known = ", ".join(name for name in run.figures if not name.startswith("lost_"))
        need = not_measured(scenario).get(target.metric)
        hint = f"; it needs {need}" if need else ""
        raise InputError(
            f"--target: this scenario does not measure {target.metric}{hint}; it has {known}"
        )


def longer(resolved: Resolved, percent: int) -> list[str]:
    """Settings that change all durations by some percent; in whole ticks except visits at stations.

    Moves of a few ticks become longer by a random extra tick; they cannot become shorter.
    """
    scenario = resolved.scenario
    settings = []
    for key, ticks in ticks_by_key(scenario).items():
        other = round(ticks * (1 + percent / 100))
        if other != ticks:
            settings.append(f"{key}={other}")
    for key, duration in handling_by_key(scenario).items():
        settings.append(f"{key}={duration * (1 + percent / 100):g}")
    chance = max(scenario.durations.moves) * percent / 100
    moves_as_before = not any(MOVE_KEY.search(setting) for setting in settings)
    if (
        moves_as_before
        and percent > 0
        and not scenario.world.extra_tick_probability
        and chance <= 1
    ):
        settings.append(f"{MOVES_LATE}={chance:g}")
    return settings


def ticks_by_key(scenario: Scenario) -> dict[str, int]:
    """All durations of operations in a scenario and its robot types, by key."""
    ticks: dict[str, int] = {}
    sections = [("durations", scenario.durations)] + [
        (f"fleet.types.{number}.durations", kind.durations)
        for number, kind in enumerate(scenario.fleet.types)
    ]
    for key, durations in sections:
        for name, value in msgspec.to_builtins(durations).items():
            if isinstance(value, int):
                ticks[f"{key}.{name}"] = value
            elif name in ("move", "turn") and value is not None:
                ticks |= {f"{key}.{name}.{load}": one for load, one in value.items()}
    return ticks


def handling_by_key(scenario: Scenario) -> dict[str, float]:
    """All durations of visits at stations in a scenario, in unrounded ticks, by key.

    Measured distributions are not included.
    """
    sections = {"durations.handling": scenario.durations.handling} | {
        f"stations.{name}.handling": station.handling
        for name, station in scenario.stations.items()
        if PLAIN_KEY.fullmatch(name)
    }
    return {
        key: duration
        for section, handling in sections.items()
        for key, duration in _numbers(section, msgspec.to_builtins(handling))
    }


def _numbers(key: str, value: Any) -> Iterator[tuple[str, float]]:
    """The numbers above 0 of a section, by key."""
    if isinstance(value, dict):
        for name, one in value.items():
            yield from _numbers(f"{key}.{name}", one)
    elif isinstance(value, int | float) and value > 0:
        yield key, value
