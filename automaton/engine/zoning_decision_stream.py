"""The decisions of zoning in the stream of decisions: robots one by one, then queues, servers, designs.

A row that is about no robot has MARK + its kind where others have an identity. With limited sight
there is one call for each robot; a replay decides all of them at once, and the last design of a
tick counts: those that are here are whole and sound (automaton.engine.zoning_commit.judge_design).

    robot:    the fields of its decision, then its message if that changes
    QUEUES:   order, queue, stop, direct; again and again
    SERVERS:  a robot for each zone
    STATIONS: a zone for each station, then zone, zone, station of each transfer station
    SEGMENT:  owner, its two ends, its points
    REFUSED:  how many decisions were illegal and are not here
"""

import numpy as np

from automaton.engine.jit.field_kernels import appending, decision_values, reading
from automaton.engine.jit.kernel import kernel
from automaton.engine.service_zones import MESSAGE_WORDS
from automaton.engine.state import CLOCK_DECISION_WORDS, KEEP, NIL, ZoningDecisions

COUNT_BITS = 16
MARK = 1 << 24
QUEUES = 0
SERVERS = 1
STATIONS = 2
SEGMENT = 3
REFUSED = 4
ROBOT_WORDS = len(decision_values(ZoningDecisions))
MAX_QUEUED = 8_000  # orders of a row

append_zoning, read_zoning = appending(ZoningDecisions), reading(ZoningDecisions)


