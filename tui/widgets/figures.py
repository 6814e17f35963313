"""The figures of the run: now, so far, and over time; of two runs side by side."""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.metrics import GLOSSARY
from automaton.units import number, percent
from automaton.world.state import DELIVERED, Array
from automaton.world.waiting import CAUSES, NO_ORDER, NOT_WAITING
from tui.view import TickChosen, View
from tui.widgets import curve
from tui.widgets.compared import compared_lines
from tui.widgets.lines import Line, Link, Span, dim, fact, line, term, title
from tui.widgets.robot_columns import waits
from tui.widgets.signs import bar
from tui.widgets.text_panel import TextPanel

NAME: Final = 13  # columns for the name of a figure
ROWS: Final = 3  # of a curve
NARROW: Final = 40  # columns below which words are shortened; /kt is per 1000 ticks
SHORT: Final = 7  # columns for the name of a figure in words


class Figures(TextPanel):
    """What matters most comes first: the panel may have little room."""

    def written(self, view: View, width: int) -> list[Line]:
        if len(view.runs) > 1:
            return [*compared_lines(view, width, self.signs), (), *self._curves(view, width)]
        return [
            *self._now(view, width),
            *self._curves(view, width),
            *self._lost(view, width),
            *self._all(view, width),
        ]

    def _now(self, view: View, width: int) -> list[Line]:
        metrics = view.shot.figures[view.side].metrics
        curve_now = _known(view)
        orders = view.snapshot.orders.state
        done = int(np.count_nonzero(orders == DELIVERED))
        share = done / max(1, len(orders))
        room = max(0, width - NAME - len(f"{done:,} of {len(orders):,} "))
        rate, now = float(metrics["throughput"]), curve.now_throughput(curve_now)
        unit = "/kt" if width < NAME + len("100.0 /1000 ticks") else "/1000 ticks"
        return [
            _figure("delivered", f"{done:,} of {len(orders):,} ", bar(share, room, self.signs)),
            _figure("throughput", f"{_short(rate)} {unit}"),
            _figure(f"  last {curve.NOW_TICKS}", f"{_short(now)} {unit}"),
            *self._share("utilization", view, width),
            *self._share("blocked", view, width),
            *fact(
                "robots",
                *_robots(view, "" if width < NARROW else ","),
                width=width,
                label=NAME if width >= NARROW else SHORT,
            ),
        ]

    def _share(self, name: str, view: View, width: int) -> list[Line]:
        """A share of time, and what counts."""
        link = ("share", list(GLOSSARY).index(name))
        value = percent(float(view.shot.figures[view.side].metrics[name]))
        told = self.explanation(link, GLOSSARY[name][1], width)
        return [line(*term(name, link, NAME), value), *told]

    def _curves(self, view: View, width: int) -> list[Line]:
        known = _known(view)
        points = curve.points_for(width, self.signs.dots)
        lines: list[Line] = []
        rate = "throughput, orders/1000 ticks"
        for name, values in (
            (rate if width >= len(rate) else "orders/1000 ticks", curve.throughput(known, points)),
            ("waiting robots", curve.waiting(known, points)),
        ):
            lines.append(line(title(name)))
            for text in curve.drawn(values, ROWS, self.signs.dots):
                label, body = text[: curve.LABELS], text[curve.LABELS :]
                lines.append(line(dim(label), Span(body, "plain", ("curve", len(known)))))
        last = f"tick {len(known):,}"
        axis = "0".ljust(max(1, width - curve.LABELS - len(last))) + last
        return [*lines, line(dim(" " * curve.LABELS + axis))]

    def _lost(self, view: View, width: int) -> list[Line]:
        """Robot ticks lost by cause."""
        lost = view.snapshot.robots.lost.sum(0)
        lost[NOT_WAITING] = lost[NO_ORDER] = 0
        if not lost.any():
            return [line(title("no time lost so far"))]
        whole = max(1, view.snapshot.tick * len(view.snapshot.robots))
        lines = [line(title("time lost"), dim(" of all robot ticks"))]
        room = max(0, width - NAME - 10)
        for code in np.argsort(-lost, kind="stable")[: np.count_nonzero(lost)].tolist():
            share = int(lost[code]) / whole
            drawn = bar(int(lost[code]) / int(lost.max()), room, self.signs)
            link = ("cause", code)
            name = term(CAUSES[code].name, link, NAME + 1)
            lines.append(line(*name, Span(drawn, "warn"), f"{percent(share):>8}"))
            lines += self.explanation(link, CAUSES[code].meaning, width)
        return lines

    def _all(self, view: View, width: int) -> list[Line]:
        """Every metric with its unit."""
        metrics = view.shot.figures[view.side].metrics
        lines = [line(title("all metrics"))]
        for at, (name, (unit, meaning)) in enumerate(GLOSSARY.items()):
            if name not in metrics:
                continue
            value = percent(float(metrics[name])) if unit == "share" else number(metrics[name])
            unit = "" if unit == "share" else f" {unit}"
            room = width - len(name) - len(unit)
            link = ("metric", at)
            lines.append(line(*term(name, link, 0), f"{value:>{max(1, room)}}", dim(unit)))
            lines += self.explanation(link, meaning, width)
        return lines

    def follow(self, link: Link, column: int = 0) -> None:
        """A click on a curve leads to its tick."""
        kind, ticks = link
        if kind == "curve":
            room = max(1, self.width - curve.LABELS - 1)
            self.post_message(TickChosen(round(ticks * min(1.0, column / room))))
        elif kind in ("cause", "metric", "share"):
            self.explain(link)
        else:
            super().follow(link, column)


def _known(view: View) -> Array:
    return view.run.chronicle.curve[: view.snapshot.tick]


def _figure(name: str, *parts: str) -> Line:
    return (dim(name.ljust(NAME)), *line(*parts))


def _short(value: float) -> str:
    return f"{value:,.1f}"


def _robots(view: View, comma: str) -> Line:
    """How many robots work, wait and are parked."""
    fleet = view.snapshot.robots
    waiting, parked = int(np.count_nonzero(waits(fleet))), int(np.count_nonzero(fleet.parked))
    idle = int(np.count_nonzero((fleet.cause == NO_ORDER) & (fleet.parked == 0)))
    work = len(fleet) - waiting - parked - idle
    look = "fault" if fleet.ring.any() else "warn" if waiting else "plain"
    waits_now = Span(f"{waiting:,} wait{comma}", look)
    parts = line(f"{work:,} work{comma} ", waits_now, f" {parked:,} parked")
    return (*parts, Span(f"{comma} {idle:,} idle")) if idle else parts
