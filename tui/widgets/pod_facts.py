"""The inspector's facts about pods (storage cells, stations, trips, robots), and due times."""

from __future__ import annotations

import numpy as np

from automaton.engine.state import (
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_UNRELEASED,
)
from automaton.history.state_words import (
    break_end,
    carries_pods,
    has_due_time,
    has_trips,
    lateness_words,
    pod_name,
    robot_at,
    served_words,
    station_of,
    station_queue,
    tick_in_words,
    ticks_late,
)
from automaton.units import count, percent
from automaton.vocabulary import order_word
from tui.playback.panel_view import View
from tui.widgets.panel import (
    Facts,
    Line,
    Parts,
    Span,
    cell_link,
    fact_lines,
    line,
    order_link,
    robot_link,
    several,
    tick_link,
    title,
)


def has_pods(view: View) -> bool:
    """Whether robots carry pods."""
    return carries_pods(view.snapshot)


def makes_trips(view: View) -> bool:
    """Whether all orders are trips, made of lines; otherwise a list has orders that carry pods."""
    return has_trips(view.snapshot)


def due_facts(view: View, order: int) -> Parts:
    """An order's due tick, due time and lateness; [] without a due time."""
    orders, now = view.snapshot.orders, view.snapshot.tick
    if order == NIL or not has_due_time(orders, order):
        return []
    scale, due = view.run.resolved.scenario.units.scale, int(orders.due[order])
    look = "warn" if ticks_late(orders, order, now) > 0 else "plain"
    return [
        tick_link(due),
        f"{tick_in_words(due, scale)}: ",
        Span(lateness_words(orders, order, now, scale), look),
    ]


def slot_place(view: View, slot: int) -> Parts:
    """The cell of a slot; [] for NIL."""
    return [] if slot == NIL else [cell_link(view.floor_plan, int(view.snapshot.slots.cell[slot]))]


def state_word(view: View, order: int) -> str:
    """The word for the state of an order or a trip."""
    orders = view.snapshot.orders
    delivers = not makes_trips(view) and int(orders.source[order]) != NIL
    return order_word(int(orders.state[order]), delivers)


def trip_link(view: View, trip: int) -> Span:
    """A link to a trip, or to an order of a list."""
    return order_link(trip, "trip" if makes_trips(view) else "order")


def station_link(view: View, station: int) -> Span:
    """A station's name as a link to its cell."""
    cell = int(view.snapshot.pod_stations.cell[station])
    return Span(view.snapshot.station_names[station], "link", ("cell", cell))


# Cells.


def storage_facts(view: View, cell: int) -> Facts:
    """The pod in a storage cell, its trip, and the lines waiting for it."""
    snapshot = view.snapshot
    slot = int(np.flatnonzero(snapshot.slots.cell == cell)[0])
    pod, keeper = int(snapshot.slots.content[slot]), int(snapshot.slots.reserved_by[slot])
    away = [int(one) for one in np.flatnonzero(snapshot.pods.home == slot) if one != pod]
    classes = _class_names(view)
    own_class = classes[int(snapshot.pods.slot_class[slot])] if classes else ""
    return [
        ("pod", _pod(view, pod) if pod != NIL else ["none"]),
        *(_pod_facts(view, pod) if pod != NIL else []),
        ("cell class", [own_class] if own_class else []),
        ("stood here", several([Span(pod_name(snapshot, one)) for one in away])),
        ("reserved", [] if keeper == NIL else [robot_link(keeper)]),
    ]


def _class_names(view: View) -> list[str]:
    return list(view.run.resolved.scenario.pods.classes or {})


def _pod(view: View, pod: int) -> Parts:
    names = _class_names(view)
    known = f", class {names[int(view.snapshot.pods.pod_class[pod])]}" if names else ""
    return [f"{view.snapshot.pod_names[pod]}{known}"]


