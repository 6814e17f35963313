"""Robots that carry pods to stations with queues, for each robot and tick; lines that become trips."""

from __future__ import annotations

from functools import partial

from automaton.bench.measurement import NS_PER_ROBOT_AND_TICK, Measurement, Sample, cpu_seconds
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

GOODS_SCENARIO = "goods-60x40"
STARTED, TICKS = 500, 2000
POD_RIGHTS_OF_WAY = ("pibt", "retreat")


def measurements() -> list[Measurement]:
    """The shipped floor with 30 robots, while it gets through."""
    return [
        Measurement(
            f"{GOODS_SCENARIO}, whole tick with {right_of_way}",
            NS_PER_ROBOT_AND_TICK,
            partial(prepare_pods, right_of_way),
        )
        for right_of_way in POD_RIGHTS_OF_WAY
    ]


def prepare_pods(right_of_way: str, started: int = STARTED, ticks: int = TICKS) -> Sample:
    """A sampler: ns per robot and tick of so many ticks, after the first ones."""
    resolved = resolve(GOODS_SCENARIO, (f"strategy.right_of_way={right_of_way}",))
    robots = resolved.scenario.fleet.robots

    def sample() -> float:
        simulation = Simulation(resolved)
        simulation.run(started)
        seconds = cpu_seconds(lambda: simulation.run(started + ticks))
        return 1e9 * seconds / (robots * ticks)

    return sample
