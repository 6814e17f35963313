"""Robots that go down: when, what becomes of their orders and loads, and when they are back."""

from __future__ import annotations

from typing import Any

import pytest
from battery_scenes import MOVES, BatteryScene
from drawn_scenes import recorded_run, scene

from automaton.engine.state import (
    ACTION_DOWN,
    ACTION_WAIT,
    BATTERY_FULL,
    BATTERY_PERCENT,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_WAITING,
    STATUS_FAILED,
    STATUS_REMOVED,
    STATUS_TOWED,
    STATUS_UP,
)
from automaton.errors import InputError
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.headless import run_once
from automaton.runs.metrics import metrics_of
from automaton.runs.pictures import picture_of, world_from
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Durations, Fault, Faults
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve


def failing(at: int, **rules: Any) -> Faults:
    return Faults(listed=(Fault(robot=0, at=at),), **rules)


def statuses(run: BatteryScene, ticks: int) -> list[int]:
    return [run.tick().status("A") for _ in range(ticks)]


def test_a_robot_fails_when_what_it_does_is_over() -> None:
    run = BatteryScene("A....", {"A": "EEEE"}, durations=Durations(move=3), faults=failing(2))
    run.tick(2)
    assert run.status("A") not in (STATUS_UP, STATUS_FAILED), "it is on its way, and will fail"
    run.tick(2)  # the move ends; in the next tick it is down
    assert (run.status("A"), run.at("A")) == (STATUS_FAILED, (1, 0))
    run.tick(100)
    assert run.at("A") == (1, 0)


def test_it_is_towed_and_comes_back_when_the_scenario_says() -> None:
    run = BatteryScene("A....", faults=failing(2, tow_after=3, repair_time=4), battery=MOVES)
    run.world.robots.charge[0] = BATTERY_FULL // 2
    assert statuses(run, 10) == [
        STATUS_UP,
        *[STATUS_FAILED] * 3,
        *[STATUS_TOWED] * 4,
        STATUS_UP,
        STATUS_UP,
    ]
    assert run.world.robots.cell[0] == NIL, "off the floor, at home"
    assert run.world.robots.charge[0] == BATTERY_FULL // 2, "a repair is not a charger"
    assert run.world.tally.failures[0].tolist() == [0, 1, 1]


@pytest.mark.parametrize(
    ("charge", "broken", "empty"), [("kept", 40, 15), (5, 5, 5), (100, 100, 100)]
)
def test_with_what_charge_a_robot_comes_back_the_scenario_says(
    charge: Any, broken: float, empty: float
) -> None:
    """As it was if it broke down; one that ran empty gets the reserve at least."""
    for has, expected in ((40.0, broken), (0.5, empty)):  # a move takes 1 %
        run, recorder = recorded_run(
            scene(
                "t.t",
                [(0, 0)],
                orders={"list": [{"from": [2, 0], "to": [0, 0]}]},
                strategy=STRATEGY,
                battery={
                    "drain": {"move": 1.0},
                    "charge_rate": 1.0,
                    "initial_charge": has,
                    "reserve": 15.0,
                },
                faults={
                    "list": [{"robot": 0, "at": 1}] if has > 1 else [],
                    **{"tow_after": 3, "repair_time": 5, "charge": charge},
                },
                stop={"when": "never", "max_duration": 8},
            )
        )
        assert run.world.robots.status[0] == STATUS_TOWED
        assert run.world.robots.charge[0] / BATTERY_PERCENT == expected
        assert metrics_of(run)["repair_energy"] == pytest.approx(max(0, expected - has) / 100)
        assert validate_stored(recorder.recording()).valid


def test_a_charge_after_repairs_needs_a_battery() -> None:
    with pytest.raises(InputError, match=r"faults.charge is 50, but the scenario has no battery"):
        scene(
            "t.t",
            [(0, 0)],
            orders={"list": [{"from": [2, 0], "to": [0, 0]}]},
            faults={"charge": 50},
        )


