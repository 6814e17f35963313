"""Robots that are delayed: for some ticks they begin nothing, and what they drive takes longer.

As in the League of Robot Runners 2026. In the faults phase each robot on the floor that is in order and
not delayed begins a delay with a probability; or a Poisson number of them do, those with the least
hashes. A sum of Poisson numbers is one: each robot adds one with the probability as its mean.

Under convoy no move ends before the one ahead of it, so a delay in mid-move is handed on to those behind.
"""

import numpy as np

from automaton.engine.holders import lane_of, mark_claim
from automaton.engine.jit.kernel import kernel
from automaton.engine.motion import U, direction_between, own_resource
from automaton.engine.operations import begin, count_following
from automaton.engine.random_numbers import (
    STREAM_DELAY_COUNTS,
    STREAM_DELAY_TICKS,
    STREAM_DELAYS,
    random_between,
    random_bits,
)
from automaton.engine.record_changes import record_change
from automaton.engine.record_codes import CHANGE_DELAYED
from automaton.engine.refinement import chance_decides
from automaton.engine.robot_status import STATUS_EXHAUSTED
from automaton.engine.state import (
    ACTION_DELAYED,
    CLOCK_COARSE_TICK,
    CLOCK_TICK,
    FOLLOWING_CONVOY,
    NIL,
)

MAX_BUSY = 65_535  # ticks that robots.busy can hold


@kernel
def delay_robots(world, record):
    """Begin delays, and let delayed robots stand; call after robots have gone down and come back."""
    robots, delays, tick = world.robots, world.delays, world.clock[CLOCK_TICK]
    draws = chance_decides(world)
    last_hash = find_last_hash(world) if delays.poisson and draws else np.uint64(0)
    lengthened = 0
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[U(identity)])
        if robots.cell[U(i)] == NIL or robots.status[U(i)] > STATUS_EXHAUSTED:
            delays.until[U(identity)] = 0
            continue
        if draws and delays.until[U(identity)] < tick:
            if begins_delay(world, identity, last_hash):
                lengthened += begin_delay(world, record, i)
        if delays.until[U(identity)] >= tick:
            delays.lasted[U(identity)] += world.rules.stride
            if robots.busy[U(i)] == 0:
                begin(world, i, ACTION_DELAYED, delays.until[U(identity)] - tick + 1)
    if lengthened and world.rules.following == FOLLOWING_CONVOY:
        hand_delays_on(world)


@kernel
def begins_delay(world, identity, last_hash):
    """Whether a robot that may begin a delay does."""
    bits = random_bits(world.rules.seed, STREAM_DELAYS, world.clock[CLOCK_COARSE_TICK], identity)
    if world.delays.poisson:
        return bits <= last_hash
    return np.int64(bits >> np.uint64(32)) < world.delays.probability


@kernel
def begin_delay(world, record, i):
    """Robot i is delayed from this tick on; returns 1 if what it drives takes longer, else 0."""
    robots, delays, tick = world.robots, world.delays, world.clock[CLOCK_TICK]
    identity, last = np.int64(robots.identity[i]), delays.ticks.shape[0] - 1
    drawn_in = world.clock[CLOCK_COARSE_TICK]
    entry = random_between(0, last, world.rules.seed, STREAM_DELAY_TICKS, drawn_in, identity)
    busy = np.int64(robots.busy[i])
    ticks = min(np.int64(delays.ticks[entry]), MAX_BUSY - busy)
    delays.until[identity] = tick + ticks - 1
    record_change(world.clock, record, CHANGE_DELAYED, identity, ticks)
    if busy == 0 or delays.lengthens[robots.action[i]] == 0:
        return 0
    robots.busy[i] = busy + ticks
    world.traffic.own_ticks[i] = min(np.int64(world.traffic.own_ticks[i]) + ticks, MAX_BUSY)
    world.tally.ticks[i, robots.action[i], 1 if robots.load[i] != NIL else 0] += ticks
    return 1


