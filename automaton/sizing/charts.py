"""The candidates of a search drawn: intervals below each other as text, curves for PNG and SVG."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from automaton.reporting.document import Curves, Line
from automaton.sizing.candidates import Candidate
from automaton.sizing.question import Question, shown
from automaton.sizing.search import Search
from automaton.sizing.session import Session
from automaton.statistics.intervals import Interval
from automaton.units import percent

COLUMNS: Final = 61  # of a scale
VALUE, REACH, MARK = "o", "-", "|"


def picture(search: Search, asked: Question) -> Iterator[str]:
    """One line for each candidate that was run: its metric with its interval, and the ends of the
    indifference zone."""
    judged = [(one, judged_by(one, asked)) for one in search.candidates if one.runs]
    found = [(one, interval) for one, interval in judged if interval is not None]
    if not found:
        return
    least, most = zone(asked)
    low, high = scale([interval for _, interval in found], asked)
    what = f"mean {asked.target.metric}" if asked.mean else "share"
    yield f"robots  {what} with its {percent(1 - asked.alpha, 0)} interval; {MARK} indifference zone"
    for one, interval in found:
        line = drawn(interval, (least, most), low, high)
        yield f"{one.place.robots:6}  {line.rstrip()}"
    ends = (shown(low), shown(high)) if asked.mean else (percent(low, 0), percent(high, 0))
    yield f"        {ends[0]}{ends[1]:>{COLUMNS - len(ends[0])}}"


def judged_by(candidate: Candidate, asked: Question) -> Interval | None:
    """The metric that decides: the share of runs that meet the target, or their mean."""
    return candidate.mean(asked.target.metric) if asked.mean else candidate.share(asked)


def zone(asked: Question) -> tuple[float, float]:
    """Between these either verdict may fall."""
    centre = asked.target.value if asked.mean else asked.success_share
    return centre - asked.indifference, centre + asked.indifference


def scale(intervals: list[Interval], asked: Question) -> tuple[float, float]:
    """The ends of the scale: those of a share, or what holds all means and the zone."""
    if not asked.mean:
        return 0.0, 1.0
    reached = [
        end for one in intervals for end in (one.value, one.low, one.high) if end is not None
    ]
    return math.floor(min(*reached, *zone(asked))), math.ceil(max(*reached, *zone(asked)))


def drawn(interval: Interval, marks: tuple[float, float], low: float, high: float) -> str:
    """An interval on a scale from low to high."""

    def column(value: float) -> int:
        inside = min(max((value - low) / (high - low), 0.0), 1.0)
        return round(inside * (COLUMNS - 1))

    cells = [" "] * COLUMNS
    if interval.low is not None and interval.high is not None:
        for at in range(column(interval.low), column(interval.high) + 1):
            cells[at] = REACH
    for mark in marks:
        cells[column(mark)] = MARK
    cells[column(interval.value)] = VALUE
    return "".join(cells)


def curves(session: Session) -> list[Curves]:
    """The share of runs that meet the target over the robots, and the mean of its metric."""
    asked = session.asked
    metric, ends = asked.target.metric, [float(asked.first), float(asked.last)]
    shares = [strategy_line(search, asked, False) for search in session.searches]
    means = [strategy_line(search, asked, True) for search in session.searches]
    wanted = (
        []
        if asked.mean
        else [level(f"wanted {percent(asked.success_share, 0)}", ends, asked.success_share)]
    )
    target = level(f"target {shown(asked.target.value)}", ends, asked.target.value)
    return [
        Curves(f"share of runs with {asked.target.text}", "robots", "share", [*shares, *wanted]),
        Curves(f"mean {metric} by robots", "robots", asked.target.unit, [*means, target]),
    ]


def strategy_line(search: Search, asked: Question, mean: bool) -> Line:
    """The candidates of one strategy that were run."""
    found: list[tuple[int, Interval]] = []
    for one in search.candidates:
        interval = one.mean(asked.target.metric) if mean else one.share(asked)
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
