"""One cell of the study `slow-crowds`: the default is the right of way that does most in it."""

from __future__ import annotations

from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.studies.sweeps.sweep_plan import check_study
from automaton.world.resolve import Resolved, resolve

TURN = 4
ROBOTS = 200
TICKS = 300


def is_in_cell(resolved: Resolved) -> bool:
    scenario = resolved.scenario
    return (
        scenario.layout["generator"] == "random"
        and scenario.fleet.robots == ROBOTS
        and scenario.durations.turn == TURN
        and scenario.durations.move == 1
    )


def delivered(resolved: Resolved) -> int:
    simulation = Simulation(resolved)
    simulation.run(until=TICKS)
    return int(metrics_of(simulation)["delivered"])


def test_the_default_does_most_where_turns_take_time() -> None:
    _, scenarios = check_study("slow-crowds")
    pibt, lattice, epibt = filter(is_in_cell, scenarios)
    done = [delivered(one) for one in (pibt, lattice, epibt)]
    assert done[0] < done[1] < done[2] and done[2] > 1.4 * done[0]
    settings = [f"durations.turn={TURN}", f"fleet.robots={ROBOTS}", "strategy.right_of_way=null"]
    default = resolve("random-400", settings)
    assert default.strategies["right_of_way"] == epibt.strategies["right_of_way"]
