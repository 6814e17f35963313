"""The state of PIBT: robots, the occupants of cells, and the robots in dead ends."""

import numpy as np

from automaton.floor.reachability import dead_ends_of_types
from automaton.strategy.api import (
    CONSTANT,
    GOAL_NONE,
    GOAL_PARK,
    NIL,
    NO_WAY_THROUGH,
    SCRATCH,
    STATIC,
    Array,
    DistanceTables,
    Struct,
    field,
    headings_of,
    kernel,
    lane_of,
    with_load,
)
from strategies.right_of_way.steering import Deadlocks, ServiceAreas

# Modes of a robot in a tick (state.mode).
MODE_FIXED = 0  # it stays, whatever is decided here
MODE_LEAVING = 1  # it is moving to `next`, and its cell will be free
MODE_UNDECIDED = 2
MODE_DECIDED = 3

STAY_OPTION = 4  # an option besides the four directions
NO_OPTION = 7  # after the last one
OPTION_BITS = 3
U = np.uint64  # unsigned as an index: avoids the test for negative values
LONG_WAIT = 100_000  # ticks: the wait for a robot that stands for an unlimited time
DEEPEST = 2**31 - 1
ROOM_TO_PASS = (
    8  # least number of places outside dead ends that stay empty when all robots come out
)


