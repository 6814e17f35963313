"""The shipped factories say the same in cells of 2.5 ft and of 5 ft, and by either kind of zones."""

from __future__ import annotations

import pytest

from automaton.papers.zoning_runs import completed
from automaton.runs.simulation import Simulation
from automaton.units import unit
from automaton.world.resolve import resolve

MINUTES = (6, 4, 3, 5, 6, 3, 4, 3, 4, 5, 1, 1, 1, 1, 6, 1, 5, 5)  # Table 4
FIXED = (
    "strategy.zoning={name: static, design: factory-logged, adjacency: 243.64, sharing: false}",
)


@pytest.mark.parametrize("name", ["factory", "factory-5ft", "factory-ddz", "factory-single"])
def test_durations_are_those_of_the_paper(name: str) -> None:
    scenario = resolve(name).scenario
    tick, cell = unit(scenario.units.tick).size, unit(scenario.units.cell or "").size
    assert cell / tick == pytest.approx(236.2 / 60, abs=1e-3)  # feet in a second
    assert scenario.orders.processing_time == tuple(
        round(60 * minutes / tick) for minutes in MINUTES
    )
    durations = scenario.durations
    assert durations.pick == durations.drop == round(2.5 / tick)
    assert durations.handling_jitter == round(5 / tick)


def test_robots_start_at_the_same_stations() -> None:
    for name in ("factory", "factory-5ft", "factory-ddz"):
        resolved = resolve(name)
        cells = resolved.floor_plan.stations
        assert resolved.start == tuple(cells[number - 1] for number in (11, 1, 18)), name


def test_larger_cells_give_nearly_the_same_day() -> None:
    small, large = (
        completed(Simulation(resolve(name, FIXED), 1)) for name in ("factory", "factory-5ft")
    )
    assert large["hours"] == pytest.approx(small["hours"], rel=0.02)
    assert large["mean_ft"] == pytest.approx(small["mean_ft"], rel=0.02)


def test_the_published_run_of_ddz_stands_still() -> None:
    stopped = resolve("factory-ddz")
    hours = [
        completed(Simulation(resolved, 1))["hours"]
        for resolved in (stopped, resolve("factory-ddz", ["strategy.zoning.pause=0"]))
    ]
    assert hours[0] > hours[1] + 0.5
