"""First come, first served: a free robot takes the order that has waited longest, or is due first.

Robots take orders in the sequence of their release (ties: the lowest number) and carry each to its own
target. A cursor passes over the orders once per run: all orders before it were taken. An order that was
given back is found through its robot, since the state stores the last order of each robot. With `by:
due` a queue holds the released orders, and orders that are given back re-enter it. (With limited
sight, cursor and queue are not kept, and each robot searches all orders.)
"""

import numpy as np

from automaton.strategy.api import (
    CMD_PARK,
    NIL,
    REASON_PERIODIC,
    STORAGE_POLICIES,
    Array,
    Strategy,
    Struct,
    can_do,
    field,
    highest_priority,
    is_open,
    kernel,
    place_load,
    places_load,
    take_order,
)
from strategies.allocation.allocation_parameters import FirstComeParameters


class DueQueue(Struct):
    """Released orders that may be open."""

    order: Array = field("(K, q) int32", "heap of each type; the first `size` entries are in use")
    size: Array = field("(K,) int64", "number of entries in use")
    place: Array = field("(K, q) int32", "by type and order: 1 + its place in the heap, or 0")
    released: int = field(
        "() int64", "number of entries of orders.release_sequence already processed"
    )
    looked: int = field("() int64", "number of insertions and removals, the cost of the queue")


class FirstComeState(Struct):
    """The cursors, and the last order of each robot."""

    took: Array = field("(n,) int32", "1 + the order that a robot took last, or 0")
    cursor: Array = field(
        "(K, p) int64",
        "by type and priority: entries of orders.release_sequence before it are taken or unsuitable",
    )
    looked: int = field("() int64", "number of orders examined, the cost of the search")
    storage: int = field("int64", "where pods are stored: its place among STORAGE_POLICIES")
    by_due: int = field("int64", "1: orders are taken from the queue, by due time")
    queue: DueQueue


@kernel
def decide(view, batch, decisions, memory, workspace):
    out = decisions.allocation
    state = FirstComeState.of(memory)
    again = False
    if state.by_due:
        fill_queue(view, out, state)
    else:
        again = has_returned_order(view, out, state)
    for k in range(batch.count):
        if workspace.stop[0]:
            return
        i = np.int64(batch.robot[k])
        if places_load(batch.reason[k]):
            place_load(view, out, workspace, k, i, state.storage)
        elif batch.reason[k] == REASON_PERIODIC:
            continue
        else:
            if view.trips.pod.shape[0]:
                order = first_trip(view, out, state, i)
            elif state.by_due:
                order = first_due(view, out, state.queue, i)
            else:
                order = order_for(view, out, state, i, again)
            if order == NIL:
                out.command[k] = CMD_PARK
            else:
                take_order(view, out, k, i, order)
                state.took[i] = order + 1


class FirstCome(Strategy):
    """Every robot carries the oldest unreserved order, or the one due first, to its destination."""

    layer = "allocation"
    Parameters = FirstComeParameters
    compiled = decide

    def reset(self, view):
        sizes = {
            "n": len(view.robots.cell),
            "K": len(view.grid.type_cell_flags),
            "p": len(view.rules.priorities),
        }
        storage = STORAGE_POLICIES.index(self.parameters.storage)
        by_due = self.parameters.by == "due"
        places = {"K": sizes["K"], "q": len(view.orders.state) if by_due else 0}
        return FirstComeState.sized(
            sizes, by_due=int(by_due), storage=storage, queue=DueQueue.sized(places)
        )


@kernel
def has_returned_order(view, out, state):
    """Whether an order below the cursors is open again."""
    for j in range(state.took.shape[0]):
        order = state.took[j] - 1
        if order >= 0 and is_open(view, out, j, order):
            return True
    return False


@kernel
def order_for(view, out, state, i, again):
    """The oldest open order of the highest priority for robot i; `again`: also a returned one."""
    for rank in range(view.rules.priorities.shape[0]):
        giver = robot_that_returned_order(view, out, state, i, rank) if again else NIL
        if giver != NIL:
            order = np.int64(state.took[giver]) - 1
            state.took[giver] = state.took[i]  # the robot's own order may be open again, too
            return order
        order = next_order(view, out, state, i, rank)
        if order != NIL:
            return order
    return np.int64(NIL)


@kernel
def robot_that_returned_order(view, out, state, i, rank):
    """The robot whose order before the cursor is open again for robot i, the lowest such order; or NIL.

    For orders of one priority: `rank` is its place among the priorities.
    """
    robot = NIL
    if state.cursor[view.robots.type[i], rank] == 0:
        return robot  # last orders are not kept, nor is the cursor
    lowest = view.orders.state.shape[0]
    for j in range(state.took.shape[0]):
        order = state.took[j] - 1
        if order < 0 or order >= lowest:
            continue
        if view.orders.priority[order] != view.rules.priorities[rank]:
            continue
        if is_open(view, out, i, order) and can_do(view, i, order):
            lowest = order
            robot = j
    return robot


