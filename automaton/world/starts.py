"""The start cells of robots, their headings, the cells that they occupy, and their charges."""

from __future__ import annotations

import numpy as np

from automaton.engine.random_numbers import STREAM_CHARGES, STREAM_STARTS
from automaton.engine.state import BATTERY_FULL, NIL, Array, Grid
from automaton.floor.floor_plan import DIRECTIONS, UNLIMITED, FloorPlan
from automaton.floor.reachability import rack_stands
from automaton.scenario.robot_types import type_of_each, types_of
from automaton.scenario.schema import Battery, Scenario
from automaton.world.capabilities import FleetOnFloor
from automaton.world.draws import integers
from automaton.world.floor_parts import service_cells
from automaton.world.gate_cells import cells_to_start
from automaton.world.resolved import Resolved
from automaton.world.rules import charge_units


def homes(resolved: Resolved, seed: int) -> tuple[Array, Array]:
    """(n,) home cells and (n,) parking bays by identity; NIL for robots that park on the floor."""
    fleet, floor_plan = resolved.fleet, resolved.floor_plan
    none = np.full(len(fleet.type_of), NIL, np.int32)
    if resolved.start == "parking-bays":
        bays = floor_plan.bays[np.concatenate(fleet.first_open(floor_plan.bays[:, 1]))]
        return bays[:, 1].astype(np.int32), bays[:, 0].astype(np.int32)
    if resolved.start == "random":
        scenario = resolved.scenario
        cells = random_cells(floor_plan, seed, service_cells(scenario, floor_plan))
        cells = cells_to_start(scenario, floor_plan, cells)
        return cells[np.concatenate(fleet.first_open(cells))], none
    if resolved.start == "racks":
        return stands_for_all(fleet, seed), none
    return np.array(resolved.start, np.int32), none


def random_cells(floor_plan: FloorPlan, seed: int, last: Array | None = None) -> Array:
    """The drivable cells in random order (least draw first); `last`: (C,) bool, cells put at the end."""
    cells = np.flatnonzero(floor_plan.drivable)
    keys = integers(len(cells), 2**31, seed, STREAM_STARTS)
    drawn: Array = cells[np.argsort(keys, kind="stable")].astype(np.int32)
    if last is None:
        return drawn
    return np.concatenate((drawn[~last[drawn]], drawn[last[drawn]]))


START_FIRST, START_LAST, START_NEVER = (
    0,
    1,
    2,
)  # cells where robots begin; if the others are used up; never


def start_order(resolved: Resolved) -> tuple[Array, Array]:
    """(c,) the drivable cells, and (c,) uint8 when robots of the first type begin there: START_*."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    cells = np.flatnonzero(floor_plan.drivable).astype(np.int32)
    is_open = np.isin(cells, cells_to_start(scenario, floor_plan, cells))
    is_open &= ~resolved.fleet.closed[0][cells]
    order = np.where(service_cells(scenario, floor_plan)[cells], START_LAST, START_FIRST)
    return cells, np.where(is_open, order, START_NEVER).astype(np.uint8)


def stands_for_all(fleet: FleetOnFloor, seed: int) -> Array:
    """(n,) cells in front of racks, each open to its robot."""
    floor_plan, each = fleet.floor_plan, fleet.type_of
    if not has_room_for_all(floor_plan):
        cells = random_stands(floor_plan, len(np.unique(rack_stands(floor_plan))), seed)
        return cells[np.concatenate(fleet.first_open(cells))]
    by_type = [random_stands(floor_plan, len(each), seed, closed) for closed in fleet.closed]
    return np.stack(by_type)[each, np.arange(len(each))]


def has_room_for_all(floor_plan: FloorPlan) -> bool:
    """Whether any number of robots may stand in front of racks."""
    return bool((floor_plan.capacity.reshape(-1)[rack_stands(floor_plan)] == UNLIMITED).all())


def random_stands(floor_plan: FloorPlan, n: int, seed: int, closed: Array | None = None) -> Array:
    """n cells in front of racks: if cells hold any number of robots, each robot draws a rack.

    Otherwise different cells in random order. `closed`: (C,) bool, excluded cells.
    """
    stands = rack_stands(floor_plan)
    if closed is not None:
        stands = stands[~closed[stands]]
    if has_room_for_all(floor_plan):
        return stands[integers(n, len(stands), seed, STREAM_STARTS)]
    stands = np.unique(stands)
    keys = integers(len(stands), 2**31, seed, STREAM_STARTS)
    chosen: Array = stands[np.argsort(keys, kind="stable")[:n]]
    return chosen


def start_headings(fleet: FleetOnFloor, grid: Grid, cells: Array) -> Array:
    """(n,) uint8 headings by identity: from the scenario, or towards an exit of the start cell."""
    default, stated = first_headings(grid, cells, fleet.type_of), fleet.scenario.fleet.heading
    if stated is None:
        return default
    names = stated if isinstance(stated, tuple) else (stated,) * len(cells)
    faces = np.array([DIRECTIONS.index(name) for name in names], np.uint8)
    differential = grid.type_headings[fleet.type_of] == len(DIRECTIONS)
    return np.where(differential, faces, default).astype(np.uint8)


def first_headings(grid: Grid, cells: Array, types: Array | int = 0) -> Array:
    """(n,) uint8: vertical if the cell leads south or north, else horizontal; `types`: (n,)."""
    cell_flags = grid.cell_flags[cells]
    choices = [(cell_flags >> np.uint8(d)) & 1 == 1 for d in (1, 3, 0, 2)]
    direction = np.select(choices, [1, 3, 0, 2], 0)
    headings: Array = (direction & (grid.type_headings[types] - 1)).astype(np.uint8)
    return headings


def occupy_starts(grid: Grid, occupancy: Array, cells: Array, headings: Array) -> None:
    capacity = (grid.cell_flags[cells].astype(np.int64) >> 5) & 3
    lane = headings.astype(np.int64) >> 1
    bit = np.select([capacity == 1, capacity == 2], [np.full_like(lane, 96), 32 << lane], 0)
    np.bitwise_and.at(occupancy, cells, ~bit.astype(np.uint16))


def first_charges(scenario: Scenario, seed: int) -> Array:
    """(n,) int32 by identity: the charge of batteries at the start."""
    n = scenario.fleet.robots
    if scenario.battery is None:
        return np.full(n, BATTERY_FULL, np.int32)
    types = [one.battery for one in types_of(scenario) if one.battery is not None]
    by_type = np.stack([_charges(one, n, seed) for one in types])
    return by_type[type_of_each(scenario.fleet), np.arange(n)]


def _charges(battery: Battery, n: int, seed: int) -> Array:
    """(n,) int32 by identity: the charge at the start for these batteries."""
    start = battery.initial_charge
    if isinstance(start, tuple):
        return np.array([charge_units(percent) for percent in start], np.int32)
    if isinstance(start, float):
        return np.full(n, charge_units(start), np.int32)
    low, high = charge_units(start.least), charge_units(start.most)
    drawn: Array = low + integers(n, high - low + 1, seed, STREAM_CHARGES)
    return drawn.astype(np.int32)
