"""The loop over ticks: the phases of a tick in their order.

    faults -> orders -> stations -> zoning -> charging -> allocation -> charging -> routing
           -> right of way -> motion -> record -> observe

`ticks` is the generator of a run; `open_tick`, `serve_layer` and `close_tick` hold the phases, and are
called for the many worlds of an environment, too.

A layer is asked when an event concerns it: in one call about all robots concerned or, with limited
sight, in one call per robot. A compiled strategy is called directly; for a Python strategy the
generator yields its number and continues in mid-tick when resumed.
"""

import numpy as np
from numba import types

from automaton.engine.batches import (
    batch_allocation,
    batch_right_of_way,
    batch_routing,
    clear_decisions,
    decide_signature,
    strategy_of_call,
)
from automaton.engine.commit import commit_allocation, commit_routing
from automaton.engine.decision_stream import max_words, max_zoning_words
from automaton.engine.decisions import Decisions
from automaton.engine.drive import apply_move_outcomes, drive, halt_robots, leave_parking_bays
from automaton.engine.events import max_events
from automaton.engine.features import (
    AFTER_OPERATIONS,
    BATTERY,
    BEFORE_DRIVING,
    BEFORE_OPERATIONS,
    COLLECTS,
    COMMITS,
    DEADLOCKS,
    DELAYS,
    FAULTS,
    FEATURES,
    GATES,
    JUDGES,
    MOVE_TICKS,
    MOVES_FEASIBLE,
    MOVES_WANTED,
    OBSERVATION,
    RECORDING,
    SIGHT,
    STATIONS,
    TICK_BEGINS,
    TICK_ENDS,
    TRIPS,
    VISITS,
    signature,
)
from automaton.engine.fulfilment import release_orders
from automaton.engine.holders import enter_holders, keep_rows, remove_holders, show_rows
from automaton.engine.jit.kernel import jit_is_on, kernel
from automaton.engine.jit.struct_types import declared_type
from automaton.engine.motion import move_all
from automaton.engine.observation import Observation
from automaton.engine.operations import MAX_CHANGES_PER_ROBOT
from automaton.engine.random_numbers import is_begin, is_due, is_end, next_tick
from automaton.engine.record_codes import EXECUTED_NOTHING
from automaton.engine.right_of_way import commit_right_of_way
from automaton.engine.state import (
    LAYER_ALLOCATION,
    LAYER_CHARGING,
    LAYER_ROUTING,
    LAYER_SEQUENCE,
    LAYER_ZONING,
    NIL,
    STOP_DELIVERED,
    STOP_ON_TARGETS,
    STOP_PARKED,
    STRATEGY_COUNT,
    Batch,
    Memory,
    Record,
    Workspace,
    World,
)
from automaton.engine.visibility import call_count, name_robots

# What the generator yields: the number of a strategy in Python that has to decide, or
LOOP_PAUSED = STRATEGY_COUNT
LOOP_GIVEN_UP = STRATEGY_COUNT + 1  # workspace.stop is set: the generator must not be resumed

MODE_ABSENT = 0  # mode: how a strategy decides
MODE_COMPILED = 1
MODE_INTERPRETED = 2

PHASES = len(LAYER_SEQUENCE)


