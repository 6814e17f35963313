"""Which orders a robot may take, where it picks up and drops, and where its load goes.

All decisions and predictions use the same rule of access cells (`world.access_cell`):

fixed (default)   A load is picked up from the right of its shelf where the floor allows it (the
                  table-top robots stand at (x + 1, y)), and dropped from the left: so loads travel
                  to the right.
nearest           The cell with the least rows and columns to the cell from which the robot comes;
                  of several the one that is first by the fixed rule.

After its trip a pod is dropped by a storage policy (`storage` of allocations):

fixed     where it stood at the start; if another pod was put there, as nearest
nearest   the free cell of least ticks with a load from where the robot is; ties: the lowest slot
class     the nearest free cell of the pod's class; then of the classes after it, then before it
random    any free cell

Except with `fixed`, cells in which a robot still stands come last.
"""

import numpy as np

from automaton.engine.decisions import CMD_DROP_AT, CMD_TAKE_ORDER
from automaton.engine.distance_tables import UNREACHABLE
from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import Struct, field
from automaton.engine.motion import has_room
from automaton.engine.operations import (
    end_of_stops,
    first_cell,
    has_load,
    is_assigned,
    next_stop_cell,
    with_load,
)
from automaton.engine.random_numbers import STREAM_STORAGE, random_between
from automaton.engine.search import begin_search, mark_goal, nearest_mark, shortest_distance
from automaton.engine.state import (
    ACTION_MOVE,
    NIL,
    ORDER_WAITING,
    REASON_PICKED,
    REASON_SERVED,
)
from automaton.engine.table_rows import cost_in, has_room_for, known_row
from automaton.engine.trips import has_place

PICK_DIRECTIONS = (0, 2, 1, 3)  # neighbours E, W, S, N of the slot; for drops, the opposite ones


@kernel
def position(view, i):
    """The cell from which a robot drives on: in a long move the cell that it enters; in its
    parking bay its home."""
    return first_cell(view.robots, i)


@kernel
def access_cell(view, robot_type, slot, turned, origin):
    """The cell from which robots of a type serve a slot, or NIL.

    turned: 0 to pick up, 2 to drop; origin: the cell from which the robot comes, NIL if unknown.
    """
    one = view.slots.reachable.shape[0] == 1  # then access holds only reachable cells
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
    """The cell from which robots of a type that come from `origin` pick up a load, or NIL."""
    return access_cell(view, robot_type, slot, 0, origin)


@kernel
def cell_beside(view, slot, direction):
    """The neighbour of a slot in a direction if some robots serve the slot from it, or NIL."""
    return np.int64(view.slots.access[slot, direction])


