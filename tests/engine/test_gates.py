"""Closed cells, doors, blocks and lifts: who gets through when, to the tick.

Robot 0 stands at (0, 0) of an aisle. Alone it is in (x, 0) after tick x, and asks for (3, 0) in tick 3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gate_scenes import delivered, first_tick, gate_scene, lost, track, watched

from automaton.engine.state import NEVER, NIL
from automaton.runs.simulation import Simulation

CLOSED = {"cells": [[3, 0]]}
DOOR = {"at": [3, 0], "opening_time": 4, "hold_open": 2}


# Closed cells.


@pytest.mark.parametrize(
    ("begin", "ticks", "entered"), [(3, 5, 8), (1, 2, 3), (2, 2, 4), (4, 9, 3)]
)
def test_a_cell_is_closed_from_the_first_tick_until_before_the_last(
    begin: int, ticks: int, entered: int
) -> None:
    """A robot that asks in tick 3 enters in the first tick that is not within [begin, begin + ticks)."""
    scene = gate_scene({"closed": [CLOSED | {"from": begin, "for": ticks}]}, (7, 0))
    assert first_tick(scene, (3, 0)) == entered


def test_a_schedule_repeats() -> None:
    """Closed in ticks 0 to 3, 5 to 8, 10 to 13, ...: open in every fifth tick."""
    scene = gate_scene({"closed": [CLOSED | {"from": 0, "for": 4, "every": 5}]}, (7, 0))
    assert first_tick(scene, (3, 0)) == 4
    assert lost(watched(scene)) == {"closed": 1}


def test_who_is_in_a_closed_cell_goes_on_through_it() -> None:
    """Cells 2 to 5 close in tick 4, when the robot is in (3, 0)."""
    cells = {"cells": [[2, 0], [5, 0]], "from": 4, "for": 50}
    assert delivered(gate_scene({"closed": [cells]}, (7, 0))) == [7]


def test_a_long_move_that_has_begun_goes_on() -> None:
    """A move of 3 ticks into (3, 0) begins in tick 7; the cell closes in tick 8."""
    closed = {"closed": [CLOSED | {"from": 8, "for": 50}]}
    assert first_tick(gate_scene(closed, (7, 0), durations={"move": 3}), (3, 0)) == 9
    closed = {"closed": [CLOSED | {"from": 7, "for": 50}]}
    assert first_tick(gate_scene(closed, (7, 0), durations={"move": 3}), (3, 0)) == 59


def test_who_waits_before_a_closed_cell_draws_nothing_and_asks_nobody() -> None:
    scene = gate_scene({"closed": [CLOSED | {"from": 1, "for": 40}]}, (7, 0))
    run = watched(scene, 20)
    assert lost(run) == {"closed": 18}, "ticks 3 to 20"
    assert run.world.robots.retry_state[0] == 0 and run.world.robots.need[0] == 0
    assert run.world.tally.batches[4] == 0


def test_closings_by_chance_have_the_mean_gap_and_the_lengths_that_were_asked_for() -> None:
    closed = CLOSED | {"every": {"mean": 20}, "for": {"uniform": {"from": 2, "to": 6}}}
    stop = {"when": "never", "max_duration": 100_000}
    scene = gate_scene({"closed": [closed]}, (7, 0), stop=stop)
    rows = Simulation(scene).world.gates.closings
    gaps, lengths = rows[1:, 0] - rows[:-1, 1], rows[:, 1] - rows[:, 0]
    assert len(rows) > 3000 and gaps.min() == 1
    assert abs(gaps.mean() - 20) < 3 * 20 / np.sqrt(len(gaps))
    assert set(lengths.tolist()) == {2, 3, 4, 5, 6}
    other = Simulation(scene, 2).world.gates.closings
    assert not np.array_equal(rows[:50], other[:50]), "they follow from the seed"


LOOP = """\
........
.######.
........"""


def test_a_robot_that_has_long_waited_goes_round() -> None:
    """The way round takes 4 moves more. It waits in ticks 3 to 12, then drives."""
    closed = {"closed": [CLOSED | {"from": 1, "for": 150}], "replan_after": 10}
    scene = gate_scene(closed, (7, 0), picture=LOOP)
    assert delivered(scene) == [12 + 2 + 11]
    assert delivered(gate_scene(closed | {"replan_after": None}, (7, 0), picture=LOOP)) == [155]


def test_where_no_way_leads_round_it_goes_on_waiting() -> None:
    closed = {"closed": [CLOSED | {"from": 1, "for": 50}], "replan_after": 10}
    assert delivered(gate_scene(closed, (7, 0))) == [55]


@pytest.mark.parametrize("routing", ["astar", "congestion"])
def test_routes_avoid_what_is_closed_for_longer_than_the_detour(routing: str) -> None:
    """Round it takes 11 moves; straight on 7, and the wait until (3, 0) is open."""

    def done(ticks: int, **known: bool) -> Any:
        closed = CLOSED | {"from": 0, "for": ticks} | known
        parts = {"picture": LOOP, "routing": routing}
        return delivered(gate_scene({"closed": [closed], "replan_after": None}, (7, 0), **parts))

    assert done(6) == [10], "it waits for 3 ticks"
    assert done(40) == [11]
    assert done(40, known=False) == [44]


# Doors.


def test_a_door_opens_to_the_first_robot_that_asks() -> None:
    """Refused in tick 3, granted from tick 3 + 4 on."""
    scene = gate_scene({"doors": [DOOR]}, (7, 0))
    assert first_tick(scene, (3, 0)) == 7
    assert lost(watched(scene)) == {"door": 4}


def test_a_door_shuts_when_it_was_not_used_for_so_long() -> None:
    """The robot stands in the door in tick 8, the last of its use; with 2 ticks more it shuts in 11."""
    run = Simulation(gate_scene({"doors": [DOOR]}, (7, 0), stop={"when": "never"}))
    run.run(10)
    assert run.world.gates.open_from[0] == 7
    run.run(11)
    assert run.world.gates.open_from[0] == NEVER


def test_a_door_stays_open_for_those_that_follow() -> None:
    """Robot 0 asks in tick 2 and enters in tick 6; robot 1, behind it, is not refused by the door."""
    doors = {"doors": [DOOR | {"hold_open": 20}]}
    scene = gate_scene(doors, (7, 0), (6, 0), start=[[1, 0], [0, 0]])
    assert first_tick(scene, (3, 0)) == 6 and first_tick(scene, (3, 0), robot=1) > 6
    run = watched(scene, 20)
    assert lost(run)["door"] == 4 and "door" not in lost(run, robot=1)


# Blocks.

CROSS = """\
..#...##
........
..#...#."""


