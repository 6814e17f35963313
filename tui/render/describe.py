"""What a cell holds, in one line.

(12, 4) shelf with load 7 for (20, 3), reserved by robot 2
(3, 0) track along x, robot 1 with load 4, waits: head-on
(5, 3) station P1 with 2 open lines, 1 in its queue, robot 1 with pod 2 (serve)
"""

from __future__ import annotations

import numpy as np

from automaton.drawings.looks import DETAIL_ONE_WAY, DETAIL_SHIFT, KIND_MASK
from automaton.engine.observation import CAUSES
from automaton.engine.state import (
    ACTION_IDLE,
    ACTION_NAMES,
    BATTERY_PERCENT,
    NIL,
    ORDER_DELIVERED,
    ORDER_WAITING,
    STATUS_TOWED,
)
from automaton.floor.cells import (
    ANY_LOADS,
    CELL_KINDS,
    DIRECTIONS,
    EXIT_EAST,
    EXIT_WEST,
    FLOOR,
    TRACK,
)
from automaton.history.state_words import (
    carries_pods,
    gates_in,
    has_trips,
    load_words,
    pod_name,
    station_queue,
    words_of,
)
from tui.registration import layers
from tui.render.scene import DETAIL_PASSING, DETAIL_UNLIMITED, Scene

MAX_NAMED_ROBOTS = 3  # named in one line


def describe(scene: Scene, cell: int) -> str:
    """One line about a cell of the floor."""
    parts = [place(scene, cell) + " " + ground(scene, cell) + _content(scene, cell)]
    if scene.snapshot is not None:
        snapshot = scene.snapshot
        parts += [words_of(snapshot, gate) for gate in gates_in(snapshot, cell)]
    for layer in layers().by_name.values():
        parts += layer.cell_words(scene, cell)
    if scene.values is not None and scene.floor.drivable[cell]:
        parts += scene.map_layer.value_words(int(scene.values[cell]))
    return ", ".join(parts + _robots(scene, cell))


def place(scene: Scene, cell: int) -> str:
    x, y = scene.floor.floor_plan.xy(cell)
    return f"({x}, {y})"


def ground(scene: Scene, cell: int) -> str:
    """The kind of a cell and what is special about it."""
    number = int(scene.floor.looks.reshape(-1)[cell])
    kind, detail = number & KIND_MASK, number >> DETAIL_SHIFT
    if kind == TRACK:
        return f"track along {'x' if detail & (EXIT_EAST | EXIT_WEST) else 'y'}"
    if kind == FLOOR and DETAIL_ONE_WAY <= detail < DETAIL_ONE_WAY + 4:
        return f"one-way floor {DIRECTIONS[detail - DETAIL_ONE_WAY]}"
    if kind == FLOOR and detail == DETAIL_PASSING:
        return "passing aisle"
    if kind == FLOOR and detail == DETAIL_UNLIMITED:
        return "floor for any number of robots"
    return CELL_KINDS[kind].name.replace("-", " ")


def _content(scene: Scene, cell: int) -> str:
    """What a slot holds."""
    slot, snapshot = int(scene.floor.slot_in[cell]), scene.snapshot
    if snapshot is None:
        return ""
    if slot == NIL:
        return _left(scene, cell)
    if carries_pods(snapshot):
        return _pod_words(scene, cell, slot)
    orders, slots = snapshot.orders, snapshot.slots
    text = ""
    kind = scene.floor.floor_plan.kind_of(cell)
    waiting = np.count_nonzero((orders.state == ORDER_WAITING) & (orders.current_slot == slot))
    if kind.holds == ANY_LOADS and kind.gives and kind.takes:
        arrived = np.count_nonzero((orders.state == ORDER_DELIVERED) & (orders.target == slot))
        text = f" with {waiting} loads to fetch, {arrived} brought"
    elif kind.holds == ANY_LOADS and kind.gives:
        text = f" with {waiting} loads"
    elif kind.holds == ANY_LOADS:
        arrived = (orders.state == ORDER_DELIVERED) & (orders.target == slot)
        text = f" with {np.count_nonzero(arrived)} loads"
    elif (order := int(slots.content[slot])) != NIL:
        text = f" with load {order}"
        if orders.target[order] != NIL:
            text += f" for {place(scene, int(slots.cell[orders.target[order]]))}"
        if orders.reserved_by[order] != NIL:
            text += f", to be fetched by robot {orders.reserved_by[order]}"
    else:
        text = ", empty"
    text += _left(scene, cell)
    return text + (
        f", reserved by robot {slots.reserved_by[slot]}" if slots.reserved_by[slot] != NIL else ""
    )