def _pod_facts(view: View, pod: int) -> Facts:
    snapshot = view.snapshot
    trip, waiting = int(snapshot.pods.trip[pod]), int(snapshot.pods.first_line[pod])
    many = len(chained_lines(view, waiting))
    fetcher = NIL if trip == NIL else int(snapshot.orders.reserved_by[trip])
    fetched: tuple[str, Parts] = ("fetched by", [] if fetcher == NIL else [robot_link(fetcher)])
    link: Parts = ["none"] if trip == NIL else [trip_link(view, trip)]
    if not makes_trips(view):
        after: Parts = [f"{count(many, 'order')} after it"] if many else []
        return [("order", link), fetched, ("waiting", after)]
    return [
        ("trip", link if trip == NIL else [*link, f": {_stops_left(view, trip)}"]),
        fetched,
        ("waiting", [f"{count(many, 'line')} for the trip after it"] if many else []),
    ]


def pod_in(view: View, cell: int) -> int:
    """The pod in a storage cell, or NIL."""
    slots = np.flatnonzero(view.snapshot.slots.cell == cell)
    return int(view.snapshot.slots.content[slots[0]]) if len(slots) else NIL


def chained_lines(view: View, first: int) -> list[int]:
    """The chain of lines (or listed orders) from one on: of a stop, or waiting for a pod."""
    snapshot = view.snapshot
    following = snapshot.lines.following if makes_trips(view) else snapshot.trips.following
    lines = []
    while first != NIL:
        lines.append(first)
        first = int(following[first])
    return lines


def pod_station_facts(view: View, cell: int) -> Facts:
    """The station in a cell, or the one to whose queue it belongs."""
    stations = view.snapshot.pod_stations
    station, queue = int(stations.station_at[cell]), int(stations.queue_at[cell])
    if station == NIL:
        return [("queue of", [] if queue == NIL else [station_link(view, queue)])]
    taken, places = int(stations.taken[station]), int(stations.places[station])
    of = "any number" if places == NIL else f"{places:,}"
    standing = [robot_link(robot) for robot in station_queue(view.snapshot, station)]
    of_lines: Facts = [
        ("places", [f"{taken:,} of {of} taken"]),
        ("open lines", [f"{int(stations.open_lines[station]):,}"]),
        ("so far", _shares_of_time(view, station)),
    ]
    return [
        ("station", [view.snapshot.station_names[station]]),
        ("serves", _served(view, station)),
        ("queue", several(standing) or ["no robot"]),
        *(of_lines if makes_trips(view) else []),
        ("break", _break(view, station)),
    ]


def _served(view: View, station: int) -> Parts:
    snapshot = view.snapshot
    robot = robot_at(snapshot, station)
    if robot == NIL:
        return ["no robot"]
    served = f" {served_words(snapshot, robot)}"
    trip = int(snapshot.robots.order[robot])
    if not served.endswith(("tick", "ticks")) or not makes_trips(view):
        return [robot_link(robot), served]
    stop = int(snapshot.orders.first_stop[trip] + snapshot.orders.stops_done[trip])
    lines = len(chained_lines(view, int(snapshot.trips.first_line[stop])))
    return [robot_link(robot), f"{served}: {count(lines, 'line')}"]


def _shares_of_time(view: View, station: int) -> Parts:
    """Shares of time in which a station served a robot, and in which it starved."""
    stations, elapsed = view.snapshot.pod_stations, view.snapshot.tick
    if not elapsed:
        return []
    serves, starved = (
        percent(int(ticks[station]) / elapsed, 0)
        for ticks in (stations.served_ticks, stations.starved_ticks)
    )
    return [f"served {serves}, starved {starved} of the time"]


def _break(view: View, station: int) -> Parts:
    """The present or next break of a station."""
    end = break_end(view.snapshot, station)
    if end != NIL:
        return [Span("now, until ", "warn"), tick_link(end)]
    rows = view.snapshot.pod_stations.breaks
    coming = rows[(rows[:, 0] == station) & (rows[:, 1] > view.snapshot.tick)]
    return ["from ", tick_link(int(coming[0, 1]))] if len(coming) else []


# Robots, orders and trips.


def carried_pod(view: View, robot: int) -> Parts:
    """The pod on a robot."""
    trip = int(view.snapshot.robots.load[robot])
    return ["none"] if trip == NIL else ["pod ", *_pod(view, int(view.snapshot.trips.pod[trip]))]


