"""Why robots wait at gates, in one sentence each, and how maps and panels say it."""

from __future__ import annotations

from typing import Any

import pytest
from gate_scenes import gate_scene, watched

from automaton.history.explanation import explain
from automaton.history.snapshot import Snapshot, shut_cells, take_snapshot

AISLE = ".........."
START = [[0, 0], [4, 0]]
LIFT = {"shaft": [[3, 0], [6, 0]], "travel_time": 10, "door_time": 2}


def said(floor: dict[str, Any], tick: int, **parts: Any) -> str:
    scene = gate_scene(floor, (9, 0), (8, 0), picture=AISLE, **parts)
    return explain(take_snapshot(watched(scene, tick)), scene.floor_plan, 0).lines[0]


@pytest.mark.parametrize(
    ("floor", "start", "expected"),
    [
        (
            {"closed": [{"cells": [[3, 0]], "from": 1, "for": 40}]},
            START[:1],
            "(3, 0) is closed until tick 41, for 36 more ticks",
        ),
        (
            {"doors": [{"at": [3, 0], "opening_time": 6, "hold_open": 1}]},
            START[:1],
            "(3, 0) is a door that opens in tick 9",
        ),
        (
            {"blocks": [{"cells": [[3, 0], [9, 0]]}]},
            START,
            "(3, 0) is in block 1, which holds 1 of 1 robot: robot 1",
        ),
        (
            {"lifts": [LIFT]},
            START[:1],
            "(3, 0) is in lift 1, whose cabin is there for it in tick 5",
        ),
        ({"lifts": [LIFT]}, [[0, 0], [2, 0]], "(3, 0) is in lift 1, which is taken: robot 1"),
    ],
)
def test_what_keeps_a_robot_is_told_with_its_end(
    floor: dict[str, Any], start: Any, expected: str
) -> None:
    tick = 8 if "taken" in expected else 4 if expected.endswith("tick 5") else 5
    assert said(floor, tick, start=start).split(": ", 1)[1] == expected


def moment(floor: dict[str, Any], tick: int) -> Snapshot:
    return take_snapshot(watched(gate_scene(floor, (9, 0), picture=AISLE), tick))


def test_cells_that_are_shut_now() -> None:
    floor = {
        "closed": [{"cells": [[5, 0], [6, 0]], "from": 3, "for": 5}],
        "doors": [{"at": [9, 0], "opening_time": 2, "hold_open": 1}],
    }
    for tick, closed in ((2, []), (3, [5, 6]), (7, [5, 6]), (8, [])):
        cells, doors = shut_cells(moment(floor, tick))
        assert [cell % 12 - 1 for cell in cells] == closed
        assert [cell % 12 - 1 for cell in doors] == [9]
