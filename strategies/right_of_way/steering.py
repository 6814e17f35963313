"""Shared by rights of way that steer robots: arrivals, guidance, making room, deadlocks."""

import numpy as np

from automaton.floor.floor_plan import CHARGER, STATION
from automaton.strategy.api import (
    ACTION_COUNT,
    ACTION_MOVE,
    ACTION_TURN,
    CONSTANT,
    FOLLOWING_CONVOY,
    GATE_BLOCK,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    NIL,
    SCRATCH,
    STATIC,
    STOP_ON_TARGETS,
    Array,
    Struct,
    energy_cost,
    field,
    has_gates,
    is_facing,
    kernel,
    no_tables,
    walk_to_cycle,
    weighted_tables,
)

AGAINST_STREET = 3  # as a multiple of the ticks of a move along a street
NO_WAY_OUT = 4  # an option besides the four directions
STALLED = 4  # as a multiple of the patience: time without any progress
LOOK = 16  # coarse ticks, since strategies may decide only in the first fine tick of each
COUNTERS = {"deadlocks_resolved": "deadlocks.resolved"}  # metric if a state has `deadlocks`


# Robots that have arrived where they work are not steered; and which robots may move on.


@kernel
def is_at_goal(view, i):
    """Whether free robot i begins its work in this tick."""
    robots = view.robots
    if robots.try_drop[i]:
        return True
    return robots.goal_type[i] != GOAL_NONE and robots.cell[i] == robots.goal_cell[i]


@kernel
def comes_to_charge(view, i, cell):
    """Return whether robot i would charge in a cell, which it may enter once the robot there has left."""
    if view.rules.battery == 0:
        return False
    return view.robots.goal_type[i] == GOAL_CHARGE and view.robots.goal_cell[i] == cell


@kernel
def lacks_charge(view, i):
    """Return whether the battery of robot i has too little charge for a move."""
    if view.rules.battery == 0:
        return False
    ticks = view.rules.duration[view.robots.type[i], ACTION_MOVE]
    return view.robots.charge[i] < energy_cost(view, i, ACTION_MOVE, ticks)


def at_once_ticks(view):
    """Return the duration of moves that end before robots decide again: all followers move at once.

    In a convoy this includes a move of one coarse tick if ticks are refined, so that refined fleets
    decide as before.
    """
    return int(view.rules.stride) if view.rules.following == FOLLOWING_CONVOY else 1


# Lattice guidance: rows and columns are one-way streets in alternating directions, so that crowds rarely
# meet head-on.
#
# Odd rows run east, even ones west; even columns run south, odd ones north. A move against its street
# is allowed, and costs as much as three moves along it. Turns cost their ticks.


def moves_against_streets(grid):
    """Return (C, 4) bool: whether a move out of a cell to E, S, W, N is against its street."""
    y, x = np.divmod(np.arange(len(grid.kind)), grid.width)
    odd_row, odd_column = (y - 1) % 2 == 1, (x - 1) % 2 == 1
    return np.stack((~odd_row, odd_column, odd_row, ~odd_column), axis=1)


def guiding_tables(view, is_guided, scale=1):
    """Return the weighted distance tables of the robots: lattice tables if they are guided, else none."""
    return lattice_tables(view, scale) if is_guided else no_tables()


def lattice_tables(view, scale=1):
    """Return distance tables with `scale` as the cost of a tick, tripled against streets.

    Set k is for robot type k.
    """
    duration = np.asarray(view.rules.duration, np.int64)
    ticks = duration[:, ACTION_MOVE, None, None]
    if len(view.grid.min_move_ticks):
        ticks = np.maximum(ticks, view.grid.min_move_ticks.reshape(-1, 4))
    weights = np.where(moves_against_streets(view.grid), AGAINST_STREET, 1)
    return weighted_tables(view, scale * ticks * weights, scale * duration[:, ACTION_TURN])


# Idle robots make room where pushing them fails: in queues of stations, in pockets, in blocks.
#
# A robot in the queue of its station pushes no robot, since only the queue moves it. A robot can leave
# a pocket (a station or charger with a single entrance) only before another robot is at the entrance.
# So idle robots leave queues and pockets as soon as another robot has work there. They leave a full
# block or lift as soon as another robot faces it. Elsewhere they are pushed.


class ServiceAreas(Struct):
    """The p service areas of a floor of c cells; p = c = 0 without any."""

    area: Array = field("(c,) int32", "the service area of a cell, or NIL", role=CONSTANT)
    way_out: Array = field(
        "(c,) uint8", "direction of the next step out of the area, or NO_WAY_OUT", role=CONSTANT
    )
    gate: Array = field(
        "(p,) int32", "the block or lift of the area, or NIL", default=NIL, role=CONSTANT
    )
    callers: Array = field(
        "(p,) int32",
        "robots with work in it, or in front of it if it is full",
        role=SCRATCH,
    )


