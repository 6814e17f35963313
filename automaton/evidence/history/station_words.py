"""Stations to which pods are carried, in words: who is served, who queues, breaks and places."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from automaton.engine.observation import CAUSE_STATION_QUEUE
from automaton.engine.state import ACTION_SERVE, GOAL_STOP, NIL, ORDER_WAITING, Array
from automaton.units import count

if TYPE_CHECKING:  # it needs Numba, pictures do not
    from automaton.engine.facilities import PodStations
    from automaton.evidence.history.snapshot import Snapshot

ORDINALS: Final = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")


def carries_pods(snapshot: Snapshot) -> bool:
    """Whether orders of this run carry pods."""
    return len(snapshot.pods.slot) > 0


def has_trips(snapshot: Snapshot) -> bool:
    """Whether the orders of this run are trips, which are made of lines."""
    return len(snapshot.lines.order) > 0


def load_words(snapshot: Snapshot, load: int) -> str:
    """Say "load 7", or "pod 12" where loads are pods."""
    return (
        pod_name(snapshot, snapshot.trips.pod[load]) if carries_pods(snapshot) else f"load {load}"
    )


def pod_name(snapshot: Snapshot, pod: int) -> str:
    """Say "pod A-17-3", or "pod 12" of one without a name."""
    return f"pod {snapshot.pod_names[pod]}"


def station_name(snapshot: Snapshot, station: int) -> str:
    """Say "station P1", or "station 3" of one without a name."""
    return f"station {snapshot.station_names[station]}"


def station_of(snapshot: Snapshot, robot: int) -> int:
    """The station to which a robot carries its pod now, or NIL."""
    fleet = snapshot.robots
    if not carries_pods(snapshot) or fleet.goal_type[robot] != GOAL_STOP:
        return NIL
    return int(snapshot.pod_stations.station_at[fleet.goal_cell[robot]])


def robot_at(snapshot: Snapshot, station: int) -> int:
    """The robot that stands at a station, or NIL."""
    there = np.flatnonzero(snapshot.robots.cell == snapshot.pod_stations.cell[station])
    return int(there[0]) if len(there) else NIL


def station_queue(snapshot: Snapshot, station: int) -> list[int]:
    """The robots that stand in the queue of a station, or wait to enter it, the next one first."""
    fleet, stations = snapshot.robots, snapshot.pod_stations
    goes_there = (fleet.goal_type == GOAL_STOP) & (fleet.goal_cell == stations.cell[station])
    on_floor = goes_there & (fleet.cell != NIL) & (fleet.cell != stations.cell[station])
    waits = on_floor & (fleet.cause == CAUSE_STATION_QUEUE)
    stands = on_floor & (stations.queue_at[np.maximum(fleet.cell, 0)] == station)
    place = {cell: steps for steps, cell in enumerate(_queue_cells(snapshot, station))}
    last = len(place)

    def steps_to_go(robot: int) -> int:
        cell, wanted = int(fleet.cell[robot]), int(fleet.wanted[robot])
        return place[cell] if cell in place else place.get(wanted, last) + 1

    standing: list[int] = np.flatnonzero(waits | stands).tolist()
    return sorted(standing, key=steps_to_go)


def _queue_cells(snapshot: Snapshot, station: int) -> list[int]:
    """The cells of a queue, the one next to the station first."""
    stations, stride = snapshot.pod_stations, snapshot.stride
    steps = (1, stride, -1, -stride)
    following = {
        int(cell) + steps[int(stations.queue_way[cell])]: int(cell)
        for cell in np.flatnonzero(stations.queue_at == station)
    }
    cells, cell = [], int(stations.cell[station])
    while cell in following:
        cell = following[cell]
        cells.append(cell)
    return cells


def break_end(snapshot: Snapshot, station: int) -> int:
    """The first tick after the break that a station has now, or NIL."""
    rows = snapshot.pod_stations.breaks
    now = (rows[:, 0] == station) & (rows[:, 1] <= snapshot.tick) & (snapshot.tick < rows[:, 2])
    return int(rows[now, 2].max()) if now.any() else NIL


def break_begins(stations: PodStations, tick: int) -> Array:
    """(k,) int64: the stations that have a break from this tick on."""
    begun: Array = stations.breaks[stations.breaks[:, 1] == tick, 0]
    return begun


def break_begun_words(snapshot: Snapshot, station: int) -> str:
    """Say that a station has a break, and for how long."""
    rest = _break_left(snapshot, break_end(snapshot, station)).removeprefix("which ")
    return f"{station_name(snapshot, station)} {rest}"


def queue_words(snapshot: Snapshot, robot: int) -> str:
    """Why a robot queues for a station: its place in the queue, and who is served there."""
    station = station_of(snapshot, robot)
    said = f"robot {robot} queues for {station_name(snapshot, station)}"
    standing = station_queue(snapshot, station)
    if robot in standing:
        place = standing.index(robot)
        nth = ORDINALS[place] if place < len(ORDINALS) else f"{place + 1}th"
        said += f": {nth} in line"
    there = robot_at(snapshot, station)
    return said if there == NIL else f"{said}, {_at_station(snapshot, there, station)}"


def _at_station(snapshot: Snapshot, robot: int, station: int) -> str:
    """What the robot at a station does there."""
    fleet = snapshot.robots
    if is_served(snapshot, robot):
        left = int(fleet.busy[robot])
        return f"robot {robot} is served there for {count(left, 'more tick')}"
    if fleet.action[robot] == ACTION_SERVE:
        return f"robot {robot} is done there"
    ends = break_end(snapshot, station)
    if ends != NIL and station_of(snapshot, robot) == station:
        return f"robot {robot} stands there, {_break_left(snapshot, ends)}"
    return f"robot {robot} stands there"


def is_served(snapshot: Snapshot, robot: int) -> bool:
    """Whether a robot is served at a stop, and not for the last time in this tick."""
    fleet = snapshot.robots
    return bool(fleet.action[robot] == ACTION_SERVE and fleet.busy[robot] > 0)


def _break_left(snapshot: Snapshot, ends: int) -> str:
    return f"which has a break for {count(ends - snapshot.tick, 'more tick')}"


def break_words(snapshot: Snapshot, robot: int) -> str:
    """Why a robot at its station is not served."""
    station = station_of(snapshot, robot)
    name, ends = station_name(snapshot, station), break_end(snapshot, station)
    rest = "which has a break" if ends == NIL else _break_left(snapshot, ends)
    return f"robot {robot} stands at {name}, {rest}"


def next_stations(snapshot: Snapshot, trips: Array) -> Array:
    """(k,) int32: the station of the next stop of each of these trips, NIL if none is left."""
    orders = snapshot.orders
    stop = orders.first_stop[trips] + orders.stops_done[trips]
    left = stop < orders.first_stop[trips + 1]
    result: Array = np.full(len(trips), NIL, np.int32)
    result[left] = snapshot.trips.station[stop[left]]
    return result


def full_stations(snapshot: Snapshot) -> Array:
    """(k,) bool: stations that let no more trips come."""
    stations = snapshot.pod_stations
    full: Array = (stations.places != NIL) & (stations.taken >= stations.places)
    return full


def no_place_words(snapshot: Snapshot, robot: int) -> str:
    """Say that all trips that a robot could have are for stations without a free place, or ""."""
    if not carries_pods(snapshot):
        return ""
    orders = snapshot.orders
    may_have = (orders.reserved_by == NIL) | (orders.reserved_by == robot)
    waits = np.flatnonzero((orders.state == ORDER_WAITING) & may_have)
    stations = next_stations(snapshot, waits)
    if not len(stations) or (stations == NIL).any() or not full_stations(snapshot)[stations].all():
        return ""
    names = [snapshot.station_names[k] for k in np.unique(stations).tolist()]
    where = f"station {names[0]} has" if len(names) == 1 else f"stations {', '.join(names)} have"
    wait = f"{count(len(waits), 'trip')} {'waits' if len(waits) == 1 else 'wait'}"
    return f"{wait}, but {where} no free place"
