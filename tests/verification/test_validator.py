"""The validator: good runs pass, and for each rule a recording that breaks it, and only it."""

from __future__ import annotations

import copy
import subprocess
import sys
from itertools import product
from typing import Any

import numpy as np
import pytest
from handmade_recordings import BAYS, FLOOR, RAILS, E, N, S, W, header, played, recorded, rules

from automaton.engine.record_codes import (
    CHANGE_DELAYED,
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    ENTERED_PARKING_BAY,
    EXECUTED_BAY_BLOCKED,
    EXECUTED_BLOCKED,
    EXECUTED_DROP,
    EXECUTED_ILLEGAL,
    EXECUTED_PICK,
    EXECUTED_WAIT,
    LEFT_PARKING_BAY,
    MOVE_EAST,
    MOVE_NORTH,
    TURN_LEFT,
    TURN_RIGHT,
)
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_KEYFRAME,
    FRAME_KIND_TICKS,
    DecodedFrame,
)
from automaton.verification.energy_rules import BEGIN
from automaton.verification.move_time_rules import random_bits
from automaton.verification.validator import (
    MAX_VIOLATIONS,
    Report,
    validate_recording,
    validate_stored,
)

# What the world does is right.


@pytest.mark.parametrize("allocation", ["independent", "cooperative"])
@pytest.mark.parametrize("move", [1, 2, 3])
@pytest.mark.parametrize("following", ["convoy", "handover", "none"])
@pytest.mark.parametrize(
    ("name", "kinematics"),
    [
        ("tabletop-1", "rail"),
        ("tabletop-2", "rail"),
        ("crossing", "omni"),
        ("crossing", "differential"),
    ],
)
def test_runs_keep_the_rules(
    name: str, kinematics: str, following: str, move: int, allocation: str
) -> None:
    report = validate_stored(
        recorded(
            name,
            f"fleet.kinematics={kinematics}",
            f"world.following={following}",
            f"durations.move={move}",
            f"strategy.allocation={allocation}",
            "stop.max_duration=1500",
        )
    )
    assert [str(violation) for violation in report.violations] == []
    assert report.ticks > 50


def test_the_report_counts_what_robots_did() -> None:
    recording = recorded("tabletop-mini")
    report = validate_stored(recording)
    assert report.counts["drop"] == report.counts["pick"] >= 25
    assert report.counts["parked"] >= 3 and report.counts["left_bay"] >= 3
    assert report.ticks == recording.ticks == recording.frames[-1].content["ticks"]  # type: ignore[index]


# Motion: A is robot 0, B is robot 1.


def test_two_robots_in_one_cell() -> None:
    """A>.<B"""
    report = played(header(FLOOR, [(0, 0), (2, 0)]), {0: E, 1: W})
    assert rules(report) == ["capacity"]
    assert report.violations[0].robots == (0, 1)
    assert report.violations[0].cell == (1, 0)
    assert str(report.violations[0]).startswith("tick 1: capacity: robot 0 and robot 1 at (1, 0): ")


def test_a_robot_drives_into_one_that_stands() -> None:
    """A>B"""
    assert rules(played(header(FLOOR, [(0, 0), (1, 0)]), {0: E})) == ["capacity"]


def test_a_queue_and_a_ring_move() -> None:
    assert played(header(FLOOR, [(0, 0), (1, 0)]), {0: E, 1: E}).valid
    ring = header(FLOOR, [(0, 0), (1, 0), (1, 1), (0, 1)])
    assert played(ring, {0: E, 1: S, 2: W, 3: N}).valid


def test_a_swap() -> None:
    """A><B"""
    assert rules(played(header(FLOOR, [(0, 0), (1, 0)]), {0: E, 1: W})) == ["swap"]


def test_robots_pass_each_other_where_both_cells_let_them() -> None:
    aisle = FLOOR.replace("......", ".==~~.")
    assert played(header(aisle, [(1, 0), (2, 0)]), {0: E, 1: W}).valid
    head = header(aisle, [(0, 0), (3, 0)])
    assert played(head, {0: E, 1: W}, {0: E, 1: W}).valid
    assert rules(played(header(aisle, [(0, 0), (1, 0)]), {0: E, 1: W})) == ["swap"]


