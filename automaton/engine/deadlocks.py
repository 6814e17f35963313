"""Deadlocks: wait cycles none of whose robots has done anything else for DEADLOCK_TICKS.

Each robot of a wait cycle waits for the next one, and the last for the first. A deadlock begins in
the tick in which the last of its robots came to wait, and lasts until one of them moves, works or has
nothing left to do. All runs count deadlocks, observed or not. Robots are looked through only while
there is a deadlock, or when two of them may have waited for long enough.
"""

import numpy as np

from automaton.engine.blockers import (
    enter_blocker,
    find_refused_swap,
    forget,
    hold,
    walk_to_cycle,
)
from automaton.engine.events import event
from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import direction_between
from automaton.engine.observation import DEADLOCK_TICKS, EVENT_DEADLOCK
from automaton.engine.observe import find_wait
from automaton.engine.record_codes import ACTION_MASK
from automaton.engine.state import GOAL_NONE, NIL

REQUESTED = -2  # value of scratch.holder: a robot waits for it
IN_DEADLOCK = NIL  # value of scratch.color
NO_TICK = np.int64(1) << 62


@kernel
def find_deadlocks(world, watch, observed):
    """Count the deadlocks of this tick; `watch`: an observation whose arrays serve as scratch.

    An observed run gets the event, and for robots in deadlocks how long these have lasted.
    """
    robots, waiters = world.robots, watch.scratch.waiters
    end_deadlocks(world)
    listed = list_standing(world, watch)
    for k in range(listed):
        find_entry(world, watch, np.int64(waiters[U(k)]))
    for k in range(listed):
        enter_cells(world, watch, np.int64(waiters[U(k)]))
    for k in range(listed):
        enter_blocker(world, watch, np.int64(waiters[U(k)]))
    for k in range(listed):
        i = np.int64(waiters[U(k)])
        find_refused_swap(world, watch, i)
        forget(watch, i)
        watch.scratch.color[U(i)] = 0
    for k in range(listed):
        start = np.int64(waiters[U(k)])
        if watch.blocker[U(start)] == NIL or watch.scratch.color[U(start)]:
            continue
        member = walk_to_cycle(watch.blocker, robots.at_index, watch.scratch.color, start)
        if member != NIL:
            begin_deadlock(world, watch, observed, member)
    for k in range(listed):
        watch.blocker[U(waiters[U(k)])] = NIL
    if world.deadlocks.count.robots:
        count_time(world, observed)


@kernel
def end_deadlocks(world):
    """Deadlocks end of which a robot has moved or worked, or has nothing to do."""
    deadlocks, robots = world.deadlocks, world.robots
    for i in range(robots.cell.shape[0] if deadlocks.count.robots else 0):
        number = np.int64(deadlocks.number[U(i)])
        if number == 0:
            continue
        acts = np.int64(world.tally.active[U(i)]) >= np.int64(deadlocks.since[U(i)])
        if acts or robots.cell[U(i)] == NIL or robots.goal_type[U(i)] == GOAL_NONE:
            for j in range(robots.cell.shape[0]):
                if deadlocks.number[U(j)] == number:
                    deadlocks.number[U(j)] = 0
                    deadlocks.count.robots -= 1


@kernel
def list_standing(world, watch):
    """List the robots in no deadlock that have waited for DEADLOCK_TICKS; enters when to look again.

    Without a deadlock, the next look is when the second robot may have waited so long.
    """
    deadlocks, robots = world.deadlocks, world.robots
    patience = DEADLOCK_TICKS * world.rules.stride
    first, second = NO_TICK, NO_TICK
    listed = 0
    for i in range(robots.cell.shape[0]):
        is_idle = robots.cell[U(i)] == NIL or robots.goal_type[U(i)] == GOAL_NONE
        if is_idle or deadlocks.number[U(i)]:
            continue
        active = last_activity(world, i)
        if active < first:
            first, second = active, first
        elif active < second:
            second = active
        if active + patience <= world.clock.tick:
            watch.scratch.waiters[U(listed)] = i
            listed += 1
    deadlocks.count.next_look = max(second + patience, world.clock.tick + 1)
    return listed


@kernel(inline=True)
def last_activity(world, i):
    """The last tick in which robot i did anything but lose time, or had nothing to do."""
    return max(np.int64(world.tally.active[U(i)]), np.int64(world.tally.progress[U(i)]))


@kernel
def find_entry(world, watch, i):
    """Ask for the holder of what robot i waits for."""
    robots = world.robots
    watch.busy_before[U(i)] = 1  # all that it can have been busy with is a wait
    executed = np.int64(robots.executed[U(i)])
    intent = np.int64(world.traffic.intent[U(i)])
    watch.cause[U(i)] = find_wait(world, watch, i, intent, executed & ACTION_MASK)
    entry = np.int64(watch.scratch.entry[U(i)])
    if entry != NIL:
        watch.scratch.holder[U(entry)] = REQUESTED


@kernel
def enter_cells(world, watch, i):
    """Robot i holds its cell and the one that it claims: enter it where a robot seeks its holder."""
    robots = world.robots
    cell, claim = np.int64(robots.cell[U(i)]), np.int64(robots.claim[U(i)])
    travel = np.int64(robots.travel[U(i)])
    hold(world, watch, cell, travel, i)
    if claim == cell:
        hold(world, watch, cell, travel ^ 2, i)
    elif claim != NIL:
        hold(world, watch, claim, direction_between(world.grid, cell, claim), i)


@kernel
def begin_deadlock(world, watch, observed, first):
    """The wait cycle through robot `first` is a deadlock: its time counts from its beginning."""
    deadlocks, count, at_index = world.deadlocks, world.deadlocks.count, world.robots.at_index
    begin, members = np.int64(0), 0
    name = np.int64(world.robots.identity[U(first)])
    i = first
    while watch.scratch.color[U(i)] != IN_DEADLOCK:
        watch.scratch.color[U(i)] = IN_DEADLOCK
        begin = max(begin, last_activity(world, i) + 1)
        name = min(name, np.int64(world.robots.identity[U(i)]))
        members += 1
        i = np.int64(at_index[U(watch.blocker[U(i)])])
    count.total += 1
    count.robots += members
    count.next_look = world.clock.tick + 1
    for _ in range(members):
        deadlocks.number[U(i)] = count.total
        deadlocks.since[U(i)] = begin
        deadlocks.found_at[U(i)] = world.clock.tick
        count.robot_ticks += world.clock.tick - begin + 1 - world.rules.stride
        i = np.int64(at_index[U(watch.blocker[U(i)])])
    if world.clock.observing:
        event(world, observed, EVENT_DEADLOCK, name, NIL, members)


@kernel
def count_time(world, observed):
    """Count this tick for the robots in deadlocks, and enter the longest deadlock."""
    deadlocks, count, robots = world.deadlocks, world.deadlocks.count, world.robots
    count.next_look = world.clock.tick + 1
    count.robot_ticks += count.robots * world.rules.stride
    for i in range(robots.cell.shape[0]):
        if deadlocks.number[U(i)] == 0:
            continue
        begin, identity = np.int64(deadlocks.since[U(i)]), np.int64(robots.identity[U(i)])
        lasted = world.clock.tick - begin + 1
        if world.clock.observing:
            observed.wait_cycle_ticks[U(i)] = lasted // world.rules.stride
        is_first = begin == count.longest_begin and identity < count.longest_robot
        if lasted > count.longest or (lasted == count.longest and is_first):
            count.longest, count.longest_begin = lasted, begin
            count.longest_robot = identity
            count.longest_cell = np.int64(robots.cell[U(i)])