@kernel
def next_order(view, out, state, i, rank):
    """The first open order of a priority for robot i from the cursor on, NIL if there is none.

    The cursor stops there.
    """
    robot_type = view.robots.type[i]
    for k in range(state.cursor[robot_type, rank], view.clock.next_release):
        order = np.int64(view.orders.release_sequence[k])
        state.looked += 1
        state.cursor[robot_type, rank] = k + 1
        if order == NIL or view.orders.priority[order] != view.rules.priorities[rank]:
            continue  # an order of another zone, out of sight
        if is_open(view, out, i, order) and can_do(view, i, order):
            return order
    return NIL


@kernel
def first_trip(view, out, state, i):
    """The first trip of the highest priority for robot i, or NIL.

    A trip may have to wait for a place at its station, so there is no cursor for trips.
    """
    orders = view.orders
    best, first, least = np.int64(NIL), np.int64(0), highest_priority(view, out, i)
    for order in range(view.clock.first_open, view.clock.known_orders):
        if orders.priority[order] < least or not is_open(view, out, i, order):
            continue
        when = np.int64(orders.due[order] if state.by_due else orders.release_tick[order])
        if (best == NIL or when < first) and can_do(view, i, order):
            best, first = np.int64(order), when
    return best


# Orders by due time: a binary heap for each robot type.
#
# The highest priority comes first, then the earliest due time; orders without a due time come last.
# Ties: the first release, then the lowest number. An order is inserted when it is released, when it is
# returned, and when it must come earlier than before. A taken order stays in the heaps of other types
# until it is first there. So each order is examined a few times per type, and moved by log2 of the
# number of waiting orders.


@kernel
def first_due(view, out, queue, i):
    """The first open order for robot i, or NIL.

    Removes it from the heap, with all orders before it that are taken or not for the robot's type.
    """
    robot_type = np.int64(view.robots.type[i])
    while queue.size[robot_type] > 0:
        order = np.int64(queue.order[robot_type, 0])
        drop_first(view, queue, robot_type)
        if is_open(view, out, i, order) and can_do(view, i, order):
            return order
    return np.int64(NIL)


@kernel
def fill_queue(view, out, state):
    """Insert released and returned orders into the queue."""
    enter_released(view, state.queue)
    for j in range(state.took.shape[0]):
        order = np.int64(state.took[j]) - 1
        if order >= 0 and is_open(view, out, j, order):
            enter_order(view, state.queue, order)
            state.took[j] = 0


@kernel
def enter_released(view, queue):
    """Insert the orders released since the last call."""
    for k in range(queue.released, view.clock.next_release):
        order = np.int64(view.orders.release_sequence[k])
        if order != NIL:  # an order of another zone, out of sight
            enter_order(view, queue, order)
    queue.released = view.clock.next_release


@kernel
def enter_order(view, queue, order):
    """Insert an order into all heaps; if a heap has it already, it may move forward."""
    for robot_type in range(queue.size.shape[0]):
        at = np.int64(queue.place[robot_type, order]) - 1
        if at == NIL:
            at = queue.size[robot_type]
            queue.size[robot_type] = at + 1
        queue.looked += 1
        while at > 0:
            above = np.int64(queue.order[robot_type, (at - 1) >> 1])
            if comes_before(view, above, order):
                break
            put(queue, robot_type, at, above)
            at = (at - 1) >> 1
        put(queue, robot_type, at, order)


@kernel
def drop_first(view, queue, robot_type):
    """Remove the first order of a heap."""
    heap, last = queue.order[robot_type], queue.size[robot_type] - 1
    queue.size[robot_type] = last
    queue.looked += 1
    order, at = np.int64(heap[last]), 0
    queue.place[robot_type, heap[0]] = 0
    if last == 0:
        return
    while 2 * at + 1 < last:
        below = 2 * at + 1
        if below + 1 < last and comes_before(
            view, np.int64(heap[below + 1]), np.int64(heap[below])
        ):
            below += 1
        if comes_before(view, order, np.int64(heap[below])):
            break
        put(queue, robot_type, at, np.int64(heap[below]))
        at = below
    put(queue, robot_type, at, order)


@kernel
def put(queue, robot_type, at, order):
    """Put an order into a place of a heap."""
    queue.order[robot_type, at] = order
    queue.place[robot_type, order] = at + 1


@kernel
def comes_before(view, a, b):
    """Whether order a comes before order b."""
    orders = view.orders
    if orders.priority[a] != orders.priority[b]:
        return orders.priority[a] > orders.priority[b]
    if orders.due[a] != orders.due[b]:
        return orders.due[a] < orders.due[b]
    if orders.release_tick[a] != orders.release_tick[b]:
        return orders.release_tick[a] < orders.release_tick[b]
    return a < b
