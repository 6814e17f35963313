"""What is read of VDMA LIF: types, layouts, speeds, curves, chargers, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from lif_layouts import lif, write

from automaton.errors import InputError
from automaton.exchange.graphs.graph import Graph
from automaton.exchange.graphs.lif import read_lif

NODES = {"A": (0.0, 0.0), "B": (4.0, 0.0), "C": (4.0, 3.0)}


def graph(folder: Path, data: dict[str, Any], **chosen: str) -> Graph:
    """Read a layout."""
    return read_lif(write(folder, data), **chosen)


def refusal(folder: Path, data: dict[str, Any], **chosen: str) -> str:
    """The sentence about a layout that is not read."""
    with pytest.raises(InputError) as caught:
        graph(folder, data, **chosen)
    return caught.value.message


def first(layout: dict[str, Any], part: str) -> dict[str, Any]:
    """The first node, edge or station of a layout."""
    found: dict[str, Any] = layout["layouts"][0][part][0]
    return found


def test_edges_of_other_types_are_left_out_and_counted(tmp_path: Path) -> None:
    layout = lif(NODES, ["A=B", "B=C"], B_C={"vehicleTypeId": "truck"})
    assert "set --type; the types are tug, truck" in refusal(tmp_path, layout)
    read = graph(tmp_path, layout, robot_type="tug")
    assert [edge.name for edge in read.edges] == ["A-B", "B-A", "C-B"]
    assert read.lost["edges of other types"] == 1 and read.type == "tug"
    text = refusal(tmp_path, layout, robot_type="tog")
    assert text == "has no type 'tog' (did you mean 'tug'?); the types are tug, truck"


def test_of_several_layouts_one_is_chosen(tmp_path: Path) -> None:
    layout = lif(NODES, ["A=B", "B=C"])
    upper = lif({"D": (0, 0), "E": (2, 0)}, ["D=E", "E-A"])["layouts"][0]
    layout["layouts"].append(upper | {"layoutId": "upper"})
    assert "set --layout; the layouts are ground, upper" in refusal(tmp_path, layout)
    read = graph(tmp_path, layout, layout="upper")
    assert [node.name for node in read.nodes] == ["D", "E"]
    assert read.lost["edges to other layouts"] == 1 and read.lost["other layouts"] == 1


def test_a_curve_counts_with_its_length(tmp_path: Path) -> None:
    points = [{"x": 0.0, "y": 0.0}, {"x": 2.0, "y": 2.0}, {"x": 4.0, "y": 0.0}]
    curve: dict[str, Any] = {"degree": 1, "knotVector": [0, 0, 1, 2, 2], "controlPoints": points}
    read = graph(tmp_path, lif(NODES, ["A=B"], A_B={"trajectory": curve}))
    assert [edge.metres for edge in read.edges] == pytest.approx([2 * 8**0.5, 4.0])
    curve["knotVector"] = [0, 1]
    read = graph(tmp_path, lif(NODES, ["A=B"], A_B={"trajectory": curve}))
    assert read.edges[0].metres == 4.0
    assert read.lost["trajectory that is not a NURBS (straight instead)"] == 1


def test_load_restrictions_and_closed_edges(tmp_path: Path) -> None:
    layout = lif(
        NODES,
        ["A=B", "B=C"],
        A_B={"loadRestriction": {"loaded": False, "unloaded": True}},
        B_A={"loadRestriction": {"loaded": False, "unloaded": False}},
        B_C={"maxSpeed": 0},
        C_B={"loadRestriction": {"loaded": True, "unloaded": False}},
    )
    read = graph(tmp_path, layout)
    assert [(edge.name, edge.closed_to) for edge in read.edges] == [
        ("A-B", "loaded"),
        ("C-B", "empty"),
    ]
    assert read.lost["edges that are closed"] == 2


def test_robots_charge_where_they_may_start_charging(tmp_path: Path) -> None:
    layout = lif(NODES, ["A=B", "B=C"])
    actions = [{"actionType": "startCharging"}, {"actionType": "pick"}]
    first(layout, "nodes")["vehicleTypeNodeProperties"] = [
        {"vehicleTypeId": "tug", "actions": actions, "theta": 1.0}
    ]
    read = graph(tmp_path, layout)
    assert read.chargers == {0} and read.lost["action pick"] == 1 and read.lost["theta"] == 1


def test_unknown_keys_are_counted_wherever_they_are(tmp_path: Path) -> None:
    layout = lif(NODES, ["A=B", "B=C"], A_B={"colour": "red"}, C_B={"colour": {"of": "paint"}})
    layout["made"] = layout["metaInformation"]["on"] = {"a": "Monday"}
    layout["layouts"][0]["owner"] = first(layout, "nodes")["label"] = "me"
    lost = graph(tmp_path, layout).lost
    assert lost == {"colour": 2, "owner": 1, "label": 1, "made": 1, "on": 1}


def test_nodes_without_an_edge_are_left_out(tmp_path: Path) -> None:
    layout = lif({**NODES, "Z": (9.0, 9.0)}, ["A=B", "B=C"], {"P": ["Z"], "Q": ["C", "Z"]})
    read = graph(tmp_path, layout)
    assert [node.name for node in read.nodes] == ["A", "B", "C"]
    assert [(one.name, one.nodes) for one in read.stations] == [("Q", (2,))]
    assert read.lost["nodes without an edge"] == read.lost["stations without an edge"] == 1


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('"x": 4.0', '"x": "4"', "Expected `float`, got `str` - at `nodes[1].nodePosition.x` (B)"),
        ('"x": 4.0', '"x": NaN', "is not JSON: invalid character at 'NaN'"),
        ('"x": 4.0', '"x": 1e999', "is not JSON: Number out of range"),
        ('"x": 4.0', '"x": 1e200', "the node B is at x 1e+200, y 0; at most 1e+09 m are allowed"),
        ('"x": 4.0, "y": 3.0', '"x": 4.0, "y": 0.0', "the nodes B and C are both at x 4, y 0"),
        ('"endNodeId": "C"', '"endNodeId": "Q"', "names the node Q, which does not exist"),
        ('"nodeId": "C"', '"nodeId": "B"', "the node B appears twice"),
        ('["C"]', '["Q"]', "the station P names the node Q, which is not in the layout"),
        ('"maxSpeed": 1.0', '"maxSpeed": -1', "has a speed of -1 m/s; 0 to 1000 are allowed"),
        ('"edgeId": "A-B", ', "", "missing required field `edgeId` - at `edges[0]`"),
        ('"1.0.0"', '"3.0.0"', "lifVersion '3.0.0' is not known; 1.0.0 and 2.0.0 are"),
        ('"vehicleTypeId": "tug", ', "", "no edge names a type of robot"),
        ('"nodes": [', '"nodes": [' + "[" * 5000, "is n"),
    ],
)
def test_a_mistake_is_a_sentence(old: str, new: str, sentence: str, tmp_path: Path) -> None:
    text = json.dumps(lif(NODES, ["A=B", "B=C"], {"P": ["C"]}))
    assert old in text
    path = tmp_path / "site.lif"
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError) as caught:
        read_lif(path)
    assert sentence in caught.value.message


def test_too_much_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "site.lif"
    path.write_text('{"layouts": [' + "{}," * 1_000_001 + "{}]}")
    with pytest.raises(InputError, match="has more than 1,000,000 objects and lists"):
        read_lif(path)
