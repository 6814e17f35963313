"""Tables with the weights of streets hold what Dijkstra finds, and the ticks of the way that is taken.

1,000 floors: HYPOTHESIS_PROFILE=explore pytest tests/engine/test_street_tables.py
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from random_floors import pictures
from reference_costs import CostSet
from reference_paths import FAR, HEADINGS

from automaton.engine.distance_tables import WEIGHT_UNIT
from automaton.engine.state import Array
from automaton.engine.table_rows import cost_in, row_to, ticks_in
from automaton.errors import InputError
from automaton.floor import floor_plan
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.durations import Durations
from automaton.scenario.robot_types import RobotType, floor_by_type
from automaton.world.prepared_floor import floor_for, make_workspace

UNIT = WEIGHT_UNIT
Pose = tuple[int, int]


def test_weights_have_the_same_unit_on_floors_and_in_the_engine() -> None:
    assert floor_plan.WEIGHT_UNIT == WEIGHT_UNIT


def walked(costs: CostSet, ticks: CostSet, found: dict[Pose, int], pose: Pose, goal: int) -> int:
    """The ticks of the way of least cost from a pose: a move before a turn, then the first one."""
    headings, spent = HEADINGS[costs.kinematics], 0
    while pose[0] != goal:
        cell, heading = pose
        for direction in range(heading, 4, headings):
            after = (cell + costs.floor_plan.offsets[direction], heading)
            if not int(costs.floor_plan.exits.flat[cell]) >> direction & 1:
                continue
            if found.get(after, FAR) == found[pose] - costs.step_cost(cell, direction):
                pose, spent = after, spent + ticks.step_cost(cell, direction)
                break
        else:
            ahead, behind = ((cell, (heading + way) % headings) for way in (1, -1))
            is_ahead = found.get(ahead, FAR) == found[pose] - costs.turn
            pose, spent = ahead if is_ahead else behind, spent + ticks.turn
    return spent


@st.composite
def floors(draw: Any) -> tuple[FloorPlan, tuple[RobotType, ...], int]:
    """A floor with weights, closed moves, two types of robots, and how many weights there are."""
    width = draw(st.integers(1, 6))
    lines = draw(pictures(".....++--||==~><v^##", width, draw(st.integers(1, 6)))).split("\n")
    if all(set(line) == {"#"} for line in lines):
        lines.append("." * width)
    floor_plan = draw_floor("\n".join(lines))
    random = np.random.default_rng(draw(st.integers(0, 999)))
    choices = draw(st.sampled_from([(50, 100), (1, 101, 1000), tuple(range(1, 400)), (99_999, 7)]))
    moves = random.choice(np.array(choices), (floor_plan.kind.size, 4))
    shut = random.random(floor_plan.exits.shape) < draw(st.sampled_from([0, 0.2]))
    closing = random.integers(0, 16, floor_plan.exits.shape)
    exits = np.where(shut, floor_plan.exits & closing, floor_plan.exits).astype(np.uint8)
    floor_plan = floor_plan.with_exits(exits)
    waits = np.full(floor_plan.kind.size, UNIT + 1)
    types = tuple(
        RobotType(
            kinematics=draw(st.sampled_from(sorted(HEADINGS))),
            durations=Durations(move=draw(st.integers(1, 3)), turn=draw(st.integers(0, 4))),
        )
        for _ in range(2)
    )
    return floor_plan.with_weights(moves, waits), types, draw(st.integers(0, 99))


@settings(max_examples=examples(100), deadline=None)
@given(floors())
def test_tables_of_streets_hold_costs_and_the_ticks_of_the_ways(
    drawn: tuple[FloorPlan, tuple[RobotType, ...], int],
) -> None:
    floor_plan, types, number = drawn
    floor = floor_for(floor_plan, "undirected", types)
    tables = make_workspace(floor, 1 << 20).streets
    cells = np.flatnonzero(floor_plan.drivable).tolist()
    goal = cells[number % len(cells)]
    for kind, robot_type in enumerate(types):
        row = int(row_to(tables, kind, goal, 1, True))
        plan = floor_by_type(floor_plan, types).floor_plans[kind]
        move, turn = int(floor.move[kind]), int(floor.turn[kind])
        weights = {
            (cell, direction): move * int(floor_plan.move_weights[cell, direction])
            for cell, direction in np.ndindex(*floor_plan.move_weights.shape)
        }
        costs = CostSet(plan, robot_type.kinematics, weights, UNIT * turn)
        ticks = CostSet(plan, robot_type.kinematics, move, turn)
        expected = costs.costs_to(goal)
        for cell in cells:
            for heading in range(HEADINGS[robot_type.kinematics]):
                pose = (cell, heading)
                assert cost_in(tables, row, *pose) == expected.get(pose, FAR)
                is_reached = pose in expected
                way = walked(costs, ticks, expected, pose, goal) if is_reached else FAR
                assert ticks_in(tables, row, *pose) == way


def lengths(floor_plan: FloorPlan) -> Array:
    """(C, 4) weights as large as they may be."""
    return np.full((floor_plan.kind.size, 4), 1_000_000)


def test_weights_that_could_make_a_way_too_dear_are_refused() -> None:
    floor_plan = draw_floor("." * 40 + "\n" + "." * 40)
    heavy = floor_plan.with_weights(lengths(floor_plan), np.full(floor_plan.kind.size, UNIT))
    slow = (RobotType(move_time_factor=20),)
    with pytest.raises(InputError, match="too large"):
        make_workspace(floor_for(heavy, "undirected", slow), 1 << 20)


def test_other_weights_do_not_build_another_floor() -> None:
    floor_plan = draw_floor("....\n....")
    moves = np.full((floor_plan.kind.size, 4), UNIT)
    waits = np.full(floor_plan.kind.size, UNIT)
    built = [
        floor_for(floor_plan.with_weights(moves * factor, waits), "undirected")
        for factor in (1, 2, 3)
    ]
    assert len({id(one.occupancy) for one in built}) == 1
    assert [len(one.grid.move_weight) > 0 for one in built] == [False, True, True]
    assert floor_plan.with_weights(moves, waits) == floor_plan
