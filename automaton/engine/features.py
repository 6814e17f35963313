"""Features: optional parts of a tick, which many runs do not use.

The loop calls each feature by a pointer, as it calls strategies. Each is compiled separately, and
only for runs that use it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types

from automaton.engine.batches import batch_all_robots, batch_charging
from automaton.engine.commit import commit_charging
from automaton.engine.decision_stream import keep_decisions
from automaton.engine.decisions import Decisions
from automaton.engine.digest import digest_world
from automaton.engine.drive import count_robots, set_move_ticks
from automaton.engine.energy import cancel_infeasible_moves
from automaton.engine.events import find_cycles, find_deadlocks, note_events
from automaton.engine.faults import break_down_and_repair, delay_robots
from automaton.engine.fulfilment import complete_visits, work_at_stations
from automaton.engine.gates import hold_at_gates, set_cabin_ticks, update_gates
from automaton.engine.jit.compile_progress import COMPILING
from automaton.engine.jit.kernel import first_class, jit_is_on, kernel
from automaton.engine.jit.struct_types import declared_type
from automaton.engine.observation import Observation
from automaton.engine.observe import observe
from automaton.engine.state import (
    LAYER_CHARGING,
    LAYER_ZONING,
    NIL,
    Array,
    Batch,
    Record,
    Workspace,
    World,
)
from automaton.engine.trips import (
    clear_queues,
    count_starved,
    has_lines,
    leave_stations_and_pods,
    mark_queues,
    plan_trips,
    take_turns,
)
from automaton.engine.visibility import mask_world
from automaton.engine.zoning import commit_zoning, judge_zoning

# Moments of a tick, for features that are called more than once per tick.
TICK_BEGINS = 0  # before anything is decided
COLLECTS = 1  # the robots that a layer is asked about
JUDGES = 2  # decisions before they are recorded
COMMITS = 3  # decisions after they are recorded
BEFORE_DRIVING = 4
MOVES_WANTED = 5  # all intended moves are known
MOVES_FEASIBLE = 6  # moves are limited to the charge of batteries
BEFORE_OPERATIONS = 7
AFTER_OPERATIONS = 8
TICK_ENDS = 9


@kernel
def gates(world, moment):
    """Doors, lifts and blocks."""
    if moment == TICK_BEGINS:
        update_gates(world)
    elif moment == MOVES_WANTED:
        set_cabin_ticks(world)
    else:
        hold_at_gates(world)


@kernel
def trips(world, record, moment, first):
    """Pods that are carried to stations; `first`: the first order that was released in this tick."""
    if moment == TICK_BEGINS:
        if has_lines(world):
            plan_trips(world, record)
        else:
            take_turns(world, record, first)
    elif moment == BEFORE_OPERATIONS:
        mark_queues(world)
        count_starved(world)
    elif moment == AFTER_OPERATIONS:
        clear_queues(world)
    else:
        leave_stations_and_pods(world, record)


@kernel
def move_ticks(world, moment):
    """Moves longer than the robot's usual ones: slow zones, speed limits, random delays."""
    if moment == MOVES_WANTED:
        set_move_ticks(world)
    elif world.rules.slowdown:
        count_robots(world.grid, world.robots, world.traffic.zone_occupancy)


@kernel
def zoning(world, record, full_batch, batch, decisions, moment):
    """The layer that designs service zones; returns whether it is asked."""
    if moment == COLLECTS:
        return 1 if batch_all_robots(world, full_batch, LAYER_ZONING) else 0
    if moment == JUDGES:
        judge_zoning(world, batch, decisions.zoning)
    else:
        commit_zoning(world, record, batch, decisions)
    return 0


@kernel
def charging(world, record, full_batch, batch, decisions, moment):
    """The layer that sends robots to chargers; returns whether it is asked."""
    if moment == COLLECTS:
        return 1 if batch_charging(world, full_batch) else 0
    if moment == COMMITS:
        commit_charging(world, record, batch, decisions)
    return 0


@kernel
def recording(world, record, batch, decisions, layer):
    """Record the decisions of a layer; without a layer, the committed actions of this tick."""
    if layer == NIL:
        write_record(world, record)
    else:
        keep_decisions(world, record, batch, decisions, layer)