def test_null_means_never() -> None:
    stays = BatteryScene("A....", faults=failing(1, tow_after=None))
    assert statuses(stays, 400)[-1] == STATUS_FAILED and stays.at("A") == (0, 0)
    gone = BatteryScene("A....", faults=failing(1, tow_after=2, repair_time=None))
    assert statuses(gone, 2000)[-1] == STATUS_REMOVED


def test_a_broken_robot_is_in_the_way_until_it_is_towed() -> None:
    run = BatteryScene(
        "A.B..", {"A": "EEEE"}, faults=Faults(listed=(Fault(robot=1, at=1),), tow_after=20)
    )
    run.tick(19)
    assert run.at("A") == (1, 0)
    run.tick(20)
    assert run.at("A") == (4, 0)


def test_the_rate_is_a_probability_of_each_tick_on_the_floor() -> None:
    robots = [(x, 0) for x in range(50)]
    strategy = {"allocation": "first-come", "right_of_way": "wait"}
    resolved = scene(
        "t" + "~" * 48 + "t",
        robots,
        strategy=strategy,
        orders={"list": [{"from": [0, 0], "to": [49, 0], "release": 1_000_000}]},
        faults={"failure_probability": 0.01, "tow_after": 1, "repair_time": 1},
        stop={"when": "never", "max_duration": 400},
    )
    run = Simulation(resolved)
    run.run()
    # Towed and back, they are off the floor, and do not fail again: 1 - 0.99^400 = 98 % of 50.
    assert run.world.tally.failures[:, 1].max() == 1 and run.world.tally.failures[:, 1].sum() >= 46
    other = Simulation(resolved, seed=2)
    other.run(until=50)
    assert 10 <= other.world.tally.failures[:, 1].sum() <= 30, "1 - 0.99^50 = 39 % of 50"


LANE = """
t...t
.....
"""
ONE = {"list": [{"from": [0, 0], "to": [4, 0]}]}
STRATEGY = {"allocation": "first-come", "right_of_way": "wait"}


def lane(at: int, **faults: Any) -> Any:
    """A carries the load of (0, 0) to (4, 0) and fails at a tick; B is far away."""
    rules = {"list": [{"robot": 0, "at": at}], **faults}
    return scene(LANE, [(0, 0), (4, 1)], orders=ONE, strategy=STRATEGY, faults=rules)


@pytest.mark.parametrize("tow_after", [None, 1, 3, 20])
def test_a_load_left_on_the_floor_is_delivered_by_another(tow_after: int | None) -> None:
    """Beside the broken robot, or where it was after the tow."""
    run, recorder = recorded_run(lane(4, tow_after=tow_after, repair_time=None))
    orders = run.world.orders
    assert run.finished and orders.state[0] == ORDER_DELIVERED
    assert orders.legs[0] == 2, "picked up by A, and by B"
    assert run.world.slots.cell[run.world.slots.first_spare :].tolist() == [NIL] * 2, (
        "both are spare again"
    )
    assert validate_stored(recorder.recording()).valid


def test_a_load_on_the_floor_is_in_the_picture() -> None:
    resolved = lane(4, tow_after=None)
    run = Simulation(resolved)
    run.run(until=5)
    order = run.world.orders
    assert order.state[0] == ORDER_WAITING
    picture = picture_of(run)
    assert "order 0 waiting at (2, 0) as load 0 for (4, 0)" in picture
    assert "broken down" in picture
    again = world_from(picture, resolved)
    assert again.digest == run.digest
    for each in (run, again):
        each.run()
    assert again.digest == run.digest, "and goes on in the same way"


def test_an_order_not_yet_picked_up_is_given_back() -> None:
    faults = {"list": [{"robot": 0, "at": 2}], "tow_after": None}
    strategy = {"allocation": "first-come", "right_of_way": "retreat"}  # round the broken one
    resolved = scene(LANE, [(3, 0), (3, 1)], orders=ONE, strategy=strategy, faults=faults)
    run = Simulation(resolved)
    run.run(until=1)
    assert run.world.orders.reserved_by[0] == 0
    run.run(until=3)
    assert run.world.orders.reserved_by[0] == 1, "B takes it at once"
    run.run()
    assert run.finished and run.world.orders.legs[0] == 1


