"""Orders by when they are due: a binary heap for each type of robots.

Of orders of the highest priority the one that is due first comes first, those without a due time last;
ties: the one released first, then the lowest number. An order is entered when it is released, again
when it has come back, and again when it is to come earlier than it was. One that is taken stays in the
heaps of other types until it is the first there, so each order is looked at a few times for each type,
and moved by log2 of those that wait.
"""

import numpy as np

from automaton.engine.jit.structs import Struct, field
from automaton.engine.state import CLOCK_NEXT_RELEASE, NIL, Array
from automaton.strategy.kernels import (
    can_do,
    is_open,
    kernel,
)


class DueQueue(Struct):
    """Orders that were released and may be open."""

    order: Array = field("(K, q) int32", "by type: its heap; the first `size` are in use")
    size: Array = field("(K,) int64", "how many orders that are")
    place: Array = field("(K, q) int32", "by type and order: 1 + its place in the heap, or 0")
    released: Array = field("(1,) int64", "entries of orders.release_sequence that were looked at")
    looked: Array = field("(1,) int64", "orders entered and taken out: what the queue has cost")


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


@kernel
def put(queue, robot_type, at, order):
    """Put an order into a place of a heap."""
    queue.order[robot_type, at] = order
    queue.place[robot_type, order] = at + 1


@kernel
def enter_order(view, queue, order):
    """Enter an order into all heaps; in one in which it is, it may come forward."""
    for robot_type in range(queue.size.shape[0]):
        at = np.int64(queue.place[robot_type, order]) - 1
        if at == NIL:
            at = queue.size[robot_type]
            queue.size[robot_type] = at + 1
        queue.looked[0] += 1
        while at > 0:
            above = np.int64(queue.order[robot_type, (at - 1) >> 1])
            if comes_before(view, above, order):
                break
            put(queue, robot_type, at, above)
            at = (at - 1) >> 1
        put(queue, robot_type, at, order)


@kernel
def drop_first(view, queue, robot_type):
    """Take the first order out of a heap."""
    heap, last = queue.order[robot_type], queue.size[robot_type] - 1
    queue.size[robot_type] = last
    queue.looked[0] += 1
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
def enter_released(view, queue):
    """Enter the orders that were released since the last time."""
    for k in range(queue.released[0], view.clock[CLOCK_NEXT_RELEASE]):
        order = np.int64(view.orders.release_sequence[k])
        if order != NIL:  # another zone's, out of sight
            enter_order(view, queue, order)
    queue.released[0] = view.clock[CLOCK_NEXT_RELEASE]


@kernel
def first_due(view, out, queue, i):
    """The open order for robot i that comes before all others, or NIL.

    It is taken out of the heap, with those before it that were taken or are not for the robot's type.
    """
    robot_type = np.int64(view.robots.type[i])
    while queue.size[robot_type] > 0:
        order = np.int64(queue.order[robot_type, 0])
        drop_first(view, queue, robot_type)
        if is_open(view, out, i, order) and can_do(view, i, order):
            return order
    return np.int64(NIL)
