"""Robots that are towed with a pod: it is put into storage, and its trip goes on from there."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from handmade_recordings import rules
from pod_scenes import line_ticks, pod_scene

from automaton.engine.record_codes import CHANGE_LOAD_LEFT
from automaton.engine.state import NIL, ORDER_DELIVERED, ORDER_WAITING
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.validator import Report, validate_stored
from automaton.world.resolve import Resolved, resolve

LINE = {"pod": 1, "station": "P1"}
FULL = """\
>>>>>>>>>v
^#pp##q##v
^########v
^<<<<t<<<<"""


def failing(at: int, *starts: list[int], **parts: Any) -> Resolved:
    """Robot 0, of those with these starts, fails in a tick and is towed for good 5 ticks later."""
    faults = {"list": [{"robot": 0, "at": at}], "tow_after": 5, "repair_time": None}
    fleet = {"robots": len(starts), "kinematics": "omni", "start": list(starts)}
    orders = parts.pop("listed", None)
    if orders is not None:
        parts["orders"] = {"list": orders}
    return pod_scene(parts.pop("lines", [LINE]), fleet=fleet, faults=faults, **parts)


def played(scene: Resolved, until: int | None = None) -> tuple[Simulation, Report]:
    recorder = MemoryRecorder(scene)
    run = Simulation(scene, on_record=recorder)
    run.run(until)
    recorder(run)
    return run, validate_stored(recorder.recording())


def slot_at(run: Simulation, x: int, y: int) -> int:
    return int(run.world.grid.slot[run.resolved.floor_plan.cell(x, y)])


def test_a_pod_is_put_into_the_nearest_free_cell_and_its_trip_waits_there() -> None:
    """Robot 0 fails in the column of 9, with the pod from (2, 1); (2, 1) and (7, 1) are free."""
    scene = failing(13, [2, 1], [0, 0])
    run = Simulation(scene)
    run.run(17)
    pods, orders = run.world.pods, run.world.orders
    assert pods.slot[0] == NIL and run.world.robots.load[0] == 0, "it stands with its pod"
    run.run(18)
    assert run.world.slots.content[pods.slot[0]] == 0 and orders.current_slot[0] == pods.slot[0]
    assert orders.state[0] == ORDER_WAITING and pods.trip[0] == 0
    assert run.world.robots.cell[0] == NIL and run.world.robots.load[0] == NIL
    assert run.world.pod_stations.taken.tolist() == [1], "the place is given to robot 1"
    run, report = played(scene)
    assert run.finished and rules(report) == []
    assert run.world.lines.trip.tolist() == [0] and run.world.orders.legs.tolist() == [2]


TWO_FREE = """\
t........
#q##p##q#"""


@pytest.mark.parametrize(
    ("cells", "x"), [([[2, 0], [4, 0]], 4), ([[4, 0], [4, 1]], 1), ([[1, 0], [1, 1]], 4)]
)
def test_speed_limits_count_on_the_way_to_a_free_cell(cells: list[list[int]], x: int) -> None:
    """The robot stands in (4, 0), right above the cell of its pod."""
    limit = {"cells": cells, "max_speed": 9}
    parts = {"picture": TWO_FREE, "stations": {}, "floor": {"speed_limits": [limit]}}
    durations = {"pick": 1, "drop": 1, "handling": {"line": 5}}
    run, report = played(failing(4, [4, 1], lines=[{"pod": 1}], durations=durations, **parts), 20)
    assert run.world.pods.slot.tolist() == [slot_at(run, x, 1)] and rules(report) == []


def test_a_trip_with_no_stop_left_is_over() -> None:
    run, report = played(failing(40, [2, 1]))
    assert line_ticks(run) == [38]
    assert run.finished and rules(report) == []
    orders = run.world.orders
    assert orders.moves.tolist() == [16] and orders.driven.tolist() == [16], "15 there, one back"
    assert orders.state.tolist() == [ORDER_DELIVERED] and run.world.pods.trip[0] == NIL


@pytest.mark.parametrize("at", [10, 28])
def test_an_order_of_a_list_whose_pod_is_put_aside_is_verified(at: int) -> None:
    """Its stop is done from tick 19 on, until 25."""
    order = {"from": [2, 1], "stops": [{"at": [5, 3], "for": 7}]}
    run, report = played(failing(at, [2, 1], [0, 0], listed=[order]), 60)
    assert run.world.trips.begun.tolist() == [1] and rules(report) == []


TWICE = {"from": [2, 1], "stops": [{"at": [5, 3], "for": 6}, {"at": [5, 3], "for": 0}]}


