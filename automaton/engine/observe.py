"""Observation of each tick: which robot waits for which and why, events, heat maps.

After motion, one pass over the robots finds which made progress, and which wait for which cell.
Robots that drive or work cost no more than this. Further passes process only waiting robots: they
find the holder of each wanted cell, refused swaps, the cause (which depends on the blocker) and
wait cycles. Nothing here writes to the world.
"""

import numpy as np

from automaton.engine.blockers import find_blockers, find_wait
from automaton.engine.drive import robots_in_zone
from automaton.engine.gates import has_gates, is_cabin_move
from automaton.engine.jit.kernel import U, kernel, prefetch
from automaton.engine.motion import (
    MOVED,
    ROBOTS_FETCHED_AHEAD,
    direction_between,
)
from automaton.engine.observation import (
    CAUSE_DRIVING_AHEAD,
    CAUSE_FAULT,
    CAUSE_NO_ENERGY,
    CAUSE_NO_ORDER,
    CAUSE_NOT_WAITING,
    CAUSE_REDUCED_SPEED,
    DELIVERED_ORDERS,
    IS_EVENTFUL,
    IS_WAITING,
    WAITING_ROBOTS,
    WORKING_ROBOTS,
)
from automaton.engine.operations import is_held_up
from automaton.engine.random_numbers import is_begin
from automaton.engine.record_codes import (
    ACTION_MASK,
    ENTERED_PARKING_BAY,
    EXECUTED_CHARGE,
    EXECUTED_DROP,
    EXECUTED_ILLEGAL,
    EXECUTED_PICK,
    EXECUTED_RETREAT,
    LEFT_PARKING_BAY,
    PICKED_ON_ARRIVAL,
)
from automaton.engine.state import (
    ACTION_MOVE,
    FOLLOWING_CONVOY,
    NIL,
)

MARKS = 8  # in a word
# Flags and actions that are events; a load dropped on arrival changes hands.
EVENT_FLAGS = LEFT_PARKING_BAY | ENTERED_PARKING_BAY | PICKED_ON_ARRIVAL
EVENT_ACTIONS = (
    (1 << EXECUTED_PICK)
    | (1 << EXECUTED_DROP)
    | (1 << EXECUTED_CHARGE)
    | (1 << EXECUTED_ILLEGAL)
    | (1 << EXECUTED_RETREAT)
)


@kernel
def observe(world, observation):
    """Observe this tick."""
    waiting, working, marked = scan_robots(world, observation)
    observation.scratch.count.waiters = 0
    observation.scratch.count.eventful = 0
    if marked:
        list_waiting(world, observation)
    if observation.scratch.count.waiters:
        find_blockers(world, observation)
    row = observation.count.curve_rows
    observation.curve[row, WAITING_ROBOTS] = waiting
    observation.curve[row, WORKING_ROBOTS] = working
    observation.curve[row, DELIVERED_ORDERS] = orders_done(world)
    observation.count.curve_rows = row + 1


@kernel
def orders_done(world):
    """Number of completed orders; where pods are carried, of orders with all lines done."""
    if world.lines.order.shape[0]:
        return world.clock.orders_done
    return world.orders.state.shape[0] - world.clock.undelivered


@kernel
def scan_robots(world, observation):
    """One pass: moves, waits and events; returns the numbers of waiting, working and listed robots."""
    robots, scratch = world.robots, observation.scratch
    intent, executed, cause = world.traffic.intent, robots.executed, observation.cause
    busy, busy_before = robots.busy, observation.busy_before
    order, order_before = robots.order, observation.order_before
    load, load_before = robots.load, observation.load_before
    tours = world.stops.cell.shape[0] > 0
    visits, visits_before = world.tally.visits, observation.visits_before
    rules = world.rules
    convoy = rules.following == FOLLOWING_CONVOY
    between = not is_begin(world)
    may_slow = rules.slowdown or rules.extra_tick or world.grid.min_move_ticks.shape[0]
    waiting = 0
    working = 0
    marked = 0
    for i in range(executed.shape[0]):
        if i + ROBOTS_FETCHED_AHEAD < executed.shape[0]:
            fetch_move(world, observation, i + ROBOTS_FETCHED_AHEAD)
        w = np.int64(intent[U(i)])
        if may_slow:
            note_slow_move(world, observation, i, w)
        told = np.int64(executed[U(i)])
        mark = 0
        now = np.int64(CAUSE_NOT_WAITING)
        goes_on = False
        visited = tours and visits[U(i)] != visits_before[U(i)]
        if w & MOVED:
            count_move(world, observation, i, w & 3)
        if convoy and is_following(world, i):
            now = note_following(world, observation, i)
        elif w & MOVED or visited:
            pass  # it made progress, or stood where it had to
        elif between and w == 0 and told == 0 and busy_before[U(i)] == 0:
            now = np.int64(cause[U(i)])  # it begins nothing: this tick is already counted
            goes_on = True
        elif w or told or busy_before[U(i)] or robots.parked[U(i)] == 0:
            now = find_wait(world, observation, i, w, told & ACTION_MASK)
        if now == CAUSE_NOT_WAITING:
            if cause[U(i)] != CAUSE_NOT_WAITING:
                end_wait(observation, i)
            if robots.parked[U(i)] == 0:
                working += 1
        else:
            if not goes_on:
                note_wait(world, observation, i, now)
            if now != CAUSE_NO_ORDER:
                waiting += 1
                mark = 0 if goes_on else IS_WAITING
        busy_before[U(i)] = busy[U(i)]
        if (
            visited
            or told & EVENT_FLAGS
            or (EVENT_ACTIONS >> (told & ACTION_MASK)) & 1
            or order[U(i)] != order_before[U(i)]
            or load[U(i)] != load_before[U(i)]
            or observation.dropped[U(i)] != NIL
            or robots.status[U(i)] != observation.status_before[U(i)]
        ):
            mark |= IS_EVENTFUL
        if mark:
            scratch.marks[U(robots.identity[U(i)])] = mark
            marked += 1
    return waiting, working, marked


