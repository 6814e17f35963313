"""Gates in recordings made by hand: what is right is not reported, and each broken rule is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gate_scenes import gate_scene
from handmade_recordings import E, W, header, played, rules

from automaton.engine.record_codes import CHANGE_STATUS, EXECUTED_WAIT
from automaton.engine.record_codes import EXECUTED_BLOCKED as B
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.verification.energy_rules import STATUS_DEPLETED
from automaton.verification.gate_rules import CheckedGate
from automaton.verification.verification import verify_recording

AISLE = "......d"
CLOSED = {"closed": [{"cells": [[2, 0]], "from": 2, "for": 3}]}
DOOR = {"doors": [{"at": [1, 0], "opening_time": 2, "hold_open": 1}]}
BLOCK = {"cells": [[1, 0], [2, 0]], "max_robots": 1, "direction": "any"}
LIFT = {"lifts": [{"shaft": [[1, 0], [3, 0]], "travel_time": 4, "door_time": 1}]}


def head(floor: dict[str, Any], *starts: tuple[int, int], **parts: Any) -> dict[str, Any]:
    orders = {"list": [{"stops": [[5, 0]]}]}
    return header(AISLE, list(starts), floor=floor, orders=orders, **parts)


def broken(floor: dict[str, Any], *ticks: dict[int, int], start: Any = ((0, 0),)) -> list[str]:
    return rules(played(head(floor, *start), *ticks))


@pytest.mark.parametrize(("waits", "expected"), [(0, ["closed"]), (2, ["closed"]), (3, [])])
def test_no_entry_into_a_closed_cell(waits: int, expected: list[str]) -> None:
    """It is closed in ticks 2 to 4; the robot moves into it in tick 2, 4 or 5."""
    assert broken(CLOSED, {0: E}, *[{0: B}] * waits, {0: E}) == expected


def test_who_is_in_a_closed_cell_may_leave_it() -> None:
    assert broken(CLOSED, {0: E}, start=((2, 0),)) == []


def test_closings_other_than_the_scenario_says() -> None:
    content = head(CLOSED, (0, 0))
    content["gates"]["closings"] = np.array([[7, 10]])
    assert rules(played(content, {0: E}, {0: E})) == ["closed"]


@pytest.mark.parametrize(
    ("ticks", "expected"),
    [
        ([{0: E}], ["door"]),
        ([{0: B}, {0: E}], ["door"]),
        ([{0: B}, {0: B}, {0: E}], []),
        ([{0: EXECUTED_WAIT}, {}, {0: E}], []),
        ([{}, {}, {0: E}], ["door"]),
        ([{0: B}, {}, {}, {}, {}, {0: E}], ["door"]),
    ],
)
def test_a_door_opens_so_long_after_it_was_asked_for(
    ticks: list[dict[int, int]], expected: list[str]
) -> None:
    changes = [(1, 3, 0, 1)] if ticks[0].get(0) == EXECUTED_WAIT else []
    report = played(head(DOOR, (0, 0)), *ticks, changes=changes)
    assert rules(report) == expected


def test_a_door_that_somebody_is_in_stays_open() -> None:
    """It is in the door from tick 3 to 6, leaves in tick 7 and comes back in tick 8."""
    assert broken(DOOR, {0: B}, {0: B}, {0: E}, {}, {}, {}, {0: W}, {0: E}) == []
    assert broken(DOOR, {0: B}, {0: B}, {0: E}, {0: W}, {}, {}, {}, {0: E}) == ["door"]


def test_no_more_robots_in_a_block_than_it_holds() -> None:
    """(1, 0) and (2, 0) hold one: the second robot may come when the first has been out for a tick."""
    floor = {"blocks": [BLOCK]}
    start = ((1, 0), (0, 0))
    assert broken(floor, {0: E}, {0: E}, {1: E}, start=start) == []
    assert broken(floor, {0: E}, {0: E, 1: E}, start=start) == ["block"]
    assert broken({"blocks": [BLOCK | {"max_robots": 2}]}, {0: E}, {1: E}, start=start) == []


def test_two_entrants_of_one_tick_are_too_many_for_one_place() -> None:
    floor = {"blocks": [BLOCK]}
    assert broken(floor, {0: E, 1: W}, start=((0, 0), (3, 0))) == ["block"]


def test_nobody_enters_a_block_of_one_direction_from_the_other_end() -> None:
    same = {"blocks": [BLOCK | {"max_robots": 2, "direction": "same"}]}
    assert broken(same, {0: E}, {1: W}, start=((0, 0), (3, 0))) == ["block"]


@pytest.mark.parametrize(
    ("ticks", "expected"),
    [
        ([{0: E}], ["lift"]),
        ([{0: B}, {0: E}], []),
        ([{1: B}, {1: B}, {1: B}, {1: B}, {1: B}, {1: W}], []),
        ([{1: B}, {1: B}, {1: B}, {1: W}], ["lift"]),
    ],
)
def test_a_lift_is_entered_where_its_cabin_is(
    ticks: list[dict[int, int]], expected: list[str]
) -> None:
    """The cabin is at (1, 0), with a tick for its doors; 4 more ticks to the mouth at (3, 0)."""
    assert broken(LIFT, *ticks, start=((0, 0), (4, 0))) == expected


def test_a_lift_takes_one_robot() -> None:
    """Moves in it take 2 ticks each; the other robot waits until the lift is left."""
    changes = [(3, 3, 0, 2), (5, 3, 0, 2)]
    ticks = [{0: B}, {0: E, 1: B}, {0: E, 1: W}]
    report = played(head(LIFT, (0, 0), (4, 0)), *ticks, changes=changes[:1])
    assert "lift" in rules(report)


def test_only_gates_that_robots_use_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three blocks the robot is in the first one after tick 2, nobody comes near the others."""
    looked: list[set[int]] = []

    def look(self: CheckedGate, *given: Any) -> None:
        looked.append(self.cells)

    monkeypatch.setattr(CheckedGate, "look", look)
    blocks = [BLOCK | {"cells": [[x, 0]]} for x in (2, 4, 5)]
    assert broken({"blocks": blocks}, {0: E}, {0: E}, {0: W}, {0: W}, {}) == []
    assert len(looked) == 2  # it is in it as tick 3 begins, and out as tick 4 does
    assert all(cells == looked[0] for cells in looked)


