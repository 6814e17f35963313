"""How long a move takes where zones or speed limits slow robots down, or where chance does.

A MOVE that starts in a zone with m robots takes m times as long (Bhattathiri, Li & Kuhl). m is
what the zone held when the tick began, each robot counted in the cell that it stands in or leaves,
the mover always included. Cells in no zone slow no robot down. A speed limit holds before zones multiply;
a tick more, by a draw, comes on top.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.motion import ENTERED, LIVE, U
from automaton.engine.random_numbers import STREAM_EXTRA_TICKS, random_bits
from automaton.engine.speed_limits import limited_ticks
from automaton.engine.state import ACTION_MOVE, CLOCK_COARSE_TICK, NIL

MAX_MOVE_TICKS = 65_535  # what robots.busy and traffic.move_ticks can hold


@kernel
def count_robots(grid, robots, zone_occupancy):
    """crowd[zone] = robots in it; call before anything moves or leaves its parking bay."""
    zone_occupancy[:] = 0
    for i in range(robots.cell.shape[0]):
        cell = np.int64(robots.cell[U(i)])
        if cell != NIL:
            traffic_zone = np.int64(
                grid.traffic_zone[U(cell), U(np.int64(robots.travel[U(i)]) >> 1)]
            )
            if traffic_zone != NIL:
                zone_occupancy[U(traffic_zone)] += 1


@kernel
def set_move_ticks(world):
    """Set traffic.move_ticks of every move that is wanted in this tick."""
    traffic = world.traffic
    for i in range(world.robots.cell.shape[0]):
        intent = np.int64(traffic.intent[U(i)])
        if intent & LIVE:
            traffic.move_ticks[U(i)] = min(ticks_of_move(world, i, intent), MAX_MOVE_TICKS)


@kernel
def ticks_of_move(world, i, intent):
    """What a move of robot i takes if it starts now."""
    rules = world.rules
    usual = np.int64(rules.duration[U(world.robots.type[U(i)]), U(ACTION_MOVE)])
    ticks = limited_ticks(world.grid, usual, np.int64(world.robots.cell[U(i)]), intent & 3)
    if rules.slowdown:
        ticks *= robots_in_zone(world, i, intent)
    if rules.extra_tick:
        identity = world.robots.identity[U(i)]
        tick = world.clock[CLOCK_COARSE_TICK]
        bits = random_bits(rules.seed, STREAM_EXTRA_TICKS, tick, identity)
        ticks += rules.refinement if np.int64(bits >> np.uint64(32)) < rules.extra_tick else 0
    return ticks


@kernel
def robots_in_zone(world, i, intent):
    """Robots that slow a move of robot i out of its cell, itself included; 1 where there is no zone."""
    cell = np.int64(world.robots.cell[U(i)])
    traffic_zone = np.int64(world.grid.traffic_zone[U(cell), U((intent & 3) >> 1)])
    if traffic_zone == NIL:
        return 1
    came = np.int64(world.grid.traffic_zone[U(cell), U(np.int64(world.robots.travel[U(i)]) >> 1)])
    counted = came == traffic_zone and intent & ENTERED == 0
    return np.int64(world.traffic.zone_occupancy[U(traffic_zone)]) + (0 if counted else 1)
