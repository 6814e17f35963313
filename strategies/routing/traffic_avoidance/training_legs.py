"""Single legs and the zones of their paths: what networks learn from."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from automaton.strategy.kernels import random_between
from strategies.routing.astar.astar import search
from strategies.routing.traffic_avoidance.path_zones import add_zones

STREAM_LEGS = 13  # of random draws; each stream has a number of its own


@kernel
def draw_legs(racks, docks, seed, start, end):
    """Legs from a rack to a dock and back by turns, drawn by (seed, leg); start, end: (n,) cells."""
    for k in range(start.shape[0]):
        rack = racks[random_between(0, racks.shape[0] - 1, seed, STREAM_LEGS, 0, k)]
        dock = docks[random_between(0, docks.shape[0] - 1, seed, STREAM_LEGS, 1, k)]
        start[k] = dock if k & 1 else rack
        end[k] = rack if k & 1 else dock


@kernel
def trace_legs(grid, duration, workspace, ties, start, end, used):
    """used[k] = the zones of the A* path from pose start[k] to cell end[k]; used: (n, words).

    Returns how many legs were traced: it stops at one that cannot be driven.
    """
    for k in range(start.shape[0]):
        used[k] = 0
        pose = search(grid, 0, duration, workspace, ties, np.uint64(0), start[k], end[k], False)
        if pose == NIL:
            return np.int64(k)
        add_zones(grid, workspace, pose, used[k])
    return np.int64(start.shape[0])
