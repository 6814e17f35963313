"""Zoning at its edges: no orders, one station, as many robots as stations and more."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from zoning_scenes import ddz_rules, drawn, everyone, scratch

from automaton.commands import main
from automaton.engine.facilities import empty_design
from automaton.engine.state import ORDER_DELIVERED
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.zoning.annealing import repair
from strategies.zoning.design_files import design_arrays
from strategies.zoning.genetic import evolve, population_for

SCENARIO = """name: edge
layout:
  picture: |
    t==t==t
    =##=##=
    t==t==t
fleet: {robots: 2, kinematics: omni}
orders: {parts: [{route: [1, 4, 2], count: 3}, {route: [3], count: 2}], processing_time: 2}
strategy: {zoning: static, allocation: shortest-job, right_of_way: {name: retreat, idle_give_way: true}}
stop: {when: delivered, max_duration: 2000}
"""
METHODS = ("static", "annealing", "genetic", "decentralized")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "edge.yaml"
    path.write_text(SCENARIO)
    return path


@pytest.mark.parametrize("method", METHODS)
def test_parts_that_are_carried_nowhere_need_no_zone(file: Path, method: str) -> None:
    settings = [f"strategy.zoning={method}", "orders.parts=[{route: [1], count: 3}]"]
    run = Simulation(resolve(file, settings))
    run.run()
    assert run.finished and len(run.world.orders.state) == 0
    assert (run.world.stations.completion_tick > 0).all() and run.world.tally.illegal.sum() == 0


@pytest.mark.parametrize("method", METHODS)
def test_a_visit_stays_in_the_zone_of_its_station(file: Path, method: str) -> None:
    settings = [
        f"strategy.zoning={method}",
        "orders={generator: visits, count: 9, mean_interarrival_time: 10}",
    ]
    run = Simulation(resolve(file, settings))
    run.run()
    assert run.finished and set(run.world.orders.state.tolist()) == {ORDER_DELIVERED}
    assert run.world.tally.illegal.sum() == 0


@pytest.mark.parametrize("method", METHODS)
def test_each_robot_needs_a_station_to_serve(
    file: Path, method: str, capsys: pytest.CaptureFixture[str]
) -> None:
    seven = ["--set", f"strategy.zoning={method}", "--set", "fleet.robots=7"]
    study = file.with_name("study.yaml")
    factors = f"{{fleet.robots: [2, 7], strategy.zoning: [{method}]}}"
    study.write_text(f"name: s\nscenario: edge.yaml\nfactors: {factors}\nreplications: 2\n")
    for command in (
        ["check", str(file), *seven],
        ["run", str(file), *seven],
        ["sweep", str(study), "--out", str(file.with_name("results"))],
    ):
        assert main(command) == 2, command
        said = capsys.readouterr().err
        assert "there are 7 robots and 6 stations; use fewer robots" in said, command
    assert not file.with_name("results").exists(), "nothing is begun"


def test_slots_that_count_as_stations_are_as_few_as_their_groups() -> None:
    settings = ["strategy.allocation=shortest-job", "strategy.zoning={name: static, groups: 2}"]
    with pytest.raises(InputError, match="3 robots and 2 groups of slots"):
        resolve("tabletop-mini", settings)


def test_as_many_robots_as_stations_serve_one_each(file: Path) -> None:
    run = Simulation(resolve(file, ["fleet.robots=6", "orders.parts=[{route: [1], count: 1}]"]))
    run.run(until=1)
    assert sorted(run.world.service_zones.design.zone.tolist()) == list(range(6))


def test_there_is_no_design_with_more_zones_than_stations() -> None:
    """The kernels say so; they do not look for a fifth seed for ever."""
    _, roads = drawn("1==2\n=##=\n3==4")
    with pytest.raises(InputError, match="4 stations allow at most as many zones, found 5"):
        design_arrays(roads, 5)
    flow = roads.between.astype(float)
    design, workspace, reach = empty_design(len(roads.cell), 4, 5), scratch(roads, 5), everyone(5)
    rules = ddz_rules()
    assert (
        repair(roads, rules, flow, 4.5, 0.35, 9, 3, design, workspace, reach, np.uint64(1), 1) == 0
    )
    population = population_for(roads, 4)
    assert (
        evolve(roads, rules, flow, 2, 2, 0.4, population, design, workspace, reach, np.uint64(1), 1)
        == 0
    )
