"""The decisions of strategies as a stream of numbers: recorded during a run, fed back in a replay.

    tick * 8 + phase (entry of LAYER_SEQUENCE) | identity * 65,536 + number of values | values ...

in the order in which they entered the world; unchanged decisions (KEEP) are left out. Values: the
fields of a decision as declared in automaton.engine.state. Plans (PLAN_WORDS times the number of
orders, the orders) come before the decisions of allocation. A route has its number of steps, then
31 directions of 2 bits per word; an illegal one has -1, its length, the place and direction of its
illegal step (or NIL), and the steps before. A zoning decision about a robot is
followed by its message if that changes; a zoning row about no robot has ROW_MARK + its kind in
place of an identity. Under limited sight zoning is called for each robot; a replay decides for all
robots at once, and the last design of a tick counts: recorded designs are complete and valid
(`judge_zoning`).
"""

import numpy as np

from automaton.engine.batches import allocation_of, may_set_order_queue
from automaton.engine.decisions import (
    AllocationDecisions,
    ChargingDecisions,
    RightOfWayDecisions,
    ZoningDecisions,
)
from automaton.engine.facilities import MESSAGE_WORDS
from automaton.engine.jit.field_kernels import appending, decision_values, reading
from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import CONSTANT, Struct, field
from automaton.engine.operations import route_flaw
from automaton.engine.refusals import RULE_ROUTE_LENGTH, RULE_ZONING, STEP_BITS
from automaton.engine.state import (
    KEEP,
    LAYER_ALLOCATION,
    LAYER_CHARGING,
    LAYER_RIGHT_OF_WAY,
    LAYER_ROUTING,
    LAYER_ZONING,
    NIL,
    Array,
)

PHASE_BITS = 3
COUNT_BITS = 16
STEPS_PER_WORD = 31  # directions per word
ILLEGAL_ROUTE = -1
ILLEGAL_WORDS = 4  # of an illegal route without its steps
ILLEGAL_PLAN = -1

# Values of a decision.
CHARGING_WORDS = len(decision_values(ChargingDecisions))
ALLOCATION_WORDS = len(decision_values(AllocationDecisions))
RIGHT_OF_WAY_WORDS = len(decision_values(RightOfWayDecisions))
PLAN_WORDS = ALLOCATION_WORDS + 1  # of a plan without its orders: longer than any other decision

append_charging, read_charging = appending(ChargingDecisions), reading(ChargingDecisions)
append_allocation, read_allocation = appending(AllocationDecisions), reading(AllocationDecisions)
append_right_of_way = appending(RightOfWayDecisions)
read_right_of_way = reading(RightOfWayDecisions)


@kernel
def key_of(world):
    """The first part of the head of the decisions made now."""
    return (world.clock.tick << PHASE_BITS) | world.clock.phase


@kernel
def max_words(longest_route, longest_plan):
    """Words that the decisions about one robot may take in a tick."""
    values = 1 + 2 * CHARGING_WORDS + ALLOCATION_WORDS + PLAN_WORDS + longest_plan
    return (
        2 * 7
        + values
        + ILLEGAL_WORDS
        + RIGHT_OF_WAY_WORDS
        + (longest_route + STEPS_PER_WORD - 1) // STEPS_PER_WORD
    )


@kernel
def keep_decisions(world, record, batch, decisions, layer):
    """Append the decisions of one call, before they are committed."""
    if layer == LAYER_ZONING:
        keep_zoning(world, record, batch, decisions.zoning, key_of(world))
        return
    if layer == LAYER_ALLOCATION:
        keep_plans(world, record, batch, decisions.allocation)
    for k in range(batch.count):
        at = world.clock.decision_words
        size = put(world, record.decisions, at + 2, batch, decisions, layer, k)
        if size:
            identity = np.int64(world.robots.identity[batch.robot[k]])
            record.decisions[at] = key_of(world)
            record.decisions[at + 1] = (identity << COUNT_BITS) | size
            world.clock.decision_words = at + 2 + size


