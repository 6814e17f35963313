"""The output of `automaton size`: a document, and curves for PNG and SVG.

The document has the question, the answer, and the method; candidates are drawn as intervals, one per
line. With several conditions a table of the answers comes first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from automaton.documents.report_document import (
    Block,
    Heading,
    Listed,
    ReportDocument,
    ShareBars,
    Table,
    Text,
)
from automaton.runs.metric_catalogue import (
    METRIC_CATALOGUE,
    TIME_TITLE,
    TIME_USES,
    mean_time_shares,
)
from automaton.studies.inference.proportions import expected_runs, fixed_runs, share_test
from automaton.studies.sizing.fleet_runs import FLEET_TICKS, MOVES_LATE, PERCENTS_OFF, TIME_OF
from automaton.studies.sizing.fleet_search import (
    DEFAULT_INDIFFERENCE,
    ROBOT_COUNT,
    Candidate,
    FleetConfig,
    FleetRun,
    FleetSearch,
    Question,
    Target,
    lost_by_cause,
    mean_of,
    shown,
)
from automaton.studies.sizing.sizing_figures import (
    USES,
    between,
    change_text,
    confidence,
    judged_by,
    mean_text,
    picture,
    shown_share,
    with_half,
    zone,
)
from automaton.studies.sizing.sizing_session import (
    TRIAL_RUNS,
    DayBound,
    MarginalGain,
    SensitivityResult,
    SizingSession,
    StrategySelection,
    around,
    bound_days,
)
from automaton.units import count, number, percent

VERDICT_NOTE = (
    "The verdict states the number of runs that decided it; other runs belong to the same round or to "
    "the comparisons below."
)
MAX_CAUSES = 4
MIN_SHARE_SHOWN = 0.0005  # of the robots' time
PER_TIME: Final = {"d": "day", "h": "hour", "min": "minute", "s": "second"}
FORECAST_MISSES: Final = (0.1, 0.2, 0.4, 0.6)  # true shares of misses, of the share allowed
FORECAST_RUNS: Final = 6000  # most runs of a fleet in a forecast


def answer_document(
    sessions: Mapping[str, SizingSession], name: str, ends: str, price: float
) -> ReportDocument:
    """The question, the answer, the candidates of each strategy, the follow-ups, and the method.

    `sessions`: one for each condition by name, or one without a name; `ends`: a sentence about when
    runs end; `price`: price of a robot, or 0.
    """
    first = next(iter(sessions.values()))
    document = ReportDocument(name, [Text(f"{name}: {asked(first.question)}")])
    if "" not in sessions:
        document.add(conditions_table(sessions))
    for condition, session in sessions.items():
        if condition:
            document.add(Heading(condition))
        document.add(*answer_blocks(session, price))
    document.add(Listed(list(method(sessions, ends))))
    return document


def asked(question: Question) -> str:
    """The question in words."""
    unit = question.target.in_unit(question.target.value)
    steady = f" after a warm-up of {count(question.warm_up, 'tick')}" if question.warm_up else ""
    target = f"{question.target.text} {unit}".strip()
    wanted = (
        f"on average {target}"
        if question.mean
        else f"{percent(question.success_share)} of runs have {target}"
    )
    return f"how many {question.quantity.noun}s so that {wanted}{steady}?"


def conditions_table(sessions: Mapping[str, SizingSession]) -> Table:
    """The answer of each condition: fleet, runs that decided it, and what it reaches on most days."""
    question = next(iter(sessions.values())).question
    share = f"on {shown_share(question.success_share)} of days"
    what = f"mean {question.target.metric}" if question.mean else f"share, {confidence(question)}"
    rows = []
    for condition, session in sessions.items():
        answers = "; ".join(
            (f"{label(search.strategy)}: " if len(question.strategies) > 1 else "")
            + sentence(search, session)
            for search in session.searches
        )
        found, bound = session.answered, session.bound
        value = judged_by(found, question) if found else None
        rows.append(
            [
                condition,
                answers or "not begun",
                "-"
                if value is None
                else with_half(value, question.target.unit)
                if question.mean
                else between(value),
                f"{session.spent:,}",
                reached(question.target, bound.value) if bound and bound.value is not None else "-",
            ]
        )
    return Table(("condition", "answer", what, "runs", share), rows, left=2)


def answer_blocks(session: SizingSession, price: float) -> Iterator[Block]:
    """The answer under one condition, its candidates and follow-ups."""
    question = session.question
    yield Listed(list(headline(session, price)), mark="")
    yield from bound_blocks(session)
    for search in session.searches:
        yield from search_blocks(search, session, len(question.strategies) > 1)
    yield Listed(best_lines(session.best, question), mark="")
    yield Listed(moved_lines(session, question))


def headline(session: SizingSession, price: float) -> Iterator[str]:
    """The answer for each strategy, in a sentence."""
    several = len(session.question.strategies) > 1
    for search in session.searches:
        who = f"{label(search.strategy)}: " if several else "Answer: "
        yield who + sentence(search, session) + priced(search, price) + unfinished(search)
    place, question = session.place, session.question
    if several and place is not None:
        known = "" if session.settled else " known to meet it"
        yield f"Smallest fleet{known}: {question.quantity.many(place.size)} with {label(place.strategy)}"
    if place is not None and not question.mean:
        yield promise(question, place.size)
    if not session.complete:
        yield "Interrupted: results so far"


def promise(question: Question, size: int) -> str:
    """What is shown of a fleet that passes, in one sentence."""
    share = f"at least {shown_share(question.success_share)}"
    if not question.assure:
        share = f"more than {shown_share(question.success_share - question.indifference)}"
    does = performance(question, size, question.target.value)
    sure = shown_share(1 - question.alpha)
    return f"{does[0].upper()}{does[1:]} on {share} of days, with {sure} confidence"


def performance(question: Question, size: int, value: float | None) -> str:
    """What a fleet does: "26 robots deliver 480 per hour or more"."""
    target, many = question.target, question.quantity.many(size)
    if value is None:
        return f"with {many} {target.metric} has no bound, because too many runs did not finish"
    if target.metric == "throughput" and question.quantity == ROBOT_COUNT:
        return f"{many} deliver{'s' if size == 1 else ''} {reached(target, value)}"
    return f"with {many} {target.metric} is {reached(target, value)}"


def reached(target: Target, value: float) -> str:
    """A value of the metric as a bound in the reader's unit: "480 per hour or more"."""
    return f"{in_readers_unit(target, value)} or {'less' if target.at_most else 'more'}"