def service_areas_of(view):
    """Return the service areas: stations with their queues, pockets, blocks and lifts.

    A cell without limit has room for robots that stay, so it belongs only to blocks and lifts. A cell
    of both a block or lift and a queue or pocket belongs to the queue or pocket.
    """
    grid, stations = view.grid, view.pod_stations
    limited = grid.cell_flags >> 5 & 3 != 0
    lane = np.flatnonzero((stations.queue_at != NIL) & limited[: len(stations.queue_at)])
    heads = np.flatnonzero(limited & np.isin(grid.kind, (STATION, CHARGER)) & is_pocket(grid))
    heads = np.union1d(heads, stations.cell[stations.queue_at[lane]])
    gates = np.flatnonzero(view.gates.kind >= GATE_BLOCK)
    if not len(heads) + len(gates):
        return ServiceAreas.sized({"p": 0, "c": 0})
    area = np.full(len(grid.kind), NIL, np.int32)
    area[heads] = np.arange(len(heads), dtype=np.int32)
    head = stations.cell[stations.queue_at[lane]]
    area[lane] = area[head]
    way_out = ways_out(grid, area)
    beyond = head + grid.offset[way_out[head] & 3]
    through = lane[(way_out[head] != NO_WAY_OUT) & (area[beyond] == NIL)]
    way_out[through] = stations.queue_way[through]  # the other cells of the queue are behind it
    for number, gate in enumerate(gates, len(heads)):
        entries = np.flatnonzero(view.gates.cell_gate == gate)
        inside = np.full(len(area), NIL, np.int32)
        inside[np.searchsorted(view.gates.cell_first, entries, side="right") - 1] = number
        added = (area == NIL) & (inside == number)
        area[added], way_out[added] = number, ways_out(grid, inside)[added]
    area[way_out == NO_WAY_OUT] = NIL
    gate = np.concatenate((np.full(len(heads), NIL), gates)).astype(np.int32)
    return ServiceAreas.sized({"p": len(gate)}, area=area, way_out=way_out, gate=gate)


def is_pocket(grid):
    """Return (c,) bool: cells whose only exit and only entrance is the same neighbour."""
    ways_out, ways_in, both = (np.zeros(len(grid.kind), int) for _ in range(3))
    for direction, offset in enumerate(grid.offset.tolist()):
        leads = grid.cell_flags >> direction & 1
        comes = np.roll(grid.cell_flags, -offset) >> (direction ^ 2) & 1
        ways_out += leads
        ways_in += comes
        both += leads & comes
    return (ways_out == 1) & (ways_in == 1) & (both == 1)


def ways_out(grid, area):
    """Return (c,) the first direction of a shortest path out of a cell's area, or NO_WAY_OUT."""
    way_out = np.full(len(area), NO_WAY_OUT, np.uint8)
    front = area == NIL
    while front.any():
        reached = np.zeros(len(area), bool)
        for direction, offset in enumerate(grid.offset.tolist()):
            leads = (grid.cell_flags >> direction & 1 != 0) & np.roll(front, -offset)
            ahead = np.roll(area, -offset)
            leaving = leads & (area != NIL) & ((ahead == NIL) | (ahead == area))
            leaving &= (way_out == NO_WAY_OUT) & ~reached
            way_out[leaving] = direction
            reached |= leaving
        front = reached
    return way_out


@kernel
def count_callers(view, areas):
    """Count the robots with work in each area."""
    if areas.callers.shape[0] == 0:
        return
    areas.callers[:] = 0
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        if robots.goal_type[i] != GOAL_NONE and robots.goal_type[i] != GOAL_PARK:
            goal = np.int64(robots.goal_cell[i])
            area = areas.area[goal] if goal != NIL else NIL
            if area != NIL and areas.gate[area] == NIL:
                areas.callers[area] += 1
        if has_gates(view) and robots.cell[i] != NIL and robots.goal_type[i] != GOAL_NONE:
            call_at_full_gate(view, areas, i)


@kernel
def call_at_full_gate(view, areas, i):
    """Count robot i for the block or lift in front of it, if that is full.

    Robots that only want to park there do not count: they and the parked robots would swap for ever.
    """
    robots, cell = view.robots, np.int64(view.robots.cell[i])
    for direction in range(4):
        leads = (np.int64(view.grid.cell_flags[cell]) >> direction) & 1
        if leads == 0 or not is_facing(view, i, direction):
            continue
        area = np.int64(areas.area[cell + view.grid.offset[direction]])
        if area == NIL or area == areas.area[cell] or areas.gate[area] == NIL:
            continue
        gate = np.int64(areas.gate[area])
        parks = robots.goal_type[i] == GOAL_PARK and areas.area[robots.goal_cell[i]] == area
        if not parks and view.gates.robots[gate] >= view.gates.max_robots[gate]:
            areas.callers[area] += 1


