"""Scenario files that are good: read, overridden, resolved."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from automaton.errors import InputError
from automaton.scenario.reading import read
from automaton.scenario.schema import LAYER_NAMES, Durations, Radius, Scenario
from automaton.scenario.text_files import shipped
from automaton.world.resolve import resolve

SMALL = """
name: small
layout:
  picture: |
    A.s
    ..d
fleet: {robots: 1}
"""


def written(folder: Path, text: str, name: str = "scenario.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", shipped())
def test_every_shipped_scenario_is_good_and_has_a_summary(name: str) -> None:
    resolved = resolve(name)
    assert resolved.scenario.name == name
    assert resolved.scenario.summary
    assert set(resolved.strategies) == set(LAYER_NAMES)


def test_the_first_tabletop_is_the_one_of_the_paper() -> None:
    resolved = resolve("tabletop-1")
    scenario = resolved.scenario
    assert scenario.durations == Durations(move=1, turn=22, pick=9, drop=9, try_drop=4)
    assert scenario.fleet.kinematics == "rail"
    assert resolved.start == "parking-bays"
    assert [choice.name for choice in resolved.strategies.values()] == [
        "none",
        "none",
        "cooperative",
        "shortest",
        "retreat",
    ]
    assert resolved.source == shipped()["tabletop-1"].read_text(encoding="utf-8")


def test_what_is_left_out_has_a_default(tmp_path: Path) -> None:
    resolved = resolve(written(tmp_path, SMALL))
    scenario = resolved.scenario
    assert scenario.seed == 1 and scenario.information == "everything"
    assert scenario.stop.when == "parked" and scenario.stop.max_duration == 50_000
    assert scenario.fleet.kinematics == "differential" and scenario.world.following
    assert scenario.orders.generator == "full-shelves"
    assert resolved.strategies["allocation"].name == "independent"


@pytest.mark.parametrize(
    ("row", "start"), [("A.s", "drawn"), ("b.s", "parking-bays"), ("..s", "random")], ids=str
)
def test_robots_start_where_drawn_else_in_bays_else_at_random(
    tmp_path: Path, row: str, start: str
) -> None:
    resolved = resolve(written(tmp_path, SMALL.replace("A.s", row)))
    expected = (resolved.floor_plan.cell(0, 0),) if start == "drawn" else start
    assert resolved.start == expected


def test_listed_orders_and_starts_keep_their_cells(tmp_path: Path) -> None:
    text = SMALL.replace("robots: 1", "robots: 2, start: [[1, 1], [0, 0]]")
    text += "orders: {list: [{from: [2, 0], to: [2, 1]}]}\n"
    resolved = resolve(written(tmp_path, text))
    assert resolved.start == (resolved.floor_plan.cell(1, 1), resolved.floor_plan.cell(0, 0))
    assert resolved.scenario.orders.listed is not None
    assert resolved.scenario.orders.listed[0].source == (2, 0)
    assert resolved.scenario.orders.listed[0].target == (2, 1)


def test_a_floor_may_lie_in_a_file_beside_the_scenario(tmp_path: Path) -> None:
    written(tmp_path, "A.x\n..d\n", "floor.txt")
    text = """
name: two files
layout: {file: floor.txt, legend: {x: {kind: shelf, loaded: true}}}
fleet: {robots: 1}
"""
    floor_plan = resolve(written(tmp_path, text)).floor_plan
    assert (floor_plan.width, floor_plan.height) == (3, 2)
    assert floor_plan.loads.flat[floor_plan.cell(2, 0)] == 1


@pytest.mark.parametrize(("found", "now"), [("true", "handover"), ("false", "none")])
def test_a_former_value_of_following_is_refused_with_its_present_name(found: str, now: str) -> None:
    with pytest.raises(InputError, match=f"found {found}; {found} is now {now}"):
        resolve("tabletop-1", [f"world.following={found}"])


def test_set_replaces_single_values_with_the_type_that_yaml_gives_them() -> None:
    resolved = resolve(
        "tabletop-1",
        [
            "fleet.robots=2",
            "layout.tables=3",
            "information.radius=4",
            "strategy.right_of_way.max_retries=5",
            "world.following=none",
        ],
        seed=7,
    )
    scenario = resolved.scenario
    assert (scenario.fleet.robots, scenario.seed, resolved.floor_plan.width) == (2, 7, 8)
    assert scenario.information == Radius(radius=4)
    assert scenario.world.following == "none"
    choice = resolved.strategies["right_of_way"]
    assert choice.name == "retreat", "the name that was there is kept"
    assert msgspec.to_builtins(choice.parameters)["max_retries"] == 5
    assert resolved.overrides[0] == "fleet.robots=2"


def test_set_reaches_into_lists(tmp_path: Path) -> None:
    text = SMALL.replace("robots: 1", "robots: 1, start: [[0, 0]]")
    resolved = resolve(written(tmp_path, text), ["fleet.start.0=[1, 1]"])
    assert resolved.start == (resolved.floor_plan.cell(1, 1),)


def test_a_scenario_object_resolves_to_the_same_as_its_file() -> None:
    from_file = resolve("tabletop-2")
    again = resolve(from_file.scenario)
    assert again.scenario == from_file.scenario
    assert again.strategies == from_file.strategies
    assert again.floor_plan is from_file.floor_plan, "equal floors are built once"


def test_a_scenario_written_out_and_read_again_is_the_same(tmp_path: Path) -> None:
    scenario = resolve("crossing").scenario
    path = tmp_path / "again.yaml"
    path.write_bytes(msgspec.yaml.encode(scenario))
    assert resolve(path).scenario == scenario


def test_many_runs_share_one_floor() -> None:
    scenario = resolve("tabletop-1").scenario
    plans = {id(resolve(scenario, seed=seed).floor_plan) for seed in range(200)}
    assert len(plans) == 1


def test_keys_are_taken_as_typed_and_anchors_may_be_used(tmp_path: Path) -> None:
    text = """
name: &title "007"
summary: *title
layout:
  picture: "A1s\\n.yd"
  legend: {1: {kind: floor}, y: {kind: charger}}
fleet: {robots: 1}
"""
    resolved = resolve(written(tmp_path, text))
    assert resolved.scenario.summary == "007"
    assert resolved.floor_plan.width == 3


def test_a_byte_order_mark_and_windows_lines_are_no_trouble(tmp_path: Path) -> None:
    path = tmp_path / "windows.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + SMALL.replace("\n", "\r\n").encode())
    assert resolve(path).floor_plan.width == 3


def test_the_scenario_is_a_valid_type_by_itself() -> None:
    scenario = Scenario.__struct_fields__
    assert scenario[:4] == ("name", "summary", "layout", "fleet")
    assert read("tabletop-1").data["fleet"]["robots"] == 4


def test_resolving_needs_no_numba() -> None:
    code = (
        "import sys; from automaton.world.resolve import resolve; resolve('tabletop-1');"
        "sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
