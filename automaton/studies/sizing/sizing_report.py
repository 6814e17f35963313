"""The output of `automaton size`: a document, curves for PNG and SVG, a JSON object, and a table.

The document has the question, the answer, and the method; candidates are drawn as intervals, one per
line. Times in JSON are in ticks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from automaton.documents.report_document import (
    Block,
    Curves,
    Heading,
    Listed,
    ReportCurve,
    ReportDocument,
    Table,
    Text,
)
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.studies.inference.intervals import Interval
from automaton.studies.sizing.fleet_search import (
    Candidate,
    FleetConfig,
    FleetSearch,
    Question,
    lost_by_cause,
    mean_of,
    shown,
)
from automaton.studies.sizing.sizing_session import (
    MOVES_LATE,
    PERCENTS_OFF,
    TRIAL_RUNS,
    MarginalGain,
    SensitivityResult,
    SizingSession,
    StrategySelection,
    around,
)
from automaton.units import count, number, percent

if TYPE_CHECKING:
    import pyarrow as pa


USES = {
    "busiest_station_utilization": "the busiest station",
    "station_use": "robots at stations",
    "charger_use": "chargers",
    "utilization": "robots",
}
VERDICT_NOTE = (
    "The verdict states the number of runs that decided it; other runs belong to the same round or to "
    "the comparisons below."
)
MAX_CAUSES = 4
MIN_SHARE_SHOWN = 0.0005  # of the robots' time
CHART_WIDTH: Final = 61  # characters of the scale
MARK_VALUE, MARK_INTERVAL, MARK_TARGET = "o", "-", "|"
ROW_KEYS = ("robots", "runs", "met", "unfinished", "verdict", "after", "excluded")


def answer_document(session: SizingSession, name: str, ends: str, price: float) -> ReportDocument:
    """The question, the answer, the candidates of each strategy, the follow-ups, and the method.

    `ends`: a sentence about when runs end; `price`: price of a robot, or 0.
    """
    question = session.question
    unit = question.target.in_unit(question.target.value)
    steady = f" after a warm-up of {count(question.warm_up, 'tick')}" if question.warm_up else ""
    target = f"{question.target.text} {unit}".strip()
    wanted = (
        f"on average {target}"
        if question.mean
        else f"{percent(question.success_share)} of runs have {target}"
    )
    asked = f"{name}: how many robots so that {wanted}{steady}?"
    document = ReportDocument(name, [Text(asked), Listed(list(headline(session, price)), mark="")])
    for search in session.searches:
        document.add(*search_blocks(search, session, len(question.strategies) > 1))
    document.add(Listed(best_lines(session.best), mark=""))
    document.add(Listed(moved_lines(session, question)), Listed(list(method(session, ends))))
    return document


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
        yield "Interrupted: results so far"


def label(strategy: str) -> str:
    """A strategy in words: "allocation cooperative"."""
    layer, _, choice = strategy.removeprefix("strategy.").partition("=")
    return f"{layer.replace('_', ' ')} {choice}" if strategy else "as in the scenario"


def sentence(search: FleetSearch, session: SizingSession) -> str:
    """The answer for one strategy, in words."""
    answer, last = search.answer, session.question.last
    if answer.kind == "answered":
        return count(answer.robots or 0, "robot")
    if answer.kind == "not reachable":
        return f"not reachable up to {count(last, 'robot')}"
    upper = f"{answer.robots}" if answer.robots else f"{last}, or more"
    share = f"its share of the budget, {search.budget:,} runs, is spent"
    spent = share if len(session.question.strategies) > 1 else "the budget is spent"
    why = spent if session.complete else "interrupted"
    return f"undecided between {answer.least} and {upper} ({why})"


def priced(search: FleetSearch, price: float) -> str:
    """The price of the answer's fleet, in words."""
    if not price or search.answer.robots is None:
        return ""
    return f", {number(search.answer.robots * price)} at {number(price)} each"


