"""Reports in the reader's units, and the metrics of stations and zones."""

from __future__ import annotations

import json

import numpy as np
import pytest

from automaton.commands import main
from automaton.engine.state import NIL
from automaton.runs.metric_sums import metric
from automaton.runs.metrics import METRIC_CATALOGUE, busy_ticks, metrics_by_robot, metrics_of
from automaton.runs.simulation import Simulation
from automaton.units import Unit, duration, unit
from automaton.world.resolve import resolve

FEW = (
    "orders.parts=[{route: [4, 2, 1, 3, 14], count: 3}, {route: [5, 6, 7], count: 2}]",
    "strategy.zoning.sharing=false",
)


@pytest.fixture(scope="module")
def ran() -> Simulation:
    run = Simulation(resolve("factory", FEW))
    run.run()
    return run


@pytest.mark.parametrize(
    ("ticks", "tick", "value", "name"),
    [
        (100, "1 s", 100, "s"),
        (120, "1 s", 2, "min"),
        (7199 / 0.5, "0.5 s", 7199 / 60, "min"),
        (14400, "0.5 s", 2, "h"),
        (14400, "1 cycle", 14400, "cycles"),
        (14400, "1 min", 14400, "min"),
    ],
)
def test_long_durations_are_told_in_minutes_and_hours(
    ticks: float, tick: str, value: float, name: str
) -> None:
    amount, told = duration(ticks, unit(tick))
    assert amount == pytest.approx(value) and told == name


def test_a_part_s_time_is_from_its_coming_to_the_last_work(ran: Simulation) -> None:
    stations, figures = ran.world.stations, metrics_of(ran)
    last = {}
    for work, part in enumerate(stations.part.tolist()):
        last[part] = int(stations.completion_tick[work])
    assert figures["parts_finished"] == 5 == len(last)
    # All come in the first tick.
    assert figures["part_flow_time"] == np.mean(list(last.values())) - 1


def test_the_busiest_station_works_as_long_as_its_parts_take(ran: Simulation) -> None:
    figures = metrics_of(ran)
    # WS1: three parts of 567 ticks; WS5: two of 567; WS4: three of 472
    assert figures["busiest_station"] == 1
    assert figures["busiest_station_utilization"] == pytest.approx(3 * 567 / ran.tick)


def test_work_under_way_counts_as_far_as_it_has_come() -> None:
    run = Simulation(resolve("factory", FEW))
    run.run(until=100)
    busy = busy_ticks(run.world)
    # WS4 and WS5 have had their first parts since the first tick.
    assert np.flatnonzero(busy).tolist() == [3, 4]
    assert np.abs(busy[[3, 4]] - 100).max() <= 1
    figures = metrics_of(run)
    assert figures["parts_finished"] == 0 and "part_flow_time" not in figures
    assert (run.world.stations.completion_tick == NIL).all()


def test_travel_is_what_robots_drove(ran: Simulation) -> None:
    moves = [robot["moves"] for robot in metrics_by_robot(ran)]
    assert metrics_of(ran)["distance"] == sum(moves) > 0


def test_balance_is_a_share_of_the_time_that_was_watched() -> None:
    assert metric("balanced_share", {"ticks_in_balance": 30, "ticks_watched": 120}) == 0.25
    assert metric("balanced_share", {"ticks_in_balance": 0, "ticks_watched": 0}) is None
    assert metric("balanced_share", {"bids": 3}) is None and metric("bids", {"bids": 3}) == 3


def test_what_zoning_counts_is_explained(ran: Simulation) -> None:
    figures = metrics_of(ran)
    assert {"redesigns", "balanced_share", "shared_orders"} < set(figures) <= set(METRIC_CATALOGUE)
    assert not {"ticks_in_balance", "ticks_watched"} & set(figures)


def test_the_report_tells_hours_and_feet_beside_ticks_and_cells(
    capsys: pytest.CaptureFixture[str],
) -> None:
    settings = [word for setting in FEW for word in ("--set", setting)]
    assert main(["run", "factory", *settings]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert main(["run", "factory", *settings, "--json"]) == 0
    run = json.loads(capsys.readouterr().out)
    ticks, distance = run["ticks"], run["metrics"]["distance"]
    minutes = ticks * 0.635055 / 60
    assert f"({minutes:.4g} min, {ticks:,} ticks)" in lines[0]
    assert "1 cell = 2.5 ft" in "".join(lines[:4])
    rows = {line.split()[0]: line.split() for line in lines if line.strip()}
    assert rows["makespan"][1:5] == [f"{minutes:.4g}", "min", f"({ticks:,}", "ticks)"]
    assert rows["distance"][1:5] == [f"{2.5 * distance:,.0f}", "ft", f"({distance:,}", "cells)"]
    assert rows["robot"][-1] == "ft"
    told = run["metrics_in_units"]
    assert told["makespan"] == {"value": pytest.approx(minutes), "unit": "min"}
    assert told["distance"] == {"value": 2.5 * distance, "unit": "ft"}
    by_robot = told["distance_by_robot"]
    assert by_robot == {"value": [2.5 * robot["moves"] for robot in run["robots"]], "unit": "ft"}
    assert max(map(len, lines[4:])) <= 80


def test_where_a_tick_is_a_tick_nothing_is_translated(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "tabletop-mini", "--set", "units.tick=1 tick", "--json"]) == 0
    run = json.loads(capsys.readouterr().out)
    assert "metrics_in_units" not in run and "distance" not in run["metrics"]
    assert Unit(1.0, "tick").of(3) == 3
