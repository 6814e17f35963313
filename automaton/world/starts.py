"""Where robots begin, how they stand there, and what of the floor they hold."""

from __future__ import annotations

import numpy as np

from automaton.kernels import draws
from automaton.scenario.resolve import Resolved
from automaton.world.cells import UNLIMITED
from automaton.world.floor import Floor
from automaton.world.plan import DRIVABLE, FloorPlan
from automaton.world.reach import rack_stands
from automaton.world.state import NIL, Array, Grid


def homes(resolved: Resolved, floor: Floor, seed: int) -> tuple[Array, Array]:
    """(n,) home cells and (n,) bays by identity; NIL where a robot parks on the floor itself."""
    n = resolved.scenario.fleet.robots
    none = np.full(n, NIL, np.int32)
    if resolved.start == "bays":
        bays = resolved.plan.bays[:n]
        return bays[:, 1].astype(np.int32), bays[:, 0].astype(np.int32)
    if resolved.start == "random":
        return random_cells(resolved.plan, n, seed), none
    if resolved.start == "stands":
        return random_stands(resolved.plan, n, seed), none
    return np.array(resolved.start, np.int32), none


def random_cells(plan: FloorPlan, n: int, seed: int) -> Array:
    """n different drivable cells: those of the least draws, in the order of their draws."""
    cells = np.flatnonzero(DRIVABLE[plan.kind.reshape(-1)])
    keys = np.zeros(len(cells), np.int64)
    with np.errstate(over="ignore"):
        draws.draw_many(keys, 2**31, np.uint64(seed), draws.STARTS, 0)
    chosen: Array = cells[np.argsort(keys, kind="stable")[:n]].astype(np.int32)
    return chosen


def random_stands(plan: FloorPlan, n: int, seed: int) -> Array:
    """n cells in front of racks: of a rack drawn for each robot, where cells hold any number.

    Else different ones, those of the least draws, in the order of their draws.
    """
    stands = rack_stands(plan)
    choice = np.zeros(n, np.int64)
    with np.errstate(over="ignore"):
        draws.draw_many(choice, len(stands), np.uint64(seed), draws.STARTS, 0)
        if (plan.capacity.reshape(-1)[stands] == UNLIMITED).all():
            return stands[choice]
        stands = np.unique(stands)
        keys = np.zeros(len(stands), np.int64)
        draws.draw_many(keys, 2**31, np.uint64(seed), draws.STARTS, 0)
    chosen: Array = stands[np.argsort(keys, kind="stable")[:n]]
    return chosen


def first_headings(grid: Grid, cells: Array) -> Array:
    """(n,) uint8: vertical where the cell leads south or north, else horizontal."""
    rule = grid.rule[cells]
    choices = [(rule >> np.uint8(d)) & 1 == 1 for d in (1, 3, 0, 2)]
    direction = np.select(choices, [1, 3, 0, 2], 0)
    headings: Array = (direction & (grid.headings - 1)).astype(np.uint8)
    return headings


def occupy_starts(grid: Grid, occupancy: Array, cells: Array, headings: Array) -> None:
    capacity = (grid.rule[cells].astype(np.int64) >> 5) & 3
    lane = headings.astype(np.int64) >> 1
    bit = np.select([capacity == 1, capacity == 2], [np.full_like(lane, 96), 32 << lane], 0)
    np.bitwise_and.at(occupancy, cells, ~bit.astype(np.uint16))
