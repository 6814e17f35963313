"""The metrics of a run add up: by robot, by action, and with what can be said without running."""

from __future__ import annotations

import numpy as np
import pytest
from gate_scenes import gate_scene
from metrics_of_some_runs import OF_OTHER_RUNS

from automaton.engine.state import (
    ACTION_BAY_BLOCKED,
    ACTION_PICK,
    ACTION_TRY_DROP,
    ACTION_TURN,
    ACTION_WAIT,
)
from automaton.runs.metric_sums import QUOTIENTS, SUMS
from automaton.runs.metrics import (
    METRIC_CATALOGUE,
    OPERATION_STATES,
    executed_ticks,
    illegal_by_layer,
    metrics_by_robot,
    metrics_of,
)
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

RUNS = [
    ("tabletop-1", 1, "independent"),
    ("tabletop-1", 4, "cooperative"),
    ("tabletop-2", 5, "independent"),
    ("tabletop-2", 3, "cooperative"),
    ("tabletop-mini", 5, "cooperative"),
]


def ran(scenario: str, robots: int, allocation: str, until: int | None = None) -> Simulation:
    settings = [f"fleet.robots={robots}", f"strategy.allocation={allocation}"]
    simulation = Simulation(resolve(scenario, settings), seed=7)
    simulation.run(until)
    return simulation


@pytest.fixture(params=RUNS, ids=lambda run: "-".join(map(str, run)))
def run(request: pytest.FixtureRequest) -> Simulation:
    return ran(*request.param)


def test_every_metric_has_a_unit_and_a_meaning(run: Simulation) -> None:
    assert list(metrics_of(run)) == [name for name in METRIC_CATALOGUE if name not in OF_OTHER_RUNS]
    assert all(unit and meaning for unit, meaning in METRIC_CATALOGUE.values())


def test_the_fleets_operations_are_those_of_its_robots(run: Simulation) -> None:
    fleet, robots = metrics_of(run), metrics_by_robot(run)
    assert [row["robot"] for row in robots] == list(range(len(robots)))
    assert fleet["operations"] == sum(row["operations"] for row in robots)
    assert fleet["operations_per_robot"] * len(robots) == fleet["operations"]
    for row in robots:
        kinds = ("moves", "turns", "picks", "drops", "try_drops", "waits")
        assert row["operations"] == sum(row[kind] for kind in kinds)
    for name in (*fleet, *robots[0]):
        if name.startswith("lost_"):
            assert fleet[name] == sum(row[name] for row in robots)


@pytest.mark.parametrize("until", [1, 10, 333, 1000])
def test_every_tick_of_every_robot_is_counted_once_in_mid_run_too(until: int) -> None:
    simulation = ran("tabletop-1", 4, "cooperative", until)
    by_robot = executed_ticks(simulation.world).sum((1, 2))
    assert by_robot.tolist() == [until] * 4


@pytest.mark.parametrize("which", RUNS, ids=lambda run: "-".join(map(str, run)))
def test_ticks_of_actions_and_ticks_in_the_bay_are_all_ticks(which: tuple[str, int, str]) -> None:
    simulation = ran(*which, until=0)
    idle = np.zeros(which[1], np.int64)
    parked = simulation.world.robots.parked == 1
    for tick in range(1, simulation.resolved.scenario.stop.max_duration):
        if simulation.finished:
            break
        simulation.run(tick)
        after = simulation.world.robots.parked == 1
        idle += parked & after & (simulation.world.robots.action != ACTION_BAY_BLOCKED)
        parked = after
    active = executed_ticks(simulation.world).sum((1, 2))
    assert (active + idle).tolist() == [simulation.tick] * which[1]
    assert metrics_of(simulation)["makespan"] == simulation.tick


def test_operations_take_the_ticks_that_the_scenario_says(run: Simulation) -> None:
    times, ticks = run.world.tally.operations.sum((0, 2)), run.world.tally.ticks.sum((0, 2))
    for action in OPERATION_STATES:
        if action != ACTION_WAIT:
            assert ticks[action] == times[action] * run.world.rules.duration[0, action]
    assert times[ACTION_WAIT] <= ticks[ACTION_WAIT] <= 10 * times[ACTION_WAIT]


def test_every_pick_up_is_a_leg_of_an_order(run: Simulation) -> None:
    figures, picks = metrics_of(run), int(run.world.tally.operations[:, ACTION_PICK].sum())
    assert figures["delivered"] == len(run.world.orders.state)
    assert figures["legs_per_order"] * figures["delivered"] == pytest.approx(picks)
    assert sum(row["drops"] for row in metrics_by_robot(run)) == picks


