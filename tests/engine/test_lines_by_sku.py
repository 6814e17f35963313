"""Lines that want a SKU: which pod has it follows by rule."""

from __future__ import annotations

from typing import Any

import pytest
from pod_scenes import line_ticks, played, pod_scene, trips

from automaton.runs.simulation import Simulation

CELLS = [
    [2, 1],
    [3, 1],
    [4, 1],
    [5, 1],
]  # of the ring; the station is at [5, 3], beyond the right end
PODS = [
    {"at": at, "skus": list(skus)} for at, skus in zip(CELLS, ["ab", "bc", "c", "c"], strict=True)
]


def scene(lines: list[dict[str, Any]], **more: Any) -> Any:
    return pod_scene(lines, pods={"list": PODS, **more})


def taken_from(run: Simulation) -> list[int]:
    """The pod of each line, from 1."""
    return [int(pod) + 1 for pod in run.world.lines.taken_from]


def sku(name: str, **more: Any) -> dict[str, Any]:
    return {"sku": name, "station": "P1", **more}


def test_the_nearest_pod_in_storage_has_it() -> None:
    """The way from [5, 1] leads over 12 cells, from [4, 1] over 13."""
    run = played(scene([sku("c")]), until=1)
    assert run.world.pod_stations.ticks_from[0, run.world.pods.home].tolist() == [15, 14, 13, 12]
    assert taken_from(run) == [4]


def test_a_pod_that_can_be_joined_comes_before_a_nearer_one() -> None:
    run = played(scene([{"pod": 2}, sku("c", release=5)]))
    assert taken_from(run) == [2, 2]
    assert trips(run) == [[0, 1]]


def test_a_trip_whose_visit_has_begun_cannot_be_joined() -> None:
    run = played(scene([{"pod": 2}, sku("c", release=30)]))
    assert taken_from(run) == [2, 4]


def test_without_joining_it_is_the_nearest_one() -> None:
    run = played(scene([{"pod": 2}, sku("c", release=5)], join=False))
    assert taken_from(run) == [2, 4]


def test_of_pods_under_way_it_is_the_one_with_the_fewest_open_lines() -> None:
    """Both pods with b are on their way; the first has two lines."""
    lines = [{"pod": 1}, {"pod": 1}, {"pod": 2}, sku("b", release=2)]
    run = played(scene(lines, join=False))
    assert taken_from(run) == [1, 1, 2, 2]
    assert run.world.pods.open_lines.tolist() == [0, 0, 0, 0], "all are done"


def test_a_pod_of_its_own_comes_before_a_sku() -> None:
    run = played(scene([{"pod": 1, "sku": "c", "station": "P1"}]))
    assert taken_from(run) == [1]
    assert line_ticks(run) == [58 - 20]


@pytest.mark.parametrize("payload", [3, 4])
def test_a_trip_weighs_what_its_pod_weighs(payload: int) -> None:
    """One of two robots carries the pod; the other one stands beneath it."""
    pods = [{"at": CELLS[0], "weight": 4}]
    fleet = {
        "kinematics": "omni",
        "types": [
            {"name": "weak", "robots": 1, "payload": payload},
            {"name": "strong", "robots": 1, "payload": 5},
        ],
        "robots": 2,
        "start": [[2, 1], [3, 1]],
    }
    picture = ">>>>>>>>>v\n^#pqqq#q#v\n^########v\n^<<<<t<<<<"
    run = played(pod_scene([{"pod": 1}], pods={"list": pods}, fleet=fleet, picture=picture), 2)
    assert run.world.orders.weight[0] == 4
    assert run.world.robots.order.tolist() == ([-1, 0] if payload == 3 else [0, -1])
