"""The validator on stops: a recording made by hand for each rule, and altered ones of runs."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from drawn_scenes import recorded_run, scene
from handmade_recordings import E, W, header, played, rules

from automaton.engine.record_codes import CHANGE_ORDER_RESERVED, CHANGE_VISITED
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.verification.validator import validate_stored
from automaton.verification.verification import verify_recording

# A stands at (0, 0), B at (3, 0). Order 0: (1, 0), (2, 0); order 1: (0, 0) twice.
TOURS = {"list": [{"stops": [[1, 0], [2, 0]]}, {"stops": [[0, 0], [0, 0]]}]}
TAKEN, FIRST, SECOND = (
    (1, CHANGE_ORDER_RESERVED, 0, 0),
    (1, CHANGE_VISITED, 0, 0),
    (2, CHANGE_VISITED, 0, 0),
)
OVER = (2, CHANGE_ORDER_RESERVED, 0, -1)


def corridor() -> dict[str, Any]:
    return header("....", [(0, 0), (3, 0)], orders=TOURS)


def test_stops_are_done_where_the_robot_stands() -> None:
    report = played(corridor(), {0: E}, {0: E}, changes=[TAKEN, FIRST, SECOND, OVER])
    assert report.valid and report.counts["visit"] == 2


@pytest.mark.parametrize(
    ("rule", "changes"),
    [
        ("visit", [TAKEN]),  # it stands there, and nothing is told
        ("visit", [TAKEN, FIRST]),  # the second one is not told
        ("visit", [FIRST]),  # it has no order
        ("visit", [TAKEN, FIRST, FIRST]),  # two in one tick, the second one elsewhere
        ("visit", [TAKEN, (1, CHANGE_VISITED, 1, 0)]),  # B has not got it
        ("order", [TAKEN, FIRST, (2, CHANGE_ORDER_RESERVED, 0, -1), SECOND]),  # given back, begun
        ("record", [TAKEN, FIRST, (1, CHANGE_ORDER_RESERVED, 1, 1)]),  # given out among stops
    ],
)
def test_what_no_rule_gives_is_told(rule: str, changes: list[tuple[int, int, int, int]]) -> None:
    assert rule in rules(played(corridor(), {0: E}, {0: E}, changes=changes))


def test_two_stops_in_one_cell_take_two_ticks() -> None:
    taken = (1, CHANGE_ORDER_RESERVED, 1, 0)
    visit, later = (1, CHANGE_VISITED, 0, 1), (2, CHANGE_VISITED, 0, 1)
    over = (2, CHANGE_ORDER_RESERVED, 1, -1)
    assert played(corridor(), {}, {}, changes=[taken, visit, later, over]).valid
    at_once = [taken, visit, visit, (1, CHANGE_ORDER_RESERVED, 1, -1)]
    assert "visit" in rules(played(corridor(), {}, {}, changes=at_once))


def test_an_order_that_is_not_begun_may_change_its_robot() -> None:
    passed = [(2, CHANGE_ORDER_RESERVED, 0, -1), (2, CHANGE_ORDER_RESERVED, 0, 1)]
    taken = (1, CHANGE_ORDER_RESERVED, 0, 0)
    assert played(corridor(), {1: W}, {0: 0}, changes=[taken, *passed]).valid


def test_each_robot_has_its_own_tasks_where_they_are_dealt_out() -> None:
    tasks = {"tasks": [[[1, 0]], [[2, 0]], [[0, 0]]], "assign": "round-robin"}
    head = header("....", [(0, 0), (3, 0)], orders=tasks)
    mine, other = (1, CHANGE_ORDER_RESERVED, 0, 0), (1, CHANGE_ORDER_RESERVED, 1, 0)
    visit, over = (1, CHANGE_VISITED, 0, 0), (1, CHANGE_ORDER_RESERVED, 0, -1)
    following = (2, CHANGE_ORDER_RESERVED, 2, 0)
    assert played(head, {0: E}, {}, changes=[mine, visit, over, following]).valid
    assert "order" in rules(played(head, {}, {}, changes=[other]))
    too_early = [(1, CHANGE_ORDER_RESERVED, 2, 0)]
    assert "order" in rules(played(head, {}, changes=too_early))


def altered(recording: Any, change: Any) -> Any:
    """A recording whose rows of visits were changed."""
    out = copy.deepcopy(recording)
    for frame in out.frames:
        if frame.kind == FRAME_KIND_TICKS:
            rows = frame.content["changes"]
            frame.content["changes"] = change(rows)
    return out


def without_one_visit(rows: Any) -> Any:
    return np.delete(rows, np.flatnonzero(rows[:, 1] == CHANGE_VISITED)[3], axis=0)


def by_another_robot(rows: Any) -> Any:
    rows[np.flatnonzero(rows[:, 1] == CHANGE_VISITED)[3], 2] ^= 1
    return rows


def of_another_order(rows: Any) -> Any:
    rows[np.flatnonzero(rows[:, 1] == CHANGE_VISITED)[3], 3] += 1
    return rows


@pytest.mark.parametrize("change", [without_one_visit, by_another_robot, of_another_order])
def test_an_altered_visit_is_found(change: Any) -> None:
    orders = {"generator": "tours", "count": 12, "stops": {"from": 1, "to": 3}}
    _, recorder = recorded_run(scene("......\n.##.#.\n......", [(0, 0), (5, 2)], orders=orders))
    recording = recorder.recording()
    assert verify_recording(recording).passed
    found = validate_stored(altered(recording, change))
    assert found.violations and {one.rule for one in found.violations} <= {
        "visit",
        "record",
        "order",
    }
