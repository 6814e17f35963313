"""The metrics of two runs beside each other, with the difference and which is better.

Only metrics of the same tick are judged, or those of two runs that have both delivered everything:
after one has ended the other goes on, and what it does then is no merit and no fault.
"""

from __future__ import annotations

from typing import Final

from automaton.runs.metrics import METRIC_CATALOGUE
from automaton.units import number
from tui.playback.panel_view import View
from tui.widgets.signs import Signs
from tui.widgets.styled_lines import Line, Span, dim, line, title, wrapped

GREATER_IS_BETTER: Final = {"delivered", "throughput", "utilization", "throughput_per_robot"}
HEADLINES: Final = ("delivered", "throughput", "blocked_share", "utilization", "makespan")
NEITHER: Final = {"legs_per_order", "retreats", "ticks_per_operation"}
METRIC_COLUMNS: Final = 28
UNEQUAL: Final = "not compared: one run has ended before this tick"
ONE_LINE: Final = 52  # columns that a metric needs for its name and values


def compared_lines(view: View, width: int, signs: Signs) -> list[Line]:
    """A table of all metrics, the most telling first; narrow panels give each metric two lines."""
    first, second = (figures.metrics for figures in view.playback.figures)
    judged = comparable(view)
    narrow = width < ONE_LINE
    # a hidden panel has no width
    column = max(1, (width - (0 if narrow else METRIC_COLUMNS)) // 3 - 1)
    names = [signs.here * (at == view.side) + name for at, name in enumerate("AB")]
    heads = [f"{name:>{column}} " for name in names]
    last = "B - A" if judged else ""
    head = line(
        title(("" if narrow else " " * METRIC_COLUMNS) + "".join(heads) + f"{last:>{column}}")
    )
    lines = [head, *([] if _together(view) else [_ticks(view, narrow, column)])]
    rest = [name for name in METRIC_CATALOGUE if name not in HEADLINES]
    for name in (name for name in (*HEADLINES, *rest) if name in first and name in second):
        unit = METRIC_CATALOGUE[name][0]
        a, b = float(first[name]), float(second[name])
        best = better(name, a, b) if judged else ""
        values = line(
            _value(a, unit, column, signs.better if best == "A" else " "),
            _value(b, unit, column, signs.better if best == "B" else " "),
            dim(f"{_difference(b - a, unit) if judged else '':>{column}}"),
        )
        if narrow:
            said = f" {unit}" if unit != "share" else ""
            lines += [line(name, dim(said)), values]
        else:
            lines.append((Span(name.ljust(METRIC_COLUMNS)), *values))
    told = f"{signs.better} better; shares in %" if judged else "shares in %"
    return [
        *lines,
        *([] if judged else wrapped(line(dim(UNEQUAL)), width)),
        line(dim(told)),
        line(dim(f"{signs.here} the run that is told of")),
    ]


def comparable(view: View) -> bool:
    """Whether one run can be called better than the other now."""
    both = zip(view.playback.snapshots, view.playback.figures, strict=True)
    finished = all(shown.finished and shown.tick == figures.tick for shown, figures in both)
    return finished or _together(view)


def _together(view: View) -> bool:
    one, other = (figures.tick for figures in view.playback.figures)
    return one == other


def _ticks(view: View, narrow: bool, column: int) -> Line:
    """Of which ticks the metrics are."""
    ticks = "".join(f"{figures.tick:>{column},} " for figures in view.playback.figures)
    return line(dim(("" if narrow else "at tick".ljust(METRIC_COLUMNS)) + ticks))


def _value(value: float, unit: str, column: int, sign: str) -> Span:
    text = f"{100 * value:.1f}" if unit == "share" else number(value)
    return Span(f"{text:>{column}}{sign}", "plain" if sign == " " else "title")


def _difference(value: float, unit: str) -> str:
    if value == 0:
        return "="
    return f"{100 * value:+.1f}" if unit == "share" else ("+" if value > 0 else "") + number(value)


def better(name: str, a: float, b: float) -> str:
    """Which of two runs has the better value, A or B; "" if neither."""
    if a == b or name in NEITHER:
        return ""
    return "A" if (a > b) == (name in GREATER_IS_BETTER) else "B"
