"""What keeps robots that carry pods: queues and breaks of stations, and pods in their way."""

from __future__ import annotations

from typing import Any

from pod_scenes import pod_scene

from automaton.engine.observation import CAUSES
from automaton.engine.state import NIL
from automaton.history.event_history import EventHistory
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, resolve

BREAK = {"P1": {"at": [5, 3], "breaks": [{"from": 10, "for": 40}]}}


def watched(scene: Resolved, until: int) -> Simulation:
    run = Simulation(scene, on_observe=EventHistory())
    run.run(until)
    return run


def lost(run: Simulation, robot: int) -> dict[str, int]:
    """The ticks that a robot has lost, by cause."""
    i = run.world.robots.at_index[robot]
    ticks = run.observation.lost[i].tolist()
    return {cause.name: n for cause, n in zip(CAUSES, ticks, strict=True) if n}


def why(run: Simulation, robot: int) -> tuple[str, int]:
    """The cause of its wait, and the robot that keeps it."""
    i = run.world.robots.at_index[robot]
    return CAUSES[run.observation.cause[i]].name, int(run.observation.blocker[i])


def test_a_robot_queues_for_the_one_that_is_served() -> None:
    run = watched(resolve("goods-mini"), 18)
    assert why(run, 0) == ("station queue", 1)
    run.run(58)
    assert lost(run, 0) == {"station queue": 20}, "ticks 18 to 37"
    assert why(run, 0) == ("none", NIL)


def test_a_robot_stands_at_its_station_while_it_has_a_break() -> None:
    run = watched(pod_scene([{"pod": 1, "station": "P1"}], stations=BREAK), 30)
    assert why(run, 0) == ("station break", NIL)
    run.run()
    came = 69 - 20 - lost(run, 0)["station break"]
    assert lost(run, 0) == {"station break": 69 - 20 - came} and 10 < came < 20
    assert int(run.world.lines.done[0]) == 69


def test_a_pod_in_the_way_keeps_a_robot_with_a_load() -> None:
    """Its router would never lead it there: it is sent east, beneath pod 2."""
    run = watched(pod_scene([{"pod": 1, "station": "P1"}]), 3)
    robots = run.world.robots
    assert robots.load[0] != NIL and robots.busy[0] == 0
    robots.route[0, 0], robots.route_length[0], robots.route_index[0] = 0, 1, 0
    robots.need[0] = 0
    run.world.clock.needing_route = 0
    run.run(4)
    wanted: Any = run.resolved.floor_plan.xy(int(run.observation.wanted[0]))
    assert why(run, 0) == ("pod ahead", NIL)
    assert wanted == (3, 1) and run.world.pods.slot[1] != NIL
