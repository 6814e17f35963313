"""The events of an observed tick, and cycles of robots that wait for each other."""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.motion import U
from automaton.recording.codes import (
    ACTION_MASK,
    DID_CHARGE,
    DID_DROP,
    DID_ILLEGAL,
    DID_PICK,
    DID_WITHDRAW,
    DROPPED_AT_ONCE,
    INTO_BAY,
    LEFT_BAY,
    PICKED_AT_ONCE,
)
from automaton.world.condition import BROKEN, EMPTY, GONE, RUNNING, TOWED
from automaton.world.state import CHARGE, DELIVERED, NIL, TICK
from automaton.world.waiting import (
    BROKE_DOWN,
    CAME_BACK,
    CHARGED,
    CYCLE,
    DEADLOCK,
    DEADLOCK_TICKS,
    DELIVERED_AT,
    EVENTFUL,
    EVENTS,
    GAVE_BACK,
    OUT_OF_BAY,
    PARKED,
    PART_FINISHED,
    PICKED_UP,
    RAN_EMPTY,
    REDESIGNED,
    REFUSED_ANSWER,
    SET_DOWN,
    TOOK,
    WAITERS,
    WAS_TOWED,
    WITHDREW,
    WORK_DONE,
)

MOST_EVENTS = 8  # of one robot in one tick
IN_CYCLE = NIL  # value of scratch.color


@kernel
def most_events(world):
    """How many events a tick can have."""
    return MOST_EVENTS * world.robots.cell.shape[0] + world.stations.slot.shape[0] + 1


@kernel
def note_events(world, watch):
    """Append what happened in this tick, by identity; call after `observe`."""
    note_work(world, watch)
    note_zones(world, watch)
    robots, scratch = world.robots, watch.scratch
    for k in range(scratch.count[EVENTFUL]):
        i = np.int64(scratch.eventful[U(k)])
        identity = np.int64(robots.identity[i])
        order, before = np.int64(robots.order[i]), np.int64(watch.order_before[i])
        did = np.int64(robots.did[i])
        action = action_of(did)
        if did & LEFT_BAY:
            event(world, watch, OUT_OF_BAY, identity, NIL, NIL)
        visited = action == DID_PICK and robots.load[i] == NIL  # it had only to come
        if order != before and before != NIL and action != DID_DROP and not visited:
            event(world, watch, GAVE_BACK, identity, before, NIL)
        if order != before and order != NIL:
            event(world, watch, TOOK, identity, order, NIL)
        if action:
            note_action(world, watch, i, identity, action)
        if robots.status[i] != watch.status_before[i]:
            note_status(world, watch, i, identity)
        if did & INTO_BAY:
            event(world, watch, PARKED, identity, NIL, NIL)
        watch.set_down[i] = watch.load_before[i] if action == DID_DROP else NIL
        watch.order_before[i] = order
        watch.load_before[i] = robots.load[i]


@kernel
def note_work(world, watch):
    """The events of stations that are done with a part."""
    stations = world.stations
    for k in range(watch.working.shape[0]):
        work, now = np.int64(watch.working[k]), np.int64(stations.first[k])
        if work != now and work != NIL:
            code = WORK_DONE if stations.frees[work] != NIL else PART_FINISHED
            event(world, watch, code, NIL, np.int64(stations.part[work]), k)
        watch.working[k] = now


@kernel
def note_zones(world, watch):
    """The event of stations that came from one zone into another."""
    design, moved = world.zoning.design, 0
    for station in range(watch.zone_before.shape[0]):
        before, now = np.int64(watch.zone_before[station]), np.int64(design.zone[station])
        if before != now:
            watch.zone_before[station] = now
            if before != NIL:  # at the start it had none
                moved += 1
                watch.reshaped[before] = world.clock[TICK]
                watch.reshaped[now] = world.clock[TICK]
    if moved:
        event(world, watch, REDESIGNED, NIL, NIL, moved)
        watch.redesigns[0] += 1


@kernel
def action_of(did):
    """What a robot did, of which a move at whose end it handled its load is the handling."""
    if did & PICKED_AT_ONCE:
        return DID_PICK
    return DID_DROP if did & DROPPED_AT_ONCE else did & ACTION_MASK