def ticks(
    worlds, batches, decisions, outputs, workspace, mode, memories, used,
    zoning, charging, allocation, routing, right_of_way, allocation_2, allocation_3, allocation_4,
    break_down_and_repair, delay_robots, gates, trips, work_at_stations, complete_visits, move_ticks,
    cancel_infeasible_moves, mask_world, zoning_layer, charging_layer, recording, observation,
    find_deadlocks,
):  # fmt: skip
    """Run ticks until world.clock.stop_tick; pause there, when a buffer is full, and at the end.

    `worlds`: the world; the visible world; a read-only view of that for strategies. `batches`: all
    robots that a layer is asked about; the robots of one call; a read-only view of these.
    `outputs`: the record, the observation, scratch of the search for deadlocks. `mode`, `memories`: by
    strategy. `used`: by feature,
    whether it is called. Functions are separate arguments: Numba warns about tuples of functions.
    Aborts the run in mid-tick once workspace.stop is set.
    """
    world, visible_world, view = worlds
    full_batch, batch, batch_view = batches
    record, observed, watch = outputs
    decide = (
        zoning, charging, allocation, routing, right_of_way, allocation_2, allocation_3, allocation_4
    )  # fmt: skip
    asked = world, visible_world, record, full_batch, batch, decisions
    of_layers = used, zoning_layer, charging_layer, mask_world, recording
    clock = world.clock
    while True:
        if clock.tick >= clock.stop_tick or clock.finished or is_full(world, record, observed):
            yield LOOP_PAUSED
            continue
        if workspace.stop[0]:
            yield LOOP_GIVEN_UP
        begins = open_tick(
            world, record, workspace, used,
            break_down_and_repair, delay_robots, gates, trips, work_at_stations,
        )  # fmt: skip
        for phase in range(PHASES if begins else 0):
            for call in range(ask_layer(asked, of_layers, mode, phase)):
                strategy = begin_call(asked, of_layers, memories, call)
                if strategy == NIL:
                    continue
                if mode[strategy] == MODE_COMPILED:
                    decide[strategy](view, batch_view, decisions, memories[strategy], workspace)
                else:
                    yield strategy
                    # Whatever they hold now.
                    name_robots(world, full_batch, batch, strategy, call)
                if workspace.stop[0]:
                    yield LOOP_GIVEN_UP
                end_call(asked, of_layers, memories, call)
        close_tick(
            world, record, batch, decisions, observed, watch, used, begins,
            gates, trips, complete_visits, move_ticks, cancel_infeasible_moves, recording,
            observation, find_deadlocks,
        )  # fmt: skip


# The parts of a tick are pasted into `ticks` and into the driver of environments: as calls they would
# take 60 ns a tick (bench --only loop).


@kernel(inline=True)
def open_tick(
    world, record, workspace, used,
    break_down_and_repair, delay_robots, gates, trips, work_at_stations,
):  # fmt: skip
    """Faults, orders, stations; returns whether strategies decide in this tick."""
    clock = world.clock
    next_tick(world)
    world.robots.executed[:] = EXECUTED_NOTHING
    if not is_begin(world):
        return 0
    if used[FAULTS]:
        break_down_and_repair(world, record, workspace)
    if used[DELAYS]:
        delay_robots(world, record)
    if used[GATES]:
        gates(world, TICK_BEGINS)
    first = clock.next_release
    release_orders(world)
    if used[TRIPS]:
        trips(world, record, TICK_BEGINS, first)
    if used[STATIONS]:
        work_at_stations(world)
    return 1


# A layer is asked, and each call of a strategy begins and ends. `asked`: the world, the visible world,
# the record, both batches, the decisions. `of_layers`: which features are used, and those of layers.


@kernel
def serve_layer(
    asked, of_layers, view, batch_view, decide, memories, workspace, mode, phase
):  # fmt: skip
    """Ask a layer whose strategies are compiled, and enter their decisions; returns whether the run
    goes on."""
    for call in range(ask_layer(asked, of_layers, mode, phase)):
        strategy = begin_call(asked, of_layers, memories, call)
        if strategy == NIL:
            continue
        decide[strategy](view, batch_view, asked[5], memories[strategy], workspace)
        if workspace.stop[0]:
            return False
        end_call(asked, of_layers, memories, call)
    return True


@kernel(inline=True)
def ask_layer(asked, of_layers, mode, phase):
    """The number of calls that a layer gets in this tick; the full batch holds its robots."""
    world, _, record, full_batch, batch, decisions = asked
    _, zoning_layer, charging_layer, _, _ = of_layers
    layer = LAYER_SEQUENCE[phase]
    world.clock.phase = phase
    if mode[layer] == MODE_ABSENT:
        return np.int64(0)
    if layer == LAYER_ZONING:
        is_asked = zoning_layer(world, record, full_batch, batch, decisions, COLLECTS)
    elif layer == LAYER_CHARGING:
        is_asked = charging_layer(world, record, full_batch, batch, decisions, COLLECTS)
    else:
        is_asked = np.int64(collect_batch(world, full_batch, layer))
    return np.int64(call_count(world, full_batch, layer) if is_asked else 0)


