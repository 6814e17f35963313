"""Routing asked every k ticks: who is asked, where a new route begins, and that KEEP changes nothing."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_runs import STEPS, SmallRun

from automaton.engine.state import LAYER_ROUTING
from automaton.history.snapshot import take_snapshot
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Durations
from automaton.strategy import paths
from automaton.strategy.api import (
    ACTION_MOVE,
    ACTION_TURN,
    ACTION_WAIT,
    NIL,
    REASON_PERIODIC,
    Strategy,
)
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve


class Question(NamedTuple):
    """One robot of a batch."""

    tick: int
    robot: str
    reason: int
    cell: tuple[int, int]  # where a new route would begin


class Told(Strategy):
    """Keeps what it is asked; answers what a test has told it for a tick and robot."""

    layer = "routing"

    def __init__(self, every: int, **answers: str) -> None:
        super().__init__()
        self.period = every
        self.answers = answers  # by robot and tick, such as A4="SEEN"
        self.questions: list[Question] = []

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        width = view.grid.width
        for k in range(batch.count):
            i, tick = int(batch.robot[k]), int(view.clock.tick)
            name = chr(ord("A") + int(view.robots.identity[i]))
            y, x = divmod(paths.position(view, i), width)
            self.questions.append(Question(tick, name, int(batch.reason[k]), (x - 1, y - 1)))
            route = self.answers.get(f"{name}{tick}")
            if route is not None:
                decisions.routing.route_length[k] = len(route)
                decisions.routing.steps[k, : len(route)] = [STEPS.index(step) for step in route]


def place(floor: SmallRun, name: str) -> tuple[int, int]:
    return floor.floor_plan.xy(int(floor.world.robots.cell[floor.index(name)]))


def illegal(floor: SmallRun) -> int:
    return int(floor.world.tally.illegal[LAYER_ROUTING])


def test_robots_on_their_way_are_asked_and_keep_going() -> None:
    strategy = Told(2)
    floor = SmallRun("A......\nB......", {"A": "EEEEE"}, strategies={"routing": strategy}).tick(7)
    assert strategy.questions == [
        Question(2, "A", REASON_PERIODIC, (1, 0)),
        Question(4, "A", REASON_PERIODIC, (3, 0)),
    ], "B has nowhere to go, and at tick 6 A has arrived"
    assert place(floor, "A") == (5, 0)
    assert floor.world.tally.operations[floor.index("A"), ACTION_MOVE].sum() == 5


def test_a_new_route_replaces_the_rest_of_the_old_one() -> None:
    """A goes round by the south."""
    strategy = Told(2, A2="SEEN")
    floor = SmallRun("A......\n.......", {"A": "EEE"}, strategies={"routing": strategy})
    ways = [place(floor.tick(), "A") for _ in range(5)]
    assert ways == [(1, 0), (1, 1), (2, 1), (3, 1), (3, 0)]
    assert illegal(floor) == 0


def test_in_a_long_move_the_route_begins_in_the_cell_that_is_entered() -> None:
    strategy = Told(2, A2="SEN")
    floor = SmallRun(
        "A......\n.......",
        {"A": "EE"},
        durations=Durations(move=3),
        strategies={"routing": strategy},
    )
    ways = [place(floor.tick(), "A") for _ in range(12)]
    assert strategy.questions[0] == Question(2, "A", REASON_PERIODIC, (1, 0)), "tick 2 of 3"
    assert ways[2::3] == [(1, 0), (1, 1), (2, 1), (2, 0)]
    assert ways[1] == (0, 0) and ways[4] == (1, 0)


def test_a_route_from_the_cell_that_it_leaves_is_illegal_and_costs_nothing() -> None:
    """Were A still in the west, it could go east twice and then south."""
    strategy = Told(2, A2="EES")
    floor = SmallRun(
        "A..#\n#..#\n##.#",
        {"A": "EE"},
        durations=Durations(move=3),
        strategies={"routing": strategy},
    )
    assert place(floor.tick(6), "A") == (2, 0), "as planned"
    assert illegal(floor) == 1
    assert floor.world.tally.operations[floor.index("A")].sum() == 2


def test_robots_that_turn_or_wait_are_asked_too() -> None:
    strategy = Told(1)
    floor = SmallRun(
        "#.#\nA.B\n...",
        {"A": "ES", "B": "W"},
        kinematics="differential",
        durations=Durations(turn=3),
        strategies={"routing": strategy},
        waits=(3, 3, 3, 3, 255),
    )
    actions = {}
    for _ in range(8):
        floor.tick()
        for name in "AB":
            if floor.world.robots.busy[floor.index(name)]:
                actions[name, floor.run.tick + 1] = int(
                    floor.world.robots.action[floor.index(name)]
                )
    asked = {(name, tick) for tick, name, *_ in strategy.questions}
    assert set(actions) <= asked
    assert {ACTION_TURN, ACTION_WAIT} <= set(actions.values())


def test_nobody_else_is_asked() -> None:
    """B retreats, C must try to drop its load first, D waits for a route, E has arrived."""
    strategy = Told(1)
    floor = SmallRun(
        "A....\nB....\nC....\nD....\nE....",
        dict.fromkeys("ABCD", "EEE"),
        strategies={"routing": strategy},
    )
    robots = floor.world.robots
    robots.retreat_moves[floor.index("B")] = 2
    robots.try_drop[floor.index("C")] = 1
    robots.route_length[floor.index("D")] = 0
    robots.goal_cell[floor.index("E")] = robots.cell[floor.index("E")]
    floor.tick(2)
    asked = {
        (name, reason == REASON_PERIODIC)
        for tick, name, reason, _ in strategy.questions
        if tick == 2
    }
    assert asked == {("A", True), ("D", False)}


def test_the_route_that_is_shown_begins_where_a_long_move_ends() -> None:
    floor = SmallRun("A...", {"A": "EEE"}, durations=Durations(move=3)).tick(2)
    shown = [
        floor.floor_plan.xy(cell) for cell in take_snapshot(floor.run, selected=0).route.tolist()
    ]
    assert place(floor, "A") == (0, 0) and shown == [(2, 0), (3, 0)]


# Whole runs


class Shortest(Strategy):
    """The shortest path, also when it is asked on the way: it must be the rest of the old one."""

    layer = "routing"
    again = True

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        for k in range(batch.count):
            i = int(batch.robot[k])
            if batch.reason[k] == REASON_PERIODIC and not self.again:
                continue
            route = paths.route(view, workspace, i, int(view.robots.goal_cell[i]))
            assert route is not None and view.robots.goal_cell[i] != NIL
            decisions.routing.route_length[k] = len(route)
            decisions.routing.steps[k, : len(route)] = route


def run(name: str, durations: tuple[str, ...], every: int, again: bool = True) -> MemoryRecorder:
    """A recorded run whose routes are planned every so many ticks."""
    resolved = resolve(name, (*durations, "strategy.right_of_way=wait", "stop.max_duration=150"))
    recorder = MemoryRecorder(resolved)
    simulation = Simulation(resolved, on_record=recorder)
    strategy = Shortest()
    strategy.period, strategy.again = every, again
    strategies = [*simulation.strategies]
    strategies[LAYER_ROUTING] = strategy
    simulation = Simulation(resolved, on_record=recorder, strategies=strategies)
    simulation.run()
    assert not simulation.world.tally.illegal.any()
    return recorder


def actions(recorder: MemoryRecorder) -> Any:
    return np.concatenate(
        [f.content["executed"] for f in recorder.frames if f.kind == FRAME_KIND_TICKS]
    )


@settings(max_examples=20)
@given(st.integers(1, 4), st.integers(1, 3), st.sampled_from(["rail", "differential", "omni"]))
def test_planning_the_same_path_again_changes_nothing(every: int, move: int, kind: str) -> None:
    scenario = (f"fleet.kinematics={kind}", f"durations.move={move}", "durations.turn=2")
    name = "tabletop-mini" if kind == "rail" else "crossing"
    plain, again = (run(name, scenario, number) for number in (0, every))
    plain.flush()
    again.flush()
    assert np.array_equal(actions(plain), actions(again))
    assert validate_stored(again.recording()).valid


@pytest.mark.parametrize("move", [1, 3])
def test_keep_leaves_the_same_digests(move: int) -> None:
    durations = (f"durations.move={move}",)
    plain, asked = (run("crossing", durations, every, again=False) for every in (0, 2))
    ends = [recorder.recording().frames[-1].content["digest"] for recorder in (plain, asked)]
    assert ends[0] == ends[1]
