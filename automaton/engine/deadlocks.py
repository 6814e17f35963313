"""Deadlocks: wait cycles none of whose robots has done anything else for DEADLOCK_TICKS.

Each robot of a wait cycle waits for the next one, and the last for the first. A deadlock begins in
the tick in which the last of its robots came to wait, and lasts until one of them moves or works.
All runs count deadlocks, observed or not. Robots are looked through only when two of them may have
waited for long enough, which the least recent activity of the fleet tells.
"""

import numpy as np

from automaton.engine.blockers import (
    enter_blocker,
    find_refused_swap,
    forget,
    hold,
    walk_to_cycle,
)
from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import direction_between
from automaton.engine.observation import DEADLOCK_TICKS
from automaton.engine.observe import find_wait
from automaton.engine.record_codes import ACTION_MASK
from automaton.engine.state import GOAL_NONE, NIL

REQUESTED = -2  # value of scratch.holder: a robot waits for it
IN_DEADLOCK = NIL  # value of scratch.color
NO_TICK = np.int64(1) << 62


@kernel
def find_deadlocks(world, watch):
    """Count the deadlocks of this tick; `watch`: an observation whose arrays serve as scratch."""
    deadlocks, robots = world.deadlocks, world.robots
    listed = list_standing(world, watch)
    for k in range(listed):
        find_entry(world, watch, np.int64(watch.scratch.waiters[U(k)]))
    for k in range(listed):
        enter_cells(world, watch, np.int64(watch.scratch.waiters[U(k)]))
    for k in range(listed):
        enter_blocker(world, watch, np.int64(watch.scratch.waiters[U(k)]))
    for k in range(listed):
        i = np.int64(watch.scratch.waiters[U(k)])
        find_refused_swap(world, watch, i)
        forget(watch, i)
        watch.scratch.color[U(i)] = 0
    for k in range(listed):
        start = np.int64(watch.scratch.waiters[U(k)])
        if watch.blocker[U(start)] == NIL or watch.scratch.color[U(start)]:
            continue
        member = walk_to_cycle(watch.blocker, robots.at_index, watch.scratch.color, start)
        if member != NIL:
            note_deadlock(world, watch, member)
    for k in range(listed):
        i = U(watch.scratch.waiters[U(k)])
        if watch.scratch.color[i] != IN_DEADLOCK:
            deadlocks.since[i] = NIL
        watch.blocker[i] = NIL


@kernel
def list_standing(world, watch):
    """List the robots that have waited for DEADLOCK_TICKS; enters when to look again.

    Two have to have waited so long: the next look is when the second of them may have.
    """
    deadlocks, robots = world.deadlocks, world.robots
    patience = DEADLOCK_TICKS * world.rules.stride
    first, second = NO_TICK, NO_TICK
    listed = 0
    for i in range(robots.cell.shape[0]):
        if robots.cell[U(i)] == NIL or robots.goal_type[U(i)] == GOAL_NONE:
            deadlocks.since[U(i)] = NIL
            continue
        active = last_activity(world, i)
        if active < first:
            first, second = active, first
        elif active < second:
            second = active
        if active + patience <= world.clock.tick:
            watch.scratch.waiters[U(listed)] = i
            listed += 1
        else:
            deadlocks.since[U(i)] = NIL
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
def note_deadlock(world, watch, first):
    """Count the deadlock of the wait cycle through robot `first`, and the time of its robots in it.

    One in which a robot has been in a deadlock before goes on: its robots wait in another sequence.
    """
    deadlocks, robots, count = world.deadlocks, world.robots, world.deadlocks.count
    tick, begin, known = world.clock.tick, np.int64(0), NO_TICK
    name, members = np.int64(robots.identity[U(first)]), 0
    i = first
    while watch.scratch.color[U(i)] != IN_DEADLOCK:
        watch.scratch.color[U(i)] = IN_DEADLOCK
        name = min(name, np.int64(robots.identity[U(i)]))
        begin = max(begin, last_activity(world, i) + 1)
        if deadlocks.since[U(i)] != NIL:
            known = min(known, np.int64(deadlocks.since[U(i)]))
        members += 1
        i = np.int64(robots.at_index[U(watch.blocker[U(i)])])
    if known == NO_TICK:
        count.found += 1
    else:
        begin = known
    for _ in range(members):
        if deadlocks.since[U(i)] == NIL:
            deadlocks.counted[U(i)] = max(begin, last_activity(world, i) + 1) - 1
        deadlocks.since[U(i)] = begin
        count.robot_ticks += tick - deadlocks.counted[U(i)]
        deadlocks.counted[U(i)] = tick
        i = np.int64(robots.at_index[U(watch.blocker[U(i)])])
    lasted = tick - begin + 1
    if lasted > count.longest:
        count.longest = lasted
        count.longest_begin = begin
        count.longest_cell = np.int64(robots.cell[U(robots.at_index[U(name)])])
