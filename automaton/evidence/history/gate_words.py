"""What is said of closed cells, doors, blocks and lifts: why one keeps a robot, and until when."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from automaton.engine.facilities import GATE_BLOCK, GATE_CLOSING, GATE_DOOR, GATE_LIFT
from automaton.engine.observation import CAUSE_CLOSED, CAUSE_LIFT
from automaton.engine.state import CLOCK_TICK, NEVER, NIL, Array, World
from automaton.units import count

if TYPE_CHECKING:  # it needs Numba
    from automaton.evidence.history.snapshot import Snapshot


def is_kept_by_gate(cause: int) -> bool:
    """Whether a cause is that a gate keeps a robot."""
    return CAUSE_CLOSED <= cause <= CAUSE_LIFT


def gate_words(snapshot: Snapshot, robot: int) -> str:
    """Why a gate keeps a robot that waits for a cell, and until when as far as that is settled."""
    wanted = int(snapshot.robots.wanted[robot])
    kind = int(snapshot.robots.cause[robot]) - CAUSE_CLOSED
    x, y = wanted % snapshot.stride - 1, wanted // snapshot.stride - 1
    gate = next((gate for gate in gates_in(snapshot, wanted) if keeps(snapshot, gate, kind)), NIL)
    return f"({x}, {y}) is {words_of(snapshot, gate, robot)}" if gate != NIL else ""


def gates_in(snapshot: Snapshot, cell: int) -> list[int]:
    """The gates that a flat cell has."""
    gates = snapshot.gates
    if not len(gates.kind):
        return []
    gates_of_cell: list[int] = gates.cell_gate[
        gates.cell_first[cell] : gates.cell_first[cell + 1]
    ].tolist()
    return gates_of_cell


def keeps(snapshot: Snapshot, gate: int, kind: int) -> bool:
    """Whether a gate is of a kind, and may have kept a robot in the last tick."""
    if snapshot.gates.kind[gate] != kind:
        return False
    if kind == GATE_CLOSING:
        return closed_until(snapshot, gate) != NIL
    if kind == GATE_BLOCK:
        return bool(snapshot.gates.same_way[gate]) or len(robots_in(snapshot, gate)) > 0
    return True


def closed_until(snapshot: Snapshot, gate: int) -> int:
    """The tick from which a closing is over that lasts; NIL if it is open."""
    gates = snapshot.gates
    row = int(gates.first_closing[gate] + gates.closing[gate])
    if gates.kind[gate] != GATE_CLOSING or row >= gates.first_closing[gate + 1]:
        return NIL
    first, end = gates.closings[row].tolist()
    return end if first <= snapshot.tick < end else NIL


def cells_of(snapshot: Snapshot, gate: int) -> Array:
    """(k,) int32: the flat cells of a gate."""
    gates = snapshot.gates
    entries = np.flatnonzero(gates.cell_gate == gate)
    cells: Array = np.searchsorted(gates.cell_first, entries, side="right").astype(np.int32) - 1
    return cells


def robots_in(snapshot: Snapshot, gate: int) -> list[int]:
    """The robots that are in a gate, or on their way into it."""
    cells = cells_of(snapshot, gate)
    robots = snapshot.robots
    inside = np.isin(robots.cell, cells) | np.isin(robots.claim, cells)
    identities: list[int] = np.flatnonzero(inside).tolist()
    return identities


def words_of(snapshot: Snapshot, gate: int, robot: int = NIL) -> str:
    """What a gate is like: "closed until tick 60, for 12 more ticks"."""
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
    """Robots behind a colon, three of them by name; "" without any."""
    if not robots:
        return ""
    names = ", ".join(f"robot {robot}" for robot in robots[:3])
    return f": {names}{' and others' if len(robots) > 3 else ''}"


def shut_cells(snapshot: Snapshot) -> tuple[Array, Array]:
    """(k,) int32 flat cells that are closed now, and (d,) of doors that are not open."""
    gates = snapshot.gates
    closed = [
        cells_of(snapshot, gate)
        for gate in range(len(gates.kind))
        if closed_until(snapshot, gate) != NIL
    ]
    shut = [
        cells_of(snapshot, int(gate))
        for gate in np.flatnonzero((gates.kind == GATE_DOOR) & (gates.open_from > snapshot.tick))
    ]
    none = np.zeros(0, np.int32)
    return np.concatenate([none, *closed]), np.concatenate([none, *shut])


def gate_states(world: World) -> Array:
    """(g,) int64: what is reported of gates when it changes; 0 for gates as they are at rest.

    1 for a closing that lasts and for a door that opens or is open, the number of the robot that called
    a lift, from 1; always 0 for blocks.
    """
    gates, tick = world.gates, int(world.clock[CLOCK_TICK])
    states = np.zeros(len(gates.kind), np.int64)
    rows = gates.first_closing[:-1] + gates.closing
    at = np.flatnonzero((gates.kind == GATE_CLOSING) & (rows < gates.first_closing[1:]))
    begins, ends = gates.closings[rows[at]].T
    states[at] = (begins <= tick) & (tick < ends)
    states[gates.kind == GATE_DOOR] = gates.open_from[gates.kind == GATE_DOOR] != NEVER
    states[gates.kind == GATE_LIFT] = gates.caller[gates.kind == GATE_LIFT] + 1
    return states


def gate_words_of(snapshot: Snapshot, gate: int) -> str:
    """Where a gate is and what it is like: "(3, 0) is a door that is open"."""
    cells = cells_of(snapshot, gate)
    x, y = int(cells[0]) % snapshot.stride - 1, int(cells[0]) // snapshot.stride - 1
    others = "" if len(cells) == 1 else f", one of {count(len(cells), 'cell')},"
    return f"({x}, {y}){others} is {words_of(snapshot, gate)}"
