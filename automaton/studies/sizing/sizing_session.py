"""A whole question answered: a search for each strategy, then what is asked of its answer.

What one robot gains, which strategy is best, and how the answer moves if durations are 10 % off: all
within what is left of the budget. The runs are of fleets of one scenario, over the cores, replication by
replication: r has the same seed for every fleet and strategy, hash(seed, r), and so the same demand.
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

PERCENTS_OFF: Final = (-10, 10)  # percent
MOVES_LATE: Final = "world.extra_tick_probability"  # makes moves longer that take too few ticks
TRIAL_RUNS: Final = 100  # runs of each fleet under other durations
SELECTION_ROUND_RUNS: Final = 100  # runs of each strategy
LARGEST_FLEET_RUNS: Final = 60  # runs of the largest fleet, for what it loses time with
ORDER_METRICS = (*OF_TIMES, "legs_per_order")  # once an order is delivered
STATION_USE = "station_use"  # share of the time of all stations in which a robot is served there
MEASURED_TICKS = "measured"  # ticks of which the metrics are
MOVE_KEY = re.compile(r"durations\.move[.=]")
PLAIN_KEY = re.compile(r"[\w-]+")  # a name that may stand between the points of a key
CHARGER_USE = "charger_use"  # share of the time of all places at chargers in which a robot charges


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


@dataclass
class SizingSession:
    """A question and what is known of it; whole at any moment, also after Ctrl-C."""

    question: Question
    run: Runner
    excluded: Mapping[int, str] = field(default_factory=dict)
    changes: Mapping[int, Sequence[str]] = field(default_factory=dict)  # percent: settings
    searches: list[FleetSearch] = field(default_factory=list)
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
        place = self.place  # these runs may have decided a fleet that the search had left undecided
        if place is None:
            return
        if len(question.strategies) > 1:
            self.best = best_of(self._rivals(place.robots), run_budget, question)
        for moved in sensitivity(self.place or place, run_budget, question, list(self.changes)):
            self.moved.append(moved)

    def _show(self, search: FleetSearch, run_budget: RunBudget) -> None:
        """Runs of the largest fleet, so that one sees what keeps it from the target."""
        candidate = search.candidates[-1] if search.candidates else None
        if candidate is not None:
            run_budget.extend_runs(candidate, LARGEST_FLEET_RUNS, self.question)

    def _largest(self, search: FleetSearch) -> int | None:
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


# The runs of fleets.


def run_and_measure_use(simulation: Simulation) -> dict[str, float | int]:
    """Run to the end; the metrics after the warm-up, and how busy stations and chargers were then."""
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
    """A `Runner` of one scenario. Raises InfeasibleFleetError for a place that cannot be run."""

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
        self.resolved = cache(self._resolved)  # of a place

    def __call__(self, place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        """Replications first .. first + number - 1."""
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
        """That there is a steady state to ask for, and the largest fleets can be run.

        Raises InputError.
        """
        if not self.ends_with_orders and not question.warm_up:
            raise InputError(
                "--target: runs end at a given tick (stop: {when: never}), so their metrics would "
                "count the start-up; set how many ticks to leave out: --set measure.warm_up=N"
            )
        if not self.ends_with_orders and question.target.metric == "makespan":
            raise InputError(
                "--target: runs end at a given tick (stop: {when: never}), so makespan "
                "is the same for every fleet; ask for throughput or a time of orders"
            )
        for strategy in question.strategies:
            for robots in sorted({question.first, question.last}):
                try:
                    self.resolved(FleetConfig(robots, strategy))
                except InputError as error:
                    unsaid = (one for one in for_any_fleet(self.base) if one not in error.message)
                    settings = " ".join(f"--set {setting}" for setting in unsaid)
                    hint = f"; fleets of other sizes: {settings}" if settings else ""
                    raise InputError(error.message + hint, error.file, error.line) from None

    def excluded(self, question: Question) -> dict[int, str]:
        """The candidates that no strategy can help, each with the bound that excludes it."""
        found = bounds(self.base)
        reasons = {}
        for robots in range(question.first, question.last + 1):
            target, why = question.target, ""
            if target.metric == "makespan" and target.at_most and self.ends_with_orders:
                least, reason = least_ticks(found, robots)
                if least > target.value:
                    many = "without end"
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
        """By how many percent durations can be longer, and the settings that make them so."""
        found = {percent: longer(self.base, percent) for percent in PERCENTS_OFF}
        return {percent: settings for percent, settings in found.items() if settings}

    @property
    def tick(self) -> Unit:
        """What a tick stands for."""
        return unit(self.base.scenario.units.tick)

    @property
    def warm_up(self) -> int | None:
        """Ticks that metrics leave out; None for runs that end with their orders, which count whole."""
        return None if self.ends_with_orders else warm_up_of(self.base.scenario)

    @property
    def measured(self) -> int:
        """Ticks of a steady state of which metrics are; 0 where runs end with their orders."""
        return 0 if self.warm_up is None else self.base.scenario.stop.max_duration - self.warm_up

    @property
    def ends_with_orders(self) -> bool:
        """Whether a run ends when all is delivered, and not at a given tick."""
        return self.base.scenario.stop.when != "never"


class Checked:
    """A runner that sees to it that the first run has the metric of the target.

    `tell` hears before each round what is run, and how many runs were made for the question.
    """

    def __init__(
        self,
        fleets: Fleets,
        question: Question,
        tell: Callable[[FleetConfig, int, Question], None] | None = None,
    ) -> None:
        self.fleets, self.question, self.tell, self.runs = fleets, question, tell, 0

    def __call__(self, place: FleetConfig, first: int, number: int) -> Sequence[FleetRun]:
        """As of Fleets. Raises InputError for a metric that is not measured."""
        if self.tell is not None:
            self.tell(place, self.runs, self.question)
        if self.runs == 0:
            run = self.fleets(place, 0, 1)[0]
            check_measured(self.question.target, run, self.fleets.base.scenario)
        self.runs += number
        return self.fleets(place, first, number)


def session_of(fleets: Fleets, runner: Checked) -> SizingSession:
    """The session that answers the runner's question. Raises InputError if that cannot be asked."""
    fleets.check(runner.question)
    return SizingSession(
        runner.question,
        runner,
        fleets.excluded(runner.question),
        fleets.changes,
        same_orders=fleets.base.scenario.orders.listed is not None,
    )


