"""Every search finds the ticks that plain Bellman-Ford finds, on a path that can be driven.

Kernels: distance tables, the descent along them, A* (find_path), and the nearest of many marks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from random_floors import pictures
from reference_paths import FAR, HEADINGS, Pose, Ways

from automaton.engine import search
from automaton.engine.state import NIL, Workspace, World
from automaton.floor.drawn_floors import draw_floor
from automaton.scenario.fleet import FleetType
from automaton.scenario.schema import Durations, Fleet, Scenario
from automaton.world.building import build_world
from automaton.world.resolved import Resolved

SYMBOLS = ".....++--||==~><v^##"


@dataclass
class Case:
    """A floor, where a search starts, and robots that stand about (all of them on other cells)."""

    ways: Ways
    start: Pose
    targets: list[int]
    robots: list[int]
    beside: str | None = None  # kinematics of the last robot, where there are two or more

    def built(self) -> tuple[World, Workspace]:
        durations = Durations(move=self.ways.move, turn=self.ways.turn)
        count, types = max(1, len(self.robots)), []
        if self.beside and count > 1:
            last = FleetType(name="last", robots=1, kinematics=self.beside)  # type: ignore[arg-type]
            types = [FleetType(name="first"), last]
        fleet = Fleet(robots=count, kinematics=self.ways.kinematics, types=tuple(types))  # type: ignore[arg-type]
        scenario = Scenario(name="paths", layout={}, fleet=fleet, durations=durations)
        start = tuple(self.robots) or (self.start[0],)
        world, floor = build_world(Resolved(scenario, self.ways.floor_plan, {}, start, ""), 1)
        return world.read_only(), floor.borrow_space(world, world.rules.table_bytes)

    def closed(self) -> set[int]:
        """Cells of capacity 1 with a robot: they have no room from any side."""
        capacity = self.ways.floor_plan.capacity.ravel()
        return {cell for cell in self.robots if capacity[cell] == 1}


@st.composite
def cases(draw: Any, symbols: str = SYMBOLS) -> Case:
    width = draw(st.integers(1, 5))
    lines = draw(pictures(symbols, width, draw(st.integers(1, 5)))).split("\n")
    if all(set(line) == {"#"} for line in lines):
        lines.append("." * width)
    ways = Ways(
        floor_plan=draw_floor("\n".join(lines)),
        kinematics=draw(st.sampled_from(["rail", "differential", "omni"])),
        move=draw(st.integers(1, 3)),
        turn=draw(st.sampled_from([1, 2, 5])),
    )
    cells = draw(st.permutations(ways.cells()))
    start = (cells[0], draw(st.integers(0, ways.headings - 1)))
    robots = cells[1 : 1 + draw(st.integers(0, 4))]
    beside = draw(st.sampled_from([None, *HEADINGS]))
    return Case(ways, start, [cells[-1], cells[len(cells) // 2], cells[0]], robots, beside)


def found(case: Case, target: int, around: bool, how: Any = search.find_path) -> list[int] | None:
    """The route that a kernel finds, or None."""
    view, workspace = case.built()
    steps = np.zeros(200, np.uint8)
    arguments = (around, steps) if how is search.find_path else (steps,)
    length = how(view, workspace, 0, *case.start, target, *arguments)
    return None if length == NIL else steps[:length].tolist()


@settings(max_examples=examples(100))
@given(cases())
def test_a_table_holds_the_ticks_from_every_pose(case: Case) -> None:
    view, workspace = case.built()
    for target in case.targets:
        for cell in case.ways.cells():
            for heading in range(case.ways.headings):
                ticks = search.distance(view, workspace, 0, cell, heading, target)
                assert ticks == case.ways.cost_to((cell, heading), target)


@settings(max_examples=examples(100))
@given(cases())
def test_a_star_and_the_descent_take_the_least_ticks(case: Case) -> None:
    for target in case.targets:
        expected = case.ways.cost_to(case.start, target)
        for how in (search.find_path, search.follow_gradient):
            route = found(case, target, False, how)
            if expected == FAR:
                assert route is None
            else:
                assert route is not None
                assert case.ways.driven(case.start, route) == (expected, target)


@settings(max_examples=examples(100))
@given(cases(symbols=".....++--||><v^##"))
def test_around_robots_means_through_no_cell_without_room(case: Case) -> None:
    closed = case.closed()
    for target in case.targets:
        open_target = closed - {target}
        expected = case.ways.cost_to(case.start, target, open_target)
        route = found(case, target, True)
        if expected == FAR:
            assert route is None
        else:
            assert route is not None
            assert case.ways.driven(case.start, route, open_target) == (expected, target)


@settings(max_examples=examples(100))
@given(cases(symbols=".....++--||><v^##"), st.booleans())
def test_the_nearest_mark_is_the_nearest_and_ties_go_to_the_lowest(
    case: Case, around: bool
) -> None:
    view, workspace = case.built()
    closed = case.closed() if around else set()
    mark = search.begin_search(workspace)
    for value, cell in enumerate(case.targets):
        search.mark_goal(workspace, mark, cell, value)
    costs = [case.ways.cost_to(case.start, cell, closed) for cell in case.targets]
    best = search.nearest_mark(view, workspace, mark, 0, *case.start, around)
    expected = NIL if min(costs) == FAR else costs.index(min(costs))
    assert best == expected, (costs, closed)


@settings(max_examples=examples(60))
@given(cases())
def test_what_was_searched_before_decides_no_tie(case: Case) -> None:
    target = case.targets[0]
    first = found(case, target, False)
    view, workspace = case.built()
    for cell in case.ways.cells():  # other tables, other stamps, other robots' searches
        search.find_path(
            view, workspace, 0, cell, case.start[1], case.targets[1], True, workspace.steps
        )
    assert found(case, target, False) == first
    assert found(case, target, True) == found(case, target, True)


@pytest.mark.parametrize(
    ("kinematics", "expected"), [("omni", [0, 0, 1, 1]), ("differential", [0, 0, 1, 1])]
)
def test_equal_paths_prefer_going_straight_then_east(kinematics: str, expected: list[int]) -> None:
    """From the upper left corner of ... to the lower right one."""
    ways = Ways(draw_floor("...\n...\n..."), kinematics, 1, 1)
    case = Case(ways, (ways.floor_plan.cell(0, 0), 0), [], [])
    assert found(case, ways.floor_plan.cell(2, 2), False, search.follow_gradient) == expected


def test_in_an_aisle_for_two_only_the_free_lane_counts_as_room() -> None:
    """A stands in the east lane of the aisle: B passes westwards, C may not follow eastwards."""
    for start, goal, passes in (((5, 0), (0, 0), True), ((0, 0), (5, 0), False)):
        ways = Ways(draw_floor("..==..\n#....#"), "omni", 1, 1)
        case = Case(ways, (ways.floor_plan.cell(*start), 0), [], [ways.floor_plan.cell(2, 0)])
        route = found(case, ways.floor_plan.cell(*goal), True)
        assert route is not None
        assert (len(route) == 5) == passes


def test_of_a_route_that_does_not_fit_the_first_steps_are_given() -> None:
    ways = Ways(draw_floor("......"), "omni", 1, 1)
    view, workspace = Case(ways, (ways.floor_plan.cell(0, 0), 0), [], []).built()
    arguments = (view, workspace, 0, ways.floor_plan.cell(0, 0), 0, ways.floor_plan.cell(5, 0))
    for length in (4, 5):
        steps = np.zeros(length, np.uint8)
        assert search.find_path(*arguments, False, steps) == length
        assert search.follow_gradient(*arguments, steps) == length
