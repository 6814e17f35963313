"""Types of robots: what the validator catches in recordings, and what files may not say."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from handmade_recordings import E, W, played, rules

from automaton.engine.record_codes import CHANGE_DURATION
from automaton.errors import InputError
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.validator import validate_recording
from automaton.world.resolve import resolve

LANE = """\
s.....d
......."""
TYPES = [{"name": "tug", "robots": 1, "move_time_factor": 2, "payload": 3}, {"name": "shuttle"}]
SHUT = {"clean-room": {"from": [4, 0], "to": [5, 1], "closed_to": ["tug"]}}


def lane(**parts: Any) -> dict[str, Any]:
    """The header of a run of a tug at (1, 0) and a shuttle at (3, 1); the east is closed to the tug."""
    fleet = {"robots": 2, "kinematics": "omni", "start": [(1, 0), (3, 1)], "types": TYPES}
    scenario = {"name": "drawn", "layout": {"picture": LANE}, "fleet": fleet, "areas": SHUT}
    scenario["orders"] = {"list": [{"from": (0, 0), "to": (6, 0)}]}
    return MemoryRecorder(resolve(msgspec.convert({**scenario, **parts}, Scenario))).header


def test_a_robot_in_an_area_that_is_closed_to_its_type() -> None:
    assert played(lane(), {1: E}, {1: E}).valid
    report = played(lane(), {0: E}, {}, {0: E}, {}, {0: E})
    assert rules(report) == ["area"]
    assert "closed to robots of the type tug" in str(report.violations[0])


def test_a_move_shorter_than_the_pace_of_the_type() -> None:
    assert played(lane(), {0: E}, {}, {0: W}, {}).valid
    assert rules(played(lane(), {0: E}, {0: W}, {})) == ["busy"]
    extra = {"world": {"extra_tick_probability": 0.0, "slowdown": "zones"}}
    short = [(1, CHANGE_DURATION, 0, 1)]
    assert rules(played(lane(**extra), {0: E}, changes=short)) == ["move time"]


def test_a_load_too_heavy_for_its_robot() -> None:
    """The run is genuine; then the order is said to weigh more than the tug carries."""
    orders = {"list": [{"from": (0, 0), "to": (6, 0), "weight": 3}]}
    fleet = {"robots": 1, "kinematics": "omni", "start": [(1, 0)], "types": [{**TYPES[0]}]}
    scenario = {"name": "heavy", "layout": {"picture": LANE}, "fleet": fleet, "orders": orders}
    resolved = resolve(msgspec.convert(scenario, Scenario))
    recorder = MemoryRecorder(resolved)
    Simulation(resolved, on_record=recorder).run()
    recording = recorder.recording()
    assert validate_recording(recording.header, recording.frames).valid
    header = {**recording.header, "orders": {**recording.header["orders"], "weight": np.array([4])}}
    assert rules(validate_recording(header, recording.frames)) == ["payload"]
    assert any(kind == FRAME_KIND_TICKS for kind, _ in recording.frames)


FILE = """\
name: typed
layout:
  picture: |
    s.....d
    .......
fleet:
  robots: 2
  kinematics: omni
  start: [[1, 0], [3, 1]]
  types:
    - {name: tug, robots: 1, move_time_factor: 2, payload: 3}
    - {name: shuttle, payload: 5}
areas:
  clean-room: {from: [4, 1], to: [5, 1], closed_to: [tug]}
orders:
  list:
    - {from: [0, 0], to: [6, 0], weight: 2}