def in_readers_unit(target: Target, value: float) -> str:
    """A value of the metric in the unit in which the target was given."""
    text = f"{number(value)} {target.unit}"
    if target.unit == "share":
        text = percent(value)
    elif target.time.startswith("/"):
        text = (
            f"{number(value / target.ticks)} per {PER_TIME.get(target.time[1:], target.time[1:])}"
        )
    elif target.time:
        text = f"{number(value / target.ticks)} {target.time}"
    return text


def bound_blocks(session: SizingSession) -> Iterator[Block]:
    """What the answer reaches on a share of days, and the command that shows the worst of them."""
    question, place, bound = session.question, session.place, session.bound
    if place is None:
        return
    share = f"On {shown_share(question.success_share)} of days"
    if bound is None:
        yield Text(f"{share}: not examined, {too_little(session, bound_days(question))}")
        return
    end = "highest" if question.target.at_most else "lowest"
    yield Text(
        f"{share} {performance(question, place.size, bound.value)} ({shown_share(1 - bound.error)} "
        f"confidence; the {ordinal(bound.rank)}{end} of {bound.days:,} further days)"
        f"{looser(question.target, bound)}"
    )
    command = session.watch(place, bound.worst)
    if command:
        value = "not finished"
        if bound.worst_value is not None:
            value = in_readers_unit(question.target, bound.worst_value)
        yield Text(f"The worst of these days ({value}):")
        yield Text(command, code=True)


def looser(target: Target, bound: DayBound) -> str:
    """Why a bound may be worse than the target that the fleet meets; "" if it is not."""
    if bound.value is not None and target.met(bound.value):
        return ""
    return (
        f". This bound comes from those days alone, with {shown_share(1 - bound.error)} confidence, so "
        f"it may be looser than {target.text}. It does not contradict the verdict, from other days"
    )


def ordinal(rank: int) -> str:
    """The place of a day from the worst one: "", "2nd ", "3rd ", "4th "."""
    tens = "th" if 10 <= rank % 100 <= 20 else {1: "st", 2: "nd", 3: "rd"}.get(rank % 10, "th")
    return "" if rank == 1 else f"{rank}{tens} "


