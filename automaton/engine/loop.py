"""The loop over ticks: one compiled generator whose body is the list of the phases of a tick.

    faults -> orders -> stations -> zoning -> charging -> allocation -> charging -> routing
           -> right of way -> motion -> record -> observe

A layer is asked when something concerns it: in one call about all the robots concerned, or, with
limited sight, in one call for each of them. A compiled strategy is called right here; for a Python
strategy the generator yields ASK and the layer, and goes on in mid-tick when it is resumed.
"""

from numba import types

from automaton.engine.batches import (
    batch_all_robots,
    batch_allocation,
    batch_charging,
    batch_right_of_way,
    batch_routing,
    clear_decisions,
    strategy_of_call,
)
from automaton.engine.charging_commit import commit_charging
from automaton.engine.commit import commit_allocation, commit_routing
from automaton.engine.decision_stream import keep_decisions, max_words
from automaton.engine.delayed_robots import delay_robots
from automaton.engine.digest import digest_world
from automaton.engine.drive import apply_move_outcomes, drive, halt_robots, leave_parking_bays
from automaton.engine.energy import cancel_infeasible_moves
from automaton.engine.events import find_cycles, max_events, note_events
from automaton.engine.faults import break_down_and_repair
from automaton.engine.gate_pass import hold_at_gates, update_gates
from automaton.engine.gate_queries import has_gates, set_cabin_ticks
from automaton.engine.holders import enter_holders, remove_holders
from automaton.engine.jit.kernel import jit_is_on, kernel
from automaton.engine.jit.struct_types import declared_type
from automaton.engine.listed_pods import take_turns
from automaton.engine.motion import move_all
from automaton.engine.observation import COUNT_CURVE_ROWS, COUNT_EVENTS, Observation
from automaton.engine.observe import observe
from automaton.engine.record_changes import MAX_CHANGES
from automaton.engine.record_codes import EXECUTED_NOTHING
from automaton.engine.refinement import is_begin, is_due, is_end, next_tick
from automaton.engine.releases import release_orders
from automaton.engine.right_of_way_commit import commit_right_of_way
from automaton.engine.slow_zones import count_robots, set_move_ticks
from automaton.engine.state import (
    CLOCK_CHANGE_ROWS,
    CLOCK_DECISION_WORDS,
    CLOCK_DIGEST_EVERY,
    CLOCK_FINISHED,
    CLOCK_HALTED_UNTIL,
    CLOCK_KNOWN_ORDERS,
    CLOCK_NEXT_RELEASE,
    CLOCK_OBSERVING,
    CLOCK_OPEN_JOBS,
    CLOCK_PHASE,
    CLOCK_RECORDED_TICKS,
    CLOCK_RECORDING,
    CLOCK_STOP_TICK,
    CLOCK_TICK,
    CLOCK_UNDELIVERED,
    CLOCK_UNPARKED,
    LAYER_ALLOCATION,
    LAYER_CHARGING,
    LAYER_RIGHT_OF_WAY,
    LAYER_ROUTING,
    LAYER_SEQUENCE,
    LAYER_ZONING,
    STOP_DELIVERED,
    STOP_PARKED,
    STRATEGIES,
    Batch,
    Decisions,
    Memory,
    Record,
    Workspace,
    World,
)
from automaton.engine.station_queues import clear_queues, count_starved, mark_queues
from automaton.engine.stations import work_at_stations
from automaton.engine.trips import has_lines, has_trips, leave_stations_and_pods, plan_trips
from automaton.engine.visibility import begin_call, call_count, end_call, name_robots
from automaton.engine.visits import complete_visits
from automaton.engine.zoning_commit import commit_zoning, judge_zoning
from automaton.engine.zoning_decision_stream import max_zoning_words

# What the generator yields: the number of a strategy in Python that has to decide, or
LOOP_PAUSED = STRATEGIES
LOOP_GIVEN_UP = STRATEGIES + 1  # workspace.stop is set: it must not be resumed

MODE_ABSENT = 0  # mode: how a strategy decides
MODE_COMPILED = 1
MODE_INTERPRETED = 2

PHASES = len(LAYER_SEQUENCE)


