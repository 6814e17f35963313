"""Pods that are carried to stations and back, tick by tick."""

from __future__ import annotations

from typing import Any

import numpy as np
from pod_scenes import line_ticks, played, pod_scene, trips

from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.strategy.api import ACTION_STATION_QUEUE, CMD_TAKE_ORDER, NIL, Strategy
from automaton.world.resolve import resolve

TWO_STATIONS = """\
>>>>>>>>>v
^#pppp#q#v
^########v
^<<t<<t<<<"""
BOTH = {"A": {"at": [6, 3], "queue": [[7, 3], [8, 3]]}, "B": {"at": [3, 3], "max_trips": 2}}


def pod(number: int, station: str = "P1", **more: Any) -> dict[str, Any]:
    return {"pod": number, "station": station, **more}


def test_goods_mini_goes_tick_by_tick() -> None:
    run = Simulation(resolve("goods-mini"))
    run.run(17)
    queued = run.world.tally.ticks[0, ACTION_STATION_QUEUE]
    assert queued.sum() == 0
    run.run(38)
    assert queued.sum() == 20, "from tick 18 to 37"
    run.run(69)
    assert run.world.pods.slot[0] == NIL
    run.run(70)
    assert run.world.pods.slot[0] == run.world.pods.home[0], "stored in tick 70"
    assert run.world.lines.trip[2] == NIL
    run.run(71)
    assert run.world.lines.trip[2] == 2, "the waiting line is a trip in the next one"
    run.run()
    assert run.finished and run.tick == 122
    assert line_ticks(run) == [58, 37, 110]
    found = metrics_of(run)
    assert found["distance"] == 78
    assert (found["late_share"], found["lead_time_max"]) == (0.0, 58)
    assert (found["lines_done"], found["visits"], found["trips"]) == (3, 3, 3)


def test_a_single_robot_serves_a_line_in_each_cycle() -> None:
    lines = [pod(1) for _ in range(4)]
    run = played(pod_scene(lines, pods={"join": False}))
    assert line_ticks(run) == [52 * k - 14 for k in range(1, 5)]
    assert run.tick == 52 * 4 - 2


def test_a_line_joins_a_stop_that_is_not_begun() -> None:
    run = played(pod_scene([pod(1), pod(1, release=5)]))
    assert trips(run) == [[0, 1]]
    assert line_ticks(run) == [58, 58], "both are handled in one visit, of 40 ticks"


def test_a_line_that_comes_in_a_visit_becomes_another_stop() -> None:
    run = played(pod_scene([pod(1), pod(1, release=25)]))
    assert trips(run) == [[0, 1]]
    assert line_ticks(run) == [38, 58], "at the same station, without a drive"
    assert metrics_of(run)["visits"] == 2


def test_a_trip_takes_no_more_stops_than_it_may_have() -> None:
    run = played(pod_scene([pod(1), pod(1, release=25)], pods={"max_stops": 1}))
    assert trips(run) == [[0], [1]]


def test_a_trip_leads_from_station_to_station() -> None:
    lines = [pod(1, "A"), pod(1, "B")]
    run = played(pod_scene(lines, picture=TWO_STATIONS, stations=BOTH))
    assert trips(run) == [[0, 1]]
    assert line_ticks(run)[0] < line_ticks(run)[1]
    assert metrics_of(run)["pod_moves"] == 0


def test_a_trip_without_a_place_at_its_next_station_ends_in_storage() -> None:
    """Two pods are on their way to A and then to B, which lets only one come."""
    stations = {**BOTH, "B": {"at": [3, 3], "max_trips": 1}}
    lines = [pod(1, "A"), pod(1, "B"), pod(2, "A"), pod(2, "B"), pod(3, "B"), pod(3, "B")]
    fleet = {"robots": 3, "kinematics": "omni", "start": [[2, 1], [3, 1], [4, 1]]}
    handling = {"pick": 3, "drop": 3, "handling": {"line": 60}}
    scene = pod_scene(
        lines, picture=TWO_STATIONS, stations=stations, fleet=fleet, durations=handling
    )
    run = Simulation(scene)
    most = 0
    while not run.finished:
        run.run(run.tick + 1)
        most = max(most, int(run.world.pod_stations.taken[0]))
        assert run.world.pod_stations.taken.min() >= 0
    assert most <= 3
    assert (run.world.lines.done != NIL).all()
    assert len(trips(run)) > 3, "lines without a place waited for another trip"
    assert run.world.pod_stations.taken.tolist() == [0, 0]