def block(most: int = 1, direction: str = "any") -> dict[str, Any]:
    return {"cells": [[3, 1], [5, 1]], "max_robots": most, "direction": direction}


def test_a_block_lets_the_next_one_in_a_tick_after_the_last_one_left() -> None:
    """Robot 0 is in (3, 1) to (5, 1) after ticks 2, 3 and 4, and outside after tick 5."""
    scene = gate_scene({"blocks": [block()]}, (7, 1), (7, 2), picture=CROSS, start=[[1, 1], [0, 1]])
    assert track(scene, 6)[1:5] == [(3, 1), (4, 1), (5, 1), (6, 1)]
    assert first_tick(scene, (2, 1), robot=1) == 2, "it waits before the block"
    assert first_tick(scene, (3, 1), robot=1) == 6


def test_of_two_entrants_of_one_tick_one_goes_and_it_does_not_depend_on_storage() -> None:
    """Both ask in tick 2, from the two ends of the block; the best by priority, then by hash, goes."""
    scene = gate_scene({"blocks": [block()]}, (7, 1), (0, 1), picture=CROSS, start=[[1, 1], [7, 1]])
    runs = [Simulation(scene, storage=np.array(order)) for order in ((0, 1), (1, 0))]
    for run in runs:
        run.run(2)
    cells = [run.world.robots.cell[run.world.robots.at_index].tolist() for run in runs]
    inside = [scene.floor_plan.xy(cell) in ((3, 1), (5, 1)) for cell in cells[0]]
    assert sorted(inside) == [False, True] and cells[0] == cells[1]
    assert runs[0].digest == runs[1].digest


def test_a_block_for_two_holds_two() -> None:
    start = [[2, 1], [1, 1], [0, 1]]
    scene = gate_scene({"blocks": [block(2)]}, (7, 1), (7, 2), (6, 1), picture=CROSS, start=start)
    run = Simulation(scene)
    most = 0
    for tick in range(1, 40):
        run.run(tick)
        cells = [scene.floor_plan.xy(int(cell)) for cell in run.world.robots.cell]
        most = max(most, sum(cell in ((3, 1), (4, 1), (5, 1)) for cell in cells))
    assert most == 2