@kernel
def max_zoning_words(world):
    """Words that the decisions of zoning may take in a tick."""
    service_zones = world.service_zones
    robots = world.robots.cell.shape[0]
    calls = 1 if world.rules.radius == NIL else robots
    words = robots * (2 + ROBOT_WORDS + MESSAGE_WORDS) + 3 * calls
    if service_zones.queue.shape[0] == 0:
        return words
    stations, points = service_zones.design.path.shape
    zones = service_zones.server.shape[0]
    orders = service_zones.queue.shape[0]
    queues = 4 * orders + 3 * (orders // MAX_QUEUED + 1)
    design = 6 + stations + 3 * zones * zones * stations + stations * (6 + points)
    return words + calls * (queues + zones + 3 + design)


@kernel
def begin_row(world, record, key, kind):
    """Leave room for the head of a row; returns where its first value goes."""
    at = world.clock[CLOCK_DECISION_WORDS]
    record.decisions[at] = key
    record.decisions[at + 1] = (MARK + kind) << COUNT_BITS
    return at + 2


@kernel
def end_row(world, record, at):
    """The row ends before word `at`."""
    begin = world.clock[CLOCK_DECISION_WORDS]
    record.decisions[begin + 1] += at - begin - 2
    world.clock[CLOCK_DECISION_WORDS] = at


@kernel
def keep_zoning(world, record, batch, out, key):
    """Append the decisions of a call of zoning, before they are committed."""
    if batch.count[0] == 0:
        return
    for k in range(batch.count[0]):
        keep_robot(world, record, batch, out, key, k)
    if out.refused[0]:
        at = begin_row(world, record, key, REFUSED)
        record.decisions[at] = out.refused[0]
        end_row(world, record, at + 1)
    if world.service_zones.queue.shape[0] == 0:
        return
    if out.redesigned[0]:
        keep_design(world, record, out.design, key)
    for zone in range(out.server.shape[0]):
        if out.server[zone] != KEEP:
            at = begin_row(world, record, key, SERVERS)
            for other in range(out.server.shape[0]):
                record.decisions[at + other] = out.server[other]
            end_row(world, record, at + out.server.shape[0])
            break
    for first in range(0, out.queued[0], MAX_QUEUED):
        at = begin_row(world, record, key, QUEUES)
        for k in range(first, min(first + MAX_QUEUED, out.queued[0])):
            record.decisions[at] = out.order[k]
            record.decisions[at + 1] = out.queue[k]
            record.decisions[at + 2] = out.next_slot[k]
            record.decisions[at + 3] = out.skips_transfer[k]
            at += 4
        end_row(world, record, at)


@kernel
def keep_robot(world, record, batch, out, key, k):
    """Append what zoning says of one robot, unless it is nothing."""
    at = world.clock[CLOCK_DECISION_WORDS]
    words = record.decisions
    size = append_zoning(out, k, words, at + 2)
    if size == 0:
        return
    if out.sends_message[k]:
        for word in range(MESSAGE_WORDS):
            words[at + 2 + size + word] = out.messages[k, word]
        size += MESSAGE_WORDS
    words[at] = key
    words[at + 1] = (np.int64(world.robots.identity[batch.robot[k]]) << COUNT_BITS) | size
    world.clock[CLOCK_DECISION_WORDS] = at + 2 + size


@kernel
def keep_design(world, record, design, key):
    words = record.decisions
    stations = design.zone.shape[0]
    at = begin_row(world, record, key, STATIONS)
    for station in range(stations):
        words[at + station] = design.zone[station]
    at += stations
    for a in range(design.transfer.shape[0]):
        for b in range(design.transfer.shape[0]):
            for station in range(stations):
                if design.transfer[a, b, station]:
                    words[at], words[at + 1], words[at + 2] = a, b, station
                    at += 3
    end_row(world, record, at)
    for segment in range(min(max(0, design.segments[0]), design.owner.shape[0])):
        at = begin_row(world, record, key, SEGMENT)
        words[at] = design.owner[segment]
        words[at + 1] = design.ends[segment, 0]
        words[at + 2] = design.ends[segment, 1]
        count = min(max(0, np.int64(design.points[segment])), design.path.shape[1])
        for k in range(count):
            words[at + 3 + k] = design.path[segment, k]
        end_row(world, record, at + 3 + count)


@kernel
def repeat_zoning(view, batch, out, words, at, end, key):
    """Decide a call as recorded; returns where the next one begins."""
    while at + 1 < end and words[at] < key:
        at += 2 + (words[at + 1] & ((1 << COUNT_BITS) - 1))
    while at + 1 < end and words[at] == key:
        size = words[at + 1] & ((1 << COUNT_BITS) - 1)
        about = words[at + 1] >> COUNT_BITS
        if at + 2 + size > end or size < 1:
            break  # the recording was altered
        if about >= MARK:
            give_row(view, out, words, at + 2, size, about - MARK)
        else:
            k = place_of(view, batch, about)
            if k != NIL:
                give_robot(out, words, at + 2, size, k)
        at += 2 + size
    return at


@kernel
def place_of(view, batch, identity):
    """Which entry of a batch a robot is, or NIL."""
    for k in range(batch.count[0]):
        if view.robots.identity[batch.robot[k]] == identity:
            return k
    return NIL


@kernel
def give_robot(out, words, at, size, k):
    if size < ROBOT_WORDS:
        return
    read_zoning(out, k, words, at)
    out.sends_message[k] = out.sends_message[k] != 0 and size == ROBOT_WORDS + MESSAGE_WORDS
    if out.sends_message[k]:
        for word in range(MESSAGE_WORDS):
            out.messages[k, word] = words[at + ROBOT_WORDS + word]


@kernel
def give_row(view, out, words, at, size, kind):
    if kind == REFUSED:
        out.refused[0] += words[at]
    if view.service_zones.queue.shape[0] == 0:
        return
    if kind == QUEUES:
        for first in range(at, at + size - 3, 4):
            k = out.queued[0]
            if k == out.order.shape[0]:
                return
            out.order[k] = words[first]
            out.queue[k] = words[first + 1]
            out.next_slot[k] = words[first + 2]
            out.skips_transfer[k] = words[first + 3]
            out.queued[0] = k + 1
    elif kind == SERVERS and size == out.server.shape[0]:
        for zone in range(size):
            if words[at + zone] != KEEP:
                out.server[zone] = words[at + zone]
    elif kind == STATIONS and size >= out.design.zone.shape[0]:
        give_stations(out, words, at, size)
    elif kind == SEGMENT and size >= 3:
        give_segment(out.design, words, at, size)


@kernel
def give_stations(out, words, at, size):
    design = out.design
    stations, zones = design.zone.shape[0], design.transfer.shape[0]
    out.redesigned[0] = 1
    design.segments[0] = 0
    design.transfer[:] = 0
    for station in range(stations):
        design.zone[station] = words[at + station]
    for first in range(at + stations, at + size - 2, 3):
        a, b, station = words[first], words[first + 1], words[first + 2]
        if 0 <= a < zones and 0 <= b < zones and 0 <= station < stations:
            design.transfer[a, b, station] = 1


@kernel
def give_segment(design, words, at, size):
    segment = design.segments[0]
    count = size - 3
    if segment >= design.owner.shape[0] or count > design.path.shape[1]:
        return
    design.owner[segment] = words[at]
    design.ends[segment, 0] = words[at + 1]
    design.ends[segment, 1] = words[at + 2]
    design.points[segment] = count
    for k in range(count):
        design.path[segment, k] = words[at + 3 + k]
    design.segments[0] = segment + 1
