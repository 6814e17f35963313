"""The answers of zoning in the stream of decisions: robots one by one, then queues, servers, designs.

A row that is about no robot has MARK + its kind where others have an identity. With limited sight there
is one call for each robot; a replay answers all of them at once, and the last design of a tick counts:
those that are here are whole and sound (automaton.kernels.zoning.judge_design).

    robot:    zone, halt, again, tells, then what it says if it tells something new
    QUEUES:   order, queue, stop, direct; again and again
    SERVERS:  a robot for each zone
    STATIONS: a zone for each station, then zone, zone, station of each transfer station
    SEGMENT:  owner, its two ends, its points
    REFUSED:  how many answers were illegal and are not here
"""

import numpy as np

from automaton.compiled import kernel
from automaton.world.partition import SAID
from automaton.world.state import DECIDED, KEEP, NIL

COUNT_BITS = 16
MARK = 1 << 24
QUEUES = 0
SERVERS = 1
STATIONS = 2
SEGMENT = 3
REFUSED = 4
ROBOT_WORDS = 4
MOST_QUEUED = 8_000  # orders of a row


@kernel
def most_zoning_words(world):
    """Words that the decisions of zoning may take in a tick."""
    zoning = world.zoning
    robots = world.robots.cell.shape[0]
    calls = 1 if world.rules.radius == NIL else robots
    words = robots * (2 + ROBOT_WORDS + SAID) + 3 * calls
    if zoning.queue.shape[0] == 0:
        return words
    stations, points = zoning.design.path.shape
    zones = zoning.server.shape[0]
    orders = zoning.queue.shape[0]
    queues = 4 * orders + 3 * (orders // MOST_QUEUED + 1)
    design = 6 + stations + 3 * zones * zones * stations + stations * (6 + points)
    return words + calls * (queues + zones + 3 + design)


@kernel
def begin_row(world, record, key, kind):
    """Leave room for the head of a row; returns where its first value goes."""
    at = world.clock[DECIDED]
    record.decisions[at] = key
    record.decisions[at + 1] = (MARK + kind) << COUNT_BITS
    return at + 2


@kernel
def end_row(world, record, at):
    """The row ends before word `at`."""
    begin = world.clock[DECIDED]
    record.decisions[begin + 1] += at - begin - 2
    world.clock[DECIDED] = at


@kernel
def keep_zoning(world, record, asked, given, key):
    """Append the answers of a call of zoning, before they are committed."""
    if asked.count[0] == 0:
        return
    for k in range(asked.count[0]):
        keep_robot(world, record, asked, given, key, k)
    if given.refused[0]:
        at = begin_row(world, record, key, REFUSED)
        record.decisions[at] = given.refused[0]
        end_row(world, record, at + 1)
    if world.zoning.queue.shape[0] == 0:
        return
    if given.redesigned[0]:
        keep_design(world, record, given.design, key)
    for zone in range(given.server.shape[0]):
        if given.server[zone] != KEEP:
            at = begin_row(world, record, key, SERVERS)
            for other in range(given.server.shape[0]):
                record.decisions[at + other] = given.server[other]
            end_row(world, record, at + given.server.shape[0])
            break
    for first in range(0, given.queued[0], MOST_QUEUED):
        at = begin_row(world, record, key, QUEUES)
        for k in range(first, min(first + MOST_QUEUED, given.queued[0])):
            record.decisions[at] = given.order[k]
            record.decisions[at + 1] = given.queue[k]
            record.decisions[at + 2] = given.stop[k]
            record.decisions[at + 3] = given.direct[k]
            at += 4
        end_row(world, record, at)


@kernel
def keep_robot(world, record, asked, given, key, k):
    """Append what zoning says of one robot, unless it is nothing."""
    silent = given.zone[k] == KEEP and given.halt[k] == KEEP and given.again[k] == KEEP
    if silent and given.tells[k] == 0:
        return
    at = world.clock[DECIDED]
    words = record.decisions
    size = ROBOT_WORDS + (SAID if given.tells[k] else 0)
    words[at] = key
    words[at + 1] = (np.int64(world.robots.identity[asked.robot[k]]) << COUNT_BITS) | size
    words[at + 2] = given.zone[k]
    words[at + 3] = given.halt[k]
    words[at + 4] = given.again[k]
    words[at + 5] = given.tells[k]
    for word in range(size - ROBOT_WORDS):
        words[at + 6 + word] = given.said[k, word]
    world.clock[DECIDED] = at + 2 + size


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
def repeat_zoning(view, asked, given, words, at, end, key):
    """Answer a call as recorded; returns where the next one begins."""
    while at + 1 < end and words[at] < key:
        at += 2 + (words[at + 1] & ((1 << COUNT_BITS) - 1))
    while at + 1 < end and words[at] == key:
        size = words[at + 1] & ((1 << COUNT_BITS) - 1)
        about = words[at + 1] >> COUNT_BITS
        if at + 2 + size > end or size < 1:
            break  # the recording was altered
        if about >= MARK:
            give_row(view, given, words, at + 2, size, about - MARK)
        else:
            k = place_of(view, asked, about)
            if k != NIL:
                give_robot(given, words, at + 2, size, k)
        at += 2 + size
    return at


@kernel
def place_of(view, asked, identity):
    """Which entry of a batch a robot is, or NIL."""
    for k in range(asked.count[0]):
        if view.robots.identity[asked.robot[k]] == identity:
            return k
    return NIL


@kernel
def give_robot(given, words, at, size, k):
    if size < ROBOT_WORDS:
        return
    given.zone[k] = words[at]
    given.halt[k] = words[at + 1]
    given.again[k] = words[at + 2]
    if words[at + 3] and size == ROBOT_WORDS + SAID:
        given.tells[k] = 1
        for word in range(SAID):
            given.said[k, word] = words[at + 4 + word]


@kernel
def give_row(view, given, words, at, size, kind):
    if kind == REFUSED:
        given.refused[0] += words[at]
    if view.zoning.queue.shape[0] == 0:
        return
    if kind == QUEUES:
        for first in range(at, at + size - 3, 4):
            k = given.queued[0]
            if k == given.order.shape[0]:
                return
            given.order[k] = words[first]
            given.queue[k] = words[first + 1]
            given.stop[k] = words[first + 2]
            given.direct[k] = words[first + 3]
            given.queued[0] = k + 1
    elif kind == SERVERS and size == given.server.shape[0]:
        for zone in range(size):
            if words[at + zone] != KEEP:
                given.server[zone] = words[at + zone]
    elif kind == STATIONS and size >= given.design.zone.shape[0]:
        give_stations(given, words, at, size)
    elif kind == SEGMENT and size >= 3:
        give_segment(given.design, words, at, size)


@kernel
def give_stations(given, words, at, size):
    design = given.design
    stations, zones = design.zone.shape[0], design.transfer.shape[0]
    given.redesigned[0] = 1
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
