"""What the inspector says about a robot."""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.engine.observation import (
    CAUSE_NOT_WAITING,
    CAUSE_REDUCED_SPEED,
    CAUSES,
    is_waiting,
    waited_ticks,
)
from automaton.engine.robot_states import STATUS_DEPLETED, STATUS_FAILED, STATUS_TOWED
from automaton.engine.state import (
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    NIL,
    Array,
)
from automaton.floor.cells import CELL_KINDS, DIRECTIONS
from automaton.history.event_history import Event
from automaton.history.explanation import doing, gate_words, is_kept_by_gate, station_of
from automaton.scenario.energy_and_faults import TypeBattery
from automaton.units import count, percent
from tui.playback.panel_view import View
from tui.widgets.charge_facts import battery, charging_plan, condition
from tui.widgets.due_facts import due_facts
from tui.widgets.event_rows import event_line
from tui.widgets.pod_facts import carried_pod, has_pods, makes_trips, robot_trip, station_link
from tui.widgets.robot_type_facts import own_durations, type_of
from tui.widgets.service_zone_facts import robot_zone
from tui.widgets.signs import UNICODE, Signs
from tui.widgets.styled_lines import (
    Line,
    Span,
    cell_link,
    fact,
    line,
    order_link,
    robot_link,
    several,
    title,
    wrapped,
)

HEADING_NAMES: Final = {  # what a robot's heading means, by kinematics
    "rail": ("east-west", "north-south"),
    "differential": DIRECTIONS,
    "omni": ("none: it never turns",),
}
LAST_EVENTS: Final = 5


def robot_lines(view: View, robot: int, width: int, signs: Signs = UNICODE) -> list[Line]:
    """Everything about one robot."""
    fleet, floor_plan = view.snapshot.robots, view.floor_plan
    state = Span(f" {_state(view, robot)}", _look(view, robot))
    lines = wrapped(line(title(f"robot {robot}"), state), width, indent=2)
    facts: list[tuple[str, list[str | Span]]] = [
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
        ("priority", [str(int(fleet.priority[robot]))]),
        *robot_zone(view, robot),
        ("home", [cell_link(floor_plan, int(fleet.home[robot]))]),
        ("bay", [] if fleet.bay[robot] == NIL else [cell_link(floor_plan, int(fleet.bay[robot]))]),
        ("so far", _so_far(view, robot)),
    ]
    for name, parts in facts:
        lines += fact(name, *parts, width=width) if parts else []
    return [*lines, (), *_last_events(view, robot)]


def _type(view: View, robot: int) -> list[str | Span]:
    """Its type with what sets it apart; nothing where all robots are alike."""
    kind = type_of(view, robot)
    if kind is None:
        return []
    facts = [f"{kind.move_time_factor} x durations.move" if kind.move_time_factor > 1 else ""]
    facts += [own_durations(kind), "" if kind.battery == TypeBattery() else "its own battery"]
    facts += [f"carries up to {kind.payload:,}" if kind.payload else ""]
    facts += [f"allocation {kind.own_allocation}" if kind.own_allocation else ""]
    told = ", ".join(fact for fact in facts if fact)
    return [kind.name, f": {told}" if told else ""]


def _delay(view: View, robot: int) -> list[str | Span]:
    """Until when it is delayed; nothing if it is not."""
    snapshot = view.snapshot
    if not len(snapshot.delayed_until) or snapshot.delayed_until[robot] <= snapshot.tick:
        return []
    last = int(snapshot.delayed_until[robot])
    return [Span(f"up to tick {last:,}", "warn")]


def _state(view: View, robot: int) -> str:
    """What it does."""
    fleet = view.snapshot.robots
    if fleet.cause[robot] == CAUSE_NOT_WAITING:
        return doing(view.snapshot, robot)
    ticks = int(waited_ticks(fleet.cause[robot], fleet.since[robot], view.snapshot.tick))
    name = CAUSES[int(fleet.cause[robot])].name
    circle = ", in a wait cycle" if fleet.wait_cycle_ticks[robot] else ""
    return f"{count(ticks, 'tick')}: {name}{circle}"


def _look(view: View, robot: int) -> str:
    fleet = view.snapshot.robots
    if fleet.wait_cycle_ticks[robot] or fleet.status[robot] in (STATUS_DEPLETED, STATUS_FAILED):
        return "fault"
    return "warn" if is_waiting(fleet.cause[robot]) else "plain"