@kernel
def write_record(world, record):
    """Record the committed actions of this tick, by identity, and the digests when they are due."""
    row = world.clock.recorded_ticks
    for i in range(world.robots.executed.shape[0]):
        record.executed[row, world.robots.identity[i]] = world.robots.executed[i]
    if world.clock.tick % world.clock.digest_every == 0:
        digest_world(world, record.digests[row])
    else:
        record.digests[row, :] = 0
    world.clock.recorded_ticks = row + 1


@kernel
def observation(world, observed, begins):
    """Observe the tick; `begins`: whether strategies could decide in it."""
    observe(world, observed)
    if begins:
        find_cycles(world, observed)
    note_events(world, observed)


class Feature(NamedTuple):
    """A part of a tick, the types of its arguments, and whether a world uses it."""

    kernel: Any
    arguments: tuple[Any, ...]  # struct classes, and "int64" for numbers
    is_used: Callable[[World, Array], Any]  # takes the world, and how each strategy decides
    result: str = "void"


def has_longer_moves(world: World, mode: Array) -> bool:
    """Whether moves may take longer than a robot's usual ones."""
    rules = world.rules
    return bool(rules.slowdown or rules.extra_tick or len(world.grid.min_move_ticks))


LAYER = World, Record, Batch, Batch, Decisions, "int64"

# In the order of the arguments of the loop.
FEATURES = (
    Feature(
        break_down_and_repair, (World, Record, Workspace), lambda world, mode: world.rules.may_fail
    ),
    Feature(delay_robots, (World, Record), lambda world, mode: len(world.delays.until)),
    Feature(gates, (World, "int64"), lambda world, mode: len(world.gates.kind)),
    Feature(trips, (World, Record, "int64", "int64"), lambda world, mode: len(world.trips.pod)),
    Feature(work_at_stations, (World,), lambda world, mode: len(world.stations.part_arrivals)),
    Feature(complete_visits, (World, Record), lambda world, mode: len(world.stops.cell)),
    Feature(move_ticks, (World, "int64"), has_longer_moves),
    Feature(cancel_infeasible_moves, (World,), lambda world, mode: world.rules.battery),
    Feature(mask_world, (World, World, "int64"), lambda world, mode: world.rules.radius != NIL),
    Feature(zoning, LAYER, lambda world, mode: mode[LAYER_ZONING], "int64"),
    Feature(charging, LAYER, lambda world, mode: mode[LAYER_CHARGING], "int64"),
    Feature(
        recording,
        (World, Record, Batch, Decisions, "int64"),
        lambda world, mode: world.clock.recording,
    ),
    Feature(
        observation,
        (World, Observation, "int64"),
        lambda world, mode: world.clock.observing,
    ),
    Feature(
        find_deadlocks,
        (World, Observation, Observation),
        lambda world, mode: len(world.deadlocks.number),
    ),
)
(
    FAULTS, DELAYS, GATES, TRIPS, STATIONS, VISITS, MOVE_TICKS, BATTERY, SIGHT, ZONING, CHARGING,
    RECORDING, OBSERVATION, DEADLOCKS,
) = range(len(FEATURES))  # fmt: skip


def signature(feature: Feature) -> Any:
    """The types by which the loop calls a feature."""
    arguments = [
        getattr(types, one) if isinstance(one, str) else declared_type(one)
        for one in feature.arguments
    ]
    return getattr(types, feature.result)(*arguments)


@cache
def compiled_feature(number: int) -> Any:
    """The function object by which the loop calls a feature; compiled or loaded once per process."""
    feature = FEATURES[number]
    function = first_class(feature.kernel, signature(feature)) if jit_is_on() else feature.kernel
    COMPILING.finish(feature.kernel)
    return function


def used_features(world: World, mode: Array) -> Array:
    """(f,) uint8: the features that a world uses; `mode`: how each strategy decides."""
    return np.array([bool(one.is_used(world, mode)) for one in FEATURES], np.uint8)


class Absent:
    """A placeholder for a function that is not called."""

    def __init__(self, signature: Any) -> None:
        self._numba_type_ = types.FunctionType(signature)

    def __wrapper_address__(self) -> int:
        return -1


@cache
def absent(signature: Any) -> Any:
    """The placeholder for an uncalled function with this signature."""
    return Absent(signature) if jit_is_on() else None


@cache
def absent_feature(number: int) -> Any:
    """The placeholder for a feature."""
    return absent(signature(FEATURES[number]))
