"""The inspector's facts about a robot: its state, battery, type and last events."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from automaton.drawings.looks import LOW_CHARGE, directions
from automaton.engine import observation as codes
from automaton.engine.observation import (
    CAUSE_NOT_WAITING,
    CAUSE_REDUCED_SPEED,
    is_waiting,
    waited_ticks,
)
from automaton.engine.robot_states import is_charging
from automaton.engine.state import (
    BATTERY_FULL,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    NIL,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_FAILING,
    STATUS_TOWED,
    Array,
)
from automaton.history.event_history import Event, event_words
from automaton.history.explanation import doing, out_of_order
from automaton.history.state_words import (
    charger_queue,
    charging_at,
    detour_words,
    gate_words,
    is_kept_by_gate,
    sent_to,
    station_of,
    up_to,
)
from automaton.scenario.fleet import FleetType, TypeBattery
from automaton.units import count, percent
from automaton.vocabulary import CONDITION_WORDS, HEADING_WORDS, robot_word, with_cause
from automaton.vocabulary import IN_WAIT_CYCLE as IN_WAIT_CYCLE
from tui.playback.panel_view import View
from tui.widgets.panel import (
    UNICODE_SIGNS,
    Facts,
    Line,
    Parts,
    Signs,
    Span,
    bar,
    cell_link,
    fact,
    fact_lines,
    line,
    linked,
    order_link,
    robot_link,
    several,
    title,
    wrapped,
)
from tui.widgets.pod_facts import (
    carried_pod,
    due_facts,
    has_pods,
    makes_trips,
    robot_trip,
    station_link,
)
from tui.widgets.zone_facts import robot_zone

BAR_WIDTH: Final = 16  # columns of a full battery's bar
MAX_QUEUE_LINES: Final = 12  # listed robots of a queue; of more, only the number is given
LAST_EVENTS: Final = 5
ON_RAILS: Final = 2  # headings of a robot that drives forwards and backwards


def robot_lines(view: View, robot: int, width: int, signs: Signs = UNICODE_SIGNS) -> list[Line]:
    """All facts about a robot."""
    fleet = view.snapshot.robots
    state = Span(f" {_state(view, robot)}", _look(view, robot))
    lines = wrapped(line(title(f"robot {robot}"), state), width, indent=2)
    facts: Facts = [
        ("type", _type(view, robot)),
        ("waits for", _waits_for(view, robot)),
        ("battery", battery(view, robot, signs)),
        ("charging", charging_plan(view, robot)),
        ("condition", condition(view, robot)),
        ("delayed", _delay(view, robot)),
        ("cell", _place(view, robot)),
        ("heading", [_heading(view, robot)]),
        *_task(view, robot),
        ("ahead", _ahead(view, robot)),
        ("goal", _goal(view, robot)),
        ("route", _route(view, robot)),
        ("streets", [said] if (said := detour_words(view.snapshot, robot)) else []),
        ("priority", [str(int(fleet.priority[robot]))]),
        *robot_zone(view, robot),
        ("home", _home(view, robot)),
        ("so far", _so_far(view, robot)),
    ]
    return [*lines, *fact_lines(facts, width), (), *_last_events(view, robot)]


def _type(view: View, robot: int) -> Parts:
    """The robot's type and its differences; [] if all robots are alike."""
    kind = type_of(view, robot)
    if kind is None:
        return []
    facts = [f"{kind.move_time_factor} x durations.move" if kind.move_time_factor > 1 else ""]
    facts += [own_durations(kind), "" if kind.battery == TypeBattery() else "its own battery"]
    facts += [f"carries up to {kind.payload:,}" if kind.payload else ""]
    facts += [f"allocation {kind.own_allocation}" if kind.own_allocation else ""]
    told = ", ".join(fact for fact in facts if fact)
    return [kind.name, f": {told}" if told else ""]


def _delay(view: View, robot: int) -> Parts:
    """The last tick of the robot's delay; [] if it is not delayed."""
    snapshot = view.snapshot
    if not len(snapshot.delayed_until) or snapshot.delayed_until[robot] <= snapshot.tick:
        return []
    last = int(snapshot.delayed_until[robot])
    return [Span(f"up to tick {last:,}", "warn")]