@kernel(inline=True)
def begin_call(asked, of_layers, memories, call):
    """The strategy that decides in a call, whose batch holds its robots; NIL if it has none."""
    world, visible_world, _, full_batch, batch, decisions = asked
    used, _, _, mask_world, _ = of_layers
    layer = LAYER_SEQUENCE[world.clock.phase]
    strategy = strategy_of_call(world, full_batch, layer, call)
    name_robots(world, full_batch, batch, strategy, call)
    if used[SIGHT]:
        i = np.int64(full_batch.robot[call])
        mask_world(world, visible_world, i)
        if world.rules.radius > 0:
            show_rows(memories[strategy].rows, i)
    if batch.count == 0 and not is_due(world, strategy):
        return np.int64(NIL)  # it concerns robots of other allocations
    clear_decisions(batch, decisions, layer, world.clock.known_orders)
    if world.rules.holders[strategy]:
        enter_holders(visible_world)
    return strategy


@kernel(inline=True)
def end_call(asked, of_layers, memories, call):
    """Record the decisions of a call, and enter them into the world."""
    world, visible_world, record, full_batch, batch, decisions = asked
    used, zoning_layer, charging_layer, _, recording = of_layers
    layer, strategy = np.int64(LAYER_SEQUENCE[world.clock.phase]), np.int64(batch.strategy)
    if world.rules.holders[strategy]:
        remove_holders(visible_world)
    if layer == LAYER_ZONING:
        zoning_layer(world, record, full_batch, batch, decisions, JUDGES)
    if used[RECORDING]:
        recording(world, record, batch, decisions, layer)
    if layer == LAYER_ZONING:
        zoning_layer(world, record, full_batch, batch, decisions, COMMITS)
    elif layer == LAYER_CHARGING:
        charging_layer(world, record, full_batch, batch, decisions, COMMITS)
    else:
        commit(world, record, batch, decisions, layer)
    if world.rules.radius > 0:
        keep_rows(memories[strategy].rows, np.int64(full_batch.robot[call]))


@kernel(inline=True)
def close_tick(
    world, record, batch, decisions, observed, watch, used, begins,
    gates, trips, complete_visits, move_ticks, cancel_infeasible_moves, recording, observation,
    find_deadlocks,
):  # fmt: skip
    """Motion, record, observe; then whether the stop condition holds."""
    clock = world.clock
    clock.phase = 0
    if begins:
        if used[MOVE_TICKS]:
            move_ticks(world, BEFORE_DRIVING)
        begin_actions(world, record)
        if used[MOVE_TICKS]:
            move_ticks(world, MOVES_WANTED)
        if used[GATES]:
            gates(world, MOVES_WANTED)
        if used[BATTERY]:
            cancel_infeasible_moves(world)
        if used[GATES]:
            gates(world, MOVES_FEASIBLE)
    else:
        world.traffic.intent[:] = 0
    move_all(world.grid, world.rules, world.robots, world.traffic, clock.tick)
    if used[TRIPS]:
        trips(world, record, BEFORE_OPERATIONS, 0)
    apply_move_outcomes(world, record)
    if used[TRIPS]:
        trips(world, record, AFTER_OPERATIONS, 0)
    if used[VISITS] and is_end(world):
        complete_visits(world, record)
    if used[TRIPS]:
        trips(world, record, TICK_ENDS, 0)
    if used[RECORDING]:
        recording(world, record, batch, decisions, NIL)
    if used[OBSERVATION]:
        observation(world, observed, np.int64(begins))
    if used[DEADLOCKS] and begins and clock.tick >= world.deadlocks.count.next_look:
        find_deadlocks(world, watch, observed)
    clock.finished = is_finished(world)


