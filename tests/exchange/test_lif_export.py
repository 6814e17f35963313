"""Floors as layouts of VDMA LIF: nodes, edges, speeds, and that an import gives the floor again.

The project ships no schema. With AUTOMATON_SCHEMAS, a folder that holds `LIF.schema` as published,
files of version 1.0.0 are also checked by it.
"""

from __future__ import annotations

import json
import os
import random
from fractions import Fraction
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.exchange.graphs.import_graph import import_lif
from automaton.exchange.imported_floor import ImportOptions
from automaton.exchange.lif_export import LIF_VERSIONS, floor_graph, lif_file
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import CHARGER, STATION, FloorPlan
from automaton.scenario.text_files import shipped
from automaton.world.floor_parts import all_station_names
from automaton.world.resolve import Resolved, resolve

SITE = """\
name: site
layout:
  legend: {z: {kind: charger, opens: [south]}}
  picture: |
    z####
    v<<<<
    v###^
    >>>>.t
fleet: {robots: 1, kinematics: omni, start: [[0, 1]]}
units: {tick: 0.5 s, cell: 0.8 m}
durations: {move: 2}
floor: {speed_limits: [{cells: [[4, 3], [5, 3]], max_speed: 0.4 m/s}]}
locations: {packing: [5, 3]}
orders: {list: [{stops: [[1, 1]]}]}
"""


def written(folder: Path, text: str) -> Resolved:
    """A scenario of a text."""
    (folder / "floor.yaml").write_text(text)
    return resolve(str(folder / "floor.yaml"))


def layout_of(resolved: Resolved, version: str = "2.0.0") -> dict[str, Any]:
    """The only layout of a scenario's file."""
    names = all_station_names(resolved.scenario, resolved.floor_plan)
    data = lif_file(resolved.scenario, resolved.floor_plan, names, version).data
    layouts = data["layouts"] if version == "1.0.0" else data["origins"][0]["layouts"]
    found: dict[str, Any] = layouts[0]
    assert data["metaInformation"]["lifVersion"] == version and len(layouts) == 1
    return found


def imported(resolved: Resolved, folder: Path, version: str = "2.0.0") -> FloorPlan:
    """The floor of a scenario after it was exported and imported."""
    names = all_station_names(resolved.scenario, resolved.floor_plan)
    data = lif_file(resolved.scenario, resolved.floor_plan, names, version).data
    schemas = os.environ.get("AUTOMATON_SCHEMAS")
    if schemas and version == "1.0.0":
        jsonschema.validate(data, json.loads((Path(schemas) / "LIF.schema").read_text()))
    (folder / "floor.lif").write_text(json.dumps(data))
    scale = resolved.scenario.units.scale
    time = resolved.scenario.units.scale.unit.seconds is not None
    options = ImportOptions(
        cell=scale.cell_metres,
        tick=scale.tick_seconds if time else None,
        speed=None if time else Fraction(1),
    )
    floor = import_lif(folder / "floor.lif", options)
    assert not floor.report.refusal
    for name, text in floor.files("again").items():
        (folder / name).write_text(text)
    return resolve(str(folder / "again.yaml")).floor_plan


def ways(plan: FloorPlan) -> dict[str, Any]:
    """What LIF knows of a floor, cropped to the cells that ways connect."""
    nodes = {plan.xy(cell) for edge in floor_graph(plan).edges for cell in (edge.start, edge.end)}
    x, y = (min(place[axis] for place in nodes) for axis in (0, 1))
    u, v = (max(place[axis] for place in nodes) for axis in (0, 1))
    part = (slice(y + 1, v + 2), slice(x + 1, u + 2))
    joined = {(a - x, b - y) for a, b in nodes}
    return {
        "exits": plan.exits[part].tolist(),
        **{
            name: [
                place
                for place in np.argwhere((plan.kind[part] == kind).T).tolist()
                if tuple(place) in joined
            ]
            for name, kind in (("stations", STATION), ("chargers", CHARGER))
        },
    }


def test_nodes_are_where_something_can_be_decided(tmp_path: Path) -> None:
    layout = layout_of(written(tmp_path, SITE))
    names = [node["nodeId"] for node in layout["nodes"]]
    assert names == ["0_0", "0_1", "4_1", "0_3", "4_3", "5_3"]
    position = {node["nodeId"]: node["nodePosition"] for node in layout["nodes"]}
    assert position["0_3"] == {"x": 0.4, "y": 0.4} and position["5_3"] == {"x": 4.4, "y": 0.4}
    assert position["0_0"] == {"x": 0.4, "y": 2.8}
    speed = {
        edge["edgeId"]: edge["mobileRobotTypeEdgeProperties"][0]["maximumSpeed"]
        for edge in layout["edges"]
    }
    assert speed == {
        **dict.fromkeys(("0_0-0_1", "0_1-0_0", "0_1-0_3", "0_3-4_3", "4_1-0_1", "4_3-4_1"), 0.8),
        **dict.fromkeys(("4_3-5_3", "5_3-4_3"), 0.4),
    }
    assert layout["stations"] == [{"stationId": "packing", "interactionNodeIds": ["5_3"]}]
    actions = [
        node["nodeId"]
        for node in layout["nodes"]
        for one in node["mobileRobotTypeNodeProperties"]
        if [a["actionType"] for a in one.get("feasibleActions", ())] == ["startCharging"]
    ]
    assert actions == ["0_0"]


