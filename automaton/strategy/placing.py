"""Where a load is dropped; of a pod after its trip: the parameter `storage` of allocations.

fixed     where it stood at the start; if another pod was put there, as nearest
nearest   the free cell of least ticks with a load from where the robot is; ties: the lowest slot
class     the nearest free cell of the pod's class; then of the classes after it, then before it
random    any free cell

But for the first, a cell in which a robot still is comes last.
"""

import numpy as np

from automaton.engine.distance_tables import UNREACHABLE
from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import Struct, field
from automaton.engine.motion import has_room
from automaton.engine.random_numbers import STREAM_STORAGE, random_between
from automaton.engine.search import begin_search, distance, mark_goal, nearest_mark
from automaton.engine.state import (
    ACTION_MOVE,
    CLOCK_COARSE_TICK,
    CMD_DROP_AT,
    NIL,
    REASON_PICKED,
    REASON_SERVED,
)
from automaton.engine.table_rows import cost_in, has_room_for, known_row
from automaton.strategy.access_cells import dropoff_cell, position

POLICIES = ("fixed", "nearest", "class", "random")
FIXED, NEAREST, CLASS, RANDOM = range(4)
ANY_CLASS = -1
SLOT_BITS = 32  # of a rank, below the ticks
SLOT_MASK = (1 << SLOT_BITS) - 1


class PlacingState(Struct):
    """The policy of storage; it remembers nothing."""

    storage: int = field("int64", "its place among POLICIES")


@kernel
def takes_load(view, out, slot):
    """Whether a load may be dropped at a slot: where any number fits, or on a shelf that is empty
    and promised to no robot."""
    if view.slots.unbounded[slot]:
        return True
    empty = view.slots.content[slot] == NIL and view.slots.reserved_by[slot] == NIL
    return empty and out.slot_taken[slot] == 0


@kernel
def places_load(reason):
    """Whether allocation is asked where the load of a robot goes."""
    return reason in (REASON_PICKED, REASON_SERVED)


@kernel
def set_down(view, out, k, i, slot):
    """Decision k: robot i drops its load at this slot, which takes it."""
    out.command[k] = CMD_DROP_AT
    out.slot[k] = slot
    out.goal_cell[k] = dropoff_cell(view, view.robots.type[i], slot, position(view, i))
    if view.slots.unbounded[slot] == 0:
        out.slot_taken[slot] = 1


@kernel
def deliver(view, out, k, i):
    """Decision k: drop the load at its order's own target; if it is full, ask again next tick."""
    slot = np.int64(view.orders.target[view.robots.load[i]])
    if takes_load(view, out, slot):
        set_down(view, out, k, i, slot)
    else:
        out.ask_again[k] = 1


@kernel
def place_load(view, out, workspace, k, i, policy):
    """Decision k: robot i brings its load to its target, or its pod into storage."""
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
    """Whether robot i may store a pod in a slot in which no robot is.

    One that has lifted a pod there comes out where another one would come in.
    """
    return is_free(view, out, i, slot) and has_room(
        view.traffic.occupancy, view.slots.cell[slot], 0
    )


@kernel
def storage_for(view, out, workspace, i, policy):
    """The slot for the pod of robot i, NIL if none is free; `policy`: its place among POLICIES."""
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
    """The nearest slot of a class, or of those after it, or before it, in which no robot is; or NIL."""
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
    """Whether a slot is of a class, or any is wanted, and free for robot i; `left`: without a robot."""
    if wanted != ANY_CLASS and view.pods.slot_class[slot] != wanted:
        return False
    return is_left(view, out, i, slot) if left else is_free(view, out, i, slot)


@kernel
def nearest_free(view, out, workspace, i, wanted, left):
    """The free slot of a class, or of any, that robot i gets to soonest with its load; NIL: none.

    `left`: of those in which no robot is. Distance tables give the ticks. One of those that are not
    there is computed, if there is room, where a slot might be nearer by the rows and columns to it;
    if there are several such slots, the floor is searched.
    """
    tables, robot_type, here = workspace.tables, np.int64(view.robots.type[i]), position(view, i)
    heading, step = np.int64(view.robots.heading[i]), view.rules.duration[robot_type, ACTION_MOVE]
    best = ranked(UNREACHABLE, 0)  # ticks and slot
    first, second = best, best  # of slots whose tables are not there, the least that they may be
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
        best = min(best, ranked(distance(view, workspace, robot_type, here, heading, goal), slot))
        first = second
    if first < best:
        return searched_free(view, out, workspace, i, wanted, left)
    return best & SLOT_MASK if best < ranked(UNREACHABLE, 0) else np.int64(NIL)


@kernel(inline=True)
def ranked(ticks, slot):
    """A number that is less for fewer ticks; then for a lower slot."""
    return (min(np.int64(ticks), UNREACHABLE) << SLOT_BITS) | np.int64(slot)


@kernel(inline=True)
def lines_between(view, cell, other):
    """Rows and columns between two cells."""
    width = view.grid.width
    return abs(cell // width - other // width) + abs(cell % width - other % width)


@kernel
def searched_free(view, out, workspace, i, wanted, left):
    """The same by a search of the floor that ends at the first one."""
    search = begin_search(workspace)
    robot_type, here = view.robots.type[i], position(view, i)
    for slot in range(view.slots.first_spare):
        if may_store(view, out, i, slot, wanted, left):
            mark_goal(workspace, search, dropoff_cell(view, robot_type, slot, here), slot)
    heading = np.int64(view.robots.heading[i])
    return np.int64(nearest_mark(view, workspace, search, robot_type, here, heading, False))


@kernel
def any_left(view, out, i):
    """A free slot in which no robot is, all alike probable."""
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
        view.clock[CLOCK_COARSE_TICK],
        np.int64(view.robots.identity[i]),
    )
    for slot in range(view.slots.first_spare):
        if is_left(view, out, i, slot):
            if chosen == 0:
                return np.int64(slot)
            chosen -= 1
    return np.int64(NIL)
