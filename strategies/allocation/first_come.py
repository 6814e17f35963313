"""First come, first served: a free robot takes the order that has waited longest.

Orders are taken in the sequence in which they are released; ties: the lowest number. The robot
carries it to its own target. A cursor goes over the orders once in a run: those before it were all
taken. One that was given back is found by its robot, which remembers what it took last.
(Where robots see only what is near, the cursor is forgotten and every robot looks at all orders.)
"""

import numpy as np

from automaton.engine.jit.fields import field
from automaton.engine.jit.structs import Struct
from automaton.engine.state import (
    CLOCK_NEXT_RELEASE,
    CMD_PARK,
    NIL,
    REASON_PERIODIC,
    Array,
)
from automaton.strategy.kernels import can_do, kernel
from automaton.strategy.layer import Strategy
from strategies.allocation.independent import deliver, places_load, take_order
from strategies.allocation.open_orders import is_open


class FirstComeState(Struct):
    """How far the orders have been looked at, and who took which."""

    took: Array = field("(n,) int32", "1 + the order that a robot took last, or 0")
    cursor: Array = field(
        "(K,) int64", "by type: orders.release_sequence before it was taken, or is not for the type"
    )
    looked: Array = field("(1,) int64", "orders looked at so far: what the search has cost")


@kernel
def has_returned_order(view, out, state):
    """Whether an order below the cursors is open again."""
    for j in range(state.took.shape[0]):
        order = state.took[j] - 1
        if order >= 0 and is_open(view, out, order):
            return True
    return False


@kernel
def robot_that_returned_order(view, out, state, i):
    """The robot whose order below the cursor is open again for robot i, that of the lowest one; NIL."""
    robot = NIL
    if state.cursor[view.robots.type[i]] == 0:
        return robot  # what robots took is forgotten, with the cursor
    lowest = view.orders.state.shape[0]
    for j in range(state.took.shape[0]):
        order = state.took[j] - 1
        if 0 <= order < lowest and is_open(view, out, order) and can_do(view, i, order):
            lowest = order
            robot = j
    return robot


@kernel
def next_order(view, out, state, i):
    """The first open order for robot i from the cursor on, NIL if there is none; the cursor stops."""
    robot_type = view.robots.type[i]
    for k in range(state.cursor[robot_type], view.clock[CLOCK_NEXT_RELEASE]):
        order = np.int64(view.orders.release_sequence[k])
        state.looked[0] += 1
        state.cursor[robot_type] = k + 1
        if order == NIL:
            continue  # another zone's, out of sight
        if is_open(view, out, order) and can_do(view, i, order):
            return order
    return NIL


@kernel
def decide(view, batch, decisions, memory, workspace):
    out = decisions.allocation
    state = FirstComeState.of(memory)
    again = has_returned_order(view, out, state)
    for k in range(batch.count[0]):
        if workspace.stop[0]:
            return
        i = np.int64(batch.robot[k])
        if places_load(batch.reason[k]):
            deliver(view, out, k, i)
        elif batch.reason[k] == REASON_PERIODIC:
            continue
        else:
            giver = robot_that_returned_order(view, out, state, i) if again else NIL
            order = next_order(view, out, state, i) if giver == NIL else NIL
            if giver != NIL:
                order = state.took[giver] - 1
                state.took[giver] = state.took[i]  # that one may be open again, too
            if order == NIL:
                out.command[k] = CMD_PARK
            else:
                take_order(view, out, k, i, order)
                state.took[i] = order + 1


class FirstCome(Strategy):
    """Every robot takes the oldest unreserved order and carries it to its destination."""

    layer = "allocation"
    compiled = decide

    def reset(self, view):
        sizes = {"n": len(view.robots.cell), "K": len(view.grid.type_cell_flags)}
        return FirstComeState.sized(sizes)
