"""The orders that were asked for, whatever the world makes of them: those of lines, or its own.

Where pods are carried, the orders of the world are trips; an order is done with the last of its lines.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from automaton.engine.facilities import Lines
from automaton.engine.state import (
    CLOCK_TICK,
    NEVER,
    NIL,
    ORDER_DELIVERED,
    ORDER_UNRELEASED,
    Array,
    Orders,
    World,
)


class AskedOrders(NamedTuple):
    """The orders of a run: (m,) each."""

    release: Array  # int64: the tick from which it is known
    due: Array  # int64: NEVER without a due time
    done: Array  # int64: the tick in which it was done, or NIL
    is_known: Array  # bool

    @property
    def is_open(self) -> Array:
        """(m,) bool: known and not done."""
        is_open: Array = self.is_known & (self.done == NIL)
        return is_open

    def after(self, tick: int) -> AskedOrders:
        """Those that were done after a tick, or are open."""
        later = self.is_open | (self.done > tick)
        return AskedOrders(*(column[later] for column in self))


def has_lines(world: World) -> bool:
    """Whether orders consist of lines."""
    return len(world.lines.order) > 0


def asked_orders(world: World) -> AskedOrders:
    """The orders of a world that pods are carried for, or its own."""
    orders, lines = world.orders, world.lines
    if not has_lines(world):
        is_done = orders.state == ORDER_DELIVERED
        done = np.where(is_done, orders.delivered, NIL).astype(np.int64)
        known = orders.state != ORDER_UNRELEASED
        if len(world.pods.slot):  # some may wait for their pods
            known |= orders.release_tick <= world.clock[CLOCK_TICK]
        return AskedOrders(
            orders.release_tick.astype(np.int64), orders.due.astype(np.int64), done, known
        )
    release, due = (np.full(len(lines.left), NEVER, np.int64) for _ in range(2))
    np.minimum.at(release, lines.order, lines.release_tick)
    np.minimum.at(due, lines.order, lines.due)
    known = release <= world.clock[CLOCK_TICK]
    return AskedOrders(release, due, lines.order_done.astype(np.int64), known)


def asked_count(world: World) -> int:
    """How many orders there are."""
    return len(world.lines.left) if has_lines(world) else len(world.orders.state)


def done_count(orders: Orders, lines: Lines) -> int:
    """How many of them are done."""
    if len(lines.order):
        return int(np.count_nonzero(lines.order_done != NIL))
    return int(np.count_nonzero(orders.state == ORDER_DELIVERED))
