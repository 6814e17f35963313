"""Who keeps the robots that wait, and so why: passes over those that `observe` has listed.

Which robot holds the cell that is waited for; who kept whom from swapping; the cause, which depends
on what the blocker does; the lost ticks by cause and by cell.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.motion import CAPACITY, MOVED, REFUSED, U, direction_between, resource_of
from automaton.kernels.prefetch import prefetch
from automaton.world.state import GOAL_NONE, MOVE, NIL, TICK
from automaton.world.waiting import (
    AT_WORK,
    BAY_HELD,
    CHARGER_HELD,
    COUNTED_AT,
    DELAY_COLUMNS,
    HEAD_ON,
    IN_THE_WAY,
    JUST_FREED,
    LANE,
    LOST_CONTEST,
    LOST_EVER,
    LOST_LATELY,
    MEMORY_TICKS,
    NO_ORDER,
    NOT_WAITING,
    PASSING,
    QUEUE,
    UNDECIDED,
    WAIT_DRAWN,
    WAITERS,
)

SOUGHT = -2  # value of scratch.holder: somebody waits for it


@kernel
def find_blockers(world, watch):
    """Who keeps the robots that wait, and the causes that follow from it."""
    scratch = watch.scratch
    waiters = scratch.count[WAITERS]
    sought = 0
    for k in range(waiters):
        sought += seek(world, watch, np.int64(scratch.waiters[U(k)]))
    if sought:
        place_holders(world, watch)
    for k in range(waiters):
        enter_blocker(world, watch, np.int64(scratch.waiters[U(k)]))
    for k in range(waiters):
        i = np.int64(scratch.waiters[U(k)])
        find_refused_swap(world, watch, i)
        forget(watch, i)
    for k in range(waiters):
        i = np.int64(scratch.waiters[U(k)])
        if watch.cause[U(i)] == UNDECIDED:
            watch.cause[U(i)] = cause_of_wait(world, watch, i)
        count_wait(world, watch, i)


@kernel
def seek(world, watch, i):
    """Ask for the holder of what robot i waits for; returns 1 if it waits for a cell or a lane."""
    scratch = watch.scratch
    cell = np.int64(world.robots.cell[U(i)])
    if cell >= 0:
        prefetch(watch.delay, U(DELAY_COLUMNS * cell))
    entry = np.int64(scratch.entry[U(i)])
    if entry == NIL:
        return 0
    scratch.holder[U(entry)] = SOUGHT
    place = np.int64(watch.wanted[U(i)]) & (scratch.sieve.shape[0] - 1)
    scratch.sieve[U(place)] = 1
    return 1


@kernel
def place_holders(world, watch):
    """Enter who holds each resource that is sought, after the motion of this tick.

    The sieve, small enough for a fast cache, keeps most robots from looking into `holder`.
    """
    robots, sieve = world.robots, watch.scratch.sieve
    mask = sieve.shape[0] - 1
    for i in range(robots.cell.shape[0]):
        cell = np.int64(robots.cell[U(i)])
        if cell == NIL:
            continue
        claim = np.int64(robots.claim[U(i)])
        if sieve[U(cell & mask)]:
            travel = np.int64(robots.travel[U(i)])
            hold(world, watch, cell, travel, i)
            if claim == cell:
                hold(world, watch, cell, travel ^ 2, i)
        if claim != NIL and claim != cell and sieve[U(claim & mask)]:
            hold(world, watch, claim, direction_between(world.grid, cell, claim), i)


@kernel
def hold(world, watch, cell, direction, i):
    """Robot i holds its lane of a limited cell: enter it if somebody seeks it."""
    word = np.int64(world.traffic.occupancy[U(cell)])
    entry = resource_of(word, cell, direction, world.grid.rule.shape[0])
    if (word >> CAPACITY) & 3 and watch.scratch.holder[U(entry)] == SOUGHT:
        watch.scratch.holder[U(entry)] = i


@kernel
def enter_blocker(world, watch, i):
    """Robot i is kept by the holder of what it waits for; by nobody, the cause is another one."""
    entry = np.int64(watch.scratch.entry[U(i)])
    if entry == NIL:
        return
    holder = np.int64(watch.scratch.holder[U(entry)])
    if holder >= 0:
        watch.blocker[U(i)] = world.robots.identity[U(holder)]
    elif watch.cause[U(i)] == BAY_HELD or watch.cause[U(i)] == CHARGER_HELD:
        watch.cause[U(i)] = JUST_FREED
    elif watch.cause[U(i)] == LANE:
        watch.cause[U(i)] = WAIT_DRAWN


@kernel
def forget(watch, i):
    """What robot i waits for is sought no more."""
    scratch = watch.scratch
    entry = np.int64(scratch.entry[U(i)])
    if entry != NIL:
        scratch.holder[U(entry)] = NIL
        place = np.int64(watch.wanted[U(i)]) & (scratch.sieve.shape[0] - 1)
        scratch.sieve[U(place)] = 0


@kernel
def find_refused_swap(world, watch, i):
    """Robot i was refused a cell held by one that wanted to come out to it: that one waits for i too.

    Its way was free but for this rule, where it would have entered a cell for several robots.
    """
    robots = world.robots
    if watch.blocker[U(i)] == NIL or np.int64(world.traffic.want[U(i)]) & REFUSED == 0:
        return
    q = np.int64(robots.at_index[U(watch.blocker[U(i)])])
    if np.int64(world.traffic.want[U(q)]) & REFUSED == 0 or watch.blocker[U(q)] != NIL:
        return
    if watch.wanted[U(q)] == robots.cell[U(i)] and watch.wanted[U(i)] == robots.cell[U(q)]:
        watch.blocker[U(q)] = robots.identity[U(i)]


@kernel
def cause_of_wait(world, watch, i):
    """Why robot i waits for its wanted cell: what its holder does."""
    robots = world.robots
    if watch.blocker[U(i)] == NIL:
        refused = np.int64(world.traffic.want[U(i)]) & REFUSED
        return JUST_FREED if refused else WAIT_DRAWN
    q = np.int64(robots.at_index[U(watch.blocker[U(i)])])
    wanted = watch.wanted[U(i)]
    moved = np.int64(world.traffic.want[U(q)]) & MOVED
    entered = robots.cell[U(q)] if robots.claim[U(q)] == NIL else robots.claim[U(q)]
    if moved and entered == wanted and np.int64(world.traffic.want[U(i)]) & REFUSED:
        return LOST_CONTEST
    if watch.wanted[U(q)] == robots.cell[U(i)] and watch.cause[U(q)] != BAY_HELD:
        return HEAD_ON
    if watch.cause[U(q)] == NO_ORDER or (robots.parked[U(q)] and robots.goal[U(q)] == GOAL_NONE):
        return IN_THE_WAY
    if watch.cause[U(q)] != NOT_WAITING:
        return QUEUE
    return PASSING if moved or robots.action[U(q)] == MOVE else AT_WORK


@kernel
def count_wait(world, watch, i):
    """Enter the lost tick of robot i by its cause and by its cell."""
    watch.lost[U(i), U(watch.cause[U(i)])] += 1
    cell = np.int64(world.robots.cell[U(i)])
    if cell != NIL:
        delay, tick = watch.delay[U(cell)], world.clock[TICK]
        delay[LOST_EVER] += 1
        halvings = min((tick - np.int64(delay[COUNTED_AT])) // MEMORY_TICKS, 31)
        if halvings > 0:
            delay[COUNTED_AT] = tick
        delay[LOST_LATELY] = (np.int64(delay[LOST_LATELY]) >> halvings) + 1