def unfinished(search: FleetSearch) -> str:
    """The number of unfinished runs of the answer's fleet, in words."""
    found = search.find(search.answer.robots or 0)
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
        f"{one.place.robots}: fails without a run, {one.excluded}"
        for one in search.candidates
        if one.excluded
    ]
    shown_one = search.find(search.answer.robots or 0) or last_run(search)
    if shown_one is not None and shown_one.runs:
        lines += spent_time(shown_one)
    gain = session.gains.get(search.strategy)
    if gain is not None:
        lines += gain_lines(gain, question)
    yield Listed(lines, mark="")


def candidate_notes(search: FleetSearch, question: Question) -> Iterator[str]:
    """Notes on the table of candidates."""
    if any(len(one.runs) > one.after for one in search.candidates if one.after):
        yield VERDICT_NOTE
    for one in search.candidates:
        lacking = one.unmeasured(question.target.metric)
        if lacking:
            what = f"{count(lacking, 'run')} without {question.target.metric}"
            yield (
                f"{one.place.robots}: {what}, because nothing was completed; these runs miss the target"
            )


def last_run(search: FleetSearch) -> Candidate | None:
    """The largest candidate that was run."""
    return next((one for one in reversed(search.candidates) if one.runs), None)


def candidates_table(search: FleetSearch, question: Question) -> Table:
    """Robots, runs, runs that met the target, unfinished runs, share, mean, and verdict."""
    rows = []
    for one in search.candidates:
        mean = one.mean(question.target.metric)
        verdict = "fails (bound)" if one.excluded else one.verdict
        rows.append(
            [
                str(one.place.robots),
                f"{len(one.runs):,}",
                f"{one.met(question):,}" if one.runs else "-",
                f"{one.censored:,}" if one.runs else "-",
                between(one.share(question)) if one.runs else "-",
                "-" if mean is None else with_half(mean, question.target.unit),
                verdict + (f" after {one.after:,}" if one.after and verdict != "undecided" else ""),
            ]
        )
    share = f"share, {percent(1 - question.alpha, 0)}"
    heads = ("robots", "runs", "met", "unfinished", share, f"mean {question.target.metric}")
    return Table((*heads, "verdict"), rows, left=0, also_left=(6,))


def between(interval: Interval) -> str:
    """A share with its interval."""
    low, high = interval.low or 0.0, 1.0 if interval.high is None else interval.high
    return f"{percent(interval.value)} ({100 * low:.1f} to {100 * high:.1f})"


def with_half(interval: Interval, unit: str) -> str:
    """A mean with its half-width, or with the ends of an interval that is cut off at 0."""
    value, low, high = interval.value, interval.low, interval.high
    text = mean_text(value, unit)
    if low is None or high is None:
        return text
    if low == 0 and high > 2 * value:
        return f"{text} (0 to {mean_text(high, unit)})"
    return f"{text} +- {mean_text(high - value, unit)}"


def mean_text(value: float, unit: str) -> str:
    """A mean of a metric; a share in percent."""
    return f"{number(100 * value)} %" if unit == "share" else number(value)


def spent_time(candidate: Candidate) -> Iterator[str]:
    """Lost time by cause, and the utilization of robots, stations and chargers."""
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
        yield f"Utilization: {', '.join(uses)}"


def gain_lines(gain: MarginalGain, question: Question) -> Iterator[str]:
    """The effect of the last robot on the metric."""
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
    """The best strategy for a fleet size."""
    if best is None:
        return []
    found = zip(best.strategies, best.means, best.runs, strict=True)
    means = ", ".join(
        f"{label(name)} {number(mean)} ({count(runs, 'run')})" for name, mean, runs in found
    )
    zone = f"indifference zone {number(best.zone)}"
    head = f"With {count(best.robots, 'robot')} (Kim & Nelson; {zone}): {means}"
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
            lines.append(how + f"not examined, {too_little(session, place)}")
    return lines


