"""The validator on batteries, faults and orders that come in time: each broken rule is named."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from drawn_scenes import recorded_run
from handmade_recordings import E, S, W, header, played, rules

from automaton.engine.record_codes import (
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_LOAD_LEFT,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    CHANGE_STATUS,
    EXECUTED_CHARGE,
    EXECUTED_DROP,
    EXECUTED_PICK,
    EXECUTED_WAIT,
)
from automaton.engine.state import (
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_REMOVED,
    STATUS_TOWED,
    STATUS_UP,
)
from automaton.recording.contents import FRAME_KIND_KEYFRAME, FRAME_KIND_TICKS
from automaton.recording.frames import Recording
from automaton.verification.validator import Report, validate_stored
from automaton.world.resolve import resolve

FLOOR = """\
c..t
...t
"""
ORDERS = {"list": [{"from": [3, 0], "to": [3, 1]}, {"from": [3, 1], "to": [3, 0], "release": 5}]}
BATTERY = {
    "initial_charge": 25.0,
    "drain": {"move": 10.0, "pick": 1.0, "wait": 0.5},
    "charge_rate": 4.0,
}
FAULTS = {"list": [{"robot": 0, "at": 3}], "tow_after": 4, "repair_time": 2}


def floor(*starts: tuple[int, int], **parts: Any) -> dict[str, Any]:
    return header(FLOOR, list(starts) or [(0, 0)], orders=ORDERS, **parts)


def texts(report: Report) -> str:
    return "; ".join(violation.text for violation in report.violations)


# Energy.


def test_moves_are_paid() -> None:
    head = floor(battery=BATTERY)
    assert played(head, {0: E}, {0: E}).valid
    report = played(head, {0: E}, {0: E}, {0: S})
    assert rules(report) == ["energy"]
    assert "begins a move that takes 100000000 units of charge, but has 50000000" in texts(report)


def test_robots_charge_on_chargers_only() -> None:
    head = floor(battery=BATTERY)
    assert played(head, {0: EXECUTED_CHARGE}, {0: EXECUTED_CHARGE}, {0: E}, {0: E}, {0: S}).valid
    assert rules(played(head, {0: E}, {0: EXECUTED_CHARGE})) == ["energy"]
    assert "without a charger" in texts(played(head, {0: E}, {0: EXECUTED_CHARGE}))


def test_waits_and_standing_still_are_paid_too() -> None:
    """25 % - 2 moves - 11 ticks of 0.5 %: out of energy, but not with what is left after 3 ticks."""
    head = floor(battery=BATTERY)
    ran_out = [(14, CHANGE_STATUS, 0, STATUS_DEPLETED)]
    assert played(head, {0: E}, {0: E}, *[{}] * 12, changes=ran_out).valid
    waits = [(3, CHANGE_DURATION, 0, 11), *ran_out]
    assert played(head, {0: E}, {0: E}, {0: EXECUTED_WAIT}, *[{}] * 11, changes=waits).valid


def test_a_robot_with_energy_is_not_empty() -> None:
    report = played(floor(battery=BATTERY), {}, changes=[(1, CHANGE_STATUS, 0, STATUS_DEPLETED)])
    assert rules(report) == ["energy"] and "is out of energy with 250000000 units" in texts(report)


def behind(charge: float, **parts: Any) -> dict[str, Any]:
    """B drives for a tick behind A, whose moves take 4; a move takes 10 %, a wait 0.5 %."""
    types = [
        {"name": "slow", "robots": 1, "durations": {"move": 4}},
        {"name": "fast", "robots": 1, "battery": {"initial_charge": charge}},
    ]
    fleet = {"robots": 2, "kinematics": "omni", "start": [[2, 0], [1, 0]], "types": types}
    orders = {"list": [{"from": [4, 0], "to": [4, 1]}]}
    full = BATTERY | {"initial_charge": 100}
    return header("c...t\n....t", "", fleet=fleet, orders=orders, battery=full, **parts)


def test_ticks_behind_the_robot_ahead_are_paid_as_waits_are() -> None:
    """10 % for a tick of moving, 3 * 0.5 % for the others, and 10 % for the next move."""
    ticks: list[dict[int, int]] = [{0: E, 1: E}, {}, {}, {}, {1: S}]
    lengths = [(1, CHANGE_DURATION, 1, 4)]
    assert played(behind(21.5), *ticks, changes=lengths).valid
    report = played(behind(21.4), *ticks, changes=lengths)
    assert rules(report) == ["energy"] and "has 99000000" in texts(report)


def test_a_battery_that_empties_in_a_move_takes_the_robot_out_when_that_is_over() -> None:
    lengths = [(1, CHANGE_DURATION, 1, 4)]
    for down in range(3, 7):
        rows = [*lengths, (down, CHANGE_STATUS, 1, STATUS_DEPLETED)]
        report = played(behind(10.9), {0: E, 1: E}, *[{}] * 6, changes=rows)
        assert rules(report) == (["energy"] if down < 5 else []), down


def test_a_robot_that_breaks_down_in_a_move_goes_down_when_that_is_over() -> None:
    faults = {"list": [{"robot": 1, "at": 2}]}
    for down, valid in ((3, False), (5, True)):
        rows = [(1, CHANGE_DURATION, 1, 4), (down, CHANGE_STATUS, 1, STATUS_FAILED)]
        report = played(behind(50, faults=faults), {0: E, 1: E}, *[{}] * 5, changes=rows)
        assert rules(report) == ([] if valid else ["energy"])


# Faults.


def out(*later: tuple[int, int, int, int]) -> list[tuple[int, int, int, int]]:
    """Robot 0 breaks down in tick 3, as the scenario says."""
    return [(3, CHANGE_STATUS, 0, STATUS_FAILED), *later]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (out(), None),
        (out((7, CHANGE_STATUS, 0, STATUS_TOWED), (9, CHANGE_STATUS, 0, STATUS_UP)), None),
        ([(2, CHANGE_STATUS, 0, STATUS_FAILED)], "breaks down without a cause in the scenario"),
        (out((4, CHANGE_STATUS, 0, STATUS_FAILED)), "goes down although it is already down"),
        (out((6, CHANGE_STATUS, 0, STATUS_TOWED)), "is towed at the wrong time"),
        (out((8, CHANGE_STATUS, 0, STATUS_TOWED)), "is towed at the wrong time"),
        ([(7, CHANGE_STATUS, 0, STATUS_TOWED)], "is towed at the wrong time"),
        (
            out((7, CHANGE_STATUS, 0, STATUS_REMOVED)),
            "is removed, or towed to return, against the rules",
        ),
        (
            out((7, CHANGE_STATUS, 0, STATUS_TOWED), (8, CHANGE_STATUS, 0, STATUS_UP)),
            "returns at the wrong time",
        ),
        (out((5, CHANGE_STATUS, 0, STATUS_UP)), "returns at the wrong time"),
        (out((4, CHANGE_STATUS, 0, 9)), "an invalid change among faults"),
        (out((4, CHANGE_STATUS, 0, 1)), "an invalid change among faults"),
    ],
)
def test_robots_fail_are_towed_and_come_back_when_the_scenario_says(changes, says) -> None:
    report = played(floor(faults=FAULTS), *[{}] * 10, changes=changes)
    if says is None:
        assert report.valid, texts(report)
    else:
        assert says in texts(report)


def test_a_robot_out_of_order_does_nothing() -> None:
    report = played(floor(faults=FAULTS), {}, {}, {}, {0: E}, changes=out())
    assert rules(report) == ["energy"] and "although it is down" in texts(report)


def test_a_towed_robot_is_in_nobody_s_way() -> None:
    head = floor((1, 0), (2, 0), faults=FAULTS)
    towed = out((7, CHANGE_STATUS, 0, STATUS_TOWED))
    assert played(head, *[{}] * 6, {1: W}, changes=towed).valid
    assert rules(played(head, *[{}] * 5, {1: W}, changes=out())) == ["capacity"]


# Loads and orders.

PICK_UP = [(1, CHANGE_ORDER_RESERVED, 0, 0), (1, CHANGE_PICKED, 0, 0)]
LEFT = [
    (3, CHANGE_STATUS, 0, STATUS_FAILED),
    (3, CHANGE_LOAD_LEFT, 0, 2),
    (3, CHANGE_ORDER_RESERVED, 0, -1),
]


def left_load(*acts: dict[int, int], changes: list[tuple[int, int, int, int]]) -> Report:
    """Robot 0 picks up at (3, 0), drives to (2, 0) and fails there; robot 1 stands at (1, 1)."""
    head = floor((3, 0), (1, 1), faults=FAULTS)
    return played(head, {0: EXECUTED_PICK}, {0: W}, {}, *acts, changes=[*PICK_UP, *LEFT, *changes])


def taken(tick: int) -> list[tuple[int, int, int, int]]:
    return [(tick, CHANGE_ORDER_RESERVED, 0, 1), (tick, CHANGE_PICKED, 1, 0)]


def test_a_load_left_behind_is_picked_up_from_beside_it() -> None:
    dropped = [(7, CHANGE_DROPPED, 1, 1), (7, CHANGE_ORDER_RESERVED, 0, -1)]
    way = [{1: E}, {1: EXECUTED_PICK}, {1: E}, {1: EXECUTED_DROP}]
    assert left_load(*way, changes=[*taken(5), *dropped]).valid
    too_far = left_load({1: EXECUTED_PICK}, changes=taken(4))
    assert rules(too_far) == ["load"] and "handles a slot that is not adjacent" in texts(too_far)


def test_a_load_lies_in_a_spare_slot_until_it_is_picked_up() -> None:
    nothing = left_load(changes=[(3, CHANGE_LOAD_LEFT, 0, 3)])
    assert rules(nothing) == ["load"], "it has left its load already"
    station = [row if row[1] != CHANGE_LOAD_LEFT else (3, CHANGE_LOAD_LEFT, 0, 1) for row in LEFT]
    head = floor((3, 0), (1, 1), faults=FAULTS)
    report = played(head, {0: EXECUTED_PICK}, {0: W}, {}, changes=[*PICK_UP, *station])
    assert "leaves no load, or not in a spare slot" in texts(report)
    twice = left_load(
        {1: E}, {1: EXECUTED_PICK}, {1: EXECUTED_PICK}, changes=[*taken(5), *taken(6)]
    )
    assert not twice.valid


def test_an_order_that_is_not_known_yet_is_nobody_s() -> None:
    head = floor((3, 1))
    order = [(1, CHANGE_ORDER_RESERVED, 1, 0), (1, CHANGE_PICKED, 0, 1)]
    early = played(head, {0: EXECUTED_PICK}, changes=order)
    assert "order" in rules(early) and "although it is not free" in texts(early)
    later = [(5, code, subject, value) for _, code, subject, value in order]
    assert played(head, *[{}] * 4, {0: EXECUTED_PICK}, changes=later).valid


# Whole runs, altered.


@pytest.fixture(scope="module")
def failing() -> Recording:
    """Four robots, one of which fails; recorded with its keyframes."""
    settings = [
        "orders.count=40",
        "faults={list: [{robot: 2, at: 850}], tow_after: 90, repair_time: 200}",
    ]
    run, recorder = recorded_run(resolve("depots", settings), seed=3)
    assert run.finished and run.world.tally.failures.sum() > 0
    recording = recorder.recording()
    assert validate_stored(recording).valid
    return recording


def altered(recording: Recording) -> Recording:
    return Recording(
        copy.deepcopy(recording.header), copy.deepcopy(list(recording.frames)), complete=True
    )


@pytest.mark.parametrize("name", ["charge", "status"])
def test_a_recorded_state_with_another_charge_or_status_is_noticed(
    failing: Recording, name: str
) -> None:
    recording = altered(failing)
    frame = next(
        f for f in recording.frames if f.kind == FRAME_KIND_KEYFRAME and f.content["tick"] > 100
    )
    frame.content["robots"][name][1] += 3
    report = validate_stored(recording)
    assert rules(report) == ["record"] and f"robots.{name}[1]" in texts(report)


def test_a_fuller_battery_at_the_start_is_noticed(failing: Recording) -> None:
    recording = altered(failing)
    recording.header["robots"]["charge"][0] -= 500
    assert set(rules(validate_stored(recording))) >= {"record"}


@pytest.mark.parametrize(
    "code", [CHANGE_STATUS, CHANGE_LOAD_LEFT, CHANGE_ORDER_RESERVED, CHANGE_PICKED]
)
def test_a_change_left_out_is_noticed(failing: Recording, code: int) -> None:
    recording = altered(failing)
    rows = [
        (frame, k)
        for frame in recording.frames
        if frame.kind == FRAME_KIND_TICKS
        for k, row in enumerate(frame.content["changes"].tolist())
        if row[1] == code
    ]
    frame, k = rows[0]
    changes = frame.content["changes"]
    frame.content["changes"] = changes[[n for n in range(len(changes)) if n != k]]
    assert not validate_stored(recording).valid


def test_a_tick_of_charging_left_out_is_noticed(failing: Recording) -> None:
    recording = altered(failing)
    for frame in recording.frames:
        if frame.kind == FRAME_KIND_TICKS and (frame.content["executed"] == EXECUTED_CHARGE).any():
            rows, robots = (frame.content["executed"] == EXECUTED_CHARGE).nonzero()
            frame.content["executed"][rows[0], robots[0]] = 0
            break
    assert not validate_stored(recording).valid