@pytest.mark.parametrize("late", range(5))
@pytest.mark.parametrize("spans", [(3, 1), (1, 3), (2, 2), (3, 3)])
@pytest.mark.parametrize("following", ["handover", "convoy"])
def test_two_robots_meet_between_two_cells(
    following: str, spans: tuple[int, int], late: int
) -> None:
    """A drives from (0, 0) into a cell without limit, where B is; B starts some ticks later."""
    floor = FLOOR.replace("......", ".~~...")
    head = header(floor, [(0, 0), (1, 0)], world={"following": following})
    begun: list[dict[int, int]] = [{} for _ in range(6)]
    begun[0][0] = E
    begun[late][1] = W
    rows = [(1, CHANGE_DURATION, 0, spans[0]), (late + 1, CHANGE_DURATION, 1, spans[1])]
    found = rules(played(head, *begun, changes=rows))
    swap = ["swap"] if late < spans[0] else []
    assert [rule for rule in found if rule not in ("capacity", "move time")] == swap
    begins_too_early = following == "handover" and late < spans[0] - 1
    arrives_too_early = following == "convoy" and late + spans[1] < spans[0]
    assert ("capacity" in found) == (begins_too_early or arrives_too_early)
    passing = header(floor.replace(".~~", "~~~"), [(0, 0), (1, 0)])
    assert "swap" not in rules(played(passing, *begun, changes=rows))


def test_each_lane_holds_one_robot() -> None:
    """A and B share a cell that has a lane for each way, but not one lane."""
    aisle = FLOOR.replace("......", ".==...")
    assert played(header(aisle, [(0, 0), (2, 1)]), {0: E}, {1: N}, {1: W}).valid
    two = header(aisle, [(0, 0), (0, 1)])
    assert rules(played(two, {0: E}, {1: N}, {1: E})) == ["capacity"]


def test_a_turning_robot_needs_both_lanes() -> None:
    aisle = FLOOR.replace("......", ".==...")
    head = header(aisle, [(0, 0), (1, 1)], kinematics="differential", durations={"turn": 3})
    enters = [{0: TURN_LEFT}, {}, {}, {0: E}]  # A comes from the west, B looks north
    assert played(head, *enters, {1: N}).valid  # north: the other lane
    assert rules(played(head, *enters, {1: N, 0: TURN_LEFT})) == ["capacity"]
    assert rules(played(head, *enters, {0: TURN_LEFT}, {1: N})) == ["capacity"]
    assert played(head, *enters, {0: TURN_LEFT}, {}, {1: N}).valid  # given back in its last tick


def test_any_number_of_robots_where_there_is_no_limit() -> None:
    square = FLOOR.replace("......", ".~....")
    assert played(header(square, [(0, 0), (2, 0), (1, 1)]), {0: E, 1: W, 2: N}).valid


def test_a_move_without_an_exit() -> None:
    assert rules(played(header(FLOOR, [(0, 0)]), {0: N})) == ["exits"]
    one_way = header(FLOOR.replace("......", ".>...."), [(1, 0)])
    assert rules(played(one_way, {0: W})) == ["exits"]


def test_a_move_across_the_heading() -> None:
    for picture, kinematics in ((FLOOR, "differential"), (RAILS, "rail")):
        head = header(picture, [(0, 0)], kinematics=kinematics)
        assert played(head, {0: S}).valid
        assert rules(played(head, {0: E})) == ["heading"]
    backwards = ({0: S}, {0: N})
    assert played(header(RAILS, [(0, 0)], kinematics="rail"), *backwards).valid
    differential = header(FLOOR, [(0, 0)], kinematics="differential")
    assert rules(played(differential, *backwards)) == ["heading"]  # only rail robots reverse