def _pod_words(scene: Scene, cell: int, slot: int) -> str:
    """The pod in a storage cell, or how busy a station is."""
    assert scene.snapshot is not None
    snapshot = scene.snapshot
    station = int(snapshot.pod_stations.station_at[cell])
    if station != NIL:
        queue = len(station_queue(snapshot, station))
        lines = int(snapshot.pod_stations.open_lines[station])
        lines_open = f"{lines:,} open lines, " if has_trips(snapshot) else ""
        return f" {snapshot.station_names[station]} with {lines_open}{queue} in its queue"
    pod, keeper = int(snapshot.slots.content[slot]), int(snapshot.slots.reserved_by[slot])
    if pod == NIL:
        return ", empty" + (f", reserved by robot {keeper}" if keeper != NIL else "")
    trip = int(snapshot.pods.trip[pod])
    fetcher = NIL if trip == NIL else int(snapshot.orders.reserved_by[trip])
    trip_name = f"{'trip' if has_trips(snapshot) else 'order'} {trip}"
    text = f" with {pod_name(snapshot, pod)}" + (f", wanted by {trip_name}" if trip != NIL else "")
    return text + (f", to be fetched by robot {fetcher}" if fetcher != NIL else "")


def _left(scene: Scene, cell: int) -> str:
    """Loads that robots had to leave in a cell."""
    if scene.snapshot is None or cell not in scene.left_loads:
        return ""
    slots, first = scene.snapshot.slots, len(scene.floor.slots_cell)
    loads = slots.content[first:][slots.cell[first:] == cell].tolist()
    return "".join(f", load {load} was left there" for load in loads if load != NIL)


def _robots(scene: Scene, cell: int) -> list[str]:
    """The robots in a cell, and those that are about to enter it."""
    if scene.snapshot is None:
        return []
    robots = scene.snapshot.robots
    at = np.where(robots.cell == NIL, robots.bay, robots.cell)
    here, coming = np.flatnonzero(at == cell).tolist(), np.flatnonzero(robots.claim == cell)
    said = [_robot(scene, robot) for robot in here[:MAX_NAMED_ROBOTS]]
    if len(here) > MAX_NAMED_ROBOTS:
        said.append(f"and {len(here) - MAX_NAMED_ROBOTS} robots more")
    return said + [f"robot {robot} comes" for robot in coming.tolist()]


def _robot(scene: Scene, robot: int) -> str:
    assert scene.snapshot is not None
    robots = scene.snapshot.robots
    words = [f"robot {robot}"]
    if robots.load[robot] != NIL:
        words.append(f"with {load_words(scene.snapshot, int(robots.load[robot]))}")
    if scene.floor.battery:
        words.append(f"at {robots.charge[robot] / BATTERY_PERCENT:.0f} %")
    if robots.status[robot] >= STATUS_TOWED:
        return " ".join([*words, "towed"])
    if robots.parked[robot]:
        return " ".join([*words, "parked"])
    if robots.cause[robot]:
        waits = f", waits: {CAUSES[robots.cause[robot]].name}"
        return (
            " ".join(words) + waits + (" in a wait cycle" if robots.wait_cycle_ticks[robot] else "")
        )
    if robots.action[robot] != ACTION_IDLE:
        words.append(f"({ACTION_NAMES[robots.action[robot]]})")
    return " ".join(words)