@pytest.mark.parametrize(("charge", "expected"), [(39.5, []), (40.5, ["energy"])])
def test_a_robot_that_cannot_pay_a_move_in_a_lift_is_out_of_energy(
    charge: float, expected: list[str]
) -> None:
    """A move in the lift takes 20 ticks and 40 % of the battery; the robot stands at its mouth."""
    lift = {"lifts": [{"shaft": [[1, 0], [2, 0]], "travel_time": 20}]}
    battery = {"drain": {"move": 2.0}, "charge_rate": 1.0, "initial_charge": charge}
    content = head(lift, (0, 0), battery=battery)
    content["robots"]["cell"] = content["robots"]["cell"] + 1  # no scenario begins there
    report = played(content, {}, changes=[(1, CHANGE_STATUS, 0, STATUS_DEPLETED)])
    assert rules(report) == expected


@pytest.mark.parametrize(("length", "expected"), [(2, []), (1, ["move time"]), (3, ["move time"])])
def test_moves_in_a_lift_take_their_share(length: int, expected: list[str]) -> None:
    changes = [(3, 3, 0, length)] if length != 1 else []
    report = played(head(LIFT, (0, 0)), {0: B}, {0: E}, {0: E}, changes=changes)
    assert rules(report) == expected


def test_robots_that_were_towed_out_of_a_shaft_come_back_there() -> None:
    """Where robots leave the floor they come back where they stood: here between two mouths."""
    lift = {"shaft": [[3, 0], [3, 2]], "travel_time": 4, "door_time": 1}
    scene = gate_scene(
        {"lifts": [lift]},
        (6, 2),
        (0, 0),
        picture=".......\n###.###\n.......",
        fleet={"robots": 1, "kinematics": "omni", "start": [[0, 0]], "when_idle": "leave"},
        faults={"list": [{"robot": 0, "at": 7}], "tow_after": 2, "repair_time": 3},
        strategy={"allocation": "first-come", "routing": "shortest", "right_of_way": "retreat"},
    )
    memory = MemoryRecorder(scene)
    run = Simulation(scene, on_record=memory)
    run.run()
    assert run.finished and run.world.robots.home[0] == scene.floor_plan.cell(3, 1)
    assert verify_recording(memory.recording()).passed


@pytest.mark.parametrize("refine", [1, 2, 3])
def test_the_shares_of_moves_in_a_lift_are_those_of_coarse_ticks(refine: int) -> None:
    """Two moves take 3 and 4 of 7 ticks; in ticks that are half as long 6 and 8, not 7 and 7."""
    lift = {"shaft": [[3, 0], [5, 0]], "travel_time": 7, "door_time": 1}
    memory = MemoryRecorder(scene := gate_scene({"lifts": [lift]}, (7, 0), refine=refine))
    run = Simulation(scene, on_record=memory)
    run.run()
    assert run.finished and verify_recording(memory.recording()).passed