def test_shares_are_shares(run: Simulation) -> None:
    for name, value in metrics_of(run).items():
        if METRIC_CATALOGUE[name][0] == "share":
            assert 0 <= value <= 1


def test_a_robot_alone_never_waits() -> None:
    for allocation in ("independent", "cooperative"):
        figures = metrics_of(simulation := ran("tabletop-1", 1, allocation))
        lost = [figures[name] for name in figures if name.startswith("lost_")]
        assert (lost, figures["retreats"], figures["blocked_share"]) == ([0] * 6, 0, 0)
        assert metrics_by_robot(simulation)[0]["waits"] == 0


def test_only_cooperative_robots_try_to_drop_and_pass_on() -> None:
    independent = ran("tabletop-2", 3, "independent")
    cooperative = ran("tabletop-2", 3, "cooperative")
    assert independent.world.tally.operations[:, ACTION_TRY_DROP].sum() == 0
    assert metrics_of(independent)["legs_per_order"] == 1
    picks = cooperative.world.tally.operations[:, ACTION_PICK].sum()
    assert cooperative.world.tally.operations[:, ACTION_TRY_DROP].sum() == picks
    assert metrics_of(cooperative)["legs_per_order"] > 1


def test_empty_runs_by_cycles_counted_by_hand() -> None:
    simulation = ran("tabletop-mini", 1, "independent")
    tally = simulation.world.tally
    driving = [1, ACTION_TURN, ACTION_WAIT]  # MOVE is 1
    empty = tally.ticks[0, driving, 0].sum()
    assert metrics_of(simulation)["empty_ticks_share"] == pytest.approx(
        empty / tally.ticks[0, 1:].sum()
    )


def test_time_at_stops_is_active_and_in_the_queue_of_a_station_lost() -> None:
    """Goods-mini by hand: a trip drives 26 ticks, lifts and stores in 6, and is served for 20."""
    simulation = Simulation(resolve("goods-mini"))
    simulation.run()
    first, second = metrics_by_robot(simulation)
    assert first["lost_station_queue"] == 20 and second["lost_station_queue"] == 0
    assert first["utilization"] == (2 * 52 - 2) / 122, "its second pod is home as its drop begins"
    assert second["utilization"] == 52 / 122
    figures = metrics_of(simulation)
    assert figures["station_queue_share"] == 20 / (102 + 52 + 20)
    assert figures["blocked_share"] == 0, "that is traffic alone"


def test_a_run_of_no_ticks_has_figures() -> None:
    simulation = Simulation(resolve("tabletop-mini"))
    figures = metrics_of(simulation)
    assert figures["throughput"] == figures["utilization"] == 0
    assert "makespan" not in figures, "it has not ended"
    assert len(metrics_by_robot(simulation)) == 3


def test_no_strategy_of_the_table_top_breaks_a_rule(run: Simulation) -> None:
    assert set(illegal_by_layer(run).values()) == {0}


def test_figures_do_not_depend_on_how_robots_are_stored() -> None:
    resolved = resolve("tabletop-1")
    plain = Simulation(resolved)
    turned = Simulation(resolved, storage=np.array([2, 0, 3, 1]))
    plain.run()
    turned.run()
    assert metrics_of(plain) == metrics_of(turned)
    assert metrics_by_robot(plain) == metrics_by_robot(turned)


def test_a_robot_that_does_little_but_wait_is_blocked_for_less_than_all_of_the_time() -> None:
    """It waits before a door for 90 ticks after a drive of few."""
    door = {"at": [3, 0], "opening_time": 150, "hold_open": 5}
    simulation = Simulation(gate_scene({"doors": [door]}, (7, 0)))
    simulation.run(100)
    metrics = metrics_of(simulation)
    assert metrics["lost_at_gates"] > 90
    assert metrics["blocked_share"] == metrics["lost_at_gates"] / 100
    assert metrics_by_robot(simulation)[0]["blocked_share"] == metrics["blocked_share"]


def test_what_quotients_are_made_of_is_kept_for_steady_states() -> None:
    parts = {one for quotient in QUOTIENTS.values() for one in (quotient.part, quotient.whole)}
    names = {name for one in parts for name in (one if isinstance(one, tuple) else (one,))}
    sums = {name for name in names if isinstance(name, str)}
    assert sums <= {*SUMS, "robots", "completed", "watched_robot_ticks"}
