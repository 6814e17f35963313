"""What routes in time cost: 100 robots on the warehouse of Bhattathiri, Li & Kuhl and on larger ones.

A leg leads a robot that is under way to its dock or rack; its old plan is taken out of the forecast,
the route is searched, and the new plan is put in. The forecast replays the plans of all 100.
"""

from __future__ import annotations

from functools import partial

from automaton.bench.leg_plans import plan_in_time
from automaton.bench.measurement import US, Measurement, Sample, cpu_seconds
from automaton.build.resolve import resolve
from automaton.engine.state import LAYER_ROUTING
from automaton.runs.simulation import Simulation
from strategies.routing.congestion.plan_forecast import forecast_all
from strategies.routing.congestion.zone_forecast import forget_all

SIDES = (100, 300, 1000)  # cells
ROBOTS = 100
TICKS = 30  # before the measurement, so that some are in each other's way


def measurements() -> list[Measurement]:
    """A leg and a forecast on each floor."""
    found = []
    for side in SIDES:
        floor = f"on {side}x{side}"
        found += [
            Measurement(f"leg in time {floor}", US, partial(prepare_legs, side)),
            Measurement(
                f"forecast of {ROBOTS} robots {floor}", US, partial(prepare_forecast, side)
            ),
        ]
    return found


def fleet(side: int, robots: int) -> Simulation:
    """A fleet under way, each robot with a task; `side` in cells."""
    size = (f"layout.rows={side}", f"layout.columns={side}", f"fleet.robots={robots}")
    simulation = Simulation(resolve("warehouse-100", (*size, "strategy.routing=congestion")))
    simulation.run(TICKS)
    return simulation


def prepare_legs(side: int, robots: int = ROBOTS) -> Sample:
    """A sampler: us for a leg, over all robots one after another."""
    simulation = fleet(side, robots)
    view, workspace = simulation.view, simulation.workspace
    state = simulation.states[LAYER_ROUTING]

    def sample() -> float:
        forecast_all(view, workspace, state)
        seconds = cpu_seconds(lambda: plan_in_time(view, workspace, state))
        forget_all(state)
        return 1e6 * seconds / robots

    return sample


def prepare_forecast(side: int, robots: int = ROBOTS) -> Sample:
    """A sampler: us for a forecast, and for clearing it away."""
    simulation = fleet(side, robots)
    view, workspace = simulation.view, simulation.workspace
    state = simulation.states[LAYER_ROUTING]

    def sample() -> float:
        begun = cpu_seconds(lambda: forecast_all(view, workspace, state))
        return 1e6 * (begun + cpu_seconds(lambda: forget_all(state)))

    return sample
