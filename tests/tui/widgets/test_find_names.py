"""What people name is found: locations, doors, lifts, blocks, orders, lines and SKUs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from gate_scenes import gate_scene
from pod_scenes import pod_scene

from automaton.errors import InputError
from automaton.history.event_history import EventHistory
from automaton.history.snapshot import take_snapshot
from automaton.runs.simulation import Simulation
from automaton.world.resolved import Resolved
from tui.screens.find_dialog import find

CELLS = [[2, 1], [3, 1], [4, 1], [5, 1]]
SKUS = (["nuts"], ["nuts", "bolts"], ["tape"], [])
LINES: list[dict[str, Any]] = [
    {"pod": 3, "station": "P1", "order": "A-17"},
    {"sku": "nuts", "station": "P1", "order": "B-4", "release": 50},
]


def view(resolved: Resolved, ticks: int) -> Any:
    """What find reads of a view."""
    run = Simulation(resolved, on_observe=EventHistory())
    run.run(ticks)
    plan = resolved.floor_plan
    return SimpleNamespace(
        snapshot=take_snapshot(run), run=SimpleNamespace(resolved=resolved), floor_plan=plan
    )


def gates() -> Any:
    floor = {
        "doors": [
            {"at": [2, 0], "opening_time": 3, "hold_open": 5},
            {"at": [6, 0], "opening_time": 3, "hold_open": 5},
        ],
        "blocks": [{"cells": {"from": [4, 0], "to": [5, 0]}}],
    }
    return view(gate_scene(floor, (7, 0), locations={"Packing": [3, 0]}), 1)


def goods(ticks: int) -> Any:
    listed = [{"at": at, "skus": skus} for at, skus in zip(CELLS, SKUS, strict=True)]
    return view(pod_scene(LINES, pods={"list": listed}), ticks)


@pytest.mark.parametrize(
    ("words", "columns"),
    [
        ("door 2", [6]),
        ("doors", [2, 6]),
        ("block 1", [4, 5]),
        ("lifts", []),
        ("packing", [3]),
    ],
)
def test_gates_and_locations_are_cells(words: str, columns: list[int]) -> None:
    there = gates()
    assert find(words, there).cells == tuple(there.floor_plan.cell(x, 0) for x in columns)


def test_an_order_is_where_the_pods_of_its_lines_are() -> None:
    """Pod 3 is far: it still stands in tick 1, and is under way in tick 20."""
    stands, carried = goods(1), goods(20)
    cell = stands.floor_plan.cell(*CELLS[2])
    for words in ("order A-17", "order 0", "line 0"):
        assert find(words, stands).cells == (cell,)
        assert find(words, carried).robots == (0,)


def test_a_sku_is_where_it_lies() -> None:
    there = goods(1)
    held = tuple(there.floor_plan.cell(*cell) for cell in CELLS[:2])
    assert find("sku nuts", there).cells == find("order b-4", there).cells == held


@pytest.mark.parametrize(
    ("words", "there", "sentence"),
    [
        ("door 3", gates, "there is no door 3; doors are numbered from 1 to 2"),
        ("lift 1", gates, "there is no lift 1; there are no lifts"),
        ("line 2", lambda: goods(1), "there is no line 2; lines are numbered from 0 to 1"),
        ("order a-71", lambda: goods(1), "there is no order a-71 (did you mean 'A-17'?)"),
        ("sku glue", lambda: goods(1), "there is no sku glue; no line names it"),
    ],
)
def test_what_is_not_there_is_said_with_what_is(words: str, there: Any, sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        find(words, there())
    assert str(caught.value) == sentence
