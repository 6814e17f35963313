"""The validator on pods: a recording made by hand that keeps the rules, and one for each rule broken."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from handmade_recordings import E, N, S, W, header, played, recorded, rules

from automaton.engine.record_codes import (
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    CHANGE_SLOT_RESERVED,
    CHANGE_VISITED,
    EXECUTED_DROP,
    EXECUTED_PICK,
    EXECUTED_SERVE,
)
from automaton.recording.contents import FRAME_KIND_KEYFRAME
from automaton.verification.validator import Report, validate_stored
from automaton.verification.verification import verify_recording

PICK, SERVE, DROP = EXECUTED_PICK, EXECUTED_SERVE, EXECUTED_DROP
FLOOR = """\
ppq
.tt"""
LINE = {"pod": 1, "station": 1}
Row = tuple[int, int, int, int]


def floor(
    *lines: dict[str, Any], robots: int = 1, line: Any = 2, stations: Any = None, **pods: Any
) -> dict[str, Any]:
    """Robot 0 stands under pod 1 (trip 0), robot 1 under pod 2; a visit takes `line` for each line."""
    return header(
        FLOOR,
        [(0, 0), (1, 0)][:robots],
        orders={"lines": list(lines or (LINE,))},
        durations={"move": 1, "turn": 1, "pick": 1, "drop": 1, "handling": {"line": line}},
        stations=stations or {},
        pods=pods,
        strategy={"allocation": "first-come"},
        stop={"when": "delivered", "max_duration": 100},
    )


def reserved(tick: int, trip: int, r: int) -> Row:
    return tick, CHANGE_ORDER_RESERVED, trip, r


OFFERED = TAKEN = reserved(1, 0, 0)
PICKED = (1, CHANGE_PICKED, 0, 0)
LIFTED = [OFFERED, TAKEN, PICKED]
SERVED = [(4, CHANGE_DURATION, 0, 2), (5, CHANGE_VISITED, 0, 0)]
STORED = [
    (6, CHANGE_SLOT_RESERVED, 0, 0),
    (8, CHANGE_DROPPED, 0, 0),
    reserved(8, 0, -1),
    (8, CHANGE_SLOT_RESERVED, 0, -1),
]
WAY = [PICK, S, E, SERVE, 0, W, N, DROP]  # what robot 0 does


def told(head: dict[str, Any], rows: list[Row], *ways: list[int], **end: bool) -> Report:
    """The report on robots that do this from tick 1 on."""
    acts = [{r: way[t] for r, way in enumerate(ways) if t < len(way)} for t in range(len(ways[0]))]
    return played(head, *acts, changes=sorted(rows, key=lambda row: row[0]), **end)


def broken(head: dict[str, Any], rows: list[Row], *ways: list[int]) -> list[str]:
    return rules(told(head, rows, *ways))


def is_refused(head: dict[str, Any], rows: list[Row], *ways: list[int]) -> bool:
    """Whether the length of a visit is not what the rules give."""
    return any("recorded as served" in one.text for one in told(head, rows, *ways).violations)


def test_a_trip_by_the_rules() -> None:
    report = told(floor(), [*LIFTED, *SERVED, *STORED], WAY, finished=True)
    assert report.violations == [] and report.counts["visit"] == 1


def test_no_robot_with_a_load_drives_under_a_pod() -> None:
    assert broken(floor(), LIFTED, [PICK, E]) == ["pod"]


def test_a_pod_is_stored_in_a_cell_of_storage() -> None:
    slot = 2 + 1  # that of the first station
    rows = [*LIFTED, *SERVED, (6, CHANGE_DROPPED, 0, slot), reserved(6, 0, -1)]
    assert "load" in broken(floor(), rows, [*WAY[:5], DROP])


def test_the_trip_of_a_pod_is_kept_for_who_stands_beneath() -> None:
    assert broken(floor(), [], [0]) == ["order"]
    assert broken(floor(), [OFFERED], [0]) == []
    assert "order" in broken(floor(robots=2), [OFFERED, reserved(1, 0, 1)], [0], [0])


def listed(*orders: dict[str, Any], robots: int = 1) -> dict[str, Any]:
    """As `floor`, with orders of a list that carry the pods."""
    head = floor(robots=robots)
    return header(
        FLOOR,
        [(0, 0), (1, 0)][:robots],
        orders={"list": list(orders)},
        durations=head["scenario"]["durations"],
        strategy={"allocation": "first-come"},
        stop={"when": "delivered", "max_duration": 100},
    )


TO_STATION = {"from": [0, 0], "stops": [{"at": [1, 1], "for": 2}]}


def test_an_order_of_a_list_carries_its_pod_by_the_rules() -> None:
    report = told(listed(TO_STATION), [*LIFTED, *SERVED, *STORED], WAY, finished=True)
    assert report.violations == [] and report.counts["visit"] == 1
    short = [*LIFTED, (4, CHANGE_DURATION, 0, 1), (4, CHANGE_VISITED, 0, 0)]
    assert "visit" in broken(listed(TO_STATION), short, WAY[:4])


def test_a_pod_has_one_order_of_a_list_at_a_time() -> None:
    """Order 1 waits for the pod of order 0; the pod of order 2 is another one."""
    orders = (TO_STATION, TO_STATION, {"from": [1, 0], "stops": [[2, 1]]})
    kept = reserved(1, 2, 1)
    assert broken(listed(*orders, robots=2), [OFFERED, kept], [0], [0]) == []
    second = [reserved(1, 1, 0), kept]
    assert "order" in broken(listed(*orders, robots=2), second, [0], [0])


def test_an_order_with_a_target_is_done_there_alone() -> None:
    """The robot stores the pod in [0, 0]: there the order waits again, and the run is not over."""
    rows = [*LIFTED, *SERVED, *STORED]
    elsewhere = {**TO_STATION, "to": [2, 0]}
    assert rules(told(listed({**TO_STATION, "to": [0, 0]}), rows, WAY, finished=True)) == []
    assert rules(told(listed(elsewhere), rows, WAY, finished=True)) == ["record"]


def test_a_line_by_sku_is_for_the_nearest_pod() -> None:
    """Pod 2 is a cell from station 1, pod 1 two; the robot beneath pod 2 has the trip."""
    pods = [{"at": [0, 0], "skus": ["X"]}, {"at": [1, 0], "skus": ["X"]}]
    head = floor({"sku": "X", "station": 1}, robots=2, list=pods)
    assert broken(head, [reserved(1, 0, 1)], [0], [0]) == []
    assert "order" in broken(head, [reserved(1, 0, 0)], [0], [0])


def test_it_is_kept_until_that_robot_leaves() -> None:
    withdrawn = reserved(2, 0, -1)
    assert broken(floor(), [OFFERED, withdrawn], [0, S]) == []
    assert broken(floor(), [OFFERED, withdrawn], [0, 0]) == ["order"]
    assert broken(floor(), [OFFERED], [0, S]) == ["order"]


def test_it_is_kept_until_that_robot_has_another_if_only_for_a_moment() -> None:
    """It is sent to a charger in the tick in which it takes the other trip, and has to turn first."""
    head = floor(LINE, {"pod": 2, "station": 1})
    moment = [reserved(2, 1, 0), reserved(2, 1, -1)]
    assert broken(head, [OFFERED, reserved(2, 0, -1), *moment], [0, 0]) == []
    assert broken(head, [OFFERED, reserved(2, 0, -1)], [0, 0]) == ["order"]
    later = [reserved(3, 1, 0), reserved(3, 1, -1)]
    assert broken(head, [OFFERED, reserved(2, 0, -1), *later], [0, 0, 0]) == ["order"]


def test_trips_are_numbered_as_their_lines_become_known() -> None:
    lines = {"pod": 2, "station": 1}, LINE
    rows = [reserved(1, 0, 0), reserved(1, 0, 0), PICKED]
    assert "order" in broken(floor(*lines), rows, [PICK])
    mine = [reserved(1, 1, 0), reserved(1, 1, 0), (1, CHANGE_PICKED, 0, 1)]
    assert broken(floor(*lines), mine, [PICK]) == []


def test_a_trip_is_known_with_its_line() -> None:
    late = {**LINE, "release": 2}
    assert "order" in broken(floor(late), LIFTED, [PICK])
    assert broken(floor(late), [reserved(2, 0, 0)], [0, 0]) == []


@pytest.mark.parametrize(
    ("line", "ticks"), [(2, 2), (2.5, 3), (2.4, 2), (0.1, 1), (2.499999, 2), (2.4999999, 3)]
)
def test_a_visit_lasts_as_long_as_its_lines_take(line: float, ticks: int) -> None:
    for recorded_ticks in (ticks - 1, ticks, ticks + 1):
        rows = [*LIFTED, (4, CHANGE_DURATION, 0, recorded_ticks)]
        assert is_refused(floor(line=line), rows, WAY[:4]) == (recorded_ticks != ticks)


@pytest.mark.parametrize(("join", "release", "ticks"), [(True, 3, 4), (False, 3, 2), (True, 5, 2)])
def test_a_line_joins_a_stop_that_is_not_begun(join: bool, release: int, ticks: int) -> None:
    head = floor(LINE, {**LINE, "release": release}, join=join)
    for recorded_ticks in (2, 4):
        rows = [*LIFTED, (4, CHANGE_DURATION, 0, recorded_ticks)]
        assert is_refused(head, rows, WAY[:4]) == (recorded_ticks != ticks)


@pytest.mark.parametrize(("most", "goes_on"), [(1, False), (2, True)])
def test_a_line_of_another_station_appends_a_stop(most: int, goes_on: bool) -> None:
    head = floor(LINE, {**LINE, "station": 2, "release": 5}, max_stops=most)
    second = [(7, CHANGE_DURATION, 0, 2), (8, CHANGE_VISITED, 0, 0)]
    found = broken(head, [*LIFTED, *SERVED, *second], [*WAY[:5], E, SERVE, 0])
    assert ("visit" not in found) == goes_on


def test_a_stop_is_done_once() -> None:
    assert "visit" in broken(floor(), [*LIFTED, *SERVED, (6, CHANGE_VISITED, 0, 0)], [*WAY[:5], 0])


def test_a_stop_that_is_over_is_told() -> None:
    assert "visit" in broken(floor(), [*LIFTED, SERVED[0]], WAY[:5])


def test_no_visit_begins_in_a_break() -> None:
    head = floor(stations={"P1": {"at": [1, 1], "breaks": [{"from": 4, "for": 1}]}})
    assert broken(head, [*LIFTED, SERVED[0]], WAY[:4]) == ["visit"]
    later = [*LIFTED, (5, CHANGE_DURATION, 0, 2)]
    assert broken(head, later, [*WAY[:3], 0, SERVE]) == []


def test_a_station_serves_one_robot() -> None:
    head = floor(LINE, {"pod": 2, "station": 1}, robots=2, stations=places(None))
    # As if two robots had room in its cell.
    head["floor"]["capacity"] = head["floor"]["capacity"] * 0
    both = [row for r in (0, 1) for row in ([reserved(1, r, r)] * 2)]
    rows = [*sorted(both[::2]), *both[1::2], PICKED, (1, CHANGE_PICKED, 1, 1)]
    rows += [(4, CHANGE_DURATION, 0, 2), (4, CHANGE_DURATION, 1, 2)]
    assert broken(head, rows, [PICK, S, E, SERVE], [PICK, S, 0, SERVE]) == ["visit"]


def places(first: int | None, second: int | None = None) -> dict[str, Any]:
    return {
        "P1": {"at": [1, 1], "max_trips": first},
        "P2": {"at": [2, 1], "max_trips": second},
    }


@pytest.mark.parametrize(("most", "found"), [(1, ["place"]), (2, []), (None, [])])
def test_a_station_has_so_many_places(most: int | None, found: list[str]) -> None:
    head = floor(LINE, {"pod": 2, "station": 1}, robots=2, stations=places(most))
    rows = [reserved(1, 0, 0), reserved(1, 1, 1), reserved(1, 0, 0), reserved(1, 1, 1)]
    assert broken(head, rows, [0], [0]) == found


def test_a_place_is_free_when_its_robot_has_left_the_station() -> None:
    lines = LINE, {"pod": 2, "station": 1}
    head = floor(*lines, robots=2, stations=places(1))
    rows = [reserved(1, 0, 0), reserved(1, 1, 1), TAKEN, PICKED, *SERVED]
    away = [*WAY[:5], W, 0]
    assert broken(head, [*rows, reserved(7, 1, 1)], away, [0] * 7) == []
    assert broken(head, [*rows, reserved(6, 1, 1)], away, [0] * 7) == ["place"]


@pytest.mark.parametrize("most", [1, 2])
def test_a_trip_ends_where_its_next_station_has_no_place(most: int) -> None:
    lines = LINE, {"pod": 2, "station": 2}, {**LINE, "station": 2}
    head = floor(*lines, robots=2, stations=places(None, most))
    rows = [reserved(1, 0, 0), reserved(1, 1, 1), TAKEN, reserved(1, 1, 1), PICKED, *SERVED]
    on = [*rows, (7, CHANGE_DURATION, 0, 2)]
    found = broken(head, on, [*WAY[:5], E, SERVE], [0] * 7)
    assert ("visit" in found) == (most == 1)
    ended = broken(head, [*rows, *STORED], WAY, [0] * 8)
    assert ("visit" in ended) == (most == 2)


def test_lines_that_wait_make_a_trip_in_the_tick_after_their_pod_is_stored() -> None:
    head = floor(LINE, LINE, join=False)
    rows = [*LIFTED, *SERVED, *STORED]
    assert broken(head, [*rows, reserved(9, 1, 0)], [*WAY, 0]) == []
    assert "order" in broken(head, [*rows, reserved(8, 1, 0)], [*WAY, 0])
    assert broken(head, rows, [*WAY, 0]) == ["order"]


def test_a_run_is_over_when_lines_are_done_and_pods_stored() -> None:
    report = told(floor(), [*LIFTED, *SERVED, STORED[0]], WAY[:7], finished=True)
    assert rules(report) == ["record"]


PARTS = (
    *("pods.slot", "pods.trip", "pods.first_line"),
    *("lines.served_at", "lines.trip", "lines.done", "orders.release_tick"),
    *("trips.begun", "trips.station", "trips.place", "trips.leaving", "trips.offered"),
    *("pod_stations.taken", "pod_stations.open_lines"),
)


@pytest.fixture(scope="module")
def mini() -> Any:
    return recorded("goods-mini")


def test_a_recorded_run_with_pods_is_verified(mini: Any) -> None:
    assert verify_recording(mini).passed


@pytest.mark.parametrize("name", PARTS)
def test_a_state_is_what_follows_from_the_lines(mini: Any, name: str) -> None:
    part, array = name.split(".")
    altered = copy.deepcopy(mini)
    state = [frame for frame in altered.frames if frame.kind == FRAME_KIND_KEYFRAME][-1]
    values = state.content[part][array].copy()
    values[0] += np.ones(1, values.dtype)[0]
    state.content[part][array] = values
    texts = [str(one) for one in validate_stored(altered).violations]
    assert texts == [text for text in texts if f"{name}[0]" in text] and texts
