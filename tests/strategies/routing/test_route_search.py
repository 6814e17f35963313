"""A* with tie rules: least ticks whatever the rule, and of equal paths the one that the rule finds.

Checked against Bellman and Ford, and against an A* in plain Python that has one heap for everything.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from random_legs import Case, cases
from reference_astar import path
from reference_paths import FAR, Ways

from automaton.engine.state import NIL
from automaton.floor.drawn_floors import draw_floor
from strategies.routing.astar import TIES, RouteSpace, astar

PLAIN_RULES = ("fifo", "larger_g")  # those that need no draw


def found(
    case: Case, ties: str, seed: int = 1, closed: Any = None, workspace: RouteSpace | None = None
) -> tuple[int, list[int]] | None:
    """(ticks, directions) of the kernel's path; `closed`: (zones,) marks of zones."""
    floor, duration, fresh = case.built()
    workspace = workspace or fresh
    if closed is not None:
        workspace.closed[:] = closed
    steps = np.zeros(300, np.uint8)
    with np.errstate(over="ignore"):
        length = astar(
            floor.grid.read_only(),
            0,
            duration,
            workspace,
            TIES.index(ties),
            np.uint64(seed),
            case.start_pose(),
            case.target,
            closed is not None,
            steps,
        )
    return None if length == NIL else (int(workspace.state.cost), steps[:length].tolist())


@settings(max_examples=examples(100))
@given(cases(), st.sampled_from(TIES))
def test_every_rule_takes_the_least_ticks(case: Case, ties: str) -> None:
    expected = case.ways.cost_to(case.start, case.target)
    leg = found(case, ties)
    if expected == FAR:
        assert leg is None
    else:
        assert leg is not None and leg[0] == expected
        assert case.ways.driven(case.start, leg[1]) == (expected, case.target)


@settings(max_examples=examples(100))
@given(cases(), st.sampled_from(PLAIN_RULES))
def test_lane_and_heap_give_the_order_of_one_heap(case: Case, ties: str) -> None:
    assert found(case, ties) == path(case.ways, case.start, case.target, ties)


@pytest.mark.parametrize("kinematics", ["rail", "differential"])
def test_turns_of_no_ticks_do_not_mix_the_order_up(kinematics: str) -> None:
    """After a turn that costs nothing g is the same: what was found first comes first."""
    floor_plan = draw_floor("+++++\n+###+\n+++++\n+#+#+\n+++++")
    ways = Ways(floor_plan, kinematics, 1, 0)
    for start in ways.cells():
        for target in ways.cells():
            case = Case(ways, (start, 0), target)
            assert found(case, "larger_g") == path(ways, (start, 0), target, "larger_g")


@settings(max_examples=examples(80))
@given(cases(), st.sampled_from(PLAIN_RULES), st.data())
def test_closed_zones_are_not_entered(case: Case, ties: str, data: Any) -> None:
    floor, _, _ = case.built()
    grid = floor.grid
    closed = np.array(
        data.draw(
            st.lists(
                st.booleans(), min_size=grid.traffic_zone_count, max_size=grid.traffic_zone_count
            )
        )
    )
    pairs = {
        (cell, way)
        for cell in case.ways.cells()
        for way in range(4)
        if grid.traffic_zone[cell, way >> 1] != NIL and closed[grid.traffic_zone[cell, way >> 1]]
    }
    assert found(case, ties, closed=closed) == path(case.ways, case.start, case.target, ties, pairs)


@settings(max_examples=examples(60))
@given(cases(), st.sampled_from(TIES))
def test_what_was_searched_before_decides_nothing(case: Case, ties: str) -> None:
    first = found(case, ties)
    workspace = case.built()[2]
    for target in case.ways.cells()[:5]:
        found(case._replace(target=target), "fifo", workspace=workspace)
    workspace.state.stamp = 1  # the last stamp: the one after it starts afresh
    assert [found(case, ties, workspace=workspace) for _ in range(3)] == [first] * 3


def leg(picture: str, ties: str, seed: int = 1) -> str:
    """The omni path from A to B of a picture, as letters."""
    rows = picture.strip().split("\n")
    marks = {
        mark: (row.index(mark), y) for y, row in enumerate(rows) for mark in "AB" if mark in row
    }
    floor_plan = draw_floor("\n".join(rows).replace("A", ".").replace("B", "."))
    case = Case(
        Ways(floor_plan, "omni", 1, 1),
        (floor_plan.cell(*marks["A"]), 0),
        floor_plan.cell(*marks["B"]),
    )
    got = found(case, ties, seed)
    assert got is not None
    return "".join("ESWN"[way] for way in got[1])


OPEN = """
A...
....
...B
"""


def test_north_and_south_come_before_east_and_west() -> None:
    assert leg(OPEN, "fifo") == leg(OPEN, "larger_g") == "SSEEE"


def test_the_larger_g_looks_at_fewer_cells() -> None:
    floor_plan = draw_floor("\n".join(["." * 20] * 20))
    case = Case(Ways(floor_plan, "omni", 1, 1), (floor_plan.cell(0, 0), 0), floor_plan.cell(19, 19))
    expanded = {}
    for ties in PLAIN_RULES:
        workspace = case.built()[2]
        found(case, ties, workspace=workspace)
        expanded[ties] = workspace.state.expanded
    assert expanded == {"fifo": 400, "larger_g": 39}


def test_random_ties_are_drawn_by_seed_and_leg() -> None:
    routes = {seed: leg(OPEN, "random", seed) for seed in range(20)}
    assert {len(route) for route in routes.values()} == {5}
    assert len(set(routes.values())) > 4
    assert routes == {seed: leg(OPEN, "random", seed) for seed in range(20)}


def test_a_path_that_does_not_fit_is_cut() -> None:
    floor_plan = draw_floor("......")
    case = Case(Ways(floor_plan, "omni", 1, 1), (floor_plan.cell(0, 0), 0), floor_plan.cell(5, 0))
    floor, duration, workspace = case.built()
    steps = np.zeros(3, np.uint8)
    with np.errstate(over="ignore"):
        arguments = (floor.grid.read_only(), 0, duration, workspace, 0, np.uint64(1))
        assert astar(*arguments, case.start_pose(), case.target, False, steps) == 3
    assert workspace.state.cost == 5


@pytest.mark.parametrize("ties", TIES)
def test_the_leg_to_where_it_stands_is_empty(ties: str) -> None:
    floor_plan = draw_floor("..")
    case = Case(
        Ways(floor_plan, "differential", 1, 2), (floor_plan.cell(1, 0), 3), floor_plan.cell(1, 0)
    )
    assert found(case, ties) == (0, [])