def too_little(session: SizingSession, place: FleetConfig) -> str:
    """Why durations were not varied."""
    if not session.complete:
        return "interrupted"
    needed = TRIAL_RUNS * len(around(place, session.question))
    left = session.question.budget - session.spent
    return f"{count(needed, 'run')} are needed, but only {left:,} of the budget are left"


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
        f"{one.place.robots}: not examined, {one.refused}" for one in moved.around if one.refused
    ]
    if not moved.fleets:
        return "; ".join(refused)
    found = moved.smallest(question)
    shares = ", ".join(f"{one.place.robots}: {moved_text(one, question)}" for one in moved.fleets)
    last = moved.fleets[-1].place.robots
    answer = f"more than {last} robots" if found is None else count(found, "robot")
    if found == moved.fleets[0].place.robots and found > 1:
        answer += " or fewer"
    runs = len(moved.fleets[0].runs)
    what = "mean" if question.mean else "share"
    told = f"{answer} ({what} by robots, {runs} runs each: {shares})"
    return "; ".join([told, *refused])


def moved_text(candidate: Candidate, question: Question) -> str:
    """The deciding value of a candidate: the mean, or the share of runs that met the target."""
    if not question.mean:
        return percent(candidate.met(question) / len(candidate.runs), 0)
    mean = candidate.mean(question.target.metric)
    return "-" if mean is None else mean_text(mean.value, question.target.unit)


def method(session: SizingSession, ends: str) -> Iterator[str]:
    """The meaning of the answer, the runs used, and the assumptions."""
    question = session.question
    sure = percent(1 - question.alpha, 0)
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
            f"Estimand: the share of independent runs that reach {question.target.text}{after}; "
            f"required: {percent(question.success_share)}."
        )
        low, high = zone(question)
        yield (
            f"Indifference zone {question.indifference:g}: with {sure} confidence every fleet that "
            f"reaches it in {percent(high)} of runs or more passes and every fleet in {percent(low)} "
            "or fewer fails; in between either verdict is possible."
        )
        test = "Wald's sequential test"
    yield (
        f"Each fleet is tested by {test} with error {question.alpha:g} / {question.candidates}; no fleet "
        "is inferred from another. Intervals of shares are confidence sequences, which stay valid under "
        "sequential stopping; intervals of means are for orientation only."
    )
    yield (
        f"Used {session.spent:,} of {question.budget:,} runs, "
        f"{session.after:,} of them after the search. " + ends
    )
    demand = "replication r has the same seed, and so the same demand, for every fleet"
    if session.same_orders:
        demand = (
            "replication r has the same seed for every fleet; all runs have the same listed orders, so "
            "the answer holds for these orders only"
        )
    yield (
        f"Assumptions: runs with different seeds are independent; {demand}; durations and orders are as "
        "in the scenario."
    )


def picture(search: FleetSearch, question: Question) -> Iterator[str]:
    """One line for each candidate that was run: its value and interval, and the indifference zone."""
    judged = [(one, judged_by(one, question)) for one in search.candidates if one.runs]
    found = [(one, interval) for one, interval in judged if interval is not None]
    if not found:
        return
    least, most = zone(question)
    low, high = scale([interval for _, interval in found], question)
    what = f"mean {question.target.metric}" if question.mean else "share"
    confidence = percent(1 - question.alpha, 0)
    yield f"robots  {what} with its {confidence} interval; {MARK_TARGET} indifference zone"
    for one, interval in found:
        line = drawn(interval, (least, most), low, high)
        yield f"{one.place.robots:6}  {line.rstrip()}"
    ends = (shown(low), shown(high)) if question.mean else (percent(low, 0), percent(high, 0))
    yield f"        {ends[0]}{ends[1]:>{CHART_WIDTH - len(ends[0])}}"


def judged_by(candidate: Candidate, question: Question) -> Interval | None:
    """The deciding value of a candidate: the share of runs that meet the target, or the mean."""
    return candidate.mean(question.target.metric) if question.mean else candidate.share(question)


