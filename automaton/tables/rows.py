"""The rows of the tables of a run, from its arrays: orders, lines, trips, robots, cells, events.

Rows are produced in pieces: the whole table of a million orders would be as large as the arrays of the
run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np

from automaton.engine.observation import (
    CAUSE_NO_ORDER,
    CAUSE_NOT_WAITING,
    CAUSES,
    EVENT_CHARGING,
    EVENT_DELIVERED,
    EVENT_DEPLETED,
    EVENT_DROPPED,
    EVENT_FAILED,
    EVENT_ILLEGAL_DECISION,
    EVENT_NAMES,
    EVENT_PICKED,
    EVENT_VISITED,
    LOST_EVER,
    Observation,
    visits_of,
)
from automaton.engine.state import (
    ACTION_IDLE,
    ACTION_NAMES,
    BATTERY_FULL,
    NEVER,
    NIL,
    ORDER_DELIVERED,
    World,
)
from automaton.runs.illegal_decisions import RULE_NAMES
from automaton.runs.interruption import interruptible
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.metrics import busy_ticks, metrics_by_robot
from automaton.runs.progress import asked_count, asked_orders, has_lines
from automaton.runs.simulation import Simulation
from automaton.runs.task_lower_bounds import least_way_ticks
from automaton.runs.task_metrics import Measured
from automaton.scenario.order_lines import line_column, line_texts, listed_lines, pod_names
from automaton.scenario.table_fields import NOTHING
from automaton.tables.columns import (
    INTEGER,
    NO_NUMBER,
    NO_TEXT,
    NUMBER,
    TEXT,
    TICKS,
    Array,
    Form,
    Rows,
    TableColumn,
    cell_texts,
    codes_of,
    columns_and_rows,
    form_of,
    texts_where,
    where,
)
from automaton.world.resolved import Resolved

Table = tuple[Form, Iterable[Rows]]

LOWEST_PRIORITY: Final = -100
ROWS_AT_ONCE: Final = 65_536  # rows


def pieces(numbers: Array) -> Iterator[Array]:
    """Split numbers into pieces of ROWS_AT_ONCE."""
    for begin in range(0, len(numbers), ROWS_AT_ONCE):
        yield numbers[begin : begin + ROWS_AT_ONCE]


def order_table(run: Measured) -> Table:
    """One row for each customer order."""
    names, texts = _order_names(run, asked_count(run.world))
    return form_of("orders", run.resolved, name=texts), _orders(run.world, names)


def _orders(world: World, names: Array) -> Iterator[Rows]:
    orders, now = asked_orders(world), int(world.clock.tick)
    priority, lines = _priority_and_lines(world, len(names))
    for number in pieces(np.arange(len(names))):
        release, due, done, is_known = (column[number] for column in orders)
        is_done, has_due = done != NIL, due != NEVER
        ends = np.where(is_done, done, now)
        yield {
            "order": number,
            "priority": priority[number],
            "released": where(release != NEVER, release),
            "due": where(has_due, due),
            "done": where(is_done, done),
            "lead_time": where(is_done, done - release),
            "tardiness": where(has_due & is_known, np.maximum(0, ends - due)),
            "late": texts_where(has_due & is_known & (is_done | (ends > due)), ends > due),
            "lines": np.full(len(number), NO_NUMBER) if lines is None else lines[number],
            "name": names[number],
        }


def _priority_and_lines(world: World, count: int) -> tuple[Array, Array | None]:
    """(m,) highest priority of the lines of each order, and number of its lines (None without lines)."""
    if not has_lines(world):
        return world.orders.priority, None
    priority = np.full(count, LOWEST_PRIORITY, np.int16)
    np.maximum.at(priority, world.lines.order, world.lines.priority)
    return priority, np.bincount(world.lines.order, minlength=count)


def _order_names(run: Measured, count: int) -> tuple[Array, Sequence[str]]:
    """Names of orders in listed lines: (q,) indices of texts or NO_TEXT, and the texts."""
    names: Array = np.full(count, NO_TEXT, np.int64)
    lines = listed_lines(run.resolved.scenario.orders)
    if not lines:
        return names, []
    places, texts = line_texts(lines, "order")
    named = places != NOTHING
    names[run.world.lines.order[named]] = places[named]
    return names, texts


def line_table(run: Measured) -> Table:
    """One row for each line; empty if orders have no lines."""
    stations = list(run.resolved.station_names)
    lines = listed_lines(run.resolved.scenario.orders)
    places, skus = line_texts(lines, "sku") if lines else (None, [])
    sku = np.full(len(run.world.lines.order), NO_TEXT) if places is None else places
    pods = pod_names(run.resolved.scenario, len(run.world.pods.slot))
    form = form_of("lines", run.resolved, sku=skus, pod_name=pods, station=stations)
    return form, _lines(run, texts_where(sku != NOTHING, sku))


def _lines(run: Measured, sku: Array) -> Iterator[Rows]:
    lines, orders, stops = run.world.lines, run.world.orders, run.world.stops
    stop_of, units = stops_of_lines(run.world), _units(run.resolved, len(lines.order))
    for number in pieces(np.arange(len(lines.order))):
        trip, stop, done = lines.trip[number], stop_of[number], lines.done[number]
        taken = _values_at(orders.dispatched, trip)
        picked = _values_at(orders.picked, trip)
        arrived, visit = _values_at(stops.arrived, stop), _values_at(stops.ticks, stop)
        is_done = done != NIL
        pod = np.where(lines.pod[number] == NIL, lines.taken_from[number], lines.pod[number])
        yield {
            "line": number,
            "order": lines.order[number],
            "sku": sku[number],
            "pod": where(pod != NIL, pod + 1),
            "pod_name": texts_where(pod != NIL, pod),
            "station": lines.served_at[number],
            "trip": where(trip != NIL, trip),
            "robot": where(taken != NIL, _values_at(orders.dispatched_to, trip)),
            "units": units[number],
            "released": lines.release_tick[number],
            "taken": where(taken != NIL, taken),
            "lifted": where((picked != NIL) & (picked >= taken), picked),
            "arrived": where((arrived != NIL) & (arrived >= taken), arrived),
            "begun": where(is_done & (stop != NIL), done - np.maximum(visit, 1) + 1),
            "done": where(is_done, done),
        }


def _values_at(values: Array, numbers: Array) -> Array:
    """(k,) int64: values at these numbers, NIL for the number NIL."""
    if not len(values):
        return np.full(len(numbers), NIL, np.int64)
    return np.where(numbers == NIL, NIL, values[numbers].astype(np.int64))


def stops_of_lines(world: World) -> Array:
    """(l,) int32: the stop of a trip that serves each line, or NIL."""
    lines = world.lines
    stop_of = np.full(len(lines.order), NIL, np.int32)
    stop = np.flatnonzero(world.trips.first_line != NIL)
    line = world.trips.first_line[stop]
    while len(line):  # one pass per line of a stop
        stop_of[line] = stop
        following = lines.following[line]
        stop, line = stop[following != NIL], following[following != NIL]
    return stop_of


def _units(resolved: Resolved, count: int) -> Array:
    lines = listed_lines(resolved.scenario.orders)
    return line_column(lines, "units") if lines else np.ones(count, np.int32)


def trip_table(run: Measured) -> Table:
    """One row for each trip of a pod, or for each order if orders have no lines."""
    cells, texts = cell_texts(run)
    types = [kind.name for kind in run.resolved.scenario.fleet.types]
    form = form_of("trips", run.resolved, type=types, **{"from": texts, "to": texts})
    return form, _trips(run, cells, bool(types))


def _trips(run: Measured, cells: Array, has_types: bool) -> Iterator[Rows]:
    world, orders = run.world, run.world.orders
    types = world.rules.loaded_types or len(world.rules.duration)
    numbers = np.arange(len(orders.state))
    if has_lines(world):
        numbers = np.flatnonzero(world.trips.pod != NIL)
    for trip in pieces(numbers):
        taken, picked = orders.dispatched[trip], orders.picked[trip]
        is_taken, is_done = taken != NIL, orders.state[trip] == ORDER_DELIVERED
        source, target = orders.source[trip], orders.target[trip]
        end = np.where(is_done & (source != NIL), orders.current_slot[trip], target)
        released = orders.release_tick[trip]
        pod = world.trips.pod[trip] if len(world.trips.pod) else np.full(len(trip), NIL)
        yield {
            "trip": trip,
            "pod": where(pod != NIL, pod + 1),
            "from": texts_where(source != NIL, cells[source]),
            "to": texts_where(end != NIL, cells[end]),
            "robot": where(is_taken, orders.dispatched_to[trip]),
            "type": texts_where(is_taken & has_types, orders.dispatched_type[trip] % types),
            "released": where(released != NEVER, released),
            "taken": where(is_taken, taken),
            "picked": where((picked != NIL) & (picked >= taken), picked),
            "delivered": where(is_done, orders.delivered[trip]),
            "stops": orders.stops_done[trip],
            "moves": where(is_done, orders.moves[trip]),
            "drive": where(is_done, orders.driven[trip]),
            "least_drive": _least_drive(run, trip, is_done & (orders.legs[trip] == 1)),
            "queued": where(is_done, orders.queued[trip]),
        }


def _least_drive(run: Measured, trips: Array, is_done: Array) -> Array:
    """(k,) least driving ticks of trips that are done, else NO_NUMBER."""
    ticks = np.full(len(trips), NO_NUMBER, np.int64)
    which = trips[is_done]
    if len(which):
        least = np.zeros(len(which), np.int64)
        with interruptible(run.workspace.stop), np.errstate(over="ignore"):
            least_way_ticks(run.view, run.workspace, which, least)
        ticks[is_done] = least
    return ticks


# Robots, stations and cells, from the counters of the run.


def robot_table(run: Measured) -> Table:
    """One row for each robot, with the values of `run --json`."""
    rows = metrics_by_robot(run)
    columns, values, texts = [], {}, {}
    for name, first in rows[0].items():
        column = [row[name] for row in rows]
        kind = _kind_of(name, first)
        meaning = METRIC_CATALOGUE[name][1] if name in METRIC_CATALOGUE else ""
        columns.append(TableColumn(name, kind, meaning))
        if kind == TEXT:
            values[name], texts[name] = codes_of(column)
        else:
            values[name] = np.array(column, np.float64 if kind == NUMBER else np.int64)
    return form_of("robots", run.resolved, tuple(columns), **texts), [values]


def _kind_of(name: str, value: Any) -> str:
    if isinstance(value, str):
        return TEXT
    if isinstance(value, float):
        return NUMBER
    return TICKS if METRIC_CATALOGUE.get(name, ("",))[0] == "ticks" else INTEGER


def station_table(run: Measured) -> Table:
    """One row for each station that serves pods or works on parts."""
    world, resolved = run.world, run.resolved
    to_pods = len(world.pod_stations.cell) > 0
    visits, work, lines = _of_pods(world) if to_pods else _of_parts(world)
    cells = world.pod_stations.cell if to_pods else world.slots.cell[world.stations.slot]
    x, y = columns_and_rows(resolved.floor_plan, cells)
    names = list(resolved.station_names) or [str(k + 1) for k in range(len(cells))]
    rows = {
        "station": np.arange(len(cells)),
        "x": x,
        "y": y,
        "visits": visits,
        "lines": lines,
        "work": work,
        "utilization": work / max(1, int(world.clock.tick)),
    }
    return form_of("stations", resolved, station=names), [rows]


def _of_pods(world: World) -> tuple[Array, Array, Array]:
    """(k,) visits, ticks of visits, and lines served."""
    stops, count = world.stops, len(world.pod_stations.cell)
    done = np.flatnonzero(stops.done != NIL)
    station = world.pod_stations.station_at[stops.cell[done]]
    done, station = done[station != NIL], station[station != NIL]
    served = world.lines.served_at[world.lines.done != NIL]
    work = np.bincount(station, stops.ticks[done], count).astype(np.int64)
    return np.bincount(station, minlength=count), work, np.bincount(served, minlength=count)


def _of_parts(world: World) -> tuple[Array, Array, Array]:
    """(k,) parts, ticks of work on parts, and NO_NUMBER for lines."""
    stations = world.stations
    done = stations.station[stations.completion_tick != NIL]
    parts = np.bincount(done, minlength=len(stations.slot))
    return parts, busy_ticks(world), where(parts < 0, parts)


def cell_table(run: Measured, observation: Observation) -> Table:
    """One row for each drivable cell: visits, lost ticks, and moves out of it."""
    grid, flow = run.world.grid, observation.flow
    cells = grid.drivable
    x, y = columns_and_rows(run.resolved.floor_plan, cells)
    rows = {
        "x": x,
        "y": y,
        "visits": visits_of(flow, grid.offset)[cells],
        "waited": observation.lost_ticks_by_cell[cells, LOST_EVER],
        **{f"flow_{side}": flow[cells, k] for k, side in enumerate("eswn")},
    }
    return form_of("cells", run.resolved), [rows]


# Events and states, recorded during the run.


EVENTS_IN_CELLS: Final = (
    *(EVENT_PICKED, EVENT_DROPPED, EVENT_DELIVERED, EVENT_VISITED),
    *(EVENT_DEPLETED, EVENT_FAILED),
)
HEADINGS: Final = {1: (), 2: ("EW", "NS"), 4: ("E", "S", "W", "N")}  # by number of headings

Append = Callable[[Rows], None]


def event_form(resolved: Resolved) -> Form:
    """The form of the events of a run."""
    return form_of("events", resolved, event=EVENT_NAMES, rule=RULE_NAMES)


class EventTaker:
    """Passes on the events of a simulation and empties its buffers; `robots`: events of these only."""

    def __init__(self, append: Append | None, robots: Array | None) -> None:
        self._append, self._robots = append, robots

    def __call__(self, simulation: Simulation) -> None:
        """Take the events in the buffers."""
        observation = simulation.observation
        events = observation.events[: observation.count.events]
        if self._append is not None and len(events):
            if self._robots is not None:
                events = events[np.isin(events[:, 2], self._robots)]
            self._append(event_rows(simulation, events))
        simulation.empty_observation()


def event_rows(simulation: Simulation, events: Array) -> Rows:
    """Events (tick, code, robot, subject, value) of an observation as rows of the table."""
    tick, code, robot, subject, value = events.T
    in_cell = np.isin(code, EVENTS_IN_CELLS)
    x, y = columns_and_rows(simulation.resolved.floor_plan, np.where(in_cell, value, NIL))
    share = np.where(code == EVENT_CHARGING, value / BATTERY_FULL, value)
    is_illegal = code == EVENT_ILLEGAL_DECISION
    return {
        "tick": tick,
        "event": code,
        "robot": where(robot != NIL, robot),
        "order": where((subject != NIL) & ~is_illegal, subject),
        "value": np.where(~is_illegal & (in_cell | (value == NIL)), np.nan, share),
        "x": x,
        "y": y,
        "rule": np.where(is_illegal, subject, NO_TEXT),
    }


def state_form(resolved: Resolved) -> Form:
    """The form of the states of a run."""
    return form_of(
        "states",
        resolved,
        heading=[name for count in heading_counts(resolved) for name in HEADINGS[count]],
        action=ACTION_NAMES,
        cause=[cause.name for cause in CAUSES],
    )


def heading_counts(resolved: Resolved) -> list[int]:
    """The distinct numbers of headings of the robot types, in descending order."""
    return sorted({one.headings for one in resolved.fleet.types}, reverse=True)


def heading_texts(simulation: Simulation, at: Array) -> Array:
    """(k,) indices of the headings of some robots in the texts of `state_form`."""
    robots, before, places = simulation.world.robots, 0, np.full(len(at), NO_TEXT)
    apart = simulation.world.grid.type_headings[robots.type[at]]
    for count in heading_counts(simulation.resolved):
        if count > 1:
            places = np.where(apart == count, before + robots.heading[at], places)
        before += len(HEADINGS[count])
    return places


def state_rows_of(simulation: Simulation, robots: Array | None) -> Rows:
    """The states of all robots, or of these, after the current tick of an observed run."""
    world, observation = simulation.world, simulation.observation
    identities = np.arange(len(world.robots.cell)) if robots is None else robots
    at = world.robots.at_index[identities]
    fleet, cause = world.robots, observation.cause[at]
    x, y = columns_and_rows(simulation.resolved.floor_plan, fleet.cell[at])
    is_idle = (fleet.parked[at] != 0) | (cause == CAUSE_NO_ORDER)
    waits = cause != CAUSE_NOT_WAITING
    load, order, blocker = fleet.load[at], fleet.order[at], observation.blocker[at]
    charge = fleet.charge[at] / BATTERY_FULL if world.rules.battery else np.full(len(at), np.nan)
    return {
        "tick": np.full(len(at), simulation.tick),
        "robot": identities,
        "x": x,
        "y": y,
        "heading": heading_texts(simulation, at),
        "action": np.where(is_idle, ACTION_IDLE, fleet.action[at]),
        "load": where(load != NIL, load),
        "order": where(order != NIL, order),
        "charge": charge,
        "cause": texts_where(waits, cause),
        "blocker": where(waits & (blocker != NIL), blocker),
    }
