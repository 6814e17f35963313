"""First come, first served: a free robot takes the order that has waited longest.

Orders are taken in the sequence in which they become known; ties: the lowest number. The robot
carries it to its own target. A cursor goes over the orders once in a run: those before it were all
taken. One that was given back is found by its robot, which remembers what it took last.
(Where robots see only what is near, the cursor is forgotten and every robot looks at all orders.)
"""

import numpy as np

from automaton.strategy.kernels import can_do, kernel
from automaton.strategy.layer import Strategy, memory_of
from automaton.world.state import NEXT_ORDER, NIL, PARK, PERIODIC, PICKED
from strategies.allocation.independent import deliver, take_order
from strategies.allocation.open_orders import is_open

TOOK = 0  # memory.own: 1 + the order that a robot took last, or 0

# memory.shared
LOOKED = 0  # orders looked at in the run so far: what the search has cost
CURSOR = (
    1  # and on, by type: entries of orders.coming before it were taken, or are not for the type
)


@kernel
def gave_back(view, given, memory):
    """Whether an order below the cursors is open again."""
    for j in range(memory.own.shape[0]):
        order = memory.own[j, TOOK] - 1
        if order >= 0 and is_open(view, given, order):
            return True
    return False


@kernel
def giver_back(view, given, memory, i):
    """The robot whose order below the cursor is open again for robot i, that of the lowest one; NIL."""
    robot = NIL
    if memory.shared[CURSOR + view.robots.type[i]] == 0:
        return robot  # what robots took is forgotten, with the cursor
    lowest = view.orders.state.shape[0]
    for j in range(memory.own.shape[0]):
        order = memory.own[j, TOOK] - 1
        if 0 <= order < lowest and is_open(view, given, order) and can_do(view, i, order):
            lowest = order
            robot = j
    return robot


@kernel
def next_order(view, given, memory, i):
    """The first open order for robot i from the cursor on, NIL if there is none; the cursor stops."""
    cursor = CURSOR + view.robots.type[i]
    for k in range(memory.shared[cursor], view.clock[NEXT_ORDER]):
        order = np.int64(view.orders.coming[k])
        memory.shared[LOOKED] += 1
        memory.shared[cursor] = k + 1
        if order == NIL:
            continue  # another zone's, out of sight
        if is_open(view, given, order) and can_do(view, i, order):
            return order
    return NIL


@kernel
def decide(view, asked, answers, memory, space):
    given = answers.allocation
    again = gave_back(view, given, memory)
    for k in range(asked.count[0]):
        if space.stop[0]:
            return
        i = np.int64(asked.robot[k])
        if asked.reason[k] == PICKED:
            deliver(view, given, k, i)
        elif asked.reason[k] == PERIODIC:
            continue
        else:
            giver = giver_back(view, given, memory, i) if again else NIL
            order = next_order(view, given, memory, i) if giver == NIL else NIL
            if giver != NIL:
                order = memory.own[giver, TOOK] - 1
                memory.own[giver, TOOK] = memory.own[i, TOOK]  # that one may be open again, too
            if order == NIL:
                given.verb[k] = PARK
            else:
                take_order(view, given, k, i, order)
                memory.own[i, TOOK] = order + 1


class FirstCome(Strategy):
    """Every robot takes the oldest unreserved order and carries it to its destination."""

    layer = "allocation"
    compiled = decide

    def reset(self, view):
        return memory_of(view, own=1, shared=CURSOR + len(view.grid.ways))