class PibtState(Struct):
    """n robots by storage, m = n + 1, c cells, r resources (a cell, or a lane of a cell for two).

    g = c where lattice weights guide robots, else 0.
    """

    dead_ends: int = field("int64", "number of dead ends", role=STATIC)
    holds_back: int = field(
        "int64",
        "1: a robot that waits for one that makes way is held back, and keeps its choice",
        role=STATIC,
    )
    rings: int = field("int64", "1: robots that push each other in a ring all move", role=STATIC)
    lanes: int = field("int64", "1: some cells are for two robots", role=STATIC)
    guided: int = field(
        "int64", "1: costs are from `tables`, 0: by streets, else ticks", role=STATIC
    )
    fixed_ties: int = field("int64", "1: ties by FIXED_TIES, 0: by hash", role=STATIC)
    tables: DistanceTables
    against: Array = field(
        "(g, 4) uint8",
        "1 = a move to E, S, W, N out of the cell is against its street",
        role=CONSTANT,
    )
    next: Array = field("(n,) int32", "the cell to which it turns or moves, or its own")
    turning: Array = field(
        "(n,) uint8", "1 + the direction to which it turns or for which it waits, or 0"
    )
    begun: Array = field("(n,) uint8", "the same; 0 if plans are not visible", role=SCRATCH)
    aim_cell: Array = field("(n,) int32", "its goal cell at the last check", default=NIL)
    aim_type: Array = field("(n,) uint8", "its work there")
    since: Array = field("(n,) int64", "with limited sight: the tick of its last finished visit")
    detour_until: Array = field("(n,) int64", "the end of its detour around another robot")
    detour_cost: Array = field(
        "(n,) int32", "the cost of the way to its goal at the start of the detour"
    )
    detour_goal: Array = field(
        "(n,) int32", "its goal cell at the start of the detour", default=NIL
    )
    detour_cell: Array = field("(n,) int32", "its cell on the detour", default=NIL)
    detour_from: Array = field("(n,) int32", "its previous cell", default=NIL)
    queue: Array = field("(q,) int32", "identities, by the time of their last finished visit")
    dead_end: Array = field("(c,) int32", "the dead end of a cell", role=CONSTANT)
    way_out: Array = field("(c,) uint8", "the direction out of the dead end", role=CONSTANT)
    depth: Array = field("(c,) int32", "number of moves out of the dead end", role=CONSTANT)
    tenants: Array = field("(e,) int32", "robots in a dead end, or entering it", role=SCRATCH)
    drivers: Array = field("(e,) int32", "those of them that are not parked", role=SCRATCH)
    callers: Array = field("(e,) int32", "robots outside with work in it", role=SCRATCH)
    parked_from: Array = field(
        "(e,) int32", "the least depth of a robot parked in it", role=SCRATCH
    )
    parks_at: Array = field(
        "(e,) int32",
        "the greatest depth at which a robot from outside will park, or 0",
        role=SCRATCH,
    )
    service_areas: ServiceAreas
    stall: Array = field("(s,) int64", "the current round of a stall, or 0")
    calls: int = field("() int64", "number of decisions", role=SCRATCH)
    in_sight: Array = field(
        "(n,) int64", "with limited sight: keys of robots that choose, lowest first", role=SCRATCH
    )
    reserved: Array = field(
        "(r,) int64", "call << 32 | the robot in it after this move", role=SCRATCH
    )
    mode: Array = field("(n,) uint8", "MODE_FIXED to MODE_DECIDED", role=SCRATCH)
    options: Array = field(
        "(n,) uint32", "directions and STAY_OPTION, best first, in OPTION_BITS each", role=SCRATCH
    )
    waits: Array = field(
        "(w,) int64", "extra cost of a step to E, S, W, N of one robot", role=SCRATCH
    )
    option_next: Array = field("(n,) uint8", "the place of the next option to try", role=SCRATCH)
    departs: Array = field("(n,) uint8", "whether it begins its move (departures)", role=SCRATCH)
    asks: Array = field(
        "(n,) uint8", "1 + the direction of the gate that it requests, or 0", role=SCRATCH
    )
    priced_cell: Array = field("(n,) int32", "the cell to which its `costs` apply", role=SCRATCH)
    priced_goal: Array = field("(n,) int32", "the goal cell of these, or NIL", role=SCRATCH)
    costs: Array = field(
        "(n, 4) int32", "cost of the way to its goal after a step to E, S, W, N", role=SCRATCH
    )
    unpriced: Array = field("(m,) int32", "robots whose costs change", role=SCRATCH)
    table: Array = field("(n,) int32", "the distance table to its goal, or NIL", role=SCRATCH)
    aisle: Array = field("(o,) int32", "the narrow aisle of a cell, or NIL", role=CONSTANT)
    aisle_depth: Array = field("(o,) int32", "moves out of it by the nearer end", role=CONSTANT)
    aisle_way_out: Array = field("(o,) uint8", "the direction out of it", role=CONSTANT)
    innermost: Array = field(
        "(o,) int32", "by aisle: depth of the innermost target without its robot", role=SCRATCH
    )
    outermost: Array = field(
        "(o,) int32", "by aisle: depth of the outermost target with its robot", role=SCRATCH
    )
    moves_back: Array = field(
        "(o,) int32", "moves from a cell to a target (ways_back)", role=SCRATCH
    )
    next_cells: Array = field("(o,) int32", "cells to search next", role=SCRATCH)
    later_cells: Array = field("(o,) int32", "those with a robot on its target", role=SCRATCH)
    holds_fixed: Array = field(
        "(c,) uint8", "1 = a robot that does not choose is there", role=SCRATCH
    )
    rank: Array = field("(q,) uint8", "rank by place in the queue, lowest first", role=SCRATCH)
    stack: Array = field("(n,) int32", "a chain of robots that push each other", role=SCRATCH)
    deadlocks: Deadlocks
    finished: Array = field("(q,) int32", "robots that have finished a visit since", role=SCRATCH)


# The robot in a cell, or in a lane of a cell for two, and the robot that has reserved it.


@kernel
def resource_in(view, cell, direction):
    """The resource of a cell for a robot that travels in a direction; NIL without limit."""
    lane = lane_of(np.int64(view.grid.cell_flags[U(cell)]), direction)
    return NIL if lane == NIL else cell + lane * view.grid.cell_flags.shape[0]