def test_a_turn_where_there_is_none() -> None:
    rail = header(RAILS, [(0, 0)], kinematics="rail")
    assert played(rail, {0: TURN_RIGHT}, {0: E}).valid
    assert rules(played(rail, {0: TURN_RIGHT}, {0: E}, {0: TURN_RIGHT})) == ["turn"]
    assert rules(played(rail, {0: TURN_LEFT})) == ["turn"]
    assert rules(played(header(FLOOR, [(0, 0)]), {0: TURN_RIGHT})) == ["turn"]


@pytest.mark.parametrize(
    ("durations", "acts"),
    [
        ({"move": 3}, (E, 0, E)),
        ({"turn": 3}, (TURN_RIGHT, 0, TURN_RIGHT)),
        ({}, (EXECUTED_WAIT, E, 0)),
    ],
)
def test_an_operation_that_begins_too_early(
    durations: dict[str, int], acts: tuple[int, ...]
) -> None:
    kinematics = "differential" if TURN_RIGHT in acts else "omni"
    head = header(FLOOR, [(0, 0)], kinematics=kinematics, durations=durations)
    wait = [(1, CHANGE_DURATION, 0, 2)] if EXECUTED_WAIT in acts else []
    assert rules(played(head, *({0: act} for act in acts), changes=wait)) == ["busy"]
    late = (acts[0], 0, 0, acts[2] or E)
    assert played(head, *({0: act} for act in late), changes=wait).valid


def test_a_long_move_holds_both_cells_until_it_arrives() -> None:
    world = {"following": "handover"}
    head = header(FLOOR, [(1, 0), (0, 0), (2, 1)], durations={"move": 3}, world=world)
    assert rules(played(head, {0: E}, {1: E})) == ["capacity"]  # into the cell left too early
    assert rules(played(head, {0: E}, {2: N})) == ["capacity"]  # into the cell entered
    assert played(head, {0: E}, {}, {1: E}).valid  # in the tick of the arrival


def test_without_following_a_cell_must_be_empty_when_the_tick_begins() -> None:
    head = header(FLOOR, [(0, 0), (1, 0)], world={"following": "none"})
    assert rules(played(head, {0: E, 1: E})) == ["following"]
    assert played(head, {1: E}, {0: E}).valid
    long = header(FLOOR, [(0, 0), (1, 0)], world={"following": "none"}, durations={"move": 2})
    assert rules(played(long, {1: E}, {0: E})) == ["following"]
    assert played(long, {1: E}, {}, {0: E}).valid


# Convoy: a robot begins to move into a cell whose holder is on its way out.


LONG = {"durations": {"move": 3}}
UNLIKE = [{"name": f"of-{ticks}", "durations": {"move": ticks}, "robots": 1} for ticks in (4, 2, 3)]


def unlike(*starts: tuple[int, int], **parts: Any) -> dict[str, Any]:
    """Robots whose moves take 4, 2, 3 and 1 ticks; with fewer starts only the first of them."""
    types = UNLIKE[: len(starts) - 1]
    last = (4, 2, 3, 1)[len(starts) - 1]
    types = [*types, {"name": f"of-{last}", "durations": {"move": last}, "robots": 1}]
    fleet = {"robots": len(starts), "kinematics": "omni", "start": list(starts), "types": types}
    return header(FLOOR, "", fleet=fleet, **parts)


def takes(tick: int, **ticks: int) -> list[tuple[int, int, int, int]]:
    """Rows that say how long moves of A, B, ... take that begin in a tick."""
    return [(tick, CHANGE_DURATION, "ABCD".index(name), value) for name, value in ticks.items()]


def test_a_file_moves_as_a_whole_in_moves_of_several_ticks() -> None:
    head = header(FLOOR, [(2, 0), (1, 0), (0, 0)], **LONG)
    file = {0: E, 1: E, 2: E}
    assert played(head, file, {}, {}, file).valid
    assert rules(played(head, file, {}, {1: E})) == ["busy"]