def _waits_for(view: View, robot: int) -> list[str | Span]:
    fleet = view.snapshot.robots
    parts: list[str | Span] = []
    if fleet.wanted[robot] != NIL:
        parts.append(cell_link(view.floor_plan, int(fleet.wanted[robot])))
    if fleet.blocker[robot] != NIL:
        parts += [" held by ", robot_link(int(fleet.blocker[robot]))]
    if is_kept_by_gate(int(fleet.cause[robot])):
        parts.append(gate_words(view.snapshot, robot).partition(")")[2])
    return parts


def _place(view: View, robot: int) -> list[str | Span]:
    fleet, floor_plan = view.snapshot.robots, view.floor_plan
    cell = int(fleet.cell[robot])
    if cell == NIL:
        if fleet.status[robot] >= STATUS_TOWED:
            return ["off the floor, towed"]
        return ["in its parking bay" if fleet.bay[robot] != NIL else "off the floor"]
    parts: list[str | Span] = [
        cell_link(floor_plan, cell),
        f" {CELL_KINDS[_kind(view, cell)].name}",
    ]
    if fleet.claim[robot] != NIL:
        parts += [", on its way to ", cell_link(floor_plan, int(fleet.claim[robot]))]
    return parts


def _kind(view: View, cell: int) -> int:
    return int(view.floor_plan.kind.reshape(-1)[cell])


def _heading(view: View, robot: int) -> str:
    fleet = view.snapshot.robots
    types = view.run.resolved.fleet.types
    own = types[int(fleet.type[robot]) % len(types)]  # types with a load come behind
    names = HEADING_NAMES[own.kinematics]
    return names[int(fleet.heading[robot])]


def _task(view: View, robot: int) -> list[tuple[str, list[str | Span]]]:
    """Its load and its order; or its pod and its trip."""
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


def _load(view: View, robot: int) -> list[str | Span]:
    load = int(view.snapshot.robots.load[robot])
    if load == NIL:
        return ["none"]
    target = int(view.snapshot.orders.target[load])
    if target == NIL:
        return [order_link(load, "load")]
    return [order_link(load, "load"), " for ", _slot(view, target)]


def _slot(view: View, slot: int) -> Span:
    return cell_link(view.floor_plan, int(view.snapshot.slots.cell[slot]))


def _order(view: View, robot: int) -> list[str | Span]:
    order = int(view.snapshot.robots.order[robot])
    if order == NIL:
        return ["none"]
    known = int(view.snapshot.orders.release_tick[order])
    return [order_link(order), *([f", known for {_ticks(view, known)}"] if known else [])]


def _ticks(view: View, since: int) -> str:
    return count(view.snapshot.tick - since, "tick")


def _ahead(view: View, robot: int) -> list[str | Span]:
    """The orders that it is to do, one after another, as they were announced."""
    if view.snapshot.selected != robot:
        many = int(view.snapshot.robots.order_queue_length[robot])
        return [count(many, "order")] if many else []
    return several([order_link(order) for order in view.snapshot.order_queue.tolist()])


def _goal(view: View, robot: int) -> list[str | Span]:
    """What it drives for, and where."""
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
    parts: list[str | Span] = [words[goal != GOAL_DROP]]
    return parts if slot == NIL else [*parts, " at ", _slot(view, slot)]


def _route(view: View, robot: int) -> list[str | Span]:
    fleet = view.snapshot.robots
    steps, goal_cell = int(fleet.route_length[robot]), int(fleet.goal_cell[robot])
    if goal_cell == NIL:
        return []
    parts: list[str | Span] = [f"{count(steps, 'cell')} to ", cell_link(view.floor_plan, goal_cell)]
    if fleet.retreat_moves[robot] > 0:
        parts.append(f", retreating {count(int(fleet.retreat_moves[robot]), 'step')}")
    return parts


def _so_far(view: View, robot: int) -> list[str | Span]:
    """Its work since the start, as of the last reading of the figures."""
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
        *(event_line(event, who=False, trips=makes_trips(view)) for event in rows),
    ]


def last_of(events: Array, robot: int, most: int) -> Array:
    """Indices of the last events of a robot; looks back no farther than it must."""
    reach = 1024
    while True:
        first = max(0, len(events) - reach)
        found = first + np.flatnonzero(events[first:, 2] == robot)
        if len(found) >= most or first == 0:
            last: Array = found[-most:]
            return last
        reach *= 4
