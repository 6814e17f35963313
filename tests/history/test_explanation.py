"""Why is this robot waiting: the chain of causes in words, to the robot or the wait cycle at its end."""

from __future__ import annotations

import re

import pytest
from small_runs import SmallRun

from automaton.engine.observation import CAUSE_HEAD_ON, CAUSE_NOT_WAITING, CAUSES
from automaton.engine.state import ACTION_MOVE, ACTION_NAMES, NIL
from automaton.history.explanation import doing, explain
from automaton.scenario.fleet import Fault, Faults, FleetType
from automaton.scenario.schema import Durations, WorldRules


def why(floor: SmallRun, name: str) -> list[str]:
    return explain(floor.snapshot(), floor.floor_plan, ord(name) - ord("A")).lines


def test_a_chain_ends_with_the_robot_that_keeps_all() -> None:
    floor = SmallRun("ABC.", {"A": "E", "B": "E"}, waits=(99, 99, 99, 99, 255)).tick(3)
    assert why(floor, "A") == [
        "robot 0 has been waiting for 3 ticks: robot 1 holds (1, 0) and is waiting itself",
        "robot 1 has been waiting for 3 ticks: robot 2 holds (2, 0) and is idle",
        "robot 2 has been idle for 3 ticks: robot 2 has no order",
    ]
    chain = explain(floor.snapshot(), floor.floor_plan, 0).chain
    assert [link.robot for link in chain] == [0, 1, 2]
    assert chain[0].cell == (1, 0) and chain[0].blocker == 1 and chain[0].cause == "queue"
    assert (
        "capacity" in chain[0].rule and chain[2].rule == "allocation assigned no order to the robot"
    )


def test_a_chain_ends_with_a_robot_at_work() -> None:
    rules = WorldRules(following="handover")
    floor = SmallRun("AB..", {"A": "E", "B": "EE"}, durations=Durations(move=4), rules=rules).tick()
    assert why(floor, "A") == [
        "robot 0 has been waiting for 1 tick: robot 1 holds (1, 0) and is driving on",
        "robot 1 is driving for 3 more ticks",
    ]


def test_a_robot_that_follows_a_slower_one_drives_on_behind_it() -> None:
    types = (
        FleetType(name="quick", robots=1),
        FleetType(name="slow", robots=1, move_time_factor=4),
    )
    floor = SmallRun("AB..", {"A": "E", "B": "EE"}, types=types).tick()
    assert why(floor, "A") == [
        "robot 0 has been waiting for 1 tick: it drives on behind robot 1, which is still leaving (1, 0)",
        "robot 1 is driving for 3 more ticks",
    ]


def test_a_circle_is_told_from_where_it_begins() -> None:
    floor = SmallRun("CAB", {"A": "E", "B": "W", "C": "E"}).tick()
    found = explain(floor.snapshot(), floor.floor_plan, 2)
    assert [link.robot for link in found.chain] == [2, 0, 1] and found.cycle == 1
    assert (
        found.lines[-1]
        == "a wait cycle: robot 0 -> robot 1 -> robot 0; none moves until one makes way"
    )
    assert explain(floor.snapshot(), floor.floor_plan, 0).cycle == 0


def test_a_cell_that_nobody_holds_any_more() -> None:
    floor = SmallRun("AB.", {"A": "E", "B": "E"}, following="none").tick()
    assert why(floor, "A") == [
        "robot 0 has been waiting for 1 tick: the robot ahead left (1, 0) only at the end of this tick"
    ]


def test_who_does_not_wait_says_what_it_does() -> None:
    floor = SmallRun("A..", {"A": "EE"}).tick()
    found = explain(floor.snapshot(), floor.floor_plan, 0)
    assert len(found.chain) == 1 and found.cycle == NIL and found.chain[0].cause == ""
    floor.world.robots.parked[0] = 1
    assert doing(floor.snapshot(), 0) == "is parked"


def test_who_drives_through_a_slow_zone_says_with_how_many() -> None:
    """B stands on an intersection, where nothing slows it."""
    rules = WorldRules(slowdown="zones")
    floor = SmallRun("##.###\nA.B.C.", {"A": "EE", "B": "E", "C": "E"}, rules=rules).tick()
    assert why(floor, "C") == ["robot 2 is driving"]
    floor = SmallRun("##.####\nB.A.C.D", {"C": "E", "A": "E"}, rules=rules).tick()
    assert why(floor, "C") == [
        "robot 2 is driving slowly for 1 more tick: zone 2 held 2 robots when this move began"
    ]
    assert why(floor, "A") == ["robot 0 is driving"]
    assert why(floor.tick(), "C") == ["robot 2 is driving"], "it has arrived"


