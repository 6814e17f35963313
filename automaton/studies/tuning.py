"""Tuning: the best strategies and parameters for a scenario, found by successive elimination.

For right of way and allocation, all strategies that declare values to try are tested. The parameters of
a strategy declare them with the method `tuned_values(scenario, floor_plan)`, which returns the values of
each parameter to try, or {} to try the strategy with its defaults. Strategies without the method are not
tested. A candidate is a combination of both layers; the first candidate is the unchanged scenario.

Each round has its own seeds, which all candidates share, so that they meet the same demand. The best
third advances. Scenarios without an end have shorter runs in early rounds. The winner is finally
compared with the unchanged scenario on new seeds, so that the runs that selected it do not bias its
result. Effort is counted in runs, not in time; the answer depends only on the budget and the seed.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from automaton.documents.report_document import INDENT, Listed, ReportDocument, Table
from automaton.errors import InputError, nearest
from automaton.runs.headless import run_marked
from automaton.runs.metric_catalogue import METRIC_CATALOGUE, OF_DELIVERED_ORDERS, UNEQUAL_SHARE
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.document import Override
from automaton.scenario.unavailable_metrics import not_measured, warm_up_of
from automaton.strategy import lookup
from automaton.studies.inference.intervals import TOO_FEW, Effect, Interval, effect, mean_interval
from automaton.studies.process_pool import PersistentPool, RunResult, run_all
from automaton.studies.reports.comparisons import direction_of
from automaton.studies.sweeps.run_keys import replication_seeds
from automaton.units import count
from automaton.world.resolve import Resolved, resolve

TUNED_LAYERS: Final = ("right_of_way", "allocation")
Choice = dict[str, Any]  # a strategy as scenarios write it: {name: NAME, ...parameters}
ELIMINATION_FACTOR: Final = 3  # one in this number of candidates advances to the next round
FULL_ROUNDS: Final = 2  # last rounds, with runs of full length; each round before halves the length
MIN_LENGTH: Final = 0.25  # least length of runs, as a share of the full length
MIN_PAIRS: Final = 5  # least number of runs that compare winner and unchanged scenario


class TunedScenario(NamedTuple):
    """A scenario with a strategy for each tuned layer."""

    choices: tuple[Choice, ...]  # by TUNED_LAYERS
    resolved: Resolved

    @property
    def settings(self) -> list[str]:
        """The values of --set that turn the scenario into this candidate."""
        pairs = zip(TUNED_LAYERS, self.choices, strict=True)
        return [f"strategy.{layer}={json.dumps(choice)}" for layer, choice in pairs]


class TunedScenarios(NamedTuple):
    """All candidates of a scenario, and those that it rejects."""

    candidates: tuple[TunedScenario, ...]  # the first is the unchanged scenario
    left_out: tuple[str, ...]  # a sentence for each reason of rejection


def candidates_of(
    scenario: str | Path, settings: Sequence[str | Override], seed: int | None = None
) -> TunedScenarios:
    """The candidates of a scenario. Raises InputError if the unchanged scenario cannot be run."""
    own = resolve(scenario, settings, seed)
    candidates = [TunedScenario(tuple(own_choice(own, layer) for layer in TUNED_LAYERS), own)]
    known, reasons = [played(own)], dict[str, None]()
    for choices in itertools.product(*(list(options(own, layer)) for layer in TUNED_LAYERS)):
        changes = [
            Override(f"strategy.{layer}", ("strategy", layer), choice)
            for layer, choice in zip(TUNED_LAYERS, choices, strict=True)
        ]
        try:
            resolved = resolve(scenario, (*settings, *changes), seed)
        except InputError as error:
            reasons[error.message] = None
            continue
        if played(resolved) not in known:
            known.append(played(resolved))
            candidates.append(TunedScenario(choices, resolved))
    return TunedScenarios(tuple(candidates), tuple(reasons))


def options(own: Resolved, layer: str) -> Iterator[Choice]:
    """Every strategy of a layer that declares values to try, with each combination of the values."""
    for name in lookup.names(layer):
        kind: Any = lookup.parameters_type(layer, name)
        if not hasattr(kind, "tuned_values"):
            continue
        usual = kind()
        values = usual.tuned_values(own.scenario, own.floor_plan)
        for combination in itertools.product(*values.values()):
            pairs = zip(values, combination, strict=True)
            yield {"name": name} | {key: one for key, one in pairs if one != getattr(usual, key)}


def own_choice(resolved: Resolved, layer: str) -> Choice:
    """The scenario's own strategy of a layer, in the notation of scenarios."""
    spec = msgspec.to_builtins(getattr(resolved.scenario.strategy, layer))
    return dict(spec) if isinstance(spec, dict) else {"name": spec}


