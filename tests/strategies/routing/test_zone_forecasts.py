"""Forecasts of zones: what they say is what the world does, as long as nobody plans again."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_floors import pictures
from slow_zone_scenes import ONE_WAY, Traffic, is_empty

from automaton.engine.state import ACTION_DROP, ACTION_PICK, NIL, Array
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.traffic_zones import ZONE_MODES
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.routing.astar import RouteSpace
from strategies.routing.forecasts import (
    CongestionState,
    add,
    add_task_forecasts,
    congestion_state,
    empty_state,
    forecast_all,
    forecast_one,
    forget,
    forget_all,
    occupancy,
    present,
    remove_task_forecast,
)
from strategies.routing.routing_parameters import SharedPlans

HORIZON = 40


def table(state: CongestionState, zones: int, horizon: int = HORIZON) -> Array:
    """(ticks, zones) the counts of a forecast."""
    return np.array([[present(state, z, t) for z in range(zones)] for t in range(horizon)])


def foreseen(traffic: Traffic, horizon: int = HORIZON) -> Array:
    state = traffic.forecast(horizon)
    forecast_all(traffic.run.view, traffic.run.workspace, state)
    counts = table(state, traffic.world.grid.traffic_zone_count, horizon)
    forget_all(state)
    assert is_empty(state), "a forecast leaves nothing behind"
    return counts


def happened(traffic: Traffic, horizon: int = HORIZON) -> Array:
    """(ticks, zones) what the world does from now on; who arrives is gone a tick later."""
    counts = []
    for _ in range(horizon):
        counts.append(traffic.crowd())
        traffic.tick_and_take_away()
    return np.array(counts)


def test_a_queue_is_foreseen_as_it_will_be() -> None:
    """A and B slow each other down in the west arm; B alone goes on through the east arm."""
    traffic = Traffic("##~##\nAB~~~\n##~##").drive(A="EES", B="EEE")
    west = traffic.world.grid.traffic_zone[traffic.world.robots.cell[0], 0]
    counts = foreseen(traffic)
    assert counts[:, west].tolist()[:8] == [2, 2, 1, 0, 0, 0, 0, 0]
    assert np.array_equal(counts, happened(traffic))


class Case(NamedTuple):
    """Robots that drive about at random."""

    traffic: Traffic
    before: int  # ticks until the forecast


@st.composite
def cases(draw: Any) -> Case:
    width, height = draw(st.integers(2, 7)), draw(st.integers(1, 5))
    picture = draw(pictures("~~~~~~~~~~~###eswn", width, height))
    if not set(picture) & set("~eswn"):
        picture = "~~~"
    floor_plan = draw_floor(picture, tuple(ONE_WAY.items()))
    cells = np.flatnonzero(floor_plan.drivable).tolist()
    n = draw(st.integers(1, 8))
    traffic = Traffic(
        picture,
        robots=tuple(draw(st.sampled_from(cells)) for _ in range(n)),
        kinematics=draw(st.sampled_from(["omni", "omni", "differential"])),
        traffic_zones=draw(st.sampled_from(ZONE_MODES)),
        slowdown=draw(st.sampled_from(["zones", "zones", "none"])),
        move=draw(st.integers(1, 2)),
        turn=draw(st.integers(1, 3)),
    )
    grid = traffic.world.grid
    walk = np.random.default_rng(draw(st.integers(0, 2**32)))
    for i in range(n):
        cell, route = int(traffic.world.robots.cell[i]), []
        for _ in range(min(draw(st.integers(0, 12)), traffic.world.robots.route.shape[1])):
            ways = [d for d in range(4) if grid.cell_flags[cell] >> d & 1]
            if not ways:
                break
            route.append(int(walk.choice(ways)))
            cell += int(grid.offset[route[-1]])
        if route:
            traffic.send(i, route)
    return Case(traffic, draw(st.integers(0, 6)))


@given(cases())
@settings(max_examples=60)
def test_what_is_foreseen_happens(case: Case) -> None:
    for _ in range(case.before):  # some are then in the middle of a long move or a turn
        case.traffic.tick_and_take_away()
    counts = foreseen(case.traffic)
    assert np.array_equal(counts, happened(case.traffic))


@given(cases(), st.integers(0, 7), st.integers(1, 30))
@settings(max_examples=30)
def test_a_robot_taken_out_and_put_back_leaves_the_others_alone(
    case: Case, robot: int, horizon: int
) -> None:
    """The last robot that is put in sees the others as they will be, and is slowed down by them."""
    traffic, view, workspace = case.traffic, case.traffic.run.view, case.traffic.run.workspace
    i = robot % len(traffic.world.robots.cell)
    route = traffic.world.robots.route[i, : traffic.world.robots.route_length[i]].copy()
    everybody = foreseen(traffic, horizon)
    state = traffic.forecast(horizon)
    forecast_all(view, workspace, state)
    forget(state, i)
    others = table(state, traffic.world.grid.traffic_zone_count, horizon)
    assert (others <= everybody).all()
    forecast_one(view, workspace, state, i, route, len(route))
    together = table(state, traffic.world.grid.traffic_zone_count, horizon)
    assert ((together - others).sum(axis=1) <= 1).all(), "it is in one zone at a time"
    assert (together >= others).all()
    assert (state.zone == NIL).all()
    forget_all(state)
    assert is_empty(state)


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 23), st.integers(0, 23)), max_size=40))
@settings(max_examples=50)
def test_four_counts_in_a_word_do_not_touch_each_other(spans: list[tuple[int, int, int]]) -> None:
    traffic = Traffic("A~#~~\n###\n~~~~~")
    state, expected = traffic.forecast(23), np.zeros((23, 3), np.int64)
    for zone, a, b in spans:
        add(state, zone, min(a, b), max(a, b), 1)
        expected[min(a, b) : max(a, b), zone] += 1
    assert np.array_equal(table(state, 3, 23), expected)
    for zone, a, b in spans:
        add(state, zone, min(a, b), max(a, b), -1)
    assert is_empty(state)


def test_beyond_the_horizon_and_in_no_zone_nobody_is_foreseen() -> None:
    traffic = Traffic("AB~")
    state = traffic.forecast(5)
    forecast_all(traffic.run.view, traffic.run.workspace, state)
    assert [present(state, 0, tick) for tick in (0, 4, 5, 500)] == [2, 2, 0, 0]
    assert present(state, NIL, 0) == 0


def test_the_rest_of_a_task_is_foreseen_to_its_end() -> None:
    """Its way to the dock, 3 ticks of work there, its way to the rack, 2 ticks, and one more."""
    floor = ("layout.rows=20", "layout.columns=20", "fleet.robots=1", "orders.count=1")
    work = ("durations.pick=3", "durations.drop=2", "stop.max_duration=400", "measure.warm_up=0")
    run = Simulation(resolve("warehouse-100", (*floor, *work, "strategy.routing=congestion")))
    run.run(1)
    state = congestion_state(run.view, SharedPlans(horizon=200))
    forecast_all(run.view, run.workspace, state)
    last = int(np.flatnonzero(table(state, run.world.grid.traffic_zone_count, 200).sum(axis=1))[-1])
    run.run(400)
    # Tick 0 of the forecast is tick 2 of the run; the load is down in the first tick of the drop.
    assert run.world.orders.delivered[0] == 2 + last - 2


def test_the_second_leg_leads_to_where_loads_are_set_down(tmp_path: Path) -> None:
    """The destination can be served from its left, 4 moves away, and from its right, 6 moves away."""
    scenario = tmp_path / "sides.yaml"
    scenario.write_text(
        "name: sides\nlayout:\n  picture: |\n    .........\n    A##s.#.d.\n"
        "fleet: {robots: 1, kinematics: omni}\norders: {list: [{from: [3, 1], to: [7, 1]}]}\n"
        "stop: {when: delivered, max_duration: 50}\n"
    )
    run = Simulation(resolve(scenario, ["strategy.routing=astar"]))
    run.run(1)
    state = congestion_state(run.view, SharedPlans(horizon=50))
    forecast_all(run.view, run.workspace, state)
    last = int(np.flatnonzero(table(state, run.world.grid.traffic_zone_count, 50).sum(axis=1))[-1])
    run.run()
    assert run.finished
    assert run.world.orders.delivered[0] == 2 + last - 1


IN_BAYS = """
b~~~~~~~
b~####~~
b~#####~
"""


@pytest.mark.parametrize("move", [1, 3])
@pytest.mark.parametrize(
    ("kinematics", "turn"), [("omni", 1), ("differential", 1), ("differential", 2)]
)
def test_who_leaves_a_bay_is_counted_from_the_next_tick_on(
    kinematics: str, turn: int, move: int
) -> None:
    traffic = Traffic(IN_BAYS.strip("\n"), bays=3, kinematics=kinematics, move=move, turn=turn)
    robots = traffic.world.robots
    assert (robots.cell == NIL).all()
    for i, route in enumerate(([0, 0, 0], [3, 0, 0, 0], [3])):  # 0 is east, 3 north
        traffic.send(i, route)
    counts = foreseen(traffic)
    real = happened(traffic)
    assert real[0].sum() == 0 < real[1].sum()
    assert np.array_equal(counts, real)


def test_a_robot_with_a_new_route_is_counted_when_it_has_left_its_bay() -> None:
    traffic = Traffic(IN_BAYS.strip("\n"), bays=1, move=3)
    route = np.array([0, 0], np.uint8)
    traffic.send(0, route.tolist())
    everybody = foreseen(traffic)
    state = traffic.forecast(HORIZON)
    forecast_all(traffic.run.view, traffic.run.workspace, state)
    forget(state, 0)
    forecast_one(traffic.run.view, traffic.run.workspace, state, 0, route, len(route))
    assert np.array_equal(table(state, traffic.world.grid.traffic_zone_count), everybody)


def test_a_count_that_is_full_does_not_carry_into_the_next_tick() -> None:
    state = empty_state(65_536, 3, SharedPlans(horizon=4), RouteSpace.sized({"P": 0, "Z": 0}))
    add(state, 1, 0, 4, 65_534)
    for _ in range(3):
        add(state, 1, 1, 3, 1)
    assert table(state, 3, 4)[:, 1].tolist() == [65_534, 65_535, 65_535, 65_534]
    add(state, 1, 0, 4, -1)
    assert table(state, 3, 4)[:, 1].tolist() == [65_533, 65_535, 65_535, 65_533]
    assert table(state, 3, 4).sum() == table(state, 3, 4)[:, 1].sum()
    forget_all(state)
    assert is_empty(state)


ALONE = ("layout.rows=20", "layout.columns=20", "fleet.robots=1", "orders.count=1")


def test_a_task_is_expected_where_plain_astar_drives_it() -> None:
    """Alone and undelayed it is there; in the tick in which it arrives the task is over."""
    settings = (*ALONE, "durations.pick=3", "stop.max_duration=400", "strategy.routing=astar")
    run = Simulation(resolve("warehouse-100", settings))
    run.run(1)
    world, state = run.world, congestion_state(run.view, SharedPlans(horizon=200))
    add_task_forecasts(run.view, run.workspace, state)
    expected = table(state, world.grid.traffic_zone_count, 200)[1:]  # that tick is over
    for tick in range(199):
        if world.orders.delivered[0] != NIL:
            break
        traffic_zone = world.grid.traffic_zone[world.robots.cell[0], world.robots.travel[0] >> 1]
        assert expected[tick].sum() == (traffic_zone != NIL) and (
            traffic_zone == NIL or expected[tick, traffic_zone] == 1
        )
        run.run(run.tick + 1)
    assert tick > 15 and not expected[tick:].any()
    remove_task_forecast(run.view, state, 0)
    assert is_empty(state)


def test_shares_are_those_of_the_ticks_of_a_task() -> None:
    settings = (*ALONE, "stop.max_duration=400", "strategy.routing=astar")
    run = Simulation(resolve("warehouse-100", settings))
    run.run(1)
    traffic_zone_count = run.world.grid.traffic_zone_count
    tasks, shares = (
        congestion_state(run.view, SharedPlans(horizon=200, forecast=kind))
        for kind in ("tasks", "task-averages")
    )
    for one in (tasks, shares):
        add_task_forecasts(run.view, run.workspace, one)
    ticks = table(tasks, traffic_zone_count, 200).sum(axis=0)
    task = shares.step_count[0] - 2  # moves, without pick and drop
    for zone in range(traffic_zone_count):
        expected = 1000 * ticks[zone] / task
        assert occupancy(shares, zone, 7) == pytest.approx(expected, abs=1)
    assert sum(occupancy(shares, zone, 0) for zone in range(traffic_zone_count)) > 500
    assert occupancy(tasks, int(ticks.argmax()), 10_000) == 0
    remove_task_forecast(run.view, shares, 0)
    assert is_empty(shares)


def test_a_task_that_takes_no_time_has_no_shares(tmp_path: Path) -> None:
    """The robot stands between rack and dock, and neither pick nor drop takes a tick."""
    scenario = tmp_path / "between.yaml"
    scenario.write_text(
        "name: between\nlayout:\n  picture: |\n    s##\n    A~~\n    d##\n"
        "fleet: {robots: 1, kinematics: omni}\norders: {list: [{from: [0, 0], to: [0, 2]}]}\n"
        "stop: {when: delivered, max_duration: 50}\n"
    )
    run = Simulation(resolve(scenario))
    run.run(1)
    assert run.world.robots.order[0] == 0
    run.world.rules.duration[:, (ACTION_PICK, ACTION_DROP)] = 0
    state = congestion_state(run.view, SharedPlans(horizon=50, forecast="task-averages"))
    add_task_forecasts(run.view, run.workspace, state)
    assert state.step_count[0] == 2
    assert is_empty(state)