def zone(question: Question) -> tuple[float, float]:
    """The ends of the indifference zone, between which either verdict is possible."""
    centre = question.target.value if question.mean else question.success_share
    return centre - question.indifference, centre + question.indifference


def scale(intervals: list[Interval], question: Question) -> tuple[float, float]:
    """The ends of the scale: 0 and 1 for shares, else a range that contains all means and the zone."""
    if not question.mean:
        return 0.0, 1.0
    reached = [
        end for one in intervals for end in (one.value, one.low, one.high) if end is not None
    ]
    return math.floor(min(*reached, *zone(question))), math.ceil(max(*reached, *zone(question)))


def drawn(interval: Interval, marks: tuple[float, float], low: float, high: float) -> str:
    """An interval on a scale from low to high."""

    def column(value: float) -> int:
        inside = min(max((value - low) / (high - low), 0.0), 1.0)
        return round(inside * (CHART_WIDTH - 1))

    cells = [" "] * CHART_WIDTH
    if interval.low is not None and interval.high is not None:
        for at in range(column(interval.low), column(interval.high) + 1):
            cells[at] = MARK_INTERVAL
    for mark in marks:
        cells[column(mark)] = MARK_TARGET
    cells[column(interval.value)] = MARK_VALUE
    return "".join(cells)


def curves(session: SizingSession) -> list[Curves]:
    """Curves over fleet size: share of runs that meet the target, and mean of its metric."""
    question = session.question
    metric, ends = question.target.metric, [float(question.first), float(question.last)]
    shares = [strategy_line(search, question, False, 100) for search in session.searches]
    wanted_percent = 100 * question.success_share
    scale_of_mean, unit = (
        (100, "%") if question.target.unit == "share" else (1, question.target.unit)
    )
    wanted = (
        []
        if question.mean
        else [level(f"wanted {percent(question.success_share, 0)}", ends, wanted_percent)]
    )
    means = [strategy_line(search, question, True, scale_of_mean) for search in session.searches]
    value = scale_of_mean * question.target.value
    target = level(f"target {shown(value)}", ends, value)
    return [
        Curves(
            f"share of runs with {question.target.text}",
            "robots",
            "%",
            [*shares, *wanted],
            from_zero=True,
        ),
        Curves(
            f"mean {metric} by robots",
            "robots",
            unit,
            [*means, target],
            from_zero=True,
        ),
    ]


def strategy_line(search: FleetSearch, question: Question, mean: bool, scale: float) -> ReportCurve:
    """The candidates of one strategy that were run; values are multiplied by `scale`."""
    found: list[tuple[int, Interval]] = []
    for one in search.candidates:
        interval = one.mean(question.target.metric) if mean else one.share(question)
        if one.runs and interval is not None:
            found.append((one.place.robots, interval))
    name = search.strategy.partition("=")[2]
    value = [scale * one.value for _, one in found]
    low = [scale * (one.value if one.low is None else one.low) for _, one in found]
    high = [scale * (one.value if one.high is None else one.high) for _, one in found]
    return ReportCurve(name, [float(robots) for robots, _ in found], value, low, high)


def level(name: str, ends: list[float], value: float) -> ReportCurve:
    """A horizontal line."""
    return ReportCurve(name, ends, [value] * 2, [value] * 2, [value] * 2)


# The answer as JSON and as a Python object.


@dataclass(frozen=True)
class SizingResult:
    """The answer of a sizing session."""

    robots: int | None  # the smallest fleet that meets the target, as far as known
    strategy: str | None  # the setting with which it does; "": the scenario's own
    settled: bool  # whether no smaller fleet may yet meet it
    record: dict[str, Any]  # everything, as `automaton size --json` prints it

    @property
    def candidates(self) -> pa.Table:
        """The tested fleets, one row for each; needs pyarrow (extra `experiments`)."""
        from automaton.studies.sweeps.result_store import arrow

        rows = [
            {"strategy": answer["strategy"], **flat(candidate)}
            for answer in self.record["answers"]
            for candidate in answer["candidates"]
        ]
        return arrow().Table.from_pylist(rows)


