"""The metrics of two runs beside each other, with the difference and which is better."""

from __future__ import annotations

from typing import Final

from automaton.metrics import GLOSSARY
from automaton.units import number
from tui.view import View
from tui.widgets.lines import Line, Span, dim, line, title
from tui.widgets.signs import Signs

GREATER_IS_BETTER: Final = {"delivered", "throughput", "utilization", "completions"}
HEADLINES: Final = ("delivered", "throughput", "blocked", "utilization", "T_total")
NEITHER: Final = {"legs_per_order", "withdrawals", "ticks_per_operation"}
NAME: Final = 19
ONE_LINE: Final = 52  # columns that a metric needs for its name and figures


def compared_lines(view: View, width: int, signs: Signs) -> list[Line]:
    """A table of all metrics, the most telling first; narrow panels give each metric two lines."""
    first, second = (figures.metrics for figures in view.shot.figures)
    narrow = width < ONE_LINE
    column = max(1, (width - (0 if narrow else NAME)) // 3 - 1)  # a hidden panel has no width
    names = [signs.here * (at == view.side) + name for at, name in enumerate("AB")]
    heads = [f"{name:>{column}} " for name in names]
    head = line(title(("" if narrow else " " * NAME) + "".join(heads) + f"{'B - A':>{column}}"))
    lines = [head]
    rest = [name for name in GLOSSARY if name not in HEADLINES]
    for name in (name for name in (*HEADLINES, *rest) if name in first and name in second):
        unit = GLOSSARY[name][0]
        a, b = float(first[name]), float(second[name])
        best = better(name, a, b)
        values = line(
            _value(a, unit, column, signs.better if best == "A" else " "),
            _value(b, unit, column, signs.better if best == "B" else " "),
            dim(f"{_difference(b - a, unit):>{column}}"),
        )
        if narrow:
            said = f" {unit}" if unit != "share" else ""
            lines += [line(name, dim(said)), values]
        else:
            lines.append((Span(name.ljust(NAME)), *values))
    return [
        *lines,
        line(dim(f"{signs.better} better; shares in %")),
        line(dim(f"{signs.here} the run that is told of")),
    ]


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
