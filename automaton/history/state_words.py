"""Gates, stations with queues, chargers and due times in words; imports without Numba."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from automaton.engine.facilities import PodStations
from automaton.engine.observation import CAUSE_CLOSED, CAUSE_LIFT, CAUSE_STATION_QUEUE
from automaton.engine.robot_states import is_charging, is_queueing
from automaton.engine.state import (
    ACTION_SERVE,
    BATTERY_FULL,
    GATE_BLOCK,
    GATE_CLOSING,
    GATE_DOOR,
    GATE_LIFT,
    GOAL_CHARGE,
    GOAL_STOP,
    NEVER,
    NIL,
    ORDER_DELIVERED,
    ORDER_WAITING,
    Array,
    Orders,
    World,
)
from automaton.history.snapshot import cells_of, closed_until
from automaton.scenario.quantities import Scale, clock_text
from automaton.units import count, duration, number, percent, ticks_and_time

if TYPE_CHECKING:
    from automaton.history.snapshot import Snapshot


def detour_words(snapshot: Snapshot, robot: int) -> str:
    """How much longer streets make the way of the selected robot; "" for others and without a detour."""
    if snapshot.selected != robot or snapshot.detour <= 0:
        return ""
    longer = f"{count(snapshot.detour, 'tick')} longer than the shortest"
    return f"its way is {longer}, because of the streets"


def is_kept_by_gate(cause: int) -> bool:
    """Whether the cause of a wait is a gate."""
    return CAUSE_CLOSED <= cause <= CAUSE_LIFT


def gate_words(snapshot: Snapshot, robot: int) -> str:
    """Why a gate stops a robot that waits for a cell, and until when, if that is known."""
    wanted = int(snapshot.robots.wanted[robot])
    kind = int(snapshot.robots.cause[robot]) - CAUSE_CLOSED
    x, y = wanted % snapshot.stride - 1, wanted // snapshot.stride - 1
    gate = next((gate for gate in gates_in(snapshot, wanted) if keeps(snapshot, gate, kind)), NIL)
    return f"({x}, {y}) is {words_of(snapshot, gate, robot)}" if gate != NIL else ""


def gates_in(snapshot: Snapshot, cell: int) -> list[int]:
    """The gates of a flat cell."""
    gates = snapshot.gates
    if not len(gates.kind):
        return []
    gates_of_cell: list[int] = gates.cell_gate[
        gates.cell_first[cell] : gates.cell_first[cell + 1]
    ].tolist()
    return gates_of_cell


def keeps(snapshot: Snapshot, gate: int, kind: int) -> bool:
    """Whether a gate is of a kind, and may have stopped a robot in the last tick."""
    if snapshot.gates.kind[gate] != kind:
        return False
    if kind == GATE_CLOSING:
        return closed_until(snapshot, gate) != NIL
    if kind == GATE_BLOCK:
        return bool(snapshot.gates.same_way[gate]) or len(robots_in(snapshot, gate)) > 0
    return True


def robots_in(snapshot: Snapshot, gate: int) -> list[int]:
    """The robots in a gate, or entering it."""
    cells = cells_of(snapshot, gate)
    robots = snapshot.robots
    inside = np.isin(robots.cell, cells) | np.isin(robots.claim, cells)
    identities: list[int] = np.flatnonzero(inside).tolist()
    return identities


def words_of(snapshot: Snapshot, gate: int, robot: int = NIL) -> str:
    """The state of a gate in words: "closed until tick 60, for 12 more ticks"."""
    gates, tick = snapshot.gates, snapshot.tick
    kind, opens = int(gates.kind[gate]), int(gates.open_from[gate])
    number = gate - int(np.argmax(gates.kind == kind)) + 1
    if kind == GATE_CLOSING:
        end = closed_until(snapshot, gate)
        if end == NIL:
            return "open now, and closed at other times"
        return f"closed until tick {end}, for {count(end - tick, 'more tick')}"
    if kind == GATE_DOOR:
        if opens == NEVER:
            return "a door that is shut"
        return f"a door that opens in tick {opens}" if opens > tick else "a door that is open"
    inside = robots_in(snapshot, gate)
    who = names_of(inside)
    if kind == GATE_BLOCK:
        most = int(gates.max_robots[gate])
        return f"in block {number}, which holds {len(inside)} of {count(most, 'robot')}{who}"
    if inside:
        return f"in lift {number}, which is taken{who}"
    caller = int(gates.caller[gate])
    if caller == NIL:
        return f"in lift {number}, which no robot has called"
    whom = "it" if caller == robot else f"robot {caller}"
    if opens > tick:
        return f"in lift {number}, whose cabin is there for {whom} in tick {opens}"
    return f"in lift {number}, whose cabin waits for {whom}"


def names_of(robots: list[int]) -> str:
    """Robots after a colon, at most three by name; "" without any."""
    if not robots:
        return ""
    names = ", ".join(f"robot {robot}" for robot in robots[:3])
    return f": {names}{' and others' if len(robots) > 3 else ''}"


def gate_states(world: World) -> Array:
    """(g,) int64: states of gates whose changes are reported; 0 for gates at rest.

    1 for a present closing and for a door that opens or is open; for a called lift the number of the
    calling robot, from 1; always 0 for blocks.
    """
    gates, tick = world.gates, int(world.clock.tick)
    states = np.zeros(len(gates.kind), np.int64)
    rows = gates.first_closing[:-1] + gates.closing
    at = np.flatnonzero((gates.kind == GATE_CLOSING) & (rows < gates.first_closing[1:]))
    begins, ends = gates.closings[rows[at]].T
    states[at] = (begins <= tick) & (tick < ends)
    states[gates.kind == GATE_DOOR] = gates.open_from[gates.kind == GATE_DOOR] != NEVER
    states[gates.kind == GATE_LIFT] = gates.caller[gates.kind == GATE_LIFT] + 1
    return states


def gate_words_of(snapshot: Snapshot, gate: int) -> str:
    """Place and state of a gate in words: "(3, 0) is a door that is open"."""
    cells = cells_of(snapshot, gate)
    x, y = int(cells[0]) % snapshot.stride - 1, int(cells[0]) // snapshot.stride - 1
    others = "" if len(cells) == 1 else f", one of {count(len(cells), 'cell')},"
    return f"({x}, {y}){others} is {words_of(snapshot, gate)}"


# Stations for pods in words: service, queues, breaks and free places.


ORDINALS: Final = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")


def carries_pods(snapshot: Snapshot) -> bool:
    """Whether robots of this run carry pods."""
    return len(snapshot.pods.slot) > 0


def has_trips(snapshot: Snapshot) -> bool:
    """Whether the orders of this run are trips, which serve lines."""
    return len(snapshot.lines.order) > 0


def load_words(snapshot: Snapshot, load: int) -> str:
    """Say "load 7", or "pod 12" if loads are pods."""
    return (
        pod_name(snapshot, snapshot.trips.pod[load]) if carries_pods(snapshot) else f"load {load}"
    )


def pod_name(snapshot: Snapshot, pod: int) -> str:
    """Say "pod A-17-3", or "pod 12" if the pod has no name."""
    return f"pod {snapshot.pod_names[pod]}"


def station_name(snapshot: Snapshot, station: int) -> str:
    """Say "station P1", or "station 3" if the station has no name."""
    return f"station {snapshot.station_names[station]}"


def station_of(snapshot: Snapshot, robot: int) -> int:
    """The station to which a robot carries its pod now, or NIL."""
    fleet = snapshot.robots
    if not carries_pods(snapshot) or fleet.goal_type[robot] != GOAL_STOP:
        return NIL
    return int(snapshot.pod_stations.station_at[fleet.goal_cell[robot]])


def robot_at(snapshot: Snapshot, station: int) -> int:
    """The robot at a station, or NIL."""
    there = np.flatnonzero(snapshot.robots.cell == snapshot.pod_stations.cell[station])
    return int(there[0]) if len(there) else NIL


def station_queue(snapshot: Snapshot, station: int) -> list[int]:
    """The robots in the queue of a station or waiting to enter it, in order of service."""
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
    """The cells of a queue, starting next to the station."""
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
    """The first tick after the present break of a station, or NIL."""
    rows = snapshot.pod_stations.breaks
    now = (rows[:, 0] == station) & (rows[:, 1] <= snapshot.tick) & (snapshot.tick < rows[:, 2])
    return int(rows[now, 2].max()) if now.any() else NIL


def break_begins(stations: PodStations, tick: int) -> Array:
    """(k,) int64: the stations whose break begins in this tick."""
    begun: Array = stations.breaks[stations.breaks[:, 1] == tick, 0]
    return begun


def break_begun_words(snapshot: Snapshot, station: int) -> str:
    """Say that a station has a break, and for how long."""
    rest = _break_left(snapshot, break_end(snapshot, station)).removeprefix("which ")
    return f"{station_name(snapshot, station)} {rest}"


def queue_words(snapshot: Snapshot, robot: int) -> str:
    """Why a robot queues for a station: its place in the queue, and the robot at the station."""
    station = station_of(snapshot, robot)
    name = station_name(snapshot, station)
    said = f"robot {robot} is queueing before {name}"
    standing = station_queue(snapshot, station)
    if robot in standing:
        place = standing.index(robot)
        nth = ORDINALS[place] if place < len(ORDINALS) else f"{place + 1}th"
        said = f"{nth} in the queue of {name}"
    there = robot_at(snapshot, station)
    return said if there == NIL else f"{said}, {_at_station(snapshot, there, station)}"


def _at_station(snapshot: Snapshot, robot: int, station: int) -> str:
    """What the robot at a station is doing."""
    fleet = snapshot.robots
    if fleet.action[robot] == ACTION_SERVE:
        return f"robot {robot} {served_words(snapshot, robot)}"
    ends = break_end(snapshot, station)
    if ends != NIL and station_of(snapshot, robot) == station:
        return f"robot {robot} stands there, {_break_left(snapshot, ends)}"
    return f"robot {robot} {served_words(snapshot, robot)}"


def served_words(snapshot: Snapshot, robot: int) -> str:
    """Whether the robot at a station is being served, and for how long."""
    fleet = snapshot.robots
    if fleet.action[robot] != ACTION_SERVE:
        return "stands there"
    left = int(fleet.busy[robot])
    return f"is served there for {count(left, 'more tick')}" if left else "is done there"


def _break_left(snapshot: Snapshot, ends: int) -> str:
    return f"which has a break for {count(ends - snapshot.tick, 'more tick')}"


def break_words(snapshot: Snapshot, robot: int) -> str:
    """Why a robot at its station is not served."""
    station = station_of(snapshot, robot)
    name, ends = station_name(snapshot, station), break_end(snapshot, station)
    rest = "which has a break" if ends == NIL else _break_left(snapshot, ends)
    return f"robot {robot} stands at {name}, {rest}"


def next_stations(snapshot: Snapshot, trips: Array) -> Array:
    """(k,) int32: the station of the next stop of each trip, NIL if no stop is left."""
    orders = snapshot.orders
    stop = orders.first_stop[trips] + orders.stops_done[trips]
    left = stop < orders.first_stop[trips + 1]
    result: Array = np.full(len(trips), NIL, np.int32)
    result[left] = snapshot.trips.station[stop[left]]
    return result


def full_stations(snapshot: Snapshot) -> Array:
    """(k,) bool: stations that admit no more trips."""
    stations = snapshot.pod_stations
    full: Array = (stations.places != NIL) & (stations.taken >= stations.places)
    return full


def no_place_words(snapshot: Snapshot, robot: int) -> str:
    """Say that all trips open to a robot are for stations without a free place; "" if not."""
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


# Chargers: robots that charge or queue, and for how long.


def ticks_to_charge(charge: int, level: int, curve: Array) -> int:
    """Ticks at a charger from one charge to another; NIL if the curve never reaches it.

    `curve`: (K, 2) rows of a charge and the units per tick from it on, as in automaton.engine.energy.
    """
    ticks = 0
    ends = [*curve[1:, 0].tolist(), BATTERY_FULL]
    for rate, end in zip(curve[:, 1].tolist(), ends, strict=True):
        missing = min(level, end) - charge
        if missing > 0:
            if rate <= 0:
                return NIL
            ticks += -(-missing // rate)
            charge += rate * -(-missing // rate)
    return ticks


def charging_at(snapshot: Snapshot, cell: int) -> list[int]:
    """The robots charging in a cell."""
    fleet = snapshot.robots
    robots: list[int] = np.flatnonzero(is_charging(fleet) & (fleet.cell == cell)).tolist()
    return robots


def charger_queue(snapshot: Snapshot, cell: int) -> list[int]:
    """The robots that queue before the charger in a cell, in arrival order."""
    fleet = snapshot.robots
    standing = np.flatnonzero(is_queueing(fleet) & (fleet.goal_cell == cell))
    found: list[int] = standing[np.argsort(fleet.ticket[standing])].tolist()
    return found


def sent_to(snapshot: Snapshot, cell: int) -> list[int]:
    """The robots on their way to the charger in a cell."""
    fleet = snapshot.robots
    going = (fleet.goal_type == GOAL_CHARGE) & (fleet.goal_cell == cell) & ~is_queueing(fleet)
    found: list[int] = np.flatnonzero(going & (fleet.cell != cell)).tolist()
    return found


def up_to(snapshot: Snapshot, robot: int) -> str:
    """The target charge of a robot, and the remaining time, in words."""
    fleet = snapshot.robots
    charge, charge_target = int(fleet.charge[robot]), int(fleet.charge_target[robot])
    ticks = ticks_to_charge(charge, charge_target, snapshot.curve[fleet.type[robot]])
    left = "which it never reaches" if ticks == NIL else f"{count(ticks, 'tick')} to go"
    return f"up to {percent(charge_target / BATTERY_FULL, 0)}, {left}"


def queueing_words(snapshot: Snapshot, robot: int, place: str) -> str:
    """Why a robot queues before the charger at `place`."""
    cell = int(snapshot.robots.goal_cell[robot])
    standing = charger_queue(snapshot, cell)
    before = standing[: standing.index(robot)] if robot in standing else []
    there = charging_at(snapshot, cell)
    said = [f"robot {one} is charging at {place} {up_to(snapshot, one)}" for one in there]
    if before:
        others = f" and {count(len(before) - 1, 'other')}" if len(before) > 1 else ""
        said.append(f"robot {before[0]}{others} came before it")
    blocker = int(snapshot.robots.blocker[robot])
    if not said and blocker != NIL:
        enters = int(snapshot.robots.claim[blocker]) == cell
        said.append(f"robot {blocker} {'drives into' if enters else 'holds'} {place}")
    return "; ".join(said) or f"robot {robot} is queueing"


# When an order is due and how late it is, in words.


def has_due_time(orders: Orders, order: int) -> bool:
    """Whether an order has a due time."""
    return int(orders.due[order]) != NEVER


def ticks_late(orders: Orders, order: int, now: int) -> int:
    """Ticks from the due time of an order to its delivery, or to now; negative if it is due later."""
    done = int(orders.state[order]) == ORDER_DELIVERED
    return (int(orders.delivered[order]) if done else now) - int(orders.due[order])


def tick_in_words(tick: int, scale: Scale) -> str:
    """A suffix such as " (10 min, 06:10)" if ticks have a time unit and the scenario a clock, or ""."""
    unit = scale.unit
    if unit.seconds is None:
        return ""
    value, name = duration(tick, unit)
    times = [f"{number(value)} {name}"]
    if scale.clock is not None:
        times.append(clock_text(scale.clock, tick * scale.tick_seconds))
    return f" ({', '.join(times)})"


def lateness_words(orders: Orders, order: int, now: int, scale: Scale) -> str:
    """Say "late by 20 ticks (10 s)", "in 5 ticks (2.5 s)", or "done in time"."""
    late = ticks_late(orders, order, now)
    if late > 0:
        return f"late by {ticks_and_time(late, scale.unit)}"
    if int(orders.state[order]) == ORDER_DELIVERED:
        return "done in time"
    return f"in {ticks_and_time(-late, scale.unit)}" if late else "now"


def due_words(orders: Orders, order: int, now: int, scale: Scale, what: str = "order") -> str:
    """Say when an order or trip is due, and how late it is: "order 3 is due in tick 40: now"."""
    due = int(orders.due[order])
    late = lateness_words(orders, order, now, scale)
    return f"{what} {order} is due in tick {due:,}{tick_in_words(due, scale)}: {late}"
