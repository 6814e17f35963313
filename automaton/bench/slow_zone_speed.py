"""What slow zones and the network cost: a fleet in the warehouse of Bhattathiri, Li & Kuhl.

The fleet drives with or without the rule of slow zones, all decisions included: A* plans each leg, of
which there are fewer where zones slow robots down. The network is asked about legs, one after the
other, as in a run.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from automaton.bench.measurement import NS_PER_ROBOT_AND_TICK, US, Measurement, Sample, cpu_seconds
from automaton.build.resolve import resolve
from automaton.papers.traffic.traffic_network import SCENARIO
from automaton.papers.traffic.traffic_trials import tasks_of, warehouse
from automaton.runs.simulation import Simulation
from strategies.routing.traffic_avoidance.network_files import (
    network_for,
    shipped,
)
from strategies.routing.traffic_avoidance.zone_network import kernel_network, predict_legs

ROBOTS, TICKS = 100, 1000
LEGS, SEED = 1000, 1


def measurements() -> list[Measurement]:
    """A tick of a fleet with each rule of slowdown, and a leg asked of the network."""
    return [
        Measurement(
            f"warehouse-100, {ROBOTS} robots, slowdown {rule}",
            NS_PER_ROBOT_AND_TICK,
            partial(prepare_fleet, rule),
        )
        for rule in ("none", "zones")
    ] + [Measurement("zones of a leg by the network", US, prepare_network)]


def prepare_fleet(rule: str, robots: int = ROBOTS, ticks: int = TICKS) -> Sample:
    """A sampler: ns per robot and tick; each sample is a run of its own."""
    settings = (f"world.slowdown={rule}", f"fleet.robots={robots}", f"stop.max_duration={ticks}")
    resolved = resolve(SCENARIO, (*settings, "measure.warm_up=0", "strategy.routing=astar"))

    def sample() -> float:
        simulation = Simulation(resolved)
        return 1e9 * cpu_seconds(simulation.run) / (robots * ticks)

    return sample


def prepare_network(legs: int = LEGS) -> Sample:
    """A sampler: us for a leg, from a start and a destination to the zones used."""
    where = warehouse()
    network = network_for(where.grid, where.duration, shipped(SCENARIO))
    zones = where.grid.traffic_zone[tasks_of(where, SEED, legs)[:, 0], 0].astype(np.int64)
    used = np.zeros((legs, -(-where.grid.traffic_zone_count // 64)), np.int64)
    start, end = zones[:, 0].copy(), zones[:, 1].copy()
    arguments = (kernel_network(network), start, end, used)  # type: ignore[no-untyped-call]
    return lambda: 1e6 * cpu_seconds(lambda: predict_legs(*arguments)) / legs