@kernel
def keep_plans(world, record, batch, out):
    """Append the plans made by allocation, by identity."""
    for identity in range(world.robots.cell.shape[0]):
        i = np.int64(world.robots.at_index[identity])
        count = np.int64(out.order_queue_length[i])
        if count == KEEP or not may_set_order_queue(world, batch, i):
            continue
        count = count if 0 <= count <= world.robots.order_queue.shape[1] else ILLEGAL_PLAN
        at = world.clock.decision_words
        size = PLAN_WORDS + max(count, 0)
        record.decisions[at] = key_of(world)
        record.decisions[at + 1] = (identity << COUNT_BITS) | size
        for k in range(PLAN_WORDS):
            record.decisions[at + 2 + k] = count
        for k in range(count):
            record.decisions[at + 2 + PLAN_WORDS + k] = out.order_queue[i, k]
        world.clock.decision_words = at + 2 + size


@kernel
def words_until(words, end, tick):
    """How many of the first `end` words belong to ticks up to `tick`."""
    at = 0
    while at < end and words[at] >> PHASE_BITS <= tick:
        at += 2 + (words[at + 1] & ((1 << COUNT_BITS) - 1))
    return min(at, end)


@kernel
def first_other_tick(words, others):
    """The tick of the first decision in which two streams differ."""
    both = min(words.shape[0], others.shape[0])
    at = 0
    while at + 1 < both:
        if words[at] != others[at]:
            return min(words[at], others[at]) >> PHASE_BITS
        following = at + 2 + (words[at + 1] & ((1 << COUNT_BITS) - 1))
        for k in range(at + 1, following):
            if k >= both or words[k] != others[k]:
                return words[at] >> PHASE_BITS
        at = following
    longer = words if words.shape[0] > others.shape[0] else others
    return longer[at] >> PHASE_BITS if at < longer.shape[0] else NIL


@kernel
def put(world, words, at, batch, decisions, layer, k):
    """Write the values of decision k; returns their number, 0 for KEEP."""
    if layer == LAYER_CHARGING:
        return append_charging(decisions.charging, k, words, at)
    if layer == LAYER_ALLOCATION:
        return append_allocation(decisions.allocation, k, words, at)
    if layer == LAYER_ROUTING:
        return put_route(world, words, at, np.int64(batch.robot[k]), decisions.routing, k)
    return append_right_of_way(decisions.right_of_way, k, words, at)


@kernel
def put_route(world, words, at, i, out, k):
    route_length = np.int64(out.route_length[k])
    if route_length == KEEP:
        return 0
    rule, value = route_flaw(world, i, out.steps[k], route_length)
    if rule == NIL:
        words[at] = route_length
        return 1 + put_steps(words, at + 1, out.steps[k], route_length)
    legal = np.int64(0) if rule == RULE_ROUTE_LENGTH else value >> STEP_BITS
    words[at] = ILLEGAL_ROUTE
    words[at + 1] = route_length
    words[at + 2] = NIL if rule == RULE_ROUTE_LENGTH else legal
    words[at + 3] = value & ((1 << STEP_BITS) - 1)
    return ILLEGAL_WORDS + put_steps(words, at + ILLEGAL_WORDS, out.steps[k], legal)