def ticks(
    worlds, batches, decisions, outputs, workspace, mode, memories,
    zoning, charging, allocation, routing, right_of_way, allocation_2, allocation_3, allocation_4,
):  # fmt: skip
    """Run ticks until world.clock[CLOCK_STOP_TICK]; pause there, when a buffer is full, and at the end.

    `worlds`: the world; what strategies see of it; the same memory, read-only, which they get.
    `batches`: the robots that a layer is asked about; those of one call; the same, read-only.
    `outputs`: the record, and what is observed. `mode`, `memories`: by strategy. Functions come one by
    one: Numba warns of a tuple of them. Gives the run up in mid-tick once workspace.stop is set.
    """
    world, visible_world, view = worlds
    full_batch, batch, batch_view = batches
    record, observation = outputs
    decide = (
        zoning, charging, allocation, routing, right_of_way, allocation_2, allocation_3, allocation_4
    )  # fmt: skip
    clock = world.clock
    while True:
        if (
            clock[CLOCK_TICK] >= clock[CLOCK_STOP_TICK]
            or clock[CLOCK_FINISHED]
            or is_full(world, record, observation)
        ):
            yield LOOP_PAUSED
            continue
        if workspace.stop[0]:
            yield LOOP_GIVEN_UP
        next_tick(world)
        world.robots.executed[:] = EXECUTED_NOTHING
        begins = is_begin(world)
        if begins:
            prepare(world, record, workspace)
        for phase in range(PHASES if begins else 0):
            layer = LAYER_SEQUENCE[phase]
            clock[CLOCK_PHASE] = phase
            if mode[layer] == MODE_ABSENT or not collect_batch(world, full_batch, layer):
                continue
            for call in range(call_count(world, full_batch, layer)):
                strategy = strategy_of_call(world, full_batch, layer, call)
                memory = memories[strategy]
                begin_call(world, visible_world, full_batch, batch, memory, strategy, call)
                if batch.count[0] == 0 and not is_due(world, strategy):
                    continue  # it is about robots of other allocations
                clear_decisions(batch, decisions, layer, clock[CLOCK_KNOWN_ORDERS])
                if world.rules.holders[strategy]:
                    enter_holders(visible_world)
                if mode[strategy] == MODE_COMPILED:
                    decide[strategy](view, batch_view, decisions, memory, workspace)
                else:
                    yield strategy
                    name_robots(
                        world, full_batch, batch, strategy, call
                    )  # whatever stands there now
                if world.rules.holders[strategy]:
                    remove_holders(visible_world)
                if workspace.stop[0]:
                    yield LOOP_GIVEN_UP
                if layer == LAYER_ZONING:
                    judge_zoning(world, batch, decisions.zoning)
                if clock[CLOCK_RECORDING]:
                    keep_decisions(world, record, batch, decisions, layer)
                commit(world, record, batch, decisions, layer)
                end_call(world, memory, full_batch, call)
        clock[CLOCK_PHASE] = 0
        motion(world, record)
        if clock[CLOCK_RECORDING]:
            write_record(world, record)
        if clock[CLOCK_OBSERVING]:
            observe(world, observation)
            if begins:
                find_cycles(world, observation)
            note_events(world, observation)
        clock[CLOCK_FINISHED] = is_finished(world)


@kernel
def prepare(world, record, workspace):
    """Faults, orders and stations: what happens before anything is decided."""
    if world.rules.may_fail:
        break_down_and_repair(world, record, workspace)
    if world.delays.until.shape[0]:
        delay_robots(world, record)
    if has_gates(world):
        update_gates(world)
    first = world.clock[CLOCK_NEXT_RELEASE]
    release_orders(world)
    if has_lines(world):
        plan_trips(world, record)
    elif has_trips(world):
        take_turns(world, record, first)
    if world.stations.part_arrivals.shape[0]:
        work_at_stations(world)


@kernel
def collect_batch(world, full_batch, layer):
    """Whether something concerns a layer in this tick; its robots are then in the batch."""
    if layer == LAYER_CHARGING:
        return batch_charging(world, full_batch)
    if layer == LAYER_ALLOCATION:
        return batch_allocation(world, full_batch)
    if layer == LAYER_ROUTING:
        return batch_routing(world, full_batch)
    if layer == LAYER_RIGHT_OF_WAY:
        return batch_right_of_way(world, full_batch)
    return batch_all_robots(world, full_batch, layer)


@kernel
def commit(world, record, batch, decisions, layer):
    """Check a layer's decisions and enter them into the world."""
    if layer == LAYER_ZONING:
        commit_zoning(world, record, batch, decisions)
    elif layer == LAYER_CHARGING:
        commit_charging(world, record, batch, decisions)
    elif layer == LAYER_ALLOCATION:
        commit_allocation(world, record, batch, decisions)
    elif layer == LAYER_ROUTING:
        commit_routing(world, batch, decisions)
    else:
        commit_right_of_way(world, record, batch, decisions)


@kernel
def no_op(view, batch, decisions, memory, workspace):
    """Stands in for the function of a layer that is absent or decides in Python."""