def test_who_follows_later_arrives_with_the_robot_ahead_or_later() -> None:
    """A takes 4 ticks, B 2: in A's ticks 2, 3 and 4 B still needs 3, 2 and 2."""
    head = unlike((1, 0), (0, 0))
    for late, ticks in ((1, 3), (2, 2), (3, 2)):
        begun = [{0: E}, *[{} for _ in range(late - 1)], {1: E}]
        rows = takes(late + 1, B=ticks) if ticks != 2 else []
        assert played(head, *begun, changes=rows).valid
        assert rules(played(head, *begun, changes=takes(late + 1, B=ticks + 1))) == ["move time"]


def test_a_move_that_is_too_short_is_named_and_where_it_arrives() -> None:
    head = unlike((1, 0), (0, 0))
    report = played(head, {0: E}, {1: E}, {}, {})
    assert rules(report) == ["move time", "capacity"]
    text = "must take 3: a move takes 2, and the robot ahead still takes 3"
    assert text in report.violations[0].text
    assert report.violations[1].tick == 3 and "has not yet left" in report.violations[1].text


def test_a_ring_of_unlike_speeds_takes_the_longest_of_them() -> None:
    head = unlike((0, 0), (1, 0), (1, 1), (0, 1))
    ring = {0: E, 1: S, 2: W, 3: N}
    rows = takes(1, B=4, C=4, D=4)
    again = {0: S, 1: W, 2: N, 3: E}
    assert played(head, ring, {}, {}, {}, again, changes=[*rows, *takes(5, B=4, C=4, D=4)]).valid
    assert rules(played(head, ring, changes=takes(1, B=4, C=3, D=4))) == ["move time"]


def test_nobody_follows_one_that_stands_and_no_two_follow_one() -> None:
    stands = header(FLOOR, [(1, 0), (0, 0)], **LONG)
    assert rules(played(stands, {1: E})) == ["capacity"]
    three = header(FLOOR, [(1, 0), (0, 0), (1, 1)], **LONG)
    assert played(three, {0: E}, {1: E}).valid
    assert rules(played(three, {0: E}, {1: E}, {2: N})) == ["capacity"]
    assert rules(played(three, {0: E}, {1: E, 2: N})) == ["capacity"]


def test_the_edge_of_a_long_move_is_barred_in_all_its_ticks() -> None:
    """A drives into a cell without limit, from which B could drive into A's cell, which is open."""
    head = header(FLOOR.replace("......", ".~...."), [(0, 0), (1, 0)], **LONG)
    for late in (1, 2):
        begun: list[dict[int, int]] = [{0: E}, {}, {}]
        begun[late] = {1: W}
        rows = takes(late + 1)
        assert rules(played(head, *begun, changes=rows)) == ["swap"]
    assert played(head, {0: E}, {}, {}, {1: W}).valid


def test_who_leaves_a_parking_bay_needs_a_home_cell_in_which_nobody_is() -> None:
    head = header(BAYS, "parking-bays", 2, **LONG)
    out = [{1: LEFT_PARKING_BAY | E}, {}, {}, {1: N}, {}, {}, {1: W}, {}, {}, {1: S}]
    leaves = {0: LEFT_PARKING_BAY | E}
    assert rules(played(head, *out, {}, leaves)) == ["bay"], "robot 1 is still on its way out"
    assert played(head, *out, {}, {}, leaves).valid


def test_nobody_follows_out_of_a_parking_bay_in_the_same_tick() -> None:
    head = header(BAYS, "parking-bays", 2, **LONG)
    out = [{1: LEFT_PARKING_BAY | E}, {}, {}, {1: N}, {}, {}]
    leaves = {0: LEFT_PARKING_BAY | S}
    assert rules(played(head, *out, leaves | {1: W})) == ["bay"]
    assert played(head, *out, leaves, {1: W}, changes=takes(8)).valid


def test_a_turn_in_an_aisle_for_two_needs_a_lane_in_which_nobody_is() -> None:
    """A comes from the west into the aisle through which B drives north."""
    parts: Any = {"kinematics": "differential", "durations": {"move": 3, "turn": 1}}
    head = header("......\n.=...d\n....s.", [(0, 1), (1, 2)], **parts)
    both = [{0: TURN_LEFT, 1: N}, {0: E}, {}, {1: N}]  # A is there from tick 5 on, B up to tick 6
    assert rules(played(head, *both, {0: TURN_LEFT})) == ["capacity"]
    assert rules(played(head, *both, {}, {0: TURN_LEFT})) == ["capacity"]
    assert played(head, *both, {}, {}, {0: TURN_LEFT}).valid