@pytest.mark.parametrize("at", [20, 25])
def test_a_robot_that_is_to_be_towed_does_no_stop_of_0_ticks(at: int) -> None:
    """It is down from tick 25 on, at whose end it would do the second stop."""
    run, report = played(failing(at, [2, 1], [0, 0], listed=[TWICE]), 29)
    assert run.world.stops.done.tolist() == [24, NIL] and rules(report) == []


@pytest.mark.parametrize("at", [20, 25])
def test_a_robot_does_no_stop_of_0_ticks_until_it_is_repaired_in_place(at: int) -> None:
    faults = {"list": [{"robot": 0, "at": at}], "repair_in_place": 15}
    run, report = played(pod_scene([], orders={"list": [TWICE]}, faults=faults), 60)
    assert run.world.stops.done.tolist() == [24, 40] and rules(report) == []


def test_who_stands_beneath_a_pod_that_is_put_there_gets_its_trip() -> None:
    """Robot 1 stands in the one cell that is free once (2, 1) is reserved."""
    run = Simulation(failing(13, [2, 1], [6, 1], picture=FULL))
    run.run(17)
    here, there = slot_at(run, 2, 1), slot_at(run, 6, 1)
    run.world.slots.reserved_by[here] = 1
    run.run(18)
    assert run.world.robots.load.tolist() == [NIL, 0], "robot 1 lifts it at once, where it stands"
    assert run.world.robots.cell[1] == run.world.slots.cell[there]


def test_a_robot_is_towed_when_there_is_room_for_its_pod() -> None:
    run = Simulation(failing(13, [2, 1], [0, 0], picture=FULL))
    run.run(17)
    here, there = slot_at(run, 2, 1), slot_at(run, 6, 1)
    run.world.slots.reserved_by[[here, there]] = 1
    run.run(30)
    assert run.world.robots.load[0] == 0 and run.world.robots.cell[0] != NIL
    run.world.slots.reserved_by[there] = NIL
    run.run(31)
    assert run.world.pods.slot[0] == there and run.world.robots.cell[0] == NIL


@pytest.mark.parametrize("join", [True, False])
def test_lines_that_came_meanwhile_are_done(join: bool) -> None:
    lines = [LINE, {**LINE, "release": 15}, {**LINE, "release": 17}]
    run, report = played(failing(13, [2, 1], [0, 0], lines=lines, pods={"join": join}))
    assert run.finished and rules(report) == [] and max(run.world.lines.trip) == (0 if join else 2)


def test_the_validator_finds_a_pod_that_is_put_elsewhere_or_stays_on_its_robot() -> None:
    scene = failing(13, [2, 1], [0, 0])
    recorder = MemoryRecorder(scene)
    run = Simulation(scene, on_record=recorder)
    run.run(20)
    recorder(run)
    recording = recorder.recording()
    (ticks,) = [one.content for one in recording.frames if one.kind == FRAME_KIND_TICKS]
    (row,) = np.flatnonzero(ticks["changes"][:, 1] == CHANGE_LOAD_LEFT)
    assert rules(validate_stored(recording)) == []
    ticks["changes"][row, 3] = slot_at(run, 7, 1)
    texts = [one.text for one in validate_stored(recording).violations]
    assert "is towed, and its pod 1 is put into slot 5, not the nearest one" in texts
    ticks["changes"] = np.delete(ticks["changes"], row, axis=0)
    texts = [one.text for one in validate_stored(recording).violations]
    assert "is towed with its pod" in texts


AREA = """\
t.....p
##.####
##q####"""


@pytest.mark.parametrize(("closed_to", "place"), [("slow", (2, 2)), ("empty", (6, 0))])
def test_no_pod_is_put_where_robots_without_a_load_may_not_come(
    closed_to: str, place: tuple[int, int]
) -> None:
    """Robot 0 fails with its pod in (2, 0): the cell below is nearest, behind one that may be closed."""
    scenario = {
        "name": "area",
        "layout": {"picture": AREA},
        "fleet": {
            "robots": 2,
            "kinematics": "omni",
            "start": [[6, 0], [1, 0]],
            "types": [{"name": "fast", "robots": 1}, {"name": "slow"}],
        },
        "areas": {"area": {"from": [2, 1], "to": [2, 1], "closed_to": [closed_to]}},
        "faults": {"list": [{"robot": 0, "at": 5}], "tow_after": 5, "repair_time": None},
        "orders": {"lines": [LINE | {"station": 1}]},
        "stop": {"when": "delivered", "max_duration": 60},
        "strategy": {"allocation": "first-come", "right_of_way": "retreat"},
    }
    scene = resolve(msgspec.convert(scenario, Scenario))
    run, report = played(scene, 12)
    assert run.world.pods.slot[0] == slot_at(run, *place) and report.valid