def played(resolved: Resolved) -> list[tuple[str, Any]]:
    """What two candidates differ in."""
    chosen = (resolved.strategies[layer] for layer in TUNED_LAYERS)
    return [(one.name, one.parameters) for one in chosen]


def in_words(choice: Choice) -> str:
    """A strategy as a table shows it: "epibt, guidance lattice"."""
    parameters = (f"{key} {value}" for key, value in choice.items() if key != "name")
    return ", ".join((str(choice["name"]), *parameters))


# The rounds.


class TuningRound(NamedTuple):
    """The size of a round."""

    candidates: int
    runs: int  # of each candidate
    length: float  # of a run, as a share of the full length


class RunPlan(NamedTuple):
    """The use of a budget of runs."""

    rounds: tuple[TuningRound, ...]
    pairs: int  # runs that compare the winner with the unchanged scenario


@dataclass
class Standing:
    """The results of a candidate so far."""

    number: int
    last_round: int = 0  # last round in which it was run, from 1
    runs: int = 0
    mean: float = math.nan  # of the metric in the last round
    place: int = 0  # rank after the last round, from 1


@dataclass
class Tuned:
    """The result of tuning."""

    metric: str
    budget: int
    seed: int
    standings: list[Standing] = field(default_factory=list)  # the best first
    spent: int = 0
    winner: Interval | None = None  # mean of the winner in the final runs
    own: Interval | None = None  # mean of the unchanged scenario in the final runs
    gain: Effect | None = None  # winner against unchanged scenario; None if they are the same
    unfinished: int = 0  # final pairs in which a run did not finish
    lost: int = 0  # of them, those in which the winner did not finish
    delivered: tuple[float, float] = (0, 0)  # orders in the final runs: winner, unchanged scenario


def measure(simulation: Simulation) -> dict[str, float | int]:
    """Run to the end; return the metrics after the warm-up."""
    return metrics_of(simulation, run_marked(simulation).warm_up)