def _state(view: View, robot: int) -> str:
    """The robot's activity, or its wait with cause and duration."""
    fleet = view.snapshot.robots
    if fleet.cause[robot] == CAUSE_NOT_WAITING:
        return doing(view.snapshot, robot)
    ticks = int(waited_ticks(fleet.cause[robot], fleet.since[robot], view.snapshot.tick))
    return with_cause(f"{robot_word(fleet, robot)} for {count(ticks, 'tick')}", fleet, robot)


def _look(view: View, robot: int) -> str:
    fleet = view.snapshot.robots
    if fleet.wait_cycle_ticks[robot] or fleet.status[robot] in (STATUS_DEPLETED, STATUS_FAILED):
        return "fault"
    return "warn" if is_waiting(fleet.cause[robot]) else "plain"


def _waits_for(view: View, robot: int) -> Parts:
    fleet = view.snapshot.robots
    parts: Parts = []
    if fleet.wanted[robot] != NIL:
        parts.append(cell_link(view.floor_plan, int(fleet.wanted[robot])))
    if fleet.blocker[robot] != NIL:
        parts += [" held by ", robot_link(int(fleet.blocker[robot]))]
    if is_kept_by_gate(int(fleet.cause[robot])):
        parts.append(gate_words(view.snapshot, robot).partition(")")[2])
    return parts


def _place(view: View, robot: int) -> Parts:
    fleet, floor_plan = view.snapshot.robots, view.floor_plan
    cell = int(fleet.cell[robot])
    if cell == NIL:
        if fleet.status[robot] >= STATUS_TOWED:
            return [f"off the floor, {CONDITION_WORDS[fleet.status[robot]]}"]
        return ["in its parking bay" if fleet.bay[robot] != NIL else "off the floor"]
    parts: Parts = [
        cell_link(floor_plan, cell),
        f" {floor_plan.kind_of(cell).name}",
    ]
    if fleet.claim[robot] != NIL:
        parts += [", on its way to ", cell_link(floor_plan, int(fleet.claim[robot]))]
    return parts


def _heading(view: View, robot: int) -> str:
    fleet = view.snapshot.robots
    types = view.run.resolved.fleet.types
    own = types[int(fleet.type[robot]) % len(types)]  # types with a load follow
    words = HEADING_WORDS[own.headings][int(fleet.heading[robot])] or "none: it never turns"
    if own.headings != ON_RAILS:
        return words
    front = directions(fleet, [one.headings for one in types])[robot]  # as on the map
    return f"{HEADING_WORDS[4][front]}, on rails {words}"


def _home(view: View, robot: int) -> Parts:
    """The robot's home, and the parking bay that opens on it, if any."""
    fleet, floor_plan = view.snapshot.robots, view.floor_plan
    parts: Parts = [cell_link(floor_plan, int(fleet.home[robot]))]
    if fleet.bay[robot] != NIL:
        parts += [", at its parking bay ", cell_link(floor_plan, int(fleet.bay[robot]))]
    return parts


def _task(view: View, robot: int) -> Facts:
    """The robot's load and order, or pod and trip."""
    if has_pods(view):
        load = carried_pod(view, robot)
        if makes_trips(view):
            return [("load", load), *robot_trip(view, robot)]
    else:
        load = _load(view, robot)
    return [
        ("load", load),
        ("order", _order(view, robot)),
        ("due", due_facts(view, int(view.snapshot.robots.order[robot]))),
    ]


def _load(view: View, robot: int) -> Parts:
    load = int(view.snapshot.robots.load[robot])
    if load == NIL:
        return ["none"]
    target = int(view.snapshot.orders.target[load])
    if target == NIL:
        return [order_link(load, "load")]
    return [order_link(load, "load"), ", destination ", _slot(view, target)]


def _slot(view: View, slot: int) -> Span:
    return cell_link(view.floor_plan, int(view.snapshot.slots.cell[slot]))


def _order(view: View, robot: int) -> Parts:
    order = int(view.snapshot.robots.order[robot])
    if order == NIL:
        return ["none"]
    known = int(view.snapshot.orders.release_tick[order])
    ticks = count(view.snapshot.tick - known, "tick")
    return [order_link(order), *([f", known for {ticks}"] if known else [])]


