"""Successive elimination: rounds of paired runs, after each of which the best third goes on.

Each round has seeds of its own, the same for all candidates: they meet the same demand. Runs of a
scenario that never ends are shorter in early rounds. What is left in the end is run against the scenario
as it is with further seeds, so that what chose the winner says nothing of how good it is. Effort is
counted in runs, never in time; the answer depends on the budget and the seed alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import msgspec

from automaton.errors import InputError, nearest
from automaton.runs.headless import run_marked
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.metrics import metrics_of
from automaton.runs.process_pool import PersistentPool, Result
from automaton.runs.simulation import Simulation
from automaton.scenario.unavailable_metrics import not_measured, warm_up_of
from automaton.studies.inference.effects import Effect, effect
from automaton.studies.inference.intervals import Interval, mean_interval
from automaton.studies.reports.directions import direction_of
from automaton.studies.sizing.fleet_runs import replication_seeds
from automaton.studies.tuning.candidates import TunedScenarios
from automaton.world.resolve import Resolved

ELIMINATION_FACTOR: Final = 3  # of so many candidates one goes on to the next round
FULL_ROUNDS: Final = 2  # the last ones; each before them has runs of half the length,
MIN_LENGTH: Final = 0.25  # and at least this share of it
MIN_PAIRS: Final = 5  # of the winner and the scenario as it is


class TuningRound(NamedTuple):
    """What a round is to take."""

    candidates: int
    runs: int  # of each candidate
    length: float  # of a run, as a share


class RunPlan(NamedTuple):
    """What a budget of runs is spent on."""

    rounds: tuple[TuningRound, ...]
    pairs: int  # of the winner and the scenario as it is


@dataclass
class Standing:
    """What is known of a candidate."""

    number: int
    last_round: int = 0  # in which it was run, from 1
    runs: int = 0
    mean: float = math.nan  # of the metric in that round
    place: int = 0  # after it, from 1


@dataclass
class Tuned:
    """The answer."""

    metric: str
    budget: int
    seed: int
    standings: list[Standing] = field(default_factory=list)  # the best first
    spent: int = 0
    winner: Interval | None = None  # its mean, in runs of their own
    own: Interval | None = None  # that of the scenario as it is
    gain: Effect | None = None  # of the winner; None where that is the scenario as it is
    unfinished: int = 0  # of the last pairs, those in which a run did not finish


def measure(simulation: Simulation) -> dict[str, float | int]:
    """Run to the end; the metrics after the warm-up."""
    return metrics_of(simulation, run_marked(simulation).warm_up)


def check_metric(metric: str | None, own: Resolved) -> str:
    """The metric that decides: the one asked for, else throughput or, of runs that end, makespan.

    Raises InputError.
    """
    ends = own.scenario.stop.when != "never"
    if metric is None:
        return "makespan" if ends else "throughput"
    if metric not in METRIC_CATALOGUE:
        hint = nearest(metric, METRIC_CATALOGUE) or f"; there are {', '.join(METRIC_CATALOGUE)}"
        raise InputError(f"--metric: no metric is called '{metric}'{hint}")
    if metric == "makespan" and not ends:
        raise InputError("--metric: runs end at a given tick, so makespan is the same for all")
    if need := not_measured(own.scenario).get(metric):
        raise InputError(f"--metric: this scenario does not measure {metric}; it takes {need}")
    if direction_of(metric) is None:
        raise InputError(f"--metric: neither more nor less of {metric} is better")
    return metric


def make_plan(candidates: int, budget: int, ends: bool) -> RunPlan:
    """What so many runs are spent on. Raises InputError for a budget that is too small."""
    sizes = [candidates]
    while sizes[-1] > 1:
        sizes.append(math.ceil(sizes[-1] / ELIMINATION_FACTOR))
    sizes = sizes[:-1]
    least = sum(sizes) + 2 * MIN_PAIRS
    if budget < least:
        raise InputError(
            f"--budget {budget:,}: {candidates} candidates take {least:,} runs at least"
        )
    left = budget - max(2 * MIN_PAIRS, min(budget // 4, budget - sum(sizes)))
    rounds = []
    for number, size in enumerate(sizes):
        rest = len(sizes) - number
        share = max(size, min(left - sum(sizes[number + 1 :]), left // rest))
        shorter = 0 if ends else max(0, rest - FULL_ROUNDS)
        rounds.append(TuningRound(size, share // size, max(MIN_LENGTH, 0.5**shorter)))
        left -= share // size * size
    spent = sum(one.candidates * one.runs for one in rounds)
    return RunPlan(tuple(rounds), (budget - spent) // 2)


def tune(
    known: TunedScenarios,
    metric: str,
    budget: int,
    pool: PersistentPool,
    on_round: Callable[[TuningRound, int], None] = lambda now, spent: None,
) -> Tuned:
    """Find the candidate with the best mean of a metric; `on_round` is called before each round."""
    own = known.candidates[0].resolved
    ends = own.scenario.stop.when != "never"
    plan = make_plan(len(known.candidates), budget, ends)
    tuned = Tuned(metric, budget, own.scenario.seed)
    left = [Standing(number) for number in range(len(known.candidates))]
    first = 0  # replication of the round
    for number, now in enumerate(plan.rounds, start=1):
        on_round(now, tuned.spent)
        scenarios = [shortened(known.candidates[one.number].resolved, now.length) for one in left]
        seeds = replication_seeds(tuned.seed, first, now.runs)
        results = pool.run([(one, seed) for one in scenarios for seed in seeds])
        for place, one in enumerate(left):
            runs = results[place * now.runs : (place + 1) * now.runs]
            one.last_round, one.runs = number, one.runs + now.runs
            one.mean = mean_of(runs, metric)
        left.sort(key=lambda one: (rank(one.mean, metric), one.number))
        remaining = math.ceil(now.candidates / ELIMINATION_FACTOR)
        tuned.standings[:0] = left[remaining:]
        left = left[:remaining]
        tuned.spent += now.candidates * now.runs
        first += now.runs
    tuned.standings[:0] = left
    on_round(TuningRound(2, plan.pairs, 1.0), tuned.spent)
    compare(tuned, known, replication_seeds(tuned.seed, first, plan.pairs), pool)
    return tuned


def shortened(resolved: Resolved, share: float) -> Resolved:
    """The scenario with runs of a share of their length, after the warm-up."""
    scenario = resolved.scenario
    if share == 1:
        return resolved
    warm_up, limit = warm_up_of(scenario), scenario.stop.max_duration
    ticks = warm_up + max(1, round(share * (limit - warm_up)))
    stop = msgspec.structs.replace(scenario.stop, max_duration=ticks)
    return replace(resolved, scenario=msgspec.structs.replace(scenario, stop=stop))


def mean_of(runs: Sequence[Result], metric: str) -> float:
    """The mean of a metric; NaN if a run did not finish, or did not measure it."""
    if not all(run.finished and metric in run.metrics for run in runs):
        return math.nan
    return math.fsum(run.metrics[metric] for run in runs) / len(runs)


def rank(mean: float, metric: str) -> float:
    """What the best candidate has least of."""
    if math.isnan(mean):
        return math.inf
    return -mean if direction_of(metric) == "highest" else mean


def compare(
    tuned: Tuned, known: TunedScenarios, seeds: Sequence[int], pool: PersistentPool
) -> None:
    """Run the winner and the scenario as it is, with the same seeds."""
    best = tuned.standings[0].number
    both = [known.candidates[number].resolved for number in dict.fromkeys((best, 0))]
    results = pool.run([(one, seed) for one in both for seed in seeds])
    tuned.spent += len(results)
    pairs = [results[place :: len(seeds)] for place in range(len(seeds))]
    metric = tuned.metric
    measured = [pair for pair in pairs if not math.isnan(mean_of(pair, metric))]
    tuned.unfinished = len(pairs) - len(measured)
    if len(measured) < 2:
        return
    values = [[float(run.metrics[metric]) for run in runs] for runs in zip(*measured, strict=True)]
    tuned.winner, tuned.own = mean_interval(values[0]), mean_interval(values[-1])
    if best != 0:
        tuned.gain = effect(values[0], values[1], paired=True)
