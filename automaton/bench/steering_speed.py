"""What a tick costs where right of way steers a large fleet: 10,000 robots in one-way aisles.

All distance tables are there when the measurement begins.
"""

from __future__ import annotations

from functools import partial

import msgspec

from automaton.bench.measurement import NS_PER_ROBOT_AND_TICK, Measurement, Sample, cpu_seconds
from automaton.build.resolve import resolve
from automaton.engine.search import table_of
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Fleet, Orders, Scenario, Stop, Strategies, WorldRules

ROBOTS = 10_000
STARTED = 100  # ticks until the fleet has spread
TICKS = 20  # of a sample
# 499 x 134 cells, 39,366 of them free.
FLOOR = {"generator": "aisles", "aisles": 249, "sections": 11, "length": 10, "one_way": True}


def measurements() -> list[Measurement]:
    """Whole ticks under both strategies that steer."""
    return [
        Measurement(
            f"whole tick, {name}, 10,000 robots",
            NS_PER_ROBOT_AND_TICK,
            partial(prepare_fleet, name),
        )
        for name in ("pibt", "epibt")
    ]


def prepare_fleet(
    right_of_way: str,
    robots: int = ROBOTS,
    floor: dict[str, object] = FLOOR,
    started: int = STARTED,
) -> Sample:
    """A sampler: ns per robot and tick of the next ticks, orders and allocation included."""
    simulation = Simulation(resolve(steered_fleet(right_of_way, robots, floor)))
    compute_tables(simulation)
    simulation.run(started)

    def sample() -> float:
        until = simulation.tick + TICKS
        return 1e9 * cpu_seconds(lambda: simulation.run(until)) / (robots * TICKS)

    return sample


def steered_fleet(
    right_of_way: str, robots: int = ROBOTS, floor: dict[str, object] = FLOOR
) -> Scenario:
    """A run without end in which every robot always has an order."""
    return Scenario(
        name="bench",
        layout=floor,
        fleet=Fleet(robots=robots, kinematics="differential", start="random"),
        orders=tours(robots),
        world=WorldRules(distance_tables="4 GiB"),
        strategy=Strategies(allocation="greedy", right_of_way=right_of_way),
        stop=Stop(when="never", max_duration=1_000_000),
    )


def compute_tables(simulation: Simulation) -> None:
    """Compute the distance tables to all cells: what they cost is measured by another part."""
    view, workspace = simulation.view, simulation.workspace
    for cell in view.grid.drivable.tolist():
        table_of(view, workspace, 0, cell)


def tours(robots: int) -> Orders:
    """Orders of two stops each, one and a half times as many open as there are robots."""
    return msgspec.convert(
        {
            "generator": "tours",
            "count": 100 * robots,
            "stops": {"from": 2, "to": 2},
            "arrivals": {"closed_loop": {"in_system": robots + robots // 2}},
        },
        Orders,
    )
