"""Warnings about stations and pods, and none for what is well."""

from __future__ import annotations

from typing import Any

import pytest
from pod_scenes import pod_scene

from automaton.world.fleet_warnings import pod_warnings
from automaton.world.resolve import resolve

LINE = {"pod": 1}
ONE_LANE = """\
>>>>>>>>>v
^#pppp#q#v
^########v
^<<t<<t<<<"""
A, B = {"at": [6, 3], "queue": [[7, 3], [8, 3]]}, {"at": [3, 3], "queue": [[4, 3]]}


def warned(**parts: Any) -> list[str]:
    return pod_warnings(pod_scene([LINE], **parts))


def robots(count: int) -> dict[str, Any]:
    return {"robots": count, "kinematics": "omni", "start": [[x, 0] for x in range(count)]}


@pytest.mark.parametrize("name", ["goods-mini", "goods-60x40", "goods-to-person"])
def test_shipped_scenarios_with_pods_are_well(name: str) -> None:
    assert pod_warnings(resolve(name)) == []


def test_a_station_lets_more_come_than_its_queue_holds() -> None:
    queue = {"at": [5, 3], "queue": [[6, 3], [8, 3]]}
    assert warned(stations={"P1": {**queue, "max_trips": 4}}) == []
    assert warned(stations={"P1": {**queue, "max_trips": None}}) == []
    assert warned(stations={"P1": {**queue, "max_trips": 5}}) == [
        "station P1 admits 5 trips (max_trips) but has room for 4 robots, in its queue and "
        "itself: the others wait in the aisles"
    ]


def test_a_queue_on_the_way_to_another_station() -> None:
    found = warned(picture=ONE_LANE, stations={"A": A, "B": B})
    assert [text.partition(":")[0] for text in found] == [
        "the queue of station A is on the only route between [2, 1] and station B",
        "the queue of station B is on the only route between [2, 1] and station A",
    ]


def test_more_robots_than_places() -> None:
    station = {"P1": {"at": [5, 3], "max_trips": 2}}
    assert warned(stations=station, fleet=robots(2)) == [
        "station P1 admits 2 trips (max_trips) but has room for 1 robot, in its queue and "
        "itself: the others wait in the aisles"
    ]
    assert warned(stations={"P1": {"at": [5, 3]}}, fleet=robots(3)) == [
        "3 robots, but stations admit 1 trip at a time: the other robots stay idle"
    ]


def test_robots_that_stay_under_pods_where_others_may_not_come() -> None:
    """The allocation of these scenes says idle: stay."""
    assert warned(fleet=robots(2)) == []
    (text,) = warned(fleet=robots(2), pods={"under": "none"})
    assert text.startswith("idle robots stay under the pods") and "idle: park" in text
    parking = {"allocation": "shortest-job", "right_of_way": "wait"}
    assert warned(fleet=robots(2), pods={"under": "none"}, strategy=parking) == []