def belief(session: SizingSession, place: FleetConfig) -> str:
    """What the runs so far say about a fleet: "40 robots: 57 of 60 days meet the target, undecided"."""
    question, fleet = session.question, session.question.quantity.many(place.size)
    if place.percent:
        return f"{fleet}, durations {place.percent:+d} %"
    searches = [one for one in session.searches if one.strategy == place.strategy]
    found = searches[0].find(place.size) if searches else None
    if found is None or not found.runs:
        return fleet
    return f"{fleet}: {evidence(found, question)}, {found.verdict}"


def forecast(question: Question) -> Iterator[str]:
    """How many days a fleet takes to pass with a sure share, with Wald's test, and if they are fixed."""
    share, error = question.success_share, question.alpha / question.candidates
    true = [1 - (1 - share) * part for part in FORECAST_MISSES]
    most = min(question.budget, FORECAST_RUNS)
    days = [
        f"{'more than ' if one.undecided > 0.5 else ''}{one.runs:,.0f}{{}} {shown_share(one.share)}"
        for one in expected_runs(question.share_test, true, most)
    ]
    yield (
        f"--assure: a fleet passes after about {days[0].format(' days if')} of its days meet the target, "
        f"{', '.join(one.format(' at') for one in days[1:])}"
    )
    if share + DEFAULT_INDIFFERENCE < 1:
        wald = expected_runs(share_test(share, DEFAULT_INDIFFERENCE, error), true, most)
        more = shown_share(share - DEFAULT_INDIFFERENCE)
        yield (
            f"without --assure, Wald's test shows more than {more} after "
            f"{', '.join(f'{one.runs:,.0f}' for one in wald)} days"
        )
    fixed = [f"{fixed_runs(share, error, misses):,}" for misses in range(4)]
    yield (
        f"a fixed number of days: {fixed[0]} without a miss, {fixed[1]} with one, {fixed[2]} with two, "
        f"{fixed[3]} with three"
    )


def label(strategy: str) -> str:
    """A strategy in words: "allocation cooperative"."""
    layer, _, choice = strategy.removeprefix("strategy.").partition("=")
    return f"{layer.replace('_', ' ')} {choice}" if strategy else "as in the scenario"


def sentence(search: FleetSearch, session: SizingSession) -> str:
    """The answer for one strategy, in words."""
    question, answer, many = session.question, search.answer, session.question.quantity.many
    if answer.kind == "answered":
        return many(answer.size or 0) + untried_text(search, answer.size or 0, question.step)
    if answer.kind == "not reachable":
        return f"not reachable up to {many(question.last)}"
    share = f"its share of the budget, {search.budget:,} runs, is spent"
    spent = share if len(question.strategies) > 1 else "the budget is spent"
    why = spent if session.complete else "interrupted"
    if answer.size:
        tested = [one for one in search.candidates if one.verdict == "undecided" and one.runs]
        known = [f"{one.place.size}: {evidence(one, question)}" for one in tested]
        enough = f"{many(answer.size)} are enough; undecided from {answer.least} to"
        return f"{enough} {answer.size - 1} ({'; '.join([*known, why])})"
    between = f"between {answer.least} and {question.last}, or more"
    if answer.least == question.last:
        between = f"whether {many(question.last)} are enough"
    return f"undecided {between} ({why})"


def evidence(candidate: Candidate, question: Question) -> str:
    """What the days of a fleet show: "421 of 451 days meet the target"."""
    if not question.mean:
        return f"{candidate.met(question):,} of {len(candidate.runs):,} days meet the target"
    mean = candidate.mean(question.target.metric)
    value = "-" if mean is None else number(mean.value)
    return f"mean {question.target.metric} {value} on {len(candidate.runs):,} days"


def untried_text(search: FleetSearch, size: int, step: int) -> str:
    """The sizes below an answer that a step leaves out: " (6 is too few; 7 was not tried)"."""
    smaller = [one.place.size for one in search.candidates if one.place.size < size]
    if step == 1 or not smaller or max(smaller) == size - 1:
        return ""
    below, first = max(smaller), max(smaller) + 1
    between = f"{first} to {size - 1} were" if first < size - 1 else f"{first} was"
    return f" ({below} {'is' if below == 1 else 'are'} too few; {between} not tried)"


