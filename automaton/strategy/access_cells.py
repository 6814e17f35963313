"""From which cell a robot picks up and drops: one rule, for whatever decides it or predicts it.

fixed (default)   A load is picked up from the right of its shelf where the floor allows it (the
                  table-top robots stand at (x + 1, y)), and dropped from the left: so loads travel
                  to the right.
nearest           The cell with the least rows and columns to the cell from which the robot comes;
                  of several the one that is first by the fixed rule.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import (
    end_of_stops,
    first_cell,
    has_load,
    next_stop_cell,
    with_load,
)
from automaton.engine.state import NIL
from automaton.engine.visits import is_assigned

PICK_DIRECTIONS = (0, 2, 1, 3)  # neighbours E, W, S, N of the slot; to drop, each turned around


@kernel
def position(view, i):
    """The cell from which a robot drives on: in a long move the one that it enters, its home in its
    parking bay."""
    return first_cell(view.robots, i)


@kernel
def access_cell(view, robot_type, slot, turned, origin):
    """The cell from which robots of a type serve a slot, NIL if there is none.

    turned: 0 to pick up, 2 to drop; origin: the cell from which the robot comes, NIL if unknown.
    """
    one = view.slots.reachable.shape[0] == 1  # then access holds only what it gets to
    robot_type = with_load(view, robot_type)
    is_nearest = view.rules.nearest_access != 0 and origin != NIL
    width = view.grid.width
    best, least = np.int64(NIL), np.int64(0)
    for direction in PICK_DIRECTIONS:
        cell = np.int64(view.slots.access[slot, direction ^ turned])
        if cell == NIL or not (one or view.slots.reachable[robot_type, cell]):
            continue
        if not is_nearest:
            return cell
        way = abs(cell // width - origin // width) + abs(cell % width - origin % width)
        if best == NIL or way < least:
            best, least = cell, way
    return best


@kernel
def pickup_cell(view, robot_type, slot, origin):
    """The cell from which robots of a type that come from `origin` pick a load up, or NIL."""
    return access_cell(view, robot_type, slot, 0, origin)


@kernel
def cell_beside(view, slot, direction):
    """The neighbour of a slot in a direction, of those from which any robots serve it, or NIL."""
    return np.int64(view.slots.access[slot, direction])


@kernel
def begin_cell(view, robot_type, order, origin):
    """The cell where robots of a type that come from `origin` begin an order that waits, or NIL.

    There they pick its load up; of an order without a load it is the next stop.
    """
    if not has_load(view.orders, order):
        return next_stop_cell(view, order)
    return pickup_cell(view, robot_type, np.int64(view.orders.current_slot[order]), origin)


@kernel
def dropoff_cell(view, robot_type, slot, origin):
    """The cell from which robots of a type that come from `origin` drop a load, or NIL."""
    return access_cell(view, robot_type, slot, 2, origin)


@kernel
def can_bring(view, robot_type, order, slot):
    """Whether robots of a type carry an order, and get to where it lies, to its stops and to a slot."""
    if view.orders.weight[order] > view.rules.payload[robot_type]:
        return False
    if not reaches_stops(view, robot_type, order):
        return False
    if not has_load(view.orders, order):
        return True
    accessible = view.slots.accessible
    if slot == NIL:
        return accessible[robot_type, view.orders.current_slot[order]] != 0
    if accessible.shape[0] == 1:
        return True  # there are no orders but for slots that a robot serves
    return (
        accessible[robot_type, view.orders.current_slot[order]] != 0
        and accessible[robot_type, slot] != 0
    )


@kernel
def reaches_stops(view, robot_type, order):
    """Whether robots of a type get to all stops of an order that are left, and back."""
    orders, reachable = view.orders, view.slots.reachable
    if reachable.shape[0] > 1:
        if has_load(orders, order):
            robot_type = with_load(view, robot_type)
        first = np.int64(orders.first_stop[order]) + np.int64(orders.stops_done[order])
        for stop in range(first, end_of_stops(view, order)):
            if reachable[robot_type, view.stops.cell[stop]] == 0:
                return False
    return True


@kernel
def can_do(view, i, order):
    """Whether robot i carries an order, and gets to where it lies and to its target, or its stops.

    Of orders that are dealt out, robots do their own alone.
    """
    robot_type = np.int64(view.robots.type[i])
    target = np.int64(view.orders.target[order])
    return is_assigned(view, i, order) and can_bring(view, robot_type, order, target)
