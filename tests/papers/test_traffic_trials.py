"""The Monte Carlo trial against the automaton itself: six robots in slow zones, tick by tick."""

from __future__ import annotations

import json

import numpy as np
import pytest

from automaton.engine.state import Array
from automaton.floor.floor_plan import RACK, FloorPlan
from automaton.papers.traffic_trials import (
    TRIAL_ROBOTS,
    Setting,
    exact,
    run_seed,
    stands,
    tasks_of,
    warehouse,
)
from automaton.runs.simulation import Simulation
from automaton.scenario.robot_types import RobotType
from automaton.world.prepared_floor import floor_for
from automaton.world.resolve import resolve
from layouts.racks import Racks
from strategies.routing import monte_carlo
from strategies.routing.astar import LARGER_G

SEED = 1


@pytest.fixture(scope="module")
def floor_plan() -> FloorPlan:
    return Racks(preset="E1").build()


def distances(tasks: Array) -> Array:
    """(r,) cells of each robot's way, by plain A*."""
    where = warehouse()
    found = []
    with np.errstate(over="ignore"):
        for r in range(TRIAL_ROBOTS):
            where.trial.task[:] = tasks
            arguments = (where.grid, where.duration, where.workspace, where.trial, LARGER_G)
            monte_carlo.plan_routes(*arguments, np.uint64(SEED), r, False)
            found.append(int(where.trial.length[r]))
    return np.array(found)


def in_the_world(floor_plan: FloorPlan, tasks: Array) -> Simulation:
    """The same six robots in the automaton, all by plain A*, robot k with order k."""

    def rack(cell: int) -> tuple[int, int]:
        kinds = floor_plan.kind.reshape(-1)
        return floor_plan.xy(
            next(
                c for c in (cell + floor_plan.stride, cell - floor_plan.stride) if kinds[c] == RACK
            )
        )

    starts = [floor_plan.xy(int(task[0])) for task in tasks]
    orders = [
        {"from": [2, floor_plan.xy(int(task[1]))[1]], "to": rack(int(task[2]))} for task in tasks
    ]
    settings = (
        f"fleet.start={json.dumps(starts)}",
        f"orders={json.dumps({'list': orders})}",
        "strategy.routing=astar",
    )
    return Simulation(resolve("warehouse-100-trial", settings), SEED)


def test_trial_and_automaton_take_the_same_ticks(floor_plan: FloorPlan) -> None:
    """In ten trials in which robot 0 is delayed by others, and five in which it is not."""
    tasks = tasks_of(warehouse(), SEED)
    times = [int(one.plain["time"]) for one in run_seed(Setting(exact, "dynamic"), SEED)]
    delays = [time - int(distances(task)[0]) for time, task in zip(times, tasks, strict=True)]
    met = [number for number, delay in enumerate(delays) if delay]
    alone = [number for number, delay in enumerate(delays) if not delay]
    for number in (*met[:10], *alone[:5]):
        simulation = in_the_world(floor_plan, tasks[number])
        simulation.run()
        assert simulation.world.orders.delivered[0] == times[number], f"trial {number}"


def test_racks_are_served_from_the_aisle_and_docks_from_their_right(floor_plan: FloorPlan) -> None:
    where = warehouse()
    floor = floor_for(floor_plan, "undirected", (RobotType(kinematics="omni"),))
    aisles = {floor_plan.xy(int(cell))[1] % 3 for cell in stands(floor, RACK)}
    assert aisles == {1}
    assert {floor_plan.xy(int(cell))[0] for cell in where.docks} == {3}


def test_waiting_in_a_zone_costs_what_the_others_there_do(floor_plan: FloorPlan) -> None:
    """Static: 1 + c ticks for each cell left; c others whose plans use its zone at all."""
    where = warehouse()
    tasks = tasks_of(where, SEED)
    one = run_seed(Setting(exact), SEED)[0]
    foreseen = exact(where, SEED, tasks)[0]
    distances(tasks[0])
    cell, ticks = int(tasks[0, 0, 0]), 0
    for way in where.trial.route[0, : int(where.trial.length[0])]:
        traffic_zone = int(where.grid.traffic_zone[cell, 0])
        ticks += 1 + (int(foreseen[traffic_zone]) if traffic_zone >= 0 else 0)
        cell += int(where.grid.offset[way])
    assert cell == tasks[0, 0, 2]
    assert ticks == one.plain["time"]
