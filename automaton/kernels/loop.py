"""The loop over ticks: one compiled generator whose body is the list of the phases of a tick.

    faults -> orders -> stations -> zoning -> charging -> allocation -> charging -> routing
           -> right of way -> motion -> record -> observe

A layer is asked when something concerns it: in one call about all the robots concerned, or, with
limited sight, in one call for each of them. A compiled strategy is called right here; for a Python
strategy the generator yields ASK and the layer, and goes on in mid-tick when it is resumed.
"""

from numba import types

from automaton.compiled import jit_is_on, kernel
from automaton.kernels.batches import (
    batch_allocation,
    batch_charging,
    batch_everybody,
    batch_right_of_way,
    batch_routing,
    clear_answers,
)
from automaton.kernels.charging import commit_charging
from automaton.kernels.commit import (
    commit_allocation,
    commit_right_of_way,
    commit_routing,
)
from automaton.kernels.decisions import keep_decisions, most_words
from automaton.kernels.digest import digest_world
from automaton.kernels.drive import drive, leave_bays, settle, stand_still
from automaton.kernels.energy import hold_back
from automaton.kernels.events import find_cycles, most_events, note_events
from automaton.kernels.faults import break_down_and_repair
from automaton.kernels.holders import enter_holders, remove_holders
from automaton.kernels.motion import move_all
from automaton.kernels.observe import observe
from automaton.kernels.operations import MOST_CHANGES
from automaton.kernels.releases import release_orders
from automaton.kernels.sight import end_turn, name_robots, take_turn, turns
from automaton.kernels.stations import work_at_stations
from automaton.kernels.zones import count_robots, slow_down
from automaton.kernels.zoning import commit_zoning, judge_zoning
from automaton.kernels.zoning_decisions import most_zoning_words
from automaton.world.state import (
    ALLOCATION,
    CHANGED,
    CHARGING,
    DECIDED,
    DIGEST_EVERY,
    FINISHED,
    HALTED,
    OBSERVING,
    PHASE,
    RECORDED,
    RECORDING,
    RIGHT_OF_WAY,
    ROUTING,
    SEQUENCE,
    STOP_DELIVERED,
    STOP_PARKED,
    TICK,
    UNDELIVERED,
    UNPARKED,
    UNTIL,
    UNWORKED,
    ZONING,
)
from automaton.world.waiting import EVENTS, ROWS

# What the generator yields: the layer (0..4) that a Python strategy has to decide for, or
PAUSE = 5
GIVEN_UP = 6  # space.stop is set: it must not be resumed

ABSENT = 0  # how a layer is served
COMPILED = 1
INTERPRETED = 2

PHASES = len(SEQUENCE)


def ticks(
    world, seen, view, batch, asked, shown, answers, record, watch, space, serving,
    zoning, charging, allocation, routing, right_of_way,
    memory_z, memory_c, memory_a, memory_r, memory_w,
    vault_z, vault_c, vault_a, vault_r, vault_w,
):  # fmt: skip
    """Run ticks until world.clock[UNTIL]; pauses there, when a buffer is full, and at the end.

    `seen` and `view`, `asked` and `shown` are the same memory, writable and read-only: strategies
    get the latter. Gives the run up in mid-tick once space.stop is set.
    """
    clock = world.clock
    decide = (zoning, charging, allocation, routing, right_of_way)
    memories = (memory_z, memory_c, memory_a, memory_r, memory_w)
    vaults = (vault_z, vault_c, vault_a, vault_r, vault_w)
    while True:
        if clock[TICK] >= clock[UNTIL] or clock[FINISHED] or is_full(world, record, watch):
            yield PAUSE
            continue
        if space.stop[0]:
            yield GIVEN_UP
        clock[TICK] += 1
        world.robots.did[:] = 0
        if world.rules.may_fail:
            break_down_and_repair(world, record)
        release_orders(world)
        if world.stations.entering.shape[0]:
            work_at_stations(world)
        for phase in range(PHASES):
            layer = SEQUENCE[phase]
            clock[PHASE] = phase
            if serving[layer] == ABSENT or not concerns(world, batch, layer):
                continue
            for turn in range(turns(world, batch)):
                take_turn(world, seen, batch, asked, memories[layer], vaults[layer], turn)
                clear_answers(asked, answers, layer)
                if world.rules.holders[layer]:
                    enter_holders(seen)
                if serving[layer] == COMPILED:
                    decide[layer](view, shown, answers, memories[layer], space)
                else:
                    yield layer
                    name_robots(world, batch, asked, turn)  # whatever stands there now
                if world.rules.holders[layer]:
                    remove_holders(seen)
                if space.stop[0]:
                    yield GIVEN_UP
                if layer == ZONING:
                    judge_zoning(world, asked, answers.zoning)
                if clock[RECORDING]:
                    keep_decisions(world, record, asked, answers, layer)
                commit(world, record, asked, answers, layer)
                end_turn(world, memories[layer], vaults[layer], batch, turn)
        clock[PHASE] = 0
        motion(world, record)
        if clock[RECORDING]:
            write_record(world, record)
        if clock[OBSERVING]:
            observe(world, watch)
            find_cycles(world, watch)
            note_events(world, watch)
        clock[FINISHED] = is_finished(world)