def _ahead(view: View, robot: int) -> Parts:
    """The robot's queue of announced orders; only their number if it is not selected."""
    if view.snapshot.selected != robot:
        many = int(view.snapshot.robots.order_queue_length[robot])
        return [count(many, "order")] if many else []
    return several([order_link(order) for order in view.snapshot.order_queue.tolist()])


def _goal(view: View, robot: int) -> Parts:
    """The purpose and place of the robot's goal."""
    fleet, orders = view.snapshot.robots, view.snapshot.orders
    goal, order, slot = (int(field[robot]) for field in (fleet.goal_type, fleet.order, fleet.slot))
    if goal == GOAL_NONE:
        return ["none"]
    if goal == GOAL_PARK:
        return ["to park"]
    if goal == GOAL_CHARGE:
        return ["to charge at ", cell_link(view.floor_plan, int(fleet.goal_cell[robot]))]
    station = station_of(view.snapshot, robot)
    if station != NIL:
        return ["to station ", station_link(view, station)]
    if goal == GOAL_STOP:
        return ["to a stop at ", cell_link(view.floor_plan, int(fleet.goal_cell[robot]))]
    if goal == GOAL_PICK:
        slot = NIL if order == NIL else int(orders.current_slot[order])
    words = ("to store its pod", "to lift a pod") if has_pods(view) else ("to drop", "to pick up")
    parts: Parts = [words[goal != GOAL_DROP]]
    load = int(fleet.load[robot])
    if slot == NIL:
        return parts
    parts += [" at ", _slot(view, slot)]
    if goal == GOAL_DROP and load != NIL and not has_pods(view) and slot != orders.target[load]:
        parts.append(" on the way; it is picked up again there")
    return parts


def _route(view: View, robot: int) -> Parts:
    fleet = view.snapshot.robots
    steps, goal_cell = int(fleet.route_length[robot]), int(fleet.goal_cell[robot])
    if goal_cell == NIL:
        return []
    parts: Parts = [f"{count(steps, 'cell')} to ", cell_link(view.floor_plan, goal_cell)]
    if fleet.retreat_moves[robot] > 0:
        parts.append(f", retreating {count(int(fleet.retreat_moves[robot]), 'step')}")
    return parts


def _so_far(view: View, robot: int) -> Parts:
    """The robot's work since the start, at the tick of the figures."""
    figures = view.playback.figures[view.side]
    slowed = int(view.snapshot.robots.lost[robot, CAUSE_REDUCED_SPEED])
    return [
        f"{count(int(figures.operations[robot]), 'operation')}, "
        f"active {percent(float(figures.active[robot]), 0)}",
        *([f", slowed by {count(slowed, 'tick')}"] if slowed else []),
    ]


def _last_events(view: View, robot: int) -> list[Line]:
    event_history = view.run.event_history
    events = event_history.events[: event_history.index_at(view.snapshot.tick)]
    indices = last_of(events, robot, LAST_EVENTS)
    if not len(indices):
        return [line(title("no events yet"))]
    rows = (Event(*(int(value) for value in events[index])) for index in reversed(indices))
    return [
        line(title("last events")),
        *(event_line(event, trips=makes_trips(view)) for event in rows),
    ]


def last_of(events: Array, robot: int, most: int) -> Array:
    """Indices of the last events of a robot; it searches backwards in growing steps."""
    reach = 1024
    while True:
        first = max(0, len(events) - reach)
        found = first + np.flatnonzero(events[first:, 2] == robot)
        if len(found) >= most or first == 0:
            last: Array = found[-most:]
            return last
        reach *= 4


# Batteries and chargers.


def has_batteries(view: View) -> bool:
    """Whether the robots run on batteries."""
    return view.run.resolved.scenario.battery is not None


def may_fail(view: View) -> bool:
    """Whether robots may break down or run empty."""
    faults = view.run.resolved.scenario.faults
    return has_batteries(view) or bool(faults.listed or faults.probability)


def battery(view: View, robot: int, signs: Signs) -> Parts:
    """The charge as a bar and a number."""
    if not has_batteries(view):
        return []
    charge = int(view.snapshot.robots.charge[robot])
    look = "warn" if charge < LOW_CHARGE else "plain"
    drawn = bar(charge / BATTERY_FULL, BAR_WIDTH, signs).replace(" ", signs.off)
    return [Span(drawn, look), f" {percent(charge / BATTERY_FULL)}"]