def for_any_fleet(resolved: Resolved) -> list[str]:
    """Settings that take back what binds a scenario to its number of robots."""
    settings = []
    if isinstance(resolved.scenario.fleet.start, tuple):
        settings.append("fleet.start=random")
    if isinstance(resolved.scenario.fleet.heading, tuple):
        settings.append("fleet.heading=null")
    if resolved.zoning.design is not None:
        settings.append("strategy.zoning.design=null")
    return settings


def typed(place: FleetConfig) -> Iterator[Override]:
    """Its settings under the options that gave them, which is where errors place them."""
    yield Override(f"--robots {place.robots}", keys_of("fleet.robots"), place.robots)
    if place.strategy:
        option = f"--strategies {place.strategy.removeprefix('strategy.')}"
        yield replace(parse_setting(place.strategy), argument=option)


def check_measured(target: Target, run: FleetRun, scenario: Scenario) -> None:
    """That runs of a scenario may have the metric of the target. Raises InputError.

    A run in which nothing ended has no times: that says nothing of the others.
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
        hint = f"; it takes {need}" if need else ""
        raise InputError(
            f"--target: this scenario does not measure {target.metric}{hint}; it has {known}"
        )


def longer(resolved: Resolved, percent: int) -> list[str]:
    """Settings that make all durations longer by so many percent, or shorter; in whole ticks but for
    those of visits at stations.

    Where moves take few ticks, a tick more by chance makes them longer; shorter they cannot be.
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
    """All durations of operations that a scenario gives, of types as well, by their keys."""
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
    """All durations of visits at stations that a scenario gives, in ticks that are not rounded, by their
    keys; measured ones aside.
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
    """The numbers of a section above 0, by their keys."""
    if isinstance(value, dict):
        for name, one in value.items():
            yield from _numbers(f"{key}.{name}", one)
    elif isinstance(value, int | float) and value > 0:
        yield key, value