def flat(candidate: dict[str, Any]) -> dict[str, Any]:
    """A candidate of the JSON object as a row, with intervals as three columns."""
    row = {name: candidate[name] for name in ROW_KEYS}
    for name in ("share", "mean"):
        interval = candidate[name] or {}
        row[name] = interval.get("value")
        row |= {f"{name}_{end}": interval.get(end) for end in ("low", "high")}
    return row


def sized(session: SizingSession, name: str, seed: int) -> SizingResult:
    """The answer of a session."""
    record = as_json(session, name, seed, 0.0)
    return SizingResult(record["robots"], record["strategy"], record["settled"], record)


def as_json(session: SizingSession, name: str, seed: int, price: float) -> dict[str, Any]:
    """The content of the report as JSON; independent of the number of workers."""
    question, place = session.question, session.place
    return {
        "scenario": name,
        "seed": seed,
        "target": {
            "metric": question.target.metric,
            "sense": "<=" if question.target.at_most else ">=",
            "value": question.target.value,
            "unit": question.target.unit,
        },
        "estimand": "mean" if question.mean else "share",
        "warm_up": question.warm_up,
        "success_share": None if question.mean else question.success_share,
        "indifference": question.indifference,
        "alpha": question.alpha,
        "candidates": question.candidates,
        "budget": question.budget,
        "spent": session.spent,
        "complete": session.complete,
        "same_orders": session.same_orders,
        "robots": None if place is None else place.robots,
        "strategy": None if place is None else place.strategy,
        "settled": session.settled,
        "price": place.robots * price if price and place is not None else None,
        "answers": [search_as_json(one, session) for one in session.searches],
        "best": plain(session.best),
        "sensitivity": [moved_as_json(moved, question) for moved in session.moved],
    }


def search_as_json(search: FleetSearch, session: SizingSession) -> dict[str, Any]:
    """One strategy."""
    gain = session.gains.get(search.strategy)
    return {
        "strategy": search.strategy,
        **search.answer._asdict(),
        "spent": search.spent,
        "candidates": [candidate_as_json(one, session.question) for one in search.candidates],
        "gain": None if gain is None else gain_as_json(gain),
    }


def candidate_as_json(candidate: Candidate, question: Question) -> dict[str, Any]:
    """One fleet."""
    share = candidate.share(question)
    mean = candidate.mean(question.target.metric)
    return {
        "robots": candidate.place.robots,
        "runs": len(candidate.runs),
        "met": candidate.met(question),
        "unfinished": candidate.censored,
        "verdict": candidate.verdict,
        "after": candidate.after,
        "excluded": candidate.excluded or None,
        "refused": candidate.refused or None,
        "share": plain(share) if candidate.runs else None,
        "mean": plain(mean),
        "lost": lost_by_cause(candidate),
        "use": {
            what: mean_of(candidate, name)
            for name, what in USES.items()
            if any(name in run.figures for run in candidate.runs)
        },
    }


def gain_as_json(gain: MarginalGain) -> dict[str, Any]:
    """The effect of the last robot: difference with interval, correlation and variance ratio."""
    return {"robots": gain.robots, "refused": gain.refused or None, "effect": plain(gain.effect)}


def plain(value: Any) -> Any:
    """Nested named tuples as JSON objects."""
    if not hasattr(value, "_asdict"):
        return value
    return {name: plain(one) for name, one in value._asdict().items()}


def moved_as_json(moved: SensitivityResult, question: Question) -> dict[str, Any]:
    """The fleets around the answer under changed durations, as JSON objects."""
    return {
        "percent": moved.percent,
        "smallest": moved.smallest(question),
        "fleets": [candidate_as_json(one, question) for one in moved.around],
    }