@kernel(inline=True)
def fetch_move(world, observation, i):
    """Prefetch the words of the map of moves for a robot stored a little later."""
    intent = np.int64(world.traffic.intent[U(i)])
    cell = np.int64(world.robots.cell[U(i)])
    if intent & MOVED and cell >= 0:
        prefetch(observation.flow, U(4 * (cell - world.grid.offset[U(intent & 3)])))


@kernel
def count_move(world, observation, i, direction):
    """Count a move of robot i in the map of moves."""
    robots = world.robots
    entered = np.int64(robots.claim[U(i)])
    if entered == NIL:  # it has arrived; a robot that moved home may already be in its parking bay
        entered = np.int64(robots.cell[U(i)])
        if entered == NIL:
            entered = np.int64(robots.home[U(i)])
    observation.flow[U(entered - world.grid.offset[U(direction)]), U(direction)] += 1


@kernel
def is_following(world, i):
    """Whether robot i loses this tick of its move to the robot ahead; its own ticks come last."""
    robots = world.robots
    if robots.claim[U(i)] == NIL or robots.claim[U(i)] == robots.cell[U(i)]:
        return False
    is_longer = robots.busy[U(i)] >= world.traffic.own_ticks[U(i)]
    return is_longer and not is_held_up(world, i)


@kernel
def note_following(world, observation, i):
    """Robot i drives behind a robot that is still leaving the cell, which `find_blockers` finds."""
    observation.blocker[U(i)] = NIL
    observation.wanted[U(i)] = world.robots.claim[U(i)]
    observation.scratch.entry[U(i)] = NIL
    return CAUSE_DRIVING_AHEAD


@kernel
def end_wait(observation, i):
    """Robot i makes progress again."""
    observation.cause[U(i)] = CAUSE_NOT_WAITING
    observation.blocker[U(i)] = NIL
    observation.wanted[U(i)] = NIL
    observation.wait_cycle_ticks[U(i)] = 0


@kernel
def note_wait(world, observation, i, cause):
    """Robot i lost this tick; a wait for an order, time in which it is down, and any other wait are
    different waits."""
    before = np.int64(observation.cause[U(i)])
    if before == CAUSE_NOT_WAITING or kind_of_wait(before) != kind_of_wait(cause):
        observation.since[U(i)] = world.clock.tick - 1
    observation.cause[U(i)] = cause
    if cause == CAUSE_NO_ORDER:
        observation.wait_cycle_ticks[U(i)] = 0
        observation.lost[U(i), U(CAUSE_NO_ORDER)] += world.rules.stride


@kernel(inline=True)
def kind_of_wait(cause):
    """CAUSE_NO_ORDER, CAUSE_FAULT if the robot is down, or CAUSE_NOT_WAITING for all other causes."""
    if cause == CAUSE_FAULT or cause == CAUSE_NO_ENERGY:
        return np.int64(CAUSE_FAULT)
    return np.int64(CAUSE_NO_ORDER if cause == CAUSE_NO_ORDER else CAUSE_NOT_WAITING)


@kernel
def list_waiting(world, observation):
    """List waiting robots, and robots with events, by identity; clear the marks."""
    scratch, at_index = observation.scratch, world.robots.at_index
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
    scratch.count.waiters = waiters
    scratch.count.eventful = eventful


@kernel
def note_slow_move(world, observation, i, want):
    """Enter the zone that slows robot i, and count a tick of its move beyond its duration.

    A slowed move is a long move out of its cell; its own duration is the last part.
    """
    robots = world.robots
    if robots.claim[U(i)] == NIL:
        observation.slow_zone[U(i)] = NIL
        return
    direction = direction_between(world.grid, robots.cell[U(i)], robots.claim[U(i)])
    if has_gates(world) and is_cabin_move(world, i, direction):
        return
    if want & MOVED and world.rules.slowdown:
        around = robots_in_zone(world, i, want)
        if around > 1:
            traffic_zone = world.grid.traffic_zone[U(robots.cell[U(i)]), U((want & 3) >> 1)]
            observation.slow_zone[U(i)] = traffic_zone
            observation.slow_zone_occupancy[U(i)] = around
    usual = world.rules.duration[U(robots.type[U(i)]), U(ACTION_MOVE)]
    drives = robots.action[U(i)] == ACTION_MOVE and not is_held_up(world, i)
    follows = world.rules.following == FOLLOWING_CONVOY and is_following(world, i)
    if drives and robots.busy[U(i)] >= usual and not follows:
        observation.lost[U(i), U(CAUSE_REDUCED_SPEED)] += 1
        if observation.slow_zone[U(i)] != NIL:
            observation.lost_in_zone[U(observation.slow_zone[U(i)])] += 1