@kernel
def event(world, watch, code, robot, subject, value):
    row = watch.count[EVENTS]
    watch.events[row, 0] = world.clock[TICK]
    watch.events[row, 1] = code
    watch.events[row, 2] = robot
    watch.events[row, 3] = subject
    watch.events[row, 4] = value
    watch.count[EVENTS] = row + 1


@kernel
def note_action(world, watch, i, identity, action):
    """The events of an operation that robot i began."""
    if action == DID_PICK and world.robots.load[i] == NIL:
        visited = np.int64(watch.order_before[i])
        event(world, watch, DELIVERED_AT, identity, visited, np.int64(world.robots.cell[i]))
    elif action == DID_PICK:
        order = np.int64(world.robots.load[i])
        event(world, watch, PICKED_UP, identity, order, np.int64(world.robots.cell[i]))
    elif action == DID_DROP:
        order = np.int64(watch.load_before[i])
        done = world.orders.state[order] == DELIVERED
        code = DELIVERED_AT if done else SET_DOWN
        event(world, watch, code, identity, order, np.int64(world.robots.cell[i]))
    elif action == DID_CHARGE:
        if world.tally.times[i, CHARGE, 0] != watch.stays[i]:  # not in every tick of a stay
            watch.stays[i] = world.tally.times[i, CHARGE, 0]
            event(world, watch, CHARGED, identity, NIL, np.int64(world.robots.charge[i]))
    elif action == DID_ILLEGAL:
        event(world, watch, REFUSED_ANSWER, identity, NIL, NIL)
    elif action == DID_WITHDRAW:
        event(world, watch, WITHDREW, identity, NIL, np.int64(world.robots.withdrawing[i]))


@kernel
def note_status(world, watch, i, identity):
    """The events of a robot that goes out of order, is towed, or comes back."""
    status = np.int64(world.robots.status[i])
    watch.status_before[i] = status
    if status == EMPTY or status == BROKEN:
        code = RAN_EMPTY if status == EMPTY else BROKE_DOWN
        event(world, watch, code, identity, NIL, np.int64(world.robots.cell[i]))
    elif status == TOWED or status == GONE:
        event(world, watch, WAS_TOWED, identity, NIL, NIL)
    elif status == RUNNING:
        event(world, watch, CAME_BACK, identity, NIL, NIL)


@kernel
def find_cycles(world, watch):
    """Mark the robots on cycles of blockers: each robot has one at most, so a walk finds them.

    Whoever has a blocker is among those that `observe` has listed.
    """
    robots, scratch = world.robots, watch.scratch
    color = scratch.color
    waiters = scratch.count[WAITERS]
    for k in range(waiters):
        color[U(scratch.waiters[U(k)])] = 0
    for k in range(waiters):
        start = np.int64(scratch.waiters[U(k)])
        if watch.blocker[U(start)] == NIL or color[U(start)]:
            continue
        i = start
        while watch.blocker[U(i)] != NIL and color[U(i)] == 0:
            color[U(i)] = start + 1
            i = np.int64(robots.at_index[U(watch.blocker[U(i)])])
        if watch.blocker[U(i)] != NIL and color[U(i)] == start + 1:
            close_cycle(world, watch, i)
    for k in range(waiters):
        i = U(scratch.waiters[U(k)])
        if color[i] != IN_CYCLE:
            watch.ring[i] = 0


@kernel
def close_cycle(world, watch, first):
    """Mark the cycle through `first`, and note when it closed or has lasted too long."""
    robots = world.robots
    members = 0
    youngest = np.int64(watch.ring[first])
    name = np.int64(robots.identity[first])
    i = first
    while watch.scratch.color[i] != IN_CYCLE:
        watch.scratch.color[i] = IN_CYCLE
        youngest = min(youngest, np.int64(watch.ring[i]))
        name = min(name, np.int64(robots.identity[i]))
        members += 1
        i = np.int64(robots.at_index[watch.blocker[i]])
    for _ in range(members):
        watch.ring[i] = youngest + 1  # with another robot in it, it is another circle
        i = np.int64(robots.at_index[watch.blocker[i]])
    if youngest == 0:
        event(world, watch, CYCLE, name, NIL, members)
    elif youngest + 1 == DEADLOCK_TICKS:
        event(world, watch, DEADLOCK, name, NIL, members)