@pytest.mark.parametrize("version", LIF_VERSIONS)
def test_an_import_gives_the_site_again_with_its_speed_limit(version: str, tmp_path: Path) -> None:
    resolved = written(tmp_path, SITE)
    plan, again = resolved.floor_plan, imported(resolved, tmp_path, version)
    assert ways(again) == ways(plan)
    limits = [np.maximum(one.min_move_ticks, 2) for one in (plan, again)]
    assert (limits[0] == limits[1]).all() and limits[0].max() == 4
    scenario = resolve(str(tmp_path / "again.yaml")).scenario
    assert scenario.locations["packing"] == (5, 3) and scenario.durations.moves == (2, 2)


def test_a_cell_where_moves_become_slower_is_a_node(tmp_path: Path) -> None:
    ring = SITE.replace("[[4, 3], [5, 3]]", "[[1, 3], [3, 3]]")
    layout = layout_of(written(tmp_path, ring))
    assert {"1_3", "3_3"} <= {node["nodeId"] for node in layout["nodes"]}
    assert "2_3" not in {node["nodeId"] for node in layout["nodes"]}


CAPACITY_ONE = {
    *(
        "bad-day",
        "factory-single",
        "goods-60x40",
        "goods-mini",
        "goods-to-person",
        "random-400",
        "sorting",
    ),
    *("tabletop-1", "tabletop-2", "tabletop-mini"),
}


@pytest.mark.parametrize("name", shipped())
def test_shipped_floors_come_back_or_are_refused_by_name(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    resolved = resolve(name)
    if resolved.scenario.units.cell is None:
        resolved = resolve(name, ["units.cell=1 m"])
    plan = resolved.floor_plan
    one_robot = (plan.capacity[plan.drivable] == 1).all()
    assert one_robot == (name in CAPACITY_ONE)
    if one_robot:
        again = imported(resolved, tmp_path)
        assert ways(again) == ways(plan)
        return
    out = tmp_path / "floor.lif"
    assert main(["export", name, "--lif", str(out), "--set", "units.cell=1 m"]) == 2
    assert f"{name}: " in (error := capsys.readouterr().err) and "more than one robot" in error
    assert not out.exists()


@pytest.mark.parametrize("seed", range(30))
def test_random_floors_come_back(seed: int, tmp_path: Path) -> None:
    draw = random.Random(seed)
    width, height = draw.randint(2, 8), draw.randint(2, 8)
    symbols = draw.choice((".....#", "..><^v", "...tc#", "><^v.#"))
    picture = "\n".join("".join(draw.choices(symbols, k=width)) for _ in range(height))
    plan = draw_floor(picture)
    if not floor_graph(plan).edges:
        return
    text = SITE[: SITE.index("layout:")] + "layout:\n  picture: |\n"
    text += "".join(f"    {row}\n" for row in picture.split("\n"))
    text += (
        "fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}\nunits: {tick: 1 s, cell: 2.5 ft}\n"
    )
    text += "orders: {list: [{stops: [[0, 0]]}]}\n"
    (tmp_path / "floor.yaml").write_text(text)
    scenario = Resolved(scenario_of(text), plan, {}, "random", "")
    try:
        again = imported(scenario, tmp_path)
    except InputError as error:
        assert "no robot could return" in error.message
        return
    assert ways(again) == ways(plan), picture


def scenario_of(text: str) -> Any:
    """A scenario, unchecked against its floor."""
    import msgspec
    import yaml

    from automaton.scenario.schema import Scenario

    return msgspec.convert(yaml.safe_load(text), Scenario)


def test_what_cannot_be_exported_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "floor.yaml").write_text(SITE)
    source, out = str(tmp_path / "floor.yaml"), str(tmp_path / "floor.lif")
    for arguments, sentence in (
        ([source, "--lif", source], "cannot write it"),
        (
            [source, "--lif", out, "--version", "2.1.0"],
            "--version 2.1.0 is not supported (did you mean",
        ),
        (["random-400", "--lif", out], "the size of a cell is unknown; set units.cell"),
        (["goods-mine", "--lif", out], "did you mean 'goods-mini'?"),
        ([source, "--planviz", out, "--set", "seed=2"], "--set needs --lif"),
        ([source, "--lif", out, "--every", "1s"], "--every needs --vda5050"),
        ([source, "--lif", out, "--planviz", out], "not allowed with argument"),
        ([str(tmp_path), "--lif", out], "is a folder"),
    ):
        assert main(["export", *arguments]) == 2, arguments
        assert sentence in capsys.readouterr().err
    assert not Path(out).exists()


def test_the_command_says_what_is_not_in_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "floor.lif"
    assert main(["export", "goods-mini", "--lif", str(out), "--version", "1.0.0"]) == 0
    printed = capsys.readouterr().out
    assert "VDMA LIF 1.0.0, 15 nodes, 26 edges, cells of 1 m" in printed
    assert "left out: storage (ways over it are kept) 5" in printed
    assert json.loads(out.read_text())["metaInformation"]["exportTimestamp"].endswith("Z")


def test_closed_moves_have_no_edge_and_weights_are_left_out(tmp_path: Path) -> None:
    streets = (
        "streets: [{path: [[1, 3], [2, 3]], back: 2}, {path: [[3, 3], [4, 3]], back: closed}]\n"
    )
    two_way = SITE.replace(">>>>.t", ".....t") + streets
    resolved = written(tmp_path, two_way)
    assert not imported(resolved, tmp_path).exits[4, 5] >> 2 & 1  # west from [4, 3]
    names = all_station_names(resolved.scenario, resolved.floor_plan)
    exported = lif_file(resolved.scenario, resolved.floor_plan, names, "2.0.0")
    assert exported.lost["weights of streets"] == 1