@kernel
def is_needed(areas, cell):
    """Return whether a cell belongs to an area in which a robot has work."""
    if areas.callers.shape[0] == 0 or cell == NIL:
        return False
    area = areas.area[cell]
    return area != NIL and areas.callers[area] > 0


@kernel
def way_to_make_room(view, areas, i, cell):
    """Return the direction in which idle robot i leaves its cell in a needed area, or NIL."""
    robots = view.robots
    is_idle = robots.goal_type[i] == GOAL_NONE or robots.goal_type[i] == GOAL_PARK
    if not is_idle or not is_needed(areas, cell):
        return np.int64(NIL)
    area = np.int64(areas.area[cell])
    is_through = areas.gate[area] != NIL and robots.goal_type[i] == GOAL_PARK
    if is_through and areas.area[robots.goal_cell[i]] != area:
        return np.int64(NIL)  # it crosses the area on its own path
    return np.int64(areas.way_out[cell])


@kernel
def may_not_go_home(view, areas, i):
    """Return whether robot i would park in a needed area; meanwhile it has no goal."""
    robots = view.robots
    return robots.goal_type[i] == GOAL_PARK and is_needed(areas, np.int64(robots.goal_cell[i]))


# Deadlocks, the last resort: wait cycles, in which each robot waits for the next one.
#
# Robots that have stood for long are checked every LOOK coarse ticks. If all robots of a wait cycle
# have stood for `patience` ticks more than the longest action of any of them, one of them steps aside:
# the robot with the newest goal, ties by identity. It chooses before all others, any cell except the
# one for which it waits, until it has left its own. If it finds no exit, the next robot of the cycle
# tries in the next decision, and so on.
#
# If robots move, but none of those with work makes progress, they alternately block each other's
# goals. This is a stall: the strategies then try other priority orders, one after another.


class Deadlocks(Struct):
    """Data about standing robots, n robots by storage."""

    patience: int = field("int64", "ticks after which a wait cycle is broken", role=STATIC)
    cell: Array = field("(n,) int32", "its cell at the last look", default=NIL)
    stood_since: Array = field("(n,) int64", "the tick of the first look that found it there")
    goal: Array = field("(n,) int32", "its goal cell at the last look", default=NIL)
    goal_since: Array = field("(n,) int64", "the tick of the first look that found this goal")
    aside: Array = field(
        "(n,) uint8", "1 + the forbidden direction of a robot that steps aside, or 0"
    )
    aside_since: Array = field("(n,) int64", "the tick of its latest request to step aside")
    tries: Array = field("(n,) int32", "the number of such requests in its cell")
    look_again: Array = field("(s,) int64", "1: look in the next tick (a single number)")
    resolved: Array = field("(n,) int64", "deadlocks that it has broken")
    aim_type: Array = field("(n,) uint8", "its work in the last decision")
    aim_cell: Array = field("(n,) int32", "and the place of that work", default=NIL)
    progress: Array = field("(s,) int64", "the coarse tick of the last progress")
    first_choice: Array = field(
        "(n,) uint8", "1 + the direction of the cell for which it waits", role=SCRATCH
    )
    blocker: Array = field(
        "(n,) int32", "identity of the robot for which it waits, or NIL", default=NIL, role=SCRATCH
    )
    color: Array = field("(n,) int32", "mark of the search for cycles", role=SCRATCH)


@kernel
def is_time_to_look(view, deadlocks):
    """Return whether this tick searches for wait cycles; if so, note how long robots have stood."""
    robots, tick = view.robots, view.clock.tick
    if view.clock.coarse_tick % LOOK and deadlocks.look_again[0] == 0:
        return False
    deadlocks.look_again[0] = 0
    for i in range(robots.cell.shape[0]):
        deadlocks.blocker[i] = NIL
        deadlocks.color[i] = 0
        if robots.cell[i] != deadlocks.cell[i]:
            steps_aside(view, deadlocks, i)
            deadlocks.cell[i] = robots.cell[i]
            deadlocks.stood_since[i] = tick
            deadlocks.tries[i] = 0
            deadlocks.aside_since[i] = 0
        if robots.goal_cell[i] != deadlocks.goal[i]:
            deadlocks.goal[i] = robots.goal_cell[i]
            deadlocks.goal_since[i] = tick
    return True


@kernel
def has_stood_long(view, deadlocks, i):
    """Return whether robot i has stood long enough to be part of a deadlock."""
    age = view.clock.tick - deadlocks.stood_since[i]
    return view.robots.cell[i] != NIL and age >= deadlocks.patience


