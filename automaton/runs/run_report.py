"""The report of a run: what matters first, its bottleneck, the run by hour, and all metrics."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from typing import Any, NamedTuple

from automaton.documents.report_document import (
    Heading,
    Listed,
    NumberText,
    ReportDocument,
    ShareBars,
    Table,
    Text,
)
from automaton.documents.text_output import print_document
from automaton.runs.bottleneck import bottleneck_sentences, flow_name, rate
from automaton.runs.headless import LongestDeadlock, Outcome
from automaton.runs.metric_catalogue import (
    METRIC_CATALOGUE,
    PER_1000_TICKS,
    TIME_TITLE,
    USE_MEANINGS,
    time_shares,
    units_of,
)
from automaton.runs.metric_sums import TRAFFIC_SUMS
from automaton.runs.periods import Period, moment
from automaton.runs.run_diagnosis import describe_jam, describe_wait_cycles
from automaton.scenario.schema import Scenario
from automaton.strategy.lookup import NO_STRATEGY
from automaton.units import SECONDS_PER_UNIT, Unit, count, duration, number, percent, shown_unit
from automaton.world.resolved import Resolved

LOST_METRIC_PREFIX = "lost_"
ROBOT_COLUMNS = {  # heading: metric of the robot
    "robot": "robot",
    "type": "type",
    "ops": "operations",
    "moves": "moves",
    "turns": "turns",
    "picks": "picks",
    "drops": "drops",
    "tries": "try_drops",
    "serves": "serves",
    "waits": "waits",
    "used": "utilization",
    "empty": "empty_ticks_share",
    "lost": "lost",
    "slowdown": "slowdown_ticks",
}
SLOWDOWN = "slowdown_ticks"
ROWS_SHOWN = 50  # of stations, chargers and robots
GROUP_HEADS = ("orders", "delivered", "lead time", "95th percentile", "late")
METRICS_TOLD = (
    "throughput",
    "utilization",
    "blocked_share",
    "lead_time",
    "late_share",
    "lines_done",
)
LOST_CAUSES_TOLD = 3
NEVER_WITH_CELLS = ("try_drops",)  # left out to make room for the distance


def print_report(resolved: Resolved, outcome: Outcome) -> None:
    """Print the report."""
    print_document(run_document(resolved, outcome))


def run_document(resolved: Resolved, outcome: Outcome) -> ReportDocument:
    """The whole report: what matters first, then the bottleneck, then where the time went."""
    tick, cell = units_of(resolved)
    document = ReportDocument(f"{resolved.scenario.name}, seed {resolved.scenario.seed}")
    document.add(Listed(heading(resolved, outcome, tick), mark=""))
    document.add(headline_table(resolved, outcome, tick))
    document.add(*[Text(text) for text in bottleneck_sentences(resolved, outcome.periods)])
    if outcome.by_period:
        document.add(periods_table(resolved, outcome.periods, outcome.metrics))
    document.add(ShareBars(TIME_TITLE, [("", time_shares(outcome.uses))]))
    document.add(uses_table(outcome))
    document.add(Heading("All metrics", 3), metrics_table(outcome, tick, cell))
    document.add(*([types_table(outcome, tick)] if outcome.types else []))
    document.add(*([priorities_table(outcome, tick)] if outcome.priorities else []))
    document.add(*([classes_table(outcome, tick)] if outcome.classes else []))
    for rows, table, what in (
        (outcome.stations, stations_table(outcome), "station"),
        (outcome.chargers, chargers_table(outcome), "charger"),
        (outcome.robots, robots_table(outcome, tick, cell), "robot"),
    ):
        document.add(*([table] if rows else []))
        if (rest := len(rows) - ROWS_SHOWN) > 0:
            document.add(Text(f"... and {count(rest, f'more {what}')}: --json prints all"))
    return document


def headline_table(resolved: Resolved, outcome: Outcome, tick: Unit) -> Table:
    """The six metrics that matter first."""
    metrics = outcome.metrics
    rows = [["delivered", f"{outcome.delivered:,} of {count(outcome.orders, 'order')}"]]
    rows += [["throughput", throughput_text(metrics["throughput"], tick)]]
    if "lead_time" in metrics:
        mean, p95 = (time_text(metrics[name], tick) for name in ("lead_time", "lead_time_p95"))
        rows += [["lead time", f"mean {mean}, 95th percentile {p95}"]]
    if "late_share" in metrics:
        rows += [["late", percent(metrics["late_share"])]]
    rows += [["utilization", f"{percent(metrics['utilization'])} of robot time spent on orders"]]
    total = max(sum(outcome.uses.values()), 1)
    traffic = sum(outcome.uses.get(name, 0) for name in (*TRAFFIC_SUMS, "lost_standing"))
    rows += [["lost in traffic", f"{percent(traffic / total)} of robot time"]]
    rows += (
        [["stranded", f"{count(int(n), 'time')} without charge"]]
        if (n := metrics.get("battery_depletions"))
        else []
    )
    return Table(
        ("metric", "value"), [*rows, *deadlock_row(resolved, outcome, tick)], also_left=(1,)
    )


def deadlock_row(resolved: Resolved, outcome: Outcome, tick: Unit) -> list[list[str]]:
    """The deadlocks of a run, where and when the longest one was."""
    if outcome.deadlock is None:
        return []
    return [["deadlocks", deadlock_text(resolved, outcome.deadlock, tick)]]


def deadlock_text(resolved: Resolved, deadlock: LongestDeadlock, tick: Unit) -> str:
    """Such as "3 deadlocks, the longest 47 min at (72, 38) from 11:14"."""
    many = count(deadlock.deadlocks, "deadlock")
    which = "the longest " if deadlock.deadlocks > 1 else ""
    when = moment(resolved, deadlock.first_tick)
    lasted = time_text(deadlock.ticks, tick)
    return f"{many}, {which}{lasted} at {deadlock.cell} from {when}"


def time_text(ticks: float, tick: Unit) -> str:
    """Ticks in the unit in which they are printed."""
    value, name = duration(ticks, tick)
    return f"{number(value)} {name}"


def throughput_text(per_1000_ticks: float, tick: Unit) -> str:
    """A throughput by the hour; without times in 1,000 ticks."""
    if tick.seconds is None:
        return f"{number(per_1000_ticks)} orders in 1,000 ticks"
    an_hour = per_1000_ticks * SECONDS_PER_UNIT["h"] / (1000 * tick.seconds)
    return f"{number(an_hour)} orders an hour"


class PeriodColumn(NamedTuple):
    """A column of the table of periods."""

    head: str
    unit: str
    value: Callable[[Period], float]
    digits: int = 0

    def text(self, period: Period) -> str:
        """The cell of a period."""
        value = self.value(period)
        text = f"{round(value, self.digits):,.{self.digits}f}"
        return NumberText(f"{text} %", value / 100) if self.unit == "%" else NumberText(text, value)


OPTIONAL_COLUMNS = {  # metric: heading of the columns that runs with it have
    "late_share": ("late",),
    "lost_station_queue": ("in queues",),
    "lost_charger_queue": ("charging", "wait to charge"),
    "downtime": ("down",),
}


def shown_columns(
    resolved: Resolved, periods: Sequence[Period], has: Container[str]
) -> list[PeriodColumn]:
    """The columns of a table of periods; `has`: the metrics that were measured."""
    what = flow_name(resolved)
    per = f"{what}/h" if units_of(resolved)[0].seconds else f"{what}/1000"
    columns = [
        PeriodColumn(per, per, lambda one: rate(resolved, one)),
        PeriodColumn("backlog", what, lambda one: one.backlog),
        PeriodColumn("late", "orders", lambda one: one.late or 0),
        PeriodColumn("on orders", "robots", lambda one: one.on_orders, 1),
        PeriodColumn("in traffic", "robots", lambda one: one.in_traffic, 1),
        PeriodColumn("in queues", "robots", lambda one: one.in_station_queues, 1),
        PeriodColumn("charging", "robots", lambda one: one.charging, 1),
        PeriodColumn("wait to charge", "robots", lambda one: one.for_chargers, 1),
        PeriodColumn("down", "robots", lambda one: one.down, 1),
    ]
    hidden = {h for name, heads in OPTIONAL_COLUMNS.items() if name not in has for h in heads}
    columns = [column for column in columns if column.head not in hidden]
    if periods[0].stations:
        columns.append(PeriodColumn("stations", "%", lambda one: mean_percent(one.stations)))
    if periods[0].chargers:
        columns.append(PeriodColumn("chargers", "%", lambda one: mean_percent(one.chargers)))
    return columns


def periods_table(resolved: Resolved, periods: Sequence[Period], has: Container[str]) -> Table:
    """One line for each period: flow, what robots did on average, how busy the rest was."""
    columns = shown_columns(resolved, periods, has)
    rows = [[one.name, *(column.text(one) for column in columns)] for one in periods]
    units = [column.unit for column in columns]
    groups = [("robots", units.count("robots")), ("busy", units.count("%"))]
    heads = ["from", *(column.head for column in columns)]
    return Table(heads, rows, groups=[group for group in groups if group[1]])


def mean_percent(shares: Sequence[float]) -> float:
    """The mean of some shares, in percent; NaN without any."""
    return 100 * sum(shares) / len(shares) if shares else math.nan


def uses_table(outcome: Outcome) -> Table:
    """Where the time of the robots went; the shares add up to all of it."""
    total, robots = max(sum(outcome.uses.values()), 1), len(outcome.robots)
    rows = []
    for name, ticks in outcome.uses.items():
        if not ticks:
            continue
        mean = robots * ticks / total
        rows.append([name, f"{mean:.2f}", percent(ticks / total), USE_MEANINGS[name]])
    return Table(("robot time", "robots", "share", "what it is"), rows, also_left=(3,))


def file_without_rows(resolved: Resolved) -> str:
    """The number of skipped rows of the file of orders, by mistake; "" if none was."""
    return "" if resolved.order_file is None else resolved.order_file.without_rows


def heading(resolved: Resolved, outcome: Outcome, tick: Unit) -> list[str]:
    """The scenario, how the run ended, and the size of a tick."""
    scenario = resolved.scenario
    time = f"{number(tick.of(outcome.ticks))} {tick.plural}"
    value, longer_unit = duration(outcome.ticks, tick)
    also = [f"{number(value)} {longer_unit}"] if longer_unit != tick.plural else []
    if tick.seconds is not None:
        also.append(count(outcome.ticks, "tick"))
    if also:
        time += f" ({', '.join(also)})"
    finished = "finished after" if scenario.stop.when != "never" else "ran for"
    unfinished = "stopped after" if outcome.stopped else "NOT FINISHED after"
    end = f"{finished if outcome.finished else unfinished} {time}"
    strategies = [
        f"{layer.replace('_', ' ')} "
        + (allocations(resolved) if layer == "allocation" else choice.name)
        for layer, choice in resolved.strategies.items()
        if choice.name != NO_STRATEGY and not resolved.observed
    ]
    cell = "" if scenario.units.cell is None else f", 1 cell = {scenario.units.cell}"
    digest = "" if resolved.observed else f"; digest {outcome.digest}"
    return [
        f"{scenario.name}, {count(scenario.fleet.robots, 'robot')}, seed {scenario.seed}: {end}, "
        f"{outcome.delivered:,} of {count(outcome.orders, 'order')} delivered",
        *([", ".join(strategies)] if strategies else []),
        *([f"orders of {day}"] if (day := resolved.day_in_words) else []),
        *([rows] if (rows := file_without_rows(resolved)) else []),
        *out_of_orders(outcome),
        *outcome.illegal.lines(),
        *(describe_wait_cycles(outcome.circles) if outcome.finished or outcome.stopped else []),
        *(describe_jam(outcome.jam) if outcome.finished or outcome.stopped else []),
        *refinement(scenario),
        f"1 tick = {shown_unit(scenario.units.tick)}{cell}{digest}"
        + ("" if outcome.wall_s is None else f"; computed in {1000 * outcome.wall_s:,.1f} ms"),
    ]


def allocations(resolved: Resolved) -> str:
    """The allocation strategy, followed by the own allocation strategies of robot types."""
    types = resolved.scenario.fleet.types
    usual = resolved.strategies["allocation"].name
    own = ", ".join(f"{kind.name}: {kind.own_allocation}" for kind in types if kind.own_allocation)
    if types and all(kind.own_allocation for kind in types):
        return own
    return f"{usual} ({own})" if own else usual


def refinement(scenario: Scenario) -> list[str]:
    """A sentence if the ticks of a run are finer than those of its scenario."""
    if scenario.refine == 1:
        return []
    when = "in every tick" if scenario.decide == "fine" else f"in one of {scenario.refine}"
    return [f"refined: ticks are {scenario.refine} times finer, strategies decide {when}"]


def out_of_orders(outcome: Outcome) -> list[str]:
    """A sentence if the orders ran out before the end."""
    if outcome.ran_out is None:
        return []
    taken, delivered = outcome.ran_out
    end = "not all are delivered" if delivered is None else f"the last delivered at {delivered:,}"
    return [
        f"orders ran out: the last of {outcome.orders:,} was taken at tick {taken:,}, {end}; "
        "metrics include the idle robots after it"
    ]


def metrics_table(outcome: Outcome, tick: Unit, cell: Unit | None) -> Table:
    """The metrics of the fleet with their units and meanings.

    If the scenario has units, values in ticks and cells follow the converted values.
    """
    rows, in_both = [], cell is not None or tick.seconds is not None
    for name in outcome.metrics:
        if name.startswith(LOST_METRIC_PREFIX):
            continue
        kind, meaning = METRIC_CATALOGUE.get(name, ("times", "counted by a strategy"))
        value, in_unit = in_units(outcome.metrics[name], kind, tick, cell)
        if in_both and kind in ("ticks", "cells"):
            in_unit += f" ({number(outcome.metrics[name])} {kind})"
        rows.append([name, value, in_unit, meaning + by_hour(outcome.metrics[name], kind, tick)])
    return Table(("metric", "value", "unit", "meaning"), rows, also_left=(2, 3))


def by_hour(value: float, kind: str, tick: Unit) -> str:
    """A rate per 1,000 ticks as a rate per hour: "; 120 /h"; "" for other metrics or without units."""
    if PER_1000_TICKS not in kind or tick.seconds is None:
        return ""
    return f"; {number(value * SECONDS_PER_UNIT['h'] / (1000 * tick.seconds))} /h"


def in_units(value: float, kind: str, tick: Unit, cell: Unit | None) -> tuple[NumberText, str]:
    """A value and its unit as text; `kind` is the unit in METRIC_CATALOGUE."""
    amount, name = value, kind
    if kind == "share":
        return NumberText(f"{100 * value:.1f}", 100 * value), "%"
    if kind == "ticks":
        amount, name = duration(value, tick) if cell else (tick.of(value), tick.plural)
    elif kind == "cells" and cell is not None:
        amount, name = cell.of(value), cell.name
    return NumberText(number(amount), amount), name


def types_table(outcome: Outcome, tick: Unit) -> Table:
    """One line for each robot type: deliveries, and time by action."""
    heads = ("type", "robots", "move time", "payload", "delivered", "driving", "handling", "used")
    rows = []
    for row in outcome.types:
        payload = "any" if row["payload"] is None else number(row["payload"])
        driving = number(tick.of(row["move_ticks"] + row["turn_ticks"]))
        handling = number(tick.of(row["pick_ticks"] + row["drop_ticks"]))
        counted = (number(row[name]) for name in ("robots", "move_time_factor"))
        done = number(row["delivered"])
        used = percent(row["utilization"], 0)
        rows.append([row["type"], *counted, payload, done, driving, handling, used])
    return Table(heads, rows)


def priorities_table(outcome: Outcome, tick: Unit) -> Table:
    """One line for each priority of orders, the highest first."""
    rows = [[number(row["priority"]), *group_texts(row, tick)] for row in outcome.priorities]
    return Table(("priority", *GROUP_HEADS), rows)


def classes_table(outcome: Outcome, tick: Unit) -> Table:
    """One line for each class of orders."""
    rows = [[row["class"] or "no class", *group_texts(row, tick)] for row in outcome.classes]
    return Table(("class", *GROUP_HEADS), rows)


def group_texts(row: Mapping[str, Any], tick: Unit) -> list[str]:
    """The metrics of a group of orders, below GROUP_HEADS."""
    times = (row[name] for name in ("lead_time", "lead_time_p95"))
    texts = ["-" if ticks is None else time_text(ticks, tick) for ticks in times]
    late = "-" if row["late_share"] is None else percent(row["late_share"])
    return [*(number(row[name]) for name in ("orders", "delivered")), *texts, late]


def chargers_table(outcome: Outcome) -> Table:
    """One line for each charger, at most ROWS_SHOWN."""
    rows = [
        [
            number(row["charger"]),
            f"({row['x']}, {row['y']})",
            percent(row["utilization"]),
            f"{row['mean_queue']:.2f}",
            number(row["longest_queue"]),
        ]
        for row in outcome.chargers[:ROWS_SHOWN]
    ]
    return Table(("charger", "at", "busy", "mean queue", "longest"), rows, also_left=(1,))


def stations_table(outcome: Outcome) -> Table:
    """One line for each station for pods, at most ROWS_SHOWN."""
    rows = []
    for row in outcome.stations[:ROWS_SHOWN]:
        shares = (percent(row[name]) for name in ("service_share", "starved_share"))
        queue = f"{row['mean_queue']:.2f}", number(row["longest_queue"])
        done = number(row["visits"]), number(row["lines_done"])
        rows.append([row["station"], *done, *shares, *queue])
    heads = ("station", "visits", "lines", "serves", "starved", "mean queue", "longest")
    return Table(heads, rows)


def robots_table(outcome: Outcome, tick: Unit, cell: Unit | None) -> Table:
    """One line for each robot, at most ROWS_SHOWN, with its distance if cells have a size."""
    slows = SLOWDOWN in outcome.metrics
    serves = any("serves" in row for row in outcome.robots)
    optional = ((SLOWDOWN, slows), ("type", outcome.types), ("serves", serves))
    absent = {name for name, there in optional if not there}
    columns = {head: name for head, name in ROBOT_COLUMNS.items() if name not in absent}
    if cell is not None:
        columns = {head: name for head, name in columns.items() if name not in NEVER_WITH_CELLS}
        columns[cell.name] = "distance"
    rows = []
    for row in outcome.robots[:ROWS_SHOWN]:
        lost = sum(value for name, value in row.items() if name.startswith(LOST_METRIC_PREFIX))
        shares = {name: percent(row[name], 0) for name in ("utilization", "empty_ticks_share")}
        cells = {**row, **shares, "lost": number(tick.of(lost))}
        if cell is not None:
            cells["distance"] = number(cell.of(row["moves"]))
        if slows:
            cells[SLOWDOWN] = number(tick.of(row[SLOWDOWN]))
        texts = [cells[name] for name in columns.values()]
        rows.append([text if isinstance(text, str) else number(text) for text in texts])
    return Table(list(columns), rows, left=0)


def sentences(resolved: Resolved, outcome: Outcome) -> list[str]:
    """How a run ended and its main metrics, one per line, without tables."""
    tick, cell = units_of(resolved)
    metrics = {name: value for name, value in outcome.metrics.items() if name in METRICS_TOLD}
    lines = heading(resolved, outcome, tick)
    lines += [f"not finished: {outcome.diagnosis}"] if outcome.diagnosis else []
    for name, value in metrics.items():
        kind, meaning = METRIC_CATALOGUE[name]
        lines.append(f"{name} {' '.join(in_units(value, kind, tick, cell))}: {meaning}")
    lost = {
        name: value
        for name, value in outcome.metrics.items()
        if name.startswith(LOST_METRIC_PREFIX) and value
    }
    for name in sorted(lost, key=lambda name: -lost[name])[:LOST_CAUSES_TOLD]:
        share = percent(lost[name] / sum(lost.values()))
        lines.append(f"{name} {share} of the lost robot time: {METRIC_CATALOGUE[name][1]}")
    return lines
