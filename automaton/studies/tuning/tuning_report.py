"""Report on tuned settings: a table, one object as JSON, a file of settings."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

from automaton.runs.console_output import ConsoleBlock
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.report_document import Table
from automaton.studies.inference.intervals import Interval
from automaton.studies.reports.directions import direction_of
from automaton.studies.tuning.candidates import TUNED_LAYERS, Choice, TunedScenarios, in_words
from automaton.studies.tuning.elimination import Tuned
from automaton.units import count

TABLE_HEADS = ("place", "round", "runs", "mean", "right of way; allocation")


def report_blocks(tuned: Tuned, known: TunedScenarios) -> Iterator[ConsoleBlock]:
    """The report, from top to bottom."""
    scenario, metric = known.candidates[0].resolved.scenario, tuned.metric
    better = "more" if direction_of(metric) == "highest" else "less"
    yield (
        f"{scenario.name}, seed {tuned.seed}: {count(len(known.candidates), 'candidate')}, "
        f"{count(tuned.spent, 'run')} of at most {tuned.budget:,}, by {metric} "
        f"({METRIC_CATALOGUE[metric][0]}; {better} is better)"
    )
    for reason in known.left_out:
        yield f"left out: {reason}"
    yield ""
    yield Table(TABLE_HEADS, list(rows(tuned, known)), left=0, also_left=(4,), folded=True)
    yield "round: the last one in which it was run; means of different rounds are of different runs"
    yield conclusion(tuned)
    for setting in known.candidates[tuned.standings[0].number].settings:
        yield f"  --set '{setting}'"


def rows(tuned: Tuned, known: TunedScenarios) -> Iterator[list[str]]:
    """A row for each candidate, the best first."""
    for place, one in enumerate(tuned.standings, start=1):
        choices = "; ".join(map(in_words, known.candidates[one.number].choices))
        mean = "unfinished" if math.isnan(one.mean) else shown(one.mean)
        as_it_is = "" if one.number else " (as it is)"
        yield [f"{place}", f"{one.last_round}", f"{one.runs}", mean, choices + as_it_is]


def conclusion(tuned: Tuned) -> str:
    """What the last runs say of the winner."""
    if tuned.winner is None or tuned.own is None:
        return f"Runs did not finish in {tuned.unfinished} of the last pairs: no interval is known"
    runs = f"{count(tuned.winner.n, 'run')} with seeds of their own, 95 %"
    if tuned.gain is None:
        return f"The best is the scenario as it is: {tuned.metric} {with_ends(tuned.own)}, {runs}"
    by = with_ends(tuned.gain.difference)
    low, high = tuned.gain.difference.low, tuned.gain.difference.high
    is_shown = low is not None and high is not None and (low > 0 or high < 0)
    head = "The best" if is_shown else "Not shown to be better than the scenario as it is"
    text = f"{head}: {tuned.metric} {with_ends(tuned.winner)}, as it is {with_ends(tuned.own)}; "
    if tuned.gain.relative is not None:
        by += f", {100 * tuned.gain.relative.value:+,.1f} %"
    return f"{text}difference {by}; {runs}"


def with_ends(interval: Interval) -> str:
    """A mean with the ends of its interval."""
    if interval.low is None or interval.high is None:
        return shown(interval.value)
    return f"{shown(interval.value)} ({shown(interval.low)} to {shown(interval.high)})"


def shown(value: float) -> str:
    """A number with four digits, or all before the point."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def as_json(tuned: Tuned, known: TunedScenarios) -> dict[str, Any]:
    """Everything, as one object."""
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
    """An interval as JSON has it."""
    if interval is None:
        return None
    return {"value": interval.value, "low": interval.low, "high": interval.high, "n": interval.n}


def best_choices(known: TunedScenarios, number: int) -> dict[str, Choice]:
    """The strategies of a candidate, by layer."""
    return dict(zip(TUNED_LAYERS, known.candidates[number].choices, strict=True))


def settings_file(tuned: Tuned, known: TunedScenarios) -> str:
    """The winner as a file for `--set @FILE`."""
    best = best_choices(known, tuned.standings[0].number)
    lines = [f"  {layer}: {json.dumps(choice)}" for layer, choice in best.items()]
    name = known.candidates[0].resolved.scenario.name
    return "\n".join((f"# {name}: {conclusion(tuned)}", "strategy:", *lines, ""))
