"""The search for the smallest fleet that meets a target, and the question that it answers.

More robots are not always better (finishing times rise and fall with fleet size), so the search does
not use bisection. It tests candidates from the smallest on until one passes, and infers none from
another. A candidate that takes too long is postponed; it gets the rest of the budget when a larger one
has passed, or when no candidate is left. With K candidates and error e / K each, all verdicts are
simultaneously right with probability 1 - e, wherever the search stops.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Final, Literal, NamedTuple

import numpy as np

from automaton.errors import InputError, alternatives, nearest
from automaton.runs.metric_catalogue import METRIC_CATALOGUE, PER_1000_TICKS
from automaton.scenario.quantities import Dimension, read_amount
from automaton.scenario.schema import LAYER_NAMES
from automaton.strategy import lookup
from automaton.studies.inference.intervals import Interval, mean_interval
from automaton.studies.inference.proportions import (
    FIRST_STAGE_RUNS,
    RUNS_PER_BATCH,
    Region,
    ShareTest,
    SureShare,
    Verdict,
    batches,
    confidence_sequence,
    feasible,
    fixed_runs,
    region,
    share_test,
)
from automaton.units import SECONDS_PER_UNIT, Unit, count, symbol_of

DEFAULT_SUCCESS_SHARE: Final = 0.95
DEFAULT_INDIFFERENCE: Final = 0.02
DEFAULT_ALPHA: Final = 0.05
DEFAULT_MAX_RUNS: Final = 20_000
DEFAULT_MEAN_INDIFFERENCE: Final = 0.01  # of the target, for a mean without a given zone
MAX_FLEET_SIZE: Final = 1_000_000

_TARGET: Final = re.compile(r"\s*([^\s<>=]+)\s*(<=|>=|<|>|==?)\s*(\S.*?)\s*")
_VALUE: Final = re.compile(r"([-+]?[\d.,_]+(?:[eE][-+]?\d+)?)\s*(\D.*)?")
_DECIMAL_COMMA: Final = re.compile(r",(?!\d{3}(?!\d))")  # not a thousands separator
_RANGE: Final = re.compile(r"\s*(\d{1,9})\s*(?:\.\.|-)\s*(\d{1,9})\s*|\s*(\d{1,9})\s*")
Kind = Literal["answered", "undecided", "not reachable"]
RUNS_PER_ROUND: Final = ((100, 100), (10, 25), (0, 10))  # (runs so far, runs in the next round)
MAX_POSTPONED: Final = 2  # postpone a candidate after 1 / MAX_POSTPONED of the remaining budget


class Target(NamedTuple):
    """The target of a run."""

    metric: str
    at_most: bool  # upper bound if True, lower bound if False
    value: float  # in the metric's unit
    time: str = ""  # "h" or "/h" if the value was given as a time or a rate
    ticks: float = 1.0  # size of this time unit in the metric's unit

    def met(self, value: float) -> bool:
        """Whether a value of the metric meets the target."""
        return value <= self.value if self.at_most else value >= self.value

    @property
    def text(self) -> str:
        """The target in words; a share in percent."""
        value = f"{shown(100 * self.value)} %" if self.unit == "share" else shown(self.value)
        return f"{self.metric} {'<=' if self.at_most else '>='} {value}"

    @property
    def unit(self) -> str:
        """The unit of the metric; "times" for counters of strategies."""
        return METRIC_CATALOGUE.get(self.metric, ("times", ""))[0]

    def in_unit(self, value: float) -> str:
        """The unit after a value: "ticks (5 h)" if the target was given as a time; "" for shares."""
        if self.unit == "share":
            return ""
        return self.unit + (f" ({shown(value / self.ticks)} {self.time})" if self.time else "")


def shown(value: float) -> str:
    """A value of a target with thousands separators."""
    return f"{value:,.0f}" if float(value).is_integer() else f"{value:,g}"


class SearchQuantity(NamedTuple):
    """What a search varies; all else is as in the scenario."""

    key: str  # of the scenario
    noun: str
    option: str  # of the command, which errors name as the source of a value

    def many(self, number: int) -> str:
        """A number of them: "1 robot"."""
        return count(number, self.noun)


ROBOT_COUNT: Final = SearchQuantity("fleet.robots", "robot", "--robots")
PARKING: Final = "strategy.allocation.active"  # varied by a comparison of means, not by a search
VARIED: Final = {
    "robots": ROBOT_COUNT,
    "stations": SearchQuantity("floor.open_stations", "station", "--vary stations"),
    "chargers": SearchQuantity("floor.open_chargers", "charger", "--vary chargers"),
    PARKING: SearchQuantity("fleet.robots", "robot", f"--vary {PARKING}"),
}


class Question(NamedTuple):
    """The complete question of a search; part of every report."""

    target: Target
    first: int  # range of sizes to test
    last: int
    strategies: tuple[str, ...]  # such as "strategy.allocation=auction"; ("",): the scenario's own
    success_share: float = DEFAULT_SUCCESS_SHARE
    indifference: float = DEFAULT_INDIFFERENCE  # a share, or for a mean in the metric's unit
    alpha: float = DEFAULT_ALPHA
    budget: int = DEFAULT_MAX_RUNS  # runs
    mean: bool = False  # whether the mean must meet the target, not a share of the runs
    warm_up: int | None = None  # ticks excluded in a steady state; None: runs that end count whole
    assure: bool = (
        False  # whether a fleet passes only if the share is shown, not the zone around it
    )
    step: int = 1  # from one size to the next
    quantity: SearchQuantity = ROBOT_COUNT

    @property
    def sizes(self) -> range:
        """The sizes to test."""
        return range(self.first, self.last + 1, self.step)

    @property
    def candidates(self) -> int:
        """The number of verdicts that share alpha."""
        return len(self.sizes) * len(self.strategies)

    @property
    def level(self) -> float:
        """The confidence of the interval of a share; with `assure` of the one that decides."""
        return 1 - (self.alpha / self.candidates if self.assure else self.alpha)

    @property
    def share_test(self) -> ShareTest | SureShare:
        """The test of one candidate's share."""
        error = self.alpha / self.candidates
        if self.assure:
            return SureShare(self.success_share, error)
        return share_test(self.success_share, self.indifference, error)

    @property
    def region(self) -> Region:
        """The region of one candidate's mean."""
        return region(self.indifference, self.alpha / self.candidates)

    @property
    def fewest(self) -> int:
        """The least number of runs after which a candidate can pass."""
        return RUNS_PER_BATCH * FIRST_STAGE_RUNS if self.mean else self.share_test.fewest