@kernel
def begin_cell(view, robot_type, order, origin):
    """The cell where robots of a type that come from `origin` begin an order that waits, or NIL.

    There they pick up its load; for an order without a load it is the next stop.
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
    """Whether robots of a type can carry an order, and reach its load, its stops and a slot."""
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
        return True  # orders exist only for slots that some robot serves
    return (
        accessible[robot_type, view.orders.current_slot[order]] != 0
        and accessible[robot_type, slot] != 0
    )


@kernel
def reaches_stops(view, robot_type, order):
    """Whether robots of a type can reach all remaining stops of an order, and return."""
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
    """Whether robot i can carry an order, and reach its load and its target, or its stops.

    If orders are assigned in advance, robots do only their own.
    """
    robot_type = np.int64(view.robots.type[i])
    target = np.int64(view.orders.target[order])
    return is_assigned(view, i, order) and can_bring(view, robot_type, order, target)


# Which orders a robot may take, and how it takes one.


LEAST_PRIORITY = -(1 << 15)  # below the priority of any order


@kernel
def is_open(view, out, i, order):
    """Whether an order is open to robot i, and no earlier decision of this batch took it.

    It is unreserved, or a trip reserved for the robot beneath its pod; and its station has a free
    place.
    """
    if view.orders.state[order] != ORDER_WAITING or out.order_taken[order]:
        return False
    owner = view.orders.reserved_by[order]
    if view.trips.pod.shape[0] == 0:
        return owner == NIL
    is_offered = view.trips.offered[view.robots.identity[i]] == order
    return (owner == NIL or is_offered) and has_place(view, order)


@kernel
def highest_priority(view, out, i):
    """The highest priority of the open orders that robot i can do."""
    highest = LEAST_PRIORITY
    if view.rules.priorities.shape[0] == 1:
        return highest
    for order in range(view.clock.first_open, view.clock.known_orders):
        priority = np.int64(view.orders.priority[order])
        if priority > highest and is_open(view, out, i, order) and can_do(view, i, order):
            highest = priority
    return highest


@kernel
def take_order(view, out, k, i, order):
    """Decision k of the batch: robot i takes an order and drives to its first cell."""
    out.command[k] = CMD_TAKE_ORDER
    out.order[k] = order
    out.goal_cell[k] = begin_cell(view, view.robots.type[i], order, position(view, i))
    out.order_taken[order] = 1


# Destinations of loads.


STORAGE_POLICIES = ("fixed", "nearest", "class", "random")
FIXED, NEAREST, CLASS, RANDOM = range(4)
ANY_CLASS = -1
SLOT_BITS = 32  # bits of the slot in a rank, below the ticks
SLOT_MASK = (1 << SLOT_BITS) - 1


class PlacingState(Struct):
    """The storage policy."""

    storage: int = field("int64", "index in STORAGE_POLICIES")


@kernel
def takes_load(view, out, slot):
    """Whether a load may be dropped at a slot: it is unbounded, or an empty shelf without a
    reservation."""
    if view.slots.unbounded[slot]:
        return True
    empty = view.slots.content[slot] == NIL and view.slots.reserved_by[slot] == NIL
    return empty and out.slot_taken[slot] == 0


@kernel
def places_load(reason):
    """Whether allocation must choose the destination of the robot's load."""
    return reason in (REASON_PICKED, REASON_SERVED)


@kernel
def set_down(view, out, k, i, slot):
    """Decision k: robot i drops its load at a slot, which must accept it."""
    out.command[k] = CMD_DROP_AT
    out.slot[k] = slot
    out.goal_cell[k] = dropoff_cell(view, view.robots.type[i], slot, position(view, i))
    if view.slots.unbounded[slot] == 0:
        out.slot_taken[slot] = 1


@kernel
def deliver(view, out, k, i):
    """Decision k: drop the load at its order's target; if that is full, ask again in the next tick."""
    slot = np.int64(view.orders.target[view.robots.load[i]])
    if takes_load(view, out, slot):
        set_down(view, out, k, i, slot)
    else:
        out.ask_again[k] = 1


@kernel
def place_load(view, out, workspace, k, i, policy):
    """Decision k: robot i takes its load to its target, or its pod into storage."""
    if view.orders.target[view.robots.load[i]] != NIL:
        deliver(view, out, k, i)
        return
    slot = storage_for(view, out, workspace, i, policy)
    if slot == NIL:
        out.ask_again[k] = 1
    else:
        set_down(view, out, k, i, slot)


@kernel
def is_free(view, out, i, slot):
    """Whether robot i may store a pod in a slot."""
    if view.pods.slot_class[slot] == NIL or not takes_load(view, out, slot):
        return False
    return dropoff_cell(view, view.robots.type[i], slot, position(view, i)) != NIL


@kernel
def is_left(view, out, i, slot):
    """Whether robot i may store a pod in a slot without a robot.

    A robot that has lifted a pod there would leave where robot i enters.
    """
    return is_free(view, out, i, slot) and has_room(
        view.traffic.occupancy, view.slots.cell[slot], 0
    )


@kernel
def storage_for(view, out, workspace, i, policy):
    """The slot for the pod of robot i, NIL if none is free; `policy`: index in STORAGE_POLICIES."""
    pod = view.trips.pod[view.robots.load[i]]
    if policy == FIXED and is_free(view, out, i, view.pods.home[pod]):
        return np.int64(view.pods.home[pod])
    slot = np.int64(NIL)
    if policy == RANDOM:
        slot = any_left(view, out, i)
    elif policy == CLASS:
        slot = nearest_of_classes(view, out, workspace, i, np.int64(view.pods.pod_class[pod]))
    if slot == NIL:
        slot = nearest_free(view, out, workspace, i, ANY_CLASS, True)
    return slot if slot != NIL else nearest_free(view, out, workspace, i, ANY_CLASS, False)


