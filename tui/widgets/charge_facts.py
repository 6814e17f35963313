"""What the inspector says about batteries: of a robot, and of a charger."""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.drawings.looks import LOW_CHARGE
from automaton.engine.robot_states import BATTERY_FULL, STATUS_DEPLETED, STATUS_FAILING, is_charging
from automaton.engine.state import GOAL_CHARGE, NIL
from automaton.history.explanation import (
    charger_queue,
    charging_at,
    out_of_order,
    sent_to,
    up_to,
)
from automaton.units import count, percent
from tui.playback.panel_view import View
from tui.widgets.signs import Signs, bar
from tui.widgets.styled_lines import Line, Span, fact, line, linked, robot_link

Parts = list[str | Span]
BAR_WIDTH: Final = 16  # columns of a full battery
MAX_QUEUE_LINES: Final = 12  # robots of a line that are told one by one


def has_batteries(view: View) -> bool:
    """Whether the robots run on batteries."""
    return view.run.resolved.scenario.battery is not None


def may_fail(view: View) -> bool:
    """Whether robots may go down."""
    faults = view.run.resolved.scenario.faults
    return has_batteries(view) or bool(faults.listed or faults.probability)


def battery(view: View, robot: int, signs: Signs) -> Parts:
    """A bar and a number."""
    if not has_batteries(view):
        return []
    charge = int(view.snapshot.robots.charge[robot])
    look = "warn" if charge < LOW_CHARGE else "plain"
    drawn = bar(charge / BATTERY_FULL, BAR_WIDTH, signs).replace(" ", signs.off)
    return [Span(drawn, look), f" {percent(charge / BATTERY_FULL)}"]


def charging_plan(view: View, robot: int) -> Parts:
    """Up to which level it charges or is going to, how long that takes, and its place in the queue."""
    fleet, snapshot = view.snapshot.robots, view.snapshot
    if fleet.goal_type[robot] != GOAL_CHARGE:
        return []
    cell = int(fleet.goal_cell[robot])
    if is_charging(fleet)[robot]:
        return [up_to(snapshot, robot)]
    told = f"up to {percent(int(fleet.charge_target[robot]) / BATTERY_FULL, 0)}"
    in_line = charger_queue(snapshot, cell)
    if robot in in_line:
        told += f", place {in_line.index(robot) + 1} of {len(in_line)} in the queue"
    elif ahead := len(in_line) + len(charging_at(snapshot, cell)):
        told += f"; {count(ahead, 'robot')} {'is' if ahead == 1 else 'are'} there now"
    return [told]


def condition(view: View, robot: int) -> list[str | Span]:
    """Whether it is down, since when and until when."""
    fleet, snapshot = view.snapshot.robots, view.snapshot
    if not may_fail(view):
        return []
    status = int(fleet.status[robot])
    if status == STATUS_FAILING:
        return [Span("fails when what it does is over", "warn")]
    if status < STATUS_DEPLETED:
        return ["in order"]
    told = linked(out_of_order(snapshot, robot), view.floor_plan, "warn")
    if fleet.cell[robot] == NIL:
        return list(told)
    since = int(fleet.since[robot]) + 1  # the first tick lost, that of the event
    return [*line("since ", Span(f"tick {since:,}", "link", ("tick", since)), ": "), *told]


def charger_lines(view: View, cell: int, width: int) -> list[Line]:
    """Who charges in a cell, who queues, and who is on the way."""
    snapshot = view.snapshot
    lines: list[Line] = []
    there = charging_at(snapshot, cell)
    for robot in there:
        charge = percent(int(snapshot.robots.charge[robot]) / BATTERY_FULL, 0)
        words = f" at {charge}, {up_to(snapshot, robot)}"
        lines += fact("charges", robot_link(robot), words, width=width)
    if not there:
        lines += fact("charges", "no robot", width=width)
    in_line = charger_queue(snapshot, cell)
    for place, robot in enumerate(in_line[:MAX_QUEUE_LINES]):
        lines += fact("" if place else "queue", *_arriving(view, robot), width=width)
    if len(in_line) > MAX_QUEUE_LINES:
        lines += fact("", f"and {len(in_line) - MAX_QUEUE_LINES:,} more", width=width)
    for place, robot in enumerate(sent_to(snapshot, cell)[:MAX_QUEUE_LINES]):
        far = f", {count(int(snapshot.robots.route_length[robot]), 'cell')} away"
        lines += fact("" if place else "sent here", *_arriving(view, robot), far, width=width)
    return lines


def _arriving(view: View, robot: int) -> Parts:
    fleet = view.snapshot.robots
    charge, level = (
        int(field[robot]) / BATTERY_FULL for field in (fleet.charge, fleet.charge_target)
    )
    return [robot_link(robot), f" at {percent(charge, 0)}, up to {percent(level, 0)}"]


def battery_figures(view: View) -> tuple[float, float] | None:
    """The emptiest battery and the mean, as shares; None where there are none."""
    if not has_batteries(view):
        return None
    charge = view.snapshot.robots.charge
    return float(np.min(charge)) / BATTERY_FULL, float(np.mean(charge)) / BATTERY_FULL