def test_the_list_of_a_robot_that_fails_is_sold_again() -> None:
    orders = {"list": [{"from": [0, 0], "to": [4, 0]}] * 6}
    resolved = scene(
        LANE,
        [(1, 0), (4, 1)],
        orders=orders,
        strategy={"allocation": "auction", "right_of_way": "wait"},
        faults={"list": [{"robot": 0, "at": 2}], "tow_after": 2, "repair_time": None},
    )
    run = Simulation(resolved)
    run.run(until=1)
    order_queue_length = run.world.robots.order_queue_length
    assert order_queue_length[0] > 0
    run.run(until=4)
    assert order_queue_length[0] == 0
    run.run()
    assert run.finished and (run.world.orders.state == ORDER_DELIVERED).all()


def test_a_robot_in_its_bay_fails_and_comes_back_there() -> None:
    run = BatteryScene("b..\nb..", faults=failing(3, tow_after=5, repair_time=4))
    run.tick(3)
    assert run.status("A") == STATUS_TOWED, "it is in nobody's way: towed at once"
    assert statuses(run, 4)[-1] == STATUS_UP
    assert run.world.tally.failures[0].tolist() == [0, 1, 0], "nobody had to tow it off the floor"


def test_who_is_out_of_order_does_not_wait_when_zoning_halts_the_robots() -> None:
    settings = ("strategy.zoning=example_strategies:Halts", "faults={list: [{robot: 1, at: 35}]}")
    recorder = MemoryRecorder(resolved := resolve("tabletop-mini", settings))
    run = Simulation(resolved, on_record=recorder)
    run.run(until=45)
    assert run.world.robots.status.tolist() == [STATUS_UP, STATUS_FAILED, STATUS_UP]
    assert run.world.robots.action.tolist() == [ACTION_WAIT, ACTION_DOWN, ACTION_WAIT]
    assert [str(rule) for rule in validate_stored(recorder.recording()).violations] == []


def test_a_load_is_carried_on_if_its_robot_was_alone_in_a_corner() -> None:
    """Where no robot gets to a cell beside it, the load stays on the robot, and comes back with it."""
    resolved = scene(
        "t.t",
        [(0, 0)],
        orders={"list": [{"from": [0, 0], "to": [2, 0]}]},
        strategy=STRATEGY,
        faults={"list": [{"robot": 0, "at": 2}], "tow_after": 3, "repair_time": 5},
    )
    run = Simulation(resolved)
    run.run()
    assert run.finished and run.world.orders.state[0] == ORDER_DELIVERED
    assert ORDER_CARRIED not in run.world.orders.state


def test_who_is_out_of_order_does_not_wait_but_others_wait_for_it(tmp_path: Any) -> None:
    """Said where a run does not finish."""
    (tmp_path / "line.yaml").write_text(
        "name: line\nlayout:\n  picture: |\n    t...t\n"
        "fleet: {robots: 2, kinematics: omni, start: [[0, 0], [2, 0]]}\n"
        "orders: {list: [{from: [0, 0], to: [4, 0]}]}\n"
        "strategy: {allocation: shortest-job, right_of_way: wait}\n"
        "faults: {list: [{robot: 1, at: 1}], tow_after: null}\n"
        "stop: {when: delivered, max_duration: 5000}\n"
    )
    told = run_once(resolve(tmp_path / "line.yaml")).diagnosis
    assert "robot 1 has broken down, robot 0 has only waited since" in told
    assert "robot 0 waits for robot 1, which holds (2, 0) and is down" in told
    told = run_once(resolve(tmp_path / "line.yaml", ["faults.list=[]"])).diagnosis
    assert told.endswith("robot 0 waits for robot 1, which holds (2, 0) and is idle")