def charging_plan(view: View, robot: int) -> Parts:
    """The level to which a robot (will) charge, the duration, and its place in the queue."""
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


def condition(view: View, robot: int) -> Parts:
    """The condition of a robot; if down, since and until when."""
    fleet, snapshot = view.snapshot.robots, view.snapshot
    if not may_fail(view):
        return []
    status = int(fleet.status[robot])
    word = CONDITION_WORDS[status]
    if status == STATUS_FAILING:
        return [Span(f"{word}: it breaks down after its current operation", "warn")]
    if status < STATUS_DEPLETED:
        return [word]
    told = linked(out_of_order(snapshot, robot), view.floor_plan, "warn")
    if fleet.cell[robot] == NIL:
        return list(told)
    since = int(fleet.since[robot]) + 1  # the first lost tick, that of the event
    return [*line("since ", Span(f"tick {since:,}", "link", ("tick", since)), ": "), *told]


def charger_lines(view: View, cell: int, width: int) -> list[Line]:
    """Robots that charge in a cell, queue for it, and drive to it."""
    snapshot = view.snapshot
    lines: list[Line] = []
    there = charging_at(snapshot, cell)
    for robot in there:
        charge = percent(int(snapshot.robots.charge[robot]) / BATTERY_FULL, 0)
        words = f" at {charge}, {up_to(snapshot, robot)}"
        lines += fact("charging", robot_link(robot), words, width=width)
    if not there:
        lines += fact("charging", "no robot", width=width)
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
    """The lowest and the mean charge, as shares; None without batteries."""
    if not has_batteries(view):
        return None
    charge = view.snapshot.robots.charge
    return float(np.min(charge)) / BATTERY_FULL, float(np.mean(charge)) / BATTERY_FULL


# Types of robots.


def has_types(view: View) -> bool:
    """Whether the scenario has named robot types."""
    return bool(view.run.resolved.scenario.fleet.types)


def type_of(view: View, robot: int) -> FleetType | None:
    """The type of a robot; None if all are alike."""
    types = view.run.resolved.scenario.fleet.types
    return types[view.run.resolved.fleet.type_of[robot]] if types else None


def closed_to(view: View, cell: int) -> list[str]:
    """The robots to which a cell is closed: types, all, or those with or without a load."""
    x, y = view.run.resolved.floor_plan.xy(cell)
    areas = view.run.resolved.scenario.areas.values()
    return list(dict.fromkeys(who for area in areas if area.holds(x, y) for who in area.closed_to))


def own_durations(kind: FleetType) -> str:
    """The durations that a type sets itself: "move 2, turn 1 / 3"."""
    stated = msgspec.to_builtins(kind.durations)
    ticks = {name: value for name, value in stated.items() if value is not None}
    return ", ".join(
        f"{name} {' / '.join(map(str, value.values())) if isinstance(value, dict) else value}"
        for name, value in ticks.items()
    )


# Events as rows.


EVENT_LOOKS: Final = {
    codes.EVENT_DELIVERED: "good",
    codes.EVENT_DEADLOCK: "fault",
    codes.EVENT_DEPLETED: "fault",
    codes.EVENT_FAILED: "fault",
    codes.EVENT_ILLEGAL_DECISION: "fault",
    codes.EVENT_WAIT_CYCLE: "warn",
    codes.EVENT_RETREATED: "warn",
    codes.EVENT_PART_FINISHED: "good",
    codes.EVENT_ZONES_REDESIGNED: "warn",
}


def event_line(
    event: Event, robot_width: int = 0, tick_width: int = 7, trips: bool = False
) -> Line:
    """An event as a row: tick (a link), robot, and the event in words about orders or trips.

    With `robot_width` 0 the robot is left out.
    """
    tick = Span(f"{event.tick:,}", "link", ("tick", event.tick))
    gap = " " * (tick_width - len(tick.text))
    number = "" if event.robot == NIL else event.robot
    robot = f"{number:>{robot_width}}" if robot_width else ""
    look = EVENT_LOOKS.get(event.code, "plain")
    return line(gap, tick, robot, Span(f" {event_words(event, trips)}", look))
