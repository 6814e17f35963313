"""Copying the state of a run from one simulation to another.

The roles of declared arrays define which of them belong to the state.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.engine.jit.structs import CARRIED, SCRATCH, STOP, Struct, window
from automaton.engine.motion import room_bit
from automaton.engine.observation import Observation
from automaton.engine.state import (
    FOLLOWING_CONVOY,
    NEED_RIGHT_OF_WAY,
    NEED_ROUTE,
    NIL,
    NO_STEP,
    REASON_NEW_GOAL,
    RETRY_NONE,
    Array,
    Clock,
    World,
)
from automaton.errors import InputError
from automaton.floor.floor_plan import DRIVABLE, EAST, WEST
from automaton.world.starts import occupy_starts

OF_THE_BUFFERS: Final = (
    "stop_tick",
    "recording",
    "recorded_ticks",
    "change_rows",
    "decision_words",
    "digest_every",
    "observing",
)


def state_arrays(struct: Struct, path: str = "") -> Iterator[tuple[str, Array]]:
    """The arrays of a struct that belong to the state, by name, without rows of different lengths."""
    for name, declared in struct._declared.items():
        if not declared.kind:
            yield from state_arrays(getattr(struct, name), f"{path}{name}.")
        elif declared.role in CARRIED and not declared.used:
            yield f"{path}{name}", struct.array(name)


def ragged_arrays(world: World) -> Iterator[tuple[Array, Array]]:
    """Arrays (n, k) with rows of different lengths, and the used length (n,) of each row."""
    for name, declared in world.robots._declared.items():
        if declared.used:
            yield getattr(world.robots, name), getattr(world.robots, declared.used)


def used_entries(rows: Array, used: Array) -> Array:
    """Flat indices of the entries in use, row by row; O(rows + entries in use)."""
    shift = np.arange(len(used)) * rows.shape[1] - (np.cumsum(used, dtype=np.int64) - used)
    entries: Array = np.repeat(shift, used)
    return entries + np.arange(len(entries))


def arrays_of_run(world: World, observation: Observation) -> dict[str, Array]:
    """The arrays of a state and of its observation, without routes, plans and the clock."""
    return dict(state_arrays(world)) | dict(state_arrays(observation, "observation."))


def copy_clock(to: Clock, since: Clock) -> None:
    """Copy the numbers of a clock that belong to the state."""
    for name in Clock.meanings:
        if name not in OF_THE_BUFFERS:
            setattr(to, name, getattr(since, name))


class RunState(NamedTuple):
    """A state from which a run can continue: copies of its arrays and of its strategies' memories."""

    arrays: dict[str, Array]  # of the state and of the observation
    rows: list[Array]  # routes and plans, which have rows of different lengths
    clock: Clock
    memories: list[dict[str, Array]]  # the arrays of each strategy's struct
    strategies: list[Any]  # strategy objects; None where a layer has none


def remembered(struct: Struct) -> Iterator[tuple[str, Array]]:
    """The arrays of a strategy's struct that belong to its memory, by name."""
    for name, declared, array in struct.arrays():
        if declared.role not in (SCRATCH, STOP):
            yield name, array


def captured(
    world: World, observation: Observation, states: Sequence[Struct], strategies: list[Any]
) -> RunState:
    """Copy the state of a run between two ticks; `states`: the structs of its strategies."""
    arrays = arrays_of_run(world, observation)
    return RunState(
        arrays={name: array.copy() for name, array in arrays.items()},
        rows=[rows.copy() for rows, _ in ragged_arrays(world)],
        clock=world.clock.copy(),
        memories=[{name: array.copy() for name, array in remembered(one)} for one in states],
        strategies=copy.deepcopy(strategies),
    )


def restore(
    state: RunState,
    world: World,
    observation: Observation,
    states: Sequence[Struct],
    strategies: list[Any],
) -> None:
    """Write a state into the arrays of a new run of the same scenario and rules."""
    for name, array in arrays_of_run(world, observation).items():
        np.copyto(array, state.arrays[name])
    for (rows, _), theirs in zip(ragged_arrays(world), state.rows, strict=True):
        np.copyto(rows, theirs)
    copy_clock(world.clock, state.clock)
    for memory, arrays in zip(states, state.memories, strict=True):
        for name, array in remembered(memory):
            window(array, writable=True)[...] = arrays[name]
    strategies[:] = copy.deepcopy(state.strategies)


