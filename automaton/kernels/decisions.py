"""The answers of strategies as a stream of numbers: kept while a run goes on, given again in a replay.

    tick * 8 + phase (entry of SEQUENCE) | identity * 65,536 + number of values | values ...

in the order in which they entered the world; robots that were asked and got KEEP are left out.
Values: zoning (automaton.kernels.zoning_decisions), charging (stand, level, yields), allocation
(verb, order, slot, stand, try_drop, ask_again) and, before these answers, plans (PLAN_WORDS times
the number of orders, the orders), routing (steps, then 31 directions of 2 bits each; -1 for an
illegal route), right of way (verb, value, release, priority).
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.commit import is_drivable, may_plan
from automaton.kernels.zoning_decisions import keep_zoning, repeat_zoning
from automaton.world.state import (
    ALLOCATION,
    CHARGING,
    DECIDED,
    KEEP,
    NIL,
    PHASE,
    RIGHT_OF_WAY,
    ROUTING,
    TICK,
    ZONING,
)

PHASE_BITS = 3
COUNT_BITS = 16
STEPS = 31  # directions in a word
CURSOR = 0  # columns of a replaying strategy's memory.own
END = 1
ILLEGAL_ROUTE = -1
ILLEGAL_PLAN = -1
ANSWER_WORDS = 6  # values of an answer of allocation
PLAN_WORDS = 7  # values of a plan, its orders aside


@kernel
def key_of(world):
    """What the words of the answers that are given now begin with."""
    return (world.clock[TICK] << PHASE_BITS) | world.clock[PHASE]


@kernel
def most_words(longest_route, longest_plan):
    """Words that the decisions about one robot may take in a tick."""
    heads, values = 2 * 7, 1 + 2 * 3 + ANSWER_WORDS + PLAN_WORDS + longest_plan + 1 + 4
    return heads + values + (longest_route + STEPS - 1) // STEPS


@kernel
def keep_decisions(world, record, asked, answers, layer):
    """Append the answers of one call, before they are committed."""
    if layer == ZONING:
        keep_zoning(world, record, asked, answers.zoning, key_of(world))
        return
    if layer == ALLOCATION:
        keep_plans(world, record, asked, answers.allocation)
    for k in range(asked.count[0]):
        at = world.clock[DECIDED]
        size = put(world, record.decisions, at + 2, asked, answers, layer, k)
        if size:
            identity = np.int64(world.robots.identity[asked.robot[k]])
            record.decisions[at] = key_of(world)
            record.decisions[at + 1] = (identity << COUNT_BITS) | size
            world.clock[DECIDED] = at + 2 + size


@kernel
def keep_plans(world, record, asked, given):
    """Append the plans that allocation made, by identity."""
    for identity in range(world.robots.cell.shape[0]):
        i = np.int64(world.robots.at_index[identity])
        count = np.int64(given.planned[i])
        if count == KEEP or not may_plan(world, asked, i):
            continue
        count = count if 0 <= count <= world.robots.plan.shape[1] else ILLEGAL_PLAN
        at = world.clock[DECIDED]
        size = PLAN_WORDS + max(count, 0)
        record.decisions[at] = key_of(world)
        record.decisions[at + 1] = (identity << COUNT_BITS) | size
        for k in range(PLAN_WORDS):
            record.decisions[at + 2 + k] = count
        for k in range(count):
            record.decisions[at + 2 + PLAN_WORDS + k] = given.plan[i, k]
        world.clock[DECIDED] = at + 2 + size


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
def put(world, words, at, asked, answers, layer, k):
    """Write the values of answer k; returns how many there are, 0 for KEEP."""
    if layer == CHARGING:
        words[at] = answers.charging.stand[k]
        words[at + 1] = answers.charging.level[k]
        words[at + 2] = answers.charging.yields[k]
        return 0 if answers.charging.stand[k] == KEEP else 3
    if layer == ALLOCATION:
        given = answers.allocation
        words[at] = given.verb[k]
        words[at + 1] = given.order[k]
        words[at + 2] = given.slot[k]
        words[at + 3] = given.stand[k]
        words[at + 4] = given.try_drop[k]
        words[at + 5] = given.ask_again[k]
        return 0 if given.verb[k] == KEEP and given.ask_again[k] == 0 else 6
    if layer == ROUTING:
        return put_route(world, words, at, np.int64(asked.robot[k]), answers.routing, k)
    given = answers.right_of_way
    words[at] = given.verb[k]
    words[at + 1] = given.value[k]
    words[at + 2] = given.release[k]
    words[at + 3] = given.priority[k]
    return 0 if given.verb[k] == KEEP and given.priority[k] == KEEP else 4


@kernel
def put_route(world, words, at, i, given, k):
    length = np.int64(given.length[k])
    if length == KEEP:
        return 0
    if length < 0 or not is_drivable(world, i, given.steps[k], length):
        words[at] = ILLEGAL_ROUTE
        return 1
    words[at] = length
    for first in range(0, length, STEPS):
        packed = 0
        for s in range(min(STEPS, length - first)):
            packed |= np.int64(given.steps[k, first + s]) << (2 * s)
        words[at + 1 + first // STEPS] = packed
    return 1 + (length + STEPS - 1) // STEPS


@kernel
def repeat(view, asked, answers, memory, space):
    """Decide as recorded. memory: parameters (layer), shared the stream, own[0] CURSOR and END."""
    layer = memory.parameters[0]
    key = key_of(view)
    words = memory.shared
    at, end = memory.own[0, CURSOR], memory.own[0, END]
    if layer == ZONING:
        memory.own[0, CURSOR] = repeat_zoning(view, asked, answers.zoning, words, at, end, key)
        return
    for k in range(asked.count[0]):
        if (
            layer == ALLOCATION
        ):  # of robots that were asked one by one, each plan stands by its answer
            at = repeat_plans(view, answers.allocation, words, at, end, key)
        # Earlier ticks, and other layers of this one.
        while at + 1 < end and words[at] < key:
            at += 2 + (words[at + 1] & ((1 << COUNT_BITS) - 1))
        if at + 1 >= end or words[at] != key:
            break
        if words[at + 1] >> COUNT_BITS == view.robots.identity[asked.robot[k]]:
            size = words[at + 1] & ((1 << COUNT_BITS) - 1)
            if at + 2 + size > end or size < fewest_values(layer):
                break  # the recording was altered
            give(words, at + 2, size, answers, layer, k)
            at += 2 + size
    memory.own[0, CURSOR] = at


@kernel
def repeat_plans(view, given, words, at, end, key):
    """Enter the recorded plans of this tick; returns where its answers begin."""
    robots = view.robots
    while at + 1 < end and words[at] <= key:
        size = words[at + 1] & ((1 << COUNT_BITS) - 1)
        if words[at] == key and (size < PLAN_WORDS or at + 2 + size > end):
            return at
        if words[at] == key:
            identity = words[at + 1] >> COUNT_BITS
            if 0 <= identity < robots.cell.shape[0]:
                give_plan(robots, given, words, at + 2, size, np.int64(robots.at_index[identity]))
        at += 2 + size
    return at


@kernel
def give_plan(robots, given, words, at, size, i):
    count = size - PLAN_WORDS
    given.planned[i] = words[at] if words[at] < 0 else count
    for k in range(min(count, robots.plan.shape[1])):
        given.plan[i, k] = words[at + PLAN_WORDS + k]


@kernel
def fewest_values(layer):
    """How many values a recorded answer has at least."""
    if layer == CHARGING:
        return 3
    if layer == ALLOCATION:
        return ANSWER_WORDS
    return 4 if layer == RIGHT_OF_WAY else 1


@kernel
def give(words, at, size, answers, layer, k):
    """Enter so many recorded values as answer k."""
    if layer == CHARGING:
        answers.charging.stand[k] = words[at]
        answers.charging.level[k] = words[at + 1]
        answers.charging.yields[k] = words[at + 2]
    elif layer == ALLOCATION:
        answers.allocation.verb[k] = words[at]
        answers.allocation.order[k] = words[at + 1]
        answers.allocation.slot[k] = words[at + 2]
        answers.allocation.stand[k] = words[at + 3]
        answers.allocation.try_drop[k] = words[at + 4]
        answers.allocation.ask_again[k] = words[at + 5]
    elif layer == ROUTING:
        give_route(words, at, size, answers.routing, k)
    else:
        answers.right_of_way.verb[k] = words[at]
        answers.right_of_way.value[k] = words[at + 1]
        answers.right_of_way.release[k] = words[at + 2]
        answers.right_of_way.priority[k] = words[at + 3]


@kernel
def give_route(words, at, size, given, k):
    length = words[at]
    if length > min(given.steps.shape[1], STEPS * (size - 1)):
        length = ILLEGAL_ROUTE  # the recording was altered
    given.length[k] = length
    for s in range(length):
        given.steps[k, s] = (words[at + 1 + s // STEPS] >> (2 * (s % STEPS))) & 3
