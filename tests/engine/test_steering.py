"""A right of way that steers: what it may ask of robots, and what becomes of it."""

from __future__ import annotations

from typing import Any

import pytest
from small_runs import STEPS, SmallRun

from automaton.engine.state import LAYER_ALLOCATION, LAYER_RIGHT_OF_WAY
from automaton.runs.simulation import Simulation
from automaton.strategy.api import (
    ACTION_HELD_BACK,
    CMD_GO,
    CMD_HOLD,
    CMD_STEP,
    CMD_TURN,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    NIL,
    Strategy,
)
from automaton.world.resolve import resolve


class Scripted(Strategy):
    """By robot, a letter for each tick: E S W N go there, h holds, e s w n hold, and would like to go,
    L and R turn."""

    layer = "right_of_way"
    steers = True
    period = 1

    def __init__(self, **scripts: str) -> None:
        super().__init__()
        self.scripts = scripts

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        out = decisions.right_of_way
        for k in range(batch.count):
            name = chr(ord("A") + int(view.robots.identity[batch.robot[k]]))
            script = self.scripts.get(name, "")[int(view.clock.tick) - 1 :]
            if not script or script[0] == ".":
                continue
            letter = script[0]
            if letter in "LR":
                out.command[k], out.value[k] = CMD_TURN, 1 if letter == "R" else 3
                continue
            out.command[k] = CMD_GO if letter.isupper() else CMD_HOLD
            out.value[k] = NIL if letter == "h" else STEPS.index(letter.upper())


class Unasked(Strategy):
    """Routing that must not be asked."""

    layer = "routing"
    period = 1

    def decide(self, *arguments: Any) -> None:
        raise AssertionError("where right of way steers, nobody follows routes")


class Counting(Strategy):
    """Allocation that has nothing for anybody, and counts how often it is asked."""

    layer = "allocation"
    asked = 0

    def decide(self, *arguments: Any) -> None:
        self.asked += 1


def test_robots_turn_and_move_as_they_are_told_and_nobody_asks_for_routes():
    run = SmallRun(
        "A..\n...",
        kinematics="differential",
        strategies={"right_of_way": Scripted(A="SEEE"), "routing": Unasked()},
    )
    run.world.robots.goal_type[0], run.world.robots.goal_cell[0] = (
        GOAL_PARK,
        run.floor_plan.cell(2, 1),
    )
    assert int(run.world.robots.heading[0]) == 1, "it looks south"
    run.tick(4)
    assert run.snapshot().tick == 4
    assert run.floor_plan.xy(int(run.world.robots.cell[0])) == (2, 1)


def test_a_robot_turns_towards_a_wall_where_it_may_not_go():
    run = SmallRun(
        "A.", kinematics="differential", strategies={"right_of_way": Scripted(A="LLRNE")}
    )
    headings = []
    for _ in range(5):
        run.tick()
        headings.append(int(run.world.robots.heading[0]))
    assert headings == [3, 2, 3, 3, 0], "east, then left, left, right; no move north; east again"
    assert int(run.world.tally.illegal[LAYER_RIGHT_OF_WAY]) == 1, "the move into the wall"


def test_a_tick_in_which_a_robot_is_held_back_is_counted_and_explained():
    run = SmallRun("A.B", strategies={"right_of_way": Scripted(A="heEe", B="....")})
    run.tick(1)
    assert run.why("A") == ("held back", "", None)
    run.tick(1)
    assert run.why("A") == ("held back", "", (1, 0))
    run.tick(2)
    assert run.why("A") == ("idle ahead", "B", (2, 0))
    assert run.world.tally.ticks[run.index("A"), ACTION_HELD_BACK].sum() == 3


def test_a_robot_that_is_parked_on_the_floor_and_has_work_is_held_back_like_any_other():
    run = SmallRun("A.B", strategies={"right_of_way": Scripted(A="heE")})
    robots = run.world.robots
    robots.parked[:] = 1
    run.world.clock.unparked = 0
    robots.goal_type[0], robots.goal_cell[0] = GOAL_PICK, run.floor_plan.cell(1, 0)
    run.tick(1)
    assert run.why("A") == ("held back", "", None)
    run.tick(1)
    assert run.world.tally.ticks[run.index("A"), ACTION_HELD_BACK].sum() == 2
    assert run.world.clock.unparked == 1


def test_a_robot_that_was_pushed_from_its_place_goes_home_and_allocation_is_not_asked_about_it():
    allocation = Counting()
    run = SmallRun(
        "A..", strategies={"right_of_way": Scripted(A=".EEWW."), "allocation": allocation}
    )
    robots = run.world.robots
    robots.parked[:] = 1
    run.world.clock.unparked = 0
    run.tick(1)
    asked = allocation.asked
    run.tick(2)
    assert (int(robots.goal_type[0]), int(robots.goal_cell[0])) == (GOAL_PARK, int(robots.home[0]))
    run.tick(2)
    assert robots.parked[0] and robots.goal_type[0] == GOAL_NONE
    assert allocation.asked == asked


def test_a_robot_leaves_its_parking_bay_when_it_is_told_to():
    run = SmallRun("b..", strategies={"right_of_way": Scripted(A="..hEE")})
    robots = run.world.robots
    robots.goal_type[0], robots.goal_cell[0] = GOAL_PICK, run.floor_plan.cell(2, 0)
    run.tick(3)
    assert robots.cell[0] == NIL and run.cause("A") == "following conflict"
    run.tick(1)
    assert robots.cell[0] == robots.home[0]
    run.tick(1)
    assert run.floor_plan.xy(int(robots.cell[0])) == (1, 0)


@pytest.mark.parametrize("answer", [(CMD_GO, 4), (CMD_GO, 3), (CMD_HOLD, 4), (CMD_STEP, 0)])
def test_what_it_may_not_ask_costs_a_tick(answer):
    class Wrong(Scripted):
        def decide(self, view, batch, decisions, memory, workspace):
            decisions.right_of_way.command[0], decisions.right_of_way.value[0] = answer

    run = SmallRun("A..", strategies={"right_of_way": Wrong()})
    run.tick(2)
    assert run.world.tally.illegal[LAYER_RIGHT_OF_WAY] == 2
    assert run.floor_plan.xy(int(run.world.robots.cell[0])) == (0, 0)


@pytest.mark.parametrize("command", [CMD_GO, CMD_HOLD])
def test_who_does_not_steer_may_neither_hold_nor_go(command):
    class Lost(Scripted):
        steers = False

        def decide(self, view, batch, decisions, memory, workspace):
            decisions.right_of_way.command[0] = command

    run = SmallRun("A..", strategies={"right_of_way": Lost()})
    run.tick(2)
    assert run.world.tally.illegal[LAYER_RIGHT_OF_WAY] == 2


def test_a_run_goes_on_when_right_of_way_begins_and_ends_to_steer():
    steady, steered = (
        resolve("crossing", [f"strategy.right_of_way={name}", "stop.max_duration=3000"])
        for name in ("retreat", "pibt")
    )
    run = Simulation(steady)
    delivered = []
    for scenario in (steady, steered, steady):
        run = run.continue_with(scenario)
        run.run(until=run.tick + 15)
        delivered.append(int((run.world.orders.delivered != NIL).sum()))
    assert delivered == sorted(set(delivered)) and delivered[0] < delivered[-1]
    assert run.world.tally.illegal.sum() == 0 and run.world.tally.batches[LAYER_ALLOCATION] > 0