@kernel
def nearest_of_classes(view, out, workspace, i, own):
    """The nearest slot without a robot, of a class, else of later, else of earlier classes; or NIL."""
    classes = 0
    for slot in range(view.pods.slot_class.shape[0]):
        classes = max(classes, np.int64(view.pods.slot_class[slot]) + 1)
    for step in range(classes):
        chosen = own + step if own + step < classes else classes - 1 - step
        slot = nearest_free(view, out, workspace, i, chosen, True)
        if slot != NIL:
            return slot
    return np.int64(NIL)


@kernel
def may_store(view, out, i, slot, wanted, left):
    """Whether a slot has the wanted class (or any) and is free for robot i; `left`: without a robot."""
    if wanted != ANY_CLASS and view.pods.slot_class[slot] != wanted:
        return False
    return is_left(view, out, i, slot) if left else is_free(view, out, i, slot)


@kernel
def nearest_free(view, out, workspace, i, wanted, left):
    """The free slot of a class, or of any, that robot i with its load reaches first; NIL: none.

    `left`: only slots without a robot. Distance tables give the ticks. Without a table, the number
    of rows and columns is a lower bound: if one such slot might be nearer and there is room, its
    table is computed; if several might be, the floor is searched.
    """
    tables, robot_type, here = workspace.tables, np.int64(view.robots.type[i]), position(view, i)
    heading, step = np.int64(view.robots.heading[i]), view.rules.duration[robot_type, ACTION_MOVE]
    best = ranked(UNREACHABLE, 0)  # ticks and slot
    first, second = best, best  # lower bounds of slots without tables
    for slot in range(view.slots.first_spare):
        if not may_store(view, out, i, slot, wanted, left):
            continue
        goal = dropoff_cell(view, robot_type, slot, here)
        row = known_row(tables, robot_type, goal)
        if row != NIL:
            best = min(best, ranked(cost_in(tables, row, here, heading), slot))
            continue
        least = ranked(lines_between(view, here, goal) * step, slot)
        first, second = min(first, least), min(second, max(first, least))
    if first < best and has_room_for(tables, 1):
        slot = first & SLOT_MASK
        goal = dropoff_cell(view, robot_type, slot, here)
        best = min(
            best, ranked(shortest_distance(view, workspace, robot_type, here, heading, goal), slot)
        )
        first = second
    if first < best:
        return searched_free(view, out, workspace, i, wanted, left)
    return best & SLOT_MASK if best < ranked(UNREACHABLE, 0) else np.int64(NIL)


@kernel(inline=True)
def ranked(ticks, slot):
    """A number that sorts by ticks, then by slot."""
    return (min(np.int64(ticks), UNREACHABLE) << SLOT_BITS) | np.int64(slot)


@kernel(inline=True)
def lines_between(view, cell, other):
    """Rows and columns between two cells."""
    width = view.grid.width
    return abs(cell // width - other // width) + abs(cell % width - other % width)


@kernel
def searched_free(view, out, workspace, i, wanted, left):
    """As `nearest_free`, by a search of the floor that ends at the first such slot."""
    search = begin_search(workspace)
    robot_type, here = view.robots.type[i], position(view, i)
    for slot in range(view.slots.first_spare):
        if may_store(view, out, i, slot, wanted, left):
            mark_goal(workspace, search, dropoff_cell(view, robot_type, slot, here), slot)
    heading = np.int64(view.robots.heading[i])
    return np.int64(nearest_mark(view, workspace, search, robot_type, here, heading, False))


@kernel
def any_left(view, out, i):
    """A random free slot without a robot, uniformly distributed."""
    count = 0
    for slot in range(view.slots.first_spare):
        count += is_left(view, out, i, slot)
    if count == 0:
        return np.int64(NIL)
    chosen = random_between(
        0,
        count - 1,
        view.rules.seed,
        STREAM_STORAGE,
        view.clock.coarse_tick,
        np.int64(view.robots.identity[i]),
    )
    for slot in range(view.slots.first_spare):
        if is_left(view, out, i, slot):
            if chosen == 0:
                return np.int64(slot)
            chosen -= 1
    return np.int64(NIL)