def ordered_pod(view: View, order: int) -> Parts:
    """The pod that a listed order carries; [] if none."""
    pod = int(view.snapshot.trips.pod[order]) if has_pods(view) else NIL
    return [] if pod == NIL else _pod(view, pod)


def robot_trip(view: View, robot: int) -> Facts:
    """The trip of a robot, its remaining stops, and the lateness of its next lines."""
    snapshot = view.snapshot
    trip = int(snapshot.robots.order[robot])
    if trip == NIL:
        offered = int(snapshot.trips.offered[robot])
        retained: Parts = (
            [] if offered == NIL else [trip_link(view, offered), " is retained for it"]
        )
        return [("trip", retained or ["none"])]
    pod = pod_name(snapshot, int(snapshot.trips.pod[trip]))
    is_left = int(snapshot.orders.stops_done[trip]) < len(stops_of(view, trip))
    return [
        ("trip", [trip_link(view, trip), f" of {pod}"]),
        ("stops", [_stops_left(view, trip)]),
        ("station", _next_station(view, robot)),
        ("due", due_facts(view, trip) if is_left else []),
    ]


def _next_station(view: View, robot: int) -> Parts:
    """The station of a robot, present or next, and the robot's place in the queue."""
    station = station_of(view.snapshot, robot)
    if station == NIL:
        return []
    queue = station_queue(view.snapshot, station)
    rank = f", {queue.index(robot) + 1} of {len(queue)} in the queue" if robot in queue else ""
    return [station_link(view, station), rank]


def trip_lines(view: View, trip: int, width: int) -> list[Line]:
    """All facts about a trip."""
    snapshot = view.snapshot
    orders, state = snapshot.orders, int(snapshot.orders.state[trip])
    lines = [line(title(f"trip {trip} "), state_word(view, trip))]
    if state == ORDER_UNRELEASED:
        return lines
    pod, robot = int(snapshot.trips.pod[trip]), int(orders.reserved_by[trip])
    done = state == ORDER_DELIVERED
    stops = [
        ("stops" if k == 0 else "", _stop(view, s)) for k, s in enumerate(stops_of(view, trip))
    ]
    facts: Facts = [
        ("pod", _pod(view, pod)),
        ("from", slot_place(view, int(orders.source[trip]))),
        ("stored at" if done else "lies at", slot_place(view, int(orders.current_slot[trip]))),
        (
            "carried by" if state == ORDER_CARRIED else "taken by",
            [] if robot == NIL else [robot_link(robot)],
        ),
        *stops,
        ("first line", ["known from ", tick_link(int(orders.release_tick[trip]))]),
        ("due", [] if done else due_facts(view, trip)),
        ("stored", [tick_link(int(orders.delivered[trip]))] if done else []),
    ]
    return [*lines, *fact_lines(facts, width)]


def stops_of(view: View, trip: int) -> range:
    """The planned stops of a trip, done or not."""
    orders, stations = view.snapshot.orders, view.snapshot.trips.station
    first, end = int(orders.first_stop[trip]), int(orders.first_stop[trip + 1])
    while end > first and stations[end - 1] == NIL:
        end -= 1
    return range(first, end)


def _stop(view: View, stop: int) -> Parts:
    """The station of a stop, its lines, and the tick when it was done."""
    snapshot = view.snapshot
    lines = chained_lines(view, int(snapshot.trips.first_line[stop]))
    when = int(snapshot.stops.done[stop])
    station = station_link(view, int(snapshot.trips.station[stop]))
    parts_said: Parts = [station, f": {count(len(lines), 'line')}"]
    return parts_said if when == NIL else [*parts_said, ", done in ", tick_link(when)]


def _stops_left(view: View, trip: int) -> str:
    """The remaining stops of a trip, with lines: "P1 (2 lines), then P3 (1 line)"."""
    names, trips = view.snapshot.station_names, view.snapshot.trips
    left = stops_of(view, trip)[int(view.snapshot.orders.stops_done[trip]) :]
    parts_said = [
        f"{names[trips.station[stop]]} "
        f"({count(len(chained_lines(view, int(trips.first_line[stop]))), 'line')})"
        for stop in left
    ]
    return ", then ".join(parts_said) if parts_said else "to storage"
