"""What is watched in every tick of an observed run: who waits for whom and why, events, heat maps.

After motion, in passes over the robots: who holds which cell; who waits, for which cell and which
robot; who kept whom from swapping; the cause, which depends on what the blocker does; cycles of
robots that wait for each other. Nothing here writes to the world.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.motion import (
    LIVE,
    MOVED,
    NO_TURN,
    REFUSED,
    U,
    direction_between,
    resource_of,
)
from automaton.kernels.zones import robots_around
from automaton.recording.codes import (
    ACTION_MASK,
    DID_BAY_BLOCKED,
    DID_BLOCKED,
    DID_ILLEGAL,
    DID_WAIT,
    DID_WITHDRAW,
)
from automaton.world.state import (
    GOAL_NONE,
    MOVE,
    NIL,
    TICK,
    UNDELIVERED,
    WAIT,
)
from automaton.world.waiting import (
    AT_WORK,
    BAY_HELD,
    DELIVERED_ORDERS,
    HEAD_ON,
    HOLDINGS,
    ILLEGAL_ANSWER,
    IN_THE_WAY,
    JUST_FREED,
    LANE,
    LOST_CONTEST,
    MEMORY_TICKS,
    NO_ORDER,
    NO_PLACE,
    NO_ROUTE,
    NOT_WAITING,
    PASSING,
    QUEUE,
    ROWS,
    WAIT_DRAWN,
    WAITING_ROBOTS,
    WITHDRAWAL,
    WORKING_ROBOTS,
)

CAPACITY = 5  # shift of the class of capacity in a cell's rule
UNDECIDED = 255  # waits for a cell; the cause depends on its holder


@kernel
def observe(world, watch):
    """Note what this tick was like."""
    place_holders(world, watch)
    for i in range(world.robots.cell.shape[0]):
        find_wait(world, watch, i)
    for identity in range(world.robots.cell.shape[0]):
        find_refused_swap(world, watch, np.int64(world.robots.at_index[identity]))
    waiting = 0
    working = 0
    for i in range(world.robots.cell.shape[0]):
        if watch.cause[i] == UNDECIDED:
            watch.cause[i] = cause_of_wait(world, watch, i)
        add_up(world, watch, i)
        if watch.cause[i] != NOT_WAITING and watch.cause[i] != NO_ORDER:
            waiting += 1
        elif world.robots.parked[i] == 0 and watch.cause[i] == NOT_WAITING:
            working += 1
    row = watch.count[ROWS]
    watch.curve[row, WAITING_ROBOTS] = waiting
    watch.curve[row, WORKING_ROBOTS] = working
    watch.curve[row, DELIVERED_ORDERS] = world.orders.state.shape[0] - world.clock[UNDELIVERED]
    watch.count[ROWS] = row + 1


@kernel
def hold(world, watch, cell, direction, i):
    """Robot i holds its lane of a limited cell."""
    capacity = (np.int64(world.grid.rule[U(cell)]) >> CAPACITY) & 3
    if capacity == 0:
        return
    entry = cell
    if capacity == 2 and direction >> 1:
        entry += world.grid.rule.shape[0]
    k = watch.count[HOLDINGS]
    watch.holder[U(entry)] = i
    watch.holdings[U(k)] = entry
    watch.count[HOLDINGS] = k + 1


@kernel
def place_holders(world, watch):
    """Enter who holds each resource after the motion of this tick."""
    robots = world.robots
    for k in range(watch.count[HOLDINGS]):
        watch.holder[U(watch.holdings[U(k)])] = NIL
    watch.count[HOLDINGS] = 0
    for i in range(robots.cell.shape[0]):
        cell = np.int64(robots.cell[U(i)])
        if cell == NIL:
            continue
        travel = np.int64(robots.travel[U(i)])
        hold(world, watch, cell, travel, i)
        claim = np.int64(robots.claim[U(i)])
        if claim == cell:
            hold(world, watch, cell, travel ^ 2, i)
        elif claim != NIL:
            hold(world, watch, claim, direction_between(world.grid, cell, claim), i)


@kernel
def holder_of(world, watch, cell, direction):
    """Storage index of the robot in the way of one that travels in `direction` into `cell`, or NIL."""
    word = np.int64(world.traffic.occupancy[U(cell)])
    entry = resource_of(word, cell, direction, world.grid.rule.shape[0])
    return np.int64(watch.holder[U(entry)])


@kernel
def wait_for(world, watch, i, cell, direction, cause):
    """Robot i waits for a cell; UNDECIDED becomes a cause when all robots are looked at."""
    holder = holder_of(world, watch, cell, direction)
    watch.wanted[i] = cell
    watch.blocker[i] = NIL if holder == NIL else world.robots.identity[holder]
    watch.cause[i] = cause


@kernel
def find_wait(world, watch, i):
    """Whether robot i did not get on in this tick, and the cell that it waits for."""
    robots = world.robots
    watch.cause[i] = NOT_WAITING
    watch.blocker[i] = NIL
    watch.wanted[i] = NIL
    if robots.claim[i] == NIL:
        watch.slow_zone[i] = NIL
    want = np.int64(world.traffic.want[i])
    did = np.int64(robots.did[i]) & ACTION_MASK
    if want & MOVED:
        note_slow_zone(world, watch, i, want)
        return
    if did == DID_WITHDRAW:
        watch.cause[i] = WITHDRAWAL
    elif did == DID_ILLEGAL:
        watch.cause[i] = ILLEGAL_ANSWER
    elif did == DID_BAY_BLOCKED:
        home = np.int64(robots.home[i])
        wait_for(world, watch, i, home, np.int64(robots.heading[i]), BAY_HELD)
        if watch.blocker[i] == NIL:
            watch.cause[i] = JUST_FREED
    elif want == NO_TURN:
        wait_to_turn(world, watch, i)
    elif want & LIVE and want & REFUSED:
        direction = want & 3
        cell = np.int64(robots.cell[i]) + world.grid.offset[direction]
        wait_for(world, watch, i, cell, direction, UNDECIDED)
    elif did == DID_WAIT or did == DID_BLOCKED:
        find_next_cell(world, watch, i)
    elif watch.busy_before[i] > 0:
        if robots.action[i] == WAIT:
            find_next_cell(world, watch, i)
    elif did == 0 and robots.parked[i] == 0:
        find_idleness(world, watch, i)


@kernel
def note_slow_zone(world, watch, i, want):
    """Robot i has begun a move, which is a long one if its zone slows it: it is still in its cell."""
    if world.rules.slowdown and world.robots.claim[i] != NIL:
        around = robots_around(world, i, want)
        if around > 1:
            watch.slow_zone[i] = world.grid.zone[world.robots.cell[i], (want & 3) >> 1]
            watch.crowd[i] = around


@kernel
def find_next_cell(world, watch, i):
    """Robot i waits before the next cell of its route, or before the turn towards it."""
    robots, grid = world.robots, world.grid
    cell = np.int64(robots.cell[i])
    if robots.at[i] >= robots.length[i]:
        watch.cause[i] = WAIT_DRAWN
        watch.wanted[i] = robots.stand[i]
        return
    direction = np.int64(robots.route[i, robots.at[i]])
    if direction & (grid.headings - 1) != robots.heading[i]:
        wait_to_turn(world, watch, i)
        return
    wait_for(world, watch, i, cell + grid.offset[direction], direction, UNDECIDED)


@kernel
def wait_to_turn(world, watch, i):
    """Robot i is about to turn: only in a passing aisle can another one keep it."""
    cell = np.int64(world.robots.cell[i])
    watch.wanted[i] = cell
    watch.cause[i] = WAIT_DRAWN
    if (np.int64(world.grid.rule[U(cell)]) >> CAPACITY) & 3 == 2:
        wait_for(world, watch, i, cell, np.int64(world.robots.travel[i]) ^ 2, LANE)
        if watch.blocker[i] == NIL:
            watch.cause[i] = WAIT_DRAWN


@kernel
def find_refused_swap(world, watch, i):
    """Robot i was refused a cell held by one that wanted to come out to it: that one waits for i too.

    Its way was free but for this rule, where it would have entered a cell for several robots.
    """
    robots = world.robots
    if watch.blocker[i] == NIL or np.int64(world.traffic.want[i]) & REFUSED == 0:
        return
    q = np.int64(robots.at_index[watch.blocker[i]])
    if np.int64(world.traffic.want[q]) & REFUSED == 0 or watch.blocker[q] != NIL:
        return
    if watch.wanted[q] == robots.cell[i] and watch.wanted[i] == robots.cell[q]:
        watch.blocker[q] = robots.identity[i]


@kernel
def find_idleness(world, watch, i):
    """Robot i is on the floor, free, and did nothing: what is missing?"""
    robots = world.robots
    if robots.goal[i] == GOAL_NONE:
        watch.cause[i] = NO_ORDER if robots.load[i] == NIL else NO_PLACE
    elif robots.at[i] >= robots.length[i] and robots.stand[i] != robots.cell[i]:
        watch.cause[i] = NO_ROUTE
        watch.wanted[i] = robots.stand[i]


@kernel
def cause_of_wait(world, watch, i):
    """Why robot i waits for its wanted cell: what its holder does."""
    robots = world.robots
    if watch.blocker[i] == NIL:
        refused = np.int64(world.traffic.want[i]) & REFUSED
        return JUST_FREED if refused else WAIT_DRAWN
    q = np.int64(robots.at_index[watch.blocker[i]])
    wanted = watch.wanted[i]
    moved = np.int64(world.traffic.want[q]) & MOVED
    entered = robots.cell[q] if robots.claim[q] == NIL else robots.claim[q]
    if moved and entered == wanted and np.int64(world.traffic.want[i]) & REFUSED:
        return LOST_CONTEST
    if watch.wanted[q] == robots.cell[i] and watch.cause[q] != BAY_HELD:
        return HEAD_ON
    if watch.cause[q] == NO_ORDER or (robots.parked[q] and robots.goal[q] == GOAL_NONE):
        return IN_THE_WAY
    if watch.cause[q] != NOT_WAITING:
        return QUEUE
    return PASSING if moved or robots.action[q] == MOVE else AT_WORK


@kernel
def add_up(world, watch, i):
    """Enter robot i into the heat maps and the lost time."""
    robots, tick = world.robots, world.clock[TICK]
    cause = np.int64(watch.cause[i])
    cell = np.int64(robots.cell[i])
    want = np.int64(world.traffic.want[i])
    if cause == NOT_WAITING:
        watch.since[i] = tick
    else:
        if (cause == NO_ORDER) != (watch.cause_before[i] == NO_ORDER):
            watch.since[i] = tick - 1
        watch.lost[i, cause] += 1
        if cell != NIL and cause != NO_ORDER:
            watch.waits[cell] += 1
            congest(watch, cell, tick)
    if want & MOVED:
        direction = want & 3
        entered = np.int64(robots.claim[i])
        if entered == NIL:  # it has arrived; one that moved home may be in its bay already
            entered = cell if cell != NIL else np.int64(robots.home[i])
        watch.visits[entered] += 1
        watch.flow[entered - world.grid.offset[direction], direction] += 1


@kernel
def congest(watch, cell, tick):
    """Count a tick lost in a cell; what was counted before halves every MEMORY_TICKS."""
    halvings = min((tick - np.int64(watch.recent_at[cell])) // MEMORY_TICKS, 31)
    kept = np.int64(watch.recent[cell]) >> halvings
    if halvings > 0:
        watch.recent_at[cell] = tick
    watch.recent[cell] = kept + 1