@kernel
def put_steps(words, at, steps, count):
    """Write the first steps of a route; returns the number of words."""
    for first in range(0, count, STEPS_PER_WORD):
        packed = 0
        for s in range(min(STEPS_PER_WORD, count - first)):
            packed |= np.int64(steps[first + s]) << (2 * s)
        words[at + first // STEPS_PER_WORD] = packed
    return (count + STEPS_PER_WORD - 1) // STEPS_PER_WORD


class ReplayState(Struct):
    """The memory of a layer that decides as recorded."""

    layer: int = field("int64")
    words: Array = field("(w,) int64", "the stream of decisions", role=CONSTANT)
    cursor: int = field("() int64", "words recorded")
    end: int = field("() int64", "words in the stream")


@kernel
def repeat(view, batch, decisions, memory, workspace):
    """Decide as recorded."""
    state = ReplayState.of(memory)
    layer, words = state.layer, state.words
    key = key_of(view)
    at, end = state.cursor, state.end
    if layer == LAYER_ZONING:
        state.cursor = repeat_zoning(view, batch, decisions.zoning, words, at, end, key)
        return
    for k in range(batch.count):
        if layer == LAYER_ALLOCATION:
            # When robots are asked one by one, each plan is next to its decision.
            at = skip_others(view, batch, words, at, end, key)
            at = repeat_plans(view, decisions.allocation, words, at, end, key)
        # Skip earlier ticks, and other layers of this one.
        while at + 1 < end and words[at] < key:
            at += 2 + (words[at + 1] & ((1 << COUNT_BITS) - 1))
        if at + 1 >= end or words[at] != key:
            break
        if words[at + 1] >> COUNT_BITS == view.robots.identity[batch.robot[k]]:
            size = words[at + 1] & ((1 << COUNT_BITS) - 1)
            if at + 2 + size > end or size < fewest_values(layer):
                break  # the recording was altered
            give(words, at + 2, size, decisions, layer, k)
            at += 2 + size
    state.cursor = at


@kernel
def skip_others(view, batch, words, at, end, key):
    """Where the words of this allocation begin; words of each allocation are contiguous."""
    several = view.rules.allocations > 1
    while several and at + 1 < end and words[at] <= key:
        identity, size = words[at + 1] >> COUNT_BITS, words[at + 1] & ((1 << COUNT_BITS) - 1)
        if words[at] == key and 0 <= identity < view.robots.cell.shape[0]:
            i = np.int64(view.robots.at_index[identity])
            if allocation_of(view, i) == batch.strategy:
                return at
        at += 2 + size
    return at


@kernel
def repeat_plans(view, out, words, at, end, key):
    """Enter the recorded plans of this tick; returns where its decisions begin."""
    robots = view.robots
    while at + 1 < end and words[at] <= key:
        size = words[at + 1] & ((1 << COUNT_BITS) - 1)
        if words[at] == key and (size < PLAN_WORDS or at + 2 + size > end):
            return at
        if words[at] == key:
            identity = words[at + 1] >> COUNT_BITS
            if 0 <= identity < robots.cell.shape[0]:
                give_plan(robots, out, words, at + 2, size, np.int64(robots.at_index[identity]))
        at += 2 + size
    return at


@kernel
def give_plan(robots, out, words, at, size, i):
    count = size - PLAN_WORDS
    out.order_queue_length[i] = words[at] if words[at] < 0 else count
    for k in range(min(count, robots.order_queue.shape[1])):
        out.order_queue[i, k] = words[at + PLAN_WORDS + k]


@kernel
def fewest_values(layer):
    """The least number of values of a recorded decision."""
    if layer == LAYER_CHARGING:
        return CHARGING_WORDS
    if layer == LAYER_ALLOCATION:
        return ALLOCATION_WORDS
    return RIGHT_OF_WAY_WORDS if layer == LAYER_RIGHT_OF_WAY else 1


@kernel
def give(words, at, size, decisions, layer, k):
    """Enter `size` recorded values as decision k."""
    if layer == LAYER_CHARGING:
        read_charging(decisions.charging, k, words, at)
    elif layer == LAYER_ALLOCATION:
        read_allocation(decisions.allocation, k, words, at)
    elif layer == LAYER_ROUTING:
        give_route(words, at, size, decisions.routing, k)
    else:
        read_right_of_way(decisions.right_of_way, k, words, at)


@kernel
def give_route(words, at, size, out, k):
    if words[at] == ILLEGAL_ROUTE:
        give_illegal_route(words, at, size, out, k)
        return
    length = words[at]
    if length > min(out.steps.shape[1], STEPS_PER_WORD * (size - 1)):
        length = ILLEGAL_ROUTE  # the recording was altered
    out.route_length[k] = length
    give_steps(words, at + 1, out.steps[k], length)


@kernel
def give_illegal_route(words, at, size, out, k):
    """Enter an illegal route up to its illegal step."""
    out.route_length[k] = ILLEGAL_ROUTE
    if size < ILLEGAL_WORDS:
        return
    legal = words[at + 2]
    most = min(out.steps.shape[1] - 1, STEPS_PER_WORD * (size - ILLEGAL_WORDS))
    if legal == NIL and (words[at + 1] < 0 or words[at + 1] > out.steps.shape[1]):
        out.route_length[k] = words[at + 1]
    elif 0 <= legal <= most and words[at + 1] > legal:
        give_steps(words, at + ILLEGAL_WORDS, out.steps[k], legal)
        out.steps[k, legal] = words[at + 3]
        out.route_length[k] = words[at + 1]


@kernel
def give_steps(words, at, steps, count):
    for s in range(count):
        steps[s] = (words[at + s // STEPS_PER_WORD] >> (2 * (s % STEPS_PER_WORD))) & 3


# The decisions of zoning: robots one by one, then queues, servers, designs.
ROW_MARK = 1 << 24
ROW_QUEUES = 0  # order, queue, next slot, whether it skips transfer stations; repeated
ROW_SERVERS = 1  # a robot for each zone
ROW_STATIONS = 2  # a zone for each station, then zone, zone, station of each transfer station
ROW_SEGMENT = 3  # owner, its two ends, its points
ROW_REFUSED = 4  # number of illegal decisions; robot, rule and value of each: they are not stored
ROBOT_WORDS = len(decision_values(ZoningDecisions))
MAX_QUEUED = 8_000  # orders per row
REFUSED_PER_CALL = 2  # a number of queued orders, and a design

append_zoning, read_zoning = appending(ZoningDecisions), reading(ZoningDecisions)


@kernel
def max_zoning_words(world):
    """Words that the decisions of zoning may take in a tick."""
    service_zones = world.service_zones
    robots = world.robots.cell.shape[0]
    calls = 1 if world.rules.radius == NIL else robots
    words = robots * (2 + ROBOT_WORDS + MESSAGE_WORDS) + (3 + 3 * REFUSED_PER_CALL) * calls
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
    at = world.clock.decision_words
    record.decisions[at] = key
    record.decisions[at + 1] = (ROW_MARK + kind) << COUNT_BITS
    return at + 2


@kernel
def end_row(world, record, at):
    """The row ends before word `at`."""
    begin = world.clock.decision_words
    record.decisions[begin + 1] += at - begin - 2
    world.clock.decision_words = at


@kernel
def keep_zoning(world, record, batch, out, key):
    """Append the decisions of a call of zoning, before they are committed."""
    if batch.count == 0:
        return
    for k in range(batch.count):
        keep_robot(world, record, batch, out, key, k)
    if out.refused:
        keep_refusals(world, record, out, key)
    if world.service_zones.queue.shape[0] == 0:
        return
    if out.redesigned:
        keep_design(world, record, out.design, key)
    for zone in range(out.server.shape[0]):
        if out.server[zone] != KEEP:
            at = begin_row(world, record, key, ROW_SERVERS)
            for other in range(out.server.shape[0]):
                record.decisions[at + other] = out.server[other]
            end_row(world, record, at + out.server.shape[0])
            break
    for first in range(0, out.queued, MAX_QUEUED):
        at = begin_row(world, record, key, ROW_QUEUES)
        for k in range(first, min(first + MAX_QUEUED, out.queued)):
            record.decisions[at] = out.order[k]
            record.decisions[at + 1] = out.queue[k]
            record.decisions[at + 2] = out.next_slot[k]
            record.decisions[at + 3] = out.skips_transfer[k]
            at += 4
        end_row(world, record, at)


@kernel
def keep_refusals(world, record, out, key):
    """Append the illegal decisions of a call; of a replay, which decides for all calls, all."""
    calls = 1 if world.rules.radius == NIL else world.robots.cell.shape[0]
    at = begin_row(world, record, key, ROW_REFUSED)
    record.decisions[at] = out.refused
    at += 1
    for k in range(min(out.refused, REFUSED_PER_CALL * calls)):
        for part in range(3):
            record.decisions[at + part] = out.refusals[k, part]
        at += 3
    end_row(world, record, at)


@kernel
def keep_robot(world, record, batch, out, key, k):
    """Append the zoning decision about one robot, unless it is empty."""
    at = world.clock.decision_words
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
    world.clock.decision_words = at + 2 + size


@kernel
def keep_design(world, record, design, key):
    words = record.decisions
    stations = design.zone.shape[0]
    at = begin_row(world, record, key, ROW_STATIONS)
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
    for segment in range(min(max(0, design.segments), design.owner.shape[0])):
        at = begin_row(world, record, key, ROW_SEGMENT)
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
        if about >= ROW_MARK:
            give_row(view, out, words, at + 2, size, about - ROW_MARK)
        else:
            k = place_of(view, batch, about)
            if k != NIL:
                give_robot(out, words, at + 2, size, k)
        at += 2 + size
    return at


@kernel
def place_of(view, batch, identity):
    """The index of a robot in a batch, or NIL."""
    for k in range(batch.count):
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
    if kind == ROW_REFUSED:
        give_refusals(out, words, at, size)
    if view.service_zones.queue.shape[0] == 0:
        return
    if kind == ROW_QUEUES:
        for first in range(at, at + size - 3, 4):
            k = out.queued
            if k == out.order.shape[0]:
                return
            out.order[k] = words[first]
            out.queue[k] = words[first + 1]
            out.next_slot[k] = words[first + 2]
            out.skips_transfer[k] = words[first + 3]
            out.queued = k + 1
    elif kind == ROW_SERVERS and size == out.server.shape[0]:
        for zone in range(size):
            if words[at + zone] != KEEP:
                out.server[zone] = words[at + zone]
    elif kind == ROW_STATIONS and size >= out.design.zone.shape[0]:
        give_stations(out, words, at, size)
    elif kind == ROW_SEGMENT and size >= 3:
        give_segment(out.design, words, at, size)


@kernel
def give_refusals(out, words, at, size):
    """Enter recorded illegal decisions; RULE_ZONING stands for those without a rule."""
    for k in range(min(max(words[at], 0), out.refusals.shape[0] - out.refused)):
        first = at + 1 + 3 * k
        is_named = first + 3 <= at + size
        out.refusals[out.refused, 0] = words[first] if is_named else NIL
        out.refusals[out.refused, 1] = words[first + 1] if is_named else RULE_ZONING
        out.refusals[out.refused, 2] = words[first + 2] if is_named else 0
        out.refused += 1


@kernel
def give_stations(out, words, at, size):
    design = out.design
    stations, zones = design.zone.shape[0], design.transfer.shape[0]
    out.redesigned = 1
    design.segments = 0
    design.transfer[:] = 0
    for station in range(stations):
        design.zone[station] = words[at + station]
    for first in range(at + stations, at + size - 2, 3):
        a, b, station = words[first], words[first + 1], words[first + 2]
        if 0 <= a < zones and 0 <= b < zones and 0 <= station < stations:
            design.transfer[a, b, station] = 1


@kernel
def give_segment(design, words, at, size):
    segment = design.segments
    count = size - 3
    if segment >= design.owner.shape[0] or count > design.path.shape[1]:
        return
    design.owner[segment] = words[at]
    design.ends[segment, 0] = words[at + 1]
    design.ends[segment, 1] = words[at + 2]
    design.points[segment] = count
    for k in range(count):
        design.path[segment, k] = words[at + 3 + k]
    design.segments = segment + 1
