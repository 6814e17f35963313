"""The cost of plans on the warehouse of Bhattathiri, Li & Kuhl and on larger ones like it.

A leg leads from the access cell of a rack to a dock, or on to another rack, drawn uniformly. An
avoidance plan chooses among the candidates for both legs, given predictions for five other robots,
and writes the routes. Plans are made one after another inside compiled code, to exclude calls from
Python.

A leg in time leads a driving robot to its dock or rack: its old plan is removed from the forecast,
the route is searched, and the new plan is added. The forecast replays the plans of all 100 robots.

A fleet drives with or without slow zones, including all decisions: A* plans each leg, and slow
zones lead to fewer legs. The network predicts legs one after another, as in a run.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from automaton.bench.leg_plans import plan_avoiding, plan_in_time, plan_legs
from automaton.bench.measurement import NS_PER_ROBOT_AND_TICK, US, Measurement, Sample, cpu_seconds
from automaton.engine.state import LAYER_ROUTING, Memory, Workspace, World
from automaton.papers.traffic_trials import WAREHOUSE_SCENARIO, exact, tasks_of, warehouse
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.routing.astar import FIFO, LARGER_G
from strategies.routing.forecasts import forecast_all, forget_all
from strategies.routing.predicted_paths import kernel_network, predict_legs
from strategies.routing.routing_parameters import network_for, shipped

PLANS_BY_SIDE = {100: 1000, 300: 200, 1000: 40}  # plans per sample, by side of the floor
TASKS_SEED = 1
FLEET_ROBOTS = 100
TICKS_BEFORE = 30  # before the measurement, so that some robots block each other
DRIVEN_TICKS = 1000
LEGS = 1000


def measurements() -> list[Measurement]:
    """A leg by each of two tie rules and an avoidance plan, on each floor."""
    found = []
    for side, plans in PLANS_BY_SIDE.items():
        floor = f"on {side}x{side}"
        found += [
            Measurement(f"A* leg {floor}", US, partial(prepare_legs, side, LARGER_G, plans)),
            Measurement(f"A* leg {floor}, fifo", US, partial(prepare_legs, side, FIFO, plans)),
            Measurement(f"avoidance plan {floor}", US, partial(prepare_avoidance, side, plans)),
        ]
    return found


def prepare_legs(side: int, ties: int, plans: int) -> Sample:
    """A sampler: us for a leg; a plan has two."""
    where = warehouse(side)
    tasks = tasks_of(where, TASKS_SEED, plans)[:, 0].copy()
    arguments = (where.grid, where.duration, where.workspace, ties, tasks, where.trial.plain)
    return lambda: 1e6 * cpu_seconds(lambda: plan_legs(*arguments)) / (2 * plans)


def prepare_avoidance(side: int, plans: int) -> Sample:
    """A sampler: us for a plan."""
    where = warehouse(side)
    tasks = tasks_of(where, TASKS_SEED, plans)
    foreseen = exact(where, TASKS_SEED, tasks)
    arguments = (where.grid, where.duration, where.workspace, tasks, foreseen, where.trial.plain)
    return lambda: 1e6 * cpu_seconds(lambda: plan_avoiding(*arguments)) / plans


def congestion_measurements() -> list[Measurement]:
    """A leg and a forecast on each floor."""
    found = []
    for side in PLANS_BY_SIDE:
        floor = f"on {side}x{side}"
        found += [
            Measurement(f"leg in time {floor}", US, partial(prepare_legs_in_time, side)),
            Measurement(
                f"forecast of {FLEET_ROBOTS} robots {floor}", US, partial(prepare_forecast, side)
            ),
        ]
    return found


def fleet_under_way(side: int, robots: int) -> Simulation:
    """A fleet under way, each robot with a task; `side` in cells."""
    size = (f"layout.rows={side}", f"layout.columns={side}", f"fleet.robots={robots}")
    simulation = Simulation(resolve("warehouse-100", (*size, "strategy.routing=congestion")))
    simulation.run(TICKS_BEFORE)
    return simulation


def prepare_legs_in_time(side: int, robots: int = FLEET_ROBOTS) -> Sample:
    """A sampler: us for a leg, over all robots one after another."""
    view, workspace, state = routing_of(fleet_under_way(side, robots))

    def sample() -> float:
        forecast_all(view, workspace, state)
        seconds = cpu_seconds(lambda: plan_in_time(view, workspace, state))
        forget_all(state)
        return 1e6 * seconds / robots

    return sample


def prepare_forecast(side: int, robots: int = FLEET_ROBOTS) -> Sample:
    """A sampler: us to make and clear a forecast."""
    view, workspace, state = routing_of(fleet_under_way(side, robots))

    def sample() -> float:
        begun = cpu_seconds(lambda: forecast_all(view, workspace, state))
        return 1e6 * (begun + cpu_seconds(lambda: forget_all(state)))

    return sample


def routing_of(simulation: Simulation) -> tuple[World, Workspace, Memory]:
    """View, workspace and state of routing."""
    return simulation.view, simulation.workspace, simulation.states[LAYER_ROUTING]


def zone_measurements() -> list[Measurement]:
    """A tick of a fleet with each rule of slowdown, and a prediction of the network for a leg."""
    return [
        Measurement(
            f"warehouse-100, {FLEET_ROBOTS} robots, slowdown {rule}",
            NS_PER_ROBOT_AND_TICK,
            partial(prepare_fleet, rule),
        )
        for rule in ("none", "zones")
    ] + [Measurement("zones of a leg by the network", US, prepare_network)]


def prepare_fleet(rule: str, robots: int = FLEET_ROBOTS, ticks: int = DRIVEN_TICKS) -> Sample:
    """A sampler: ns per robot and tick; each sample is a separate run."""
    settings = (f"world.slowdown={rule}", f"fleet.robots={robots}", f"stop.max_duration={ticks}")
    resolved = resolve(
        WAREHOUSE_SCENARIO, (*settings, "measure.warm_up=0", "strategy.routing=astar")
    )

    def sample() -> float:
        simulation = Simulation(resolved)
        return 1e9 * cpu_seconds(simulation.run) / (robots * ticks)

    return sample


def prepare_network(legs: int = LEGS) -> Sample:
    """A sampler: us for a leg, from a start and a destination to the zones used."""
    where = warehouse()
    network = network_for(where.grid, where.duration, shipped(WAREHOUSE_SCENARIO))
    zones = where.grid.traffic_zone[tasks_of(where, TASKS_SEED, legs)[:, 0], 0].astype(np.int64)
    used = np.zeros((legs, -(-where.grid.traffic_zone_count // 64)), np.int64)
    start, end = zones[:, 0].copy(), zones[:, 1].copy()
    arguments = (kernel_network(network), start, end, used)  # type: ignore[no-untyped-call]
    return lambda: 1e6 * cpu_seconds(lambda: predict_legs(*arguments)) / legs
