"""The events of an observed tick, cycles of robots that wait for each other, and deadlocks."""

import numpy as np

from automaton.engine.blockers import (
    REQUESTED,
    enter_blocker,
    find_refused_swap,
    find_wait,
    forget,
    hold,
    walk_to_cycle,
)
from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import direction_between
from automaton.engine.observation import (
    DEADLOCK_TICKS,
    EVENT_BACK,
    EVENT_CHARGING,
    EVENT_DEADLOCK,
    EVENT_DELIVERED,
    EVENT_DEPLETED,
    EVENT_DROPPED,
    EVENT_FAILED,
    EVENT_ILLEGAL_DECISION,
    EVENT_JOB_DONE,
    EVENT_LEFT_BAY,
    EVENT_ORDER_RETURNED,
    EVENT_ORDER_TAKEN,
    EVENT_PARKED,
    EVENT_PART_FINISHED,
    EVENT_PICKED,
    EVENT_RETREATED,
    EVENT_TOWED,
    EVENT_VISITED,
    EVENT_WAIT_CYCLE,
    EVENT_ZONES_REDESIGNED,
)
from automaton.engine.record_codes import (
    ACTION_MASK,
    DROPPED_ON_ARRIVAL,
    ENTERED_PARKING_BAY,
    EXECUTED_CHARGE,
    EXECUTED_DROP,
    EXECUTED_PICK,
    EXECUTED_RETREAT,
    LEFT_PARKING_BAY,
    PICKED_ON_ARRIVAL,
)
from automaton.engine.refusals import (
    LATEST_REFUSALS,
    REFUSED_ROBOT,
    REFUSED_RULE,
    REFUSED_TICK,
    REFUSED_VALUE,
)
from automaton.engine.state import (
    ACTION_CHARGE,
    GOAL_NONE,
    NIL,
    ORDER_DELIVERED,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_REMOVED,
    STATUS_TOWED,
    STATUS_UP,
)

MAX_EVENTS_PER_ROBOT = 8  # of one robot in one tick
IN_CYCLE = NIL  # value of scratch.color


@kernel
def max_events(world):
    """The maximum number of events in a tick."""
    robots, stations = world.robots.cell.shape[0], world.stations.slot.shape[0]
    return MAX_EVENTS_PER_ROBOT * robots + stations + 1 + LATEST_REFUSALS


@kernel
def note_events(world, observation):
    """Append what happened in this tick, by identity; call after `observe`."""
    note_work(world, observation)
    note_zones(world, observation)
    note_refusals(world, observation)
    robots, scratch = world.robots, observation.scratch
    for k in range(scratch.count.eventful):
        i = np.int64(scratch.eventful[U(k)])
        identity = np.int64(robots.identity[i])
        order, before = np.int64(robots.order[i]), np.int64(observation.order_before[i])
        executed = np.int64(robots.executed[i])
        action = action_of(executed)
        if executed & LEFT_PARKING_BAY:
            event(world, observation, EVENT_LEFT_BAY, identity, NIL, NIL)
        visited = world.tally.visits[i] != observation.visits_before[i]
        came = action == EXECUTED_PICK and robots.load[i] == NIL  # the pick completed its order
        # An order that is done may have been taken in this tick, too.
        had = np.int64(world.tally.visited[i]) if (visited or came) and order == NIL else order
        if had != before and before != NIL and action != EXECUTED_DROP:
            event(world, observation, EVENT_ORDER_RETURNED, identity, before, NIL)
        if had != before and had != NIL:
            event(world, observation, EVENT_ORDER_TAKEN, identity, had, NIL)
        if visited:
            note_visit(world, observation, i, identity)
        if action:
            note_action(world, observation, i, identity, action)
        if robots.status[i] != observation.status_before[i]:
            note_status(world, observation, i, identity)
        if executed & ENTERED_PARKING_BAY:
            event(world, observation, EVENT_PARKED, identity, NIL, NIL)
        observation.dropped[i] = observation.load_before[i] if action == EXECUTED_DROP else NIL
        observation.order_before[i] = order
        observation.load_before[i] = robots.load[i]


@kernel
def note_work(world, observation):
    """The events of stations whose job on a part is done."""
    stations = world.stations
    for k in range(observation.working.shape[0]):
        work, now = np.int64(observation.working[k]), np.int64(stations.in_service[k])
        if work != now and work != NIL:
            code = EVENT_JOB_DONE if stations.releases_order[work] != NIL else EVENT_PART_FINISHED
            event(world, observation, code, NIL, np.int64(stations.part[work]), k)
        observation.working[k] = now


@kernel
def note_zones(world, observation):
    """The event of stations that changed their zone."""
    design, moved = world.service_zones.design, 0
    for station in range(observation.zone_before.shape[0]):
        before, now = np.int64(observation.zone_before[station]), np.int64(design.zone[station])
        if before != now:
            observation.zone_before[station] = now
            if before != NIL:  # no zone before the first design
                moved += 1
                observation.reshaped[before] = world.clock.tick
                observation.reshaped[now] = world.clock.tick
    if moved:
        event(world, observation, EVENT_ZONES_REDESIGNED, NIL, NIL, moved)
        observation.redesigns += 1


@kernel
def note_refusals(world, observation):
    """The events of the illegal decisions of this tick, at most the last LATEST_REFUSALS of them."""
    latest, total = world.refusals.latest, np.int64(world.refusals.count.total)
    first = total
    while first > max(0, total - LATEST_REFUSALS):
        if latest[(first - 1) % LATEST_REFUSALS, REFUSED_TICK] != world.clock.tick:
            break
        first -= 1
    for k in range(first, total):
        row = latest[k % LATEST_REFUSALS]
        rule, value = row[REFUSED_RULE], row[REFUSED_VALUE]
        event(world, observation, EVENT_ILLEGAL_DECISION, row[REFUSED_ROBOT], rule, value)