@kernel
def hand_delays_on(world):
    """Put off the ends of moves behind robots that were delayed, in files and rings of any length."""
    robots, until = world.robots, world.delays.until
    mark_claims(world, 1)
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[U(identity)])
        if is_between_cells(robots, i) and until[U(identity)] >= world.clock[CLOCK_TICK]:
            put_off_end(world, i, 0)
            hand_on(world, i)
    mark_claims(world, 0)


@kernel
def mark_claims(world, value):
    """Enter the robots that come into cells (1), or remove them (0)."""
    robots = world.robots
    for i in range(robots.cell.shape[0]):
        if is_between_cells(robots, i):
            mark_claim(world, i, robots.identity[U(i)] if value else NIL)


@kernel
def is_between_cells(robots, i):
    """Whether robot i is in a move of several ticks; a turn in a cell for two claims its own cell."""
    cell, claim = robots.cell[U(i)], robots.claim[U(i)]
    return cell != NIL and claim != NIL and claim != cell


@kernel
def hand_on(world, i):
    """Let the moves behind robot i end no sooner than its own."""
    robots = world.robots
    while True:
        cell, travel = np.int64(robots.cell[U(i)]), np.int64(robots.travel[U(i)])
        lane = lane_of(np.int64(world.grid.cell_flags[U(cell)]), travel)
        if lane == NIL or world.traffic.holder[U(cell), U(lane)] == NIL:
            return
        behind = np.int64(robots.at_index[U(world.traffic.holder[U(cell), U(lane)])])
        ticks = np.int64(robots.busy[U(i)]) - np.int64(robots.busy[U(behind)])
        if ticks <= 0:
            return
        put_off_end(world, behind, ticks)
        i = behind


@kernel
def put_off_end(world, i, ticks):
    """The move of robot i ends so many ticks later, which it loses to following."""
    robots, traffic = world.robots, world.traffic
    robots.busy[U(i)] += np.uint16(ticks)
    if ticks:
        count_following(world, i, ticks)
    last = world.clock[CLOCK_TICK] + np.int64(robots.busy[U(i)]) - 1
    way = direction_between(world.grid, np.int64(robots.cell[U(i)]), np.int64(robots.claim[U(i)]))
    traffic.leaving[U(own_resource(robots, traffic, i))] = (last << 2) | way


@kernel
def find_last_hash(world):
    """The hash up to which robots begin delays in this tick, 0: none does."""
    robots, delays, rules = world.robots, world.delays, world.rules
    drawn_in, count, able = world.clock[CLOCK_COARSE_TICK], 0, 0
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[U(identity)])
        if robots.cell[U(i)] == NIL or robots.status[U(i)] > STATUS_EXHAUSTED:
            continue
        if delays.until[U(identity)] >= world.clock[CLOCK_TICK]:
            continue
        delays.hash[U(able)] = random_bits(rules.seed, STREAM_DELAYS, drawn_in, identity)
        able += 1
        bits = random_bits(rules.seed, STREAM_DELAY_COUNTS, drawn_in, identity) >> np.uint64(32)
        for k in range(delays.counts.shape[0]):
            count += np.int64(np.int64(bits) >= delays.counts[U(k)])
    return least_hash(delays.hash, able, min(count, able))


@kernel
def least_hash(hashes, able, count):
    """The least number that is not less than `count` of the first `able` hashes; 0 for none."""
    result = np.uint64(0)
    if count == 0:
        return result
    for k in range(64):
        bit = np.uint64(1) << np.uint64(63 - k)
        below = result | (bit - np.uint64(1))
        within = 0
        for entry in range(able):
            within += np.int64(hashes[U(entry)] <= below)
        if within < count:
            result |= bit
    return result


@kernel
def is_held_up(world, i):
    """Whether robot i stands because it is delayed, between two operations or in one."""
    delays, robots = world.delays, world.robots
    if delays.until.shape[0] == 0 or robots.parked[U(i)]:
        return False
    if delays.until[U(robots.identity[U(i)])] < world.clock[CLOCK_TICK]:
        return False
    action = np.int64(robots.action[U(i)])
    return action == ACTION_DELAYED or delays.lengthens[U(action)] != 0