"""


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("name: shuttle", "name: tug", 10, ["fleet.types", "tug twice"]),
        (
            "robots: 1, move_time_factor",
            "robots: 2, move_time_factor",
            10,
            ["none is left for shuttle"],
        ),
        (
            "robots: 1, move_time_factor",
            "move_time_factor",
            10,
            ["all types but one", "tug or shuttle"],
        ),
        (
            "{name: shuttle,",
            "{name: shuttle, robots: 2,",
            10,
            ["list 3 robots", "fleet.robots is 2"],
        ),
        (
            "move_time_factor: 2",
            "move_time_factor: 0",
            11,
            ["move_time_factor must be a whole number from 1"],
        ),
        ("payload: 3", "size: 2", 11, ["size: a robot takes one cell", "units.cell"]),
        ("payload: 3", "kinematics: rails", 11, ["kinematics", "'rail'"]),
        ("payload: 3", "kinematics: rail", 11, ["tug drives on rails", "no tracks and no turn"]),
        ("payload: 3", "durations: {turn: 2}", 10, ["tug durations.turn", "omni robots do not"]),
        ("payload: 3", "durations: {move: {empty: 1}}", 11, ["'loaded' is missing"]),
        (
            "payload: 3",
            "durations: {serve: 1}",
            11,
            ["'serve'", "move, turn, pick, drop, try_drop"],
        ),
        ("name: tug", "name: empty", 10, ["a type empty: the word has another meaning in areas"]),
        (
            "closed_to: [tug]",
            "closed_to: [loded]",
            14,
            ["'loded'", "'loaded'", "all, empty, loaded"],
        ),
        (
            "[4, 1], to: [5, 1], closed_to: [tug]",
            "[4, 0], to: [4, 1], closed_to: [loaded]",
            17,
            ["the shelf at [0, 0] cannot be served", "areas cut off robots with its load"],
        ),
        ("payload: 3", "payload: 0", 11, ["payload must be a whole number from 1"]),
        ("closed_to: [tug]", "closed_to: [tig]", 14, ["'tig'", "'tug'", "tug, shuttle"]),
        ("closed_to: [tug]", "closed_to: []", 14, ["areas.clean-room.closed_to must name a type"]),
        ("closed_to: [tug]", "closed: [tug]", 14, ["unknown key 'closed'", "closed_to"]),
        ("to: [5, 1], closed", "to: [7, 1], closed", 14, ["[7, 1]", "outside the floor"]),
        ("from: [4, 1]", "from: [1, 0]", 9, ["robot 0", "[1, 0]", "clean-room", "closed to tug"]),
        ("weight: 2", "weight: 6", 17, ["order 0 weighs 6", "more than 5"]),
        (
            "[4, 1], to: [5, 1], closed_to: [tug]",
            "[6, 1], to: [5, 0], closed_to: [tug, shuttle]",
            1,
            ["(6, 0)", "cannot be served"],
        ),
    ],
)
def test_errors_say_where_and_what(
    tmp_path: Any, old: str, new: str, line: int, words: list[str]
) -> None:
    assert old in FILE
    path = tmp_path / "typed.yaml"
    path.write_text(FILE.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        resolve(path)
    for word in words:
        assert word in str(caught.value)
    if line > 1:
        assert f"typed.yaml:{line}:" in str(caught.value)


def test_an_order_that_only_a_weaker_type_could_reach(tmp_path: Any) -> None:
    """The tug carries it and may not go there, the shuttle may and is too weak."""
    path = tmp_path / "typed.yaml"
    text = FILE.replace("payload: 3}", "payload: 9}").replace("weight: 2", "weight: 6")
    path.write_text(text.replace("from: [4, 1]", "from: [5, 0]"))
    with pytest.raises(InputError, match=r"typed.yaml:17: order 0, of weight 6, ends at the dest"):
        resolve(path)


def test_weights_of_generated_orders_parts_and_files(tmp_path: Any) -> None:
    drawn = resolve("tabletop-1", ["orders.weight={from: 2, to: 4}"])
    weights = Simulation(drawn).world.orders.weight
    assert set(weights.tolist()) == {2, 3, 4}
    assert (
        weights.tolist() == Simulation(drawn, seed=drawn.scenario.seed).world.orders.weight.tolist()
    )
    parts = resolve("factory", ["orders.parts=[{route: [1, 2, 3], count: 2, weight: 7}]"])
    assert Simulation(parts).world.orders.weight.tolist() == [7] * 4
    (tmp_path / "orders.csv").write_text("released,weight,from_x,from_y,to_x,to_y\n0,3,0,0,6,0\n")
    path = tmp_path / "typed.yaml"
    listed = FILE[: FILE.index("orders:")] + "orders: {transports: {file: orders.csv}}\n"
    path.write_text(listed)
    assert Simulation(resolve(path)).world.orders.weight.tolist() == [3]
    (tmp_path / "orders.csv").write_text("released,weight,from_x,from_y,to_x,to_y\n0,0,0,0,6,0\n")
    with pytest.raises(InputError, match="weight must be a whole number from 1 to 1,000,000,000"):
        resolve(path)