def test_moves_under_way_keep_their_length_when_the_rule_changes() -> None:
    head = header(FLOOR, [(1, 0), (0, 0), (1, 1)], **LONG)
    for rule, late, broken in (
        ("handover", 1, ["capacity"]),
        ("handover", 2, []),
        ("none", 2, ["following"]),
        ("none", 3, []),
    ):
        assert rules(changed(head, [{0: E}], rule, [{}] * (late - 1) + [{1: E}])) == broken
    both = changed(head, [{0: E}, {1: E}], "handover", [{2: N}])
    assert rules(both) == ["capacity"], "A gives its cell up, and B is on its way into it"
    held = header(FLOOR, [(1, 0), (0, 0)], **LONG, world={"following": "handover"})
    assert changed(held, [{0: E}], "convoy", [{1: E}]).valid


def changed(
    head: dict[str, Any], before: list[dict[int, int]], following: str, after: list[dict[int, int]]
) -> Report:
    """Validate a recording in which the rule of following changes between two of its ticks."""
    scenario = {**head["scenario"], "world": {**head["scenario"]["world"], "following": following}}
    frames, first = [], 1
    for ticks in (before, after):
        did = np.zeros((len(ticks), len(head["robots"]["home"])), np.uint16)
        for row, acts in enumerate(ticks):
            for robot, code in acts.items():
                did[row, robot] = code
        rows = np.zeros((0, 4), np.int64)
        content = {"first": first, "executed": did, "changes": rows, "digests": None}
        frames.append(DecodedFrame(FRAME_KIND_TICKS, content))
        first += len(ticks)
    change = DecodedFrame(FRAME_KIND_CONDITIONS, {"tick": len(before), "scenario": scenario})
    return validate_recording(head, [frames[0], change, frames[1]])


def delayed(of: tuple[int, int], *starts: tuple[int, int], **parts: Any) -> dict[str, Any]:
    """A run in which this robot begins a delay of 2 ticks in this tick, and no other one in 12."""
    tick, robot = of
    faults = {"delays": {"probability": 0.02, "ticks": {"from": 2, "to": 2}}}
    head = header(FLOOR, list(starts), faults=faults, **parts)
    draws = list(product(range(1, 13), range(len(starts))))
    for seed in range(100_000):
        begun = [at for at in draws if random_bits(seed, BEGIN, *at) >> 32 < 0.02 * 2**32]
        if begun == [(tick, robot)]:
            return head | {"seed": seed}
    raise AssertionError("no such seed")


def test_a_delay_is_handed_on_down_the_file() -> None:
    """A, B and C drive for 3 ticks, one behind the other; A is delayed by 2 in the second."""
    head = delayed((2, 0), (2, 0), (1, 0), (0, 0), **LONG)
    file, begins = {0: E, 1: E, 2: E}, [(2, CHANGE_DELAYED, 0, 2)]
    assert played(head, file, *[{}] * 4, file, changes=begins).valid
    for early in range(2, 6):
        ticks = [file, *[{}] * (early - 2), {2: E}, *[{}] * 6]
        assert rules(played(head, *ticks, changes=begins))[0] == "busy"
    behind = delayed((2, 2), (2, 0), (1, 0), (0, 0), **LONG)
    begins = [(2, CHANGE_DELAYED, 2, 2)]
    ahead = {0: E, 1: E}
    assert played(behind, file, {}, {}, ahead, changes=begins).valid, "not to those ahead"


# Bays: A's home is (0, 0), B's is (0, 1).


def test_robots_leave_and_enter_their_bays() -> None:
    head = header(BAYS, "parking-bays", 2)
    report = played(
        head, {0: LEFT_PARKING_BAY | E}, {0: W | ENTERED_PARKING_BAY}, {0: LEFT_PARKING_BAY | S}
    )
    assert report.valid and report.counts["left_bay"] == 2


