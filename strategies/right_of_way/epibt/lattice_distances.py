"""Tables of distances in 16 bits per cell: the least cost to a goal cell, and what headings add to it.

A move costs 1, or 3 against its street where the lattice guides; a turn by 90 degrees costs 1. A robot
may turn wherever it stands, so the costs from two neighbouring headings differ by 1 at most, and there
are 19 patterns of what the four headings add to the least of them:

    bits 0-4    number of the pattern
    bits 5-15   the least cost of the four headings; FAR: there is no way

A row belongs to a goal cell and a type of robot. Rows are computed when they are asked for; the oldest
one that was not used in this tick is overwritten.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from automaton.engine.facilities import MAY_TURN
from automaton.engine.jit.fields import CONSTANT, SCRATCH, field
from automaton.engine.jit.structs import Struct
from automaton.engine.state import NIL, Array
from automaton.strategy.kernels import kernel

FAR = 2047
AGAINST_STREET = 3
BUCKETS = 4  # more than the dearest move
UNVISITED = 1 << 30


class DistanceTables(Struct):
    """Rows of distances, and scratch to compute them."""

    cell_index: Array = field("(C,) int32", "number of a drivable cell, else 0", role=CONSTANT)
    drivable: Array = field("(f,) int32", "the drivable cells", role=CONSTANT)
    move_cost: Array = field("(C, 4) uint8", "of leaving a cell in a direction", role=CONSTANT)
    pattern: Array = field("(32,) uint8", "what headings E S W N add, 2 bits each", role=CONSTANT)
    pattern_number: Array = field("(256,) uint8", "the inverse", role=CONSTANT)
    distances: Array = field("(R, f) uint16", "rows, by number of the cell", role=SCRATCH)
    row_of: Array = field(
        "(K C,) int32", "by type and goal cell, or NIL", default=NIL, role=SCRATCH
    )
    owner: Array = field("(R,) int32", "the entry of row_of, or NIL", default=NIL, role=SCRATCH)
    used: Array = field("(R,) int64", "tick in which a row was last asked for", role=SCRATCH)
    hand: Array = field("(1,) int64", "the row to overwrite next", role=SCRATCH)
    cost: Array = field("(P,) int32", "by pose = cell * 4 + heading", role=SCRATCH)
    bucket: Array = field("(4, P) int32", "poses by cost modulo 4", role=SCRATCH)
    bucket_size: Array = field("(4,) int64", role=SCRATCH)


def distance_tables(grid, guided, budget):
    """Return empty tables for a floor of the world's `grid` in so many bytes of memory."""
    types, cells = grid.type_cell_flags.shape
    drivable = np.flatnonzero(grid.cell_flags & MAY_TURN).astype(np.int32)
    cell_index = np.zeros(cells, np.int32)
    cell_index[drivable] = np.arange(len(drivable))
    pattern, pattern_number = heading_patterns()
    rows = max(1, min(types * len(drivable), budget // (2 * max(1, len(drivable)))))
    return DistanceTables.sized(
        {"R": rows, "K C": types * cells, "P": 4 * cells},
        cell_index=cell_index,
        drivable=drivable,
        move_cost=move_costs(cells, grid.width, guided),
        pattern=pattern,
        pattern_number=pattern_number,
    )


def heading_patterns():
    """Return (32,) what the headings add by pattern, 2 bits each, and (256,) the inverse."""
    pattern, number = np.zeros(32, np.uint8), np.zeros(256, np.uint8)
    count = 0
    for added in product(range(3), repeat=4):
        neighbours = zip(added, added[1:] + added[:1], strict=True)
        if min(added) == 0 and all(abs(a - b) <= 1 for a, b in neighbours):
            pattern[count] = sum(a << 2 * heading for heading, a in enumerate(added))
            number[pattern[count]] = count
            count += 1
    return pattern, number


def move_costs(cells, stride, guided):
    """Return (C, 4): 1, or with streets 3 against them.

    Odd rows run east, even ones west; even columns run south, odd ones north.
    """
    costs = np.ones((cells, 4), np.uint8)
    if guided:
        y, x = np.divmod(np.arange(cells), stride)
        odd_row, odd_column = (y - 1) % 2 == 1, (x - 1) % 2 == 1
        for direction, against in enumerate((~odd_row, odd_column, odd_row, ~odd_column)):
            costs[against, direction] = AGAINST_STREET
    return costs


@kernel
def row_to(grid, stop, tables, robot_type, goal, tick):
    """Return the row of distances to a goal cell; NIL once stop[0] is set."""
    entry = robot_type * tables.cell_index.shape[0] + goal
    row = np.int64(tables.row_of[entry])
    if row == NIL:
        row = free_row(tables, tick)
        if not fill_costs(grid, stop, tables, robot_type, goal):
            return np.int64(NIL)
        pack_row(tables, row)
        tables.owner[row] = entry
        tables.row_of[entry] = row
    tables.used[row] = tick
    return row


@kernel
def free_row(tables, tick):
    """Return the next row that was not used in this tick, or any if all were."""
    rows = tables.owner.shape[0]
    row = tables.hand[0]
    for _ in range(rows):
        if tables.owner[row] == NIL or tables.used[row] != tick:
            break
        row = (row + 1) % rows
    tables.hand[0] = (row + 1) % rows
    if tables.owner[row] != NIL:
        tables.row_of[tables.owner[row]] = NIL
        tables.owner[row] = NIL
    return row


@kernel
def fill_costs(grid, stop, tables, robot_type, goal):
    """Write the least cost from each pose to the goal cell into tables.cost; False if given up."""
    flags = grid.type_cell_flags[robot_type]
    cost, size = tables.cost, tables.bucket_size
    cost[:] = UNVISITED
    for heading in range(4):
        enter_pose(tables, goal * 4 + heading, 0)
    level = 0
    idle = 0
    while idle < BUCKETS and stop[0] == 0:
        now = level % BUCKETS
        idle += 1
        k = 0
        while k < size[now]:
            pose = np.int64(tables.bucket[now, k])
            k += 1
            if cost[pose] != level:
                continue  # a cheaper way to it is known
            idle = 0
            cell, heading = pose >> 2, pose & 3
            before = cell - grid.offset[heading]
            if 0 <= before < flags.shape[0] and (np.int64(flags[before]) >> heading) & 1:
                enter_pose(
                    tables,
                    before * 4 + heading,
                    level + np.int64(tables.move_cost[before, heading]),
                )
            enter_pose(tables, cell * 4 + ((heading + 1) & 3), level + 1)
            enter_pose(tables, cell * 4 + ((heading + 3) & 3), level + 1)
        size[now] = 0
        level += 1
    size[:] = 0
    return stop[0] == 0


@kernel
def enter_pose(tables, pose, cost):
    """Enter a pose into its bucket if this cost is less; at most once in each bucket."""
    if cost < tables.cost[pose]:
        tables.cost[pose] = cost
        bucket = cost % BUCKETS
        tables.bucket[bucket, tables.bucket_size[bucket]] = pose
        tables.bucket_size[bucket] += 1


@kernel
def pack_row(tables, row):
    """Write tables.cost into a row."""
    for k in range(tables.drivable.shape[0]):
        pose = np.int64(tables.drivable[k]) * 4
        east, south = np.int64(tables.cost[pose]), np.int64(tables.cost[pose + 1])
        west, north = np.int64(tables.cost[pose + 2]), np.int64(tables.cost[pose + 3])
        least = min(min(east, south), min(west, north))
        added = (east - least) | (south - least) << 2 | (west - least) << 4 | (north - least) << 6
        if least >= FAR:
            least, added = FAR, 0
        tables.distances[row, k] = np.uint16(least << 5 | np.int64(tables.pattern_number[added]))


@kernel
def least_distance(tables, row, cell):
    """Return the least cost from a cell in any heading, FAR if there is no way."""
    return np.int64(tables.distances[row, tables.cell_index[cell]]) >> 5


@kernel
def distance_from(tables, row, cell, heading):
    """Return the least cost from a pose."""
    word = np.int64(tables.distances[row, tables.cell_index[cell]])
    return (word >> 5) + ((np.int64(tables.pattern[word & 31]) >> (2 * heading)) & 3)