def take_over(
    world: World, observation: Observation, other_world: World, other_observation: Observation
) -> None:
    """Copy state and observation of another run with the same floor, fleet and orders.

    Raises InputError if the numbers of orders differ.
    """
    orders, known = len(world.orders.state), len(other_world.orders.state)
    if orders != known:
        raise InputError(
            f"a branch keeps the {known:,} orders of its run, but with these settings there would be "
            f"{orders:,}; keep stop.max_duration"
        )
    theirs = arrays_of_run(other_world, other_observation)
    # If only one of the runs has zoning, its zones are not copied: their numbers would be out of range.
    has_same_zones = len(world.service_zones.server) == len(other_world.service_zones.server)
    for name, array in arrays_of_run(world, observation).items():
        if name.startswith("service_zones.") and not has_same_zones:
            continue
        if array.shape == theirs[name].shape:  # an unobserved simulation has no observation
            np.copyto(array, theirs[name])
    if not world.rules.slowdown:
        observation.slow_zone[:] = NIL  # a branch may have switched it off
    for (rows, _), (others, _) in zip(
        ragged_arrays(world), ragged_arrays(other_world), strict=True
    ):
        np.copyto(rows, others)
    copy_clock(world.clock, other_world.clock)
    if world.rules.following != other_world.rules.following:
        hold_cells(world)
    if world.rules.loaded_types != other_world.rules.loaded_types:
        split_by_load(world, other_world)


def hold_cells(world: World) -> None:
    """Let every robot hold the cells that the following rule assigns to it.

    These are its own cell and the cell that it enters; under convoy only the latter. Raises InputError
    if the new rule is not convoy and a robot is entering a cell that another robot is still leaving.
    """
    robots, occupancy = world.robots, world.traffic.occupancy
    is_convoy = world.rules.following == FOLLOWING_CONVOY
    moves = (robots.cell != NIL) & (robots.claim != NIL) & (robots.claim != robots.cell)
    turns = (robots.cell != NIL) & (robots.claim == robots.cell)
    stays = (robots.cell != NIL) & ~(moves & is_convoy)
    step = robots.claim[moves] - robots.cell[moves]
    way = np.argmax(world.grid.offset == step[:, None], axis=1).astype(np.uint8)
    places = (
        (robots.cell[stays], robots.travel[stays]),
        (robots.claim[moves], way),
        (robots.cell[turns], robots.travel[turns] ^ 2),  # it turns from lane to lane
    )
    occupancy[DRIVABLE[world.grid.kind]] |= np.uint16(room_bit(EAST) | room_bit(WEST))
    for cells, headings in places:
        occupy_starts(world.grid, occupancy, cells, headings)
    lanes = [resources(world, *place) for place in places]
    held, times = np.unique(np.concatenate(lanes), return_counts=True)
    if not is_convoy and (times[held >= 0] > 1).any():
        raise InputError(
            f"at tick {world.clock.tick} a robot is entering a cell that another one is still leaving, "
            f"so world.following cannot change from convoy at this tick; choose another tick"
        )
    if is_convoy:
        left = resources(world, robots.cell[moves], robots.travel[moves])
        last = int(world.clock.tick) + robots.busy[moves].astype(np.int64)
        world.traffic.leaving[left[left >= 0]] = (4 * last + way)[left >= 0]
        own = world.traffic.own_ticks  # robots not known to follow count as driving alone
        own[moves] = np.maximum(own[moves], robots.busy[moves] + 1)


def resources(world: World, cells: Array, directions: Array) -> Array:
    """The number of each cell, or of its lane in the direction of travel; NIL for unlimited cells."""
    capacity = (world.grid.cell_flags[cells].astype(np.int64) >> 5) & 3
    lane = np.where(capacity == 2, directions.astype(np.int64) >> 1, 0)
    return np.where(capacity == 0, NIL, cells + lane * len(world.grid.cell_flags))


def split_by_load(world: World, other_world: World) -> None:
    """Convert robot types where the rules begin or cease to have separate types for loaded robots."""
    robots, known = world.robots, other_world.slots.accessible
    types = world.rules.loaded_types or len(world.rules.duration)
    robots.type[:] %= types
    robots.type[robots.load != NIL] += np.uint8(world.rules.loaded_types)
    world.slots.accessible[:] = np.tile(known[:types], (len(world.slots.accessible) // types, 1))


def plan_anew(world: World) -> None:
    """Drop routes, retries and retreats when right of way begins or stops steering.

    When it stops steering, all robots with a goal ask for a route.
    """
    robots, clock = world.robots, world.clock
    for array in (robots.route_length, robots.route_index, robots.route_hash):
        array[:] = 0
    robots.retreat_moves[:], robots.failed_retries[:], robots.retry_state[:] = 0, 0, RETRY_NONE
    robots.step[:] = NO_STEP
    robots.need[:] &= 255 - (NEED_ROUTE | NEED_RIGHT_OF_WAY)
    clock.needing_right_of_way = 0
    asking = (robots.goal_cell != NIL) & (world.rules.steered[0] == 0)
    robots.need[asking] |= NEED_ROUTE
    robots.route_reason[asking] = REASON_NEW_GOAL
    clock.needing_route = int(asking.sum())