def test_bays_are_left_only_onto_an_empty_home_cell() -> None:
    head = header(BAYS, "parking-bays", 2)
    report = played(head, {0: LEFT_PARKING_BAY | S}, {1: LEFT_PARKING_BAY | E, 0: N})
    assert rules(report) == ["bay"]


def test_nobody_follows_a_robot_that_came_out_of_its_bay() -> None:
    head = header(BAYS, "parking-bays", 2)
    assert rules(
        played(head, {1: LEFT_PARKING_BAY | E}, {1: N}, {1: W, 0: LEFT_PARKING_BAY | S})
    ) == ["bay"]
    assert played(head, {1: LEFT_PARKING_BAY | E}, {1: N}, {0: LEFT_PARKING_BAY | S}, {1: W}).valid


def test_a_robot_in_its_bay_does_nothing() -> None:
    head = header(BAYS, "parking-bays", 2)
    assert rules(played(head, {0: E})) == ["bay"]
    assert played(head, {0: EXECUTED_BAY_BLOCKED}).valid
    assert rules(played(head, {0: LEFT_PARKING_BAY | E}, {0: EXECUTED_BAY_BLOCKED})) == ["bay"]
    assert rules(played(head, {0: LEFT_PARKING_BAY | E}, {0: LEFT_PARKING_BAY | E}))[0] == "bay"


def test_a_robot_parks_at_its_own_home_only() -> None:
    head = header(BAYS, "parking-bays", 2)
    assert rules(played(head, {0: LEFT_PARKING_BAY | S | ENTERED_PARKING_BAY})) == ["bay"]
    early = header(BAYS, "parking-bays", 2, durations={"move": 2})
    assert rules(played(early, {0: LEFT_PARKING_BAY | E}, {}, {0: W | ENTERED_PARKING_BAY})) == [
        "bay"
    ]
    assert played(early, {0: LEFT_PARKING_BAY | E}, {}, {0: W}, {0: ENTERED_PARKING_BAY}).valid


def test_a_robot_with_an_order_does_not_park() -> None:
    head = header(BAYS, "parking-bays", 2)
    given = [(1, CHANGE_ORDER_RESERVED, 0, 0)]
    assert rules(
        played(head, {0: LEFT_PARKING_BAY | E}, {0: W | ENTERED_PARKING_BAY}, changes=given)
    ) == ["bay"]


def test_a_bay_holds_one_robot() -> None:
    head = copy.deepcopy(header(BAYS, "parking-bays", 2))
    for name in ("bay", "home"):
        head["robots"][name][1] = head["robots"][name][0]
    assert rules(played(head, {})) == ["bay"]
    head = copy.deepcopy(header(BAYS, "parking-bays", 2))
    head["robots"]["home"][1] += 1
    assert rules(played(head, {})) == ["bay"]


def test_robots_start_in_different_drivable_cells() -> None:
    head = copy.deepcopy(header(FLOOR, [(0, 0), (1, 0)]))
    head["robots"]["cell"][1] = head["robots"]["cell"][0]
    assert rules(played(head, {})) == ["capacity"]


# The recording agrees with itself.


STATES = [
    *("robots.cell", "robots.claim", "robots.heading", "robots.busy", "robots.load"),
    *("robots.order", "robots.parked", "orders.state", "orders.current_slot", "orders.reserved_by"),
    *("slots.content", "slots.reserved_by"),
]


@pytest.mark.parametrize("name", STATES)
def test_a_recorded_state_that_differs_from_the_replay(name: str) -> None:
    recording = recorded("tabletop-mini", "stop.max_duration=300")
    frames = copy.deepcopy(list(recording.frames))
    part, field = name.split(".")
    state = [content for kind, content in frames if kind == FRAME_KIND_KEYFRAME][-1]
    state[part][field][1] += 1
    report = validate_recording(recording.header, frames)
    assert rules(report) == ["record"]
    assert name in report.violations[0].text and report.violations[0].tick == 300