def check_metric(metric: str | None, own: Resolved) -> str:
    """The metric to optimize: `metric`, else makespan for runs that end and throughput for others.

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
        raise InputError(f"--metric: this scenario does not measure {metric}; it needs {need}")
    if direction_of(metric) is None:
        raise InputError(f"--metric: {metric} has no better direction")
    return metric


def make_plan(candidates: int, budget: int, ends: bool) -> RunPlan:
    """Divide a budget of runs among rounds. Raises InputError if the budget is too small."""
    sizes = [candidates]
    while sizes[-1] > 1:
        sizes.append(math.ceil(sizes[-1] / ELIMINATION_FACTOR))
    sizes = sizes[:-1]
    least = sum(sizes) + 2 * MIN_PAIRS
    if budget < least:
        raise InputError(
            f"--budget {budget:,}: {candidates} candidates need at least {least:,} runs"
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
    first = 0  # first replication of the round
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
    """The scenario with its run length after the warm-up reduced to a share."""
    scenario = resolved.scenario
    if share == 1:
        return resolved
    warm_up, limit = warm_up_of(scenario), scenario.stop.max_duration
    ticks = warm_up + max(1, round(share * (limit - warm_up)))
    stop = msgspec.structs.replace(scenario.stop, max_duration=ticks)
    return replace(resolved, scenario=msgspec.structs.replace(scenario, stop=stop))


def mean_of(runs: Sequence[RunResult], metric: str) -> float:
    """The mean of a metric; NaN if a run did not finish or did not measure it."""
    if not all(run.finished and metric in run.metrics for run in runs):
        return math.nan
    return math.fsum(run.metrics[metric] for run in runs) / len(runs)


def rank(mean: float, metric: str) -> float:
    """The sort key of a mean: lowest for the best candidate."""
    if math.isnan(mean):
        return math.inf
    return -mean if direction_of(metric) == "highest" else mean


def compare(
    tuned: Tuned, known: TunedScenarios, seeds: Sequence[int], pool: PersistentPool
) -> None:
    """Run the winner and the unchanged scenario with the same seeds."""
    best = tuned.standings[0].number
    both = [known.candidates[number].resolved for number in dict.fromkeys((best, 0))]
    results = pool.run([(one, seed) for one in both for seed in seeds])
    tuned.spent += len(results)
    pairs = [results[place :: len(seeds)] for place in range(len(seeds))]
    metric = tuned.metric
    measured = [pair for pair in pairs if not math.isnan(mean_of(pair, metric))]
    tuned.unfinished = len(pairs) - len(measured)
    tuned.lost = sum(math.isnan(mean_of(pair[:1], metric)) for pair in pairs)
    if len(measured) < 2:
        return
    of_winner, *_ = of_each = list(zip(*measured, strict=True))
    tuned.delivered = number_delivered(of_winner), number_delivered(of_each[-1])
    values = [[float(run.metrics[metric]) for run in runs] for runs in zip(*measured, strict=True)]
    tuned.winner, tuned.own = (mean_interval(one).unless_vague() for one in (values[0], values[-1]))
    if best != 0:
        tuned.gain = effect(values[0], values[1], paired=True)


def number_delivered(runs: Iterable[RunResult]) -> float:
    """The number of orders that these runs delivered."""
    return math.fsum(run.metrics["delivered"] for run in runs)


# The result as a report, as JSON, and as a settings file.


def tuning_document(tuned: Tuned, known: TunedScenarios) -> ReportDocument:
    """The report as a document."""
    scenario, metric = known.candidates[0].resolved.scenario, tuned.metric
    better = "more" if direction_of(metric) == "highest" else "less"
    document = ReportDocument(f"{scenario.name}, tuned")
    begin = (
        f"{scenario.name}, seed {tuned.seed}: {count(len(known.candidates), 'candidate')}, "
        f"{count(tuned.spent, 'run')} of at most {tuned.budget:,}, by {metric} "
        f"({METRIC_CATALOGUE[metric][0]}; {better} is better)"
    )
    left_out = [f"left out: {reason}" for reason in known.left_out]
    document.add(Listed([begin, *left_out], mark=""))
    heads = ("place", "round", "runs", "mean", "right of way; allocation")
    document.add(Table(heads, list(rows(tuned, known)), left=0, also_left=(4,)))
    note = "round: last round of the candidate; means of different rounds come from different runs"
    document.add(Listed([note, conclusion(tuned)], mark=""))
    settings = known.candidates[tuned.standings[0].number].settings
    document.add(Listed([f"--set '{setting}'" for setting in settings], mark=INDENT))
    return document


def rows(tuned: Tuned, known: TunedScenarios) -> Iterator[list[str]]:
    """A row for each candidate, from best to worst."""
    for place, one in enumerate(tuned.standings, start=1):
        choices = "; ".join(map(in_words, known.candidates[one.number].choices))
        mean = "unfinished" if math.isnan(one.mean) else shown(one.mean, tuned.metric)
        as_it_is = "" if one.number else " (unchanged)"
        yield [f"{place}", f"{one.last_round}", f"{one.runs}", mean, choices + as_it_is]


def conclusion(tuned: Tuned) -> str:
    """A sentence about the winner, from the final runs."""
    metric = tuned.metric
    if tuned.winner is None or tuned.own is None:
        return f"Runs did not finish in {tuned.unfinished} of the final pairs: no interval is known"
    runs = f"{count(tuned.winner.n, 'run')} with new seeds, 95 % confidence"
    if tuned.gain is None:
        best = with_ends(tuned.own, metric)
        return f"The unchanged scenario is best: {metric} {best}, {runs}"
    by = with_ends(tuned.gain.difference, metric)
    if METRIC_CATALOGUE[metric][0] == "share":
        by = f"{by.replace(' %', '')} percentage points"
    is_shown = tuned.gain.p < 1 - tuned.gain.difference.level
    head = "Best" if is_shown else "No statistically significant gain over the unchanged scenario"
    if is_shown and tuned.lost:
        head = f"Unclear, because the winner did not finish in {tuned.lost} of its final runs"
    winner, own = with_ends(tuned.winner, metric), with_ends(tuned.own, metric)
    text = f"{head}: {metric} {winner}, unchanged {own}; "
    if tuned.gain.relative is not None:
        by += f", {100 * tuned.gain.relative.value:+,.1f} %"
    return f"{text}difference {by}; {runs}{delivery_caveat(tuned)}"


def delivery_caveat(tuned: Tuned) -> str:
    """The caveat that both deliver different numbers of orders, if the metric is of those only."""
    winner, own = tuned.delivered
    more = (winner - own) / own if own else 0.0
    if tuned.metric not in OF_DELIVERED_ORDERS or abs(more) < UNEQUAL_SHARE:
        return ""
    return (
        f". Caveat: the winner delivered {100 * abs(more):.0f} % {'more' if more > 0 else 'fewer'} "
        f"orders, and {tuned.metric} counts delivered orders only"
    )


def with_ends(interval: Interval, metric: str) -> str:
    """A mean with its interval."""
    value = shown(interval.value, metric)
    if interval.low is None or interval.high is None:
        return f"{value} ({TOO_FEW})"
    return f"{value} ({shown(interval.low, metric)} to {shown(interval.high, metric)})"


def shown(value: float, metric: str) -> str:
    """A number with four significant digits, or all digits before the point; a share in percent."""
    if METRIC_CATALOGUE[metric][0] == "share":
        return f"{100 * value:.4g} %"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def as_json(tuned: Tuned, known: TunedScenarios) -> dict[str, Any]:
    """The result as a JSON object."""
    gain = tuned.gain
    return {
        "scenario": known.candidates[0].resolved.scenario.name,
        "seed": tuned.seed,
        "metric": tuned.metric,
        "budget": tuned.budget,
        "spent": tuned.spent,
        "left_out": list(known.left_out),
        "candidates": [
            {
                "strategy": best_choices(known, one.number),
                "as_it_is": one.number == 0,
                "round": one.last_round,
                "runs": one.runs,
                "mean": None if math.isnan(one.mean) else one.mean,
            }
            for one in tuned.standings
        ],
        "winner": ends_of(tuned.winner),
        "as_it_is": ends_of(tuned.own),
        "difference": None if gain is None else ends_of(gain.difference),
        "relative": None if gain is None else ends_of(gain.relative),
        "unfinished": tuned.unfinished,
    }


def ends_of(interval: Interval | None) -> dict[str, Any] | None:
    """An interval as a JSON object."""
    if interval is None:
        return None
    return {"value": interval.value, "low": interval.low, "high": interval.high, "n": interval.n}


def best_choices(known: TunedScenarios, number: int) -> dict[str, Choice]:
    """The strategies of a candidate, by layer."""
    return dict(zip(TUNED_LAYERS, known.candidates[number].choices, strict=True))


def settings_file(tuned: Tuned, known: TunedScenarios) -> str:
    """The winner as the content of a file for `--set @FILE`."""
    best = best_choices(known, tuned.standings[0].number)
    lines = [f"  {layer}: {json.dumps(choice)}" for layer, choice in best.items()]
    name = known.candidates[0].resolved.scenario.name
    return "\n".join((f"# {name}: {conclusion(tuned)}", "strategy:", *lines, ""))


# Pairs of runs of two models with the same seeds: by how much does a result depend on the model?


COMPARED: Final = {"throughput": 1, "lead_time": -1}  # power of time, in ticks
SAME_MODEL: Final = 0.01  # relative difference below which two models count as one


class Change(NamedTuple):
    """A relative difference, with the ends of its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def matters(self) -> bool:
        """Whether the difference is large enough, and not by chance."""
        return abs(self.value) >= SAME_MODEL and not self.low <= 0 <= self.high

    def __str__(self) -> str:
        return f"{self.value:+.1%} ({self.low:+.1%} to {self.high:+.1%})"


def compare_pairs(
    first: Resolved,
    second: Resolved,
    pairs: int,
    workers: int | None,
    on_done: Callable[[int], None] = lambda done: None,
) -> dict[str, Change]:
    """By how much `second` differs from `first` in each metric that both measure; at least 2 pairs."""
    seeds = replication_seeds(first.scenario.seed, 0, pairs)
    results = run_all([first, second], seeds, workers, on_done, measure)
    finer = second.scenario.refine / first.scenario.refine
    out = {}
    for metric, power in COMPARED.items():
        values = [[run.metrics.get(metric) for run in runs] for runs in results]
        if any(value is None for some in values for value in some):
            continue
        a, b = ([float(value or 0) for value in some] for some in values)
        relative = effect([one * finer**power for one in b], a, paired=True).relative
        if relative is not None and relative.low is not None and relative.high is not None:
            out[metric] = Change(relative.value, relative.low, relative.high)
    return out