def make_question(
    target: Target,
    robots: tuple[int, int],
    strategies: tuple[str, ...] = ("",),
    success_share: float | None = None,
    indifference: float | None = None,
    alpha: float = DEFAULT_ALPHA,
    budget: int = DEFAULT_MAX_RUNS,
    mean: bool | None = None,
    warm_up: int | None = None,
    assure: bool = False,
    step: int = 1,
    quantity: SearchQuantity = ROBOT_COUNT,
) -> Question:
    """Create a checked question. A steady state uses the mean unless a share is asked for.

    Raises InputError.
    """
    if assure and (mean or indifference is not None):
        other = "--mean" if mean else "--indifference"
        raise InputError(f"--assure shows a share of days without a zone around it: omit {other}")
    if mean is None:
        mean = warm_up is not None and success_share is None and not assure
    success_share = DEFAULT_SUCCESS_SHARE if success_share is None else success_share
    if indifference is None:
        indifference = (
            DEFAULT_MEAN_INDIFFERENCE * abs(target.value) if mean else DEFAULT_INDIFFERENCE
        )
    question = Question(
        target, *robots, strategies, success_share, indifference, alpha, budget, mean, warm_up, assure,
        step, quantity,
    )  # fmt: skip
    if not 0 < alpha < 0.5:
        raise InputError(f"--alpha {alpha:g}: the error probability must lie between 0 and 0.5")
    if mean and indifference == 0 == target.value:
        raise InputError(
            "--target: a target of 0 needs an --indifference zone, in the unit of the metric "
            "(the default is 1 % of the target)"
        )
    if mean and indifference <= 0:
        raise InputError("--indifference of a mean must be above 0, in the unit of the metric")
    if not mean:
        if not 0 < success_share < 1:
            raise InputError(
                f"--success-share {success_share:g}: a share must lie between 0 and 1, such as "
                "0.95 or 95%"
            )
        try:
            share_test(success_share, 1e-9 if assure else indifference, 0.01)
        except ValueError as problem:
            raise InputError(f"--success-share and --indifference: {problem}") from None
    check_budget(question)
    return question._replace(last=question.sizes[-1])


