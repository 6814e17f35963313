"""Robots that are repaired where they break down: they keep what they have, and hold their cell."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from automaton.engine.state import BATTERY_FULL, NIL, STATUS_FAILED, STATUS_UP
from automaton.history.event_history import EventHistory
from automaton.history.explanation import explain
from automaton.history.snapshot import take_snapshot
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve

PICTURE = """\
s......d
........"""
FAULTS = {"list": [{"robot": 0, "at": 5}], "repair_in_place": 6}


def simulation(**parts: Any) -> tuple[Simulation, MemoryRecorder]:
    """Robot 0 takes a load from the shelf to the other end of the row: a pick, five moves, a drop."""
    scenario: dict[str, Any] = {
        "name": "repairs",
        "layout": {"picture": PICTURE},
        "fleet": {"robots": 1, "kinematics": "omni", "start": [[1, 0]]},
        "orders": {"list": [{"from": [0, 0], "to": [7, 0]}]},
        "strategy": {"allocation": "first-come", "routing": "shortest", "right_of_way": "wait"},
        "stop": {"when": "delivered", "max_duration": 100},
    }
    made = resolve(msgspec.convert(scenario | parts, Scenario))
    recorder = MemoryRecorder(made)
    return Simulation(made, on_record=recorder, on_observe=EventHistory()), recorder


def test_a_robot_goes_on_with_its_load_after_its_repair() -> None:
    quick, _ = simulation()
    quick.run()
    made, recorder = simulation(faults=FAULTS)
    made.run(6)
    robots = made.world.robots
    assert (robots.status[0], robots.load[0], robots.order[0]) == (STATUS_FAILED, 0, 0)
    here = int(robots.cell[0])
    assert explain(take_snapshot(made), made.resolved.floor_plan, 0).lines == [
        "robot 0 has been down for 2 ticks: robot 0 has broken down; it continues in 5 ticks"
    ]
    made.run(10)
    assert (robots.status[0], int(robots.cell[0])) == (STATUS_FAILED, here)
    made.run(11)
    assert robots.status[0] == STATUS_UP and robots.cell[0] != here
    made.run()
    assert made.tick == quick.tick + 6
    metrics = metrics_of(made)
    assert (metrics["breakdowns"], metrics["towed"], metrics["downtime"]) == (1, 0, 6)
    assert validate_stored(recorder.recording()).violations == []


def test_its_battery_is_as_it_was_and_an_empty_one_is_still_towed() -> None:
    battery = {"drain": {"move": 10.0}, "charge_rate": 1.0, "initial_charge": 40.0}
    made, recorder = simulation(
        faults={**FAULTS, "tow_after": 3},
        battery=battery,
        layout={"picture": "s......d\n.......c"},
    )
    made.run(10)
    assert made.world.robots.charge[0] == BATTERY_FULL // 10, "three moves"
    made.run(40)
    assert made.world.robots.cell[0] == NIL, "it ran empty, and was towed"
    assert validate_stored(recorder.recording()).violations == []


def test_repairs_that_are_drawn_come_from_the_scenario() -> None:
    """With a list, each takes one of its times."""
    made, recorder = simulation(
        faults={"mtbf": 10, "repair_in_place": {"empirical": [2, 9]}},
        orders={"generator": "tours", "count": 500},
        stop={"when": "never", "max_duration": 400},
    )
    lengths: set[int] = set()
    down = 0
    while made.tick < 400:
        made.run(made.tick + 1)
        if made.world.robots.status[0] == STATUS_FAILED:
            down += 1
        elif down:
            lengths.add(down)
            down = 0
    assert lengths == {2, 9}
    assert validate_stored(recorder.recording()).violations == []


@pytest.mark.parametrize("right_of_way", ["pibt", "retreat"])
def test_others_go_round_it_or_wait_for_it(right_of_way: str) -> None:
    """Nobody else takes its order: both orders are delivered, each by one robot."""
    made, recorder = simulation(
        fleet={"robots": 2, "kinematics": "omni", "start": [[1, 0], [1, 1]]},
        orders={"list": [{"from": [0, 0], "to": [7, 0]}, {"stops": [[6, 1]]}]},
        faults={"list": [{"robot": 0, "at": 3}], "repair_in_place": 20},
        strategy={"allocation": "first-come", "right_of_way": right_of_way},
    )
    made.run()
    assert made.finished
    assert made.world.orders.legs.tolist() == [1, 1]
    assert validate_stored(recorder.recording()).violations == []