def priced(search: FleetSearch, price: float) -> str:
    """The price of the answer's fleet, in words."""
    if not price or search.answer.size is None:
        return ""
    return f", {number(search.answer.size * price)} at {number(price)} each"


def unfinished(search: FleetSearch) -> str:
    """The number of unfinished runs of the answer's fleet, in words."""
    found = search.find(search.answer.size or 0)
    if found is None or not found.censored:
        return ""
    return f"; {found.censored:,} of {count(len(found.runs), 'run')} did not finish"


def search_blocks(search: FleetSearch, session: SizingSession, several: bool) -> Iterator[Block]:
    """The candidates of one strategy, and the lost time of the deciding one."""
    question = session.question
    if several:
        yield Heading(label(search.strategy), 3)
    yield candidates_table(search, question)
    yield Listed(list(candidate_notes(search, question)), mark="")
    yield Text("\n".join(picture(search, question)), code=True)
    lines = [
        f"{one.place.size}: fails without a run, {one.excluded}"
        for one in search.candidates
        if one.excluded
    ]
    shown_one = search.find(search.answer.size or 0) or last_run(search)
    if shown_one is not None and shown_one.runs:
        lines += spent_time(shown_one, question)
    gain = session.gains.get(search.strategy)
    if gain is not None:
        lines += gain_lines(gain, question)
    yield Listed(lines, mark="")
    yield from time_blocks(search, question, shown_one)


def time_blocks(
    search: FleetSearch, question: Question, decided: Candidate | None
) -> Iterator[Block]:
    """Where the time of the robots went with the deciding fleet and with the next ones."""
    ran = [one for one in search.candidates if one.runs]
    at = ran.index(decided) if decided in ran else 0
    bars = [
        (question.quantity.many(one.place.size), shares)
        for one in ran[max(0, at - 1) : at + 2]
        if (shares := mean_time_shares([run_time_shares(run) for run in one.runs]))
    ]
    if bars:
        block = ShareBars(TIME_TITLE, bars)
        yield from (Text(f"{TIME_TITLE[0].upper()}{TIME_TITLE[1:]}, in whole runs:"), block)
        yield block.table


def run_time_shares(run: FleetRun) -> list[tuple[str, float, str]]:
    """The parts of the robots' time in a run."""
    shares = ((name, run.figures.get(f"{TIME_OF}{name}"), part) for name, part in TIME_USES.items())
    return [(name, float(share), part.colour) for name, share, part in shares if share]


def candidate_notes(search: FleetSearch, question: Question) -> Iterator[str]:
    """Notes on the table of candidates."""
    if any(len(one.runs) > one.after for one in search.candidates if one.after):
        yield VERDICT_NOTE
    for one in search.candidates:
        lacking = one.unmeasured(question.target.metric)
        if lacking:
            what = f"{count(lacking, 'run')} without {question.target.metric}"
            yield (
                f"{one.place.size}: {what}, because nothing was completed; these runs miss the target"
            )


def last_run(search: FleetSearch) -> Candidate | None:
    """The largest candidate that was run."""
    return next((one for one in reversed(search.candidates) if one.runs), None)


def candidates_table(search: FleetSearch, question: Question) -> Table:
    """Robots, runs, runs that met the target, unfinished runs, share, mean, and verdict."""
    rows = []
    for one in search.candidates:
        mean_value = one.mean(question.target.metric)
        verdict = "fails (bound)" if one.excluded else one.verdict
        rows.append(
            [
                str(one.place.size),
                f"{len(one.runs):,}",
                f"{one.met(question):,}" if one.runs else "-",
                f"{one.censored:,}" if one.runs else "-",
                between(one.share(question).unless_vague()) if one.runs else "-",
                "-" if mean_value is None else with_half(mean_value, question.target.unit),
                verdict + (f" after {one.after:,}" if one.after and verdict != "undecided" else ""),
            ]
        )
    share = f"share, {confidence(question)}"
    heads = (
        f"{question.quantity.noun}s",
        "runs",
        "met",
        "unfinished",
        share,
        f"mean {question.target.metric}",
    )
    return Table((*heads, "verdict"), rows, left=0, also_left=(6,))


