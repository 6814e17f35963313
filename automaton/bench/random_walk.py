"""The bare step: every robot wants to move in a random direction, all occupancy rules apply."""

from __future__ import annotations

import numpy as np

from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import LIVE, move_all
from automaton.engine.random_numbers import splitmix64
from automaton.engine.state import World


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