@kernel
def begin_actions(world, record):
    """Parking bays, halts, operations that begin, and intended moves."""
    if world.clock.unparked < world.robots.cell.shape[0]:
        leave_parking_bays(world)
    if world.clock.halted_until >= world.clock.tick:
        halt_robots(world, record)
    drive(world, record)


@kernel
def collect_batch(world, full_batch, layer):
    """Whether a layer must be asked in this tick; then the batch holds its robots."""
    if layer == LAYER_ALLOCATION:
        return batch_allocation(world, full_batch)
    if layer == LAYER_ROUTING:
        return batch_routing(world, full_batch)
    return batch_right_of_way(world, full_batch)


@kernel
def commit(world, record, batch, decisions, layer):
    """Check a layer's decisions and enter them into the world."""
    if layer == LAYER_ALLOCATION:
        commit_allocation(world, record, batch, decisions)
    elif layer == LAYER_ROUTING:
        commit_routing(world, batch, decisions)
    else:
        commit_right_of_way(world, record, batch, decisions)


@kernel
def is_full(world, record, observation):
    """Whether the next tick may exceed the buffers of the recording or the observation."""
    clock, robots = world.clock, world.robots.cell.shape[0]
    if clock.observing:
        if observation.count.events + max_events(world) > observation.events.shape[0]:
            return True
        if observation.count.curve_rows >= observation.curve.shape[0]:
            return True
    if clock.recording == 0:
        return False
    if clock.recorded_ticks >= record.executed.shape[0]:
        return True
    if (
        clock.decision_words
        + max_zoning_words(world)
        + robots * max_words(world.robots.route.shape[1], world.robots.order_queue.shape[1])
        > record.decisions.shape[0]
    ):
        return True
    return clock.change_rows + MAX_CHANGES_PER_ROBOT * (robots + 1) > record.changes.shape[0]


@kernel
def is_finished(world):
    clock, stop = world.clock, world.rules.stop
    away = note_targets(world) if stop == STOP_ON_TARGETS else 0
    if clock.undelivered > 0 or clock.open_jobs > 0:
        return 0
    if stop == STOP_PARKED:
        return 1 if clock.unparked == 0 else 0
    if stop == STOP_ON_TARGETS:
        return 1 if away == 0 else 0
    return 1 if stop == STOP_DELIVERED else 0


@kernel
def note_targets(world):
    """Note since when each robot stands on its target, and return the number of those that do not."""
    robots, settled, away = world.robots, world.tally.settled, 0
    for i in range(robots.cell.shape[0]):
        is_moving = robots.claim[i] != NIL and robots.claim[i] != robots.cell[i]
        if robots.cell[i] != robots.home[i] or is_moving:
            settled[i] = NIL
            away += 1
        elif settled[i] == NIL:
            settled[i] = world.clock.tick
    return away


def compile_loop():
    """The generator function and the signature of `decide`; all runs use the same types."""
    if not jit_is_on():
        return ticks, None
    decide = decide_signature()
    worlds = declared_type(World), declared_type(World), declared_type(World, writable=False)
    batches = declared_type(Batch), declared_type(Batch), declared_type(Batch, writable=False)
    kinds = (
        types.BaseTuple.from_types(worlds),
        types.BaseTuple.from_types(batches),
        declared_type(Decisions),
        types.BaseTuple.from_types(
            (declared_type(Record), declared_type(Observation), declared_type(Observation))
        ),
        declared_type(Workspace),
        types.Array(types.uint8, 1, "C"),
        types.UniTuple(declared_type(Memory), STRATEGY_COUNT),
        types.Array(types.uint8, 1, "C"),
        *[types.FunctionType(decide)] * STRATEGY_COUNT,
        *[types.FunctionType(signature(feature)) for feature in FEATURES],
    )
    return kernel(ticks, signature=kinds), decide