@kernel
def holder_of(view, cell, direction):
    """The robot that holds this resource now, or NIL."""
    lane = lane_of(np.int64(view.grid.cell_flags[U(cell)]), direction)
    if lane == NIL:
        return np.int64(NIL)
    identity = np.int64(view.traffic.holder[U(cell), U(lane)])
    return np.int64(NIL) if identity == NIL else np.int64(view.robots.at_index[U(identity)])


@kernel
def own_resource(view, i):
    return resource_in(view, np.int64(view.robots.cell[U(i)]), np.int64(view.robots.travel[U(i)]))


@kernel
def reserve(state, resource, i):
    if resource != NIL:
        state.reserved[U(resource)] = (state.calls << 32) | i


@kernel
def reserver_of(state, resource):
    """The robot that has reserved a resource in this call, or NIL."""
    if resource == NIL:
        return np.int64(NIL)
    word = state.reserved[U(resource)]
    return word & 0xFFFFFFFF if word >> 32 == state.calls else np.int64(NIL)


@kernel
def is_for_two(view, cell):
    return (np.int64(view.grid.cell_flags[U(cell)]) >> 5) & 3 == 2


@kernel
def is_lane_free(view, state, i):
    """Whether robot i can turn in its cell; in a cell for two a turn needs both lanes."""
    cell, travel = np.int64(view.robots.cell[U(i)]), np.int64(view.robots.travel[U(i)])
    if not is_for_two(view, cell):
        return True
    if holder_of(view, cell, travel ^ 2) not in (NIL, i):
        return False
    comer = reserver_of(state, resource_in(view, cell, travel ^ 2))
    return comer == NIL or comer == i


@kernel
def is_across(view, state, i, cell, heading):
    """Whether robot i would stand across a cell for two: no way leads on in its heading.

    Then it needs both lanes until it has turned, or has driven into the storage or dead end ahead.
    """
    grid, robot_type = view.grid, with_load(view, np.int64(view.robots.type[U(i)]))
    if not is_for_two(view, cell) or headings_of(grid, robot_type) == 1:
        return False
    if (np.int64(grid.type_cell_flags[U(robot_type), U(cell)]) >> heading) & 1 == 0:
        return True
    ahead = cell + grid.offset[U(heading)]
    if np.int64(grid.type_cell_flags[U(robot_type), U(ahead)]) & NO_WAY_THROUGH != 0:
        return True
    here, there = state.dead_end[U(cell)], state.dead_end[U(ahead)]
    return there != NIL and there != here


@kernel
def holds_both_lanes(view, state, i):
    """Whether robot i stands across a cell for two, or faces against the lane in which it stands."""
    cell, heading = np.int64(view.robots.cell[U(i)]), np.int64(view.robots.heading[U(i)])
    if not is_for_two(view, cell):
        return False
    is_in_other_lane = (heading ^ np.int64(view.robots.travel[U(i)])) & 2 != 0
    if is_in_other_lane and headings_of(view.grid, view.robots.type[U(i)]) == 4:
        return True
    return is_across(view, state, i, cell, heading)


@kernel
def reserve_ahead(view, state, i, cell, direction):
    """Reserve the lane of robot i in the cell that it enters, or both if it stands across there."""
    reserve(state, resource_in(view, cell, direction), i)
    if state.lanes and is_across(view, state, i, cell, direction):
        reserve(state, resource_in(view, cell, direction ^ 2), i)


@kernel
def reserve_other_lane(view, state, i):
    """Reserve both lanes of a cell for two while robot i turns there."""
    cell, travel = np.int64(view.robots.cell[U(i)]), np.int64(view.robots.travel[U(i)])
    if is_for_two(view, cell):
        reserve(state, resource_in(view, cell, travel ^ 2), i)


# Dead ends: which robots may enter, and which must leave.
#
# A dead end admits one robot with work at a time, if it is empty; robots parked in it leave for that.
# Robots whose homes share a dead end park from its inner end: the robot with the innermost home goes
# first, and robots parked nearer to the entrance leave for it.


