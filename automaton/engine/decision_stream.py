"""The decisions of strategies as a stream of numbers: kept while a run goes on, given again in a replay.

    tick * 8 + phase (entry of LAYER_SEQUENCE) | identity * 65,536 + number of values | values ...

in the order in which they entered the world; decisions that are as they began (KEEP) are left out.
Values: the fields of a decision as declared in automaton.engine.state; for zoning see
automaton.engine.zoning_decision_stream; before the decisions of allocation, plans (PLAN_WORDS times the
number of orders, the orders); for routing the steps, then 31 directions of 2 bits each, or -1 for an
illegal route.
"""

import numpy as np

from automaton.engine.batches import allocation_of
from automaton.engine.commit import is_drivable, may_set_order_queue
from automaton.engine.jit.field_kernels import appending, decision_values, reading
from automaton.engine.jit.fields import CONSTANT, field
from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import Struct
from automaton.engine.state import (
    CLOCK_DECISION_WORDS,
    CLOCK_PHASE,
    CLOCK_TICK,
    KEEP,
    LAYER_ALLOCATION,
    LAYER_CHARGING,
    LAYER_RIGHT_OF_WAY,
    LAYER_ROUTING,
    LAYER_ZONING,
    NIL,
    AllocationDecisions,
    Array,
    ChargingDecisions,
    RightOfWayDecisions,
)
from automaton.engine.zoning_decision_stream import keep_zoning, repeat_zoning

PHASE_BITS = 3
COUNT_BITS = 16
STEPS_PER_WORD = 31  # directions in a word
ILLEGAL_ROUTE = -1
ILLEGAL_PLAN = -1

# Values of a decision.
CHARGING_WORDS = len(decision_values(ChargingDecisions))
ALLOCATION_WORDS = len(decision_values(AllocationDecisions))
RIGHT_OF_WAY_WORDS = len(decision_values(RightOfWayDecisions))
PLAN_WORDS = ALLOCATION_WORDS + 1  # of a plan, its orders aside: longer than any other decision

append_charging, read_charging = appending(ChargingDecisions), reading(ChargingDecisions)
append_allocation, read_allocation = appending(AllocationDecisions), reading(AllocationDecisions)
append_right_of_way = appending(RightOfWayDecisions)
read_right_of_way = reading(RightOfWayDecisions)


@kernel
def key_of(world):
    """What the words of the decisions that are given now begin with."""
    return (world.clock[CLOCK_TICK] << PHASE_BITS) | world.clock[CLOCK_PHASE]


@kernel
def max_words(longest_route, longest_plan):
    """Words that the decisions about one robot may take in a tick."""
    values = 1 + 2 * CHARGING_WORDS + ALLOCATION_WORDS + PLAN_WORDS + longest_plan
    return (
        2 * 7
        + values
        + 1
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
    for k in range(batch.count[0]):
        at = world.clock[CLOCK_DECISION_WORDS]
        size = put(world, record.decisions, at + 2, batch, decisions, layer, k)
        if size:
            identity = np.int64(world.robots.identity[batch.robot[k]])
            record.decisions[at] = key_of(world)
            record.decisions[at + 1] = (identity << COUNT_BITS) | size
            world.clock[CLOCK_DECISION_WORDS] = at + 2 + size


@kernel
def keep_plans(world, record, batch, out):
    """Append the plans that allocation made, by identity."""
    for identity in range(world.robots.cell.shape[0]):
        i = np.int64(world.robots.at_index[identity])
        count = np.int64(out.order_queue_length[i])
        if count == KEEP or not may_set_order_queue(world, batch, i):
            continue
        count = count if 0 <= count <= world.robots.order_queue.shape[1] else ILLEGAL_PLAN
        at = world.clock[CLOCK_DECISION_WORDS]
        size = PLAN_WORDS + max(count, 0)
        record.decisions[at] = key_of(world)
        record.decisions[at + 1] = (identity << COUNT_BITS) | size
        for k in range(PLAN_WORDS):
            record.decisions[at + 2 + k] = count
        for k in range(count):
            record.decisions[at + 2 + PLAN_WORDS + k] = out.order_queue[i, k]
        world.clock[CLOCK_DECISION_WORDS] = at + 2 + size


@kernel
def words_until(words, end, tick):
    """How many of the first `end` words tell of ticks up to `tick`."""
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
    """Write the values of decision k; returns how many there are, 0 for KEEP."""
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
    if route_length < 0 or not is_drivable(world, i, out.steps[k], route_length):
        words[at] = ILLEGAL_ROUTE
        return 1
    words[at] = route_length
    for first in range(0, route_length, STEPS_PER_WORD):
        packed = 0
        for s in range(min(STEPS_PER_WORD, route_length - first)):
            packed |= np.int64(out.steps[k, first + s]) << (2 * s)
        words[at + 1 + first // STEPS_PER_WORD] = packed
    return 1 + (route_length + STEPS_PER_WORD - 1) // STEPS_PER_WORD


class ReplayState(Struct):
    """What a layer that decides as recorded goes through."""

    layer: int = field("int64")
    words: Array = field("(w,) int64", "the stream of decisions", role=CONSTANT)
    cursor: Array = field("(1,) int64", "words given")
    end: Array = field("(1,) int64", "words in the stream")


@kernel
def repeat(view, batch, decisions, memory, workspace):
    """Decide as recorded."""
    state = ReplayState.of(memory)
    layer, words = state.layer, state.words
    key = key_of(view)
    at, end = state.cursor[0], state.end[0]
    if layer == LAYER_ZONING:
        state.cursor[0] = repeat_zoning(view, batch, decisions.zoning, words, at, end, key)
        return
    for k in range(batch.count[0]):
        if layer == LAYER_ALLOCATION:
            # Of robots that were asked one by one, each plan stands by its decision.
            at = skip_others(view, batch, words, at, end, key)
            at = repeat_plans(view, decisions.allocation, words, at, end, key)
        # Earlier ticks, and other layers of this one.
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
    state.cursor[0] = at


@kernel
def skip_others(view, batch, words, at, end, key):
    """Where words begin that are not of robots with another allocation, whose are behind one another."""
    several = view.rules.allocations > 1
    while several and at + 1 < end and words[at] <= key:
        identity, size = words[at + 1] >> COUNT_BITS, words[at + 1] & ((1 << COUNT_BITS) - 1)
        if words[at] == key and 0 <= identity < view.robots.cell.shape[0]:
            i = np.int64(view.robots.at_index[identity])
            if allocation_of(view, i) == batch.strategy[0]:
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
    """How many values a recorded decision has at least."""
    if layer == LAYER_CHARGING:
        return CHARGING_WORDS
    if layer == LAYER_ALLOCATION:
        return ALLOCATION_WORDS
    return RIGHT_OF_WAY_WORDS if layer == LAYER_RIGHT_OF_WAY else 1


@kernel
def give(words, at, size, decisions, layer, k):
    """Enter so many recorded values as decision k."""
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
    length = words[at]
    if length > min(out.steps.shape[1], STEPS_PER_WORD * (size - 1)):
        length = ILLEGAL_ROUTE  # the recording was altered
    out.route_length[k] = length
    for s in range(length):
        out.steps[k, s] = (words[at + 1 + s // STEPS_PER_WORD] >> (2 * (s % STEPS_PER_WORD))) & 3