def spent_time(candidate: Candidate, question: Question) -> Iterator[str]:
    """Lost time by cause, and the utilization of robots, stations and chargers."""
    lost = sorted(lost_by_cause(candidate).items(), key=lambda item: -item[1])
    whole = mean_of(candidate, FLEET_TICKS)
    lost = [(name, ticks) for name, ticks in lost if ticks >= MIN_SHARE_SHOWN * whole]
    if lost and whole > 0:
        causes = [
            f"{percent(ticks / whole)} {METRIC_CATALOGUE[name][1].split(':')[0].split(',')[0]}"
            for name, ticks in lost[:MAX_CAUSES]
        ]
        fleet = question.quantity.many(candidate.place.size)
        yield f"Robot time lost with {fleet}: {'; '.join(causes)}"
    uses = [
        f"{what} {percent(mean_of(candidate, name))}"
        for name, what in USES.items()
        if not math.isnan(mean_of(candidate, name))
    ]
    if uses:
        yield f"Utilization: {', '.join(uses)}"


def gain_lines(gain: MarginalGain, question: Question) -> Iterator[str]:
    """The effect of the last robot on the metric."""
    last = question.quantity.many(question.step).removeprefix("1 ")
    last = f"The last {last} ({gain.size - question.step} -> {gain.size})"
    if gain.refused:
        yield f"{last}: not examined, {gain.refused}"
    if gain.effect is None:
        return
    effect, metric = gain.effect, question.target.metric
    relative = "" if effect.relative is None else f", {100 * effect.relative.value:+.1f} %"
    yield (
        f"{last} change{'s' if question.step == 1 else ''} mean {metric} by "
        f"{change_text(effect.difference, question.target.unit)}{relative}"
    )


def best_lines(best: StrategySelection | None, question: Question) -> list[str]:
    """The best strategy for a fleet size."""
    if best is None:
        return []
    found = zip(best.strategies, best.means, best.runs, strict=True)
    means = ", ".join(
        f"{label(name)} {number(mean)} ({count(runs, 'run')})" for name, mean, runs in found
    )
    zone = f"indifference zone {number(best.zone)}"
    head = f"With {question.quantity.many(best.size)} (Kim & Nelson; {zone}): {means}"
    if len(best.left) == 1:
        return [head, f"Best: {label(best.left[0])}"]
    return [head, f"No statistically significant difference: {', '.join(map(label, best.left))}"]


def moved_lines(session: SizingSession, question: Question) -> list[str]:
    """The answers under changed durations."""
    place = session.place
    if place is None:
        return []
    lines = []
    for percent_off in PERCENTS_OFF:
        how = f"Durations {abs(percent_off)} % {'longer' if percent_off > 0 else 'shorter'}: "
        moved = next((one for one in session.moved if one.percent == percent_off), None)
        if moved is not None:
            settings = changed(session.changes[percent_off])
            lines.append(f"{how}{moved_line(moved, question)} ({settings})")
        elif percent_off not in session.changes:
            lines.append(how + "not examined because they are too short to change by whole ticks")
        else:
            needed = TRIAL_RUNS * len(around(place, question))
            lines.append(how + f"not examined, {too_little(session, needed)}")
    return lines


def too_little(session: SizingSession, needed: int) -> str:
    """Why the answer was not followed up."""
    if not session.complete:
        return "interrupted"
    return f"{count(needed, 'run')} are needed, but only {session.left:,} of the budget are left"


def changed(settings: Sequence[str]) -> str:
    """Changed durations in words: "turn 24, pick 10, 10 % of moves a tick longer".

    Moves that are too short to change by whole ticks are mentioned as well.
    """
    as_they_are = (
        ""
        if any(setting.startswith((MOVES_LATE, "durations.move")) for setting in settings)
        else ", moves unchanged"
    )
    parts = [setting.removeprefix("durations.").replace("=", " ") for setting in settings]
    late = f"{MOVES_LATE}="
    return (
        ", ".join(
            f"{percent(float(part.partition(' ')[2]), 0)} of moves a tick longer"
            if setting.startswith(late)
            else part
            for setting, part in zip(settings, parts, strict=True)
        )
        + as_they_are
    )


