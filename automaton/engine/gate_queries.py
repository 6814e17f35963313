"""What is asked of gates: whether they are closed, shut or full, and what a move in a lift takes."""

import numpy as np

from automaton.engine.gates import GATE_BLOCK, GATE_CLOSING, GATE_DOOR, GATE_LIFT
from automaton.engine.jit.kernel import kernel
from automaton.engine.motion import LIVE, U
from automaton.engine.state import CLOCK_TICK, NIL


@kernel
def has_gates(view):
    """Whether there are gates on the floor."""
    return view.gates.kind.shape[0] > 0


@kernel
def is_gated(view, cell):
    """Whether a cell has a gate."""
    return view.gates.cell_first[cell] != view.gates.cell_first[cell + 1]


@kernel
def index_in(gates, cell, gate):
    """The entry of a cell in a gate, or NIL: it is not in it."""
    for entry in range(gates.cell_first[cell], gates.cell_first[cell + 1]):
        if gates.cell_gate[entry] == gate:
            return entry
    return NIL


@kernel
def is_closed_now(view, gate):
    """Whether a closing lasts."""
    row = view.gates.first_closing[gate] + view.gates.closing[gate]
    tick = view.clock[CLOCK_TICK]
    return (
        row < view.gates.first_closing[gate + 1]
        and view.gates.closings[row, 0] <= tick < view.gates.closings[row, 1]
    )


@kernel
def closed_until(view, cell, known):
    """The tick from which a cell that is closed now is open again, 0 if it is not closed.

    `known`: closings of which routing may not know how long they last do not count.
    """
    gates, until = view.gates, np.int64(0)
    if gates.kind.shape[0] == 0:
        return until
    for entry in range(gates.cell_first[cell], gates.cell_first[cell + 1]):
        gate = gates.cell_gate[entry]
        if gates.kind[gate] == GATE_CLOSING and is_closed_now(view, gate):
            if gates.known[gate] or not known:
                row = gates.first_closing[gate] + gates.closing[gate]
                until = max(until, gates.closings[row, 1])
    return until


@kernel
def is_shut(view, gate):
    """Whether a closing or a door lets no robot in."""
    if view.gates.kind[gate] == GATE_CLOSING:
        return is_closed_now(view, gate)
    return view.gates.kind[gate] == GATE_DOOR and (
        view.gates.open_from[gate] > view.clock[CLOCK_TICK]
    )


@kernel
def gate_before(view, i, to):
    """The gate that keeps robot i out of a cell beside it in this tick, whoever else moves; or NIL."""
    gates, cell = view.gates, np.int64(view.robots.cell[i])
    if gates.kind.shape[0] == 0:
        return np.int64(NIL)
    for entry in range(gates.cell_first[to], gates.cell_first[to + 1]):
        gate = np.int64(gates.cell_gate[entry])
        if cell != NIL and index_in(gates, cell, gate) != NIL:
            continue
        if is_shut(view, gate):
            return gate
        if gates.kind[gate] < GATE_BLOCK:
            continue
        if gates.robots[gate] >= gates.max_robots[gate]:
            return gate
        if gates.kind[gate] == GATE_LIFT:
            if gates.mouth[gate] != to or gates.open_from[gate] > view.clock[CLOCK_TICK]:
                return gate
            if gates.caller[gate] != view.robots.identity[i]:
                return gate
        elif gates.same_way[gate] and gates.robots[gate]:
            if gates.mouth[gate] != NIL and gates.mouth[gate] != to:
                return gate
    return np.int64(NIL)


@kernel
def opens_soon(view, gate, i):
    """Whether a gate that keeps robot i opens to it by itself: a door, or a lift that comes for it."""
    gates = view.gates
    if gates.kind[gate] != GATE_LIFT:
        return gates.kind[gate] == GATE_DOOR
    is_for_it = gates.caller[gate] == NIL or gates.caller[gate] == view.robots.identity[i]
    return gates.robots[gate] == 0 and is_for_it


@kernel
def is_in_full_gate(view, cell):
    """Whether a cell is in a block or lift that holds as many robots as it may: no robot comes in."""
    gates = view.gates
    if gates.kind.shape[0] == 0:
        return False
    for entry in range(gates.cell_first[cell], gates.cell_first[cell + 1]):
        gate = gates.cell_gate[entry]
        if gates.kind[gate] >= GATE_BLOCK and gates.robots[gate] >= gates.max_robots[gate]:
            return True
    return False


@kernel
def set_cabin_ticks(world):
    """In a lift moves take their share of the ticks from one mouth to the next."""
    robots, traffic = world.robots, world.traffic
    for i in range(robots.cell.shape[0]):
        intent = np.int64(traffic.intent[U(i)])
        if intent & LIVE:
            ticks = world.gates.cabin_ticks[U(robots.cell[U(i)]), U(intent & 3)]
            if ticks:
                traffic.move_ticks[U(i)] = ticks


@kernel
def is_cabin_move(world, i, direction):
    """Whether a move that robot i has made, or is in, takes the ticks of a lift."""
    cell = np.int64(world.robots.cell[U(i)])
    if world.robots.claim[U(i)] == NIL:
        cell -= world.grid.offset[U(direction)]
    return world.gates.cabin_ticks[U(cell), U(direction)] != 0
