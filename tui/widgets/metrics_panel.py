"""The metrics of a run, or of two runs side by side with difference and better value.

Metrics are compared only at the same tick, or after both runs have delivered everything. If one run
has ended and the other goes on, their metrics are not comparable.

A metric over time is drawn in braille: two points in time and four levels per character. A curve is
filled or a line, so that two curves differ by more than their colours.

    24 ⡀   ⢀⣀⡀        The label of the greatest value is at the top, 0 at the bottom; the last
     0 ⣷⣶⣶⣿⣿⣷         column is the last tick. Without braille, one point per character.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable, Sequence
from itertools import accumulate, zip_longest
from typing import Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import LOW_CHARGE
from automaton.engine.observation import (
    CAUSE_NO_ORDER,
    DELIVERED_ORDERS,
    WAITING_ROBOTS,
    is_waiting,
)
from automaton.engine.robot_states import is_charging, is_queueing
from automaton.engine.state import (
    BATTERY_FULL,
    ORDER_DELIVERED,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_TOWED,
)
from automaton.history.event_history import Curve
from automaton.history.fleet_summary import FleetSummary, summarize
from automaton.runs.bottleneck import (
    LEAST_TICKS,
    bottleneck_in_short,
    bottleneck_sentences,
    flow_name,
    rate,
    rate_unit,
)
from automaton.runs.metric_catalogue import METRIC_CATALOGUE, time_shares
from automaton.runs.periods import Period
from automaton.units import count, number, percent
from tui.playback.panel_view import JamChosen, TickChosen, View, middle_robot
from tui.widgets.panel import (
    Line,
    Link,
    Signs,
    Span,
    TextPanel,
    bar,
    dim,
    fact,
    length,
    line,
    term,
    title,
    wrapped,
)
from tui.widgets.robot_facts import IN_WAIT_CYCLE, battery_figures, may_fail
from tui.widgets.why_panel import LOST_KINDS, NAME_WIDTH, cause_bar, lost_kinds, pattern_key
from tui.widgets.zone_facts import partition_of, parts_finished, slow_zones

NAME_COLUMNS: Final = 13  # columns for the name of a metric
VALUE_COLUMNS: Final = 5  # columns of a value, with one decimal
USE_COLUMNS: Final = 15  # columns for the name of a use of time

THROUGHPUT_UNIT: Final = "/1000 ticks"
SHORT_UNIT: Final = "/kt"  # where there is little room

CURVE_ROWS: Final = 3
LEAD_ROWS: Final = 2
PERIODS_SHOWN: Final = 6
LEAST_HALF: Final = 34  # columns of one of two parts side by side


class Figures(TextPanel):
    """The metrics of the run: now, so far, and over time; of two runs side by side.

    The most important metrics come first, since the panel may be small.
    """

    def panel_lines(self, view: View, width: int) -> list[Line]:
        if len(view.runs) > 1:
            throughput, waiting = self._curves(view, width)
            table = compared_lines(view, width, self.signs)
            lead = lead_lines(view, width, self.signs)
            lines = [*lead, *table, (), *throughput, *waiting]
            # Indented lines belong to the line before.
            self.ends = [at for at, one in enumerate(lines) if one and one[0].text[:1] != " "]
            return lines
        periods, curves = last_periods(view, width), self._curves(view, width)
        by_hour = view.run.marks.is_fixed
        parts = (
            *self._first(view, width),
            self._state(view, width),
            bottleneck_so_far(view, width),
            *((periods,) if by_hour else ()),
            self._lost(view, width),
            *curves,
            *(() if by_hour else (periods,)),
            slow_zones(view),
            self._all(view, width),
        )
        self.ends = tuple(accumulate(len(part) for part in parts))
        return [made for part in parts for made in part]

    def _first(self, view: View, width: int) -> list[list[Line]]:
        """The first metrics, and where the time went: below them or, where there is room, beside them."""
        half = width // 2 - 1
        if half < LEAST_HALF:
            return [self._now(view, width), self._time(view, width)]
        rows = zip_longest(self._now(view, half), self._time(view, half), fillvalue=())
        return [[(*one, Span(" " * (half + 2 - length(one))), *other) for one, other in rows]]

    def rows_within(self, most: int) -> int:
        """The greatest number of rows up to `most` that shows only whole parts."""
        return max((end for end in self.ends if end <= most), default=most)

    def _now(self, view: View, width: int) -> list[Line]:
        metrics = view.playback.figures[view.side].metrics
        curve_now = _known(view)
        fleet = summarize(view.snapshot)
        done = fleet.delivered
        share = done / max(1, fleet.orders)
        of_all = f"{done:,} of {fleet.orders:,} "
        of_all = of_all if len(of_all) <= width - NAME_COLUMNS else f"{done:,} "
        room = max(0, width - NAME_COLUMNS - len(of_all))
        rate, now = float(metrics["throughput"]), now_throughput(curve_now)
        longest = max(len(_short(value)) for value in (rate, now))
        unit = (
            THROUGHPUT_UNIT
            if width >= NAME_COLUMNS + longest + 1 + len(THROUGHPUT_UNIT)
            else SHORT_UNIT
        )
        return [
            _figure("delivered", of_all, bar(share, room, self.signs)),
            *_lines(fleet, view, width),
            _figure("throughput", f"{_short(rate)} {unit}"),
            _figure(f"  last {NOW_TICKS}", f"{_short(now)} {unit}"),
            *self._share("utilization", "utilization", view, width),
            *_bottleneck(view, width),
            *_robots(view, width),
        ]

    def _state(self, view: View, width: int) -> list[Line]:
        """Open orders, batteries, faults, parts and zones now."""
        lines = [
            *self._progress(view, width),
            *self._energy(view, width),
            *_out_of_order(view, width),
            *self._parts(view, width),
        ]
        return [line(title("now")), *lines] if lines else []

    def _progress(self, view: View, width: int) -> list[Line]:
        """The oldest open order, late orders, starved robots, and the largest jam."""
        figures = view.playback.figures[view.side]
        oldest = figures.metrics.get("oldest_order", 0)
        lines: list[Line] = []
        if oldest:
            age = Span(f"{count(int(oldest), 'tick')}")
            lines += self._explained("oldest_order", "oldest order", age, width)
        if "late_share" in figures.metrics:
            look = "warn" if figures.metrics["late_share"] else "plain"
            lines += self._share("late_share", "late", view, width, look)
        if len(figures.starved):
            starved = Span(count(len(figures.starved), "robot"), "warn")
            lines += self._explained("starved_robots", "starved", starved, width)
        if figures.jam is not None:
            robots = figures.jam.robots
            middle = robots[middle_robot(figures.jam, view.snapshot, view.floor_plan)]
            x, y = view.floor_plan.xy(int(view.snapshot.robots.cell[middle]))
            jam = Span(count(len(robots), "robot"), "link", ("jam", 0))
            lines += fact("  in a jam", jam, f" at ({x}, {y})", width=width, label=NAME_COLUMNS)
        return lines

    def _explained(self, name: str, label: str, value: Span, width: int) -> list[Line]:
        """A metric under a short name, with its explanation if requested."""
        link = ("share", list(METRIC_CATALOGUE).index(name))
        told = self.explanation(link, METRIC_CATALOGUE[name][1], width)
        return [line(*term(label, link, NAME_COLUMNS), value), *told]

    def _parts(self, view: View, width: int) -> list[Line]:
        """Finished parts; number of zone redesigns; share of time with balanced zones."""
        lines: list[Line] = []
        finished = parts_finished(view)
        if finished is not None:
            lines.append(_figure("parts", f"{finished[0]:,} of {finished[1]:,} finished"))
        if partition_of(view) is not None:
            changed = count(view.snapshot.redesigns, "time")
            lines.append(_figure("zones", f"redesigned {changed}"))
        metrics = view.playback.figures[view.side].metrics
        if metrics.get("ticks_watched"):
            share = metrics["ticks_in_balance"] / metrics["ticks_watched"]
            lines.append(_figure("  in balance", f"{percent(share):>{VALUE_COLUMNS + 2}}"))
        return lines

    def _energy(self, view: View, width: int) -> list[Line]:
        """Batteries now, energy used so far, and the share of time at chargers."""
        charge = battery_figures(view)
        metrics = view.playback.figures[view.side].metrics
        if charge is None or "energy" not in metrics:
            return []
        fleet = view.snapshot.robots
        there, waiting = is_charging(fleet), np.count_nonzero(is_queueing(fleet))
        look = "warn" if charge[0] * BATTERY_FULL < LOW_CHARGE else "plain"
        least, mean = percent(charge[0], 0), percent(charge[1], 0)
        chargers = f"{np.count_nonzero(there):,}, {waiting:,} queue"
        link = ("share", list(METRIC_CATALOGUE).index("energy"))
        used = f"{_short(float(metrics['energy']))} batteries"
        return [
            _figure("at chargers", chargers),
            *self._share("charging_share", "charging", view, width),
            (*line(dim("mean battery "), f"{mean}, "), Span(f"least {least}", look)),
            line(*term("energy", link, NAME_COLUMNS), used),
            *self.explanation(link, METRIC_CATALOGUE["energy"][1], width),
        ]

    def _share(
        self, name: str, label: str, view: View, width: int, look: str = "plain"
    ) -> list[Line]:
        """A share of time or of orders, with its explanation."""
        share = percent(float(view.playback.figures[view.side].metrics[name]))
        return self._explained(name, label, Span(f"{share:>{VALUE_COLUMNS + 2}}", look), width)

    def _curves(self, view: View, width: int) -> tuple[list[Line], list[Line]]:
        """Throughput and waiting robots over time; the axis is below the second curve."""
        known = _known(view)
        points = points_for(width, self.signs.dots)
        rate = "throughput, orders/1000 ticks"
        name = rate if width >= len(rate) else "orders/1000 ticks"
        throughput = self._curve(name, throughput_over_time(known, points), known.ticks)
        mean = waiting_over_time(known, points)
        waiting = self._curve("waiting robots", mean, known.ticks, filled=False)
        last = f"tick {known.ticks:,}"
        axis = "0".ljust(max(1, width - LABEL_WIDTH - len(last))) + last
        return throughput, [*waiting, line(dim(" " * LABEL_WIDTH + axis))]

    def _curve(self, name: str, values: Values, ticks: int, filled: bool = True) -> list[Line]:
        """A curve in one colour: a colour per character would cost ten times the bytes."""
        lines, look = [line(title(name))], "good" if filled else "warn"
        for text in drawn_curve(values, CURVE_ROWS, self.signs.dots, filled):
            label, body = text[:LABEL_WIDTH], text[LABEL_WIDTH:]
            lines.append(line(dim(label), Span(body, look, ("curve", ticks))))
        return lines

    def _time(self, view: View, width: int) -> list[Line]:
        """Where the time of the robots went, as in reports."""
        room, uses = max(0, width - USE_COLUMNS - 8), view.measured.uses
        shares = time_shares(uses)
        most = max((share for _, share, _ in shares), default=1)
        rows = [
            line(f"{name:<{USE_COLUMNS}}", bar(share / most, room, self.signs), f"{text:>8}")
            for name, share, _ in shares
            if (text := percent(share))
        ]
        lost = sum(ticks for name, ticks in uses.items() if name.startswith("lost_"))
        share = percent(lost / max(1, sum(uses.values())))
        return [line(title("where the time went"), dim(f" {share} lost")), *rows] if rows else []

    def _lost(self, view: View, width: int) -> list[Line]:
        """Robot ticks lost by cause."""
        undone = int(view.measured.making_way.sum())
        lost = lost_kinds(view.snapshot.robots.lost.sum(0), undone)
        if not lost.any():
            return [line(title("no time lost so far"))]
        whole = max(1, view.snapshot.tick * len(view.snapshot.robots))
        lines = [line(title("time lost"), dim(" of all robot ticks"))]
        room = max(0, width - NAME_WIDTH - 8)
        causes = np.argsort(-lost, kind="stable")[: np.count_nonzero(lost)].tolist()
        for cause in causes:
            drawn = cause_bar(cause, int(lost[cause]) / int(lost.max()), room, self.signs)
            link = ("cause", cause)
            name = term(LOST_KINDS[cause].name, link, NAME_WIDTH)
            lines.append(line(*name, drawn, f"{percent(int(lost[cause]) / whole):>8}"))
            lines += self.explanation(link, LOST_KINDS[cause].meaning, width)
        return [*lines, pattern_key(causes, self.signs)]

    def _all(self, view: View, width: int) -> list[Line]:
        """Every metric with its unit."""
        metrics = view.playback.figures[view.side].metrics
        lines = [line(title("all metrics"), dim(" by their names in studies"))]
        for at, (name, (unit, meaning)) in enumerate(METRIC_CATALOGUE.items()):
            if name not in metrics:
                continue
            value = percent(float(metrics[name])) if unit == "share" else number(metrics[name])
            unit = "" if unit in ("share", "number") else f" {unit}"
            unit = " time" if unit == " times" and metrics[name] == 1 else unit
            link = ("metric", at)
            room = width - len(name) - len(unit)
            if room > len(value):
                lines.append(line(*term(name, link, 0), f"{value:>{room}}", dim(unit)))
            else:  # the name has its own line
                lines.append(line(*term(name, link, 0)))
                lines.append(line(f"{value:>{max(1, width - len(unit))}}", dim(unit)))
            lines += self.explanation(link, meaning, width)
        return lines

    def follow(self, link: Link, column: int = 0) -> None:
        """Go to the tick of a clicked curve, or explain a metric."""
        kind, ticks = link
        if kind == "curve":
            room = max(1, self.width - LABEL_WIDTH - 1)
            self.post_message(TickChosen(round(ticks * min(1.0, column / room))))
        elif kind in ("cause", "metric", "share"):
            self.explain(link)
        elif kind == "jam":
            self.post_message(JamChosen())
        else:
            super().follow(link, column)


def last_periods(view: View, width: int) -> list[Line]:
    """What was done in the last periods, what robots did on average, and how busy the rest was.

    The columns that do not fit are left out.
    """
    known = view.playback.figures[view.side].periods
    is_open = known and known[-1].ticks < view.run.marks.ticks
    periods = known[: -1 if is_open and not view.playback.ended(view.side) else None]
    if not (periods := periods[-PERIODS_SHOWN:]):
        return []
    resolved, first = view.run.resolved, periods[0]
    waiting = ("in_traffic", "in_station_queues", "for_chargers")
    columns: list[tuple[str, Callable[[Period], str]]] = [
        ("from", lambda one: one.name.removeprefix("tick ")),
        (flow_name(resolved), lambda one: number(round(rate(resolved, one)))),
        ("open", lambda one: number(one.backlog)),
        ("work", lambda one: f"{one.on_orders:.1f}"),
        ("wait", lambda one: f"{sum(getattr(one, name) for name in waiting):.1f}"),
    ]
    if first.chargers:
        columns.append(("charge", lambda one: f"{one.charging:.1f}"))
    if first.stations:
        columns.append(("stations", lambda one: percent(sum(one.stations) / len(one.stations), 0)))
    if first.chargers:
        columns.append(("chargers", lambda one: percent(one.charger_share, 0)))
    rows, used = [""] * (1 + len(periods)), 0
    for head, text in columns:
        cells = [head, *(text(one) for one in periods)]
        wide = max(map(len, cells)) + bool(used)
        if used + wide > width:
            break
        used += wide
        rows = [row + f"{cell:>{wide}}" for row, cell in zip(rows, cells, strict=True)]
    unit = f" {flow_name(resolved)}/{'h' if rate_unit(resolved) == 'an hour' else '1000 ticks'}"
    return [line(title("last periods"), dim(unit)), line(dim(rows[0])), *map(line, rows[1:])]


def _bottleneck(view: View, width: int) -> list[Line]:
    """What was saturated for longest in the periods up to now."""
    said = bottleneck_in_short(view.run.resolved, _periods(view))
    return fact("bottleneck", said, width=width, label=NAME_COLUMNS) if said else []


def _periods(view: View) -> Sequence[Period]:
    """The periods up to now; none of a run that is too short for a bottleneck."""
    figures = view.playback.figures[view.side]
    return figures.periods if figures.tick >= LEAST_TICKS else ()


def bottleneck_so_far(view: View, width: int) -> list[Line]:
    """What was saturated in the periods up to now, in the words of the report."""
    said = bottleneck_sentences(view.run.resolved, _periods(view))
    lines = [row for text in said for row in wrapped(line(text), width)]
    return [line(title("bottleneck so far")), *lines] if lines else []


def _known(view: View) -> Curve:
    return view.run.event_history.curve.until(view.snapshot.tick)


def _out_of_order(view: View, width: int) -> list[Line]:
    """Robots that are down or towed, if robots may break down."""
    if not may_fail(view):
        return []
    status = view.snapshot.robots.status
    standing = int(np.count_nonzero((status == STATUS_DEPLETED) | (status == STATUS_FAILED)))
    towed = int(np.count_nonzero(status >= STATUS_TOWED))
    out = Span(count(standing, "robot"), "fault" if standing else "plain")
    return fact("down", out, f", {towed:,} towed", width=width, label=NAME_COLUMNS)


def _figure(name: str, *parts: str) -> Line:
    return (dim(name.ljust(NAME_COLUMNS)), *line(*parts))


def _lines(fleet: FleetSummary, view: View, width: int) -> list[Line]:
    """Finished lines and trips, where orders consist of lines."""
    if not fleet.lines:
        return []
    trips = int(np.count_nonzero(view.snapshot.orders.state == ORDER_DELIVERED))
    done = f"{fleet.lines_done:,} of {fleet.lines:,}"
    with_trips = f"{done}, {count(trips, 'trip')}"
    return [_figure("lines done", with_trips if len(with_trips) <= width - NAME_COLUMNS else done)]


def _short(value: float) -> str:
    return f"{value:>{VALUE_COLUMNS},.1f}"


def _robots(view: View, width: int) -> list[Line]:
    """Numbers of robots at work, waiting, in wait cycles, parked and idle, wrapped to the width."""
    fleet = view.snapshot.robots
    in_cycle = fleet.wait_cycle_ticks > 0
    stuck = int(np.count_nonzero(in_cycle))
    waiting = int(np.count_nonzero(is_waiting(fleet.cause) & ~in_cycle))
    parked = int(np.count_nonzero(fleet.parked))
    idle = int(np.count_nonzero((fleet.cause == CAUSE_NO_ORDER) & (fleet.parked == 0)))
    work = len(fleet) - waiting - stuck - parked - idle
    kinds = [
        (work, Span(f"{work:,} working")),
        (waiting, Span(f"{waiting:,} waiting", "warn")),
        (stuck, Span(f"{stuck:,} {IN_WAIT_CYCLE}", "fault")),
        (parked, Span(f"{parked:,} parked")),
        (idle, Span(f"{idle:,} idle")),
    ]
    said = [span for robots, span in kinds if robots]
    rows = [said]
    for step in (len(said), 2, 1):
        rows = [said[at : at + step] for at in range(0, len(said), step)]
        if all(length(row) + 2 * (len(row) - 1) <= width - NAME_COLUMNS for row in rows):
            break
    names = ["robots", *[""] * (len(rows) - 1)]
    return [
        (dim(name.ljust(NAME_COLUMNS)), *[part for span in row for part in (span, Span(", "))][:-1])
        for name, row in zip(names, rows, strict=True)
    ]


# Two runs.


GREATER_IS_BETTER: Final = {"delivered", "throughput", "utilization", "throughput_per_robot"}
HEADLINES: Final = ("delivered", "throughput", "blocked_share", "utilization", "makespan")
NEITHER: Final = {"legs_per_order", "retreats", "ticks_per_operation"}
METRIC_COLUMNS: Final = 28
UNEQUAL: Final = "not compared: one run has ended before this tick"
ONE_LINE: Final = 52  # columns that a metric needs for its name and values


def compared_lines(view: View, width: int, signs: Signs) -> list[Line]:
    """A table of the metrics that are not 0 in both runs, by meaning, the most important first.

    In narrow panels the values stand below the meaning.
    """
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
        unit, meaning = METRIC_CATALOGUE[name]
        a, b = float(first[name]), float(second[name])
        if not (a or b) or math.isnan(a) or math.isnan(b):
            continue
        meaning = re.split(r"[:;(]", meaning)[0].strip()
        best = better(name, a, b) if judged else ""
        values = line(
            _value(a, unit, column, signs.better if best == "A" else " "),
            _value(b, unit, column, signs.better if best == "B" else " "),
            dim(f"{_difference(b - a, unit) if judged else '':>{column}}"),
        )
        if narrow:
            lines += [*wrapped(line(meaning), width, indent=2), values]
        else:
            words, *more = textwrap.wrap(meaning, METRIC_COLUMNS - 1, subsequent_indent="  ")
            lines.append((Span(words.ljust(METRIC_COLUMNS)), *values))
            lines += map(line, more)
    told = f"{signs.better} better; shares in %" if judged else "shares in %"
    return [
        *lines,
        *([] if judged else wrapped(line(dim(UNEQUAL)), width)),
        line(dim(told)),
        line(dim(f"{signs.here} the run in the panels")),
    ]


def lead_lines(view: View, width: int, signs: Signs) -> list[Line]:
    """How many deliveries each run was ahead of the other, over time."""
    tick = min(shown.tick for shown in view.playback.snapshots)
    ticks = edges(tick, points_for(width, signs.dots))[1:]
    first, second = (run.event_history.curve.at(ticks, DELIVERED_ORDERS) for run in view.runs)
    lines: list[Line] = []
    for name, ahead, look in (("A", first - second, "warn"), ("B", second - first, "good")):
        if (ahead > 0).any():
            lines.append(line(title(f"{name} ahead, deliveries"), dim(f" now {max(0, ahead[-1])}")))
            for text in drawn_curve(np.maximum(ahead, 0).astype(float), LEAD_ROWS, signs.dots):
                label, body = text[:LABEL_WIDTH], text[LABEL_WIDTH:]
                lines.append(line(dim(label), Span(body, look, ("curve", tick))))
    return lines


def comparable(view: View) -> bool:
    """Whether the metrics of the two runs are comparable now."""
    both = zip(view.playback.snapshots, view.playback.figures, strict=True)
    finished = all(shown.finished and shown.tick == figures.tick for shown, figures in both)
    return finished or _together(view)


def _together(view: View) -> bool:
    one, other = (figures.tick for figures in view.playback.figures)
    return one == other


def _ticks(view: View, narrow: bool, column: int) -> Line:
    """A row with the ticks of the metrics."""
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
    """The run with the better value, "A" or "B"; "" if neither."""
    if a == b or name in NEITHER:
        return ""
    return "A" if (a > b) == (name in GREATER_IS_BETTER) else "B"


# Curves.


Values = NDArray[np.float64]

LABEL_WIDTH: Final = 7  # columns for labels, including a blank
SAMPLES_PER_POINT: Final = 64  # samples of the curve between two points
NOW_TICKS: Final = 500  # window in ticks of the present throughput

# Bits of a braille pattern with 1 to 4 dots from the bottom, in the left and right column.
RISING: Final = np.array([[0x40, 0x44, 0x46, 0x47], [0x80, 0xA0, 0xB0, 0xB8]])

STEPS_OF_TEN: Final = (1, 1.5, 2, 3, 4, 5, 6, 8, 10)  # ends of an axis
CURVE_CHARACTERS: Final = " .:|"  # filled to 0, 1, 2, 3 levels, in ASCII
LINE_CHARACTERS: Final = " .-'"  # a line at these levels


def throughput_over_time(curve: Curve, points: int) -> Values:
    """(points,) deliveries per 1,000 ticks, each over at least the last NOW_TICKS."""
    bounds = edges(curve.ticks, points)
    return _rate(curve, np.minimum(bounds[:-1], bounds[1:] - NOW_TICKS), bounds[1:])


def waiting_over_time(curve: Curve, points: int) -> Values:
    """(points,) mean number of waiting robots."""
    bounds = edges(curve.ticks, points)
    width = np.maximum(1, np.diff(bounds))
    steps = np.arange(SAMPLES_PER_POINT) / SAMPLES_PER_POINT
    ticks = (bounds[:-1, None] + (width[:, None] * steps)).astype(np.int64) + 1
    mean: Values = curve.at(ticks, WAITING_ROBOTS).mean(axis=1)
    return mean


def now_throughput(curve: Curve) -> float:
    """Deliveries per 1,000 ticks over the last NOW_TICKS."""
    last = np.array([curve.ticks])
    return float(_rate(curve, last - NOW_TICKS, last)[0])


def _rate(curve: Curve, begin: NDArray[np.int64], end: NDArray[np.int64]) -> Values:
    """Deliveries per 1,000 ticks; ends are rounded down to ticks with rows in the curve."""
    end = end - end % curve.every
    begin = np.clip(begin - begin % curve.every, 0, np.maximum(0, end - curve.every))
    delivered = curve.at(end, DELIVERED_ORDERS) - curve.at(begin, DELIVERED_ORDERS)
    rate: Values = 1000.0 * delivered / np.maximum(1, end - begin)
    return rate


def edges(ticks: int, points: int) -> NDArray[np.int64]:
    """(points + 1,) the boundaries in ticks of the points of a curve."""
    return np.linspace(0, ticks, points + 1).astype(np.int64)


def points_for(width: int, dots: bool) -> int:
    """Number of points of a curve `width` columns wide, labels included."""
    return max(1, (width - LABEL_WIDTH) * (2 if dots else 1))


def drawn_curve(values: Values, rows: int, dots: bool, filled: bool = True) -> list[str]:
    """Rows of characters, labels included; a rounded maximum is the full height."""
    top = nice(float(values.max(initial=0.0)))
    levels = 4 if dots else len(CURVE_CHARACTERS) - 1
    heights = np.round(values / top * rows * levels).astype(np.int64)
    heights = np.maximum(heights, (values > 0).astype(np.int64))
    below = np.zeros_like(heights) if filled else _below_line(heights)
    signs = CURVE_CHARACTERS if filled else LINE_CHARACTERS
    lifted = [(rows - 1 - row) * levels for row in range(rows)]
    bodies = [_curve_row(heights - lift, below - lift, "" if dots else signs) for lift in lifted]
    labels = [number(top), *[""] * (rows - 2), "0"]
    return [
        f"{label:>{LABEL_WIDTH - 1}} {body}" for label, body in zip(labels, bodies, strict=True)
    ]


def _below_line(heights: NDArray[np.int64]) -> NDArray[np.int64]:
    """(points,) the empty height below a line, which connects each point to the one before."""
    before = np.concatenate((heights[:1], heights[:-1]))
    return np.maximum(0, np.minimum(heights - 1, before))


def _curve_row(heights: NDArray[np.int64], below: NDArray[np.int64], signs: str) -> str:
    """One row between the heights `below` and `heights`, in `signs` or, if "", in braille."""
    if signs:
        levels = np.clip(heights, 0, len(signs) - 1)
        levels = np.where(below >= len(signs) - 1, 0, levels)
        return "".join(signs[level] for level in levels)
    filled = np.concatenate((np.zeros((2, 1), np.int64), RISING), axis=1)
    top, bottom = (np.clip(one, 0, 4).reshape(-1, 2) for one in (heights, below))
    patterns = filled[0, top[:, 0]] | filled[1, top[:, 1]]
    patterns &= ~(filled[0, bottom[:, 0]] | filled[1, bottom[:, 1]])
    return "".join(chr(0x2800 + pattern) for pattern in patterns.tolist())


def nice(value: float) -> float:
    """`value` rounded up to a number of STEPS_OF_TEN times a power of ten."""
    if value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in STEPS_OF_TEN if value <= step * power * 1.000001))
