"""The answer of `automaton size` for eyes and programs: intervals drawn as text, curves, JSON.

Times in JSON are in ticks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from automaton.documents.report_document import (
    Curves,
    Listed,
    ReportCurve,
    ReportDocument,
    Table,
    Text,
)
from automaton.studies.inference.intervals import STUDENT_MIN_RUNS, TOO_FEW, Effect, Interval
from automaton.studies.sizing.fleet_search import (
    PARKING,
    Candidate,
    FleetSearch,
    Question,
    lost_by_cause,
    mean_of,
    shown,
)
from automaton.studies.sizing.sizing_session import (
    PARKING_ZONE,
    DayBound,
    MarginalGain,
    ParkingSession,
    SensitivityResult,
    SizingSession,
)
from automaton.studies.sweeps.run_keys import replication_seeds
from automaton.units import number, percent

if TYPE_CHECKING:
    import pyarrow as pa

USES = {
    "busiest_station_utilization": "the busiest station",
    "station_use": "robots at stations",
    "charger_use": "chargers",
    "utilization": "robots",
}
ROW_KEYS = ("robots", "runs", "met", "unfinished", "verdict", "after", "excluded")
CHART_WIDTH: Final = 61  # characters of the scale
MARK_VALUE, MARK_INTERVAL, MARK_TARGET = "o", "-", "|"


def shown_share(share: float) -> str:
    """A share as percent with the digits that it has."""
    return f"{100 * share:.6g} %"


def confidence(question: Question) -> str:
    """The level of the interval of a share, as percent with the digits that it has."""
    return shown_share(question.level)


def picture(search: FleetSearch, question: Question) -> Iterator[str]:
    """One line for each candidate that was run: its value and interval, and the indifference zone."""
    judged = [(one, judged_by(one, question)) for one in search.candidates if one.runs]
    drawable = [(one, interval) for one, interval in judged if interval is not None]
    if not drawable:
        return
    least, most = zone(question)
    low, high = scale([interval for _, interval in drawable], question)
    what = f"mean {question.target.metric}" if question.mean else "share"
    marks = "required share" if question.assure else "indifference zone"
    head = f"{question.quantity.noun}s"
    yield f"{head}  {what} with its {confidence(question)} interval; {MARK_TARGET} {marks}"
    for one, interval in drawable:
        line = drawn(interval, (least, most), low, high)
        yield f"{one.place.size:{len(head)}}  {line.rstrip()}"
    ends = (shown(low), shown(high)) if question.mean else (percent(low, 0), percent(high, 0))
    yield f"{'':{len(head) + 2}}{ends[0]}{ends[1]:>{CHART_WIDTH - len(ends[0])}}"


def judged_by(candidate: Candidate, question: Question) -> Interval | None:
    """The deciding value of a candidate: the share of runs that meet the target, or the mean."""
    return candidate.mean(question.target.metric) if question.mean else candidate.share(question)


def zone(question: Question) -> tuple[float, float]:
    """The ends of the indifference zone, between which either verdict is possible."""
    centre = question.target.value if question.mean else question.success_share
    if question.assure:
        return centre, centre
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


def curves(session: SizingSession, condition: str = "") -> list[Curves]:
    """Curves over fleet size: share of runs that meet the target, and mean of its metric."""
    under, sizes = f"{condition}: " if condition else "", f"{session.question.quantity.noun}s"
    question = session.question
    metric, ends = question.target.metric, [float(question.first), float(question.last)]
    is_share = question.target.unit == "share"
    factor, unit = (100, "%") if is_share else (1, question.target.unit)
    shares = [strategy_line(search, question, False, 100) for search in session.searches]
    means = [strategy_line(search, question, True, factor) for search in session.searches]
    share = question.success_share
    wanted = [] if question.mean else [level(f"wanted {percent(share, 0)}", ends, 100 * share)]
    value = factor * question.target.value
    target = level(f"target {shown(value)}", ends, value)
    return [
        Curves(
            f"{under}share of runs with {question.target.text}",
            sizes,
            "%",
            [*shares, *wanted],
            from_zero=True,
        ),
        Curves(
            f"{under}mean {metric} by {sizes}",
            sizes,
            unit,
            [*means, target],
            from_zero=True,
        ),
    ]


def strategy_line(search: FleetSearch, question: Question, mean: bool, scale: float) -> ReportCurve:
    """The candidates of one strategy that were run; values are multiplied by `scale`."""
    drawable: list[tuple[int, Interval]] = []
    for one in search.candidates:
        interval = one.mean(question.target.metric) if mean else one.share(question)
        if one.runs and interval is not None:
            drawable.append((one.place.size, interval))
    name = search.strategy.partition("=")[2]
    value = [scale * one.value for _, one in drawable]
    low = [scale * (one.value if one.low is None else one.low) for _, one in drawable]
    high = [scale * (one.value if one.high is None else one.high) for _, one in drawable]
    return ReportCurve(name, [float(robots) for robots, _ in drawable], value, low, high)


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
    record = as_json({"": session}, name, seed, 0.0)
    return SizingResult(record["robots"], record["strategy"], record["settled"], record)


def as_json(
    sessions: Mapping[str, SizingSession], name: str, seed: int, price: float
) -> dict[str, Any]:
    """The content of the report as JSON; independent of the number of workers."""
    head = {"scenario": name, "seed": seed}
    if "" in sessions:
        return head | session_as_json(sessions[""], seed, price)
    answers = [
        {"name": condition, **session_as_json(session, seed, price)}
        for condition, session in sessions.items()
    ]
    return head | {"conditions": answers}


def session_as_json(session: SizingSession, seed: int, price: float) -> dict[str, Any]:
    """The question and its answer under one condition."""
    question, place = session.question, session.place
    return {
        "varied": question.quantity.key,
        "target": {
            "metric": question.target.metric,
            "sense": "<=" if question.target.at_most else ">=",
            "value": question.target.value,
            "unit": question.target.unit,
        },
        "estimand": "mean" if question.mean else "share",
        "warm_up": question.warm_up,
        "assure": question.assure,
        "success_share": None if question.mean else question.success_share,
        "indifference": None if question.assure else question.indifference,
        "alpha": question.alpha,
        "candidates": question.candidates,
        "budget": question.budget,
        "spent": session.spent,
        "complete": session.complete,
        "same_orders": session.same_orders,
        size_key(question): None if place is None else place.size,
        "strategy": None if place is None else place.strategy,
        "settled": session.settled,
        "price": place.size * price if price and place is not None else None,
        "answers": [search_as_json(one, session) for one in session.searches],
        "best": plain(session.best),
        "bound": bound_as_json(session.bound, seed),
        "sensitivity": [moved_as_json(moved, question) for moved in session.moved],
    }


def search_as_json(search: FleetSearch, session: SizingSession) -> dict[str, Any]:
    """One strategy."""
    gain, answer = session.gains.get(search.strategy), search.answer
    return {
        "strategy": search.strategy,
        "kind": answer.kind,
        size_key(session.question): answer.size,
        "least": answer.least,
        "spent": search.spent,
        "candidates": [candidate_as_json(one, session.question) for one in search.candidates],
        "gain": None if gain is None else gain_as_json(gain, session.question),
    }


def candidate_as_json(candidate: Candidate, question: Question) -> dict[str, Any]:
    """One fleet."""
    share = candidate.share(question)
    mean = candidate.mean(question.target.metric)
    return {
        size_key(question): candidate.place.size,
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


def size_key(question: Question) -> str:
    """The key of a number of what the search varies: "robots", "stations" or "chargers"."""
    return f"{question.quantity.noun}s"


def between(interval: Interval) -> str:
    """A share with its interval."""
    if interval.low is None or interval.high is None:
        return f"{percent(interval.value)} ({TOO_FEW})"
    return f"{percent(interval.value)} ({100 * interval.low:.1f} to {100 * interval.high:.1f})"


def with_half(interval: Interval, unit: str) -> str:
    """A mean with its half-width, or with the ends of an interval that is cut off at 0."""
    value, low, high = interval.value, interval.low, interval.high
    text = mean_text(value, unit)
    if low is None or high is None:
        return f"{text} ({TOO_FEW})"
    if low == 0 and high > 2 * value:
        return f"{text} (0 to {mean_text(high, unit)})"
    return f"{text} +- {mean_text(high - value, unit)}"


def mean_text(value: float, unit: str) -> str:
    """A mean of a metric; a share in percent."""
    return f"{number(100 * value)} %" if unit == "share" else number(value)


def change_text(difference: Interval, unit: str) -> str:
    """A difference of means with its interval; of shares, in percentage points."""
    if unit != "share":
        return interval_text(difference)
    low, high = (None if end is None else 100 * end for end in (difference.low, difference.high))
    points = difference._replace(value=100 * difference.value, low=low, high=high)
    return f"{interval_text(points)} percentage points"


def interval_text(interval: Interval) -> str:
    """A difference with its interval."""
    if interval.low is None or interval.high is None:
        return f"{interval.value:+,.4g} ({TOO_FEW})"
    return f"{interval.value:+,.4g} ({interval.low:+,.4g} to {interval.high:+,.4g})"


def gain_as_json(gain: MarginalGain, question: Question) -> dict[str, Any]:
    """The effect of the last robot: difference with interval, correlation and variance ratio."""
    return {
        size_key(question): gain.size,
        "refused": gain.refused or None,
        "effect": plain(gain.effect),
    }


def bound_as_json(bound: DayBound | None, seed: int) -> dict[str, Any] | None:
    """What the answer reaches on a share of days, with the seed of the worst day."""
    if bound is None:
        return None
    [worst] = replication_seeds(seed, bound.worst, 1)
    return {**bound._asdict(), "worst": worst}


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


# Parking a part of the fleet.


def parking_document(session: ParkingSession, name: str) -> ReportDocument:
    """Whether parking helps, the limits that were compared, and the method."""
    question, best = session.question, session.best
    metric = question.target.metric
    kind = "lowest" if question.target.at_most else "highest"
    text = (
        f"{name}: how many of {session.robots:,} robots should have orders for the {kind} {metric}?"
    )
    document = ReportDocument(name, [Text(text), Listed(list(parking_lines(session)), mark="")])
    if best is not None:
        rows = [
            [
                setting.partition("=")[2] or "all",
                number(mean),
                f"{runs:,}",
                "left" if setting in best.left else "eliminated",
            ]
            for setting, mean, runs in zip(best.strategies, best.means, best.runs, strict=True)
        ]
        document.add(
            Table(("with orders", f"mean {metric}", "runs", "selection"), rows, also_left=(3,))
        )
    sure = shown_share(1 - question.alpha)
    document.add(
        Text(
            f"Selection by Kim & Nelson: with {sure} confidence the best one is left if all others are "
            f"worse by {shown_share(PARKING_ZONE)} of the mean. The comparison with the fleet as it is "
            f"comes from {STUDENT_MIN_RUNS} further pairs of runs. Parked robots stay on the floor, "
            f"where others push them aside. Used {session.spent:,} runs."
        )
    )
    return document


def parking_lines(session: ParkingSession) -> Iterator[str]:
    """The answer in sentences."""
    limit, robots, metric = session.limit, session.robots, session.question.target.metric
    if session.best is None or len(session.best.left) > 1:
        yield "Undecided: the budget is spent, or runs did not finish or lack the metric"
        return
    few = "" if limit is None else f"{limit:,} of {robots:,} robots with orders"
    if session.is_better and limit is not None:
        few = f"{robots - limit:,} of {robots:,} robots parked"
        yield f"Better with {few}: {metric} {relative_change(session.gain)}"
    else:
        selected = f"; selected: {few}, {relative_change(session.gain)}" if few else ""
        yield f"No number of parked robots is better by {shown_share(PARKING_ZONE)}{selected}"
    if limit is not None:
        change = session.refused or relative_change(session.alone)
        yield f"With a fleet of {limit:,} robots, without parked ones: {change}"
    limits = {"", *(f"{PARKING}={size}" for size in session.question.sizes if size < robots)}
    for setting in sorted(limits - set(session.best.strategies)):
        yield f"Not compared, since runs did not finish: {setting.partition('=')[2] or 'all'} with orders"


def relative_change(effect: Effect | None) -> str:
    """A relative effect with its interval: "+15.0 % (+13.1 to +16.9)"."""
    change = None if effect is None else effect.relative
    if change is None:
        return "not comparable"
    interval = ""
    if change.low is not None and change.high is not None:
        interval = f" ({100 * change.low:+.1f} to {100 * change.high:+.1f})"
    return f"{100 * change.value:+.1f} %{interval}"


def parking_as_json(session: ParkingSession, name: str, seed: int) -> dict[str, Any]:
    """The comparison as JSON; independent of the number of workers."""
    return {
        "scenario": name,
        "seed": seed,
        "varied": PARKING,
        "metric": session.question.target.metric,
        "robots": session.robots,
        "limit": session.limit,
        "is_better": session.is_better,
        "best": plain(session.best),
        "gain": plain(session.gain),
        "alone": plain(session.alone),
        "spent": session.spent,
    }
