"""How long a move takes where zones slow robots down, or where chance does.

A MOVE that starts in a zone with m robots takes m times as long (Bhattathiri, Li & Kuhl). m is
what the zone held when the tick began, each robot counted in the cell that it stands in or leaves,
the mover always included. Cells in no zone slow nobody down. A tick more, by a draw, comes on top.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import EXTRA_TICKS, draw
from automaton.kernels.motion import ENTERED, LIVE, U
from automaton.world.state import MOVE, NIL, TICK

MOST_TICKS = 65_535  # what robots.busy and traffic.span can hold


@kernel
def count_robots(grid, robots, crowd):
    """crowd[zone] = robots in it; call before anything moves or leaves its bay."""
    crowd[:] = 0
    for i in range(robots.cell.shape[0]):
        cell = np.int64(robots.cell[U(i)])
        if cell != NIL:
            zone = np.int64(grid.zone[U(cell), U(np.int64(robots.travel[U(i)]) >> 1)])
            if zone != NIL:
                crowd[U(zone)] += 1


@kernel
def slow_down(world):
    """Set traffic.span of every move that is wanted in this tick."""
    traffic = world.traffic
    for i in range(world.robots.cell.shape[0]):
        want = np.int64(traffic.want[U(i)])
        if want & LIVE:
            traffic.span[U(i)] = min(ticks_of_move(world, i, want), MOST_TICKS)


@kernel
def ticks_of_move(world, i, want):
    """What a move of robot i takes if it starts now."""
    rules = world.rules
    ticks = np.int64(rules.duration[U(world.robots.type[U(i)]), U(MOVE)])
    if rules.slowdown:
        ticks *= robots_around(world, i, want)
    if rules.extra_tick:
        identity = world.robots.identity[U(i)]
        bits = draw(rules.seed, EXTRA_TICKS, world.clock[TICK], identity)
        ticks += 1 if np.int64(bits >> np.uint64(32)) < rules.extra_tick else 0
    return ticks


@kernel
def robots_around(world, i, want):
    """Robots that slow a move of robot i out of its cell, itself included; 1 where there is no zone."""
    cell = np.int64(world.robots.cell[U(i)])
    zone = np.int64(world.grid.zone[U(cell), U((want & 3) >> 1)])
    if zone == NIL:
        return 1
    came = np.int64(world.grid.zone[U(cell), U(np.int64(world.robots.travel[U(i)]) >> 1)])
    counted = came == zone and want & ENTERED == 0
    return np.int64(world.traffic.crowd[U(zone)]) + (0 if counted else 1)
