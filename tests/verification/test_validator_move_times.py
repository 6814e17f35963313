"""The validator on the length of moves: it counts the robots of a zone itself."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from handmade_recordings import E, N, W, header, played, recorded, rules
from hypothesis import given, settings
from hypothesis import strategies as st
from random_floors import pictures

from automaton.engine.random_numbers import STREAM_EXTRA_TICKS, random_bits
from automaton.engine.record_codes import CHANGE_DURATION, LEFT_PARKING_BAY
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.traffic_zones import ZONE_MODES, traffic_zones_of
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.frames import Recording
from automaton.verification.move_time_rules import MoveTimes, Types, zones_by_cell
from automaton.verification.validator import validate_stored

# (1, 1) is the only intersection; there is a slot, since orders need one.
CORNER = """\
#.####d
.......
#s#####"""
SLOW = {"slowdown": "zones"}


def slow(*starts: tuple[int, int], **more: Any) -> dict[str, Any]:
    return header(CORNER, list(starts), world={**SLOW, **more})


def lengths(*rows: tuple[int, int, int]) -> list[tuple[int, int, int, int]]:
    """Rows of changes from (tick, robot, ticks)."""
    return [(tick, CHANGE_DURATION, robot, ticks) for tick, robot, ticks in rows]


def test_a_robot_alone() -> None:
    assert played(slow((2, 1)), {0: E}, {0: E}).valid
    report = played(slow((2, 1)), {0: E}, changes=lengths((1, 0, 2)))
    assert rules(report) == ["move time"]
    assert str(report.violations[0]) == (
        "tick 1: move time: robot 0 at (2, 1): its move is recorded with 2 ticks but must take 1: "
        "zone 2 holds 1 robot when it starts"
    )


def test_two_robots_and_a_third_that_comes_later() -> None:
    head = slow((3, 1), (5, 1), (1, 1))
    both = {0: E, 1: E, 2: E}
    told = lengths((1, 0, 2), (1, 1, 2), (2, 2, 3))
    assert played(head, both, {2: E}, {}, {}, changes=told).valid
    assert rules(played(head, both, {2: E}, changes=told[:2])) == ["move time"]
    assert rules(played(head, both, {2: E}, changes=[*told[:2], *lengths((2, 2, 2))])) == [
        "move time"
    ]
    assert rules(played(head, both, changes=lengths((1, 0, 2), (1, 1, 2), (1, 2, 3)))) == [
        "move time"
    ]


def test_who_leaves_counts_until_it_arrives() -> None:
    """A drives onto the intersection, B starts one tick later."""
    head = slow((2, 1), (4, 1))
    two = lengths((1, 0, 2), (2, 1, 2))
    assert played(head, {0: W}, {1: E}, changes=two).valid
    assert rules(played(head, {0: W}, {1: E}, changes=two[:1])) == ["move time"]
    assert played(head, {0: W}, {}, {1: E}, changes=two[:1]).valid


def test_intersections_are_free_or_zones() -> None:
    start = [(1, 1), (2, 1), (3, 1)]
    assert played(slow(*start), {0: W}).valid
    assert played(slow(*start, traffic_zones="with-intersections"), {0: N}).valid


def test_lanes() -> None:
    head = slow((2, 1), (5, 1), traffic_zones="directed")
    assert played(head, {1: W}).valid, "both look east"
    assert rules(played(slow((2, 1), (5, 1)), {1: W})) == ["move time"]
    assert rules(played(head, {1: E})) == ["move time"]
    assert played(head, {1: E}, changes=lengths((1, 1, 2))).valid


def test_a_robot_out_of_its_bay_is_in_no_zone_yet_but_counts_itself() -> None:
    floor = "b....\n#s##d"
    head = header(floor, "parking-bays", 1, world=SLOW)
    assert played(head, {0: LEFT_PARKING_BAY | E}).valid
    assert rules(played(head, {0: LEFT_PARKING_BAY | E}, changes=lengths((1, 0, 2)))) == [
        "move time"
    ]