def check_budget(question: Question, conditions: int = 1) -> None:
    """Raise InputError if the budget is too small for any candidate to pass."""
    parts = len(question.strategies) * conditions
    each, fewest = question.budget // parts, question.fewest
    if each >= fewest:
        return
    shared = f"; each of {parts} {'strategies' if conditions == 1 else 'searches'} gets {each:,}"
    least = f"a fleet needs at least {fewest:,} runs to pass"
    if question.assure:
        error = question.alpha / question.candidates
        least = (
            f"to show {100 * question.success_share:g} % of days, a fleet needs {fewest:,} days without "
            f"a miss ({fixed_runs(question.success_share, error):,} if their number were fixed)"
        )
    raise InputError(f"--budget {question.budget:,}: {least}{shared if parts > 1 else ''}")


def read_target(text: str, tick: Unit | None = None) -> Target:
    """Read a target such as "makespan<=3000" or "utilization>=60%". Raises InputError.

    `tick`: the scenario's unit of a tick; if it is a time, "makespan<=5h" is valid, too.
    """
    found = _TARGET.fullmatch(text)
    if found is None:
        raise InputError(
            f"--target '{text}' is not a target; expected METRIC<=VALUE or METRIC>=VALUE"
        )
    metric, sign, given = found.groups()
    if sign not in ("<=", ">="):
        raise InputError(f"--target '{text}': use <= or >=, not {sign}")
    if metric not in METRIC_CATALOGUE:
        hint = nearest(metric, METRIC_CATALOGUE) or f"; there are {', '.join(METRIC_CATALOGUE)}"
        raise InputError(f"--target: no metric is called '{metric}'{hint}")
    value, unit = _time_of_parts(given, text) if ":" in given else _value(given, text)
    if value < 0:
        raise InputError(f"--target '{text}': {metric} cannot be below 0")
    target = Target(metric, sign == "<=", value)
    if target.unit == "share":
        return target._replace(value=_share(target, unit, text))
    if symbol := symbol_of(unit):
        return _in_ticks(target, symbol, tick, text)
    if unit.startswith("/") and (symbol := symbol_of(unit[1:].strip())):
        return _in_thousand_ticks(target, symbol, tick, text)
    if unit:
        allowed = (
            f", or a time in {alternatives(SECONDS_PER_UNIT)}" if target.unit == "ticks" else ""
        )
        if target.unit.startswith(PER_1000_TICKS):
            allowed = ", or a rate such as 120/h"
        raise InputError(
            f"--target '{text}': '{unit}' is not understood; {metric} is in {target.unit}{allowed}"
        )
    return target


def _value(given: str, text: str) -> tuple[float, str]:
    """The number of a target and its unit. Raises InputError."""
    found = _VALUE.fullmatch(given)
    try:
        value = float(found[1].replace(",", "").replace("_", "")) if found else math.nan
    except ValueError:
        value = math.nan
    if found is not None and _DECIMAL_COMMA.search(found[1]):
        raise InputError(f"--target '{text}': write '{given}' with a decimal point, such as 1.5")
    if found is None or not math.isfinite(value):
        raise InputError(f"--target '{text}': '{given}' is not a number")
    return value, found[2] or ""


