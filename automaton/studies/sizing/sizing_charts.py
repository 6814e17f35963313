"""The candidates of a search drawn: intervals below each other as text, curves for PNG and SVG."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from automaton.studies.inference.intervals import Interval
from automaton.studies.reports.report_document import Curves, Line
from automaton.studies.sizing.candidates import Candidate
from automaton.studies.sizing.fleet_search import Search
from automaton.studies.sizing.question import Question, shown
from automaton.studies.sizing.sizing_session import SizingSession
from automaton.units import percent

CHART_WIDTH: Final = 61  # of a scale
MARK_VALUE, MARK_INTERVAL, MARK_TARGET = "o", "-", "|"


def picture(search: Search, question: Question) -> Iterator[str]:
    """One line for each candidate that was run: its metric with its interval, and the ends of the
    indifference zone."""
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
    """The metric that decides: the share of runs that meet the target, or their mean."""
    return candidate.mean(question.target.metric) if question.mean else candidate.share(question)


def zone(question: Question) -> tuple[float, float]:
    """Between these either verdict may fall."""
    centre = question.target.value if question.mean else question.success_share
    return centre - question.indifference, centre + question.indifference


def scale(intervals: list[Interval], question: Question) -> tuple[float, float]:
    """The ends of the scale: those of a share, or what holds all means and the zone."""
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
    """The share of runs that meet the target over the robots, and the mean of its metric."""
    question = session.question
    metric, ends = question.target.metric, [float(question.first), float(question.last)]
    shares = [strategy_line(search, question, False) for search in session.searches]
    means = [strategy_line(search, question, True) for search in session.searches]
    wanted = (
        []
        if question.mean
        else [level(f"wanted {percent(question.success_share, 0)}", ends, question.success_share)]
    )
    target = level(f"target {shown(question.target.value)}", ends, question.target.value)
    return [
        Curves(f"share of runs with {question.target.text}", "robots", "share", [*shares, *wanted]),
        Curves(f"mean {metric} by robots", "robots", question.target.unit, [*means, target]),
    ]


def strategy_line(search: Search, question: Question, mean: bool) -> Line:
    """The candidates of one strategy that were run."""
    found: list[tuple[int, Interval]] = []
    for one in search.candidates:
        interval = one.mean(question.target.metric) if mean else one.share(question)
        if one.runs and interval is not None:
            found.append((one.place.robots, interval))
    name = search.strategy.partition("=")[2]
    value = [one.value for _, one in found]
    low = [one.value if one.low is None else one.low for _, one in found]
    high = [one.value if one.high is None else one.high for _, one in found]
    return Line(name, [float(robots) for robots, _ in found], value, low, high)


def level(name: str, ends: list[float], value: float) -> Line:
    """A horizontal line."""
    return Line(name, ends, [value] * 2, [value] * 2, [value] * 2)