def dead_ends_that_hold(grid, robots):
    """Return the dead ends, or none if there are too few places outside them for this number of robots.

    Otherwise a robot could come out only into cells that the entering robot needs.
    """
    exits, capacity = exits_to_pass_by(grid), grid.cell_flags >> 5 & 3
    ends = dead_ends_of_types(exits, capacity == 1, grid.offset)
    outside = (exits != 0).any(axis=0) & (ends.number == NIL)
    places = int(capacity[outside].sum())
    if robots <= places - ROOM_TO_PASS or (capacity[outside] == 0).any():
        return ends
    return ends._replace(number=np.full_like(ends.number, NIL), total=0)


def exits_to_pass_by(grid):
    """(k, C) uint8: the exits of each type, without those from storage into storage."""
    flags = grid.type_cell_flags.copy()
    storage = (flags & NO_WAY_THROUGH != 0).any(axis=0)
    for direction, offset in enumerate(grid.offset.tolist()):
        inside = storage & np.roll(storage, -offset)
        flags[:, inside] &= np.uint8(255 ^ (1 << direction))
    return flags & np.uint8(15)


@kernel
def empty_dead_ends(state):
    for e in range(state.tenants.shape[0]):
        state.tenants[e] = 0
        state.drivers[e] = 0
        state.callers[e] = 0
        state.parked_from[e] = DEEPEST
        state.parks_at[e] = 0


@kernel
def count_in_dead_ends(view, state, i):
    """Count robot i for the dead end that it is in, enters, or wants to enter."""
    robots = view.robots
    cell, goal = np.int64(robots.cell[i]), np.int64(robots.goal_cell[i])
    here = np.int64(state.dead_end[cell])
    if here != NIL:
        state.tenants[here] += 1
        if robots.parked[i]:
            state.parked_from[here] = min(state.parked_from[here], state.depth[cell])
        else:
            state.drivers[here] += 1
    there = np.int64(state.dead_end[state.next[i]]) if state.mode[i] == MODE_LEAVING else here
    if there != NIL and there != here:
        state.tenants[there] += 1
        state.drivers[there] += 1
    if robots.goal_type[i] == GOAL_NONE:
        return
    wanted = np.int64(state.dead_end[goal])
    if wanted == NIL or wanted == here:
        return
    if robots.goal_type[i] == GOAL_PARK:
        state.parks_at[wanted] = max(state.parks_at[wanted], state.depth[goal])
    else:
        state.callers[wanted] += 1


@kernel
def has_to_leave(view, state, i):
    """Whether idle robot i is in a dead end that others want to enter, or beyond its own place there."""
    robots = view.robots
    goal_type, cell = robots.goal_type[U(i)], np.int64(robots.cell[U(i)])
    if state.dead_ends == 0 or cell == NIL or (goal_type != GOAL_NONE and goal_type != GOAL_PARK):
        return False
    here = np.int64(state.dead_end[cell])
    place = cell if goal_type == GOAL_NONE else np.int64(robots.goal_cell[U(i)])
    if here == NIL or state.dead_end[place] != here:
        return False
    return state.callers[here] > 0 or state.parks_at[here] > state.depth[place]


@kernel
def may_enter(view, state, i, cell):
    """Whether the rules of dead ends let robot i enter a cell: with a goal inside, and in its turn."""
    if waits_for_aisle(view, state, i) and state.aisle[cell] == state.aisle[view.robots.home[i]]:
        return False
    if state.dead_ends == 0:
        return True
    dead_end = np.int64(state.dead_end[cell])
    if dead_end == NIL or state.dead_end[view.robots.cell[i]] == dead_end:
        return True
    goal = np.int64(view.robots.goal_cell[i])
    if goal == NIL or state.dead_end[goal] != dead_end:
        return False
    if view.robots.goal_type[i] != GOAL_PARK:
        return state.tenants[dead_end] == 0
    depth = state.depth[goal]
    if state.callers[dead_end] or state.drivers[dead_end] or depth < state.parks_at[dead_end]:
        return False
    return state.parked_from[dead_end] >= depth