def test_an_end_that_is_not_true() -> None:
    recording = recorded("tabletop-mini")
    for change in ({"ticks": 5}, {"finished": False}):
        frames = [
            DecodedFrame(kind, {**content, **change})
            if kind == FRAME_KIND_END
            else DecodedFrame(kind, content)
            for kind, content in recording.frames
        ]
        assert rules(validate_recording(recording.header, frames)) == ["record"]


@pytest.mark.parametrize(
    ("act", "true"), [(EXECUTED_ILLEGAL, {False, True}), (EXECUTED_BLOCKED, {False})]
)
def test_a_tick_lost_to_an_illegal_answer_does_not_tell_whether_a_robot_is_parked(
    act: int, true: set[bool]
) -> None:
    """Robot 0 delivers the order and leaves the floor; robot 1 rests, or is about to leave."""
    orders = {"list": [{"from": [1, 2], "to": [5, 2]}]}
    fleet = {"robots": 2, "kinematics": "omni", "start": [(1, 1), (0, 0)], "when_idle": "leave"}
    head = header(FLOOR, "", orders=orders, fleet=fleet)
    way = [
        {0: EXECUTED_PICK},
        {0: E},
        {0: E},
        {0: E},
        {0: S},
        {0: EXECUTED_DROP},
        {0: ENTERED_PARKING_BAY, 1: act},
    ]
    picked = [(1, CHANGE_ORDER_RESERVED, 0, 0), (1, CHANGE_PICKED, 0, 0)]
    changes = [*picked, (6, CHANGE_DROPPED, 0, 3), (6, CHANGE_ORDER_RESERVED, 0, -1)]
    for finished in (False, True):
        report = played(head, *way, changes=changes, finished=finished)
        assert rules(report) == ([] if finished in true else ["record"])


def test_missing_ticks_and_changes_out_of_order() -> None:
    recording = recorded("tabletop-mini")
    frames = list(recording.frames)
    second = [i for i, frame in enumerate(frames) if frame.kind == FRAME_KIND_TICKS][1]
    report = validate_recording(recording.header, frames[:second] + frames[second + 1 :])
    assert rules(report) == ["record"]
    head = header(FLOOR, [(0, 0)])
    assert rules(played(head, {}, changes=[(2, CHANGE_ORDER_RESERVED, 0, 0)])) == ["record"]


@pytest.mark.parametrize("seed", range(8))
def test_a_move_altered_anywhere_in_a_run_is_noticed(seed: int) -> None:
    recording = recorded("tabletop-1", f"fleet.robots={1 + seed % 5}", seed=seed)
    frames = copy.deepcopy(list(recording.frames))
    ticks = [content for kind, content in frames if kind == FRAME_KIND_TICKS]
    rng = np.random.default_rng(seed)
    content = ticks[rng.integers(len(ticks))]
    moves = np.argwhere((content["executed"] >= MOVE_EAST) & (content["executed"] <= MOVE_NORTH))
    row, robot = moves[rng.integers(len(moves))]
    content["executed"][row, robot] = 0
    report = validate_recording(recording.header, frames)
    assert not report.valid
    assert report.violations[0].tick >= content["first"] + row
    assert len(report.violations) <= MAX_VIOLATIONS


def test_the_validator_shares_no_code_with_the_kernels() -> None:
    code = "import sys, automaton.verification.validator; print(*sys.modules)"
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    loaded = answer.stdout.split()
    foreign = ("numba", "automaton.engine", "automaton.runs.simulation", "automaton.world.building")
    shared = {"automaton.engine", "automaton.engine.record_codes"}  # numbers, no code
    # Which arrays a recording keeps follows from the declarations of the state: fields, no rules.
    shared |= {
        f"automaton.engine.{name}"
        for name in (
            *("delays", "distance_tables", "facilities", "gates", "pods"),
            *("refusals", "service_zones", "state", "stops"),
        )
    }
    shared |= {f"automaton.engine.jit{name}" for name in ("", ".named_numbers", ".structs")}
    assert not [name for name in loaded if name.startswith(foreign) and name not in shared]