@kernel
def break_deadlocks(view, deadlocks):
    """Let one robot of each overdue wait cycle step aside; `blocker` must be filled in."""
    at_index = view.robots.at_index
    for identity in range(view.robots.cell.shape[0]):
        i = np.int64(at_index[identity])
        if deadlocks.blocker[i] == NIL or deadlocks.color[i]:
            continue
        member = walk_to_cycle(deadlocks.blocker, at_index, deadlocks.color, i)
        if member != NIL and has_lasted(view, deadlocks, member):
            let_step_aside(view, deadlocks, robot_to_step_aside(view, deadlocks, member))


@kernel
def has_lasted(view, deadlocks, first):
    """Return whether all robots of the wait cycle have stood longer than patience + longest action."""
    robots, i, longest, since = view.robots, first, np.int64(0), np.int64(0)
    while True:
        for action in range(ACTION_COUNT):
            longest = max(longest, np.int64(view.rules.duration[robots.type[i], action]))
        since = max(since, deadlocks.stood_since[i])
        i = np.int64(robots.at_index[deadlocks.blocker[i]])
        if i == first:
            return view.clock.tick - since >= deadlocks.patience + longest


@kernel
def robot_to_step_aside(view, deadlocks, first):
    """Return the robot of the wait cycle with the oldest or no attempt, ties by the newest goal."""
    robots, best, i = view.robots, first, first
    while True:
        if deadlocks.aside_since[i] != deadlocks.aside_since[best]:
            is_better = deadlocks.aside_since[i] < deadlocks.aside_since[best]
        elif deadlocks.goal_since[i] != deadlocks.goal_since[best]:
            is_better = deadlocks.goal_since[i] > deadlocks.goal_since[best]
        else:
            is_better = robots.identity[i] < robots.identity[best]
        best = i if is_better else best
        i = np.int64(robots.at_index[deadlocks.blocker[i]])
        if i == first:
            return best


@kernel
def let_step_aside(view, deadlocks, i):
    """Let robot i choose another cell and be checked in the next tick; pause once all have tried."""
    if deadlocks.tries[i] == 0 or view.clock.coarse_tick % LOOK == 0:
        deadlocks.tries[i] += 1
        deadlocks.aside[i] = deadlocks.first_choice[i]
        deadlocks.aside_since[i] = view.clock.tick
        deadlocks.look_again[0] = 1


@kernel
def is_given_up(view, deadlocks, i):
    """Return whether robot i has tried to step aside for so long that another robot must try."""
    return view.clock.tick - deadlocks.aside_since[i] > deadlocks.patience


@kernel
def steps_aside(view, deadlocks, i):
    """Return whether robot i still has to step aside; count it once it has done so."""
    if deadlocks.aside[i] and view.robots.cell[i] != deadlocks.cell[i]:
        deadlocks.resolved[i] += 1
        deadlocks.aside[i] = 0
    return deadlocks.aside[i] != 0


@kernel
def has_work(view, goal_type):
    """Return whether a goal is work; in a one-shot problem also to drive back to the target."""
    returns = goal_type == GOAL_PARK and view.rules.stop == STOP_ON_TARGETS
    return goal_type == GOAL_PICK or goal_type == GOAL_DROP or goal_type == GOAL_STOP or returns


@kernel
def note_progress(view, deadlocks):
    """Note progress: a robot works, has worked, or gets work after idleness; or all are idle."""
    robots, is_quiet = view.robots, True
    for i in range(robots.cell.shape[0]):
        before, goal_type = deadlocks.aim_type[i], robots.goal_type[i]
        is_quiet = is_quiet and not has_work(view, goal_type)
        if robots.busy[i] and has_work(view, goal_type) and robots.cell[i] == robots.goal_cell[i]:
            deadlocks.progress[0] = view.clock.coarse_tick
        if before == goal_type and deadlocks.aim_cell[i] == robots.goal_cell[i]:
            continue
        was_there = robots.cell[i] == deadlocks.aim_cell[i]
        if was_there if has_work(view, before) else has_work(view, goal_type):
            deadlocks.progress[0] = view.clock.coarse_tick
        deadlocks.aim_type[i], deadlocks.aim_cell[i] = goal_type, robots.goal_cell[i]
    if is_quiet:
        deadlocks.progress[0] = view.clock.coarse_tick


@kernel
def round_of_stall(view, deadlocks):
    """Return the number of the priority order to try in a stall, from 1; 0: no stall.

    Each is tried for twice the patience.
    """
    patience = deadlocks.patience // view.rules.refinement
    ticks = view.clock.coarse_tick - deadlocks.progress[0] - STALLED * patience
    return max(ticks // (2 * patience) + 1, np.int64(0))
