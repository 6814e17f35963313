"""Robots with pods under each right of way: nobody passes through storage, nobody waits for ever."""

from __future__ import annotations

import pytest
from pod_scenes import RING, line_ticks, played, pod_scene

from automaton.engine.state import ACTION_BLOCKED
from automaton.runs.simulation import Simulation

SLOW = {"pick": 3, "drop": 3, "move": 2, "turn": 3, "handling": {"line": 20}}
LINES = [{"pod": pod, "release": 40 * turn} for turn in range(3) for pod in (1, 2, 3, 4)]


def driven(right_of_way: str, **parts: object) -> Simulation:
    """Three robots that turn carry four pods round the ring, three times each."""
    fleet = {"robots": 3, "kinematics": "differential", "start": [[2, 1], [3, 1], [9, 1]]}
    strategy = {
        "allocation": {"name": "shortest-job", "idle": "stay", "storage": "nearest"},
        "right_of_way": right_of_way,
    }
    given = {"fleet": fleet, "strategy": strategy, "durations": SLOW} | parts
    return played(pod_scene(LINES, **given))


@pytest.mark.parametrize("right_of_way", ["wait", "retreat", "pibt", "epibt"])
def test_all_lines_are_done(right_of_way: str) -> None:
    run = driven(right_of_way)
    assert run.finished and min(line_ticks(run)) > 0
    assert run.world.tally.illegal.sum() == 0


def test_epibt_refuses_no_move_but_in_queues() -> None:
    run = driven("epibt")
    assert run.world.tally.ticks[:, ACTION_BLOCKED].sum() == 0


BLOCK = """\
>>>>>>v
^pppp#v
^pppp#v
^<<t<<<"""


def test_no_way_leads_through_storage() -> None:
    """The robot at (2, 0) is to lift pod 6, which stands behind pod 2: it goes round."""
    scene = pod_scene(
        [{"pod": 6}],
        picture=BLOCK,
        stations={"P1": {"at": [3, 3]}},
        fleet={"robots": 1, "kinematics": "omni", "start": [[2, 0]]},
    )
    run = Simulation(scene)
    run.run(1)
    robots = run.world.robots
    route = robots.route[0, : robots.route_length[0]].tolist()
    assert route[:5] == [0, 0, 0, 0, 1], "east along the aisle, not south beneath pod 2"


def test_a_robot_on_its_way_home_gets_the_trip_of_the_pod_above_it() -> None:
    """Robot 0 wants home past robot 1, which does not move, when pod 1 is asked for again."""
    fleet = {"robots": 2, "kinematics": "omni", "start": [[2, 1], [3, 1]]}
    strategy = {
        "allocation": {"name": "first-come", "storage": "nearest"},
        "right_of_way": "wait",
    }
    lines = [{"pod": 1}, {"pod": 3}, {"pod": 1, "release": 200}]
    parts = {"fleet": fleet, "strategy": strategy, "pods": {"join": False}, "picture": RING}
    run = played(pod_scene(lines, **parts), 400)
    assert run.finished