@kernel
def concerns(world, batch, layer):
    """Whether something concerns a layer in this tick; its robots are then in the batch."""
    if layer == CHARGING:
        return batch_charging(world, batch)
    if layer == ALLOCATION:
        return batch_allocation(world, batch)
    if layer == ROUTING:
        return batch_routing(world, batch)
    if layer == RIGHT_OF_WAY:
        return batch_right_of_way(world, batch)
    return batch_everybody(world, batch, layer)


@kernel
def commit(world, record, asked, answers, layer):
    """Check a layer's answers and enter them into the world."""
    if layer == ZONING:
        commit_zoning(world, record, asked, answers)
    elif layer == CHARGING:
        commit_charging(world, record, asked, answers)
    elif layer == ALLOCATION:
        commit_allocation(world, record, asked, answers)
    elif layer == ROUTING:
        commit_routing(world, asked, answers)
    else:
        commit_right_of_way(world, record, asked, answers)


@kernel
def silence(view, asked, answers, memory, space):
    """Stands in for the function of a layer that is absent or decides in Python."""


@kernel
def motion(world, record):
    """Bays, intents and operations, the occupancy rules, and what comes of them."""
    if world.rules.slowdown:
        count_robots(world.grid, world.robots, world.traffic.crowd)
    if world.clock[UNPARKED] < world.robots.cell.shape[0]:
        leave_bays(world)
    if world.clock[HALTED] >= world.clock[TICK]:
        stand_still(world, record)
    drive(world, record)
    if world.rules.slowdown or world.rules.extra_tick:
        slow_down(world)
    if world.rules.battery:
        hold_back(world)
    move_all(world.grid, world.rules, world.robots, world.traffic, world.clock[TICK])
    settle(world, record)


@kernel
def is_full(world, record, watch):
    """Whether another tick might not fit into the buffers of a recording or of an observation."""
    clock, robots = world.clock, world.robots.cell.shape[0]
    if clock[OBSERVING]:
        if watch.count[EVENTS] + most_events(world) > watch.events.shape[0]:
            return True
        if watch.count[ROWS] >= watch.curve.shape[0]:
            return True
    if clock[RECORDING] == 0:
        return False
    if clock[RECORDED] >= record.did.shape[0]:
        return True
    if (
        clock[DECIDED]
        + most_zoning_words(world)
        + robots * most_words(world.robots.route.shape[1], world.robots.plan.shape[1])
        > record.decisions.shape[0]
    ):
        return True
    return clock[CHANGED] + MOST_CHANGES * (robots + 1) > record.changes.shape[0]


@kernel
def write_record(world, record):
    """Keep what was committed in this tick, by identity, and the digests after it when they are due."""
    row = world.clock[RECORDED]
    for i in range(world.robots.did.shape[0]):
        record.did[row, world.robots.identity[i]] = world.robots.did[i]
    if world.clock[TICK] % world.clock[DIGEST_EVERY] == 0:
        digest_world(world, record.digests[row], record.values)
    else:
        record.digests[row, :] = 0
    world.clock[RECORDED] = row + 1


@kernel
def is_finished(world):
    clock = world.clock
    if clock[UNDELIVERED] > 0 or clock[UNWORKED] > 0:
        return 0
    if world.rules.stop == STOP_PARKED:
        return 1 if clock[UNPARKED] == 0 else 0
    return 1 if world.rules.stop == STOP_DELIVERED else 0


def compile_loop(arguments, memory):
    """The generator function, and the signature of `decide`.

    `arguments`: those of `ticks` up to `serving`, of any run; all runs have the same types.
    """
    if not jit_is_on():
        return ticks, None
    from numba import typeof

    kinds = [typeof(argument) for argument in arguments]
    _, _, view, _, _, shown, answers, _, _, space, _ = kinds
    decide = types.void(view, shown, answers, typeof(memory), space)
    layers = [types.FunctionType(decide)] * 5
    return kernel(ticks, signature=(*kinds, *layers, *([typeof(memory)] * 10))), decide