def _time_of_parts(value: str, text: str) -> tuple[float, str]:
    """Seconds of a time H:MM:SS, and its unit. Raises InputError."""
    try:
        return float(read_amount(value, (Dimension.TIME,)).value), "s"
    except InputError as error:
        raise InputError(f"--target '{text}': {error.message}") from None


def _share(target: Target, unit: str, text: str) -> float:
    """The value of a target that is a share. Raises InputError."""
    share = target.value / 100 if unit == "%" else target.value
    if unit not in ("", "%") or share > 1:
        raise InputError(
            f"--target '{text}': {target.metric} is a share between 0 and 1, such as 10% or 0.1"
        )
    return share


def _in_ticks(target: Target, time: str, tick: Unit | None, text: str) -> Target:
    """Convert a target whose value is a time to ticks. Raises InputError."""
    if target.unit != "ticks":
        raise InputError(f"--target '{text}': {target.metric} is in {target.unit}, not a time")
    ticks = SECONDS_PER_UNIT[time] / _tick_seconds(tick, text)
    return target._replace(value=target.value * ticks, time=time, ticks=ticks)


def _in_thousand_ticks(target: Target, time: str, tick: Unit | None, text: str) -> Target:
    """Convert a target whose value is a rate to events per 1,000 ticks. Raises InputError."""
    if not target.unit.startswith(PER_1000_TICKS):
        raise InputError(f"--target '{text}': {target.metric} is in {target.unit}, not a rate")
    once = 1000 * _tick_seconds(tick, text) / SECONDS_PER_UNIT[time]
    return target._replace(value=target.value * once, time=f"/{time}", ticks=once)


def _tick_seconds(tick: Unit | None, text: str) -> float:
    """Seconds of a tick. Raises InputError if the tick has no time unit."""
    if tick is None or tick.seconds is None:
        name = "unknown" if tick is None else tick.name
        raise InputError(f"--target '{text}': units.tick of the scenario is {name}; use ticks")
    return tick.seconds


def read_robots(text: str, quantity: SearchQuantity = ROBOT_COUNT) -> tuple[int, int]:
    """Read a range of sizes such as "1..12", or "5". Raises InputError."""
    found = _RANGE.fullmatch(text)
    if found is None:
        raise InputError(f"{quantity.option} '{text}': expected FIRST..LAST, such as 1..12")
    return checked_robots(int(found[1] or found[3]), int(found[2] or found[3]), quantity)


def quantity_named(name: str) -> SearchQuantity:
    """What `--vary` names. Raises InputError."""
    if name in VARIED:
        return VARIED[name]
    raise InputError(
        f"--vary {name}: cannot vary{nearest(name, VARIED)}; can vary: {', '.join(VARIED)}"
    )


def robots_of(given: str | int | tuple[int, int] | list[int]) -> tuple[int, int]:
    """Read a range of fleet sizes given in Python: "1..12", 5, or (1, 12). Raises InputError."""
    if isinstance(given, str):
        return read_robots(given)
    pair = list(given) if isinstance(given, (tuple, list)) else [given, given]
    if len(pair) != 2 or not all(isinstance(one, int) for one in pair):
        raise InputError(f"robots={given!r}: expected a number, (FIRST, LAST) or 'FIRST..LAST'")
    return checked_robots(pair[0], pair[1])


def checked_robots(
    first: int, last: int, quantity: SearchQuantity = ROBOT_COUNT
) -> tuple[int, int]:
    """The smallest and the largest size to test. Raises InputError."""
    if not 1 <= first <= last <= MAX_FLEET_SIZE:
        raise InputError(
            f"{quantity.option} '{first}..{last}': expected FIRST..LAST with 1 <= FIRST <= LAST <= "
            f"{MAX_FLEET_SIZE:,}"
        )
    return first, last


