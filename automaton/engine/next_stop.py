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
def next_stop(world, order):
    """The next stop of an order among all stops, NIL if none is left."""
    stop = np.int64(world.orders.first_stop[order]) + np.int64(world.orders.stops_done[order])
    if stop == world.orders.first_stop[order + 1] or world.stops.cell[stop] == NIL:
        return np.int64(NIL)
    return stop


@kernel
def end_of_stops(world, order):
    """The first stop that is not one of an order any more."""
    end = np.int64(world.orders.first_stop[order + 1])
    if world.trips.pod.shape[0]:
        stop = np.int64(world.orders.first_stop[order])
        while stop < end and world.stops.cell[stop] != NIL:
            stop += 1
        return stop
    return end


@kernel
def next_stop_cell(world, order):
    """The cell of the next stop of an order, NIL if none is left."""
    stop = next_stop(world, order)
    return np.int64(NIL) if stop == NIL else np.int64(world.stops.cell[stop])


@kernel
def drive_on_with_load(world, i, reason):
    """Robot i has a load: it drives to the next stop; after the last one allocation says where to."""
    cell = next_stop_cell(world, np.int64(world.robots.load[i]))
    if cell == NIL:
        request_allocation(world, i, reason)
    else:
        set_goal(world, i, GOAL_STOP, cell)
