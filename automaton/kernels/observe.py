"""What is watched in every tick of an observed run: who waits for whom and why, events, heat maps.

After motion, one pass over the robots finds who got on and who waits for which cell; whoever drives
or works costs no more than this. Only when somebody waits, further passes over those who do: who
holds the cells that are waited for; who kept whom from swapping; the cause, which depends on what
the blocker does; cycles of robots that wait for each other. Nothing here writes to the world.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.blockers import find_blockers
from automaton.kernels.motion import (
    AHEAD,
    CAPACITY,
    LIVE,
    MOVED,
    NO_TURN,
    REFUSED,
    U,
    resource_of,
)
from automaton.kernels.prefetch import prefetch
from automaton.kernels.zones import robots_around
from automaton.recording.codes import (
    ACTION_MASK,
    DID_BAY_BLOCKED,
    DID_BLOCKED,
    DID_CHARGE,
    DID_DROP,
    DID_ILLEGAL,
    DID_PICK,
    DID_WAIT,
    DID_WITHDRAW,
    INTO_BAY,
    LEFT_BAY,
)
from automaton.world.condition import EMPTY, EXHAUSTED
from automaton.world.state import (
    GOAL_NONE,
    HALTED,
    IN_LINE,
    MOVE,
    NIL,
    TICK,
    UNDELIVERED,
    WAIT,
)
from automaton.world.waiting import (
    BAY_HELD,
    CHARGER_HELD,
    DELIVERED_ORDERS,
    DRIVING_SLOWLY,
    EVENTFUL,
    FAULT,
    ILLEGAL_ANSWER,
    IS_EVENTFUL,
    IS_WAITING,
    LANE,
    NO_ENERGY,
    NO_ORDER,
    NO_PLACE,
    NO_ROUTE,
    NOT_WAITING,
    REDESIGN,
    ROWS,
    UNDECIDED,
    WAIT_DRAWN,
    WAITERS,
    WAITING_ROBOTS,
    WITHDRAWAL,
    WORKING_ROBOTS,
)

MARKS = 8  # in a word
TOLD_OF = LEFT_BAY | INTO_BAY  # flags and actions that are events
TOLD_ACTIONS = (
    (1 << DID_PICK) | (1 << DID_DROP) | (1 << DID_CHARGE) | (1 << DID_ILLEGAL) | (1 << DID_WITHDRAW)
)


@kernel
def observe(world, watch):
    """Note what this tick was like."""
    waiting, working, marked = look_at_all(world, watch)
    watch.scratch.count[WAITERS] = 0
    watch.scratch.count[EVENTFUL] = 0
    if marked:
        line_up(world, watch)
    if watch.scratch.count[WAITERS]:
        find_blockers(world, watch)
    row = watch.count[ROWS]
    watch.curve[row, WAITING_ROBOTS] = waiting
    watch.curve[row, WORKING_ROBOTS] = working
    watch.curve[row, DELIVERED_ORDERS] = world.orders.state.shape[0] - world.clock[UNDELIVERED]
    watch.count[ROWS] = row + 1


@kernel
def look_at_all(world, watch):
    """One pass: moves, waits and events; returns how many wait, work, and have to be gone through."""
    robots, scratch = world.robots, watch.scratch
    want, did, cause = world.traffic.want, robots.did, watch.cause
    busy, busy_before = robots.busy, watch.busy_before
    order, order_before = robots.order, watch.order_before
    load, load_before = robots.load, watch.load_before
    waiting = 0
    working = 0
    marked = 0
    for i in range(did.shape[0]):
        if i + AHEAD < did.shape[0]:
            fetch_move(world, watch, i + AHEAD)
        w = np.int64(want[U(i)])
        if world.rules.slowdown or world.rules.extra_tick:
            note_slow_move(world, watch, i, w)
        told = np.int64(did[U(i)])
        mark = 0
        now = NOT_WAITING
        if w & MOVED:
            count_move(world, watch, i, w & 3)
        elif w or told or busy_before[U(i)] or robots.parked[U(i)] == 0:
            now = find_wait(world, watch, i, w, told & ACTION_MASK)
        if now == NOT_WAITING:
            if cause[U(i)] != NOT_WAITING:
                end_wait(watch, i)
            if robots.parked[U(i)] == 0:
                working += 1
        else:
            note_wait(world, watch, i, now)
            if now != NO_ORDER:
                waiting += 1
                mark = IS_WAITING
        busy_before[U(i)] = busy[U(i)]
        if (
            told & TOLD_OF
            or (TOLD_ACTIONS >> (told & ACTION_MASK)) & 1
            or order[U(i)] != order_before[U(i)]
            or load[U(i)] != load_before[U(i)]
            or watch.set_down[U(i)] != NIL
            or robots.status[U(i)] != watch.status_before[U(i)]
        ):
            mark |= IS_EVENTFUL
        if mark:
            scratch.marks[U(robots.identity[U(i)])] = mark
            marked += 1
    return waiting, working, marked


@kernel(inline=True)
def fetch_move(world, watch, i):
    """Ask for the words of the map of moves that a robot stored a little later needs."""
    want = np.int64(world.traffic.want[U(i)])
    cell = np.int64(world.robots.cell[U(i)])
    if want & MOVED and cell >= 0:
        prefetch(watch.flow, U(4 * (cell - world.grid.offset[U(want & 3)])))


@kernel
def count_move(world, watch, i, direction):
    """Enter a move of robot i into the map of moves."""
    robots = world.robots
    entered = np.int64(robots.claim[U(i)])
    if entered == NIL:  # it has arrived; one that moved home may be in its bay already
        entered = np.int64(robots.cell[U(i)])
        if entered == NIL:
            entered = np.int64(robots.home[U(i)])
    watch.flow[U(entered - world.grid.offset[U(direction)]), U(direction)] += 1


@kernel
def end_wait(watch, i):
    """Robot i gets on again."""
    watch.cause[U(i)] = NOT_WAITING
    watch.blocker[U(i)] = NIL
    watch.wanted[U(i)] = NIL
    watch.ring[U(i)] = 0


@kernel
def note_wait(world, watch, i, cause):
    """Robot i lost this tick; a wait for an order and a wait on the way begin anew."""
    before = np.int64(watch.cause[U(i)])
    if before == NOT_WAITING or (before == NO_ORDER) != (cause == NO_ORDER):
        watch.since[U(i)] = world.clock[TICK] - 1
    watch.cause[U(i)] = cause
    if cause == NO_ORDER:
        watch.ring[U(i)] = 0
        watch.lost[U(i), U(NO_ORDER)] += 1


@kernel
def line_up(world, watch):
    """List the robots that wait, and those with something to tell, by identity; clears the marks."""
    scratch, at_index = watch.scratch, world.robots.at_index
    waiters = 0
    eventful = 0
    for word in range(scratch.words.shape[0]):
        if scratch.words[U(word)] == 0:
            continue
        for identity in range(MARKS * word, MARKS * (word + 1)):
            mark = np.int64(scratch.marks[U(identity)])
            if mark & IS_WAITING:
                scratch.waiters[U(waiters)] = at_index[U(identity)]
                waiters += 1
            if mark & IS_EVENTFUL:
                scratch.eventful[U(eventful)] = at_index[U(identity)]
                eventful += 1
        scratch.words[U(word)] = 0
    scratch.count[WAITERS] = waiters
    scratch.count[EVENTFUL] = eventful


@kernel
def wait_for(world, watch, i, cell, direction, cause):
    """Robot i waits for a cell; UNDECIDED becomes a cause when all robots are looked at."""
    word = np.int64(world.traffic.occupancy[U(cell)])
    entry = resource_of(word, cell, direction, world.grid.rule.shape[0])
    prefetch(watch.scratch.holder, U(entry))
    watch.scratch.entry[U(i)] = entry
    watch.wanted[U(i)] = cell
    return cause


@kernel
def find_wait(world, watch, i, want, did):
    """Why robot i, which did not move, does not get on; enters the cell that it waits for."""
    robots = world.robots
    watch.blocker[U(i)] = NIL
    watch.wanted[U(i)] = NIL
    watch.scratch.entry[U(i)] = NIL
    if robots.status[U(i)] >= EXHAUSTED:
        return NO_ENERGY if robots.status[U(i)] <= EMPTY else FAULT
    if world.clock[HALTED] >= world.clock[TICK] and world.zoning.halt[U(i)] >= world.clock[TICK]:
        if robots.action[U(i)] == WAIT and robots.parked[U(i)] == 0:
            return REDESIGN
    if robots.action[U(i)] == IN_LINE and robots.ticket[U(i)] and did == DID_BLOCKED:
        direction = np.int64(robots.route[U(i), U(robots.at[U(i)])])
        return wait_for(world, watch, i, np.int64(robots.stand[U(i)]), direction, CHARGER_HELD)
    if did == DID_WITHDRAW:
        return WITHDRAWAL
    if did == DID_ILLEGAL:
        return ILLEGAL_ANSWER
    if did == DID_BAY_BLOCKED:
        home = np.int64(robots.home[U(i)])
        return wait_for(world, watch, i, home, np.int64(robots.heading[U(i)]), BAY_HELD)
    if want == NO_TURN:
        return wait_to_turn(world, watch, i)
    if want & LIVE and want & REFUSED:
        direction = want & 3
        cell = np.int64(robots.cell[U(i)]) + world.grid.offset[U(direction)]
        return wait_for(world, watch, i, cell, direction, UNDECIDED)
    if did == DID_WAIT or did == DID_BLOCKED:
        return find_next_cell(world, watch, i)
    if watch.busy_before[U(i)] > 0:
        return find_next_cell(world, watch, i) if robots.action[U(i)] == WAIT else NOT_WAITING
    if did == 0 and robots.parked[U(i)] == 0:
        return find_idleness(world, watch, i)
    return NOT_WAITING


@kernel
def note_slow_move(world, watch, i, want):
    """Enter the zone that slows robot i, and a tick that its move takes beyond its duration.

    A move that is slowed is a long one, out of its cell; its last ticks are its duration.
    """
    robots = world.robots
    if robots.claim[U(i)] == NIL:
        watch.slow_zone[U(i)] = NIL
        return
    if want & MOVED and world.rules.slowdown:
        around = robots_around(world, i, want)
        if around > 1:
            zone = world.grid.zone[U(robots.cell[U(i)]), U((want & 3) >> 1)]
            watch.slow_zone[U(i)] = zone
            watch.crowd[U(i)] = around
    usual = world.rules.duration[U(robots.type[U(i)]), U(MOVE)]
    if robots.action[U(i)] == MOVE and robots.busy[U(i)] >= usual:
        watch.lost[U(i), U(DRIVING_SLOWLY)] += 1
        if watch.slow_zone[U(i)] != NIL:
            watch.lost_in_zone[U(watch.slow_zone[U(i)])] += 1


@kernel
def find_next_cell(world, watch, i):
    """Robot i waits before the next cell of its route, or before the turn towards it."""
    robots, grid = world.robots, world.grid
    cell = np.int64(robots.cell[U(i)])
    if robots.at[U(i)] >= robots.length[U(i)]:
        watch.wanted[U(i)] = robots.stand[U(i)]
        return WAIT_DRAWN
    direction = np.int64(robots.route[U(i), U(robots.at[U(i)])])
    if direction & (grid.headings - 1) != robots.heading[U(i)]:
        return wait_to_turn(world, watch, i)
    return wait_for(world, watch, i, cell + grid.offset[U(direction)], direction, UNDECIDED)


@kernel
def wait_to_turn(world, watch, i):
    """Robot i is about to turn: only in a passing aisle can another one keep it."""
    cell = np.int64(world.robots.cell[U(i)])
    watch.wanted[U(i)] = cell
    if (np.int64(world.traffic.occupancy[U(cell)]) >> CAPACITY) & 3 == 2:
        return wait_for(world, watch, i, cell, np.int64(world.robots.travel[U(i)]) ^ 2, LANE)
    return WAIT_DRAWN


@kernel
def find_idleness(world, watch, i):
    """Robot i is on the floor, free, and did nothing: what is missing?"""
    robots = world.robots
    if robots.goal[U(i)] == GOAL_NONE:
        return NO_ORDER if robots.load[U(i)] == NIL else NO_PLACE
    if robots.at[U(i)] >= robots.length[U(i)] and robots.stand[U(i)] != robots.cell[U(i)]:
        watch.wanted[U(i)] = robots.stand[U(i)]
        return NO_ROUTE
    return NOT_WAITING