def test_lines_of_an_order_go_to_one_station() -> None:
    lines = [{"pod": 1, "order": 7}, {"pod": 2, "order": 7}, {"pod": 3, "order": 8}]
    run = played(pod_scene(lines, picture=TWO_STATIONS, stations=BOTH))
    assert run.world.lines.served_at[0] == run.world.lines.served_at[1]
    assert run.world.lines.served_at[2] != run.world.lines.served_at[0], "it has fewer open lines"
    assert metrics_of(run)["delivered"] == 2, "orders, of three lines"


def test_no_visit_begins_in_a_break() -> None:
    stations = {"P1": {"at": [5, 3], "breaks": [{"from": 10, "for": 40}]}}
    run = played(pod_scene([pod(1)], stations=stations))
    assert line_ticks(run) == [69], "it begins in tick 50"


def test_a_station_that_lets_one_trip_come_is_asked_for_one_after_the_other() -> None:
    stations = {"P1": {"at": [5, 3], "max_trips": 1}}
    fleet = {"robots": 2, "kinematics": "omni", "start": [[2, 1], [3, 1]]}
    run = Simulation(pod_scene([pod(1), pod(2)], stations=stations, fleet=fleet))
    while not run.finished:
        run.run(run.tick + 1)
        assert run.world.pod_stations.taken[0] <= 1
    assert run.world.tally.illegal.sum() == 0


class Changes(Strategy):
    """Allocation: the one robot takes trip 0 in tick 1, and trip 1 instead in tick 2."""

    layer = "allocation"
    period = 1

    def decide(self, view, batch, decisions, memory, workspace):
        trip = view.clock.tick - 1
        if trip < 2:
            slot = view.orders.current_slot[trip]
            decisions.allocation.command[0] = CMD_TAKE_ORDER
            decisions.allocation.order[0] = trip
            decisions.allocation.goal_cell[0] = view.slots.cell[slot]


def test_a_robot_that_changes_its_trip_takes_its_place_along() -> None:
    """The station lets one trip come: the robot's own, so that its place is free for the other one."""
    fleet = {"robots": 1, "kinematics": "omni", "start": [[1, 0]]}
    stations = {"P1": {"at": [5, 3], "max_trips": 1}}
    scene = pod_scene([pod(4), pod(3)], stations=stations, fleet=fleet)
    run = Simulation(scene, strategies=[None, None, Changes(), None, None])
    run.run(1)
    assert run.world.robots.order.tolist() == [0]
    run.run(2)
    assert run.world.robots.order.tolist() == [1]
    assert run.world.pod_stations.taken.tolist() == [1] and not run.world.tally.illegal.any()


def test_the_robot_beneath_a_pod_gets_its_trip() -> None:
    """Robot 1 stands beneath pod 2 and is farther from the station than robot 0."""
    fleet = {"robots": 2, "kinematics": "omni", "start": [[7, 0], [3, 1]]}
    run = played(pod_scene([pod(2)], fleet=fleet), until=1)
    assert run.world.orders.reserved_by[0] == 1
    assert run.world.robots.order.tolist() == [NIL, 0]


def test_a_robot_with_a_pod_is_led_past_pods() -> None:
    """The way over storage would be as short."""
    run = played(pod_scene([pod(1), pod(4, release=100)]))
    did = run.world.tally.ticks.sum((0, 2))
    assert run.world.tally.illegal.sum() == 0
    assert did[8] == 0, "no move was refused"


def test_handling_is_summed_for_lines_and_units() -> None:
    handling = {"visit": 2, "line": 3, "unit": 4}
    durations = {"pick": 3, "drop": 3, "handling": handling}
    run = played(pod_scene([pod(1, units=2), pod(1, units=0)], durations=durations))
    assert line_ticks(run) == [18 + 2 + 2 * 3 + 2 * 4] * 2


def test_a_trip_is_as_urgent_as_the_most_urgent_of_its_lines() -> None:
    lines = [pod(1, due=500), pod(1, release=2, priority=3, due=90)]
    run = played(pod_scene(lines), until=10)
    orders = run.world.orders
    assert (orders.priority[0], orders.due[0], orders.release_tick[0]) == (3, 92, 0)


def test_storage_in_any_sequence_gives_the_same_run() -> None:
    fleet = {"robots": 3, "kinematics": "omni", "start": [[2, 1], [3, 1], [7, 0]]}
    lines = {"count": 12, "mean_interarrival_time": 9}
    digests = []
    for storage in ([0, 1, 2], [2, 0, 1]):
        scene = pod_scene(lines, fleet=fleet)
        run = Simulation(scene, storage=np.array(storage))
        run.run()
        digests.append((run.tick, run.world.lines.done.tolist(), run.digest))
    assert digests[0] == digests[1]
