"""The bare step: every robot wants to move in a random direction, all occupancy rules apply."""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import mix
from automaton.kernels.motion import LIVE, U, move_all


@kernel
def random_walk(world, first, last):
    """Run the ticks first .. last-1 of a fleet whose intents are drawn by the hash."""
    robots, traffic = world.robots, world.traffic
    for tick in range(first, last):
        base = np.uint64(tick) << np.uint64(32)
        for i in range(robots.cell.shape[0]):
            bits = mix(base | np.uint64(robots.identity[U(i)]))
            free = robots.busy[U(i)] == 0
            traffic.want[U(i)] = np.uint8(LIVE | np.int64(bits >> np.uint64(62))) if free else 0
        move_all(world.grid, world.rules, robots, traffic, tick)