@kernel
def action_of(executed):
    """The action of a robot; a move at whose end it handled its load counts as the handling."""
    if executed & PICKED_ON_ARRIVAL:
        return EXECUTED_PICK
    return EXECUTED_DROP if executed & DROPPED_ON_ARRIVAL else executed & ACTION_MASK


@kernel
def event(world, observation, code, robot, subject, value):
    row = observation.count.events
    observation.events[row, 0] = world.clock.tick
    observation.events[row, 1] = code
    observation.events[row, 2] = robot
    observation.events[row, 3] = subject
    observation.events[row, 4] = value
    observation.count.events = row + 1


@kernel
def note_action(world, observation, i, identity, action):
    """The events of an operation that robot i has begun."""
    if action == EXECUTED_PICK and world.robots.load[i] == NIL:
        visited = np.int64(world.tally.visited[i])
        event(
            world, observation, EVENT_DELIVERED, identity, visited, np.int64(world.robots.cell[i])
        )
    elif action == EXECUTED_PICK:
        order = np.int64(world.robots.load[i])
        event(world, observation, EVENT_PICKED, identity, order, np.int64(world.robots.cell[i]))
    elif action == EXECUTED_DROP:
        order = np.int64(observation.load_before[i])
        done = world.orders.state[order] == ORDER_DELIVERED
        code = EVENT_DELIVERED if done else EVENT_DROPPED
        event(world, observation, code, identity, order, np.int64(world.robots.cell[i]))
    elif action == EXECUTED_CHARGE:
        if (
            world.tally.operations[i, ACTION_CHARGE, 0] != observation.stays[i]
        ):  # only in the first tick of a stay
            observation.stays[i] = world.tally.operations[i, ACTION_CHARGE, 0]
            event(
                world, observation, EVENT_CHARGING, identity, NIL, np.int64(world.robots.charge[i])
            )
    elif action == EXECUTED_RETREAT:
        event(
            world,
            observation,
            EVENT_RETREATED,
            identity,
            NIL,
            np.int64(world.robots.retreat_moves[i]),
        )


@kernel
def note_visit(world, observation, i, identity):
    """The events of a stop that robot i has done; after the last stop the order is delivered."""
    observation.visits_before[i] = world.tally.visits[i]
    order, cell = np.int64(world.tally.visited[i]), np.int64(world.robots.cell[i])
    event(world, observation, EVENT_VISITED, identity, order, cell)
    if world.orders.state[order] == ORDER_DELIVERED:
        event(world, observation, EVENT_DELIVERED, identity, order, cell)


@kernel
def note_status(world, observation, i, identity):
    """The events of a robot that goes down, is towed, or returns."""
    status = np.int64(world.robots.status[i])
    observation.status_before[i] = status
    if status == STATUS_DEPLETED or status == STATUS_FAILED:
        code = EVENT_DEPLETED if status == STATUS_DEPLETED else EVENT_FAILED
        event(world, observation, code, identity, NIL, np.int64(world.robots.cell[i]))
    elif status == STATUS_TOWED or status == STATUS_REMOVED:
        event(world, observation, EVENT_TOWED, identity, NIL, NIL)
    elif status == STATUS_UP:
        event(world, observation, EVENT_BACK, identity, NIL, NIL)


@kernel
def find_cycles(world, observation):
    """Mark the robots on cycles of blockers.

    `observe` has listed all robots with a blocker.
    """
    scratch = observation.scratch
    color = scratch.color
    waiters = scratch.count.waiters
    for k in range(waiters):
        color[U(scratch.waiters[U(k)])] = 0
    for k in range(waiters):
        start = np.int64(scratch.waiters[U(k)])
        if observation.blocker[U(start)] == NIL or color[U(start)]:
            continue
        member = walk_to_cycle(observation.blocker, world.robots.at_index, color, start)
        if member != NIL:
            close_cycle(world, observation, member)
    for k in range(waiters):
        i = U(scratch.waiters[U(k)])
        if color[i] != IN_CYCLE:
            observation.wait_cycle_ticks[i] = 0


@kernel
def close_cycle(world, observation, first):
    """Mark the cycle through `first`, and report when it closes."""
    robots = world.robots
    members = 0
    youngest = np.int64(observation.wait_cycle_ticks[first])
    name = np.int64(robots.identity[first])
    i = first
    while observation.scratch.color[i] != IN_CYCLE:
        observation.scratch.color[i] = IN_CYCLE
        youngest = min(youngest, np.int64(observation.wait_cycle_ticks[i]))
        name = min(name, np.int64(robots.identity[i]))
        members += 1
        i = np.int64(robots.at_index[observation.blocker[i]])
    for _ in range(members):
        # a cycle with a new member is a new wait cycle
        observation.wait_cycle_ticks[i] = youngest + 1
        i = np.int64(robots.at_index[observation.blocker[i]])
    if youngest == 0:
        event(world, observation, EVENT_WAIT_CYCLE, name, NIL, members)


# Deadlocks: wait cycles none of whose robots has done anything else for DEADLOCK_TICKS.
#
# A deadlock begins in the tick in which the last of its robots came to wait, and lasts until one of them
# moves, works or has nothing left to do. All runs count deadlocks, observed or not. Robots are looked
# through only while there is a deadlock, or when two of them may have waited for long enough.


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
    """End deadlocks of which a robot has moved or worked, or has nothing to do."""
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
