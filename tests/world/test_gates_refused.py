"""Gates that do not fit their floor are refused in a sentence; those that may be a mistake, warned of."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import msgspec
import pytest
from gate_scenes import gate_scenario, gate_scene

from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.schema import Scenario
from automaton.world import gates
from automaton.world.building import build_world
from automaton.world.gate_cells import mouths_of
from automaton.world.resolve import resolve
from automaton.world.scenario_warnings import scenario_warnings

HALLS = """\
......
.####.
......"""
LIFT = "travel_time: 9"


@pytest.mark.parametrize(
    ("floor", "said"),
    [
        ("{closed: [{cells: [[9, 0]], from: 1, for: 2}]}",
         ["closing 1 has the cell [9, 0], outside the floor of 6 x 3 cells"]),
        ("{closed: [{cells: {from: [0, 0], to: [0, 7]}, from: 1, for: 2}]}", ["[0, 7]"]),
        ("{closed: [{cells: [[0, 0], [2, 2]], from: 1, for: 2}]}",
         ["from [0, 0] to [2, 2]: along neither a row nor a column"]),
        ("{closed: [{cells: [[1, 1]], from: 1, for: 2}]}", ["no cell in which robots can stand"]),
        ("{closed: [{cells: [[0, 0]], for: 2}]}", ["needs from"]),
        ("{closed: [{cells: [[0, 0]], from: 1, for: 9, every: 9}]}", ["for (9)", "every (9)"]),
        ("{closed: [{cells: [[0, 0]], from: 1, for: 2, every: {mean: 9}}]}", ["from belongs"]),
        ("{closed: [{cells: [[0, 0]], from: 1, for: {uniform: {from: 1, to: 2}}}]}", ["scheduled"]),
        ("{closed: [{cells: [[0, 0]], from: 1, fro: 2}]}", ["did you mean"]),
        ("{doors: [{at: [1, 1], opening_time: 2, hold_open: 1}]}", ["door 1 has no cell"]),
        ("{doors: [{at: [[0, 0], [1, 0]], opening_time: 2, hold_open: 1}]}", ["floor.doors[0].at"]),
        ("{doors: [{at: [0, 0], opening_time: 0, hold_open: 1}]}", ["opening_time", "found 0"]),
        ("{blocks: [{cells: [[0, 0]], max_robots: 0}]}", ["max_robots", "found 0"]),
        ("{blocks: [{cells: [[0, 0], [0, 2], [5, 2], [5, 0]], direction: both}]}", ["found 'both'"]),
        ("{blocks: [{cells: [[0, 1], [2, 1]], direction: same}]}",
         ["must be a path, but [1, 1] is a cell of kind wall"]),
        ("{blocks: [{cells: {from: [0, 0], to: [5, 0]}}]}", ["begin in block 1, which holds at most 1"]),
        (f"{{lifts: [{{shaft: [[1, 0], [4, 0]], {LIFT}}}, {{shaft: [[3, 0], [5, 0]], {LIFT}}}]}}",
         ["lift 2 and lift 1 both contain the cell [3, 0]"]),
        (f"{{lifts: [{{shaft: [[1, 0], [1, 2]], {LIFT}}}]}}", ["must be a path, but [1, 1]"]),
        (f"{{lifts: [{{shaft: [[1, 0]], {LIFT}}}]}}", ["only one cell"]),
        ("{lifts: [{shaft: [[0, 0], [4, 0]], travel_time: 3}]}", ["less than the 4 moves"]),
        ("{lifts: [{shaft: [[0, 0], [1, 0]], travel_time: 65536}]}",
         ["a move in lift 1 takes 65,536 ticks, its share of travel_time; at most 65,535"]),
        ("{lifts: [{shaft: [[0, 0], [0, 2]], travel_time: 131071}]}",
         ["a move in lift 1 takes 65,536 ticks"]),
        (f"{{lifts: [{{shaft: [[0, 0], [5, 0], [5, 2], [0, 2], [0, 1]], {LIFT}}}]}}",
         ["no way out"]),
        ("{levels: {ground: {from: [0, 0], to: [6, 0]}}}", ["[6, 0] of the level ground"]),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(tmp_path: Path, floor: str, said: list[str]) -> None:
    file = tmp_path / "gates.yaml"
    picture = "\n".join(f"    {row}" for row in HALLS.split("\n"))
    file.write_text(
        f"name: gates\nlayout:\n  picture: |\n{picture}\n"
        "fleet: {robots: 2, kinematics: omni, start: [[2, 0], [3, 0]]}\n"
        "orders: {list: [{stops: [[5, 2]]}]}\n"
        f"floor: {floor}\n"
    )
    with pytest.raises(InputError) as refused:
        build_world(resolve(str(file)), 1)
    sentence = str(refused.value)
    for text in said:
        assert text in sentence
    assert "\n" not in sentence


def test_moves_in_a_lift_take_all_ticks_that_moves_may() -> None:
    floor = {"lifts": [{"shaft": [[1, 0], [3, 0]], "travel_time": 2 * 65_535}]}
    world, _ = build_world(gate_scene(floor, (5, 0)), 1)
    assert world.gates.cabin_ticks.max() == 65_535


def test_the_mouths_of_a_lift_are_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []

    def counted(shaft: list[int], floor_plan: FloorPlan) -> list[int]:
        calls.append(len(shaft))
        return mouths_of(shaft, floor_plan)

    scene = gate_scene({"lifts": [{"shaft": [[1, 0], [6, 0]], "travel_time": 9}]}, (7, 0))
    monkeypatch.setattr(gates, "mouths_of", counted)
    build_world(scene, 1)
    assert calls == [6]


def test_no_robot_begins_or_parks_in_a_lift() -> None:
    floor = {"lifts": [{"shaft": [[1, 0], [4, 0]], "travel_time": 9}]}
    with pytest.raises(InputError, match=r"begin or park at \[1, 0\], in lift 1"):
        gate_scene(floor, (5, 0), start=[[1, 0], [0, 0]])


def test_robots_drawn_into_cells_leave_lifts_free_and_blocks_within_what_they_hold() -> None:
    """Of 14 cells a lift has four, and a block for two has six."""
    floor = {
        "lifts": [{"shaft": [[1, 0], [4, 0]], "travel_time": 9}],
        "blocks": [{"cells": {"from": [0, 2], "to": [5, 2]}, "max_robots": 2}],
    }
    fleet = {"robots": 6, "kinematics": "omni", "start": "random"}
    scene = gate_scene(floor, (5, 0), picture=HALLS, fleet=fleet)
    for seed in range(20):
        build_world(scene, seed)
    with pytest.raises(InputError, match="too few cells are open to"):
        gate_scene(floor, (5, 0), picture=HALLS, fleet=fleet | {"robots": 7})


def test_more_closings_than_a_run_may_have() -> None:
    stop = {"when": "never", "max_duration": 2_000_000_000}
    closed = {"cells": [[3, 0]], "from": 0, "for": 1, "every": 2}
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="cells close 1,000,000,001 times"):
            gate_scene({"closed": [closed]}, (5, 0), stop=stop)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 100_000_000, "bytes: none of them is stored before they are counted"


def test_more_closings_by_chance_than_a_run_may_have() -> None:
    stop = {"when": "never", "max_duration": 2_000_000_000}
    closed = {"cells": [[3, 0]], "for": 1, "every": {"mean": 2}}
    with pytest.raises(InputError, match=r"cells close 4,\d{3},\d{3} times"):
        gate_scene({"closed": [closed]}, (5, 0), stop=stop)


WITH_CHARGER = """\
......c
.####..
......."""


@pytest.mark.parametrize(
    ("gate", "warned"),
    [
        ({"doors": [{"at": [3, 0], "opening_time": 2, "hold_open": 1}]}, False),
        ({"doors": [{"at": [0, 1], "opening_time": 2, "hold_open": 1}]}, False),
        ({"blocks": [{"cells": {"from": [5, 0], "to": [6, 1]}}]}, True),
        ({"closed": [{"cells": [[5, 0], [6, 0]], "from": 5, "for": 9}]}, False),
    ],
)
def test_a_gate_on_the_only_way_to_a_charger_is_warned_of(
    gate: dict[str, Any], warned: bool
) -> None:
    battery = {"drain": {"move": 0.1, "wait": 0.01}, "charge_rate": 1.0}
    scenario = gate_scenario(gate, (5, 2), picture=WITH_CHARGER, battery=battery)
    sentences = scenario_warnings(resolve(msgspec.convert(scenario, Scenario)))
    found = [text for text in sentences if "only route to a charger" in text]
    assert found == (
        [
            "block 1 is on the only route to a charger: robots may run out of charge while they wait "
            "for it"
        ]
        if warned
        else []
    )


@pytest.mark.parametrize(
    ("travel_time", "drain", "picture", "said"),
    [
        (20, {"move": 6.0}, "c.......", "takes 120 % of a battery from one mouth to the next"),
        (20, {"move": 6.0}, "....c...", "takes 120 % of a battery from one mouth to the next"),
        (20, {"move": 5.0}, "c.......", ""),
        (
            20,
            {"move": 4.0, "loaded_factor": 1.5},
            "c.......",
            "robots with a load run out of charge there",
        ),
        (20, {"move": 6.0}, ".....c..", ""),
        (40, {"move": 6.0}, ".....c..", "takes 120 % of a battery in one move"),
    ],
)
def test_a_lift_that_empties_batteries_is_warned_of(
    travel_time: int, drain: dict[str, Any], picture: str, said: str
) -> None:
    """It has two moves; the charger of the last two floors lies between them."""
    lift = {"lifts": [{"shaft": [[4, 0], [6, 0]], "travel_time": travel_time}]}
    battery = {"drain": drain, "charge_rate": 1.0}
    scenario = gate_scenario(lift, (7, 0), picture=picture, battery=battery)
    sentences = scenario_warnings(resolve(msgspec.convert(scenario, Scenario)))
    found = [text for text in sentences if "lift 1 takes" in text]
    assert len(found) == bool(said)
    assert said in "".join(found)