def test_without_slow_zones_every_move_takes_its_duration() -> None:
    head = header(CORNER, [(2, 1)], durations={"move": 2})
    assert played(head, {0: E}, {}, {0: E}).valid
    assert rules(played(head, {0: E}, changes=lengths((1, 0, 3)))) == ["move time"]
    assert rules(played(head, {0: E}, {0: E}, changes=lengths((1, 0, 1)))) == ["move time"]


def test_an_extra_tick_must_be_the_one_that_was_drawn() -> None:
    head = header(CORNER, [(2, 1)], world={"extra_tick_probability": 0.5})
    pace = MoveTimes(head["floor"], head["seed"], Types(head["floor"], head["scenario"]))
    late = [tick for tick in range(1, 40) if pace.draw(tick, 0) < 2**31]
    assert 5 < len(late) < 35
    for tick in (late[0], next(tick for tick in range(1, 40) if tick not in late)):
        before: list[dict[int, int]] = [{}] * (tick - 1)
        verdicts = [
            rules(played(head, *before, {0: E}, changes=lengths((tick, 0, ticks))))
            for ticks in (1, 2, 3)
        ]
        assert verdicts == [
            [["move time"], []][tick not in late],
            [["move time"], []][tick in late],
            ["move time"],
        ]


@given(st.integers(0, 2**63 - 1), st.integers(0, 2**40), st.integers(0, 10**6))
def test_its_draws_are_those_of_the_world(seed: int, tick: int, robot: int) -> None:
    head = header(CORNER, [(2, 1)])
    mine = MoveTimes({}, seed, Types(head["floor"], head["scenario"])).draw(tick, robot)
    with np.errstate(over="ignore"):
        assert mine == int(random_bits(np.uint64(seed), STREAM_EXTRA_TICKS, tick, robot)) >> 32


@settings(max_examples=60)
@given(st.data())
def test_its_zones_are_those_of_the_world(data: st.DataObject) -> None:
    width = data.draw(st.integers(1, 8))
    drawn = pictures("......##+-|><v^~=s", width, data.draw(st.integers(1, 6)))
    floor_plan = draw_floor(data.draw(drawn.filter(lambda text: set(text) - set("#s\n"))))
    floor = {"width": floor_plan.width, "exits": floor_plan.exits, "kind": floor_plan.kind}
    for mode in ZONE_MODES:
        assert [list(pair) for pair in zones_by_cell(floor, mode)] == traffic_zones_of(
            floor_plan, mode
        ).of.tolist()


@pytest.fixture(scope="module")
def good() -> Recording:
    return recorded(
        *(
            "crossing",
            "world.slowdown=zones",
            "world.extra_tick_probability=0.2",
            "stop.max_duration=120",
        ),
    )


def test_a_run_in_slow_zones(good: Recording) -> None:
    assert validate_stored(good).valid


def test_a_tampered_length_is_named(good: Recording) -> None:
    frames = copy.deepcopy(good.frames)
    ticks = next(frame.content for frame in frames if frame.kind == FRAME_KIND_TICKS)
    moves = np.flatnonzero(ticks["changes"][:, 1] == CHANGE_DURATION)
    tick, _, robot, length = ticks["changes"][moves[3]].tolist()
    ticks["changes"][moves[3], 3] += 1
    first = validate_stored(Recording(good.header, frames, complete=True)).violations[0]
    assert (first.tick, first.rule, first.robots) == (tick, "move time", (robot,))
    assert f"is recorded with {length + 1} ticks but must take {length}: zone" in first.text
    assert "when it starts and a random delay adds" in first.text


def test_a_scenario_that_claims_to_be_quick(good: Recording) -> None:
    head = copy.deepcopy(good.header)
    head["scenario"]["world"]["slowdown"] = "none"
    violations = validate_stored(Recording(head, good.frames[1:], complete=True)).violations
    assert {violation.rule for violation in violations} >= {"move time"}
