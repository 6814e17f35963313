"""Kernels that the bench measures: the bare step, and look-ups in distance tables.

In the bare step every robot tries to move in a random direction, and all occupancy rules apply.
"""

from __future__ import annotations

import numpy as np

from automaton.engine.distance_tables import DistanceTables
from automaton.engine.jit.kernel import U, kernel
from automaton.engine.jit.structs import NIL
from automaton.engine.motion import LIVE, move_all
from automaton.engine.random_numbers import splitmix64
from automaton.engine.state import Array, World
from automaton.engine.table_rows import cost_in, forget, row_to


@kernel
def random_walk(world: World, first: int, last: int) -> None:
    """Run the ticks first .. last-1 of a fleet whose intents are drawn by the hash."""
    robots, traffic = world.robots, world.traffic
    for tick in range(first, last):
        base = np.uint64(tick) << np.uint64(32)
        for i in range(robots.cell.shape[0]):
            bits = splitmix64(base | np.uint64(robots.identity[U(i)]))
            free = robots.busy[U(i)] == 0
            traffic.intent[U(i)] = np.uint8(LIVE | np.int64(bits >> np.uint64(62))) if free else 0
        move_all(world.grid, world.rules, robots, traffic, tick)


@kernel
def random_walk_in_spans(world: World, first: int, last: int) -> None:
    """As random_walk, but a tenth of the moves take 2 or 3 ticks."""
    robots, traffic = world.robots, world.traffic
    for tick in range(first, last):
        base = np.uint64(tick) << np.uint64(32)
        for i in range(robots.cell.shape[0]):
            traffic.intent[U(i)] = 0
            if robots.busy[U(i)] == 0:
                bits = splitmix64(base | np.uint64(robots.identity[U(i)]))
                traffic.intent[U(i)] = np.uint8(LIVE | np.int64(bits >> np.uint64(62)))
                slow = np.int64(bits) & 1023 < 102
                traffic.move_ticks[U(i)] = 2 + (np.int64(bits >> np.uint64(10)) & 1) if slow else 1
        move_all(world.grid, world.rules, robots, traffic, tick)


@kernel
def compute(tables: DistanceTables, goals: Array) -> None:
    """Compute the tables to some goals, even if they exist."""
    for k in range(goals.shape[0]):
        row = tables.row_of[goals[k]]
        if row != NIL:
            forget(tables, row)
        row_to(tables, 0, goals[k], 0, False)


@kernel
def rank_options(
    tables: DistanceTables, goals: Array, cells: Array, headings: Array, rounds: int
) -> np.int64:
    """Look up the cost of staying and of each neighbour, for robots with a goal each; returns the
    sum."""
    total = np.int64(0)
    for _ in range(rounds):
        for k in range(goals.shape[0]):
            row = row_to(tables, 0, goals[k], 0, True)
            total += cost_in(tables, row, cells[k], headings[k])
            for direction in range(4):
                after = cells[k] + tables.offset[direction]
                if tables.number[after] != NIL:
                    total += cost_in(tables, row, after, direction)
    return total
