"""What `automaton bench --only zoning` measures. How fast is for no test."""

from __future__ import annotations

import numpy as np
import pytest

from automaton.bench import BENCH_PARTS, zoning_speed
from automaton.bench.measurement import EXPONENT, slope
from automaton.floor.drawn_floors import draw_floor
from automaton.runs.simulation import Simulation
from automaton.world.building import roads_of
from automaton.world.resolve import resolve


@pytest.mark.parametrize("stations", [18, 50, 200])
def test_a_lattice_has_its_stations_on_aisles_that_hang_together(stations: int) -> None:
    picture = zoning_speed.lattice(stations)
    assert picture.count("t") == stations and zoning_speed.lattice(stations) == picture
    floor_plan = draw_floor(picture)
    between = roads_of(floor_plan, floor_plan.stations).between
    assert between.shape == (stations, stations) and between.max() < 1000


@pytest.mark.parametrize(("stations", "zones"), [(18, 3), (50, 3), (50, 10)])
def test_a_repair_gives_every_station_of_a_lattice_a_zone(stations: int, zones: int) -> None:
    floor_plan = draw_floor(zoning_speed.lattice(stations))
    rng = np.random.default_rng(4)
    flow = rng.integers(0, 2, (stations, stations)).astype(float)
    one = zoning_speed.task(roads_of(floor_plan, floor_plan.stations).read_only(), flow, zones)
    assert zoning_speed.anneal(one, 1) == 1
    assert set(one.design.zone.tolist()) == set(range(zones))


def test_a_run_of_the_factory_has_work_to_its_end() -> None:
    run = Simulation(resolve("factory", zoning_speed.MORE_PARTS))
    assert run.resolved.scenario.orders.parts is not None
    assert [kind.count for kind in run.resolved.scenario.orders.parts] == [45, 45, 30, 30]
    run.run(until=round(3600 * 7 / 0.635055))
    assert not run.finished


def test_the_parts_take_samples() -> None:
    for scenario, settings in zoning_speed.FACTORY_RUNS.values():
        assert zoning_speed.prepare_run(scenario, settings, hours=0.05)() > 0
    assert zoning_speed.prepare_repair()() > 0
    assert zoning_speed.prepare_breeding(2, 12)() > 0
    assert zoning_speed.prepare_lattice(18, 3)() > 0


def test_fleets_of_any_size_run_in_zones() -> None:
    for kind in ("annealing", "decentralized"):
        resolved = resolve(zoning_speed.fleet(kind, 3, stations=18))
        run = Simulation(resolved)
        run.run(until=900)
        assert (run.world.orders.delivered >= 0).sum() > 0
        assert run.world.tally.illegal.sum() == 0


def test_growth_is_the_slope_of_log_time_over_log_size() -> None:
    assert slope((18, 50, 200), [7 * n**1.5 for n in (18, 50, 200)]) == pytest.approx(1.5)
    times = {size: iter([size**2.0] * 9) for size in (3, 10, 30)}
    takes = {size: lambda size=size: lambda: next(times[size]) for size in times}  # type: ignore[misc]
    assert zoning_speed.prepare_growth(takes, 3)() == pytest.approx(2.0)
    rows = [one for one in zoning_speed.measurements() if one.unit == EXPONENT]
    assert [one.name for one in rows] == [
        "growth of a repair with the stations, 3 zones",
        "growth of a repair with the zones, 200 stations",
        "growth of 5,000 ticks with the robots, annealing",
        "growth of 5,000 ticks with the robots, decentralized",
    ]


def test_names_are_unique() -> None:
    names = [one.name for one in zoning_speed.measurements()]
    assert len(set(names)) == len(names) and "zoning" in BENCH_PARTS
