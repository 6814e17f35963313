"""The answer of `automaton size` as text: the question, the answer, and how it was found."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.console import Console
from rich.table import Table

from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.run_report import plain_table, print_table
from automaton.studies.inference.intervals import Interval
from automaton.studies.sizing.candidates import Candidate, FleetConfig, lost_by_cause, mean_of
from automaton.studies.sizing.fleet_search import Search
from automaton.studies.sizing.follow_up import (
    MOVES_LATE,
    PERCENTS_OFF,
    TRIAL_RUNS,
    MarginalGain,
    SensitivityResult,
    StrategySelection,
    around,
)
from automaton.studies.sizing.question import Question, shown
from automaton.studies.sizing.sizing_charts import picture
from automaton.studies.sizing.sizing_session import SizingSession
from automaton.units import count, number, percent

USES = {
    "busiest_station_utilization": "the busiest station",
    "station_use": "robots at stations",
    "charger_use": "chargers",
    "utilization": "robots",
}
VERDICT_NOTE = (
    "A verdict falls after so many runs of a fleet; the others end its round, or are made for what "
    "follows."
)
MAX_CAUSES = 4
MIN_SHARE_SHOWN = 0.0005  # of the robots' time
REPORT_WIDTH = 100  # a table of metrics is not text to be folded


def print_answer(out: Console, session: SizingSession, name: str, ends: str, price: float) -> None:
    """Print everything. `ends`: when a run ends, in a sentence; `price` of a robot, or 0."""
    question = session.question
    unit = question.target.in_unit(question.target.value)
    steady = f" after a warm-up of {count(question.warm_up, 'tick')}" if question.warm_up else ""
    out.print(
        f"{name}: how many robots so that {f'{question.target.text} {unit}'.strip()}{steady}?",
        soft_wrap=True,
    )
    out.print()
    for line in headline(session, price):
        out.print(line, soft_wrap=True)
    for search in session.searches:
        out.print()
        out.width = max(out.width, REPORT_WIDTH)
        print_search(out, search, session, len(question.strategies) > 1)
    for lines in (best_lines(session.best), moved_lines(session, question)):
        if lines:
            out.print()
        for line in lines:
            out.print(line, soft_wrap=True)
    out.print()
    for line in method(session, ends):
        out.print(line, soft_wrap=True)


def headline(session: SizingSession, price: float) -> Iterator[str]:
    """The answer for each strategy, in a sentence."""
    several = len(session.question.strategies) > 1
    for search in session.searches:
        who = f"{label(search.strategy)}: " if several else "Answer: "
        yield who + sentence(search, session) + priced(search, price) + unfinished(search)
    place = session.place
    if several and place is not None:
        known = "" if session.settled else " known to meet it"
        yield f"Smallest fleet{known}: {count(place.robots, 'robot')} with {label(place.strategy)}"
    if not session.complete:
        yield "Interrupted: what follows is what was known then"


def label(strategy: str) -> str:
    """A strategy in words: "allocation cooperative"."""
    layer, _, choice = strategy.removeprefix("strategy.").partition("=")
    return f"{layer.replace('_', ' ')} {choice}" if strategy else "as the scenario says"


def sentence(search: Search, session: SizingSession) -> str:
    """What is known of one strategy."""
    answer, last = search.answer, session.question.last
    if answer.kind == "answered":
        return count(answer.robots or 0, "robot")
    if answer.kind == "not reachable":
        return f"not reachable up to {count(last, 'robot')}"
    upper = f"{answer.robots}" if answer.robots else f"{last}, or more"
    share = f"its {search.budget:,} runs of the budget are spent"
    spent = share if len(session.question.strategies) > 1 else "the budget is spent"
    why = spent if session.complete else "interrupted"
    return f"undecided between {answer.least} and {upper} ({why})"


def priced(search: Search, price: float) -> str:
    """What the answer costs."""
    if not price or search.answer.robots is None:
        return ""
    return f", {number(search.answer.robots * price)} at {number(price)} each"


def unfinished(search: Search) -> str:
    """How many runs of the answer did not finish."""
    found = search.find(search.answer.robots or 0)
    if found is None or not found.censored:
        return ""
    return f"; {found.censored:,} of {count(len(found.runs), 'run')} did not finish"


def print_search(out: Console, search: Search, session: SizingSession, several: bool) -> None:
    """The candidates of one strategy, one by one, and what the deciding one loses time with."""
    question = session.question
    if several:
        out.print(label(search.strategy))
    print_table(out, candidates_table(search, question))
    if any(len(one.runs) > one.after for one in search.candidates if one.after):
        out.print(VERDICT_NOTE, soft_wrap=True)
    for one in search.candidates:
        lacking = one.unmeasured(question.target.metric)
        if lacking:
            what = f"{count(lacking, 'run')} without {question.target.metric}, since nothing ended"
            out.print(f"{one.place.robots}: {what}; such runs miss the target", soft_wrap=True)
    for line in picture(search, question):
        out.print(line, soft_wrap=True, highlight=False)
    for one in search.candidates:
        if one.excluded:
            out.print(f"{one.place.robots}: fails without a run, {one.excluded}", soft_wrap=True)
    shown_one = search.find(search.answer.robots or 0) or last_run(search)
    if shown_one is not None and shown_one.runs:
        for line in spent_time(shown_one):
            out.print(line, soft_wrap=True)
    gain = session.gains.get(search.strategy)
    if gain is not None:
        for line in gain_lines(gain, question):
            out.print(line, soft_wrap=True)


def last_run(search: Search) -> Candidate | None:
    """The largest candidate that was run."""
    return next((one for one in reversed(search.candidates) if one.runs), None)


def candidates_table(search: Search, question: Question) -> Table:
    """Robots, runs, how many met the target, the interval of the share, the mean, the verdict."""
    level = percent(1 - question.alpha, 0)
    table = plain_table(
        "robots", "runs", "met", "unfinished", f"share, {level}", f"mean {question.target.metric}"
    )
    table.add_column("verdict", no_wrap=True)
    for one in search.candidates:
        mean = one.mean(question.target.metric)
        verdict = "fails (bound)" if one.excluded else one.verdict
        table.add_row(
            str(one.place.robots),
            f"{len(one.runs):,}",
            f"{one.met(question):,}" if one.runs else "-",
            f"{one.censored:,}" if one.runs else "-",
            between(one.share(question)) if one.runs else "-",
            "-" if mean is None else with_half(mean),
            verdict + (f" after {one.after:,}" if one.after and verdict != "undecided" else ""),
        )
    return table


def between(interval: Interval) -> str:
    """A share with its interval."""
    low, high = interval.low or 0.0, 1.0 if interval.high is None else interval.high
    return f"{interval.value:.3f} ({low:.3f} to {high:.3f})"


def with_half(interval: Interval) -> str:
    """A mean with half of its interval."""
    half = interval.half
    return number(interval.value) + ("" if half is None else f" +- {number(half)}")


def spent_time(candidate: Candidate) -> Iterator[str]:
    """What a run loses time with, by cause, and how busy robots, stations and chargers are."""
    robots = candidate.place.robots
    lost = sorted(lost_by_cause(candidate).items(), key=lambda item: -item[1])
    whole = robots * mean_of(candidate, "measured")
    lost = [(name, ticks) for name, ticks in lost if ticks >= MIN_SHARE_SHOWN * whole]
    if lost and whole > 0:
        causes = [
            f"{percent(ticks / whole)} {METRIC_CATALOGUE[name][1].split(':')[0].split(',')[0]}"
            for name, ticks in lost[:MAX_CAUSES]
        ]
        yield f"Robot time lost with {count(robots, 'robot')}: {'; '.join(causes)}"
    uses = [
        f"{what} {percent(mean_of(candidate, name))}"
        for name, what in USES.items()
        if not math.isnan(mean_of(candidate, name))
    ]
    if uses:
        yield f"Time in use: {', '.join(uses)}"


def gain_lines(gain: MarginalGain, question: Question) -> Iterator[str]:
    """What the last robot does for the metric."""
    if gain.refused:
        yield f"The last robot ({gain.robots - 1} -> {gain.robots}): not examined, {gain.refused}"
    if gain.effect is None:
        return
    effect, metric = gain.effect, question.target.metric
    relative = "" if effect.relative is None else f", {100 * effect.relative.value:+.1f} %"
    yield (
        f"The last robot ({gain.robots - 1} -> {gain.robots}) changes mean {metric} by "
        f"{interval_text(effect.difference)}{relative}"
    )


def interval_text(interval: Interval) -> str:
    """A difference with its interval."""
    if interval.low is None or interval.high is None:
        return f"{interval.value:+,.4g}"
    return f"{interval.value:+,.4g} ({interval.low:+,.4g} to {interval.high:+,.4g})"


def best_lines(best: StrategySelection | None) -> list[str]:
    """Which strategy is best with the same number of robots."""
    if best is None:
        return []
    found = zip(best.strategies, best.means, best.runs, strict=True)
    means = ", ".join(
        f"{label(name)} {number(mean)} ({count(runs, 'run')})" for name, mean, runs in found
    )
    zone = f"differences below {number(best.zone)} do not matter"
    head = f"With {count(best.robots, 'robot')} (Kim & Nelson; {zone}): {means}"
    if len(best.left) == 1:
        return [head, f"Best: {label(best.left[0])}"]
    return [head, f"Not told apart: {', '.join(map(label, best.left))}"]


def moved_lines(session: SizingSession, question: Question) -> list[str]:
    """How the answer moves if durations are off."""
    place = session.place
    if place is None:
        return []
    lines = []
    for percent_off in PERCENTS_OFF:
        how = f"Durations {abs(percent_off)} % {'longer' if percent_off > 0 else 'shorter'}: "
        moved = next((one for one in session.moved if one.percent == percent_off), None)
        if moved is not None:
            lines.append(how + moved_line(moved, question))
            lines.append(f"  ({changed(session.changes[percent_off])})")
        elif percent_off not in session.changes:
            lines.append(how + "not examined, they are too short for that in whole ticks")
        else:
            lines.append(how + f"not examined, {too_little(session, place)}")
    return lines


def too_little(session: SizingSession, place: FleetConfig) -> str:
    """Why durations were not varied."""
    if not session.complete:
        return "interrupted"
    needed = TRIAL_RUNS * len(around(place, session.question))
    left = session.question.budget - session.spent
    return f"which takes {count(needed, 'run')}: {left:,} of the budget are left"


def changed(settings: Sequence[str]) -> str:
    """What makes durations longer or shorter: "turn 24, pick 10, moves a tick longer in 10 %"."""
    parts = [setting.removeprefix("durations.").replace("=", " ") for setting in settings]
    late = f"{MOVES_LATE}="
    return ", ".join(
        f"moves a tick longer in {percent(float(part.partition(' ')[2]), 0)}"
        if setting.startswith(late)
        else part
        for setting, part in zip(settings, parts, strict=True)
    )


def moved_line(moved: SensitivityResult, question: Question) -> str:
    """One sentence for a change of durations."""
    refused = [
        f"{one.place.robots}: not examined, {one.refused}" for one in moved.around if one.refused
    ]
    if not moved.fleets:
        return "; ".join(refused)
    found = moved.smallest(question)
    shares = ", ".join(
        f"{one.place.robots}: "
        + (
            f"{number(mean.value) if (mean := one.mean(question.target.metric)) else '-'}"
            if question.mean
            else f"{percent(one.met(question) / len(one.runs), 0)}"
        )
        for one in moved.fleets
    )
    last = moved.fleets[-1].place.robots
    answer = f"more than {last} robots" if found is None else count(found, "robot")
    if found == moved.fleets[0].place.robots and found > 1:
        answer += " or fewer"
    runs = len(moved.fleets[0].runs)
    what = "mean" if question.mean else "share"
    told = f"{answer} ({what} by robots, {runs} runs each: {shares})"
    return "; ".join([told, *refused])


def method(session: SizingSession, ends: str) -> Iterator[str]:
    """What the answer means, what was spent, and what it rests on."""
    question = session.question
    sure = percent(1 - question.alpha, 0)
    after = f" after the first {count(question.warm_up, 'tick')}" if question.warm_up else ""
    if question.mean:
        yield (
            f"Estimand: the mean of {question.target.metric}{after} over runs with seeds of their own."
        )
        zone = f"{shown(question.indifference)} {question.target.in_unit(question.indifference)}".strip()
        yield (
            f"Zone {zone}: with probability {sure} every fleet whose mean is better than the "
            "target by that much passes and every one worse by that much fails; between them either "
            "may happen."
        )
        test = "Batur & Kim's region on means of 10 runs, 20 of them at first"
    else:
        yield (
            f"Estimand: the share of runs, each with a seed of its own, that reach {question.target.text}"
            f"{after}; wanted {percent(question.success_share)}."
        )
        low, high = (
            question.success_share - question.indifference,
            question.success_share + question.indifference,
        )
        yield (
            f"Zone {question.indifference:g}: with probability {sure} every fleet that reaches it in "
            f"{percent(high)} of runs or more passes and every one in {percent(low)} or fewer fails; "
            "between them either may happen."
        )
        test = "Wald's sequential test"
    yield (
        f"Each fleet by {test}, error {question.alpha:g} / {question.candidates} each; none is "
        "inferred from "
        "another. Intervals of shares are confidence sequences, which stopping does not spoil; "
        "means are for orientation."
    )
    yield (
        f"Spent {session.spent:,} of {question.budget:,} runs, "
        f"{session.after:,} of them after the search. " + ends
    )
    demand = "replication r has the same seed, and so the same demand, for every fleet"
    if session.same_orders:
        demand = (
            "replication r has the same seed for every fleet; the demand is the same in all runs, "
            "since the orders are listed, so the answer holds for these orders alone"
        )
    yield (
        f"Assumed: runs with different seeds are independent; {demand}; durations and orders are as "
        "the scenario says."
    )