def moved_line(moved: SensitivityResult, question: Question) -> str:
    """One sentence for a change of durations."""
    refused = [
        f"{one.place.size}: not examined, {one.refused}" for one in moved.around if one.refused
    ]
    if not moved.fleets:
        return "; ".join(refused)
    found = moved.smallest(question)
    shares = ", ".join(f"{moved_text(one, question)} with {one.place.size}" for one in moved.fleets)
    last = moved.fleets[-1].place.size
    many = question.quantity.many
    answer = f"more than {many(last)}" if found is None else many(found)
    if found == moved.fleets[0].place.size and found > 1:
        answer += " or fewer"
    runs = len(moved.fleets[0].runs)
    what = "mean" if question.mean else "target met by"
    told = f"{answer} ({what} {shares}; {runs} runs each)"
    return "; ".join([told, *refused])


def moved_text(candidate: Candidate, question: Question) -> str:
    """The deciding value of a candidate: the mean, or the share of runs that met the target."""
    if not question.mean:
        return percent(candidate.met(question) / len(candidate.runs), 0)
    mean = candidate.mean(question.target.metric)
    return "-" if mean is None else mean_text(mean.value, question.target.unit)


def method(sessions: Mapping[str, SizingSession], ends: str) -> Iterator[str]:
    """The meaning of the answer, the runs used, and the assumptions."""
    first = next(iter(sessions.values()))
    question = first.question
    sure = shown_share(1 - question.alpha)
    after = f" after the first {count(question.warm_up, 'tick')}" if question.warm_up else ""
    if question.mean:
        yield (f"Estimand: the mean of {question.target.metric}{after} over independent runs.")
        unit = question.target.in_unit(question.indifference)
        width = f"{shown(question.indifference)} {unit}".strip()
        yield (
            f"Indifference zone {width}: with {sure} confidence every fleet whose mean is better than "
            "the target by at least this amount passes, and every fleet that is worse by at least this "
            "amount fails; in between either verdict is possible."
        )
        test = "Batur & Kim's test on means of 10 runs (at least 20 means)"
    else:
        yield (
            f"Estimand: the share of independent runs (days) that reach {question.target.text}{after}; "
            f"required: {percent(question.success_share)}."
        )
        yield verdict_meaning(question, sure)
        test = "Wald's sequential test"
        if question.assure:
            test = (
                f"its confidence sequence of level {confidence(question)} (beta mixture, Robbins)"
            )
    yield (
        f"Each fleet is tested by {test} with error {question.alpha:g} / {question.candidates}; no "
        "result of a fleet is inferred from another fleet. Intervals of shares are confidence sequences, "
        "which stay valid under sequential stopping; intervals of means are for orientation only."
    )
    if first.bound is not None:
        yield (
            f"The bound for {shown_share(question.success_share)} of days is an order statistic of "
            f"{first.bound.days:,} runs that follow those of the verdict."
        )
    if len(sessions) > 1:
        yield (
            f"Each condition is a search of its own: {sure} confidence holds for each answer, not for "
            "all together. The same replication has the same seed under all conditions."
        )
    spent, budget = (
        sum(one.spent for one in sessions.values()),
        sum(one.question.budget for one in sessions.values()),
    )
    following = sum(one.after for one in sessions.values())
    yield f"Used {spent:,} of {budget:,} runs, {following:,} of them after the search. " + ends
    demand = "replication r has the same seed, and so the same demand, for every fleet"
    if first.same_orders:
        demand = (
            "replication r has the same seed for every fleet; all runs have the same listed orders, so "
            "the answer holds for these orders only"
        )
    yield (
        f"Assumptions: runs with different seeds are independent; {demand}; durations and orders are as "
        "in the scenario."
    )


def verdict_meaning(question: Question, sure: str) -> str:
    """What a verdict on a share shows."""
    if question.assure:
        share = shown_share(question.success_share)
        return (
            f"With {sure} confidence every fleet that passes meets the target on at least {share} of "
            "days, and every fleet that fails on fewer. There is no indifference zone, so a fleet whose "
            f"share is close to {share} takes many days."
        )
    low, high = zone(question)
    return (
        f"Indifference zone {question.indifference:g}: with {sure} confidence every fleet that "
        f"meets the target in {percent(high)} of runs or more passes, and every fleet that meets it in "
        f"{percent(low)} or fewer fails; in between either verdict is possible."
    )
