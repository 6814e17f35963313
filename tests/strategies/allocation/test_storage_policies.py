"""Where pods are stored."""

from __future__ import annotations

import pytest
from pod_scenes import played, pod_scene

from automaton.runs.simulation import Simulation

LINES = [{"pod": 1}, {"pod": 1, "release": 200}]
ONE_PER_TRIP = {"join": False}


def stored_in(allocation: str, storage: str, **parts: object) -> tuple[int, int]:
    """Columns of the cells in which pod 1 stood first and last."""
    strategy = {"allocation": {"name": allocation, "storage": storage}, "right_of_way": "wait"}
    run: Simulation = played(pod_scene(LINES, strategy=strategy, pods=ONE_PER_TRIP, **parts))
    assert run.finished and run.world.tally.illegal.sum() == 0
    plan, slots = run.resolved.floor_plan, run.world.slots
    return tuple(  # type: ignore[return-value]
        plan.xy(int(slots.cell[slot]))[0]
        for slot in (run.world.pods.home[0], run.world.pods.slot[0])
    )


@pytest.mark.parametrize(
    "allocation", ["first-come", "independent", "shortest-job", "greedy", "auction"]
)
def test_a_pod_goes_back_to_where_it_stood(allocation: str) -> None:
    assert stored_in(allocation, "fixed") == (2, 2)


def test_the_nearest_free_cell_is_on_the_way() -> None:
    """From the station the robot comes round by the west: its own cell is nearer than the free one."""
    assert stored_in("first-come", "nearest") == (2, 2)
    nearer = ">>>>>>>>>v\n^q#pppp##v\n^########v\n^<<<<t<<<<"
    fleet = {"robots": 1, "kinematics": "omni", "start": [[3, 1]]}
    assert stored_in("first-come", "nearest", picture=nearer, fleet=fleet) == (3, 1)


def test_any_cell_may_be_drawn() -> None:
    assert stored_in("first-come", "random")[1] in (2, 7)


@pytest.mark.parametrize(("idle_at", "stored"), [((1, 1), 3), ((8, 0), 1)])
def test_a_pod_goes_where_no_robot_is(idle_at: tuple[int, int], stored: int) -> None:
    """The free cell (1, 1) is the nearest, but not while a robot stands there with nothing to do."""
    picture = ">>>>>>>>>v\n^qppp####v\n^########v\n^<<<<t<<<<"
    fleet = {"robots": 2, "kinematics": "omni", "start": [[3, 1], list(idle_at)]}
    strategy = {
        "allocation": {"name": "shortest-job", "idle": "stay", "storage": "nearest"},
        "right_of_way": "retreat",
    }
    run = Simulation(pod_scene([{"pod": 2}], picture=picture, fleet=fleet, strategy=strategy))
    while run.world.slots.reserved_by.max() < 0 and run.tick < 200:
        run.run(run.tick + 1)
    plan, slots = run.resolved.floor_plan, run.world.slots
    chosen = int((slots.reserved_by >= 0).argmax())
    assert plan.xy(int(slots.cell[chosen])) == (stored, 1)
