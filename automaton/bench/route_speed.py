"""The loop while driving: long routes are set in advance and no layer is asked.

>>>>>v    Each pair of rows is a ring; all its robots drive round clockwise,
^<<<<<    so that no robot is in any other robot's way and every robot moves in every tick.

Also the cost of observing a run, as the viewer does: the same fleet alternately with and without.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from automaton.bench.measurement import (
    NS_PER_ROBOT_AND_TICK,
    Measurement,
    Sample,
    cpu_seconds,
    open_floor,
    scene,
)
from automaton.engine.state import ACTION_MOVE, GOAL_PICK, NIL, Array, World
from automaton.floor.floor_plan import EAST, NORTH, SOUTH, WEST
from automaton.runs.simulation import Simulation

ROBOTS, SIDE, TICKS = 10_000, 1000, 500
OBSERVING_TICKS = 100


def measurements() -> list[Measurement]:
    """One: 10,000 robots on 1000 x 1000."""
    return [Measurement("routes driven without decisions", NS_PER_ROBOT_AND_TICK, prepare)]


def prepare(robots: int = ROBOTS, side: int = SIDE, ticks: int = TICKS) -> Sample:
    """A sampler: ns per robot and tick; every sample gets its own routes. `side` is even."""
    simulation = circling_fleet(robots, side)

    def sample() -> float:
        return 1e9 * cpu_seconds_of_driving(simulation, ticks) / (robots * ticks)

    return sample


def circling_fleet(robots: int, side: int) -> Simulation:
    """Robots at random places, all driving: allocation has been asked and has decided nothing."""
    simulation = Simulation(scene(open_floor(side, side), robots))
    give_routes(simulation.world, side, 2)
    simulation.run(1)
    return simulation


def cpu_seconds_of_driving(simulation: Simulation, ticks: int) -> float:
    """Drive; raises AssertionError if a robot stood still or a layer was asked."""
    world = simulation.world
    give_routes(world, world.grid.width - 2, ticks + 1)
    moved, batches = moves(world), world.tally.batches.copy()
    until = simulation.tick + ticks
    seconds = cpu_seconds(lambda: simulation.run(until))
    if moves(world) - moved != ticks * len(world.robots.cell):
        raise AssertionError("some robots did not drive")
    if not np.array_equal(world.tally.batches, batches):
        raise AssertionError("a layer was asked")
    return seconds


def moves(world: World) -> int:
    """Moves made by the whole fleet so far."""
    return int(world.tally.operations[:, ACTION_MOVE].sum())


def give_routes(world: World, width: int, steps: int) -> None:
    """Set routes with a number of steps round the rings, from the robots' cells."""
    robots = world.robots
    y, x = np.divmod(robots.cell, world.grid.width)
    row, column = y - 1, x - 1
    position = np.where(row % 2 == 0, column, 2 * width - 1 - column)
    ahead = np.arange(steps)
    robots.route[:, :steps] = ring(width)[(position[:, None] + ahead) % (2 * width)]
    robots.route_length[:] = steps
    robots.route_index[:] = 0
    # A goal that is nowhere: no decisions are needed on the way.
    robots.goal_type[:] = GOAL_PICK
    robots.goal_cell[:] = NIL


def ring(width: int) -> Array:
    """(2 width,) uint8: directions round a ring from its upper left cell."""
    directions = np.full(2 * width, EAST, np.uint8)
    directions[width - 1] = SOUTH
    directions[width:] = WEST
    directions[-1] = NORTH
    return directions


def observing_measurements() -> list[Measurement]:
    """A fleet in which no robot waits, and one in which robots block each other."""
    return [
        Measurement("observing, all on the way", NS_PER_ROBOT_AND_TICK, prepare_observing),
        Measurement(
            "observing, a tenth waits",
            NS_PER_ROBOT_AND_TICK,
            partial(prepare_observing, at_random=True),
        ),
    ]


def prepare_observing(
    robots: int = ROBOTS, side: int = SIDE, ticks: int = OBSERVING_TICKS, at_random: bool = False
) -> Sample:
    """A sampler: ns per robot and tick with observation minus those without. `side` is even."""
    fleets = [observed_fleet(robots, side, observed) for observed in (False, True)]
    seeds = iter(range(1_000_000))

    def sample() -> float:
        seed = next(seeds) if at_random else None
        alone, observed = (seconds_of_observing(simulation, ticks, seed) for simulation in fleets)
        if not np.array_equal(fleets[0].world.robots.cell, fleets[1].world.robots.cell):
            raise AssertionError("the fleet that was observed drove elsewhere")
        return 1e9 * (observed - alone) / (robots * ticks)

    return sample


def observed_fleet(robots: int, side: int, observed: bool) -> Simulation:
    """Robots at random places; observations are discarded."""
    resolved = scene(open_floor(side, side), robots)
    return Simulation(resolved, on_observe=Simulation.empty_observation if observed else None)


def seconds_of_observing(simulation: Simulation, ticks: int, seed: int | None) -> float:
    """CPU seconds of the next ticks, round the rings or, with a seed, in random directions."""
    world = simulation.world
    if seed is None:
        give_routes(world, world.grid.width - 2, ticks)
    else:
        robots = world.robots
        draws = np.random.default_rng(seed).integers(0, 4, (len(robots.cell), ticks))
        robots.route[:, :ticks] = draws
        robots.route_length[:], robots.route_index[:] = ticks, 0
        robots.goal_type[:], robots.goal_cell[:] = GOAL_PICK, NIL
    until = simulation.tick + ticks
    return cpu_seconds(lambda: simulation.run(until))
