"""Pods, stations, queues and lines that do not fit: one sentence each."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest
from pod_scenes import RING, pod_scenario, pod_scene

from automaton.errors import InputError
from automaton.scenario.schema import Scenario
from automaton.world.resolve import resolve

LINE = {"pod": 1, "station": "P1"}


def refused(lines: Any = (LINE,), **parts: Any) -> str:
    with pytest.raises(InputError) as error:
        pod_scene(list(lines) if isinstance(lines, tuple) else lines, **parts)
    return error.value.message


@pytest.mark.parametrize(
    ("station", "says"),
    [
        ({"at": [1, 1]}, "station P1 is at [1, 1], but a wall is there, not a station"),
        ({"at": [50, 1]}, "it lies outside"),
        ({"at": [5, 3], "queue": [[7, 2]]}, "along neither a row nor a column"),
        ({"at": [5, 3], "queue": [[12, 3]]}, "[12, 3] lies outside the floor"),
        ({"at": [5, 3], "queue": [[4, 3]]}, "breaks at [4, 3]: from there no robot drives east"),
        ({"at": [5, 3], "queue": [[8, 3], [6, 3]]}, "contains [7, 3] twice"),
    ],
)
def test_a_station_and_its_queue(station: dict[str, Any], says: str) -> None:
    assert says in refused(stations={"P1": station})


def test_two_names_for_a_station() -> None:
    stations = {"P1": {"at": [5, 3]}, "P2": {"at": [5, 3]}}
    assert refused(stations=stations) == "stations P1 and P2 are both at [5, 3]"


def test_a_queue_that_touches_another() -> None:
    picture = ">>>>>>>>>v\n^#pppp#q#v\n^########v\n^<<t<<t<<<"
    stations = {"A": {"at": [3, 3], "queue": [[5, 3]]}, "B": {"at": [6, 3], "queue": [[8, 3]]}}
    pod_scene([{"pod": 1}], picture=picture, stations=stations)
    longer = {**stations, "A": {"at": [3, 3], "queue": [[6, 3]]}}
    says = refused([{"pod": 1}], picture=picture, stations=longer)
    assert says == "the queue of A contains [6, 3], which is a station"


def test_no_place_at_a_station() -> None:
    scenario = pod_scenario([LINE], stations={"P1": {"at": [5, 3], "max_trips": 0}})
    with pytest.raises(msgspec.ValidationError, match=">= 1"):
        msgspec.convert(scenario, Scenario)


def test_a_pod_or_a_station_that_there_is_not() -> None:
    says = refused(({"pod": 5},))
    assert says.startswith("'5' is not a pod: there are 4 pods, numbered from 1")
    says = refused(({"pod": 1, "station": "P2"},))
    assert says == "'P2' is not a station; there are P1, 1"


def test_pods_without_a_way_for_their_robots() -> None:
    """Pod 4 is behind other pods."""
    picture = ">>>>>>>>>v\n^#ppp##q#v\n^#p######v\n^########v\n^<<<<t<<<<"
    says = refused(picture=picture, stations={"P1": {"at": [5, 4]}})
    assert says.startswith(
        "pod 4 at (2, 2) has no route to station 1 at (5, 4) and back that avoids"
    )


def test_classes_that_are_none_or_do_not_add_up() -> None:
    drawn = {"count": 5, "classes": {"A": 0.5, "X": 0.5}}
    says = refused(drawn, pods={"classes": {"A": 0.5, "B": 0.5}})
    assert says == "'X' is not a class of pods: pods.classes has A, B"
    with pytest.raises(Exception, match=r"must add up to 1, found 0\.9"):
        pod_scene([LINE], pods={"classes": {"A": 0.5, "B": 0.4}})


def test_lines_without_pods_or_stations() -> None:
    assert "the floor has none; draw them as p" in refused(picture=RING.replace("p", "q"))
    plain = RING.replace("t", "<")
    assert "lines need stations, but the floor has none" in refused(picture=plain, stations={})


def test_stations_without_lines() -> None:
    text = "orders.lines"
    with pytest.raises(InputError, match=text):
        resolve("tabletop-mini", ("stations={P1: {at: [1, 1]}}",))


def listed(*pods: dict[str, Any], **more: Any) -> dict[str, Any]:
    drawn = [{"at": [x, 1]} for x in (2, 3, 4, 5)]
    return {"list": [*drawn, *pods], **more}


def test_listed_pods_stand_in_storage_one_in_each_cell() -> None:
    pods = listed({"at": [1, 1], "name": "A"})
    assert refused(pods=pods) == "pod A stands at [1, 1], but a wall is there, not storage"
    pods = listed({"at": [2, 1]})
    assert refused(pods=pods) == "pod 1 and pod 5 both stand at [2, 1]"
    pods = listed({"at": [7, 1], "name": "A"}, {"at": [7, 1], "name": "A"})
    assert refused(pods=pods) == "pod A and pod A both stand at [7, 1]"


def test_pods_with_the_same_name_or_without_their_classes() -> None:
    pods = {"list": [{"at": [x, 1], "name": "A"} for x in (2, 3, 4, 5)]}
    assert refused(pods=pods) == "two pods are called A"
    pods = {"list": [{"at": [x, 1], "class": "Z"} for x in (2, 3, 4, 5)], "classes": {"A": 1}}
    assert refused(pods=pods) == "'Z' is not a class of pods: pods.classes has A"
    pods = listed({"at": [7, 1], "class": "A"}, classes={"A": 1})
    assert refused(pods=pods) == "pod 1 has no class, but other pods have one"


def test_a_pod_that_is_drawn_and_not_listed() -> None:
    says = refused(pods={"list": [{"at": [2, 1]}]})
    assert says == "the layout has a pod at [3, 1], but pods.list has none there: draw it as q"


def test_a_line_by_sku_that_no_pod_holds() -> None:
    assert refused(({"sku": 7},)) == (
        "'7' is not a SKU of a pod: pods have none; set skus in pods.list"
    )
    pods = {"list": [{"at": [x, 1], "skus": ["apple"]} for x in (2, 3, 4, 5)]}
    assert refused(({"sku": "appel"},), pods=pods) == (
        "'appel' is not a SKU of a pod (did you mean 'apple'?)"
    )
    with pytest.raises(msgspec.ValidationError, match="a line needs a pod or a sku"):
        pod_scene([{"station": "P1"}])


def test_a_pod_that_no_robot_carries() -> None:
    fleet = {
        "robots": 1,
        "kinematics": "omni",
        "start": [[2, 1]],
        "types": [{"name": "lift", "robots": 1, "payload": 9}],
    }
    pods = listed({"at": [7, 1], "weight": 10, "name": "A"})
    says = refused(pods=pods, fleet=fleet)
    assert says == "pod A weighs 10, but no robot carries more than 9"


# The pods weigh 5, which a robot on rails alone carries; it does not turn at [2, 0].
BENT = """\
p..-+.t
##.#.##
##.#.##"""


def carried_by_rail(stop: list[int]) -> None:
    types = [
        {"name": "tug", "robots": 1, "kinematics": "rail", "payload": 5},
        {"name": "amr", "robots": 1, "kinematics": "differential", "payload": 1},
    ]
    order = {"from": [0, 0], "stops": [stop], "to": [0, 0]}
    parts = {
        "layout": {"picture": BENT},
        "fleet": {"robots": 2, "start": [[4, 0], [5, 0]], "types": types},
        "pods": {"list": [{"at": [0, 0], "weight": 5}]},
        "orders": {"list": [order]},
        "stations": {},
    }
    resolve(msgspec.convert(pod_scenario([], **parts), Scenario))


def test_a_pod_goes_where_the_robots_that_carry_it_drive() -> None:
    carried_by_rail([6, 0])
    carried_by_rail([4, 2])  # over the turntable
    with pytest.raises(InputError, match=r"the pod at \[0, 0\] has no route to \[2, 2\] and back"):
        carried_by_rail([2, 2])