def test_a_block_of_one_direction_lets_nobody_in_from_the_other_end() -> None:
    """Robot 0 is in before robot 1 asks at the other end, for which there would be room."""
    parts: dict[str, Any] = {"picture": CROSS, "start": [[2, 1], [7, 1]]}
    any_way = gate_scene({"blocks": [block(2)]}, (7, 1), (0, 1), **parts)
    assert first_tick(any_way, (5, 1), robot=1) == 2
    same = gate_scene({"blocks": [block(2, "same")]}, (7, 1), (0, 1), **parts)
    assert lost(watched(same, 3), robot=1) == {"block": 2}


def test_a_robot_in_a_bay_waits_for_its_home_cell_to_open() -> None:
    """A parking bay opens on (0, 0), which is closed up to tick 9."""
    scene = gate_scene(
        {"closed": [{"cells": [[0, 0]], "from": 0, "for": 10}]},
        (5, 0),
        picture="b.......",
        fleet={"robots": 1, "kinematics": "omni"},
    )
    run = watched(scene, 9)
    assert run.world.robots.cell[0] == NIL and set(lost(run)) == {"closed"}
    run.run(10)
    assert run.world.robots.cell[0] != NIL


# Lifts.

LEVELS = "..........\n####.#####"
LIFT = {"shaft": [[3, 0], [6, 0]], "travel_time": 10, "door_time": 2}


def test_a_lift_opens_to_the_one_that_calls_and_travels_from_mouth_to_mouth() -> None:
    """Called in tick 3, where the cabin is: entered in 5. Three moves share 10 ticks: 3, 3 and 4."""
    scene = gate_scene({"lifts": [LIFT]}, (8, 0), picture=".........")
    assert track(scene, 18)[2:] == [
        *[(2, 0)] * 2,
        *[(3, 0)] * 3,
        *[(4, 0)] * 3,
        *[(5, 0)] * 4,
        *[(6, 0)] * 1,
        *[(7, 0)] * 1,
        *[(8, 0)] * 2,
    ]


def test_the_cabin_stays_where_it_was_left_and_comes_back_for_the_next_one() -> None:
    """Robot 0 is out of it after tick 16; robot 1 calls in tick 17: 10 ticks of way, 2 of doors."""
    scene = gate_scene(
        {"lifts": [LIFT]}, (9, 0), (8, 0), picture="..........", start=[[1, 0], [0, 0]]
    )
    left = first_tick(scene, (7, 0))
    assert first_tick(scene, (3, 0), robot=1) == left + 1 + 10 + 2


def test_a_lift_with_three_mouths_takes_a_travel_time_from_each_to_the_next() -> None:
    """Mouths at (3, 0), (4, 0) and (6, 0), as (4, 1) leads out: 10 ticks, then 5 and 5."""
    scene = gate_scene({"lifts": [LIFT]}, (8, 0), picture=LEVELS)
    assert first_tick(scene, (3, 0)) == 5
    assert first_tick(scene, (4, 0)) == 15
    assert first_tick(scene, (5, 0)) == 20 and first_tick(scene, (6, 0)) == 25


def test_moves_in_a_lift_are_no_slow_moves() -> None:
    run = watched(gate_scene({"lifts": [LIFT]}, (8, 0), picture="........."))
    assert run.world.tally.slowdown_ticks.sum() == 0 and lost(run) == {"lift": 2}


# Rights of way that steer.

RING = """\
.......
.#####.
.#####.
......."""
GATES = {
    "closed": {"closed": [{"cells": [[3, 0]], "from": 2, "for": 40}]},
    "door": {"doors": [DOOR]},
    "block": {"blocks": [{"cells": [[2, 0], [4, 0]]}]},
    "lift": {"lifts": [LIFT | {"shaft": [[2, 0], [4, 0]]}]},
}


@pytest.mark.parametrize("right_of_way", ["pibt", "epibt"])
@pytest.mark.parametrize("kind", list(GATES))
def test_robots_that_are_steered_ask_at_gates_and_make_way(kind: str, right_of_way: str) -> None:
    """Two robots cross over to each other's place, and back, over a ring with a gate in it."""
    scene = gate_scene(
        GATES[kind],
        *[(6, 0), (0, 0)] * 2,
        picture=RING,
        start=[[0, 0], [6, 0]],
        right_of_way=right_of_way,
        kinematics="differential",
    )
    run = Simulation(scene)
    run.run()
    assert run.finished and run.world.tally.illegal.sum() == 0