def strategies_of(given: str | Sequence[str] | None) -> tuple[str, ...]:
    """Read strategies given in Python: "a,b" or ["a", "b"]; None: only the scenario's own.

    Raises InputError.
    """
    if given is None:
        return ("",)
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, (tuple, list)) or not all(isinstance(name, str) for name in names):
        raise InputError(f"strategies={given!r}: expected names, such as 'independent,cooperative'")
    return strategies_named(",".join(names))


def strategies_named(text: str) -> tuple[str, ...]:
    """The settings of strategies such as "independent,cooperative" or "routing=astar".

    Raises InputError for unknown names.
    """
    found = []
    for name in (part.strip() for part in text.split(",")):
        layer, equals, choice = name.partition("=")
        if equals:
            found.append(f"strategy.{layer.removeprefix('strategy.').strip()}={choice.strip()}")
            continue
        layers = [layer for layer in LAYER_NAMES if name in lookup.names(layer)]
        if ":" in name:
            layers = ["allocation"]
        if not layers or name == lookup.NO_STRATEGY:
            known = [known for layer in LAYER_NAMES for known in lookup.names(layer)]
            raise InputError(
                f"--strategies: no strategy is called '{name}'{nearest(name, known)}; "
                "or say LAYER=NAME"
            )
        found.append(f"strategy.{layers[0]}={name}")
    if len(set(found)) < len(found):
        raise InputError("--strategies names a strategy twice")
    return tuple(found)


# The search.


class FleetConfig(NamedTuple):
    """A fleet to run."""

    size: int  # number of robots, or of what the search varies
    strategy: str = ""  # a setting; "": the scenario's own
    percent: int = 0  # change of durations in percent


class FleetRun(NamedTuple):
    """The stored result of a run."""

    finished: bool
    figures: dict[str, float | int]


# Arguments: fleet, first replication, number of runs.
Runner = Callable[[FleetConfig, int, int], Sequence[FleetRun]]


class InfeasibleFleetError(InputError):
    """The scenario does not allow a fleet, such as a number of robots other than that of starts."""


@dataclass
class Candidate:
    """One fleet with one strategy."""

    place: FleetConfig
    runs: list[FleetRun] = field(default_factory=list)
    verdict: Verdict = "undecided"
    after: int = 0  # number of runs at the time of the verdict
    excluded: str = ""  # the theoretical bound that excludes it without a run
    refused: str = ""  # why it cannot be run

    def add(self, runs: Sequence[FleetRun], question: Question) -> None:
        """Add runs, and update the verdict if it is undecided."""
        self.runs += runs
        if self.verdict == "undecided":
            self.verdict, self.after = judged(self.runs, question)

    def values(self, metric: str) -> list[float]:
        """The values of a metric in the finished runs that have it."""
        return [
            float(run.figures[metric])
            for run in self.runs
            if run.finished and metric in run.figures
        ]

    def unmeasured(self, metric: str) -> int:
        """Number of finished runs without the metric, such as runs without a delivered order."""
        return sum(run.finished and metric not in run.figures for run in self.runs)

    @property
    def censored(self) -> int:
        """Number of runs that did not finish."""
        return sum(not run.finished for run in self.runs)

    def met(self, question: Question) -> int:
        """Number of runs that meet the target."""
        return sum(meets(run, question) for run in self.runs)

    def share(self, question: Question) -> Interval:
        """The share of runs that meet the target, with an interval valid under sequential stopping."""
        return confidence_sequence(self.met(question), len(self.runs), question.level)

    def mean(self, metric: str) -> Interval | None:
        """The mean of a metric over the finished runs; None without any."""
        values = self.values(metric)
        return mean_interval(values).unless_vague().not_below_zero() if values else None


def meets(run: FleetRun, question: Question) -> bool:
    """Whether a run finished, measured the metric, and meets the target."""
    metric = question.target.metric
    return (
        run.finished and metric in run.figures and question.target.met(float(run.figures[metric]))
    )