@kernel
def motion(world, record):
    """Bays, intents and operations, the occupancy rules, and what comes of them; stops that are done."""
    if is_begin(world):
        want_moves(world, record)
    else:
        world.traffic.intent[:] = 0
    move_all(world.grid, world.rules, world.robots, world.traffic, world.clock[CLOCK_TICK])
    carries_pods = has_trips(world)
    if carries_pods:
        mark_queues(world)
        count_starved(world)
    apply_move_outcomes(world, record)
    if carries_pods:
        clear_queues(world)
    if world.stops.cell.shape[0] and is_end(world):
        complete_visits(world, record)
    if carries_pods:
        leave_stations_and_pods(world, record)


@kernel
def want_moves(world, record):
    """What robots begin, and the moves that they want, as far as charge and gates allow them."""
    if world.rules.slowdown:
        count_robots(world.grid, world.robots, world.traffic.zone_occupancy)
    if world.clock[CLOCK_UNPARKED] < world.robots.cell.shape[0]:
        leave_parking_bays(world)
    if world.clock[CLOCK_HALTED_UNTIL] >= world.clock[CLOCK_TICK]:
        halt_robots(world, record)
    drive(world, record)
    if world.rules.slowdown or world.rules.extra_tick or world.grid.min_move_ticks.shape[0]:
        set_move_ticks(world)
    gated = has_gates(world)
    if gated:
        set_cabin_ticks(world)
    if world.rules.battery:
        cancel_infeasible_moves(world)
    if gated:
        hold_at_gates(world)


@kernel
def is_full(world, record, observation):
    """Whether another tick might not fit into the buffers of a recording or of an observation."""
    clock, robots = world.clock, world.robots.cell.shape[0]
    if clock[CLOCK_OBSERVING]:
        if observation.count[COUNT_EVENTS] + max_events(world) > observation.events.shape[0]:
            return True
        if observation.count[COUNT_CURVE_ROWS] >= observation.curve.shape[0]:
            return True
    if clock[CLOCK_RECORDING] == 0:
        return False
    if clock[CLOCK_RECORDED_TICKS] >= record.executed.shape[0]:
        return True
    if (
        clock[CLOCK_DECISION_WORDS]
        + max_zoning_words(world)
        + robots * max_words(world.robots.route.shape[1], world.robots.order_queue.shape[1])
        > record.decisions.shape[0]
    ):
        return True
    return clock[CLOCK_CHANGE_ROWS] + MAX_CHANGES * (robots + 1) > record.changes.shape[0]


@kernel
def write_record(world, record):
    """Keep what was committed in this tick, by identity, and the digests after it when they are due."""
    row = world.clock[CLOCK_RECORDED_TICKS]
    for i in range(world.robots.executed.shape[0]):
        record.executed[row, world.robots.identity[i]] = world.robots.executed[i]
    if world.clock[CLOCK_TICK] % world.clock[CLOCK_DIGEST_EVERY] == 0:
        digest_world(world, record.digests[row])
    else:
        record.digests[row, :] = 0
    world.clock[CLOCK_RECORDED_TICKS] = row + 1


@kernel
def is_finished(world):
    clock = world.clock
    if clock[CLOCK_UNDELIVERED] > 0 or clock[CLOCK_OPEN_JOBS] > 0:
        return 0
    if world.rules.stop == STOP_PARKED:
        return 1 if clock[CLOCK_UNPARKED] == 0 else 0
    return 1 if world.rules.stop == STOP_DELIVERED else 0


def compile_loop():
    """The generator function, and the signature of `decide`; all runs have the same types."""
    if not jit_is_on():
        return ticks, None
    decide = decide_signature()
    worlds = declared_type(World), declared_type(World), declared_type(World, writable=False)
    batches = declared_type(Batch), declared_type(Batch), declared_type(Batch, writable=False)
    kinds = (
        types.BaseTuple.from_types(worlds),
        types.BaseTuple.from_types(batches),
        declared_type(Decisions),
        types.BaseTuple.from_types((declared_type(Record), declared_type(Observation))),
        declared_type(Workspace),
        types.Array(types.uint8, 1, "C"),
        types.UniTuple(declared_type(Memory), STRATEGIES),
        *[types.FunctionType(decide)] * STRATEGIES,
    )
    return kernel(ticks, signature=kinds), decide


def decide_signature():
    """The types of the arguments of a strategy's `decide`."""
    shown = (declared_type(kind, writable=False) for kind in (World, Batch))
    return types.void(*shown, *(declared_type(kind) for kind in (Decisions, Memory, Workspace)))


def last_parts():
    """Kernels that `ticks` calls last, and the types of their arguments: another process can compile
    them while the first parts are compiled, in about the same time."""
    world, record, observation = (declared_type(kind) for kind in (World, Record, Observation))
    return (
        (motion, (world, record)),
        (write_record, (world, record)),
        (observe, (world, observation)),
        (find_cycles, (world, observation)),
        (note_events, (world, observation)),
    )
