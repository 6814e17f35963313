"""The cost of a tick under each right of way: 400 robots on an open floor, 10,000 in one-way
aisles; and of weights of streets that all are 1.

Whole ticks are measured, including orders, allocation and, if used, routes. All distance tables
exist when the measurement begins.
"""

from __future__ import annotations

from functools import partial
from typing import Any, Final, NamedTuple

import msgspec

from automaton.bench.measurement import (
    NS_PER_ROBOT_AND_TICK,
    TIMES_THE_RUN,
    Measurement,
    Sample,
    cpu_seconds,
)
from automaton.engine.search import table_of
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Fleet, Orders, Scenario, Stop, Strategies, WorldRules
from automaton.world.resolve import resolve

STEERING_RIGHTS_OF_WAY: Final = ("retreat", "wait", "pibt", "epibt")


class BusyFleet(NamedTuple):
    """A fleet that always has work."""

    robots: int
    floor: dict[str, Any]
    started: int  # ticks until the fleet has spread
    ticks: int  # ticks of a sample


OPEN_FLOOR: Final = {
    "generator": "random",
    "columns": 32,
    "rows": 32,
    "obstacles": 0.2,
}  # 819 free cells
AISLES: Final = {  # 499 x 134 cells, 39,366 of them free
    **{"generator": "aisles", "aisles": 249, "sections": 11, "length": 10},
    "one_way": True,
}
BUSY_CROWD: Final = BusyFleet(10_000, AISLES, 100, 20)
TURNS: Final = 40  # of two runs that are compared, since the speed of a machine varies
ALL_ONE: Final = "streets={preset: crisscross, along: 1, against: 1}"
BUSY_FLEETS: Final = (BusyFleet(400, OPEN_FLOOR, 100, 400), BUSY_CROWD)
LONGER: Final = BUSY_FLEETS[0]._replace(ticks=2000)


def measurements() -> list[Measurement]:
    """Whole ticks under each right of way, and with weights that all are 1."""
    ones = "whole tick, pibt, 400 robots, weights that all are 1"
    ticks = [
        Measurement(
            f"whole tick, {name}, {case.robots:,} robots",
            NS_PER_ROBOT_AND_TICK,
            partial(prepare_fleet, name, case),
        )
        for case in BUSY_FLEETS
        for name in STEERING_RIGHTS_OF_WAY
    ]
    return [*ticks, Measurement(ones, TIMES_THE_RUN, partial(prepare_ones, LONGER))]


def prepare_fleet(right_of_way: str, case: BusyFleet) -> Sample:
    """A sampler: ns per robot and tick of the next ticks, including orders and allocation."""
    simulation = Simulation(resolve(busy_fleet(right_of_way, case)))
    compute_tables(simulation)
    simulation.run(case.started)

    def sample() -> float:
        until = simulation.tick + case.ticks
        return 1e9 * cpu_seconds(lambda: simulation.run(until)) / (case.robots * case.ticks)

    return sample


def prepare_ones(case: BusyFleet) -> Sample:
    """A sampler: the CPU time of ticks with weights of 1 / that without weights, of equal runs."""
    ones, none = (
        Simulation(resolve(busy_fleet("pibt", case), settings)) for settings in ((ALL_ONE,), ())
    )
    for simulation in (ones, none):
        compute_tables(simulation)
        simulation.run(case.started)

    def sample() -> float:
        seconds = dict.fromkeys((ones, none), 0.0)
        for _ in range(TURNS):
            until = none.tick + case.ticks // TURNS
            for run in seconds:
                seconds[run] += cpu_seconds(partial(run.run, until))
        if ones.digest != none.digest:
            raise AssertionError("weights of 1 changed the run")
        return seconds[ones] / seconds[none]

    return sample


def busy_fleet(right_of_way: str, case: BusyFleet = BUSY_CROWD) -> Scenario:
    """An endless run in which every robot always has an order."""
    return Scenario(
        name="bench",
        layout=case.floor,
        fleet=Fleet(robots=case.robots, kinematics="differential", start="random"),
        orders=tours(case.robots),
        world=WorldRules(distance_tables="4 GiB"),
        strategy=Strategies(allocation="greedy", right_of_way=right_of_way),
        stop=Stop(when="never", max_duration=1_000_000),
    )


def compute_tables(simulation: Simulation) -> None:
    """Compute the distance tables to all cells; another part measures their cost."""
    view, workspace = simulation.view, simulation.workspace
    for cell in view.grid.drivable.tolist():
        table_of(view, workspace, 0, cell)


def tours(robots: int) -> Orders:
    """Orders of two stops each; 1.5 open orders per robot."""
    return msgspec.convert(
        {
            "generator": "tours",
            "count": 100 * robots,
            "stops": {"from": 2, "to": 2},
            "arrivals": {"closed_loop": {"in_system": robots + robots // 2}},
        },
        Orders,
    )