def judged(runs: Sequence[FleetRun], question: Question) -> tuple[Verdict, int]:
    """The verdict on a candidate from its runs in order, and the number of runs that decided it."""
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
        return "fails", len(known) + 1  # a run has no value, so the mean of all runs is unknown
    return verdict, len(runs)


def lost_by_cause(candidate: Candidate) -> dict[str, float]:
    """Mean lost robot ticks per run by cause, over all runs; causes without lost ticks are omitted."""
    names = dict.fromkeys(name for run in candidate.runs for name in run.figures)
    lost = (name for name in names if name.startswith("lost_") or name == "slowdown_ticks")
    means = {name: mean_of(candidate, name) for name in lost}
    return {name: value for name, value in means.items() if value > 0}


def mean_of(candidate: Candidate, name: str) -> float:
    """The mean of a metric over all runs, including unfinished ones; NaN without any."""
    values = [float(run.figures[name]) for run in candidate.runs if name in run.figures]
    return math.fsum(values) / len(values) if values else math.nan


class SearchAnswer(NamedTuple):
    """The answer for one strategy."""

    kind: Kind
    size: int | None  # the smallest fleet that has passed so far
    least: int | None  # the smallest undecided fleet; None: all below `size` fail


@dataclass
class FleetSearch:
    """The search with one strategy; `spent` and `candidates` are valid at any time, even after Ctrl-C."""

    question: Question
    strategy: str
    run: Runner
    budget: int
    excluded: Mapping[int, str] = field(default_factory=dict)  # fleet size: bound that excludes it
    spent: int = 0
    candidates: list[Candidate] = field(default_factory=list)

    def go(self) -> None:
        """Test candidates until the answer is known or the budget is spent."""
        question = self.question
        for size in question.sizes:
            if self.spent >= self.budget:
                break
            candidate = Candidate(FleetConfig(size, self.strategy))
            self.candidates.append(candidate)
            if size in self.excluded:
                candidate.excluded, candidate.verdict = self.excluded[size], "fails"
                continue
            left = self.budget - self.spent
            self.test(candidate, max(question.fewest, left // MAX_POSTPONED))
            if candidate.verdict == "meets":
                break
        for candidate in self.candidates:
            if candidate.verdict == "undecided":
                self.test(candidate, self.budget)

    def test(self, candidate: Candidate, most: int) -> None:
        """Run a candidate until it is decided, has `most` more runs, or the budget is spent."""
        until = self.spent + most
        while candidate.verdict == "undecided":
            room = min(until, self.budget) - self.spent
            if room <= 0:
                return
            self.grow(candidate, min(room, round_of(candidate, self.question)))

    def grow(self, candidate: Candidate, number: int) -> None:
        """Do `number` more runs of a candidate."""
        runs = self.run(candidate.place, len(candidate.runs), number)
        self.spent += number
        candidate.add(runs, self.question)

    @property
    def answer(self) -> SearchAnswer:
        """The answer that the verdicts so far imply."""
        verdicts = {one.place.size: one.verdict for one in self.candidates}
        passing = next((n for n, verdict in verdicts.items() if verdict == "meets"), None)
        beyond = self.question.last + 1 if passing is None else passing
        unsure = [
            size
            for size in self.question.sizes
            if size < beyond and verdicts.get(size, "undecided") == "undecided"
        ]
        if unsure:
            return SearchAnswer("undecided", passing, unsure[0])
        return SearchAnswer("not reachable" if passing is None else "answered", passing, None)

    def find(self, size: int) -> Candidate | None:
        """The candidate of this size, if the search has reached it."""
        return next((one for one in self.candidates if one.place.size == size), None)


def round_of(candidate: Candidate, question: Question) -> int:
    """Number of runs of the next round. It depends on the candidate only, not on time or cores."""
    have = len(candidate.runs)
    if question.mean and have < question.fewest:
        return question.fewest - have
    return next(size for since, size in RUNS_PER_ROUND if have >= since)
