"""Orders, their lines, and trips, read off the arrays of a run that is over.

Rows come in pieces: of a million orders a whole table would be as large as all that the run keeps of
them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np

from automaton.engine.state import CLOCK_TICK, NEVER, NIL, ORDER_DELIVERED, World
from automaton.runs.asked_orders import asked_count, asked_orders, has_lines
from automaton.runs.interruption import interruptible
from automaton.runs.task_lower_bounds import least_way_ticks
from automaton.runs.task_metrics import Measured
from automaton.scenario.order_fields import NOTHING
from automaton.scenario.orders import line_column, line_texts, listed_lines
from automaton.scenario.table_files import pod_names
from automaton.tables.columns import (
    NO_NUMBER,
    NO_TEXT,
    Array,
    Form,
    Rows,
    form_of,
    texts_where,
    where,
)
from automaton.tables.places import cell_texts
from automaton.world.pods import station_names
from automaton.world.resolve import Resolved

Table = tuple[Form, Iterable[Rows]]

LEAST_PRIORITY: Final = -100
PIECE: Final = 65_536  # rows


def pieces(numbers: Array) -> Iterator[Array]:
    """Numbers, so many at a time."""
    for begin in range(0, len(numbers), PIECE):
        yield numbers[begin : begin + PIECE]


def order_table(run: Measured) -> Table:
    """One row for each order that the scenario asks for."""
    names, texts = _order_names(run, asked_count(run.world))
    return form_of("orders", run.resolved, name=texts), _orders(run.world, names)


def _orders(world: World, names: Array) -> Iterator[Rows]:
    orders, now = asked_orders(world), int(world.clock[CLOCK_TICK])
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
    """(m,) the highest priority of the lines of each order, and how many they are, if there are any."""
    if not has_lines(world):
        return world.orders.priority, None
    priority = np.full(count, LEAST_PRIORITY, np.int16)
    np.maximum.at(priority, world.lines.order, world.lines.priority)
    return priority, np.bincount(world.lines.order, minlength=count)


def _order_names(run: Measured, count: int) -> tuple[Array, Sequence[str]]:
    """What listed lines call their orders: (q,) places among the texts, or NO_TEXT; the texts."""
    names: Array = np.full(count, NO_TEXT, np.int64)
    lines = listed_lines(run.resolved.scenario.orders)
    if not lines:
        return names, []
    places, texts = line_texts(lines, "order")
    named = places != NOTHING
    names[run.world.lines.order[named]] = places[named]
    return names, texts


def line_table(run: Measured) -> Table:
    """One row for each line; none where orders have no lines."""
    stations = list(station_names(run.resolved))
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
    """(k,) int64: values by number, NIL for the number NIL."""
    if not len(values):
        return np.full(len(numbers), NIL, np.int64)
    return np.where(numbers == NIL, NIL, values[numbers].astype(np.int64))


def stops_of_lines(world: World) -> Array:
    """(l,) int32: the stop of a trip where each line is served, or NIL."""
    lines = world.lines
    stop_of = np.full(len(lines.order), NIL, np.int32)
    stop = np.flatnonzero(world.trips.first_line != NIL)
    line = world.trips.first_line[stop]
    while len(line):  # as often as a stop has lines
        stop_of[line] = stop
        following = lines.following[line]
        stop, line = stop[following != NIL], following[following != NIL]
    return stop_of


def _units(resolved: Resolved, count: int) -> Array:
    lines = listed_lines(resolved.scenario.orders)
    return line_column(lines, "units") if lines else np.ones(count, np.int32)


def trip_table(run: Measured) -> Table:
    """One row for each trip of a pod, or for each order where orders have no lines."""
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
    """(k,) ticks of driving at least, of trips that are done; several robots may turn less than one."""
    ticks = np.full(len(trips), NO_NUMBER, np.int64)
    which = trips[is_done]
    if len(which):
        least = np.zeros(len(which), np.int64)
        with interruptible(run.workspace.stop), np.errstate(over="ignore"):
            least_way_ticks(run.view, run.workspace, which, least)
        ticks[is_done] = least
    return ticks
