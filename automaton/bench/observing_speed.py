"""What it costs to observe a run, as the viewer does: the same fleet with and without, by turns."""

from __future__ import annotations

from functools import partial

import numpy as np

from automaton.bench.bench_floors import open_floor, scene
from automaton.bench.measurement import NS_PER_ROBOT_AND_TICK, Measurement, Sample, cpu_seconds
from automaton.bench.route_speed import give_routes
from automaton.engine.state import GOAL_CHARGE, NIL
from automaton.runs.simulation import Simulation

ROBOTS, SIDE, TICKS = 10_000, 1000, 100


def measurements() -> list[Measurement]:
    """A fleet in which no robot waits, and one in which robots are in each other's way."""
    return [
        Measurement("observing, all on the way", NS_PER_ROBOT_AND_TICK, prepare),
        Measurement(
            "observing, a tenth waits", NS_PER_ROBOT_AND_TICK, partial(prepare, at_random=True)
        ),
    ]


def prepare(
    robots: int = ROBOTS, side: int = SIDE, ticks: int = TICKS, at_random: bool = False
) -> Sample:
    """A sampler: ns per robot and tick with less those without. `side` is even."""
    fleets = [fleet(robots, side, observed) for observed in (False, True)]
    seeds = iter(range(1_000_000))

    def sample() -> float:
        seed = next(seeds) if at_random else None
        alone, observed = (seconds_of_driving(simulation, ticks, seed) for simulation in fleets)
        if not np.array_equal(fleets[0].world.robots.cell, fleets[1].world.robots.cell):
            raise AssertionError("the fleet that was observed drove elsewhere")
        return 1e9 * (observed - alone) / (robots * ticks)

    return sample


def fleet(robots: int, side: int, observed: bool) -> Simulation:
    """Robots at random places; what is observed is thrown away."""
    resolved = scene(open_floor(side, side), robots)
    return Simulation(resolved, on_observe=Simulation.empty_observation if observed else None)


def seconds_of_driving(simulation: Simulation, ticks: int, seed: int | None) -> float:
    """CPU seconds of the next ticks, round the rings or, with a seed, wherever the draws say."""
    world = simulation.world
    if seed is None:
        give_routes(world, world.grid.width - 2, ticks)
    else:
        robots = world.robots
        draws = np.random.default_rng(seed).integers(0, 4, (len(robots.cell), ticks))
        robots.route[:, :ticks] = draws
        robots.route_length[:], robots.route_index[:] = ticks, 0
        robots.goal_type[:], robots.goal_cell[:] = GOAL_CHARGE, NIL
    until = simulation.tick + ticks
    return cpu_seconds(lambda: simulation.run(until))
