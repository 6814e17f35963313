"""One-way streets: what is closed, what stays two-way, and whether the design is kept."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from street_designs import design_of, moves_in, planted, resolved_on, scenario_on
from whole_floors import drawn_whole, resolved_whole

import automaton
from automaton.floor.floor_plan import DIRECTIONS
from automaton.recording.recording_reader import read_recording
from automaton.studies.street_search.designs import StreetDesign, stretches
from automaton.studies.street_search.one_way import (
    NeededWays,
    OneWay,
    bridges,
    closed_where_possible,
    closing_candidates,
    flow_of,
    one_way,
    with_closings,
)
from automaton.verification.verification import verify
from automaton.world.resolve import resolve

RING = """\
......
.####.
......"""
CLOCKWISE = (
    ("row", 0, "west", 8),
    ("row", 2, "east", 8),
    ("column", 0, "south", 8),
    ("column", 5, "north", 8),
)


def closed_on(picture: str, *streets: Any, flow: Any = None, **changes: Any) -> Any:
    """The design with all closings that are possible, its floor, and the streets that stay two-way."""
    resolved = resolved_on(picture, **changes)
    floor_plan = resolved.floor_plan
    design = design_of(floor_plan, *streets)
    traffic = np.ones((floor_plan.kind.size, 4)) if flow is None else flow(floor_plan)
    candidates = closing_candidates(design, floor_plan, traffic)
    closings, two_way = closed_where_possible(design, NeededWays(resolved), candidates)
    return with_closings(design, closings), floor_plan, two_way


def test_a_ring_becomes_one_way() -> None:
    design, floor_plan, two_way = closed_on(RING, *CLOCKWISE)
    assert not two_way
    assert moves_in(design, floor_plan, (2, 0)) == (True, False, False, False)
    assert moves_in(design, floor_plan, (5, 1)) == (False, True, False, False)
    assert moves_in(design, floor_plan, (2, 2)) == (False, False, True, False)
    assert moves_in(design, floor_plan, (0, 0)) == (True, False, False, False)
    assert moves_in(design, floor_plan, (0, 2)) == (False, False, False, True)


def test_a_ratio_below_4_closes_nothing() -> None:
    design, *_ = closed_on(RING, ("row", 0, "west", 3.9), ("column", 0, "north", 3.9))
    assert not design.closed.any()


def test_of_streets_that_meet_head_on_the_one_with_the_least_traffic_stays_two_way() -> None:
    against = (("row", 0, "east", 8), *CLOCKWISE[1:])  # row 0 leads west, the rest clockwise

    def flow(floor_plan: Any) -> Any:
        traffic = np.ones((floor_plan.kind.size, 4))
        traffic[[floor_plan.cell(x, 0) for x in range(6)]] = 0.1
        return traffic

    design, floor_plan, two_way = closed_on(RING, *against, flow=flow)
    assert [floor_plan.xy(one.stretch.cells[0]) for one in two_way] == [(0, 0)]
    assert moves_in(design, floor_plan, (2, 0)) == (True, False, True, False)
    assert moves_in(design, floor_plan, (2, 2)) == (False, False, True, False)


def test_a_bridge_stays_two_way_and_the_rest_of_its_street_does_not() -> None:
    rings = "....#...\n.##.#.#.\n........"
    design, floor_plan, two_way = closed_on(rings, ("row", 2, "west", 8))
    assert not two_way
    assert [moves_in(design, floor_plan, (x, 2))[2] for x in range(1, 8)] == [
        *(False, False, False),
        *(True, True),  # from [4, 2] and [5, 2]
        *(False, False),
    ]
    marks = bridges(floor_plan)
    assert marks.sum() == 4 and marks[floor_plan.cell(4, 2)].tolist() == [True, False] * 2


def test_the_way_into_a_dead_end_stays_two_way() -> None:
    design, floor_plan, two_way = closed_on("...\n.#.\n...\n.##", ("column", 0, "north", 8))
    assert not two_way and not design.closed[floor_plan.cell(0, 3)].any()
    assert design.closed[floor_plan.cell(0, 2), 3] and design.closed[floor_plan.cell(0, 1), 3]


def test_robots_that_an_area_keeps_out_need_ways_of_their_own() -> None:
    """Type b may not enter the middle row, so that its ring has rows 0 and 2 alone."""
    streets = (("row", 0, "west", 8), ("row", 2, "west", 8), ("row", 1, "east", 8))
    picture = "....\n....\n...."
    fleet = {
        "robots": 2,
        "start": [[0, 0], [1, 0]],
        "types": [{"name": "a", "robots": 1}, {"name": "b"}],
    }
    areas = {"middle": {"from": [1, 1], "to": [2, 1], "closed_to": ["b"]}}
    *_, two_way = closed_on(picture, *streets)
    assert not two_way  # robots come back over the middle row
    _, floor_plan, two_way = closed_on(picture, *streets, fleet=fleet, areas=areas)
    rows = {floor_plan.xy(one.stretch.cells[0])[1] for one in two_way}
    assert len(rows) == 1 and rows < {0, 2}


def scattered(floor_plan: Any, seed: int) -> StreetDesign:
    """Each stretch prefers one of its directions by a factor 8."""
    draws = np.random.default_rng(seed)
    design = design_of(floor_plan)
    for stretch in stretches(floor_plan):
        cells = np.array(stretch.cells)
        if draws.random() < 0.5:
            design.moves[cells[:-1], stretch.along] = 800
        else:
            design.moves[cells[1:], stretch.along ^ 2] = 800
    return design


def test_the_mouths_of_a_lift_stay_open_both_ways() -> None:
    """Without the lift the move into its upper mouth is closed."""
    picture = "......\n.####.\n......"
    lift = {"shaft": [[0, 0], [0, 2]], "travel_time": 4}
    for lifts in ([], [lift]):
        resolved = resolved_on(picture, floor={"lifts": lifts})
        design = design_of(resolved.floor_plan, *CLOCKWISE)
        candidates = closing_candidates(design, resolved.floor_plan, np.ones(design.moves.shape))
        closings, two_way = closed_where_possible(design, NeededWays(resolved), candidates)
        assert len(two_way) == (3 if lifts else 0)
        assert len(closings) == (1 if lifts else 4)


# Pods whose queues or ways would break; rails; bays, areas and several types.
@pytest.mark.parametrize("number", [74, 94, 150, 316, 3])
def test_check_accepts_every_one_way_design(number: int) -> None:
    plain = drawn_whole(number)
    resolved = resolved_whole(plain)
    floor_plan = resolved.floor_plan
    design = scattered(floor_plan, number)
    candidates = closing_candidates(design, floor_plan, np.ones(design.moves.shape))
    closings, _ = closed_where_possible(design, NeededWays(resolved), candidates)
    assert closings
    closed = with_closings(design, closings).closed
    plain["streets"] = [
        {"at": list(floor_plan.xy(cell)), DIRECTIONS[way]: "closed"}
        for cell, way in np.argwhere(closed).tolist()
    ]
    exits = resolved_whole(plain).floor_plan.exits.reshape(-1)
    bits = (closed << np.arange(4)).sum(axis=1)
    assert not (exits & bits).any()


def test_robots_on_a_one_way_floor_finish_and_the_run_is_verified(tmp_path: Any) -> None:
    picture = "......\n......\n......"
    resolved = resolved_on(picture)
    design = scattered(resolved.floor_plan, 1)
    candidates = closing_candidates(design, resolved.floor_plan, np.ones(design.moves.shape))
    closings, _ = closed_where_possible(design, NeededWays(resolved), candidates)
    streets = [
        {"at": list(resolved.floor_plan.xy(cell)), DIRECTIONS[way]: "closed"}
        for cell, way in np.argwhere(with_closings(design, closings).closed).tolist()
    ]
    data = scenario_on(picture, streets=streets, stop={"when": "delivered", "max_duration": 2000})
    assert automaton.simulate(data, record=tmp_path / "a.rec").finished
    assert verify(tmp_path / "a.rec").passed
    assert read_recording(tmp_path / "a.rec").header


def judged(worth: Any, noise: float = 0.1) -> tuple[OneWay, StreetDesign, Any]:
    """The one-way ring, with a metric that a function of the design gives."""
    resolved = resolved_on(RING)
    floor_plan = resolved.floor_plan
    design = design_of(floor_plan, *CLOCKWISE)
    flow = np.ones(design.moves.shape)
    compared = planted(lambda one: worth(one, floor_plan), noise=noise)
    found = one_way(design, NeededWays(resolved), flow, compared, range(20), range(100, 140))
    return found, design, floor_plan


def test_a_closing_that_costs_is_opened_again() -> None:
    found, _, floor_plan = judged(lambda one, plan: -0.03 * one.closed[plan.cell(2, 0), 2])
    assert found.is_kept and len(found.closings) == 3
    assert [floor_plan.xy(one.stretch.cells[0]) for one in found.reopened] == [(0, 0)]
    assert moves_in(found.design, floor_plan, (2, 0)) == (True, False, True, False)


def test_a_design_that_loses_1_percent_is_not_kept() -> None:
    """No closing alone makes a difference, all together do."""
    found, design, _ = judged(lambda one, plan: -0.012 * (one.closed.sum() > 8))
    assert not found.is_kept and found.design is design and len(found.closings) == 4
    assert found.change is not None and found.change.relative is not None
    assert found.change.relative.value == pytest.approx(-0.012, abs=0.003)


def test_flow_counts_the_moves_of_a_run() -> None:
    data = scenario_on("....", fleet={"robots": 1, "start": [[0, 0]]})
    data |= {
        "orders": {"tasks": [[[3, 0], [1, 0]]]},
        "stop": {"when": "delivered", "max_duration": 99},
    }
    resolved = resolve(data)
    flow, plan = flow_of(resolved, [1, 2]), resolved.floor_plan
    east = [flow[plan.cell(x, 0), 0] for x in range(4)]
    west = [flow[plan.cell(x, 0), 2] for x in range(4)]
    assert (east, west) == ([1, 1, 1, 0], [0, 0, 1, 1]) and flow.sum() == 5
