"""Why robots that carry pods wait, in one sentence each."""

from __future__ import annotations

from pod_scenes import pod_scene

from automaton.history.event_history import EventHistory
from automaton.history.explanation import explain
from automaton.history.snapshot import Snapshot, take_snapshot
from automaton.history.state_words import station_queue
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, resolve

FLEET = {"kinematics": "omni", "start": [[2, 1], [3, 1], [4, 1]], "robots": 3}


def moment(scene: Resolved, tick: int) -> Snapshot:
    run = Simulation(scene, on_observe=EventHistory())
    run.run(tick)
    return take_snapshot(run)


def said(scene: Resolved, tick: int, robot: int) -> str:
    return explain(moment(scene, tick), scene.floor_plan, robot).lines[0]


def lines(*pods: int) -> list[dict[str, object]]:
    return [{"pod": pod, "station": "P1"} for pod in pods]


def test_the_place_in_the_queue_and_who_is_served() -> None:
    assert said(resolve("goods-mini"), 18, 0) == (
        "robot 0 has been queueing for 1 tick: first in the queue of station P1, "
        "robot 1 is served there for 19 more ticks"
    )
    assert (
        said(resolve("goods-mini"), 18, 1)
        == "robot 1 is at its stop at station P1 for 19 more ticks"
    )


def test_a_queue_is_told_in_its_sequence() -> None:
    scene = pod_scene(lines(1, 2, 3), fleet=FLEET)
    assert station_queue(moment(scene, 30), 0) == [1, 0], "robot 2 is served"
    assert (
        "robot 0 has been queueing for 14 ticks: second in the queue of station P1, robot 2 is"
        in said(scene, 30, 0)
    )


def test_a_break_says_how_long_it_lasts() -> None:
    stations = {"P1": {"at": [5, 3], "breaks": [{"from": 10, "for": 40}]}}
    text = said(pod_scene(lines(1), stations=stations), 30, 0)
    assert text.endswith("robot 0 stands at station P1, which has a break for 20 more ticks")


def test_a_free_robot_says_that_the_stations_are_full() -> None:
    stations = {"P1": {"at": [5, 3], "max_trips": 1}}
    text = said(pod_scene(lines(1, 2), stations=stations, fleet=FLEET), 5, 1)
    assert text == "robot 1 is parked: 1 trip waits, but station P1 has no free place"


def test_a_station_without_a_name_goes_by_its_number() -> None:
    scene = pod_scene([{"pod": 1, "station": 1}], stations={})
    assert said(scene, 25, 0).startswith("robot 0 is at its stop at station 1 for ")