@pytest.mark.parametrize("action", range(len(ACTION_NAMES)))
def test_every_action_has_words(action: int) -> None:
    floor = SmallRun("A..").tick()
    floor.world.robots.action[0], floor.world.robots.busy[0] = action, 2
    floor.run.observation.cause[0] = CAUSE_NOT_WAITING
    text = doing(floor.snapshot(), 0)
    assert text and text != ACTION_NAMES[action]
    assert action != ACTION_MOVE or text == "is driving for 2 more ticks"


@pytest.mark.parametrize("code", range(1, len(CAUSES)))
def test_every_cause_makes_a_sentence(code: int) -> None:
    floor = SmallRun("AB", {"A": "E", "B": "W"}).tick()
    assert floor.run.observation.cause[0] == CAUSE_HEAD_ON
    floor.run.observation.cause[0] = code
    text = explain(floor.snapshot(), floor.floor_plan, 0).chain[0].text
    assert re.match("robot 0 has been [a-z ]+ for 1 tick: ", text) and "{" not in text
    assert ("robot 1" in text) == ("{blocker}" in CAUSES[code].text)
    assert ("(1, 0)" in text) == ("{cell}" in CAUSES[code].text)


def test_a_wait_cycle_is_named_before_the_breakdown_that_keeps_it_closed() -> None:
    """A and B meet head-on, C queues behind A; then B breaks down."""
    faults = Faults(listed=(Fault(robot=1, at=6),), tow_after=None)
    floor = SmallRun("CAB", {"A": "E", "B": "W", "C": "E"}, waits=(1, 1, 1, 1, 255), faults=faults)
    floor.tick(4)
    assert explain(floor.snapshot(), floor.floor_plan, 2).down == ()
    floor.tick(600)
    assert floor.cause("B") == "broken down"
    found = explain(floor.snapshot(), floor.floor_plan, 2)
    assert ([link.robot for link in found.chain], found.cycle, found.down) == ([2, 0, 1], 1, (1,))
    lines = found.lines
    assert lines[0] == (
        "a wait cycle: robot 0 -> robot 1 -> robot 0; none moves until one makes way; robot 1 went down "
        "later, which keeps the cycle closed"
    )
    down = f"robot 1 has been down for {floor.run.tick - 5} ticks: "  # it waited before that
    assert lines[-1].startswith(down) and lines[-1].endswith(
        "robot 1 has broken down; it is not towed; before, it waited for robot 0"
    )


def test_a_breakdown_on_the_way_out_of_a_wait_cycle_is_named_after_it() -> None:
    """A and B meet head-on; C, broken down, stands where B could go; D is down, but out of the way."""
    faults = Faults(listed=(Fault(robot=2, at=1), Fault(robot=3, at=1)), tow_after=None)
    moves = {"A": "E", "B": "W"}
    floor = SmallRun("AB#\n#CD", moves, waits=(1, 1, 1, 1, 255), faults=faults).tick(4)
    lines = explain(floor.snapshot(), floor.floor_plan, 0).lines
    assert lines[-2].startswith("a wait cycle: robot 0 -> robot 1 -> robot 0")
    assert lines[-1] == (
        "robot 2 has broken down; it is not towed; at (1, 1) it blocks a way out of the wait cycle"
    )


def test_a_breakdown_alone_is_no_wait_cycle() -> None:
    """B waits for nobody when it breaks down; A queues behind it."""
    faults = Faults(listed=(Fault(robot=1, at=2),), tow_after=None)
    floor = SmallRun("AB....", {"A": "EEE", "B": "EEE"}, faults=faults).tick(30)
    found = explain(floor.snapshot(), floor.floor_plan, 0)
    assert (found.cycle, found.down) == (NIL, ())
    assert found.lines[-1].endswith("robot 1 has broken down; it is not towed")


def test_a_cycle_that_has_opened_again_is_not_named() -> None:
    """A waits for B, which drives on after A has broken down."""
    faults = Faults(listed=(Fault(robot=0, at=3),), tow_after=None)
    floor = SmallRun("AB....", {"A": "E"}, faults=faults).tick(5)
    assert floor.cause("A") == "broken down"
    before = floor.snapshot().robots
    assert (before.blocker_before[0], before.cell[1]) == (1, before.wanted_before[0])
    assert explain(floor.snapshot(), floor.floor_plan, 0).cycle == NIL