# Narrow aisles, in one-shot problems: the robot with the innermost target goes first.


def aisles_of(grid, dead_end):
    """Return (c,) the aisle of a cell, its depth, and the direction out of it by the nearer end.

    An aisle consists of cells for one robot with two exits each, outside dead ends.
    """
    flags, offsets = grid.cell_flags, grid.offset.tolist()
    is_open = (flags & 15 != 0) & (dead_end == NIL)
    leads = [(flags >> d & 1 != 0) & is_open & np.roll(is_open, -o) for d, o in enumerate(offsets)]
    narrow = is_open & (np.sum(leads, axis=0) == 2) & (flags >> 5 & 3 == 1)
    number = np.where(narrow, np.arange(len(flags)), len(flags))
    before = np.zeros_like(number)
    while (number != before).any():
        before = number.copy()
        for leading, offset in zip(leads, offsets, strict=True):
            number = np.minimum(
                number, np.where(leading & narrow, np.roll(number, -offset), number)
            )
            number[~narrow] = len(flags)
    depth, way_out = np.where(narrow, NIL, 0), np.zeros(len(flags), np.uint8)
    for moves in range(1, len(flags)):
        inner = depth == moves - 1
        reached = np.zeros(len(flags), bool)
        for direction, (leading, offset) in enumerate(zip(leads, offsets, strict=True)):
            reached |= (now := leading & (depth == NIL) & np.roll(inner, -offset))
            way_out[now] = direction
        if not reached.any():
            break
        depth[reached] = moves
    number = np.where(narrow & (depth > 0), number, NIL)
    return number.astype(np.int32), depth.astype(np.int32), way_out


@kernel
def look_into_aisles(view, state):
    """Note the innermost target without its robot, and the outermost with it, of each aisle."""
    robots = view.robots
    if state.aisle.shape[0] == 0:
        return
    state.innermost[:] = 0
    state.outermost[:] = DEEPEST
    for i in range(robots.cell.shape[0]):
        home = np.int64(robots.home[U(i)])
        aisle = np.int64(state.aisle[U(home)])
        if aisle == NIL:
            continue
        depth = state.aisle_depth[U(home)]
        if robots.goal_type[U(i)] == GOAL_PARK:
            state.innermost[U(aisle)] = max(state.innermost[U(aisle)], depth)
        elif robots.goal_type[U(i)] == GOAL_NONE:
            state.outermost[U(aisle)] = min(state.outermost[U(aisle)], depth)


@kernel
def clears_aisle(view, state, i):
    """Whether robot i, in the aisle of its target, leaves it for a robot with a target further in."""
    robots = view.robots
    goal_type, cell = robots.goal_type[U(i)], np.int64(robots.cell[U(i)])
    if state.aisle.shape[0] == 0 or cell == NIL:
        return False
    if goal_type != GOAL_NONE and goal_type != GOAL_PARK:
        return False
    home = np.int64(robots.home[U(i)])
    aisle = np.int64(state.aisle[U(home)])
    if aisle == NIL or state.aisle[U(cell)] != aisle:
        return False
    return state.innermost[U(aisle)] > state.aisle_depth[U(home)]


@kernel
def waits_for_aisle(view, state, i):
    """Whether robot i is outside the aisle of its target, and others must enter or leave it first."""
    robots = view.robots
    if state.aisle.shape[0] == 0 or robots.goal_type[U(i)] != GOAL_PARK:
        return False
    home, cell = np.int64(robots.home[U(i)]), np.int64(robots.cell[U(i)])
    aisle = np.int64(state.aisle[U(home)])
    if aisle == NIL or (cell != NIL and state.aisle[U(cell)] == aisle):
        return False
    depth = state.aisle_depth[U(home)]
    return depth < state.innermost[U(aisle)] or depth > state.outermost[U(aisle)]
