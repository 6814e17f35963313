"""Orders of a list that carry pods, tick by tick."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from pod_scenes import pod_scenario

from automaton.engine.state import (
    ACTION_STATION_QUEUE,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_UNRELEASED,
    ORDER_WAITING,
)
from automaton.errors import InputError
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.world.resolve import Resolved, resolve

POD_1, POD_2, EMPTY, STATION = [2, 1], [3, 1], [7, 1], [5, 3]
VISIT = {"at": STATION, "for": 20}


def scene(*orders: dict[str, Any], **parts: Any) -> Resolved:
    scenario = pod_scenario([], **parts)
    return resolve(msgspec.convert({**scenario, "orders": {"list": list(orders)}}, Scenario))


def played(*orders: dict[str, Any], until: int | None = None, **parts: Any) -> Simulation:
    run = Simulation(scene(*orders, **parts))
    run.run(until)
    return run


def cells_of_pods(run: Simulation) -> list[tuple[int, int]]:
    slots, floor_plan = run.world.slots.cell, run.resolved.floor_plan
    return [floor_plan.xy(int(slots[slot])) for slot in run.world.pods.slot]


def test_a_pod_is_carried_over_its_stop_and_back() -> None:
    """Pick 3, 15 moves, 20 at the station, 11 moves, set-down 3."""
    run = played({"from": POD_1, "stops": [VISIT]})
    assert run.finished and run.world.stops.done.tolist() == [38]
    assert run.world.orders.delivered.tolist() == [50], "in the first tick of the set-down"
    assert cells_of_pods(run)[0] == (2, 1)
    assert run.world.tally.illegal.sum() == 0


def test_without_to_allocation_says_where_it_goes() -> None:
    allocation = {"allocation": {"name": "shortest-job", "storage": "nearest"}}
    run = played({"from": POD_1, "stops": [VISIT]}, strategy={**allocation, "right_of_way": "wait"})
    assert cells_of_pods(run)[0] == (2, 1), "the first on the way from the station"


def test_with_to_it_goes_there_whatever_the_policy() -> None:
    run = played({"from": POD_1, "stops": [VISIT], "to": EMPTY})
    assert cells_of_pods(run)[0] == (7, 1)
    run = played({"from": POD_1, "to": EMPTY})
    assert cells_of_pods(run)[0] == (7, 1), "without a stop, too"


def test_to_may_be_where_it_stands() -> None:
    run = played({"from": POD_1, "stops": [VISIT], "to": POD_1})
    assert run.finished and cells_of_pods(run)[0] == (2, 1)


def test_an_order_follows_its_pod_to_where_that_is() -> None:
    """Both name the pod by where it stands at the start; the second waits for the first."""
    run = Simulation(scene({"from": POD_1, "to": EMPTY}, {"from": POD_1, "stops": [VISIT]}))
    run.run(10)
    assert run.world.orders.state.tolist() == [ORDER_CARRIED, ORDER_UNRELEASED]
    assert run.world.pods.first_line.tolist() == [1, NIL, NIL, NIL]
    stored = 0
    while not stored:
        run.run(run.tick + 1)
        stored = int(run.world.orders.state[0] == ORDER_DELIVERED) * run.tick
    assert run.world.orders.state[1] == ORDER_UNRELEASED, "it is known in the next tick"
    run.run(stored + 1)
    assert run.world.orders.state[1] == ORDER_WAITING
    assert run.world.orders.reserved_by[1] == 0, "kept for the robot that stands beneath"
    assert run.resolved.floor_plan.xy(int(run.world.slots.cell[run.world.orders.source[1]])) == (
        7,
        1,
    )
    run.run()
    assert run.finished and cells_of_pods(run)[0] == (2, 1), "fixed: where it stood at the start"


def test_orders_of_one_pod_go_by_their_releases() -> None:
    late, soon = {"from": POD_1, "stops": [VISIT], "release": 9}, {"from": POD_1, "to": EMPTY}
    run = played(late, soon, {"from": POD_1, "stops": [VISIT], "release": 4})
    assert np.argsort(run.world.orders.delivered).tolist() == [1, 2, 0]


def test_tours_may_stand_among_them() -> None:
    run = played({"stops": [[9, 2]]}, {"from": POD_1, "stops": [VISIT]}, {"stops": [[0, 0]]})
    assert run.finished and metrics_of(run)["delivered"] == 3


def test_robots_with_listed_pods_queue_and_heed_breaks() -> None:
    fleet = {"robots": 2, "kinematics": "omni", "start": [POD_1, POD_2]}
    stations = {
        "P1": {"at": STATION, "queue": [[6, 3], [8, 3]], "breaks": [{"from": 0, "for": 30}]}
    }
    orders = [{"from": POD_1, "stops": [VISIT]}, {"from": POD_2, "stops": [VISIT]}]
    run = played(*orders, fleet=fleet, stations=stations)
    assert run.world.stops.done.tolist() == [69 + 1, 49], "the first begins in tick 30"
    assert run.world.tally.ticks[:, ACTION_STATION_QUEUE].sum() > 0
    assert run.world.pod_stations.taken.tolist() == [0], "they need no places"


REFUSED = [
    ({"from": EMPTY, "stops": [VISIT]}, "no pod stands at [7, 1] at the start"),
    ({"from": POD_1, "to": [0, 0]}, "the order of a pod ends in storage, but [0, 0] is a floor"),
    ({"from": POD_1, "to": [50, 0]}, "ends in storage, but [50, 0] lies outside"),
    ({"from": POD_1, "to": POD_1}, "an order ends where it begins"),
    ({"from": POD_1, "stops": [[1, 1]]}, "the stop [1, 1] is a wall: robots do not drive there"),
    ({"from": STATION, "to": POD_1}, "order 1 takes a load at [5, 3], but other orders carry pods"),
]


@pytest.mark.parametrize(("order", "says"), REFUSED)
def test_orders_that_cannot_be(order: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError) as error:
        scene({"from": POD_2}, order)
    assert says in error.value.message


@pytest.mark.parametrize(
    ("orders", "says"),
    [
        (
            [{"from": POD_1, "to": POD_2}],
            "order 0 brings pod 1 to [3, 1], where pod 2 stays: no order carries it away",
        ),
        (
            [{"from": POD_1, "to": EMPTY}, {"from": POD_2, "stops": [VISIT], "to": EMPTY}],
            "order 1 brings pod 2 to [7, 1], where pod 1 stays: order 0 brings it there",
        ),
        (
            [{"from": POD_2, "to": EMPTY, "release": 9}, {"from": POD_2, "to": POD_1}],
            "order 1 brings pod 2 to [2, 1], where pod 1 stays: no order carries it away",
        ),
    ],
)
def test_two_pods_that_would_stay_in_one_cell(orders: list[dict[str, Any]], says: str) -> None:
    with pytest.raises(InputError) as error:
        scene(*orders)
    assert error.value.message == f"{says}; choose another cell"


def test_pods_may_change_places_and_follow_each_other() -> None:
    fleet = {"robots": 2, "kinematics": "omni", "start": [POD_1, [5, 1]]}
    run = played({"from": POD_1, "to": [5, 1]}, {"from": [5, 1], "to": POD_1}, fleet=fleet)
    assert run.finished and cells_of_pods(run) == [(5, 1), (3, 1), (4, 1), (2, 1)]
    third = [4, 1]
    assert scene(
        {"from": POD_2, "to": POD_1}, {"from": POD_1, "to": third}, {"from": third, "to": EMPTY}
    )


def test_a_load_that_is_no_pod_needs_to() -> None:
    with pytest.raises(InputError, match="only the order of a pod, from storage, may leave it out"):
        resolve("tabletop-mini", ("orders={list: [{from: [1, 1]}]}",))


def test_a_pod_without_a_way_over_aisles() -> None:
    """Pod 4 is behind other pods; the first three are not."""
    picture = ">>>>>>>>>v\n^#ppp##q#v\n^#p######v\n^########v\n^<<<<t<<<<"
    stations = {"P1": {"at": [5, 4]}}
    order = {"from": [2, 2], "stops": [[5, 4]]}
    with pytest.raises(InputError) as error:
        scene(order, picture=picture, stations=stations)
    assert error.value.message == (
        "the pod at [2, 2] has no route to [5, 4] and back that avoids other storage"
    )
    assert scene({"from": [3, 1], "to": [7, 1]}, picture=picture, stations=stations)


@pytest.mark.parametrize("allocation", ["auction", "cooperative"])
def test_an_allocation_that_does_not_know_pods(allocation: str) -> None:
    with pytest.raises(InputError, match="it does not support pods"):
        scene({"from": POD_1}, strategy={"allocation": allocation, "right_of_way": "wait"})
