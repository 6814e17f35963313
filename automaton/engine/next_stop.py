"""How far an order has come: its load, if it has one, and the stops that are left."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.requests import request_allocation, set_goal
from automaton.engine.state import GOAL_STOP, NIL


@kernel
def has_load(orders, order):
    """Whether an order has a load, which is picked up before its stops and dropped after them."""
    return orders.source[order] != NIL


@kernel
def next_stop(orders, order):
    """The next stop of an order among all stops, NIL if none is left."""
    stop = np.int64(orders.first_stop[order]) + np.int64(orders.stops_done[order])
    return stop if stop < orders.first_stop[order + 1] else np.int64(NIL)


@kernel
def next_stop_cell(world, order):
    """The cell of the next stop of an order, NIL if none is left."""
    stop = next_stop(world.orders, order)
    return np.int64(NIL) if stop == NIL else np.int64(world.stops.cell[stop])


@kernel
def drive_on_with_load(world, i, reason):
    """Robot i has a load: it drives to the next stop; after the last one allocation says where to."""
    cell = next_stop_cell(world, np.int64(world.robots.load[i]))
    if cell == NIL:
        request_allocation(world, i, reason)
    else:
        set_goal(world, i, GOAL_STOP, cell)
