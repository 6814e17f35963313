"""The loop over ticks: one compiled generator whose body is the list of the phases of a tick.

    orders -> zoning -> charging -> allocation -> routing -> right of way -> motion -> digest

A layer is asked when something concerns it: a compiled strategy is called right here; for a Python
strategy the generator yields ASK and the layer, and goes on in mid-tick when it is resumed.
"""

import numpy as np
from numba import types

from automaton.compiled import jit_is_on, kernel
from automaton.kernels.batches import (
    batch_allocation,
    batch_everybody,
    batch_right_of_way,
    batch_routing,
    clear_answers,
)
from automaton.kernels.commit import (
    commit_allocation,
    commit_charging,
    commit_right_of_way,
    commit_routing,
    commit_zoning,
)
from automaton.kernels.digest import digest_world
from automaton.kernels.drive import drive, leave_bays, settle
from automaton.kernels.motion import move_all
from automaton.world.state import (
    ALLOCATION,
    CHANGED,
    CHARGING,
    FINISHED,
    RECORDED,
    RECORDING,
    RIGHT_OF_WAY,
    ROUTING,
    STOP_DELIVERED,
    STOP_PARKED,
    TICK,
    UNDELIVERED,
    UNPARKED,
    UNTIL,
    ZONING,
)

# What the generator yields: the layer (0..4) that a Python strategy has to decide for, or PAUSE.
PAUSE = 5

ABSENT = 0  # how a layer is served
COMPILED = 1
INTERPRETED = 2


def ticks(
    world, view, asked, answers, record, space, serving,
    zoning, charging, allocation, routing, right_of_way,
    memory_z, memory_c, memory_a, memory_r, memory_w,
):  # fmt: skip
    """Run ticks until world.clock[UNTIL]; pauses there, when a buffer is full, and at the end."""
    clock = world.clock
    while True:
        if clock[TICK] >= clock[UNTIL] or clock[FINISHED] or is_full(clock, record):
            yield PAUSE
            continue
        clock[TICK] += 1
        world.robots.did[:] = 0

        if serving[ZONING] and batch_everybody(world, asked, ZONING):
            clear_answers(asked, answers, ZONING)
            if serving[ZONING] == COMPILED:
                zoning(view, asked, answers, memory_z, space)
            else:
                yield ZONING
            commit_zoning(world, record, asked, answers)

        if serving[CHARGING] and batch_everybody(world, asked, CHARGING):
            clear_answers(asked, answers, CHARGING)
            if serving[CHARGING] == COMPILED:
                charging(view, asked, answers, memory_c, space)
            else:
                yield CHARGING
            commit_charging(world, record, asked, answers)

        if batch_allocation(world, asked):
            clear_answers(asked, answers, ALLOCATION)
            if serving[ALLOCATION] == COMPILED:
                allocation(view, asked, answers, memory_a, space)
            else:
                yield ALLOCATION
            commit_allocation(world, record, asked, answers)

        if batch_routing(world, asked):
            clear_answers(asked, answers, ROUTING)
            if serving[ROUTING] == COMPILED:
                routing(view, asked, answers, memory_r, space)
            else:
                yield ROUTING
            commit_routing(world, record, asked, answers)

        if batch_right_of_way(world, asked):
            clear_answers(asked, answers, RIGHT_OF_WAY)
            if serving[RIGHT_OF_WAY] == COMPILED:
                right_of_way(view, asked, answers, memory_w, space)
            else:
                yield RIGHT_OF_WAY
            commit_right_of_way(world, record, asked, answers)

        motion(world, record)
        if clock[RECORDING]:
            write_record(world, record)
        clock[FINISHED] = is_finished(world)


@kernel
def silence(view, asked, answers, memory, space):
    """Stands in for the function of a layer that is absent or decides in Python."""


@kernel
def motion(world, record):
    """Bays, intents and operations, the occupancy rules, and what comes of them."""
    if world.clock[UNPARKED] < world.robots.cell.shape[0]:
        leave_bays(world)
    drive(world, record)
    move_all(world.grid, world.rules, world.robots, world.traffic, world.clock[TICK])
    settle(world, record)


@kernel
def is_full(clock, record):
    """Whether another tick might not fit into the buffers of a recording."""
    if clock[RECORDING] == 0:
        return False
    if clock[RECORDED] >= record.did.shape[0]:
        return True
    return clock[CHANGED] + 8 * record.did.shape[1] + 8 > record.changes.shape[0]


@kernel
def write_record(world, record):
    """Keep what was committed in this tick, by identity, and the digests after it."""
    row = world.clock[RECORDED]
    for i in range(world.robots.did.shape[0]):
        record.did[row, world.robots.identity[i]] = world.robots.did[i]
    digest_world(world, record.digests[row], record.values)
    world.clock[RECORDED] = row + 1


@kernel
def is_finished(world):
    clock = world.clock
    if clock[UNDELIVERED] > 0:
        return 0
    if world.rules.stop == STOP_PARKED:
        return 1 if clock[UNPARKED] == 0 else 0
    return 1 if world.rules.stop == STOP_DELIVERED else 0


def compile_loop(world, view, asked, answers, record, space, serving, memory):
    """The generator function for arguments of these types, and the signature of `decide`."""
    if not jit_is_on():
        return ticks, None
    from numba import typeof

    decide = types.void(*(typeof(x) for x in (view, asked, answers, memory, space)))
    layer = types.FunctionType(decide)
    arguments = tuple(typeof(x) for x in (world, view, asked, answers, record, space, serving))
    signature = (*arguments, *([layer] * 5), *([typeof(memory)] * 5))
    return kernel(ticks, signature=signature), decide
