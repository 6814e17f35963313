"""Look-ups of robots by cell: entering the holders of cells, and idle robots that may give way.

The crowd stands still on a floor that it nearly fills. Each robot must follow a chain of robots
across the floor, so the cost per robot must not grow with the fleet.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from automaton.bench.measurement import (
    NS_PER_ROBOT_AND_TICK,
    Measurement,
    Sample,
    cpu_seconds,
    open_floor,
    scene,
)
from automaton.bench.step_speed import WalkingFleet, walking_fleet
from automaton.engine.holders import enter_holders, remove_holders
from automaton.runs.simulation import Simulation
from automaton.strategy import lookup
from automaton.world.resolved import StrategyChoice

SPARSE, ROUNDS = WalkingFleet(100_000, 1000), 20
CROWDS, TICKS = (1_000, 4_000), 50


def measurements() -> list[Measurement]:
    """Holders of a large fleet, and crowds of two sizes."""
    return [
        Measurement(
            "holders of 100,000 on 1000x1000",
            NS_PER_ROBOT_AND_TICK,
            partial(prepare_holders, SPARSE),
        ),
        *(
            Measurement(
                f"giving way in a crowd of {robots:,}",
                NS_PER_ROBOT_AND_TICK,
                partial(prepare_crowd, robots),
            )
            for robots in CROWDS
        ),
    ]


def prepare_holders(case: WalkingFleet) -> Sample:
    """A sampler: ns per robot to enter and remove the holders of all cells."""
    world = walking_fleet(case)

    def rounds() -> None:
        for _ in range(ROUNDS):
            enter_holders(world)
            remove_holders(world)

    return lambda: 1e9 * cpu_seconds(rounds) / (ROUNDS * case.robots)


def prepare_crowd(robots: int, ticks: int = TICKS) -> Sample:
    """A sampler: ns per robot and tick of idle robots on a floor that has 2 % of its cells free."""
    simulation = idle_crowd(robots)
    world = simulation.world

    def sample() -> float:
        until = simulation.tick + ticks
        seconds = cpu_seconds(lambda: simulation.run(until))
        if (world.robots.cell < 0).any() or world.tally.operations.any():
            raise AssertionError("the crowd did not stand still")
        return 1e9 * seconds / (robots * ticks)

    return sample


def idle_crowd(robots: int) -> Simulation:
    """Robots without tasks that are asked in every tick whether they give way."""
    side = round((1.02 * robots) ** 0.5)
    resolved = scene(open_floor(side, -(-102 * robots // (100 * side))), robots)
    parameters = lookup.parameters_type("right_of_way", "retreat")(idle_give_way=True)
    strategies = resolved.strategies | {"right_of_way": StrategyChoice("retreat", parameters)}
    simulation = Simulation(replace(resolved, strategies=strategies))
    simulation.run(1)
    return simulation
